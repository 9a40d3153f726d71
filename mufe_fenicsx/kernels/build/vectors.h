/* Vectors in space, of one contact and of several lanes at once, kept as rows of three. */

#ifndef MUFE_VECTORS_H
#define MUFE_VECTORS_H

#include <stddef.h>

#include "lanes.h"

INLINE double where(int m, double a, double b) { return m ? a : b; }
INLINE int any(int m) { return m; }
INLINE int no(int m) { return !m; }
INLINE mask no_each(mask m) { return ~m; }
INLINE double root(double a) { return sqrt(a); }
INLINE double number(double a) { return a; }
INLINE vec number_each(double a) { return all(a); }

#define WIDTH 1
#include "space.h"
#undef WIDTH
#define WIDTH LANES
#include "space.h"
#undef WIDTH

typedef struct {
  vec3 a, b, c;
} triangle;

/* The row n of an array of rows of three. */
INLINE vec3 at(const double *rows, int64_t n) {
  const double *r = rows + 3 * n;
  return (vec3){r[0], r[1], r[2]};
}
INLINE triangle corners_at(const double *rows, const int32_t *n) {
  return (triangle){at(rows, n[0]), at(rows, n[1]), at(rows, n[2])};
}
INLINE void add_to(double *rows, int64_t n, vec3 a) {
  double *r = rows + 3 * n;
  r[0] += a.x, r[1] += a.y, r[2] += a.z;
}

/* Where a member of a ``row`` stands in its row of numbers; and whether flags of it are set, in the
   number that holds their bytes. */
#define IN_ROW(row, name) ((int)(offsetof(row, name) / sizeof(double)))
#define FLAG(word, row, name) ((mask) - ((word) >> (8 * (int)(offsetof(row, name) % 8)) & 1))
/* Whether pairs are worked on together; the results are the same to rounding. */
#ifndef TOGETHER
#define TOGETHER 1
#endif

/* A row of three numbers, as four. */
INLINE v4 row_of(const double *rows, int64_t n) {
  const double *r = rows + 3 * n;
#if LANES == 8
  return (v4)_mm256_maskz_loadu_pd(7, r);
#else
  return (v4){r[0], r[1], r[2], 0.0};
#endif
}

/* Four numbers of each lane, from ``address[i]`` + ``offset`` numbers on, as vectors, and back where
   ``lanes`` has a bit. */
/* Numbers of single precision that lie two in a place of one of double. */
typedef float half_vec __attribute__((vector_size(4 * LANES)));
typedef int32_t half_mask __attribute__((vector_size(4 * LANES)));
INLINE vec first_of(vec two) {
  return __builtin_convertvector((half_vec) __builtin_convertvector((mask)two, half_mask), vec);
}
INLINE vec second_of(vec two) {
  return __builtin_convertvector((half_vec) __builtin_convertvector((mask)two >> 32, half_mask),
                                 vec);
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
INLINE vec3_each rows_at(const double *rows, const int32_t *row) {
  vec r[4];
#pragma GCC unroll 4
  for (int j = 0; j < 4; j++) {
    const int i = FIRST(j), k = i + SECOND;
    r[j] = join(row_of(rows, row[i]), row_of(rows, row[k]));
  }
  to_lanes(r);
  return (vec3_each){r[0], r[1], r[2]};
}

/* Rows of three numbers of each lane, to be read one by one. */
INLINE void to_memory(v4 out[LANES], vec3_each a) {
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
