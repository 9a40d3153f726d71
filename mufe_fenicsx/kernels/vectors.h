/* Vectors in space, kept as rows of three, and points of facets made of them. */

#ifndef MUFE_VECTORS_H
#define MUFE_VECTORS_H

#include <math.h>
#include <stdint.h>

#define INLINE static inline __attribute__((always_inline))

typedef struct {
  double x, y, z;
} vec3;

/* The row n of an array of rows of three. */
INLINE vec3 at(const double *rows, int64_t n) {
  const double *r = rows + 3 * n;
  return (vec3){r[0], r[1], r[2]};
}
INLINE void set(double *rows, int64_t n, vec3 a) {
  double *r = rows + 3 * n;
  r[0] = a.x, r[1] = a.y, r[2] = a.z;
}
INLINE void add_to(double *rows, int64_t n, vec3 a) {
  double *r = rows + 3 * n;
  r[0] += a.x, r[1] += a.y, r[2] += a.z;
}
INLINE vec3 plus(vec3 a, vec3 b) { return (vec3){a.x + b.x, a.y + b.y, a.z + b.z}; }
INLINE vec3 minus(vec3 a, vec3 b) { return (vec3){a.x - b.x, a.y - b.y, a.z - b.z}; }
INLINE vec3 times(double s, vec3 a) { return (vec3){s * a.x, s * a.y, s * a.z}; }
/* a + s b */
INLINE vec3 along(vec3 a, double s, vec3 b) {
  return (vec3){a.x + s * b.x, a.y + s * b.y, a.z + s * b.z};
}
INLINE double dot(vec3 a, vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
INLINE vec3 cross(vec3 a, vec3 b) {
  return (vec3){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
INLINE double length(vec3 a) { return sqrt(dot(a, a)); }
/* a with its part along the unit vector n taken out. */
INLINE vec3 across(vec3 a, vec3 n) { return along(a, -dot(a, n), n); }
/* The mean of three vectors with the weights w. */
INLINE vec3 mean(vec3 w, vec3 a, vec3 b, vec3 c) {
  return along(along(times(w.x, a), w.y, b), w.z, c);
}

INLINE double least(double a, double b) { return a < b ? a : b; }
INLINE double most(double a, double b) { return a > b ? a : b; }

/* Points of facets, as in kernels/points.py; ``corner`` is NULL where points are nodes. */
typedef struct {
  const int32_t *corner; /* nodes around each point, as rows of the positions */
  const double *weight;  /* their weights */
} points_type;

/* Where the point n is; its row of the positions x is set. */
INLINE vec3 place(const points_type *points, double *x, int64_t n) {
  if (!points->corner) return at(x, n);
  const int32_t *c = points->corner + 3 * n;
  vec3 p = mean(at(points->weight, n), at(x, c[0]), at(x, c[1]), at(x, c[2]));
  set(x, n, p);
  return p;
}

/* Add a force on the point n to its nodes. */
INLINE void spread(const points_type *points, double *f, int64_t n, vec3 force) {
  if (!points->corner) {
    add_to(f, n, force);
    return;
  }
  const int32_t *c = points->corner + 3 * n;
  const double *w = points->weight + 3 * n;
  for (int k = 0; k < 3; k++) add_to(f, c[k], times(w[k], force));
}

#endif
