/* Contact of nodes, or of points in facets, with rigid planes, cylinders and spheres. The law and
   all arrays are described in kernels/contact/walls.py. */

#include "walls.h"

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

/* In the order of kernels/contact/walls.py. */
typedef struct {
  wall_pair_row *row;
  double *next_check;
  const double *bounds; /* of the pairs' grains and walls, and which of them is whose */
  const int32_t *bound_row;
  int32_t *scratch;
  wall_type *walls;
  const double *weights; /* of the corners of points, a row of three for each rule */
  const double *x;
  double *f, *wall_force, *wall_torque, *pressing;
  const double *point, *axis, *velocity, *radius, *friction, *friction_kinetic;
  strength_type strength;
} walls_type;

/* Ask for the rows of LANES pairs, from place i of the list on. Asking for their nodes too, or for
   what flows, takes longer than it saves. */
INLINE void fetch_rows(const walls_type *m, int64_t i, int64_t num_due) {
  const int64_t end = num_due - i < LANES ? num_due : i + LANES;
#pragma GCC unroll 8
  for (; i < end; i++) {
    const char *row = (const char *)(m->row + m->scratch[i]);
    for (size_t line = 0; line < sizeof(wall_pair_row); line += 64) FETCH(row + line);
  }
}

/* One pair: all that can happen to it. */
static void add_one(const walls_type *m, double *totals, int64_t p, int64_t accept) {
  wall_pair_row *s = m->row + p;
  dent_row *dented = m->strength.tables ? m->strength.row + p : NULL;
  wall_type *wall = m->walls + wall_of(s);
  const int32_t *c = s->corner;
  const double bound = m->bounds[m->bound_row[p]];
  const triangle around = corners_at(m->x, c);
  const vec3 weights = at(m->weights, rule_of(s));
  const vec3 point = mean(weights, around.a, around.b, around.c);
  const vec3 r = minus(point, wall->point);
  vec3 normal;
  double g = gap_to(wall->axis, wall->radius, r, &normal) + s->recess;
  if (dented && !s->closed && g < s->offset) {
    const double more = kept_dent(&m->strength, p) - dented->dent;
    if (more > 0.0) dented->dent += more, s->recess += more, g += more;
  }
  const double was = s->closed ? s->offset - s->gap : 0.0;
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
      s->shear = (vec3){0.0, 0.0, 0.0};
    }
    m->next_check[p] = bound + most(g, 0.0);
    return;
  }
  m->next_check[p] = bound;
  const vec3 old_shear = s->shear;
  if (!s->closed) {
    s->closed = 1;
    s->stick_point = r;
    s->yield_depth = INFINITY;
    if (dented) {
      flowing_type q = flowing(&m->strength, p, s->softer, around);
      s->yield_depth = (float)yield_depth(&q, dented->dent);
    }
  }
  double deeper = 0.0, own_part = 1.0, left = 1.0;
  if (depth > s->yield_depth) {
    flowing_type q = flowing(&m->strength, p, s->softer, around);
    double limit = s->yield_depth;
    deeper = flow(&q, 1, dented->dent, depth, &limit, &left, &own_part);
    s->yield_depth = (float)((1.0 + ROUNDING) * limit);
    depth -= deeper, s->gap += deeper, s->recess += deeper;
  }
  const contact_type contact = {spring_of_wall(s),        depth,     1.0,        normal,
                                minus(r, s->stick_point), old_shear, s->sliding, wall->friction,
                                wall->friction_kinetic};
  const carried_type now = carry(contact);
  if (deeper > 0.0)
    deepen(&m->strength, p, deeper, own_part, left,
           work_of_dent(contact.of, was, old_shear, depth, now.spring, deeper));
  s->sliding = now.sliding;
  s->slip += now.slipped;
  s->work += now.lost;
  totals[0] += now.lost;
  if (s->sliding) s->stick_point = minus(r, now.spring);
  s->shear = now.shear;
  const vec3 force = along(now.shear, now.N, normal), torque = cross(force, r);
  add_to(m->f, c[0], times(weights.x, force));
  add_to(m->f, c[1], times(weights.y, force));
  add_to(m->f, c[2], times(weights.z, force));
  wall->pressing[0] += now.N;
  wall->force[0][0] -= force.x, wall->force[1][0] -= force.y, wall->force[2][0] -= force.z;
  wall->torque[0][0] += torque.x, wall->torque[1][0] += torque.y, wall->torque[2][0] += torque.z;
}

