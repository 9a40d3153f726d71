/* Vectors in space of WIDTH contacts (width.h). */

#include "width.h"

typedef struct {
  real x, y, z;
} OF(vec3);

INLINE real OF(least)(real a, real b) { return OF(where)(a < b, a, b); }
INLINE real OF(most)(real a, real b) { return OF(where)(a > b, a, b); }
INLINE real OF(size)(real a) { return OF(where)(a < 0.0, -a, a); }

INLINE OF(vec3) OF(plus)(OF(vec3) a, OF(vec3) b) {
  return (OF(vec3)){a.x + b.x, a.y + b.y, a.z + b.z};
}
INLINE OF(vec3) OF(minus)(OF(vec3) a, OF(vec3) b) {
  return (OF(vec3)){a.x - b.x, a.y - b.y, a.z - b.z};
}
INLINE OF(vec3) OF(times)(real s, OF(vec3) a) { return (OF(vec3)){s * a.x, s * a.y, s * a.z}; }
/* a + s b */
INLINE OF(vec3) OF(along)(OF(vec3) a, real s, OF(vec3) b) {
  return (OF(vec3)){a.x + s * b.x, a.y + s * b.y, a.z + s * b.z};
}
INLINE real OF(dot)(OF(vec3) a, OF(vec3) b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
INLINE OF(vec3) OF(cross)(OF(vec3) a, OF(vec3) b) {
  return (OF(vec3)){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
INLINE real OF(length)(OF(vec3) a) { return OF(root)(OF(dot)(a, a)); }
/* a with its part along the unit vector n taken out. */
INLINE OF(vec3) OF(across)(OF(vec3) a, OF(vec3) n) { return OF(along)(a, -OF(dot)(a, n), n); }
/* The mean of three vectors with the weights w. */
INLINE OF(vec3) OF(mean)(OF(vec3) w, OF(vec3) a, OF(vec3) b, OF(vec3) c) {
  return OF(along)(OF(along)(OF(times)(w.x, a), w.y, b), w.z, c);
}
INLINE OF(vec3) OF(choose)(truth m, OF(vec3) a, OF(vec3) b) {
  return (OF(vec3)){OF(where)(m, a.x, b.x), OF(where)(m, a.y, b.y), OF(where)(m, a.z, b.z)};
}

/* Where the point a + ap lies beside a triangle with the sides ab and ac: products by which the
   regions are told apart, and va, vb and vc, the weights of its foot in their plane times their
   sum, four times the area squared. The foot is inside where all three are positive. */
typedef struct {
  real d1, d2, d3, d4, d5, d6, ab2, ac2, abac, va, vb, vc;
} OF(regions_type);
INLINE OF(regions_type) OF(regions)(OF(vec3) ab, OF(vec3) ac, OF(vec3) ap) {
  OF(regions_type) r;
  r.d1 = OF(dot)(ab, ap), r.d2 = OF(dot)(ac, ap);
  r.ab2 = OF(dot)(ab, ab), r.ac2 = OF(dot)(ac, ac), r.abac = OF(dot)(ab, ac);
  r.d3 = r.d1 - r.ab2, r.d4 = r.d2 - r.abac, r.d5 = r.d1 - r.abac, r.d6 = r.d2 - r.ac2;
  r.va = r.d3 * r.d6 - r.d5 * r.d4, r.vb = r.d5 * r.d2 - r.d1 * r.d6;
  r.vc = r.d1 * r.d4 - r.d3 * r.d2;
  return r;
}
