/* Derivatives of the forces of closed contacts by the positions of their nodes, as blocks of two
   nodes; all arrays are described in kernels/contact/tangents.py.

   A contact joins a point and a facet, two edges, or a point and a wall, so that central differences
   over all of their coordinates cost little. Its force is that of a step (law.h, pairs.h,
   edge_springs.h), where facet, feature, side, normal spring and offset are those of the last
   evaluation, and whether it slips. */

#include "edge_springs.h"
#include "pairs.h"
#include "walls.h"

#define STEP 1e-5  /* of the differences over the size of a contact; at a wall over its lengths */
#define NEAR 1e-4  /* the same over lengths by which the law bends and directions turn */
#define LEAST 1e-9 /* least step over the size of a contact */
#define SAME 1e-7  /* a foot found again is the same up to this part of a facet */
#define ON_IT \
  1e-8 /* a point is on an edge or a vertex that is nearer, over the size of a contact */

/* In the order of kernels/contact/tangents.py. */
typedef struct {
  int32_t *rows, *columns;
  double *blocks;
  const void *row, *before; /* of the pairs, and what these were before the increment */
  const dent_row *dent, *dent_before;
  const double *weights, *friction;
  const double *x, *point, *axis, *radius; /* the last three of walls */
  edges_type edges;
} tangent_type;

/* What of a pair of a point and a facet stays as it is. ``left``: part of the law's slope, from the
   ``depth`` on. */
typedef struct {
  const pair_row *row;
  spring_type of;
  int feature, is_on_it; /* its normal is then the one that it has */
  int slips;
  double kinetic, depth, left;
  vec3 stick_point, weights;
} frozen_pair;

#define MOST 6 /* nodes of a contact */

/* Part of the law's slope that the pair has left. */
INLINE double slope_left(const tangent_type *m, int64_t p) {
  const int deepens = m->dent && m->dent[p].dent > m->dent_before[p].dent;
  return deepens ? (double)m->dent[p].slope_left : 1.0;
}

/* Weights of the foot of a point on a feature that goes on beyond its end. */
INLINE vec3 foot_on(int feature, vec3 point, triangle t) {
  if (feature == INTERIOR) return project(point, t);
  if (feature < EDGE)
    return (vec3){feature == VERTEX, feature == VERTEX + 1, feature == VERTEX + 2};
  const vec3 from[3] = {t.a, t.b, t.c}, to = feature == EDGE       ? t.b
                                             : feature == EDGE + 1 ? t.c
                                                                   : t.a;
  const vec3 edge = minus(to, from[feature - EDGE]);
  const double s = dot(edge, minus(point, from[feature - EDGE])) / dot(edge, edge);
  return feature == EDGE       ? (vec3){1.0 - s, s, 0.0}
         : feature == EDGE + 1 ? (vec3){0.0, 1.0 - s, s}
                               : (vec3){s, 0.0, 1.0 - s};
}

/* Forces on the corners x[0] to x[2] of the point and on the vertices x[3] to x[5] of the facet. */
static void forces_of_pair(const void *pair, const vec3 x[MOST], vec3 f[MOST]) {
  const frozen_pair *q = pair;
  const pair_row *s = q->row;
  const triangle own = {x[0], x[1], x[2]}, t = {x[3], x[4], x[5]};
  const vec3 point = stand(s, mean(q->weights, own.a, own.b, own.c), own);
  const vec3 w = foot_on(q->feature, point, t), r = minus(point, mean(w, t.a, t.b, t.c));
  const vec3 facet_normal = normal_of(t);
  vec3 normal = q->is_on_it ? s->facing : facet_normal;
  double height = dot(r, normal);
  if (q->feature != INTERIOR && !q->is_on_it) {
    height = s->height >= 0.0 ? length(r) : -length(r);
    normal = times(1.0 / height, r);
  }
  vec3 slope;
  const double bulge = bulge_at(s, w, t, facet_normal, q->feature, &slope);
  const vec3 steepest = minus(normal, slope);
  const double steep = length(steepest), depth = s->offset - height - s->recess + bulge;
  const carried_type now =
      carry_as((contact_type){q->of,
                              q->depth + q->left * (depth - q->depth),
                              steep,
                              normal,
                              minus(point, mean(q->stick_point, t.a, t.b, t.c)),
                              {0.0, 0.0, 0.0},
                              q->slips,
                              q->kinetic,
                              q->kinetic},
               1);
  const vec3 force = along(now.shear, now.N / steep, steepest);
  forces_on_own(f, force, q->weights, s, own);
  forces_on_facet(f + 3, force, w, height, normal, facet_normal, t);
}

