/* Contact of nodes, or of points in facets, with the facets of other grains: what is known of a
   pair, and which facet is the closest. */

#ifndef PAIRS_H
#define PAIRS_H

#include "contact_law.h"
#include "surface.h"

#define FACING 0.342 /* sine of the angle a node around may lie below such a plane: 20 degrees */
#define BESIDE 1e-3  /* part of a facet by which the foot of a node may lie beside it */

/* In the order of kernels/contact/pairs.py. */
typedef struct {
  pair_row *row;
  double *next_check;
  float *candidate_next_check;
  const double *bounds;
  const int32_t *bound_row; /* as in the rows, for those that are not due */
  int64_t *closest;
  int32_t *scratch, *seen;
  const uint8_t *early; /* whether a pair is, where there are some */
  const int64_t *first;
  const int32_t *candidate;
  surface_type surface;
  const uint8_t *sharp;
  const double *area_of_point, *layer_of_node, *layer_of_facet;
  const double *area_at_node, *area_of_facet, *depth_of_node, *depth_of_facet;
  const double *bulge_of_facet, *curvature_of_point, *curvature_of_facet; /* six, three */
  const double *weights; /* of the corners of points, a row of three for each rule */
  const int32_t *around;
  double *x, *f;
  const double *friction; /* static and kinetic of pairs of materials; none: one for all */
  strength_type strength;
} pairs_type;

/* Parts of the pairs, in the order of kernels/contact/pairs.py. */
enum { ALL_PAIRS, EARLY_PAIRS, OTHER_PAIRS };

/* What a call is given and finds, see kernels/contact/pairs.py. */
typedef struct {
  double friction, friction_kinetic, range;
  double left;     /* motion from now on before which no other facet can be met */
  double highest;  /* of smooth surfaces over facets */
  double steepest; /* how much faster than points gaps of smooth surfaces go at most */
  int64_t accept, part, num_others;
  double dissipated, switched, num_accepted, deepest, sunk;
  int64_t sunken;
} call_type;

/* Static and kinetic coefficient of a pair. */
typedef struct {
  double held, kinetic;
} friction_type;
INLINE friction_type friction_of(const pairs_type *m, const call_type *c, const pair_row *s) {
  if (!m->friction) return (friction_type){c->friction, c->friction_kinetic};
  const double *of = m->friction + 2 * (int64_t)s->friction;
  return (friction_type){of[0], of[1]};
}

/* Weights of the corners of its point. */
INLINE vec3 corner_weights(const pairs_type *m, const pair_row *s) {
  return at(m->weights, s->rule);
}
/* The point on the smooth surface, at a height over its own facet along the facet's normal; a vertex
   is where it is. ``beneath``: the place in the facet. */
INLINE vec3 stand(const pair_row *s, vec3 beneath, triangle own) {
  return s->stands == 0.0f ? beneath : along(beneath, s->stands, normal_of(own));
}
INLINE vec3 place_in_facet(const pairs_type *m, const pair_row *s, triangle own) {
  return mean(corner_weights(m, s), own.a, own.b, own.c);
}
INLINE vec3 point_of(const pairs_type *m, const pair_row *s) {
  const triangle own = corners_at(m->x, s->corner);
  return stand(s, place_in_facet(m, s, own), own);
}
INLINE spring_type spring_of(const pair_row *s) {
  return (spring_type){s->stiffness, s->softer, s->largest_depth, s->ratio};
}

/* Stiffness of the pair of a point and a candidate. Both surfaces carry points, and what they find
   of each other adds up to one contact, whose share the finer one carries more of: few points of a
   coarse surface would load a fine one unevenly. */
INLINE double stiffness_of(const pairs_type *m, const pair_row *s, int64_t k) {
  const int32_t facet = m->candidate[k];
  const double own = m->area_at_node[s->node], other = m->area_of_facet[facet];
  return other * other / (other * other + own * own) * m->area_of_point[s->node] /
         (m->layer_of_node[s->node] + m->layer_of_facet[facet]);
}

/* Mean edge of the pair of a point and a candidate, weighted by the compliance of each side. */
INLINE double edge_of(const pairs_type *m, const pair_row *s, int64_t k) {
  const int32_t facet = m->candidate[k];
  const double per_area = 4.0 / 1.7320508075688772; /* h² of an equilateral triangle */
  const double h1 = sqrt(per_area * m->area_at_node[s->node]);
  const double h2 = sqrt(per_area * m->area_of_facet[facet]);
  const double l1 = m->layer_of_node[s->node], l2 = m->layer_of_facet[facet];
  return (l1 + l2) / (l1 / h1 + l2 / h2);
}

