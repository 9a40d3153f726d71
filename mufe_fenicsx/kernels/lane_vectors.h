/* Vectors in space of several lanes at once, as vectors.h has them of one. */

#ifndef LANE_VECTORS_H
#define LANE_VECTORS_H

#include <stddef.h>

#include "lanes.h"
#include "vectors.h"

/* Where a member of ``state_type`` stands in its row of numbers; and whether flags of it are set,
   in the number that holds their bytes. */
#define IN_ROW(name) ((int)(offsetof(state_type, name) / sizeof(double)))
#define FLAG(word, name) ((mask)-((word) >> (8 * (int)(offsetof(state_type, name) % 8)) & 1))
/* Whether pairs are worked on together; the results are the same to rounding. */
#ifndef TOGETHER
#define TOGETHER 1
#endif

typedef struct {
  vec x, y, z;
} lanes3;

INLINE lanes3 difference(lanes3 a, lanes3 b) {
  return (lanes3){a.x - b.x, a.y - b.y, a.z - b.z};
}
INLINE lanes3 scaled(vec s, lanes3 a) { return (lanes3){s * a.x, s * a.y, s * a.z}; }
/* a + s b */
INLINE lanes3 moved_along(lanes3 a, vec s, lanes3 b) {
  return (lanes3){a.x + s * b.x, a.y + s * b.y, a.z + s * b.z};
}
INLINE vec product(lanes3 a, lanes3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
INLINE lanes3 across_both(lanes3 a, lanes3 b) {
  return (lanes3){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
INLINE lanes3 mean_of(lanes3 w, lanes3 a, lanes3 b, lanes3 c) {
  return moved_along(moved_along(scaled(w.x, a), w.y, b), w.z, c);
}
INLINE lanes3 where_each(mask m, lanes3 a, lanes3 b) {
  return (lanes3){where(m, a.x, b.x), where(m, a.y, b.y), where(m, a.z, b.z)};
}

/* A row of three numbers, as four. */
INLINE v4 row_of(const double *rows, int64_t n) {
  const double *r = rows + 3 * n;
  return (v4){r[0], r[1], r[2], 0.0};
}

/* Four numbers of each lane, from ``address[i]`` + ``offset`` numbers on, as vectors, and back where
   ``lanes`` has a bit. */
/* Numbers of single precision that lie two in a place of one of double. */
typedef float half_vec __attribute__((vector_size(4 * LANES)));
typedef int32_t half_mask __attribute__((vector_size(4 * LANES)));
INLINE vec first_of(vec two) {
  return __builtin_convertvector((half_vec)__builtin_convertvector((mask)two, half_mask), vec);
}
INLINE vec second_of(vec two) {
  return __builtin_convertvector((half_vec)__builtin_convertvector((mask)two >> 32, half_mask), vec);
}

INLINE void load_four(vec r[4], double *const *address, int offset) {
#pragma GCC unroll 4
  for (int j = 0; j < 4; j++) {
    const int i = FIRST(j), k = i + SECOND;
    r[j] = join(*(const v4 *)(address[i] + offset), *(const v4 *)(address[k] + offset));
  }
  to_lanes(r);
}
INLINE void store_four(vec r[4], double *const *address, int offset, unsigned lanes) {
  to_rows(r);
#pragma GCC unroll 4
  for (int j = 0; j < 4; j++) {
    const int i = FIRST(j), k = i + SECOND;
    if (lanes >> i & 1) *(v4 *)(address[i] + offset) = low(r[j]);
    if (SECOND && lanes >> k & 1) *(v4 *)(address[k] + offset) = high(r[j]);
  }
}

/* The rows ``row[i]`` of an array of rows of three. */
INLINE lanes3 rows_at(const double *rows, const int32_t *row) {
  vec r[4];
#pragma GCC unroll 4
  for (int j = 0; j < 4; j++) {
    const int i = FIRST(j), k = i + SECOND;
    r[j] = join(row_of(rows, row[i]), row_of(rows, row[k]));
  }
  to_lanes(r);
  return (lanes3){r[0], r[1], r[2]};
}

/* Rows of three numbers of each lane, to be read one by one. */
INLINE void to_memory(v4 out[LANES], lanes3 a) {
  vec r[4] = {a.x, a.y, a.z, all(0.0)};
  to_rows(r);
#pragma GCC unroll 4
  for (int j = 0; j < 4; j++) {
    const int i = FIRST(j), k = i + SECOND;
    out[i] = low(r[j]);
    if (SECOND) out[k] = high(r[j]);
  }
}
INLINE void add_row(double *rows, int64_t n, v4 a) {
  double *r = rows + 3 * n;
  r[0] += a[0], r[1] += a[1], r[2] += a[2];
}

#endif
