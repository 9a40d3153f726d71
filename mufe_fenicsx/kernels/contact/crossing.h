/* Where two edges cross, and whether they do so inside the bodies. */

#ifndef CROSSING_H
#define CROSSING_H

#include "edge_springs.h"

#define PARALLEL 0.01 /* sine of the angle below which edges are left to nodes and facets */
/* Angle by which the normal may lie outside the normals of an edge's facets [rad]: where an edge lies
   flat on a facet, or two facets on each other, all their crossings carry. */
#define ARC 0.1

/* Where the lines of two edges come closest. ``outside``: by how much that lies outside of the edges
   or of the normals of their facets, in parts of the edge or radians, at most 0 within both.
   ``normal``: from the second to the first. ``gap``: negative where they are inside each other,
   infinite of parallel ones. ``across``: the shorter edge across the other, by which motions move the
   crossing. ``turned``: sine of the angle by which the normal lies outside those of the facets. */
typedef struct {
  double outside;
  place_type place;
  vec3 normal;
  double gap, across, turned;
} crossing_type;

/* Sine of the angle by which a direction n lies outside the normals of the edge u from a. The normals
   of a convex edge are the directions at right angles to it with n.r <= 0 for every r into its
   facets. Negative within them. */
INLINE double outside_normals(const double *x, vec3 a, vec3 u, const int32_t *beyond, vec3 n) {
  const double uu = dot(u, u);
  double worst = -INFINITY;
  for (int m = 0; m < 2; m++) {
    const vec3 r = minus(at(x, beyond[m]), a);
    const double along_edge = dot(r, u);
    worst = most(worst, dot(r, n) / sqrt(dot(r, r) - along_edge * along_edge / uu));
  }
  return worst;
}

/* The normal is that of the separating planes of two convex bodies that touch there: it lies between
   the normals of the facets at edge j and, reversed, at edge i (S. Gottschalk, M. C. Lin, D. Manocha,
   OBBTree, SIGGRAPH 1996, for the axis; D. Gregorius, The separating axis test between convex
   polyhedra, GDC 2013, for the arcs). */
static crossing_type crossing(const double *x, const edges_type *e, int64_t i, int64_t j) {
  const int32_t *first = e->ends + 2 * i, *second = e->ends + 2 * j;
  const int32_t *beyond = e->beyond + 2 * i, *other_beyond = e->beyond + 2 * j;
  const vec3 a = at(x, first[0]), c = at(x, second[0]), w = minus(a, c);
  const two_edges both = both_edges(x, first, second);
  const vec3 u = both.u, v = both.v, n = cross(u, v);
  const double uu = dot(u, u), vv = dot(v, v), det = dot(n, n);
  if (!(det > PARALLEL * PARALLEL * uu * vv))
    return (crossing_type){INFINITY, {0.5, 0.5}, {0.0, 0.0, 0.0}, INFINITY, 0.0, INFINITY};
  const double uv = dot(u, v), uw = dot(u, w), vw = dot(v, w);
  const double s = (uv * vw - vv * uw) / det, t = (uu * vw - uv * uw) / det;
  /* Out of grain j: away from its facets, and towards those of grain i. */
  double side = 0.0;
  for (int m = 0; m < 2; m++) {
    side += dot(n, minus(at(x, beyond[m]), a));
    side -= dot(n, minus(at(x, other_beyond[m]), c));
  }
  const vec3 normal = times(copysign(1.0 / sqrt(det), side), n);
  const double turned = most(outside_normals(x, a, u, beyond, times(-1.0, normal)),
                             outside_normals(x, c, v, other_beyond, normal));
  const double beside = most(most(-s, s - 1.0), most(-t, t - 1.0));
  return (crossing_type){most(beside - END, turned - ARC), {s, t}, normal, dot(w, normal),
                         sqrt(det / most(uu, vv)),         turned};
}

/* Six times the volume of a tetrahedron. */
INLINE double volume(vec3 a, vec3 b, vec3 c, vec3 d) {
  return dot(minus(b, a), cross(minus(c, a), minus(d, a)));
}

/* Whether the segment a, b meets the triangle c, d, e. */
INLINE int pierces(vec3 a, vec3 b, vec3 c, vec3 d, vec3 e) {
  if (volume(a, c, d, e) * volume(b, c, d, e) > 0.0) return 0;
  const double first = volume(a, b, c, d), second = volume(a, b, d, e), third = volume(a, b, e, c);
  return (first >= 0.0 && second >= 0.0 && third >= 0.0) ||
         (first <= 0.0 && second <= 0.0 && third <= 0.0);
}

/* Ends of an edge, a little farther where it goes on as another one. */
typedef struct {
  vec3 a, b;
} segment_type;
INLINE segment_type reach_of(const double *x, const edges_type *e, int64_t i) {
  const vec3 a = at(x, e->ends[2 * i]), b = at(x, e->ends[2 * i + 1]), u = minus(b, a);
  const double *share = e->share + 2 * i;
  return (segment_type){along(a, share[0] == 1.0 ? -END : 0.0, u),
                        along(b, share[1] == 1.0 ? END : 0.0, u)};
}

/* Whether two edges pierce facets of each other. Not so where the lines of edges cross inside each
   other but the edges or the facets have ended before. */
static int pierce(const double *x, const edges_type *e, int64_t i, int64_t j) {
  const segment_type u = reach_of(x, e, i), v = reach_of(x, e, j);
  for (int m = 0; m < 2; m++)
    if (pierces(u.a, u.b, v.a, v.b, at(x, e->beyond[2 * j + m])) ||
        pierces(v.a, v.b, u.a, u.b, at(x, e->beyond[2 * i + m])))
      return 1;
  return 0;
}

/* Distance of two edges (C. Ericson, Real-Time Collision Detection, 2005, section 5.1.9). */
static double distance_of(const double *x, const edges_type *e, int64_t i, int64_t j) {
  const int32_t *first = e->ends + 2 * i, *second = e->ends + 2 * j;
  const two_edges both = both_edges(x, first, second);
  const vec3 u = both.u, v = both.v, w = minus(at(x, first[0]), at(x, second[0]));
  const double uu = dot(u, u), vv = dot(v, v), uv = dot(u, v), uw = dot(u, w), vw = dot(v, w);
  const double det = uu * vv - uv * uv;
  double s = 0.0;
  if (det > 1e-14 * uu * vv) s = least(most((uv * vw - uw * vv) / det, 0.0), 1.0);
  double t = (uv * s + vw) / vv;
  if (t < 0.0)
    t = 0.0, s = least(most(-uw / uu, 0.0), 1.0);
  else if (t > 1.0)
    t = 1.0, s = least(most((uv - uw) / uu, 0.0), 1.0);
  return length(along(along(w, s, u), -t, v));
}

#endif
