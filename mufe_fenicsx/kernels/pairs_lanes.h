/* Several pairs at once that stay in contact with the inside of a facet, as most that are due do.
   The steps are those of pairs_one.h, which has the other pairs. */

#ifndef PAIRS_LANES_H
#define PAIRS_LANES_H

#include "contact_law.h"
#include "pairs.h"

/* Whether a node at ``corner`` lies below, as in pairs_one.h. */
INLINE mask below_each(lanes3 corner, lanes3 p, lanes3 normal) {
  lanes3 d = difference(corner, p);
  vec height = product(d, normal);
  return (height < 0.0) & (height * height > FACING * FACING * product(d, d));
}

/* Forces of the ``wanted`` ones of ``pair[0]`` to ``pair[LANES - 1]`` so far as these stay in
   contact inside the facets that are known. The pairs that were not done, as bits; ``looked``: those
   that were looked at, whose closest candidates before are in ``before``. */
INLINE unsigned add_lanes(const pairs_type *m, call_type *c, const int32_t *pair, unsigned wanted,
                          vec *dissipated, unsigned *looked, int64_t *before) {
  double *rows[LANES], *x = m->x, *f = m->f;
  int32_t node[6][LANES];
  vec next_check, bound;
  unsigned changed = 0;
#pragma GCC unroll 8
  for (int i = 0; i < LANES; i++) {
    state_type *s = m->state + pair[i];
    rows[i] = (double *)s;
    if (*looked >> i & 1)
      changed |= (unsigned)(before[i] >= 0 && before[i] != m->closest[pair[i]]) << i;
    for (int k = 0; k < 3; k++) node[k][i] = s->corner[k], node[3 + k][i] = s->vertices[k];
    next_check[i] = m->next_check[pair[i]], bound[i] = m->bounds[s->bound_row];
  }
  vec head[4], second[4], third[4], fourth[4], fifth[4], sixth[4], seventh[4], last[4];
  vec packed[4], place[4];
  load_four(head, rows, 0);
  load_four(second, rows, IN_ROW(area) - 1);
  load_four(third, rows, IN_ROW(gap));
  load_four(fourth, rows, IN_ROW(weights));
  load_four(fifth, rows, IN_ROW(normal));
  load_four(sixth, rows, IN_ROW(stick_point));
  load_four(seventh, rows, IN_ROW(shear));
  load_four(last, rows, IN_ROW(corner_weight));
  load_four(packed, rows, IN_ROW(bulge));
  const mask word = (mask)head[1];
  const vec area = second[1], recess = second[2], ratio = second[3];
  const vec offset = third[1], kn = third[2], largest_depth = sixth[3];

  /* The point, the facet and the foot of the point in its plane. */
  const lanes3 pa = rows_at(x, node[0]), pb = rows_at(x, node[1]), pc = rows_at(x, node[2]);
  const lanes3 a = rows_at(x, node[3]), b = rows_at(x, node[4]), d = rows_at(x, node[5]);
  const lanes3 point = mean_of((lanes3){last[0], last[1], last[2]}, pa, pb, pc);
  const lanes3 ab = difference(b, a), ac = difference(d, a), ap = difference(point, a);
  REGIONS(vec, product, ab, ac, ap);
  const vec square = va + vb + vc, inverse = 1.0 / square;
  const vec wb = vb * inverse, wc = vc * inverse;
  const lanes3 w = {1.0 - wb - wc, wb, wc};
  const vec over_twice = square_root(inverse);
  const lanes3 n = scaled(over_twice, across_both(ab, ac));
  const vec height = product(difference(point, mean_of(w, a, b, d)), n);
  /* Between smooth surfaces, not facets: as of bulge_at in pairs.h. */
  const vec q_ab = first_of(packed[0]), q_bc = second_of(packed[0]), q_ca = first_of(packed[1]);
  const lanes3 sunk = {second_of(packed[1]), first_of(packed[2]), second_of(packed[2])};
  const vec softer = first_of(packed[3]), yields = second_of(packed[3]);
  const vec by_a = q_ab * wb + q_ca * wc - sunk.x, by_b = q_ab * w.x + q_bc * wc - sunk.y;
  const vec by_c = q_bc * wb + q_ca * w.x - sunk.z;
  const vec bulge = q_ab * w.x * wb + q_bc * wb * wc + q_ca * wc * w.x - product(sunk, w);
  const lanes3 grad_b = scaled(over_twice, across_both(ac, n));
  const lanes3 grad_c = scaled(over_twice, across_both(n, ab));
  const lanes3 steepest = moved_along(moved_along(n, by_a - by_b, grad_b), by_a - by_c, grad_c);
  const vec steep = square_root(product(steepest, steepest));
  const lanes3 smooth = scaled(1.0 / steep, steepest);
  const vec distance = where(height < 0.0, -height, height);
  vec g = height + recess - bulge;

  /* Which of them are done here: for the others nothing has been changed yet. */
  vec depth = offset - g;
  mask inside = (va > 0.0) & (vb > 0.0) & (vc > 0.0);
  mask far = head[0] - bound >= distance;
  mask corners = below_each(pa, point, n) | below_each(pb, point, n) | below_each(pc, point, n);
  /* Nodes are no points in facets: what they face is around them. */
  mask is_node = lanes_of(0);
#pragma GCC unroll 8
  for (int i = 0; i < LANES; i++) is_node[i] = -(int64_t)(node[0][i] == node[1][i]);
  corners |= is_node;
  mask turned_away = FLAG(word, sharp) & (height < BESIDE * square_root(area)) & corners;
  const vec moved = bound - next_check, change = where(g < third[0], third[0] - g, g - third[0]);
  mask stays = FLAG(word, closed) & (~is_node | (change <= moved)) & (depth > 0.0) & (depth <= largest_depth);
  unsigned can = wanted & ~changed & bits(inside & stays & ~turned_away);
  for (unsigned near = can & ~*looked & ~bits(far); near; near &= near - 1) {
    const int i = __builtin_ctz(near);
    before[i] = look(m, pair[i], c->range, point_of(m->state + pair[i], x));
    *looked |= 1u << i;
    changed |= (unsigned)(before[i] != m->closest[pair[i]]) << i;
  }
  can &= ~changed;
  const vec was = offset - third[0];
  const unsigned flows = can & bits(depth > yields);
  vec deeper = all(0.0);
  for (unsigned left = flows; left; left &= left - 1) {
    const int i = __builtin_ctz(left);
    deeper[i] = deepen(m, pair[i], m->closest[pair[i]], depth[i]);
  }
  depth -= deeper, g += deeper;

  /* Normal force, on the smooth surface, and friction, along the facet. */
  const vec share = kn * share_of_stiffness_each(depth, softer);
  const vec kt = share * ratio, kt_slope = steep * kn * ratio * slope_of_share_each(depth, softer);
  vec N = steep * share * depth;
  lanes3 spring = difference(point, mean_of((lanes3){sixth[0], sixth[1], sixth[2]}, a, b, d));
  vec held = all(c->friction), kinetic = all(c->friction_kinetic);
  if (m->friction)
#pragma GCC unroll 8
    for (int i = 0; i < LANES; i++) {
      const friction_type mu = friction_of(m, c, m->state + pair[i]);
      held[i] = mu.held, kinetic[i] = mu.kinetic;
    }
  const slips_type found =
      slip_each(&spring, n, kt, FLAG(word, sliding), limit_of_friction_each(held, N, kt, kt_slope),
                limit_of_friction_each(kinetic, N, kt, kt_slope),
                (lanes3){seventh[0], seventh[1], seventh[2]});
  const vec left_of_spring = product(spring, spring);
  N += 0.5 * kt_slope * left_of_spring;
  for (unsigned left = flows; left; left &= left - 1) {
    const int i = __builtin_ctz(left);
    if (deeper[i] > 0.0)
      work_of_dent(m, pair[i], deeper[i], was[i], m->state[pair[i]].shear, depth[i],
                   left_of_spring[i]);
  }
  const mask sliding = found.sliding;
  const lanes3 to_anchor = difference(ap, moved_along(spring, height, n));
  const vec along_ab = product(to_anchor, ab), along_ac = product(to_anchor, ac);
  const vec anchor_b = (ac2 * along_ab - abac * along_ac) * inverse;
  const vec anchor_c = (ab2 * along_ac - abac * along_ab) * inverse;
  const lanes3 shear = scaled(-kt, spring);
  const lanes3 force = moved_along(shear, N, smooth);
  const lanes3 in_plane = moved_along(force, -product(force, n), n);

  /* Couple of the height and the force in the facet: h_i = height grad N_i . T. */
  const vec hb = height * product(in_plane, grad_b), hc = height * product(in_plane, grad_c);
  v4 on[6][LANES];
  for (int k = 0; k < 3; k++) to_memory(on[k], scaled(last[k], force));
  to_memory(on[3], moved_along(scaled(-hb - hc, n), -w.x, force));
  to_memory(on[4], moved_along(scaled(hb, n), -w.y, force));
  to_memory(on[5], moved_along(scaled(hc, n), -w.z, force));

  vec dissipates = found.lost;
  third[0] = g, third[3] = N;
  fourth[0] = w.x, fourth[1] = w.y, fourth[2] = w.z, fourth[3] += found.slipped;
  fifth[0] = smooth.x, fifth[1] = smooth.y, fifth[2] = smooth.z, fifth[3] += found.lost;
  place[0] = n.x, place[1] = n.y, place[2] = n.z, place[3] = height;
  sixth[0] = where(sliding, 1.0 - anchor_b - anchor_c, sixth[0]);
  sixth[1] = where(sliding, anchor_b, sixth[1]), sixth[2] = where(sliding, anchor_c, sixth[2]);
  seventh[0] = shear.x, seventh[1] = shear.y, seventh[2] = shear.z;
  store_four(third, rows, IN_ROW(gap), can);
  store_four(fourth, rows, IN_ROW(weights), can);
  store_four(fifth, rows, IN_ROW(normal), can);
  store_four(sixth, rows, IN_ROW(stick_point), can);
  store_four(seventh, rows, IN_ROW(shear), can);
  store_four(place, rows, IN_ROW(facing), can);
  const unsigned slides = bits(sliding);
#pragma GCC unroll 8
  for (int i = 0; i < LANES; i++) {
    if (!(can >> i & 1)) {
      dissipates[i] = 0.0;
      continue;
    }
    m->state[pair[i]].sliding = slides >> i & 1;
    m->next_check[pair[i]] = bound[i];
    for (int k = 0; k < 6; k++) add_row(f, node[k][i], on[k][i]);
  }
  *dissipated += dissipates;
  return wanted & ~can;
}

#endif