/* Add a block: minus the derivative d, by column. */
INLINE void put_block(const tangent_type *m, int64_t b, int32_t row, int32_t column,
                      const vec3 d[3]) {
  double *block = m->blocks + 9 * b;
  m->rows[b] = row, m->columns[b] = column;
  for (int k = 0; k < 3; k++) block[k] = -d[k].x, block[3 + k] = -d[k].y, block[6 + k] = -d[k].z;
}
INLINE double *coordinate(vec3 *x, int k) { return k == 0 ? &x->x : k == 1 ? &x->y : &x->z; }

/* Derivatives d[i][j][k] of the force on each i of ``num`` by the coordinates k of each j. */
INLINE void differ(void (*forces)(const void *pair, const vec3 x[MOST], vec3 f[MOST]),
                   const void *pair, int num, vec3 x[MOST], double step, vec3 d[MOST][MOST][3]) {
  for (int j = 0; j < num; j++)
    for (int k = 0; k < 3; k++) {
      double *moved = coordinate(x + j, k);
      const double here = *moved;
      vec3 more[MOST], less[MOST];
      *moved = here + step;
      forces(pair, x, more);
      *moved = here - step;
      forces(pair, x, less);
      *moved = here;
      for (int i = 0; i < num; i++) d[i][j][k] = times(0.5 / step, minus(more[i], less[i]));
    }
}

/* See kernels/contact/tangents.py. */
void mufe_pair_tangent(const tangent_type *m, int64_t num_before, int64_t num_pairs) {
  const pair_row *before = m->before;
  int64_t b = 0;
  for (int64_t p = 0; p < num_pairs; p++) {
    const pair_row *s = (const pair_row *)m->row + p;
    if (!s->closed) continue;
    /* Relative to one of the nodes. */
    const vec3 from = at(m->x, s->corner[0]), weights = at(m->weights, s->rule);
    const triangle c = corners_at(m->x, s->corner), v = corners_at(m->x, s->vertices);
    vec3 x[MOST] = {minus(c.a, from), minus(c.b, from), minus(c.c, from),
                    minus(v.a, from), minus(v.b, from), minus(v.c, from)};
    const triangle own = {x[0], x[1], x[2]}, t = {x[3], x[4], x[5]};
    const vec3 point = stand(s, mean(weights, own.a, own.b, own.c), own);
    frozen_pair q = {s,
                     spring_of(s),
                     INTERIOR,
                     0,
                     0,
                     0.0,
                     s->offset - s->gap,
                     slope_left(m, p),
                     s->stick_point,
                     weights};
    const vec3 off = minus(closest_point(point, t, &q.feature), s->weights);
    /* The plane of a facet that it came through beside a sharp edge. */
    if (fabs(off.x) + fabs(off.y) + fabs(off.z) > SAME) q.feature = INTERIOR;
    const double size_of_it = sqrt(s->area);
    q.is_on_it = q.feature != INTERIOR && fabs(s->height) <= ON_IT * size_of_it;
    double near = s->softer > 0.0f ? s->softer : INFINITY;
    if (q.feature != INTERIOR && !q.is_on_it) near = least(near, fabs(s->height));
    const double mu = m->friction[2 * (int64_t)s->friction + 1], limit = mu * s->normal_force;
    if (!before[p].closed || (s->sliding && !(limit > 0.0))) {
      q.of.ratio = 0.0; /* the stick point begins where the point is now, or nothing holds it */
    } else if (s->sliding) { /* back to the spring before the slip */
      q.slips = 1, q.kinetic = mu;
      const double trial = limit / tangential_stiffness(q.of, q.depth) + s->slip - before[p].slip;
      near = least(near, trial);
      q.stick_point =
          stick_point_of(times(-trial / limit, s->shear), along(point, -s->height, s->facing),
                         s->facing, normal_of(t), t);
    }
    const double step = most(least(STEP * size_of_it, NEAR * near), LEAST * size_of_it);
    vec3 d[MOST][MOST][3];
    differ(forces_of_pair, &q, MOST, x, step, d);
    int32_t node[MOST];
    for (int i = 0; i < 3; i++)
      node[i] = s->corner[i] - num_before, node[3 + i] = s->vertices[i] - num_before;
    for (int i = 0; i < MOST; i++)
      for (int j = 0; j < MOST; j++) put_block(m, b++, node[i], node[j], d[i][j]);
  }
}

