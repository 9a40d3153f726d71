/* One pair: all that can happen to it. What most pairs in contact do is in pairs_lanes.h too. */

#ifndef PAIRS_ONE_H
#define PAIRS_ONE_H

#include "pairs.h"

/* Part of its depth that a point moves by, straight in or out, at least: less came from the side. */
#define STRAIGHT 0.9

/* A length that is nothing beside the facets around a point. */
INLINE double tiny(const pair_row *s) { return 1e-9 * sqrt(s->area); }

/* What the finer side of a pair has in its largest depth. Where one of them is rigid, with a layer
   thicker than its facets', half of the whole. */
INLINE double finer_depth(const pairs_type *m, const pair_row *s, int64_t k) {
  const int32_t facet = m->candidate[k];
  const double own = m->depth_of_node[s->node], other = m->depth_of_facet[facet];
  const double alike = own * sqrt(m->area_of_facet[facet] / m->area_at_node[s->node]) / other;
  return fabs(alike - 1.0) < 0.01 ? least(own, other) : 0.5 * (own + other);
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
INLINE int faces(const pairs_type *m, const pair_row *s, vec3 beneath, vec3 normal) {
  /* Of a point in a facet: its corners. */
  const int32_t *nodes = s->num_around ? m->around + s->around : s->corner;
  const int32_t count = s->num_around ? s->num_around : 3;
  for (int32_t k = 0; k < count; k++)
    if (below(at(m->x, nodes[k]), beneath, normal)) return 0;
  return 1;
}

/* The nearest facet that the node of the pair p is straight behind, no deeper than ``limit``, and
   that its body faces; -1 if none. */
static int64_t find_facing(const pairs_type *m, int64_t p, vec3 point, vec3 beneath, double limit,
                           double *gap, vec3 *weights, vec3 *normal) {
  int64_t best = -1;
  *gap = -limit;
  for (int64_t k = m->first[p]; k < m->first[p + 1]; k++) {
    triangle t = facet_at(&m->surface, m->x, m->candidate[k]);
    vec3 u = normal_of(t);
    double g = dot(minus(point, t.a), u);
    if (!(*gap < g && g < 0.0)) continue;
    vec3 w = project(point, t);
    if (least(w.x, least(w.y, w.z)) >= -BESIDE && faces(m, m->row + p, beneath, u))
      best = k, *gap = g, *weights = w, *normal = u;
  }
  return best;
}

/* Forces of the pair p, which has been looked at where ``looked``, ``before`` being the candidate
   that was closest in the last step. The normal force of a point in a facet is that of its
   place; a vertex that comes in from the side, past a sharp edge, carries from the depth on at
   which it came: where sides of bodies lie in a plane, vertices cross it all the time. So does a
   point of a piece: those of a grain lie in each other, and sides of a crack in each of them. */
static void add_one(const pairs_type *m, call_type *c, int64_t p, int looked, int64_t before) {
  double *x = m->x, *f = m->f;
  pair_row *s = m->row + p;
  const triangle own = corners_at(x, s->corner);
  const vec3 in_facet = place_in_facet(m, s, own), point = stand(s, in_facet, own);

  /* The closest point: most often in the facet where it was, the others being too far. All is
     computed in one place, so that a run that is resumed finds the same last digits. */
  int feature;
  const double bound = m->bounds[s->bound_row];
  triangle t = corners_at(x, s->vertices);
  vec3 w = closest_point(point, t, &feature);
  double distance = length(minus(point, mean(w, t.a, t.b, t.c)));
  if (!looked && s->other_next_check - bound < distance) {
    before = look(m, p, c->range, point);
    t = corners_at(x, s->vertices);
    w = closest_point(point, t, &feature);
    distance = length(minus(point, mean(w, t.a, t.b, t.c)));
  }
  int64_t k = m->closest[p];
  /* Another facet may be as near, and only the nearest one tells on which side the point is. */
  if (!s->closed && !c->accept && distance + least(s->recess, 0.0) > c->left + c->highest) {
    m->next_check[p] = bound + least(most(c->left, 0.0) / c->steepest, c->range);
    return;
  }

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
  const double behind = g - dot(minus(point, in_facet), normal);
  if (s->sharp && behind < BESIDE * sqrt(s->area) && !faces(m, s, in_facet, normal)) {
    double other_gap, limit = 3.0 * largest_depth_of(m, s, k);
    vec3 other_weights, other_normal;
    int64_t other =
        find_facing(m, p, point, in_facet, limit, &other_gap, &other_weights, &other_normal);
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
    const double more = kept_dent(&m->strength, p) - m->strength.row[p].dent;
    if (more > 0.0) m->strength.row[p].dent += more, s->recess += more, g += more;
  }
  const pair_row old = *s;
  const double was = old.offset - old.gap;
  s->weights = w;
  /* The normal of the smooth surface, and by how much faster the gap grows along it. */
  const vec3 steepest = minus(normal, slope);
  const double steep = length(steepest);
  s->facing = normal;
  s->height = height;
  s->normal = times(1.0 / steep, steepest);
  s->gap = g;

  const int can_jump = s->num_around > 0 || s->within;
  const double moved = c->steepest * (bound - m->next_check[p]); /* of the gap, at most */
  if (!s->closed) {
    /* The offset of a pair that moves out follows it, and never grows again. */
    if (s->offset < 0.0) s->offset = least(most(s->offset, g), 0.0);
    if (c->accept && s->offset > g) {
      c->num_accepted += 1.0;
      c->deepest = most(c->deepest, -g);
      s->offset = g;
    }
    /* What is deeper than it can have moved came in from the side. */
    if (can_jump && s->offset - g > moved + tiny(s)) s->offset = g;
  } else if (can_jump && fabs(g - old.gap) > moved + tiny(s)) {
    s->offset = least(s->offset, g + was);
  }
  double depth = s->offset - g;
  const int passed = before >= 0 && before != k;
  const triangle last = passed ? facet_at(&m->surface, x, m->candidate[before]) : t;
  /* Energy and force of before, and the way of the point since, relative to the facet of before. */
  const double old_energy = old.closed ? energy_of(spring_of(s), was, old.shear) : 0.0;
  const vec3 old_force = along(old.shear, old.normal_force, old.normal);
  const vec3 old_foot = mean(old.weights, last.a, last.b, last.c);
  const vec3 beneath = along(point, -old.height, old.facing), way = minus(beneath, old_foot);
  const vec3 old_spring = minus(beneath, mean(s->stick_point, last.a, last.b, last.c));
  if (depth <= 0.0) {
    if (s->closed) {
      const double lost = lost_at_opening(old.shear, across(old_spring, old.facing));
      /* It left over an edge where it did not move out as far as it was deep. */
      if (passed || dot(way, old.normal) < STRAIGHT * was)
        c->switched += old_energy - lost - 0.5 * dot(old_force, way);
      c->dissipated += lost;
      s->work += lost;
      s->closed = s->sliding = 0;
      s->normal_force = 0.0;
      s->shear = (vec3){0.0, 0.0, 0.0};
    }
    /* It closes at its offset, where that lies outside. */
    m->next_check[p] = bound + least(most(g - most(s->offset, 0.0), 0.0) / c->steepest, c->range);
    return;
  }

  const vec3 foot = along(point, -height, normal);
  if (!old.closed || before != k) meet(m, p, k);
  if (!old.closed) {
    s->stick_point = w;
  } else if (passed) {
    /* Another facet: the spring keeps its length and turns with the normal. */
    const vec3 spring = across(old_spring, old.facing), turned = across(spring, normal);
    double now2 = dot(turned, turned);
    double keep = now2 > 0.0 ? sqrt(dot(spring, spring) / now2) : 0.0;
    s->stick_point = stick_point_of(times(keep, turned), foot, normal, facet_normal, t);
  }
  double deeper = 0.0, own_part = 1.0, left = 1.0;
  if (depth > s->yield_depth) {
    flowing_type q = flowing(&m->strength, p, s->softer, own);
    double limit = s->yield_depth;
    deeper = flow(&q, 1, m->strength.row[p].dent, depth, &limit, &left, &own_part);
    s->yield_depth = (float)((1.0 + ROUNDING) * limit);
    depth -= deeper, s->gap += deeper, s->recess += deeper;
  }
  if (depth > s->largest_depth) {
    double sunk = depth / finer_depth(m, s, k);
    if (sunk > c->sunk) c->sunk = sunk, c->sunken = p;
  }
  m->next_check[p] = bound;

  /* Normal force, on the smooth surface, and friction, along the facet. */
  const friction_type mu = friction_of(m, c, s);
  const contact_type contact = {spring_of(s),
                                depth,
                                steep,
                                normal,
                                minus(point, mean(s->stick_point, t.a, t.b, t.c)),
                                old.shear,
                                s->sliding,
                                mu.held,
                                mu.kinetic};
  const carried_type now = carry(contact);
  double flowed = 0.0;
  if (deeper > 0.0) {
    flowed = work_of_dent(contact.of, old.closed ? was : 0.0, old.shear, depth, now.spring, deeper);
    deepen(&m->strength, p, deeper, own_part, left, flowed);
  }
  s->normal_force = now.N;
  s->closed = 1;
  s->sliding = now.sliding;
  s->slip += now.slipped;
  s->work += now.lost;
  c->dissipated += now.lost;
  /* The stick point that leaves just this much of the spring. */
  if (s->sliding) s->stick_point = stick_point_of(now.spring, foot, normal, facet_normal, t);
  s->shear = now.shear;
  const vec3 force = along(now.shear, now.N, s->normal);
  /* What the springs lost beside their work where the facet changed, or where a point came in from
     the side: it did not move in as far as it is deep. */
  const int known = isfinite(old.gap);
  const int came_in = !old.closed && !(known && -dot(way, s->normal) >= STRAIGHT * depth);
  if ((old.closed && (passed || s->offset != old.offset)) || came_in)
    c->switched += old_energy - energy_of(contact.of, depth, now.shear) - now.lost - flowed -
                   (known ? 0.5 * dot(plus(old_force, force), way) : 0.0);
  vec3 on[3];
  forces_on_own(on, force, corner_weights(m, s), s, own);
  for (int i = 0; i < 3; i++) add_to(f, s->corner[i], on[i]);
  forces_on_facet(on, force, w, height, normal, facet_normal, t);
  for (int i = 0; i < 3; i++) add_to(f, s->vertices[i], on[i]);
}

#endif