/* Add what acts on a wall in the ``lanes``. */
INLINE void add_where(mask lanes, double sums[3][8], vec sign, vec3_each a) {
  const vec part[3] = {a.x, a.y, a.z};
  for (int k = 0; k < 3; k++) *(vec_at *)sums[k] += where_each(lanes, sign * part[k], all(0.0));
}

/* The same of pairs ``pair[0]`` to ``pair[LANES - 1]`` so far as they stay closed, or in front of
   the wall. The pairs that were not done, as bits. */
INLINE unsigned add_lanes(const walls_type *m, const int32_t *pair, unsigned wanted, int any_curved,
                          vec *dissipated) {
  double *rows[LANES], *wall_rows[LANES];
  int32_t node[3][LANES], rule[LANES];
  vec bound;
  mask of_wall;
#pragma GCC unroll 8
  for (int i = 0; i < LANES; i++) {
    wall_pair_row *s = m->row + pair[i];
    rows[i] = (double *)s;
    wall_rows[i] = (double *)(m->walls + wall_of(s));
    rule[i] = rule_of(s);
    of_wall[i] = wall_of(s);
    bound[i] = m->bounds[m->bound_row[pair[i]]];
    for (int k = 0; k < 3; k++) node[k][i] = s->corner[k];
  }
  vec head[4], spring_row[4], stick[4], shear[4], wall[4], place[4], shape[4];
  load_four(head, rows, 0);
  load_four(spring_row, rows, IN_ROW(wall_pair_row, offset));
  load_four(stick, rows, IN_ROW(wall_pair_row, stick_point));
  load_four(shear, rows, IN_ROW(wall_pair_row, shear));
  load_four(wall, wall_rows, 0);
  load_four(place, wall_rows, 4);
  const mask flags = (mask)head[1], closed = FLAG(flags, wall_pair_row, closed);
  const vec recess = head[2], offset = spring_row[0], gap = spring_row[2];
  const vec yields = second_of(spring_row[3]);
  const spring_type_each spring = {spring_row[1], first_of(spring_row[3]), all(INFINITY), head[3]};

  const vec3_each axis = {wall[0], wall[1], wall[2]};
  const vec3_each a = rows_at(m->x, node[0]), b = rows_at(m->x, node[1]),
                  d = rows_at(m->x, node[2]);
  const vec3_each weights = rows_at(m->weights, rule), point = mean_each(weights, a, b, d);
  const vec3_each r = minus_each(point, (vec3_each){place[0], place[1], place[2]});
  vec3_each n = axis;
  vec distance = dot_each(r, axis);
  if (any_curved) {
    load_four(shape, wall_rows, 8);
    const vec R = shape[0], side = where_each(R > 0.0, all(1.0), all(-1.0));
    const vec3_each away = along_each(r, -distance, axis);
    const vec length = length_each(away), longest = most_each(length, all(TINY));
    const mask is_plane = R == 0.0;
    n = choose_each(is_plane, axis, times_each(-side / longest, away));
    distance = where_each(is_plane, distance, R - side * length);
  }
  vec g = distance + recess, depth = offset - g;
  const mask in_front = ~closed & (g >= 0.0) & (depth <= 0.0);
  const unsigned can = wanted & bits(closed & (depth > 0.0)), open = wanted & bits(in_front);

  const vec3_each old_shear = {shear[0], shear[1], shear[2]};
  const vec was = offset - gap;
  const unsigned flows = can & bits(depth > yields);
  flowed_type flowed = {.deeper = all(0.0)};
  if (flows) {
    const vec3_each around[3] = {a, b, d};
    flow_lanes(&flowed, &m->strength, pair, flows, depth, spring.softer, yields, around);
    depth -= flowed.deeper, g += flowed.deeper;
  }
  const vec3_each stick_point = {stick[0], stick[1], stick[2]};
  const contact_type_each contact = {spring,
                                     depth,
                                     all(1.0),
                                     n,
                                     minus_each(r, stick_point),
                                     old_shear,
                                     FLAG(flags, wall_pair_row, sliding),
                                     wall[3],
                                     place[3]};
  const int is_smooth = !any_each((contact.held > 0.0) | (contact.kinetic > 0.0));
  const carried_type_each now = is_smooth ? carry_smooth_each(contact) : carry_each(contact);
  if (flows) {
    const vec work = work_of_dent_each(spring, was, old_shear, depth, now.spring, flowed.deeper);
    for (unsigned some = flows; some; some &= some - 1) {
      const int i = __builtin_ctz(some);
      const double deeper = flowed.deeper[i];
      m->row[pair[i]].yield_depth = (float)((1.0 + ROUNDING) * flowed.limit[i]);
      m->row[pair[i]].recess += deeper;
      if (deeper > 0.0)
        deepen(&m->strength, pair[i], deeper, flowed.own_part[i], flowed.left[i], work[i]);
    }
    load_four(spring_row, rows, IN_ROW(wall_pair_row, offset));
  }
  const mask sliding = now.sliding;
  const vec3_each new_stick_point = choose_each(sliding, minus_each(r, now.spring), stick_point);
  const vec3_each force = along_each(now.shear, now.N, n), torque = cross_each(force, r);

  v4 on[3][LANES];
  to_memory(on[0], times_each(weights.x, force));
  to_memory(on[1], times_each(weights.y, force));
  to_memory(on[2], times_each(weights.z, force));
  /* What was accepted behind the wall is free again; a multiplier's offset is positive and stays. */
  spring_row[0] = where_each(in_front & (offset < 0.0), all(0.0), offset), spring_row[2] = g;
  store_four(spring_row, rows, IN_ROW(wall_pair_row, offset), can | open);
  stick[0] = new_stick_point.x, stick[1] = new_stick_point.y, stick[2] = new_stick_point.z;
  stick[3] += now.slipped;
  store_four(stick, rows, IN_ROW(wall_pair_row, stick_point), can);
  shear[0] = now.shear.x, shear[1] = now.shear.y, shear[2] = now.shear.z, shear[3] += now.lost;
  store_four(shear, rows, IN_ROW(wall_pair_row, shear), can);
  const unsigned slides = bits(sliding);
  const mask done = lanes_of(can);
  for (unsigned some = can; some;) {
    const int64_t number = of_wall[__builtin_ctz(some)];
    const mask here = done & (of_wall == number);
    add_where(here, m->walls[number].force, all(-1.0), force);
    add_where(here, m->walls[number].torque, all(1.0), torque);
    *(vec_at *)m->walls[number].pressing += where_each(here, now.N, all(0.0));
    some &= ~bits(here);
  }
#pragma GCC unroll 8
  for (int i = 0; i < LANES; i++) {
    if (!(can >> i & 1)) continue;
    m->row[pair[i]].sliding = slides >> i & 1;
    m->next_check[pair[i]] = bound[i];
    for (int k = 0; k < 3; k++) add_row(m->f, node[k][i], on[k][i]);
  }
  for (unsigned some = open; some; some &= some - 1) {
    const int i = __builtin_ctz(some);
    m->next_check[pair[i]] = bound[i] + g[i];
  }
  *dissipated += where_each(done, now.lost, all(0.0));
  return wanted & ~(can | open);
}