/* m of the law, XI h² √det, with the determinant of the curvature of the gap, to which both sides
   add: det K₁ + det K₂ + ½ tr K₁ tr K₂, the mean over how they may be turned against each other;
   0 where it is not convex. */
INLINE double softer_of(const pairs_type *m, const pair_row *s, int64_t k) {
  const int32_t facet = m->candidate[k];
  const double *own = m->curvature_of_point + 3 * (int64_t)s->node;
  const double *other = m->curvature_of_facet + 3 * (int64_t)facet;
  const double det = own[0] + other[0] + 0.5 * own[1] * other[1];
  if (s->num_around || !(det > 0.0 && own[1] + other[1] > 0.0)) return 0.0;
  const double h = edge_of(m, s, k);
  return XI * h * h * sqrt(det);
}

/* Height of the smooth surface over the closest facet t, with the normal u, at w, and its slope: the
   gradient in the facet. On an edge it is that along the edge, on a vertex none, as the closest
   point goes nowhere else. */
INLINE double bulge_at(const pair_row *s, vec3 w, triangle t, vec3 u, int feature, vec3 *slope) {
  const double ab = s->bulge[0], bc = s->bulge[1], ca = s->bulge[2];
  const vec3 o = {s->bulge[3], s->bulge[4], s->bulge[5]};
  const double by_a = ab * w.y + ca * w.z - o.x, by_b = ab * w.x + bc * w.z - o.y;
  const double by_c = bc * w.y + ca * w.x - o.z;
  const vec3 e1 = minus(t.b, t.a), e2 = minus(t.c, t.a);
  if (feature == INTERIOR) {
    const double scale = 1.0 / dot(u, cross(e1, e2));
    *slope = plus(times(scale * (by_b - by_a), cross(e2, u)),
                  times(scale * (by_c - by_a), cross(u, e1)));
  } else if (feature >= EDGE) {
    const vec3 along_edge = feature == EDGE ? e1 : feature == EDGE + 1 ? minus(t.c, t.b) : e2;
    const double rise = feature == EDGE       ? by_b - by_a
                        : feature == EDGE + 1 ? by_c - by_b
                                              : by_c - by_a;
    *slope = times(rise / dot(along_edge, along_edge), along_edge);
  } else {
    *slope = (vec3){0.0, 0.0, 0.0};
  }
  return ab * w.x * w.y + bc * w.y * w.z + ca * w.z * w.x - dot(o, w);
}

/* Weights of the point of a facet that a spring s from the node p leads to. ``foot`` is the
   closest point and ``n`` the normal of the contact, which differs from that of the facet on its
   edges and vertices. The spring lies across n, so its end is moved along n into the facet: along
   the facet's own normal a node at depth would find another spring in the next step. */
INLINE vec3 stick_point_of(vec3 s, vec3 foot, vec3 n, vec3 facet_normal, triangle t) {
  double slant = dot(n, facet_normal);
  double shift = slant > 0.1 ? dot(s, facet_normal) / slant : 0.0;
  return project(along(minus(foot, s), shift, n), t);
}

/* Forces on the vertices of the facet t with a force on the point: the opposite one, shared by the
   weights w of its foot, and the couple of the height and the part of the force in the facet, as
   normal forces h_i = height grad N_i . T, less what is across the facet, along the normal, where
   that is of an edge or vertex. */
INLINE void forces_on_facet(vec3 on[3], vec3 force, vec3 w, double height, vec3 normal,
                            vec3 facet_normal, triangle t) {
  const vec3 e1 = minus(t.b, t.a), e2 = minus(t.c, t.a);
  const vec3 in_plane = along(force, -dot(force, facet_normal) / dot(normal, facet_normal), normal);
  const double scale = height / dot(facet_normal, cross(e1, e2));
  /* grad N_b = (e2 x n)/2A and grad N_c = (n x e1)/2A */
  const double hb = scale * dot(in_plane, cross(e2, facet_normal));
  const double hc = scale * dot(in_plane, cross(facet_normal, e1));
  on[0] = along(times(-hb - hc, normal), -w.x, force);
  on[1] = along(times(hb, normal), -w.y, force);
  on[2] = along(times(hc, normal), -w.z, force);
}

