/* Vectors in space, kept as rows of three. */

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

#endif
