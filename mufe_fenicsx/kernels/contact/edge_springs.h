/* Springs of crossing edges: their stiffness by the place, and what pushes them along. */

#ifndef EDGE_SPRINGS_H
#define EDGE_SPRINGS_H

#include "contact_law.h"

#define END 1e-2 /* part of an edge beyond its end up to which a crossing may lie there */

/* Edges, as in kernels/contact/edges.py. */
typedef struct {
  const int32_t *ends, *beyond;
  const double *area, *layer, *share, *compliance;
} edges_type;

/* What a crossing has on each of its two edges: places, or parts of a vector s u - t v. */
typedef struct {
  double s, t;
} place_type;
typedef struct {
  vec3 u, v;
} two_edges;
INLINE two_edges both_edges(const double *x, const int32_t *first, const int32_t *second) {
  return (two_edges){minus(at(x, first[1]), at(x, first[0])),
                     minus(at(x, second[1]), at(x, second[0]))};
}
INLINE vec3 between(two_edges e, place_type d) {
  return (vec3){d.s * e.u.x - d.t * e.v.x, d.s * e.u.y - d.t * e.v.y, d.s * e.u.z - d.t * e.v.z};
}
/* s and t of the vector s u - t v that has these products with u and v. */
INLINE place_type parts_along(two_edges e, double along_u, double along_v) {
  const double uu = dot(e.u, e.u), vv = dot(e.v, e.v), uv = dot(e.u, e.v);
  const double det = uu * vv - uv * uv;
  return (place_type){(vv * along_u - uv * along_v) / det, (uv * along_u - uu * along_v) / det};
}

/* Parts of the stiffness of a crossing by its place on an edge: at corners, and beside edges. Toward
   a corner of k edges it falls to a k-th over a quarter of the edge, for several of them can cross
   there at once. Toward an end where the edge goes on, ``share`` 1, it fades out while that of the
   next edge fades in: the two of a straight ridge add up to one. */
typedef struct {
  double corner, fade;
} parts_type;
INLINE parts_type parts_at(double place, const double *share) {
  const double inside = place < 0.5 ? place : 1.0 - place;
  const double end = place < 0.5 ? share[0] : share[1];
  if (end == 1.0) return (parts_type){1.0, least(most(0.5 + 0.5 * inside / END, 0.0), 1.0)};
  return (parts_type){end + (1.0 - end) * least(most(4.0 * inside, 0.0), 1.0), 1.0};
}

/* Stiffness of a crossing of the edges i and j between meshes that are even, A/2 of a node of the
   finer edge over both layers, and the part that has faded in. */
typedef struct {
  double stiffness, fade;
} even_type;
INLINE even_type at_place(const edges_type *e, int64_t i, int64_t j, place_type at) {
  const parts_type a = parts_at(at.s, e->share + 2 * i), b = parts_at(at.t, e->share + 2 * j);
  const double area = least(e->area[i], e->area[j]), layers = e->layer[i] + e->layer[j];
  return (even_type){0.5 * least(a.corner, b.corner) * area / layers, a.fade * b.fade};
}

/* Stiffness of a crossing, and its derivatives by s and t. Between the ends of an edge a force finds
   the mesh stiffer than at them, by what the place ξ takes off its compliance, ξ (1 - ξ) D. That is
   added to the spring's own: 1/k' = 1/k + s (1 - s) D + t (1 - t) D of the other. */
typedef struct {
  double stiffness;
  place_type slope;
} series_type;
INLINE series_type in_series(even_type even, place_type at, double compliance, double other) {
  const double s = least(most(at.s, 0.0), 1.0), t = least(most(at.t, 0.0), 1.0), k = even.stiffness;
  const double soft = 1.0 + k * (s * (1.0 - s) * compliance + t * (1.0 - t) * other);
  const double softened = k / soft, slope = -even.fade * (softened * softened);
  return (series_type){even.fade * k / soft,
                       {slope * (1.0 - 2.0 * s) * compliance, slope * (1.0 - 2.0 * t) * other}};
}
INLINE series_type crossing_stiffness(const edges_type *e, int64_t i, int64_t j, place_type at) {
  return in_series(at_place(e, i, j, at), at, e->compliance[i], e->compliance[j]);
}

/* Force Q = q u + r v on edge u, its opposite on edge v, by which an energy moves a crossing; ``by``:
   its derivatives. Where edge u moves by w, the crossing moves by ds and dt with ds u - dt v = -w,
   less what w has along the normal: Q.u is the derivative by s, -Q.v that by t. */
typedef struct {
  double q, r;
  vec3 force;
} push_type;
INLINE push_type push_along(two_edges e, place_type by) {
  if (by.s == 0.0 && by.t == 0.0) return (push_type){0.0, 0.0, {0.0, 0.0, 0.0}};
  const place_type of = parts_along(e, by.s, -by.t);
  return (push_type){of.s, -of.t, between(e, of)};
}

/* Forces on the ends of both edges, of a crossing ``at`` a place and a gap that carries a normal force
   N and the friction ``shear`` of the spring ``by`` with the stiffness kt; ``push``: along the edges. */
INLINE void forces_on_ends(vec3 on[4], double N, double kt, place_type at, place_type by,
                           double gap, vec3 normal, vec3 shear, push_type push) {
  /* Couple: T = -kt (ds u - dt v), so h = -kt g ds on the first edge, kt g dt on the second. */
  const double h0 = -kt * gap * by.s + gap * push.q, h1 = kt * gap * by.t + gap * push.r;
  const place_type stick = {at.s + by.s, at.t + by.t};
  const double share[4] = {1.0 - at.s, at.s, 1.0 - at.t, at.t};
  const double of_friction[4] = {1.0 - stick.s, stick.s, 1.0 - stick.t, stick.t};
  const double couple[4] = {-h0, h0, h1, -h1};
  for (int k = 0; k < 4; k++) {
    const vec3 both = along(times(share[k] * N + couple[k], normal), of_friction[k], shear);
    on[k] = times(k < 2 ? 1.0 : -1.0, along(both, share[k], push.force));
  }
}

#endif
