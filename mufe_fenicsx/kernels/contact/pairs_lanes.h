/* Several pairs at once that stay in contact with the inside of a facet, as most that are due do.
   The steps are those of pairs_one.h, which has the other pairs. */

#ifndef PAIRS_LANES_H
#define PAIRS_LANES_H

#include "pairs.h"

#define AT(name) IN_ROW(pair_row, name)

/* Whether a node at ``corner`` lies below, as in pairs_one.h. */
INLINE mask below_each(vec3_each corner, vec3_each p, vec3_each normal) {
  const vec3_each d = minus_each(corner, p);
  const vec height = dot_each(d, normal);
  return (height < 0.0) & (height * height > FACING * FACING * dot_each(d, d));
}

/* Height of the smooth surface over facets, at the weights w, and the direction in which the gap to
   it grows most, by how much it does: as of bulge_at in pairs.h. ``grad``: of the weights. */
INLINE vec bulge_each(const vec packed[3], vec3_each w, vec3_each n, vec3_each grad_b,
                      vec3_each grad_c, vec3_each *steepest) {
  const vec ab = first_of(packed[0]), bc = second_of(packed[0]), ca = first_of(packed[1]);
  const vec3_each o = {second_of(packed[1]), first_of(packed[2]), second_of(packed[2])};
  const vec by_a = ab * w.y + ca * w.z - o.x, by_b = ab * w.x + bc * w.z - o.y;
  const vec by_c = bc * w.y + ca * w.x - o.z;
  *steepest = along_each(along_each(n, by_a - by_b, grad_b), by_a - by_c, grad_c);
  return ab * w.x * w.y + bc * w.y * w.z + ca * w.z * w.x - dot_each(o, w);
}

/* Forces of the ``wanted`` ones of ``pair[0]`` to ``pair[LANES - 1]`` so far as these stay in
   contact inside the facets that are known. The pairs that were not done, as bits; ``looked``: those
   that were looked at, whose closest candidates before are in ``before``. */
