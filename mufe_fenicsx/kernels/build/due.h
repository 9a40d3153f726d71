/* Pairs that can have closed, and early loads of what their evaluation reads.

   Between two steps the tetrahedra stream through the caches, so that what pairs read, scattered
   over many arrays, comes from memory; what is asked for some pairs ahead comes together. It is
   asked for in the second cache: the pairs ahead would leave little of the first to the present. */

#ifndef MUFE_DUE_H
#define MUFE_DUE_H

#include "vectors.h"

#define AHEAD 8               /* pairs ahead of the present one whose nodes are asked for */
#define FAR_AHEAD (4 * AHEAD) /* and whose rows are, which tell the nodes */
#define FETCH(address) __builtin_prefetch(address, 0, 2)
/* Of a row of three numbers, which may lie in two cache lines. */
#define FETCH_ROW(rows, n) (FETCH((rows) + 3 * (int64_t)(n)), FETCH((rows) + 3 * (int64_t)(n) + 2))

/* List the pairs whose ``next_check`` their bound, number ``of[p]``, has reached; how many. */
INLINE int64_t find_due(int32_t *pairs, const double *next_check, const double *bounds,
                        const int32_t *of, int64_t num) {
  int64_t count = 0;
  for (int64_t p = 0; p < num; p++) {
    pairs[count] = (int32_t)p;
    count += next_check[p] <= bounds[of[p]];
  }
  return count;
}

/* The same in two lists, those that are to be ``early`` and the others. */
INLINE int64_t find_both(int32_t *pairs, int32_t *others, int64_t *num_others,
                         const double *next_check, const double *bounds, const int32_t *of,
                         const uint8_t *early, int64_t num) {
  int64_t count = 0, rest = 0;
  for (int64_t p = 0; p < num; p++) {
    const int is_due = next_check[p] <= bounds[of[p]];
    pairs[count] = others[rest] = (int32_t)p;
    count += is_due & early[p];
    rest += is_due & !early[p];
  }
  *num_others = rest;
  return count;
}

#endif