/* What of a crossing of edges stays as it is; ``begin``: gap at which it is closed. */
typedef struct {
  const edge_pair_row *row;
  even_type even;
  int slips;
  double side, begin, compliance, other_compliance, ratio, kinetic;
  place_type stick_point;
} frozen_edges;

/* Forces on the ends x of two edges, the first one's first. */
static void forces_of_edges(const void *pair, const vec3 x[MOST], vec3 f[MOST]) {
  const frozen_edges *q = pair;
  const two_edges both = {minus(x[1], x[0]), minus(x[3], x[2])};
  const vec3 w = minus(x[0], x[2]), n = cross(both.u, both.v);
  const vec3 normal = times(q->side / length(n), n);
  const double gap = dot(w, normal), depth = q->begin - gap, largest = q->row->largest_depth;
  const place_type at = parts_along(both, -dot(both.u, w), -dot(both.v, w));
  const series_type k = in_series(q->even, at, q->compliance, q->other_compliance);
  place_type by = {q->stick_point.s - at.s, q->stick_point.t - at.t};
  double keep;
  coulomb_as(q->ratio * length(between(both, by)), 0.0,
             q->kinetic * normal_force(1.0, 0.0, depth, largest), q->slips, 1, &keep);
  by = (place_type){keep * by.s, keep * by.t};
  const vec3 spring = between(both, by);
  const double kt = q->ratio * k.stiffness;
  const double stored =
      stored_energy(1.0, 0.0, depth, largest) + 0.5 * q->ratio * dot(spring, spring);
  const push_type push = push_along(both, (place_type){k.slope.s * stored, k.slope.t * stored});
  forces_on_ends(f, normal_force(k.stiffness, 0.0, depth, largest), kt, at, by, gap, normal,
                 times(-kt, spring), push);
}

/* See kernels/contact/tangents.py. */
void mufe_edge_tangent(const tangent_type *m, int64_t num_before, int64_t num_pairs) {
  const edge_pair_row *before = m->before;
  const edges_type *e = &m->edges;
  int64_t b = 0;
  for (int64_t p = 0; p < num_pairs; p++) {
    const edge_pair_row *s = (const edge_pair_row *)m->row + p;
    if (!s->closed) continue;
    const int32_t i = s->first, j = s->second;
    int32_t node[4] = {e->ends[2 * i], e->ends[2 * i + 1], e->ends[2 * j], e->ends[2 * j + 1]};
    vec3 x[MOST];
    for (int k = 0; k < 4; k++) x[k] = minus(at(m->x, node[k]), at(m->x, node[0]));
    for (int k = 0; k < 4; k++) node[k] -= num_before;
    const vec3 u = minus(x[1], x[0]), v = minus(x[3], x[2]);
    const place_type place = {s->place[0], s->place[1]};
    frozen_edges q = {s,
                      at_place(e, i, j, place),
                      0,
                      copysign(1.0, dot(s->normal, cross(u, v))),
                      s->offset - s->recess,
                      e->compliance[i],
                      e->compliance[j],
                      s->ratio,
                      0.0,
                      {s->stick_point[0], s->stick_point[1]}};
    const double kt = s->stiffness * s->ratio, slipped = s->slip - before[p].slip;
    const double mu = m->friction[2 * (int64_t)s->friction + 1];
    const double limit = mu * normal_force(s->stiffness, 0.0, q.begin - s->gap, s->largest_depth);
    double near = INFINITY;
    if (!before[p].closed || (slipped > 0.0 && !(limit > 0.0))) {
      q.ratio = 0.0;
    } else if (slipped > 0.0) { /* back to the spring before the slip */
      q.slips = 1, q.kinetic = mu, near = limit / kt + slipped;
      const double back = near * kt / limit;
      q.stick_point = (place_type){place.s + back * (q.stick_point.s - place.s),
                                   place.t + back * (q.stick_point.t - place.t)};
    }
    const double shortest = least(length(u), length(v));
    const double step = most(least(STEP * shortest, NEAR * near), LEAST * shortest);
    vec3 d[MOST][MOST][3];
    differ(forces_of_edges, &q, 4, x, step, d);
    for (int r = 0; r < 4; r++)
      for (int c = 0; c < 4; c++) put_block(m, b++, node[r], node[c], d[r][c]);
  }
}

