/* Closest feature of a triangulated surface and on which side of it a point lies: what
   kernels/geometry/closest.py does for searches, for the forces of each step. */

#ifndef MUFE_SURFACE_H
#define MUFE_SURFACE_H

#include "vectors.h"

/* Features of a triangle: its interior, its vertices, its edges (0-1, 1-2, 2-0). */
enum { INTERIOR = 0, VERTEX = 1, EDGE = 4 };

typedef struct {
  const int32_t *facets;      /* vertices, three a facet, as rows of the positions */
  const int32_t *neighbour;   /* facets across the edges 0-1, 1-2, 2-0; -1 for none */
  const int64_t *ring_offset; /* facets around each row of the positions, compressed rows */
  const int32_t *ring;
} surface_type;

INLINE triangle facet_at(const surface_type *s, const double *x, int64_t facet) {
  const int32_t *v = s->facets + 3 * facet;
  return (triangle){at(x, v[0]), at(x, v[1]), at(x, v[2])};
}

/* Unit normal of a triangle, outward where its vertices turn to the left. */
INLINE vec3 normal_of(triangle t) {
  vec3 n = cross(minus(t.b, t.a), minus(t.c, t.a));
  return times(1.0 / sqrt(dot(n, n)), n);
}

/* Weights of the vertices at the closest point of a triangle, and its feature. Voronoi regions of
   the features in turn (C. Ericson, Real-Time Collision Detection, 2005, section 5.1.5). */
INLINE vec3 closest_point(vec3 p, triangle t, int *feature) {
  const regions_type r = regions(minus(t.b, t.a), minus(t.c, t.a), minus(p, t.a));
  const double scale = 1.0 / (r.va + r.vb + r.vc), v = r.vb * scale, w = r.vc * scale;
  *feature = INTERIOR; /* most often; no other region has all three */
  if (r.va > 0.0 && r.vb > 0.0 && r.vc > 0.0) return (vec3){1.0 - v - w, v, w};
  *feature = VERTEX;
  if (r.d1 <= 0.0 && r.d2 <= 0.0) return (vec3){1.0, 0.0, 0.0};
  *feature = VERTEX + 1;
  if (r.d3 >= 0.0 && r.d4 <= r.d3) return (vec3){0.0, 1.0, 0.0};
  *feature = EDGE;
  if (r.vc <= 0.0 && r.d1 >= 0.0 && r.d3 <= 0.0) {
    const double s = r.d1 / (r.d1 - r.d3);
    return (vec3){1.0 - s, s, 0.0};
  }
  *feature = VERTEX + 2;
  if (r.d6 >= 0.0 && r.d5 <= r.d6) return (vec3){0.0, 0.0, 1.0};
  *feature = EDGE + 2;
  if (r.vb <= 0.0 && r.d2 >= 0.0 && r.d6 <= 0.0) {
    const double s = r.d2 / (r.d2 - r.d6);
    return (vec3){1.0 - s, 0.0, s};
  }
  *feature = EDGE + 1;
  if (r.va <= 0.0 && r.d4 - r.d3 >= 0.0 && r.d5 - r.d6 >= 0.0) {
    const double s = (r.d4 - r.d3) / ((r.d4 - r.d3) + (r.d5 - r.d6));
    return (vec3){0.0, 1.0 - s, s};
  }
  *feature = INTERIOR;
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
