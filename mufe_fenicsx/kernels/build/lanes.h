/* Vectors of one number of several elements or nodes, and how rows of numbers become such. */

#ifndef LANES_H
#define LANES_H

#include <math.h>
#include <stdint.h>

/* Elements that are worked on together: a vector register of one component of each. */
#ifdef __AVX512DQ__
#include <immintrin.h>
#define LANES 8
#else
#define LANES 4
#endif

typedef double v4 __attribute__((vector_size(32)));
typedef double vec __attribute__((vector_size(8 * LANES)));
typedef int64_t mask __attribute__((vector_size(8 * LANES)));
/* The same where they may begin at any double. */
typedef double v4_at __attribute__((vector_size(32), aligned(8), may_alias));
typedef double vec_at __attribute__((vector_size(8 * LANES), aligned(8), may_alias));

#define INLINE static inline __attribute__((always_inline))

#if defined(__clang__) || __GNUC__ >= 12
#define PICK(a, b, ...) __builtin_shufflevector(a, b, __VA_ARGS__)
#else
#define PICK(a, b, ...) __builtin_shuffle(a, b, (mask){__VA_ARGS__})
#endif

/* ``bits``: one for each lane where a mask is set, the first one lowest.

   Four numbers of each element <-> a vector of each number. Row j holds element j, or with
   eight lanes element FIRST(j) and behind it the second next. */
#if LANES == 8
#define FIRST(j) ((j) < 2 ? (j) : (j) + 2)
#define SECOND 2
INLINE vec join(v4 a, v4 b) {
  return (vec)_mm512_insertf64x4(_mm512_castpd256_pd512((__m256d)a), (__m256d)b, 1);
}
INLINE v4 low(vec a) { return (v4)_mm512_castpd512_pd256((__m512d)a); }
INLINE v4 high(vec a) { return (v4)_mm512_extractf64x4_pd((__m512d)a, 1); }
INLINE unsigned bits(mask m) { return _mm512_movepi64_mask((__m512i)m); }
#define EVEN(a, b) PICK(a, b, 0, 8, 2, 10, 4, 12, 6, 14)
#define ODD(a, b) PICK(a, b, 1, 9, 3, 11, 5, 13, 7, 15)
INLINE void to_lanes(vec r[4]) {
  vec a = EVEN(r[0], r[1]), b = ODD(r[0], r[1]), c = EVEN(r[2], r[3]), d = ODD(r[2], r[3]);
  r[0] = PICK(a, c, 0, 1, 4, 5, 8, 9, 12, 13);
  r[1] = PICK(b, d, 0, 1, 4, 5, 8, 9, 12, 13);
  r[2] = PICK(a, c, 2, 3, 6, 7, 10, 11, 14, 15);
  r[3] = PICK(b, d, 2, 3, 6, 7, 10, 11, 14, 15);
}
INLINE void to_rows(vec r[4]) {
  vec a = EVEN(r[0], r[1]), b = ODD(r[0], r[1]), c = EVEN(r[2], r[3]), d = ODD(r[2], r[3]);
  r[0] = PICK(a, c, 0, 1, 8, 9, 2, 3, 10, 11);
  r[1] = PICK(b, d, 0, 1, 8, 9, 2, 3, 10, 11);
  r[2] = PICK(a, c, 4, 5, 12, 13, 6, 7, 14, 15);
  r[3] = PICK(b, d, 4, 5, 12, 13, 6, 7, 14, 15);
}
#define LAST_FROM(a, b) PICK(a, b, 0, 1, 2, 11, 4, 5, 6, 15)
INLINE vec all(double a) { return (vec){a, a, a, a, a, a, a, a}; }
#else
#define FIRST(j) (j)
#define SECOND 0
INLINE vec join(v4 a, v4 b) { return a; }
INLINE v4 low(vec a) { return a; }
INLINE v4 high(vec a) { return a; }
INLINE unsigned bits(mask m) {
  return (unsigned)((m[0] & 1) | (m[1] & 2) | (m[2] & 4) | (m[3] & 8));
}
INLINE void to_lanes(vec r[4]) {
  vec a = PICK(r[0], r[1], 0, 4, 2, 6), b = PICK(r[0], r[1], 1, 5, 3, 7);
  vec c = PICK(r[2], r[3], 0, 4, 2, 6), d = PICK(r[2], r[3], 1, 5, 3, 7);
  r[0] = PICK(a, c, 0, 1, 4, 5);
  r[1] = PICK(b, d, 0, 1, 4, 5);
  r[2] = PICK(a, c, 2, 3, 6, 7);
  r[3] = PICK(b, d, 2, 3, 6, 7);
}
#define to_rows to_lanes
#define LAST_FROM(a, b) PICK(a, b, 0, 1, 2, 7)
INLINE vec all(double a) { return (vec){a, a, a, a}; }
#endif

/* A mask from such bits. */
INLINE mask lanes_of(unsigned lanes) {
#if LANES == 8
  return (mask)_mm512_movm_epi64((__mmask8)lanes);
#else
  return -(mask){lanes & 1, lanes >> 1 & 1, lanes >> 2 & 1, lanes >> 3 & 1};
#endif
}

INLINE int any_each(mask m) { return bits(m) != 0; }

/* a where m, else b. */
INLINE vec where_each(mask m, vec a, vec b) { return (vec)((m & (mask)a) | (~m & (mask)b)); }

INLINE vec root_each(vec a) {
  vec r;
  for (int i = 0; i < LANES; i++) r[i] = sqrt(a[i]);
  return r;
}

/* ln J. Near 1 by 2 artanh((J - 1)/(J + 1)), whose series then ends at 1e-17. */
INLINE vec logarithm(vec J) {
  vec d = J - 1.0, z = d / (J + 1.0), s = z * z;
  vec sum = 1.0 / 13.0 * s + 1.0 / 11.0;
  sum = sum * s + 1.0 / 9.0;
  sum = sum * s + 1.0 / 7.0;
  sum = sum * s + 1.0 / 5.0;
  sum = sum * s + 1.0 / 3.0;
  vec r = 2.0 * z * (sum * s + 1.0);
  mask near = (d < 0.1) & (d > -0.09);
  if (any_each(~near))
    for (int i = 0; i < LANES; i++)
      if (!near[i]) r[i] = log(J[i]);
  return r;
}

/* J^(-2/3). Near 1 by the series of exp(-2/3 ln J), which then ends at 1e-16. */
INLINE vec power_of_minus_two_thirds(vec J) {
  vec y = (-2.0 / 3.0) * logarithm(J);
  vec sum = 1.0 / 40320.0 * y + 1.0 / 5040.0;
  sum = sum * y + 1.0 / 720.0;
  sum = sum * y + 1.0 / 120.0;
  sum = sum * y + 1.0 / 24.0;
  sum = sum * y + 1.0 / 6.0;
  sum = sum * y + 0.5;
  vec r = (sum * y + 1.0) * y + 1.0;
  mask near = (y < 0.07) & (y > -0.07);
  if (any_each(~near))
    for (int i = 0; i < LANES; i++)
      if (!near[i]) r[i] = exp(y[i]);
  return r;
}

#endif