/* See kernels/contact/walls.py; ``totals``: energy dissipated by friction, accepted pairs. */
void mufe_add_wall_forces(const walls_type *m, double *totals, double ahead, int64_t num_pairs,
                          int64_t num_walls, int64_t accept) {
  int any_curved = 0;
  for (int64_t w = 0; w < num_walls; w++) {
    any_curved |= m->radius[w] != 0.0;
    const vec3 point = along(at(m->point, w), ahead, at(m->velocity, w));
    m->walls[w] = (wall_type){at(m->axis, w), m->friction[w], point,   m->friction_kinetic[w],
                              m->radius[w],   {0.0},          {{0.0}}, {{0.0}},
                              {0.0}};
  }
  totals[0] = totals[1] = 0.0;
  vec dissipated = all(0.0);
  const int64_t num_due = find_due(m->scratch, m->next_check, m->bounds, m->bound_row, num_pairs);
  for (int64_t i = -FAR_AHEAD; i < num_due; i += LANES) {
    fetch_rows(m, i + FAR_AHEAD, num_due);
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

/* Energy stored in the springs of the pairs that are ``closed``. */
double mufe_energy(const wall_pair_row *row, const uint8_t *closed, int64_t num_pairs) {
  double energy = 0.0;
  for (int64_t p = 0; p < num_pairs; p++)
    if (closed[p])
      energy += energy_of(spring_of_wall(row + p), row[p].offset - row[p].gap, row[p].shear);
  return energy;
}

/* Normal forces on the points of pairs. */
void mufe_normal_forces(double *out, const wall_pair_row *row, int64_t num_pairs) {
  for (int64_t p = 0; p < num_pairs; p++) {
    if (!row[p].closed) continue;
    const spring_type s = spring_of_wall(row + p);
    const double depth = row[p].offset - row[p].gap, kt = tangential_stiffness(s, depth);
    const double T2 = dot(row[p].shear, row[p].shear);
    out[p] = force_along_depth(s, depth, T2 > 0.0 ? T2 / (kt * kt) : 0.0);
  }
}
