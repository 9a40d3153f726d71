/* Contact of nodes, or of points in facets, with rigid planes, cylinders and spheres. The law and
   all arrays are described in kernels/walls.py. */

#include "contact_law.h"
#include "due.h"
#include "flow.h"

/* What a pair keeps, three cache lines in rows of four numbers; the stick point from ``point`` of the
   wall. ``corner``: nodes around a point in a facet, or thrice the node; the first has a weight of
   its own, the others share the rest. */
typedef struct {
  int32_t corner[3];
  uint8_t closed, sliding;
  uint16_t wall; /* and above it the weight's place in LEAD */
  double recess, ratio;
  double gap, offset, stiffness, normal_force;
  vec3 stick_point;
  double slip;
  vec3 shear;
  double work;
  double softer, dent, yield_depth, edge; /* m of the law; as in kernels/flow.h */
  double layer, slope_left, bend, unused; /* of the law where the dent deepens, for tangents */
} state_type;

#define WALL_BITS 14
#define TINY 1e-300 /* keeps what divides by a length from dividing by none */
static const double LEAD[] = {1.0, 1.0 / 3.0, 2.0 / 3.0};

INLINE int wall_of(const state_type *s) { return s->wall & ((1 << WALL_BITS) - 1); }
INLINE double lead_of(const state_type *s) { return LEAD[s->wall >> WALL_BITS]; }

/* A wall where it stands now, then what acts on it: sums of each lane. ``axis``: normal of a plane,
   axis of a cylinder, zero for a sphere. ``radius``: 0 of a plane, negative where the sample is
   outside. */
typedef struct {
  vec3 axis;
  double friction;
  vec3 point;
  double friction_kinetic;
  double radius, unused[3];
  double force[3][8], torque[3][8], pressing[8];
} wall_type;
_Static_assert(sizeof(wall_type) == 68 * sizeof(double), "WALL in walls.py");

/* In the order of kernels/walls.py. */
typedef struct {
  state_type *state;
  double *next_check;
  const double *bounds; /* of the pairs' grains and walls, and which of them is whose */
  const int32_t *bound_row;
  int32_t *scratch;
  wall_type *walls;
  const double *x;
  double *f, *wall_force, *wall_torque, *pressing;
  const double *point, *axis, *velocity, *radius, *friction, *friction_kinetic;
  strength_type strength;
} walls_type;

/* Ask for what the pairs after the i-th of the list need; from i = -FAR_AHEAD on. */
INLINE void fetch_ahead(const walls_type *m, int64_t i, int64_t num_due) {
  if (i + FAR_AHEAD < num_due) {
    const char *row = (const char *)(m->state + m->scratch[i + FAR_AHEAD]);
    for (size_t at = 0; at < sizeof(state_type); at += 64) FETCH(row + at);
  }
  if (i + AHEAD >= 0 && i + AHEAD < num_due) {
    const state_type *s = m->state + m->scratch[i + AHEAD];
    for (int k = 0; k < 3; k++) {
      FETCH_ROW(m->x, s->corner[k]);
      FETCH_ROW(m->f, s->corner[k]);
    }
  }
}

/* Gap of a point r from ``point`` of a wall, and the normal there, which points into the sample. */
INLINE double gap_to(const wall_type *wall, vec3 r, vec3 *normal) {
  const double along_axis = dot(r, wall->axis), R = wall->radius;
  *normal = wall->axis;
  if (R == 0.0) return along_axis;
  const vec3 away = along(r, -along_axis, wall->axis);
  const double distance = sqrt(dot(away, away)), side = R > 0.0 ? 1.0 : -1.0;
  *normal = times(-side / most(distance, TINY), away);
  return R - side * distance;
}

/* What the pair p has to flow. */
INLINE flowing_type flowing(const walls_type *m, const state_type *s, int64_t p) {
  const int is_tip = lead_of(s) == 1.0;
  const double reference = TRIANGLE * s->edge * s->edge;
  return (flowing_type){p, is_tip, s->softer, s->edge, s->layer, s->bend,
                        stretch_of(s->corner, is_tip, m->x, reference)};
}