/* See kernels/contact/tangents.py. */
void mufe_wall_tangent(const tangent_type *m, int64_t num_before, int64_t num_pairs) {
  const wall_pair_row *before = m->before;
  int64_t b = 0;
  for (int64_t p = 0; p < num_pairs; p++) {
    const wall_pair_row *s = (const wall_pair_row *)m->row + p;
    if (!s->closed) continue;
    const vec3 axis = at(m->axis, wall_of(s)), weights = at(m->weights, rule_of(s));
    const triangle c = corners_at(m->x, s->corner);
    const vec3 r = minus(mean(weights, c.a, c.b, c.c), at(m->point, wall_of(s)));
    /* The normal of a curved wall turns with the place, by dn = -κ (1 - a aᵀ - n nᵀ) dx. */
    vec3 normal;
    const double R = m->radius[wall_of(s)], gap = gap_to(axis, R, r, &normal);
    const double curvature = R == 0.0 ? 0.0 : 1.0 / (R - gap);
    const double depth = s->offset - s->gap, left = slope_left(m, p);
    contact_type contact = {spring_of_wall(s), depth, 1.0, normal, {0.0, 0.0, 0.0},
                            {0.0, 0.0, 0.0},   0,     0.0, 0.0};
    double near = s->softer > 0.0f ? s->softer : depth; /* a tip that begins to flow has no depth */
    if (depth > 0.0) near = least(near, depth);
    vec3 spring = {0.0, 0.0, 0.0};
    const double T = length(s->shear), kt = tangential_stiffness(contact.of, depth);
    if (!before[p].closed || (s->sliding && T == 0.0)) {
      contact.of.ratio = 0.0;
    } else if (s->sliding) {
      contact.slid = 1, contact.kinetic = m->friction[wall_of(s)];
      const double trial = T / kt + s->slip - before[p].slip;
      near = least(near, trial);
      spring = times(-trial / T, s->shear);
    } else {
      spring = minus(r, s->stick_point);
    }
    vec3 d[3];
    for (int k = 0; k < 3; k++) {
      vec3 force[2];
      for (int sign = 0; sign < 2; sign++) {
        vec3 way = {0.0, 0.0, 0.0};
        *coordinate(&way, k) = (sign ? -STEP : STEP) * near;
        const vec3 n = along(normal, -curvature, across(across(way, axis), normal));
        contact.normal = times(1.0 / length(n), n);
        contact.depth = depth - left * dot(way, normal);
        contact.spring = plus(spring, way);
        const carried_type now = carry_as(contact, 1);
        force[sign] = along(now.shear, now.N, contact.normal);
      }
      d[k] = times(0.5 / (STEP * near), minus(force[0], force[1]));
    }
    const double part[3] = {weights.x, weights.y, weights.z};
    for (int i = 0; i < 3; i++)
      for (int j = 0; j < 3; j++) {
        vec3 of[3];
        for (int k = 0; k < 3; k++) of[k] = times(part[i] * part[j], d[k]);
        put_block(m, b++, s->corner[i] - num_before, s->corner[j] - num_before, of);
      }
  }
}