INLINE unsigned add_lanes(const pairs_type *m, call_type *c, const int32_t *pair, unsigned wanted,
                          vec *dissipated, unsigned *looked, int64_t *before) {
  double *rows[LANES], *x = m->x, *f = m->f;
  int32_t node[6][LANES], rule[LANES];
  vec next_check, bound;
  mask is_node;
  unsigned changed = 0;
#pragma GCC unroll 8
  for (int i = 0; i < LANES; i++) {
    pair_row *s = m->row + pair[i];
    rows[i] = (double *)s;
    if (*looked >> i & 1)
      changed |= (unsigned)(before[i] >= 0 && before[i] != m->closest[pair[i]]) << i;
    for (int k = 0; k < 3; k++) node[k][i] = s->corner[k], node[3 + k][i] = s->vertices[k];
    /* Nodes are no points in facets: what they face is around them. */
    is_node[i] = -(int64_t)(s->corner[0] == s->corner[1]);
    rule[i] = s->rule;
    next_check[i] = m->next_check[pair[i]], bound[i] = m->bounds[s->bound_row];
  }
  vec head[4], place[4], spring_row[4], packed[4], sums[4], stick[4], shear[4], facing[4], one[4];
  load_four(head, rows, 0);
  load_four(place, rows, AT(offset) - 2);
  load_four(spring_row, rows, AT(stiffness));
  load_four(packed, rows, AT(bulge));
  load_four(sums, rows, AT(gap));
  load_four(stick, rows, AT(stick_point));
  load_four(shear, rows, AT(shear));
  const mask word = (mask)head[1];
  const vec offset = place[2], recess = place[3], gap = sums[0];
  const vec area = first_of(spring_row[3]), stands = second_of(spring_row[3]);
  const vec yields = second_of(packed[3]);
  const spring_type_each spring = {spring_row[0], first_of(packed[3]), spring_row[1],
                                   spring_row[2]};

  /* The point, the facet and the foot of the point in its plane. */
  const vec3_each pa = rows_at(x, node[0]), pb = rows_at(x, node[1]), pc = rows_at(x, node[2]);
  const vec3_each a = rows_at(x, node[3]), b = rows_at(x, node[4]), d = rows_at(x, node[5]);
  const vec3_each weights = rows_at(m->weights, rule), in_facet = mean_each(weights, pa, pb, pc);
  const vec3_each own_b = minus_each(pb, pa), own_c = minus_each(pc, pa);
  const vec3_each across_own = cross_each(own_b, own_c);
  const vec over_own = 1.0 / (length_each(across_own) + NOTHING); /* nodes have no facet */
  const vec3_each up = times_each(over_own, across_own);
  const vec3_each point = along_each(in_facet, stands, up);
  const vec3_each ab = minus_each(b, a), ac = minus_each(d, a), ap = minus_each(point, a);
  const regions_type_each at = regions_each(ab, ac, ap);
  const vec inverse = 1.0 / (at.va + at.vb + at.vc);
  const vec wb = at.vb * inverse, wc = at.vc * inverse;
  const vec3_each w = {1.0 - wb - wc, wb, wc};
  const vec over_twice = root_each(inverse);
  const vec3_each n = times_each(over_twice, cross_each(ab, ac));
  const vec3_each grad_b = times_each(over_twice, cross_each(ac, n));
  const vec3_each grad_c = times_each(over_twice, cross_each(n, ab));
  const vec height = dot_each(minus_each(point, mean_each(w, a, b, d)), n);
  const vec behind = height - stands * dot_each(up, n);
  /* Between smooth surfaces, not facets. */
  vec3_each steepest;
  const vec bulge = bulge_each(packed, w, n, grad_b, grad_c, &steepest);
  const vec steep = length_each(steepest);
  const vec3_each smooth = times_each(1.0 / steep, steepest);
  vec g = height + recess - bulge, depth = offset - g;

  /* Which of them are done here: for the others nothing has been changed yet. */
  const mask inside = (at.va > 0.0) & (at.vb > 0.0) & (at.vc > 0.0);
  const mask far = head[0] - bound >= size_each(height);
  const mask corners = below_each(pa, in_facet, n) | below_each(pb, in_facet, n) |
                       below_each(pc, in_facet, n) | is_node;
  const mask turned_away =
      FLAG(word, pair_row, sharp) & (behind < BESIDE * root_each(area)) & corners;
  const mask by_motion = ~is_node | (size_each(g - gap) <= bound - next_check);
  const mask stays =
      FLAG(word, pair_row, closed) & by_motion & (depth > 0.0) & (depth <= spring.largest_depth);
  unsigned can = wanted & ~changed & bits(inside & stays & ~turned_away);
  for (unsigned near = can & ~*looked & ~bits(far); near; near &= near - 1) {
    const int i = __builtin_ctz(near);
    before[i] = look(m, pair[i], c->range, point_of(m, m->row + pair[i]));
    *looked |= 1u << i;
    changed |= (unsigned)(before[i] != m->closest[pair[i]]) << i;
  }
  can &= ~changed;

  const vec3_each old_shear = {shear[0], shear[1], shear[2]};
  const vec was = offset - gap;
  const unsigned flows = can & bits(depth > yields);
  flowed_type flowed = {.deeper = all(0.0)};
  if (flows) {
    const vec3_each around[3] = {pa, pb, pc};
    flow_lanes(&flowed, &m->strength, pair, flows, depth, spring.softer, yields, around);
    depth -= flowed.deeper, g += flowed.deeper;
  }

  /* Normal force, on the smooth surface, and friction, along the facet. */
  vec held = all(c->friction), kinetic = all(c->friction_kinetic);
  if (m->friction)
#pragma GCC unroll 8
    for (int i = 0; i < LANES; i++) {
      const friction_type mu = friction_of(m, c, m->row + pair[i]);
      held[i] = mu.held, kinetic[i] = mu.kinetic;
    }
  const vec3_each stick_point = mean_each((vec3_each){stick[0], stick[1], stick[2]}, a, b, d);
  const carried_type_each now =
      carry_each((contact_type_each){spring, depth, steep, n, minus_each(point, stick_point),
                                     old_shear, FLAG(word, pair_row, sliding), held, kinetic});
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
  }
  const vec3_each to_anchor = minus_each(ap, along_each(now.spring, height, n));
  const vec along_ab = dot_each(to_anchor, ab), along_ac = dot_each(to_anchor, ac);
  const vec anchor_b = (at.ac2 * along_ab - at.abac * along_ac) * inverse;
  const vec anchor_c = (at.ab2 * along_ac - at.abac * along_ab) * inverse;
  const vec3_each force = along_each(now.shear, now.N, smooth);
  const vec3_each in_plane = across_each(force, n);

  /* Couple of the height and the force in the facet: h_i = height grad N_i . T. */
  const vec hb = height * dot_each(in_plane, grad_b), hc = height * dot_each(in_plane, grad_c);
  /* That of the height over the own facet. */
  const vec lean = stands * over_own;
  const vec lean_b = lean * dot_each(force, cross_each(own_c, up));
  const vec lean_c = lean * dot_each(force, cross_each(up, own_b));
  v4 on[6][LANES];
  to_memory(on[0], along_each(times_each(lean_b + lean_c, up), weights.x, force));
  to_memory(on[1], along_each(times_each(-lean_b, up), weights.y, force));
  to_memory(on[2], along_each(times_each(-lean_c, up), weights.z, force));
  to_memory(on[3], along_each(times_each(-hb - hc, n), -w.x, force));
  to_memory(on[4], along_each(times_each(hb, n), -w.y, force));
  to_memory(on[5], along_each(times_each(hc, n), -w.z, force));

  const mask sliding = now.sliding;
  sums[0] = g, sums[1] = now.N, sums[2] += now.slipped, sums[3] += now.lost;
  store_four(sums, rows, AT(gap), can);
  stick[0] = where_each(sliding, 1.0 - anchor_b - anchor_c, stick[0]);
  stick[1] = where_each(sliding, anchor_b, stick[1]);
  stick[2] = where_each(sliding, anchor_c, stick[2]), stick[3] = height;
  store_four(stick, rows, AT(stick_point), can);
  shear[0] = now.shear.x, shear[1] = now.shear.y, shear[2] = now.shear.z;
  store_four(shear, rows, AT(shear), can);
  facing[0] = n.x, facing[1] = n.y, facing[2] = n.z, facing[3] = all(0.0);
  store_four(facing, rows, AT(facing), can);
  one[0] = w.x, one[1] = w.y, one[2] = w.z, one[3] = all(0.0);
  store_four(one, rows, AT(weights), can);
  one[0] = smooth.x, one[1] = smooth.y, one[2] = smooth.z, one[3] = all(0.0);
  store_four(one, rows, AT(normal), can);
  const unsigned slides = bits(sliding);
#pragma GCC unroll 8
  for (int i = 0; i < LANES; i++) {
    if (!(can >> i & 1)) continue;
    m->row[pair[i]].sliding = slides >> i & 1;
    m->next_check[pair[i]] = bound[i];
    for (int k = 0; k < 6; k++) add_row(f, node[k][i], on[k][i]);
  }
  *dissipated += where_each(lanes_of(can), now.lost, all(0.0));
  return wanted & ~can;
}

#undef AT
#endif