/* One pair: all that can happen to it. */
static void add_one(const walls_type *m, double *totals, int64_t p, int64_t accept) {
  state_type *s = m->state + p;
  wall_type *wall = m->walls + wall_of(s);
  const int32_t *c = s->corner;
  const double bound = m->bounds[m->bound_row[p]];
  const double lead = lead_of(s), rest = 0.5 * (1.0 - lead);
  const vec3 weights = {lead, rest, rest};
  const vec3 point = mean(weights, at(m->x, c[0]), at(m->x, c[1]), at(m->x, c[2]));
  const vec3 r = minus(point, wall->point);
  vec3 normal;
  double g = gap_to(wall, r, &normal) + s->recess;
  if (m->strength.tables && !s->closed && g + s->dent < s->offset)
    s->dent = most(s->dent, kept_dent(&m->strength, p));
  g += s->dent;
  s->gap = g;
  if (!s->closed) {
    if (s->offset < 0.0) s->offset = least(most(s->offset, g), 0.0);
    if (accept && g < s->offset) {
      totals[1] += 1.0;
      s->offset = g;
    }
  }
  double depth = s->offset - g;
  if (depth <= 0.0) {
    if (s->closed) {
      double lost = lost_at_opening(s->shear, across(minus(r, s->stick_point), normal));
      totals[0] += lost;
      s->work += lost;
      s->closed = s->sliding = 0;
      s->normal_force = 0.0;
      s->shear = (vec3){0.0, 0.0, 0.0};
    }
    m->next_check[p] = bound + most(g, 0.0);
    return;
  }
  m->next_check[p] = bound;
  if (!s->closed) {
    s->closed = 1;
    s->stick_point = r;
    s->yield_depth = yield_depth(&m->strength, flowing(m, s, p), s->dent);
  }
  double deeper = 0.0;
  if (depth > s->yield_depth) {
    deeper = flow(&m->strength, flowing(m, s, p), s->dent, depth, &s->yield_depth, &s->slope_left);
    s->dent += deeper, depth -= deeper, s->gap += deeper;
  }
  const double share = s->stiffness * share_of_stiffness(depth, s->softer);
  const double kt = share * s->ratio;
  const double kt_slope = s->stiffness * s->ratio * slope_of_share(depth, s->softer);
  double N = share * depth;
  vec3 spring = minus(r, s->stick_point);
  const slip_type found =
      slip(&spring, normal, kt, s->sliding, limit_of_friction(wall->friction, N, kt, kt_slope),
           limit_of_friction(wall->friction_kinetic, N, kt, kt_slope), s->shear);
  N += 0.5 * kt_slope * dot(spring, spring);
  if (deeper > 0.0) m->strength.work[m->strength.cell[p]] += 0.5 * (s->normal_force + N) * deeper;
  s->normal_force = N;
  s->sliding = found.sliding;
  s->slip += found.slipped;
  s->work += found.lost;
  totals[0] += found.lost;
  if (s->sliding) s->stick_point = minus(r, spring);
  s->shear = times(-kt, spring);
  const vec3 force = along(s->shear, N, normal), torque = cross(force, r);
  for (int k = 0; k < 3; k++) add_to(m->f, c[k], times(k ? rest : lead, force));
  wall->pressing[0] += N;
  wall->force[0][0] -= force.x, wall->force[1][0] -= force.y, wall->force[2][0] -= force.z;
  wall->torque[0][0] += torque.x, wall->torque[1][0] += torque.y, wall->torque[2][0] += torque.z;
}

/* Add what acts on a wall in the ``lanes``. */
INLINE void add_where(mask lanes, double sums[3][8], vec sign, lanes3 a) {
  const vec part[3] = {a.x, a.y, a.z};
  for (int k = 0; k < 3; k++) *(vec_at *)sums[k] += where(lanes, sign * part[k], all(0.0));
}

/* The same of pairs ``pair[0]`` to ``pair[LANES - 1]`` so far as they stay closed, or in front of
   the wall. The pairs that were not done, as bits. */
