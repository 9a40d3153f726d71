/* One pair: all that can happen to it. What most pairs in contact do is in pairs_lanes.h too. */

#ifndef PAIRS_ONE_H
#define PAIRS_ONE_H

#include "contact_law.h"
#include "pairs.h"

/* Part of its depth that a point moves by, straight in or out, at least: less came from the side. */
#define STRAIGHT 0.9

/* A length that is nothing beside the facets around a point. */
INLINE double tiny(const state_type *s) { return 1e-9 * sqrt(s->area); }

/* What the finer side of a pair has in its largest depth. Where one of them is rigid, with a layer
   thicker than its facets', half of the whole. */
INLINE double finer_depth(const pairs_type *m, const state_type *s, int64_t k) {
  const int32_t facet = m->candidate[k];
  const double own = m->depth_of_node[s->node], other = m->depth_of_facet[facet];
  const double alike = own * sqrt(m->area_of_facet[facet] / m->area_at_node[s->node]) / other;
  return fabs(alike - 1.0) < 0.01 ? least(own, other) : 0.5 * (own + other);
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

/* Whether a body can rest with its point p on a plane of the given normal, towards the body. The
   facet closest to a node just inside a sharp edge can be one that the body around the node cannot
   touch: pushed out there, the node would slip off the edge while its body stays inside. A body
   rests with a node on a plane only if no node around it lies below. */
INLINE int below(vec3 node, vec3 p, vec3 normal) {
  vec3 d = minus(node, p);
  double height = dot(d, normal);
  return height < 0.0 && height * height > FACING * FACING * dot(d, d);
}
INLINE int faces(const pairs_type *m, const state_type *s, vec3 p, vec3 normal) {
  /* Of a point in a facet: its corners. */
  const int32_t *nodes = s->num_around ? m->around + s->around : s->corner;
  const int32_t count = s->num_around ? s->num_around : 3;
  for (int32_t k = 0; k < count; k++)
    if (below(at(m->x, nodes[k]), p, normal)) return 0;
  return 1;
}

/* The nearest facet that the node of the pair p is straight behind, no deeper than ``limit``, and
   that its body faces; -1 if none. */
static int64_t find_facing(const pairs_type *m, int64_t p, vec3 point, double limit, double *gap,
                           vec3 *weights, vec3 *normal) {
  int64_t best = -1;
  *gap = -limit;
  for (int64_t k = m->first[p]; k < m->first[p + 1]; k++) {
    triangle t = facet_at(&m->surface, m->x, m->candidate[k]);
    vec3 u = normal_of(t);
    double g = dot(minus(point, t.a), u);
    if (!(*gap < g && g < 0.0)) continue;
    vec3 w = project(point, t);
    if (least(w.x, least(w.y, w.z)) >= -BESIDE && faces(m, m->state + p, point, u))
      best = k, *gap = g, *weights = w, *normal = u;
  }
  return best;
}

/* Energy of the springs of a closed pair, normal and tangential. */
INLINE double energy_of(const state_type *s, double depth) {
  return stored_energy(s->stiffness, s->softer, depth, s->largest_depth) +
         dot(s->shear, s->shear) / (2.0 * tangential_stiffness(s, depth));
}

/* Forces of the pair p, which has been looked at where ``looked``, ``before`` being the candidate
   that was closest in the last step. The normal force of a point in a facet is that of its
   place; a vertex that comes in from the side, past a sharp edge, carries from the depth on at
   which it came: where sides of bodies lie in a plane, vertices cross it all the time. */
static void add_one(const pairs_type *m, call_type *c, int64_t p, int looked, int64_t before) {
  double *x = m->x, *f = m->f;
  state_type *s = m->state + p;
  const vec3 point = point_of(s, x);

  /* The closest point: most often in the facet where it was, the others being too far. All is
     computed in one place, so that a run that is resumed finds the same last digits. */
  int feature;
  const double bound = m->bounds[s->bound_row];
  triangle t = vertices_at(s->vertices, x);
  vec3 w = closest_point(point, t, &feature);
  double distance = length(minus(point, mean(w, t.a, t.b, t.c)));
  if (!looked && s->other_next_check - bound < distance) {
    before = look(m, p, c->range, point);
    t = vertices_at(s->vertices, x);
    w = closest_point(point, t, &feature);
    distance = length(minus(point, mean(w, t.a, t.b, t.c)));
  }
  int64_t k = m->closest[p];

  /* The gap, and the normal from the facet to the point. */
  vec3 facet_normal = normal_of(t);
  vec3 normal = facet_normal, r = minus(point, mean(w, t.a, t.b, t.c));
  if (feature != INTERIOR)
    normal = pseudo_normal(&m->surface, x, m->candidate[k], feature, facet_normal);
  double g = dot(r, normal) >= 0.0 ? distance : -distance;
  if (feature != INTERIOR)
    normal = distance > tiny(s) ? times(1.0 / g, r) : times(1.0 / length(normal), normal);
  double height = g;
  int beside = 0;
  if (s->sharp && g < BESIDE * sqrt(s->area) && !faces(m, s, point, normal)) {
    double other_gap, limit = 3.0 * largest_depth_of(m, s, k);
    vec3 other_weights, other_normal;
    int64_t other = find_facing(m, p, point, limit, &other_gap, &other_weights, &other_normal);
    /* A node just outside, within BESIDE, counts where it came through that facet. */
    if (other >= 0 && (g < 0.0 || s->closed || -other_gap <= bound - m->next_check[p] + tiny(s))) {
      beside = 1, k = other, g = height = other_gap, w = other_weights, normal = other_normal;
      t = facet_at(&m->surface, x, m->candidate[k]);
      facet_normal = normal;
      know(m, p, k);
    }
  }
  /* Between smooth surfaces, not facets. */
  vec3 slope;
  const double bulge = bulge_at(s, w, t, facet_normal, !beside ? feature : INTERIOR, &slope);
  g += s->recess - bulge;
  if (m->strength.tables && !s->closed && g < s->offset) {
    const double more = kept_dent(&m->strength, p) - m->dent[p];
    if (more > 0.0) set_dent(m, p, m->dent[p] + more), g += more;
  }
  const double old_height = s->height;
  const vec3 old_facing = s->facing, old_normal = s->normal;
  const vec3 old_weights = s->weights, old_shear = s->shear;
  const double old_gap = s->gap, old_offset = s->offset, was = old_offset - old_gap;
  s->weights = w;
  /* The normal of the smooth surface, and by how much faster the gap grows along it. */
  const vec3 steepest = minus(normal, slope);
  const double steep = length(steepest);
  const vec3 smooth = times(1.0 / steep, steepest);
  s->facing = normal;
  s->height = height;
  s->normal = smooth;
  s->gap = g;

  const int is_vertex = s->num_around > 0;
  const double moved = bound - m->next_check[p];
  if (!s->closed) {
    /* The offset of a pair that moves out follows it, and never grows again. */
    if (s->offset < 0.0) s->offset = least(most(s->offset, g), 0.0);
    if (c->accept && s->offset > g) {
      c->num_accepted += 1.0;
      c->deepest = most(c->deepest, -g);
      s->offset = g;
    }
    /* A vertex deeper than it can have moved came in from the side. */
    if (is_vertex && s->offset - g > moved + tiny(s)) s->offset = g;
  } else if (is_vertex && fabs(g - old_gap) > moved + tiny(s)) {
    s->offset = least(s->offset, g + was);
  }
  double depth = s->offset - g;
  const int passed = before >= 0 && before != k;
  const triangle old = passed ? facet_at(&m->surface, x, m->candidate[before]) : t;
  /* Energy and force of before, and the way of the point since, relative to the facet of before. */
  const int was_closed = s->closed;
  const double old_energy = was_closed ? energy_of(s, was) : 0.0;
  const vec3 old_force = along(old_shear, s->normal_force, old_normal);
  const vec3 old_foot = mean(old_weights, old.a, old.b, old.c);
  const vec3 beneath = along(point, -old_height, old_facing), way = minus(beneath, old_foot);
  if (depth <= 0.0) {
    if (s->closed) {
      const vec3 spring = minus(beneath, mean(s->stick_point, old.a, old.b, old.c));
      const double lost = lost_at_opening(old_shear, across(spring, old_facing));
      /* It left over an edge where it did not move out as far as it was deep. */
      if (passed || dot(way, old_normal) < STRAIGHT * was)
        c->switched += old_energy - lost - 0.5 * dot(old_force, way);
      c->dissipated += lost;
      s->work += lost;
      s->closed = s->sliding = 0;
      s->normal_force = 0.0;
      s->shear = (vec3){0.0, 0.0, 0.0};
    }
    m->next_check[p] = bound + least(most(g, 0.0) / c->steepest, c->range);
    return;
  }

  const vec3 foot = along(point, -height, normal);
  if (!was_closed || before != k) {
    s->stiffness = stiffness_of(m, s, k);
    s->largest_depth = largest_depth_of(m, s, k);
    s->softer = softer_of(m, s, k);
    s->yield_depth = (float)yield_depth(&m->strength, flowing(m, p, k), m->dent[p]);
  }
  double deeper = 0.0;
  if (depth > s->yield_depth) {
    deeper = deepen(m, p, k, depth);
    depth -= deeper, g += deeper;
    s->gap = g;
  }
  if (!was_closed) {
    s->stick_point = w;
  } else if (passed) {
    /* Another facet: the spring keeps its length and turns with the normal. */
    vec3 spring = minus(beneath, mean(s->stick_point, old.a, old.b, old.c));
    spring = across(spring, old_facing);
    vec3 turned = across(spring, normal);
    double now2 = dot(turned, turned);
    double keep = now2 > 0.0 ? sqrt(dot(spring, spring) / now2) : 0.0;
    s->stick_point = stick_point_of(times(keep, turned), foot, normal, facet_normal, t);
  }
  if (depth > s->largest_depth) {
    double sunk = depth / finer_depth(m, s, k);
    if (sunk > c->sunk) c->sunk = sunk, c->sunken = p;
  }
  m->next_check[p] = bound;

  /* Normal force, on the smooth surface, and friction, along the facet. */
  const double kn = s->stiffness, kt = tangential_stiffness(s, depth);
  const double kt_slope = steep * tangential_slope(s, depth);
  double N = steep * normal_force(kn, s->softer, depth, s->largest_depth);
  vec3 spring = minus(point, mean(s->stick_point, t.a, t.b, t.c));
  const friction_type mu = friction_of(m, c, s);
  const slip_type found =
      slip(&spring, normal, kt, s->sliding, limit_of_friction(mu.held, N, kt, kt_slope),
           limit_of_friction(mu.kinetic, N, kt, kt_slope), old_shear);
  const double left = dot(spring, spring);
  const double flowed =
      deeper > 0.0 ? work_of_dent(m, p, deeper, was_closed ? was : 0.0, old_shear, depth, left) : 0.0;
  N += 0.5 * kt_slope * left;
  s->normal_force = N;
  s->closed = 1;
  s->sliding = found.sliding;
  s->slip += found.slipped;
  s->work += found.lost;
  c->dissipated += found.lost;
  /* The stick point that leaves just this much of the spring. */
  if (s->sliding) s->stick_point = stick_point_of(spring, foot, normal, facet_normal, t);
  vec3 shear = times(-kt, spring);
  s->shear = shear;
  const vec3 force = along(shear, N, smooth);
  /* What the springs lost beside their work where the facet changed, or where a point came in from
     the side: it did not move in as far as it is deep. */
  const int known = isfinite(old_gap);
  const int came_in = !was_closed && !(known && -dot(way, smooth) >= STRAIGHT * depth);
  if ((was_closed && (passed || s->offset != old_offset)) || came_in)
    c->switched += old_energy - energy_of(s, depth) - found.lost - flowed -
                   (known ? 0.5 * dot(plus(old_force, force), way) : 0.0);
  for (int corner = 0; corner < 3; corner++)
    add_to(f, s->corner[corner], times((&s->corner_weight.x)[corner], force));

  /* Couple of the height and the part of the force in the facet, as normal forces on it,
     h_i = height grad N_i . T, less what is across the facet, along the normal, where that is of
     an edge or vertex. */
  const vec3 e1 = minus(t.b, t.a), e2 = minus(t.c, t.a);
  const vec3 in_plane = along(force, -dot(force, facet_normal) / dot(normal, facet_normal), normal);
  const double scale = height / dot(facet_normal, cross(e1, e2));
  /* grad N_b = (e2 x n)/2A and grad N_c = (n x e1)/2A */
  const double hb = scale * dot(in_plane, cross(e2, facet_normal));
  const double hc = scale * dot(in_plane, cross(facet_normal, e1));
  const int32_t *v = s->vertices;
  add_to(f, v[0], along(times(-hb - hc, normal), -w.x, force));
  add_to(f, v[1], along(times(hb, normal), -w.y, force));
  add_to(f, v[2], along(times(hc, normal), -w.z, force));
}

#endif