/* Forces on the corners of its own facet with a force on the point, which stands over it. */
INLINE void forces_on_own(vec3 on[3], vec3 force, vec3 weights, const pair_row *s, triangle own) {
  if (s->stands != 0.0f) {
    const vec3 normal = normal_of(own);
    forces_on_facet(on, times(-1.0, force), weights, s->stands, normal, normal, own);
  } else {
    on[0] = times(weights.x, force), on[1] = times(weights.y, force);
    on[2] = times(weights.z, force);
  }
}

/* Depth from which the force of that pair grows no more: both sides add. */
INLINE double largest_depth_of(const pairs_type *m, const pair_row *s, int64_t k) {
  return m->depth_of_node[s->node] + m->depth_of_facet[m->candidate[k]];
}

/* A number of single precision that is not above v: rounding adds 2^-24 |v| at most. */
INLINE float no_more_than(double v) { return (float)(v - 1.2e-7 * fabs(v)); }

/* Closest candidate of the pair p, testing only those that can be it: ``candidate_next_check`` is
   the bound of both grains' motion at which a candidate can be at distance zero. The bound advances
   by all that points of both within ``range`` move relative to each other, so that the difference
   of the two is a lower bound of the distance now. */
static int64_t find_closest(const pairs_type *m, int64_t p, double range, vec3 point) {
  const double bound = m->bounds[m->row[p].bound_row];
  double best = INFINITY;
  int64_t begin = m->first[p], end = m->first[p + 1], remembered = m->closest[p], closest = -1;
  for (int64_t trial = begin - 1; trial < end; trial++) {
    int64_t k = trial;
    if (trial < begin) {
      if (remembered < 0) continue;
      k = remembered;
    } else if (k == remembered || m->candidate_next_check[k] - bound >= best) {
      continue;
    }
    triangle t = facet_at(&m->surface, m->x, m->candidate[k]);
    int feature;
    vec3 w = closest_point(point, t, &feature);
    double distance = length(minus(point, mean(w, t.a, t.b, t.c)));
    m->candidate_next_check[k] = no_more_than(bound + least(distance, range));
    if (distance < best) best = distance, closest = k;
  }
  return closest;
}

/* Make the candidate k what is known of the pair p. */
static void know(const pairs_type *m, int64_t p, int64_t k) {
  pair_row *s = m->row + p;
  m->closest[p] = k;
  const int64_t facet = m->candidate[k];
  for (int v = 0; v < 3; v++) s->vertices[v] = m->surface.facets[3 * facet + v];
  for (int i = 0; i < 6; i++) s->bulge[i] = (float)m->bulge_of_facet[6 * facet + i];
  s->sharp = m->sharp[facet];
  s->known = 1;
  s->other_next_check = INFINITY;
  for (int64_t o = m->first[p]; o < m->first[p + 1]; o++)
    if (o != k) s->other_next_check = least(s->other_next_check, m->candidate_next_check[o]);
}

/* Look at the candidates of the pair p, whose point is given; the one that was closest before. */
static int64_t look(const pairs_type *m, int64_t p, double range, vec3 point) {
  const int64_t before = m->closest[p];
  know(m, p, find_closest(m, p, range, point));
  return before;
}

/* A pair comes to the candidate k: all that hangs on both sides. */
static void meet(const pairs_type *m, int64_t p, int64_t k) {
  pair_row *s = m->row + p;
  s->stiffness = stiffness_of(m, s, k);
  s->largest_depth = largest_depth_of(m, s, k);
  s->softer = (float)softer_of(m, s, k);
  s->yield_depth = INFINITY;
  if (!m->strength.tables) return;
  dent_row *d = m->strength.row + p;
  const int32_t facet = m->candidate[k];
  d->edge = edge_of(m, s, k);
  d->layers = m->layer_of_node[s->node] + m->layer_of_facet[facet];
  d->bend = m->curvature_of_point[3 * (int64_t)s->node + 2] +
            m->curvature_of_facet[3 * (int64_t)facet + 2];
  d->reference = s->num_around ? 0.0 : m->area_at_node[s->node];
  flowing_type q = flowing(&m->strength, p, s->softer, corners_at(m->x, s->corner));
  s->yield_depth = (float)yield_depth(&q, d->dent);
}

#endif