INLINE unsigned add_lanes(const walls_type *m, const int32_t *pair, unsigned wanted,
                          int any_curved, vec *dissipated) {
  double *rows[LANES], *wall_rows[LANES];
  int32_t node[3][LANES];
  vec lead, bound;
  mask of_wall;
#pragma GCC unroll 8
  for (int i = 0; i < LANES; i++) {
    state_type *s = m->state + pair[i];
    rows[i] = (double *)s;
    wall_rows[i] = (double *)(m->walls + wall_of(s));
    lead[i] = lead_of(s);
    of_wall[i] = wall_of(s);
    bound[i] = m->bounds[m->bound_row[pair[i]]];
    for (int k = 0; k < 3; k++) node[k][i] = s->corner[k];
  }
  vec head[4], spring_row[4], stick_point_row[4], shear_row[4], wall[4], place[4], shape[4], law[4];
  load_four(head, rows, 0);
  load_four(spring_row, rows, IN_ROW(gap));
  load_four(stick_point_row, rows, IN_ROW(stick_point));
  load_four(shear_row, rows, IN_ROW(shear));
  load_four(law, rows, IN_ROW(softer));
  load_four(wall, wall_rows, 0);
  load_four(place, wall_rows, 4);
  const mask flags = (mask)head[1];
  const vec rest = 0.5 * (1.0 - lead), weight[3] = {lead, rest, rest};
  const lanes3 axis = {wall[0], wall[1], wall[2]};
  const lanes3 point = mean_of((lanes3){weight[0], weight[1], weight[2]}, rows_at(m->x, node[0]),
                               rows_at(m->x, node[1]), rows_at(m->x, node[2]));
  const lanes3 r = difference(point, (lanes3){place[0], place[1], place[2]});
  lanes3 n = axis;
  vec distance = product(r, axis);
  if (any_curved) {
    load_four(shape, wall_rows, 8);
    const vec R = shape[0], side = where(R > 0.0, all(1.0), all(-1.0));
    const lanes3 away = moved_along(r, -distance, axis);
    const vec length = square_root(product(away, away));
    const vec longest = where(length > TINY, length, all(TINY));
    const mask is_plane = R == 0.0;
    n = where_each(is_plane, axis, scaled(-side / longest, away));
    distance = where(is_plane, distance, R - side * length);
  }
  const vec g = distance + head[2] + law[1], depth = spring_row[1] - g;
  const mask closed = FLAG(flags, closed), in_front = ~closed & (g >= 0.0) & (depth <= 0.0);
  const unsigned can = wanted & bits(closed & (depth > 0.0) & (depth <= law[2])), open = wanted & bits(in_front);

  const vec share = spring_row[2] * share_of_stiffness_each(depth, law[0]);
  const vec kt = share * head[3];
  const vec kt_slope = spring_row[2] * head[3] * slope_of_share_each(depth, law[0]);
  vec N = share * depth;
  const lanes3 stick_point = {stick_point_row[0], stick_point_row[1], stick_point_row[2]};
  lanes3 spring = difference(r, stick_point);
  const slips_type found =
      slip_each(&spring, n, kt, FLAG(flags, sliding), limit_of_friction_each(wall[3], N, kt, kt_slope),
                limit_of_friction_each(place[3], N, kt, kt_slope),
                (lanes3){shear_row[0], shear_row[1], shear_row[2]});
  N += 0.5 * kt_slope * product(spring, spring);
  const mask sliding = found.sliding;
  const lanes3 new_stick_point = where_each(sliding, difference(r, spring), stick_point);
  const lanes3 shear = scaled(-kt, spring), force = moved_along(shear, N, n);
  const lanes3 torque = across_both(force, r);

  v4 on[3][LANES];
  for (int k = 0; k < 3; k++) to_memory(on[k], scaled(weight[k], force));
  vec dissipates = found.lost;
  /* What was accepted behind the wall is free again; a multiplier's offset is positive and stays. */
  spring_row[0] = g;
  spring_row[1] = where(in_front & (spring_row[1] < 0.0), all(0.0), spring_row[1]);
  spring_row[3] = where(in_front, all(0.0), N);
  stick_point_row[0] = new_stick_point.x, stick_point_row[1] = new_stick_point.y;
  stick_point_row[2] = new_stick_point.z;
  stick_point_row[3] += found.slipped;
  shear_row[0] = shear.x, shear_row[1] = shear.y, shear_row[2] = shear.z, shear_row[3] += found.lost;
  store_four(spring_row, rows, IN_ROW(gap), can | open);
  store_four(stick_point_row, rows, IN_ROW(stick_point), can);
  store_four(shear_row, rows, IN_ROW(shear), can);
  const unsigned slides = bits(sliding);
  const mask done = lanes_of(can);
  for (unsigned left = can; left;) {
    const int64_t number = of_wall[__builtin_ctz(left)];
    const mask here = done & (of_wall == number);
    add_where(here, m->walls[number].force, all(-1.0), force);
    add_where(here, m->walls[number].torque, all(1.0), torque);
    *(vec_at *)m->walls[number].pressing += where(here, N, all(0.0));
    left &= ~bits(here);
  }
#pragma GCC unroll 8
  for (int i = 0; i < LANES; i++) {
    if (!(can >> i & 1)) {
      dissipates[i] = 0.0;
      continue;
    }
    ((state_type *)rows[i])->sliding = slides >> i & 1;
    m->next_check[pair[i]] = bound[i];
    for (int k = 0; k < 3; k++) add_row(m->f, node[k][i], on[k][i]);
  }
  for (unsigned left = open; left; left &= left - 1) {
    const int i = __builtin_ctz(left);
    m->next_check[pair[i]] = bound[i] + g[i];
  }
  *dissipated += dissipates;
  return wanted & ~(can | open);
}

