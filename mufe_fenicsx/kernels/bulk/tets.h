/* What the loops over linear tetrahedra have in common: packed nodes, one grain, the model. */

#ifndef TETS_H
#define TETS_H

#include "lanes.h"

enum { PLAIN, AVERAGED };

/* Increment of the plastic strain of one element, see kernels/bulk/hardening.py. */
typedef double (*law_type)(double q, double mean, double alpha, double dt, double shear,
                           const double *parameters);

/* One node: x y z and pressure; half the displacement of this step and nothing. The positions are
   those of the end of the step in sums of volumes, of its middle in the batches. Where the deviator
   follows from the stretch: the displacement since the first places, and these in the batches. */
typedef struct {
  v4 x, d;
} node_type;

typedef struct {
  const node_type *node;                       /* of node 0 of the rank, were it in this grain */
  v4 *force;                                   /* likewise */
  const int32_t *cells;                        /* of the first element */
  double *deviator, *strain, *work, *pressure; /* of the first element */
  const double *volume0;
  double dt, bulk, shear, own; /* own: resists the element's own volume */
  const double *parameters;    /* of the law */
  const double *segments;      /* slope of each segment of the table, then 1/(3 G + slope) */
  law_type law;
} grain_type;

#define NODE(n) (g->node + (uint32_t)(n))
#define FORCE(n) g->force[(uint32_t)(n)]

/* What stays the same from step to step, in the order of kernels/bulk/solid.py. */
typedef struct {
  const int32_t *cells;
  const double *volume0;
  const int64_t *cell_offset, *first_node, *num_nodes;
  const double *node_volume0, *bulk, *shear, *own, *parameters;
  double *segments, *scratch, *pressure;
} model_type;

#endif
