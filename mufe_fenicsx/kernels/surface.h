/* Closest feature of a triangulated surface and on which side of it a point lies: what
   kernels/closest.py does for searches, for the forces of each step. */

#ifndef MUFE_SURFACE_H
#define MUFE_SURFACE_H

#include "vectors.h"

/* Features of a triangle: its interior, its vertices, its edges (0-1, 1-2, 2-0). */
enum { INTERIOR = 0, VERTEX = 1, EDGE = 4 };

typedef struct {
  const int32_t *facets;      /* vertices, three a facet, as rows of the positions */
  const int32_t *neighbour;    /* facets across the edges 0-1, 1-2, 2-0; -1 for none */
  const int64_t *ring_offset; /* facets around each row of the positions, compressed rows */
  const int32_t *ring;
} surface_type;

typedef struct {
  vec3 a, b, c;
} triangle;

INLINE triangle facet_at(const surface_type *s, const double *x, int64_t facet) {
  const int32_t *v = s->facets + 3 * facet;
  return (triangle){at(x, v[0]), at(x, v[1]), at(x, v[2])};
}

/* Unit normal of a triangle, outward where its vertices turn to the left. */
INLINE vec3 normal_of(triangle t) {
  vec3 n = cross(minus(t.b, t.a), minus(t.c, t.a));
  return times(1.0 / sqrt(dot(n, n)), n);
}

/* Where the point a + ap lies beside a triangle with the sides ab and ac: products by which the
   regions are told apart, and va, vb and vc, the weights of its foot in their plane times their
   sum, four times the area squared. The foot is inside where all three are positive. */
#define REGIONS(real, dot, ab, ac, ap)                                              \
  const real d1 = dot(ab, ap), d2 = dot(ac, ap);                                    \
  const real ab2 = dot(ab, ab), ac2 = dot(ac, ac), abac = dot(ab, ac);              \
  const real d3 = d1 - ab2, d4 = d2 - abac, d5 = d1 - abac, d6 = d2 - ac2;          \
  const real va = d3 * d6 - d5 * d4, vb = d5 * d2 - d1 * d6, vc = d1 * d4 - d3 * d2

/* Weights of the vertices at the closest point of a triangle, and its feature. Voronoi regions of
   the features in turn (C. Ericson, Real-Time Collision Detection, 2005, section 5.1.5). */
INLINE vec3 closest_point(vec3 p, triangle t, int *feature) {
  vec3 ab = minus(t.b, t.a), ac = minus(t.c, t.a), ap = minus(p, t.a);
  REGIONS(double, dot, ab, ac, ap);
  if (va > 0.0 && vb > 0.0 && vc > 0.0) { /* most often; no other region has all three */
    double scale = 1.0 / (va + vb + vc), v = vb * scale, w = vc * scale;
    *feature = INTERIOR;
    return (vec3){1.0 - v - w, v, w};
  }
  *feature = VERTEX;
  if (d1 <= 0.0 && d2 <= 0.0) return (vec3){1.0, 0.0, 0.0};
  *feature = VERTEX + 1;
  if (d3 >= 0.0 && d4 <= d3) return (vec3){0.0, 1.0, 0.0};
  *feature = EDGE;
  if (vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0) {
    double s = d1 / (d1 - d3);
    return (vec3){1.0 - s, s, 0.0};
  }
  *feature = VERTEX + 2;
  if (d6 >= 0.0 && d5 <= d6) return (vec3){0.0, 0.0, 1.0};
  *feature = EDGE + 2;
  if (vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0) {
    double s = d2 / (d2 - d6);
    return (vec3){1.0 - s, 0.0, s};
  }
  *feature = EDGE + 1;
  if (va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0) {
    double s = (d4 - d3) / ((d4 - d3) + (d5 - d6));
    return (vec3){0.0, 1.0 - s, s};
  }
  *feature = INTERIOR;
  double scale = 1.0 / (va + vb + vc), v = vb * scale, w = vc * scale;
  return (vec3){1.0 - v - w, v, w};
}

/* Weights of the foot of a point on the plane of a triangle. */
INLINE vec3 project(vec3 p, triangle t) {
  vec3 u = minus(t.b, t.a), v = minus(t.c, t.a), d = minus(p, t.a);
  double uu = dot(u, u), vv = dot(v, v), uv = dot(u, v), du = dot(d, u), dv = dot(d, v);
  double scale = 1.0 / (uu * vv - uv * uv);
  double wb = (vv * du - uv * dv) * scale, wc = (uu * dv - uv * du) * scale;
  return (vec3){1.0 - wb - wc, wb, wc};
}

/* Normal of a feature whose sign tells inside from outside; not of unit length. Edge: the sum of
   the two normals. Vertex: the sum of the normals around it, each times its angle there (J. A.
   Bærentzen, H. Aanæs, IEEE Trans. Vis. Comput. Graph. 11, 2005, 243-253). */
static vec3 pseudo_normal(const surface_type *s, const double *x, int64_t facet, int feature,
                          vec3 normal) {
  if (feature == INTERIOR) return normal;
  if (feature >= EDGE) {
    int32_t other = s->neighbour[3 * facet + feature - EDGE];
    return other < 0 ? normal : plus(normal, normal_of(facet_at(s, x, other)));
  }
  int32_t node = s->facets[3 * facet + feature - VERTEX];
  vec3 sum = {0.0, 0.0, 0.0};
  for (int64_t k = s->ring_offset[node]; k < s->ring_offset[node + 1]; k++) {
    const int32_t *v = s->facets + 3 * (int64_t)s->ring[k];
    int32_t b = v[0] == node ? v[1] : v[0], c = v[2] == node ? v[1] : v[2];
    vec3 p = at(x, node), to_b = minus(at(x, b), p), to_c = minus(at(x, c), p);
    double cosine = dot(to_b, to_c) / sqrt(dot(to_b, to_b) * dot(to_c, to_c));
    double angle = acos(least(1.0, most(-1.0, cosine)));
    sum = along(sum, angle, normal_of(facet_at(s, x, s->ring[k])));
  }
  return sum;
}

#endif