/* See kernels/walls.py; ``totals``: energy dissipated by friction, accepted pairs. */
void mufe_add_wall_forces(const walls_type *m, double *totals, double ahead, int64_t num_pairs,
                          int64_t num_walls, int64_t accept) {
  int any_curved = 0;
  for (int64_t w = 0; w < num_walls; w++) {
    any_curved |= m->radius[w] != 0.0;
    const vec3 point = along(at(m->point, w), ahead, at(m->velocity, w));
    m->walls[w] = (wall_type){at(m->axis, w), m->friction[w], point, m->friction_kinetic[w],
                              m->radius[w], {0.0}, {{0.0}}, {{0.0}}, {0.0}};
  }
  totals[0] = totals[1] = 0.0;
  vec dissipated = all(0.0);
  const int64_t num_due = find_due(m->scratch, m->next_check, m->bounds, m->bound_row, num_pairs);
  for (int64_t i = -FAR_AHEAD; i < num_due; i += LANES) {
    for (int k = 0; k < LANES; k++) fetch_ahead(m, i + k, num_due);
    if (i < 0) continue;
    const int count = num_due - i < LANES ? (int)(num_due - i) : LANES;
    int32_t pair[LANES];
    for (int k = 0; k < LANES; k++) pair[k] = m->scratch[i + (k < count ? k : 0)];
    unsigned left = (1u << count) - 1;
    if (TOGETHER) left = add_lanes(m, pair, left, any_curved, &dissipated);
    for (; left; left &= left - 1) add_one(m, totals, pair[__builtin_ctz(left)], accept);
  }
  for (int k = 0; k < LANES; k++) totals[0] += dissipated[k];
  for (int64_t w = 0; w < num_walls; w++)
    for (int i = 0; i < LANES; i++) m->pressing[w] += m->walls[w].pressing[i];
  for (int64_t w = 0; w < num_walls; w++)
    for (int k = 0; k < 3; k++)
      for (int i = 0; i < LANES; i++) {
        m->wall_force[3 * w + k] += m->walls[w].force[k][i];
        m->wall_torque[3 * w + k] += m->walls[w].torque[k][i];
      }
}
