/* Stress update and internal forces of linear tetrahedra, eight (or four) at a time.

   The method, its sources and all arguments are described in kernels/bulk/solid.py. Here is how it is
   made fast. The nodes of a grain are packed, one cache line each (position, pressure, half the
   displacement of the step), so that the loads of an element are whole vectors, which are turned
   into vectors of one component of several elements. The forces go back the same way into a
   packed array, which is added to the nodal forces at the end. All data of one grain but the
   stress stay in the cache from the pass over volumes to the end. */

#include <string.h>

#include "tets.h"

/* Elements ahead whose stress, nodes' numbers and volumes are fetched early. */
#define AHEAD 16
#define FAR_AHEAD 64
/* Square of q up to which the rotation is a series: spins of 1e-4 in a step. */
#define SMALL 2.5e-9

/* Von Mises with a table, as in kernels/bulk/hardening.py, for all lanes. */
INLINE vec plastic_increment(vec q, vec alpha, const grain_type *g) {
  const int last = (int)g->parameters[1] - 1;
  const double *strain = g->parameters + 2, *stress = strain + last + 1;
  vec dp = (q - stress[last]) * (1.0 / (3.0 * g->shear));
  dp = where_each(dp > 0.0, dp, all(0.0));
  /* From the last segment to the first: what is valid in an earlier one wins. */
  for (int k = last - 1; k >= 0; k--) {
    vec Y = stress[k] + g->segments[k] * (alpha - strain[k]);
    vec here = (q - Y) * g->segments[last + k];
    mask valid = (alpha < strain[k + 1]) & (alpha + here <= strain[k + 1]);
    dp = where_each(valid, where_each(here > 0.0, here, all(0.0)), dp);
  }
  return dp;
}

/* Turn stresses by Q, whose axial vector q is half that of the spin: by R s R^T of Cayley's
   R = I + t (Q + Q Q); small spins by s + [2 Q, s + [Q, s]], off by 4/3 of the spin's third power,
   and the length of s by twice the fourth, which is rounding. */
INLINE void turn(vec *xx, vec *yy, vec *zz, vec *xy, vec *yz, vec *xz, vec qx, vec qy, vec qz) {
  vec sxx = *xx, syy = *yy, szz = *zz, sxy = *xy, syz = *yz, sxz = *xz;
  vec square = qx * qx + qy * qy + qz * qz;
  if (__builtin_expect(!any_each(square > SMALL), 1)) {
    vec a = qy * sxz, b = qz * sxy, c = qx * syz;
    vec axx = sxx + 2.0 * (a - b), ayy = syy + 2.0 * (b - c), azz = szz + 2.0 * (c - a);
    vec axy = sxy + qz * (sxx - syy) + qy * syz - qx * sxz;
    vec ayz = syz + qx * (syy - szz) + qz * sxz - qy * sxy;
    vec axz = sxz + qy * (szz - sxx) + qx * sxy - qz * syz;
    qx += qx, qy += qy, qz += qz;
    a = qy * axz, b = qz * axy, c = qx * ayz;
    *xx = sxx + 2.0 * (a - b), *yy = syy + 2.0 * (b - c), *zz = szz + 2.0 * (c - a);
    *xy = sxy + qz * (axx - ayy) + qy * ayz - qx * axz;
    *yz = syz + qx * (ayy - azz) + qz * axz - qy * axy;
    *xz = sxz + qy * (azz - axx) + qx * axy - qz * ayz;
    return;
  }
  vec t = 2.0 / (1.0 + square), tx = t * qx, ty = t * qy, tz = t * qz;
  vec rxx = 1.0 - ty * qy - tz * qz, ryy = 1.0 - tx * qx - tz * qz, rzz = 1.0 - tx * qx - ty * qy;
  vec rxy = tx * qy - tz, ryx = tx * qy + tz, rxz = tx * qz + ty, rzx = tx * qz - ty;
  vec ryz = ty * qz - tx, rzy = ty * qz + tx;
  vec ax = rxx * sxx + rxy * sxy + rxz * sxz, ay = rxx * sxy + rxy * syy + rxz * syz;
  vec az = rxx * sxz + rxy * syz + rxz * szz, bx = ryx * sxx + ryy * sxy + ryz * sxz;
  vec by = ryx * sxy + ryy * syy + ryz * syz, bz = ryx * sxz + ryy * syz + ryz * szz;
  vec cx = rzx * sxx + rzy * sxy + rzz * sxz, cy = rzx * sxy + rzy * syy + rzz * syz;
  vec cz = rzx * sxz + rzy * syz + rzz * szz;
  *xx = ax * rxx + ay * rxy + az * rxz;
  *yy = bx * ryx + by * ryy + bz * ryz;
  *zz = cx * rzx + cy * rzy + cz * rzz;
  *xy = ax * ryx + ay * ryy + az * ryz;
  *yz = bx * rzx + by * rzy + bz * rzz;
  *xz = ax * rzx + ay * rzy + az * rzz;
}

INLINE void fetch_cells(const int32_t *cells) {
  for (int i = 0; i < 2; i++) __builtin_prefetch(cells + 4 * FAR_AHEAD + 16 * i);
}

/* Elements e to e + count - 1 of the grain; the lanes beyond repeat the last one. Where ``stretch``
   the deviator follows from the displacement since the first places, kernels/bulk/neo_hooke.py.
   Returns the first that has no volume, or -1. */
INLINE int64_t batch(const grain_type *g, int64_t e, int count, int element, int stretch) {
  const int32_t *cells = g->cells + 4 * e;
  double *stress = g->deviator + 6 * e, tail[6 * LANES];
  const double *from = stress;
  if (count < LANES && !stretch) {
    for (int i = 0; i < LANES; i++)
      memcpy(tail + 6 * i, stress + 6 * (i < count ? i : count - 1), 6 * sizeof(double));
    from = tail;
  }
#pragma GCC unroll 6
  for (int i = 0; i < 6; i++) __builtin_prefetch(stress + 6 * AHEAD + LANES * i, 1);
  fetch_cells(cells);
  __builtin_prefetch(g->volume0 + e + FAR_AHEAD);

  vec m1[4], m2[4], m3[4], d1[4], d2[4], d3[4];
#pragma GCC unroll 4
  for (int j = 0; j < 4; j++) {
    const int i = FIRST(j), k = i + SECOND;
    const int32_t *c = cells + 4 * (i < count ? i : count - 1);
    const int32_t *cc = cells + 4 * (k < count ? k : count - 1);
    vec x = join(NODE(c[0])->x, NODE(cc[0])->x);
    vec x1 = join(NODE(c[1])->x, NODE(cc[1])->x), x2 = join(NODE(c[2])->x, NODE(cc[2])->x);
    vec x3 = join(NODE(c[3])->x, NODE(cc[3])->x);
    m1[j] = x1 - x;
    m2[j] = x2 - x;
    m3[j] = x3 - x;
    if (element == AVERAGED) m3[j] = LAST_FROM(m3[j], x + x1 + x2 + x3);
  }
  to_lanes(m1);
  to_lanes(m2);
  to_lanes(m3);
#pragma GCC unroll 4
  for (int j = 0; j < 4; j++) {
    const int i = FIRST(j), k = i + SECOND;
    const int32_t *c = cells + 4 * (i < count ? i : count - 1);
    const int32_t *cc = cells + 4 * (k < count ? k : count - 1);
    vec d = join(NODE(c[0])->d, NODE(cc[0])->d);
    d1[j] = join(NODE(c[1])->d, NODE(cc[1])->d) - d;
    d2[j] = join(NODE(c[2])->d, NODE(cc[2])->d) - d;
    d3[j] = join(NODE(c[3])->d, NODE(cc[3])->d) - d;
  }
  to_lanes(d1);
  to_lanes(d2);
  to_lanes(d3);
  vec m1x = m1[0], m1y = m1[1], m1z = m1[2], d1x = d1[0], d1y = d1[1], d1z = d1[2];
  vec m2x = m2[0], m2y = m2[1], m2z = m2[2], d2x = d2[0], d2y = d2[1], d2z = d2[2];
  vec m3x = m3[0], m3y = m3[1], m3z = m3[2], d3x = d3[0], d3y = d3[1], d3z = d3[2];

  /* Gradient of the displacement at the middle of the step (where ``stretch``: that since the
     first places, there), times six volumes. */
  vec g1x = m2y * m3z - m2z * m3y, g1y = m2z * m3x - m2x * m3z, g1z = m2x * m3y - m2y * m3x;
  vec inv = 1.0 / (m1x * g1x + m1y * g1y + m1z * g1z);
  vec g2x = m3y * m1z - m3z * m1y, g2y = m3z * m1x - m3x * m1z, g2z = m3x * m1y - m3y * m1x;
  vec g3x = m1y * m2z - m1z * m2y, g3y = m1z * m2x - m1x * m2z, g3z = m1x * m2y - m1y * m2x;
  vec lxx = d1x * g1x + d2x * g2x + d3x * g3x, lxy = d1x * g1y + d2x * g2y + d3x * g3y;
  vec lxz = d1x * g1z + d2x * g2z + d3x * g3z;
  vec e1x = m1x + d1x, e2x = m2x + d2x, e3x = m3x + d3x;
  vec lyx = d1y * g1x + d2y * g2x + d3y * g3x;
  vec lyy = d1y * g1y + d2y * g2y + d3y * g3y, lyz = d1y * g1z + d2y * g2z + d3y * g3z;
  vec e1y = m1y + d1y, e2y = m2y + d2y, e3y = m3y + d3y;
  vec lzx = d1z * g1x + d2z * g2x + d3z * g3x, lzy = d1z * g1y + d2z * g2y + d3z * g3y;
  vec lzz = d1z * g1z + d2z * g2z + d3z * g3z;
  vec e1z = m1z + d1z, e2z = m2z + d2z, e3z = m3z + d3z;

  vec sxx, syy, szz, sxy, syz, sxz, oxx, oyy, ozz, oxy, oyz, oxz;
  if (stretch) {
    /* dev (F F^T - 1), F - 1 = H. */
    lxx *= inv, lxy *= inv, lxz *= inv, lyx *= inv, lyy *= inv, lyz *= inv;
    lzx *= inv, lzy *= inv, lzz *= inv;
    sxx = 2.0 * lxx + lxx * lxx + lxy * lxy + lxz * lxz;
    syy = 2.0 * lyy + lyx * lyx + lyy * lyy + lyz * lyz;
    szz = 2.0 * lzz + lzx * lzx + lzy * lzy + lzz * lzz;
    sxy = lxy + lyx + lxx * lyx + lxy * lyy + lxz * lyz;
    syz = lyz + lzy + lyx * lzx + lyy * lzy + lyz * lzz;
    sxz = lxz + lzx + lxx * lzx + lxy * lzy + lxz * lzz;
    vec third = (1.0 / 3.0) * (sxx + syy + szz);
    sxx -= third, syy -= third, szz -= third;
  } else {
    /* Half of the stress increment; it turns along with the stress, and the other half not. */
    vec third = (1.0 / 3.0) * (lxx + lyy + lzz), Gi = (2.0 * g->shear) * inv, Gh = g->shear * inv;
    vec hxx = Gi * (lxx - third), hyy = Gi * (lyy - third), hzz = Gi * (lzz - third);
    vec hxy = Gh * (lxy + lyx), hyz = Gh * (lyz + lzy), hxz = Gh * (lxz + lzx);

    /* Half of the axial vector of the spin. */
    vec quarter = 0.5 * inv;
    vec qx = quarter * (lzy - lyz), qy = quarter * (lxz - lzx), qz = quarter * (lyx - lxy);
    vec o1[4], o2[4];
#pragma GCC unroll 4
    for (int j = 0; j < 4; j++) {
      const int i = FIRST(j), k = i + SECOND;
      o1[j] = join(*(const v4_at *)(from + 6 * i), *(const v4_at *)(from + 6 * k));
      o2[j] = join(*(const v4_at *)(from + 6 * i + 2), *(const v4_at *)(from + 6 * k + 2));
    }
    to_lanes(o1);
    to_lanes(o2);
    oxx = o1[0], oyy = o1[1], ozz = o1[2], oxy = o1[3], oyz = o2[2], oxz = o2[3];
    sxx = oxx + hxx, syy = oyy + hyy, szz = ozz + hzz;
    sxy = oxy + hxy, syz = oyz + hyz, sxz = oxz + hxz;
    turn(&sxx, &syy, &szz, &sxy, &syz, &sxz, qx, qy, qz);
    sxx += hxx, syy += hyy, szz += hzz, sxy += hxy, syz += hyz, sxz += hxz;
  }

  /* Volume and gradients at the end of the step. */
  vec h1x = e2y * e3z - e2z * e3y, h1y = e2z * e3x - e2x * e3z, h1z = e2x * e3y - e2y * e3x;
  vec h2x = e3y * e1z - e3z * e1y, h2y = e3z * e1x - e3x * e1z, h2z = e3x * e1y - e3y * e1x;
  vec h3x = e1y * e2z - e1z * e2y, h3y = e1z * e2x - e1x * e2z, h3z = e1x * e2y - e1y * e2x;
  vec volume = (1.0 / 6.0) * (e1x * h1x + e1y * h1y + e1z * h1z);
  int64_t bad = -1;
  if (any_each(~(volume > 0.0)))
    for (int i = count - 1; i >= 0; i--)
      if (!(volume[i] > 0.0)) bad = e + i;

  vec volume0 = all(1.0);
  if (count == LANES)
    volume0 = *(const vec_at *)(g->volume0 + e);
  else
    for (int i = 0; i < LANES; i++) volume0[i] = g->volume0[e + (i < count ? i : count - 1)];
  if (stretch) {
    vec scale = g->shear * power_of_minus_two_thirds(volume / volume0);
    sxx *= scale, syy *= scale, szz *= scale, sxy *= scale, syz *= scale, sxz *= scale;
  }
  vec mean;
  if (element == AVERAGED) {
    mean = 0.25 * m3[3];
  } else {
    mean = g->bulk * logarithm(volume / volume0);
    for (int i = 0; i < count; i++) g->pressure[e + i] = mean[i];
  }

  vec q2 = 1.5 * (sxx * sxx + syy * syy + szz * szz) + 3.0 * (sxy * sxy + syz * syz + sxz * sxz);
  const double first_yield = g->parameters[0];
  if (!stretch && isfinite(first_yield) && any_each(q2 > first_yield * first_yield)) {
    double *strain = g->strain + e, *work = g->work + e;
    vec alpha = all(0.0), q = root_each(q2), dp = all(0.0);
    if (count == LANES)
      alpha = *(const vec_at *)strain;
    else
      for (int i = 0; i < LANES; i++) alpha[i] = strain[i < count ? i : count - 1];
    if (g->law) {
      for (int i = 0; i < LANES; i++)
        dp[i] = q[i] > first_yield ? g->law(q[i], mean[i], alpha[i], g->dt, g->shear, g->parameters)
                                   : 0.0;
    } else {
      dp = plastic_increment(q, alpha, g);
    }
    /* Half of the start's stress and half of the end's: the rule by which the nodal
       forces do their work. Where nothing flows, q may be 0. */
    mask flows = dp > 0.0;
    dp = where_each(flows, dp, all(0.0));
    q = where_each(flows, q, all(1.0));
    vec before =
        1.5 * (oxx * sxx + oyy * syy + ozz * szz) + 3.0 * (oxy * sxy + oyz * syz + oxz * sxz);
    vec scale = 1.0 - 3.0 * g->shear * dp / q;
    vec done = 0.5 * (q * scale + before / q) * dp * volume0;
    sxx *= scale, syy *= scale, szz *= scale, sxy *= scale, syz *= scale, sxz *= scale;
    alpha += dp;
    if (count == LANES) {
      *(vec_at *)strain = alpha;
      *(vec_at *)work += done;
    } else {
      for (int i = 0; i < count; i++) strain[i] = alpha[i], work[i] += done[i];
    }
  }

  /* Back into rows of six: xx yy zz xy of an element, and then the last four. */
  double *to = count < LANES ? tail : stress;
  vec first[4] = {sxx, syy, szz, sxy}, last[4] = {szz, sxy, syz, sxz};
  to_rows(first);
  to_rows(last);
#pragma GCC unroll 4
  for (int j = 0; j < 4; j++) {
    const int i = FIRST(j), k = i + SECOND;
    *(v4_at *)(to + 6 * i) = low(first[j]);
    *(v4_at *)(to + 6 * i + 2) = low(last[j]);
    if (SECOND) *(v4_at *)(to + 6 * k) = high(first[j]);
    if (SECOND) *(v4_at *)(to + 6 * k + 2) = high(last[j]);
  }
  if (count < LANES) memcpy(stress, tail, 6 * count * sizeof(double));

  /* Forces on nodes b, c, d: Cauchy stress times gradient times volume. */
  const vec ratio = volume0 / volume;
  vec share = (1.0 / 6.0) * ratio, p = (1.0 / 6.0) * mean;
  if (element == AVERAGED && !stretch && g->own > 0.0) {
    const vec grown = 1.0 - ratio;
    p += share * (g->own * grown * grown * grown);
  }
  sxx = share * sxx + p, syy = share * syy + p, szz = share * szz + p;
  sxy *= share, syz *= share, sxz *= share;
  vec f1x = sxx * h1x + sxy * h1y + sxz * h1z, f1y = sxy * h1x + syy * h1y + syz * h1z;
  vec f1z = sxz * h1x + syz * h1y + szz * h1z, f2x = sxx * h2x + sxy * h2y + sxz * h2z;
  vec f2y = sxy * h2x + syy * h2y + syz * h2z, f2z = sxz * h2x + syz * h2y + szz * h2z;
  vec f3x = sxx * h3x + sxy * h3y + sxz * h3z, f3y = sxy * h3x + syy * h3y + syz * h3z;
  vec f3z = sxz * h3x + syz * h3y + szz * h3z;
  vec f1[4] = {f1x, f1y, f1z, all(0.0)}, f2[4] = {f2x, f2y, f2z, all(0.0)};
  vec f3[4] = {f3x, f3y, f3z, all(0.0)}, f0[4];
  to_rows(f1);
  to_rows(f2);
  to_rows(f3);
#pragma GCC unroll 4
  for (int j = 0; j < 4; j++) {
    const int i = FIRST(j), k = i + SECOND;
    f0[j] = f1[j] + f2[j] + f3[j];
    if (i < count) {
      const int32_t *c = cells + 4 * i;
      FORCE(c[0]) += low(f0[j]);
      FORCE(c[1]) -= low(f1[j]);
      FORCE(c[2]) -= low(f2[j]);
      FORCE(c[3]) -= low(f3[j]);
    }
    if (SECOND && k < count) {
      const int32_t *c = cells + 4 * k;
      FORCE(c[0]) += high(f0[j]);
      FORCE(c[1]) -= high(f1[j]);
      FORCE(c[2]) -= high(f2[j]);
      FORCE(c[3]) -= high(f3[j]);
    }
  }
  return bad;
}

INLINE int64_t elements_of(const grain_type *g, int64_t count, int element, int stretch) {
  int64_t bad = -1, e = 0;
  for (; e + LANES <= count; e += LANES) {
    int64_t found = batch(g, e, LANES, element, stretch);
    if (found >= 0) bad = found;
  }
  if (e < count) {
    int64_t found = batch(g, e, (int)(count - e), element, stretch);
    if (found >= 0) bad = found;
  }
  return bad;
}

/* Six times the volumes of a batch of elements. */
INLINE vec six_volumes(const grain_type *g, int64_t e, int count) {
  const int32_t *cells = g->cells + 4 * e;
  vec e1[4], e2[4], e3[4];
#pragma GCC unroll 4
  for (int j = 0; j < 4; j++) {
    const int i = FIRST(j), k = i + SECOND;
    const int32_t *c = cells + 4 * (i < count ? i : count - 1);
    const int32_t *cc = cells + 4 * (k < count ? k : count - 1);
    vec x = join(NODE(c[0])->x, NODE(cc[0])->x);
    e1[j] = join(NODE(c[1])->x, NODE(cc[1])->x) - x;
    e2[j] = join(NODE(c[2])->x, NODE(cc[2])->x) - x;
    e3[j] = join(NODE(c[3])->x, NODE(cc[3])->x) - x;
  }
  to_lanes(e1);
  to_lanes(e2);
  to_lanes(e3);
  return e1[0] * (e2[1] * e3[2] - e2[2] * e3[1]) + e1[1] * (e2[2] * e3[0] - e2[0] * e3[2]) +
         e1[2] * (e2[0] * e3[1] - e2[1] * e3[0]);
}

/* Positions of a grain's nodes, packed. */
INLINE void pack(node_type *node, const double *x, int64_t num_nodes) {
  for (int64_t n = 0; n < num_nodes; n++, x += 3) node[n].x = (v4){x[0], x[1], x[2], 0.0};
}

/* Volumes around the nodes of a grain, the first of which is ``first``. */
INLINE void nodal_volumes(const grain_type *g, int64_t num_cells, double *volume, int64_t num_nodes,
                          int64_t first) {
  memset(volume, 0, num_nodes * sizeof(double));
  double *of_node = volume - first;
  for (int64_t e = 0; e < num_cells; e += LANES) {
    const int count = num_cells - e < LANES ? (int)(num_cells - e) : LANES;
    fetch_cells(g->cells + 4 * e);
    vec quarter = count == LANES ? six_volumes(g, e, LANES) : six_volumes(g, e, count);
    quarter *= 1.0 / 24.0;
#pragma GCC unroll 8
    for (int i = 0; i < LANES; i++) {
      if (i == count) break;
      const int32_t *c = g->cells + 4 * (e + i);
      for (int k = 0; k < 4; k++) of_node[(uint32_t)c[k]] += quarter[i];
    }
  }
}

/* Packed positions at the end of the step become those of its middle. */
INLINE void to_middle(node_type *node, int64_t num_nodes) {
  for (int64_t n = 0; n < num_nodes; n++) node[n].x -= node[n].d;
}

/* Pressures of the nodes of a grain, into their packed data, whose positions go to the middle. */
INLINE void nodal_pressure(const grain_type *g, node_type *node, const double *volume,
                           const double *volume0, double *pressure, int64_t num_nodes) {
  int64_t n = 0;
  for (; n + LANES <= num_nodes; n += LANES) {
    vec p = g->bulk * logarithm(*(const vec_at *)(volume + n) / *(const vec_at *)(volume0 + n));
    *(vec_at *)(pressure + n) = p;
#pragma GCC unroll 8
    for (int i = 0; i < LANES; i++) {
      node[n + i].x -= node[n + i].d;
      node[n + i].x[3] = p[i];
    }
  }
  for (; n < num_nodes; n++) {
    node[n].x -= node[n].d;
    pressure[n] = node[n].x[3] = g->bulk * logarithm(all(volume[n] / volume0[n]))[0];
  }
}

/* Volumes of all elements, by the same products as in each step: at rest their ratio is one. */
void mufe_volumes(const model_type *m, double *volume, const double *x, int64_t num_grains) {
  node_type *node = (node_type *)m->scratch;
  for (int64_t i = 0; i < num_grains; i++) {
    const int64_t first = m->first_node[i], begin = m->cell_offset[i];
    const int64_t num_cells = m->cell_offset[i + 1] - begin;
    pack(node, x + 3 * first, m->num_nodes[i]);
    const grain_type grain = {.node = node - first, .cells = m->cells + 4 * begin};
    for (int64_t e = 0; e < num_cells; e += LANES) {
      const int count = num_cells - e < LANES ? (int)(num_cells - e) : LANES;
      const vec found = (1.0 / 6.0) * six_volumes(&grain, e, count);
      for (int k = 0; k < count; k++) volume[begin + e + k] = found[k];
    }
  }
}

/* Volumes around all nodes, by the same sums as in each step: at rest their ratio is one. */
void mufe_nodal_volumes(const model_type *m, double *volume, const double *x, int64_t num_grains) {
  node_type *node = (node_type *)m->scratch;
  for (int64_t i = 0; i < num_grains; i++) {
    const int64_t first = m->first_node[i], num_nodes = m->num_nodes[i];
    const int64_t begin = m->cell_offset[i], count = m->cell_offset[i + 1] - begin;
    pack(node, x + 3 * first, num_nodes);
    const grain_type grain = {.node = node - first, .cells = m->cells + 4 * begin};
    nodal_volumes(&grain, count, volume + first, num_nodes, first);
  }
}

/* Mean and deviator of all elements of a grain, and their forces. */
INLINE int64_t stresses_of(const model_type *m, int64_t i, const grain_type *g, node_type *node,
                           double *volume, int64_t element, int stretch) {
  const int64_t count = m->cell_offset[i + 1] - m->cell_offset[i];
  const int64_t first = m->first_node[i], num_nodes = m->num_nodes[i];
  if (element == AVERAGED) {
    nodal_volumes(g, count, volume, num_nodes, first);
    nodal_pressure(g, node, volume, m->node_volume0 + first, m->pressure + first, num_nodes);
    return elements_of(g, count, AVERAGED, stretch);
  }
  to_middle(node, num_nodes);
  return elements_of(g, count, PLAIN, stretch);
}

/* x0: first places, for grains whose deviator follows from the stretch; NULL for the others. */
int64_t mufe_add_internal_forces(const model_type *m, double *f, double *deviator, double *strain,
                                 double *work, const double *x, const double *v,
                                 const int64_t *grains, double dt, int64_t num_grains,
                                 int64_t num_parameters, int64_t element, law_type law,
                                 const double *x0) {
  int64_t bad = -1;
  const double half = 0.5 * dt;
  for (int64_t k = 0; k < num_grains; k++) {
    const int64_t i = grains[k], begin = m->cell_offset[i];
    const int64_t first = m->first_node[i], num_nodes = m->num_nodes[i];
    node_type *node = (node_type *)m->scratch;
    v4 *force = (v4 *)(node + num_nodes);
    double *volume = (double *)(force + num_nodes);
    const double *xn = x + 3 * first, *vn = v + 3 * first;
    for (int64_t n = 0; n < num_nodes; n++, xn += 3, vn += 3) {
      node[n].x = (v4){xn[0], xn[1], xn[2], 0.0};
      node[n].d = (v4){half * vn[0], half * vn[1], half * vn[2], 0.0};
      force[n] = (v4){0.0, 0.0, 0.0, 0.0};
    }
    const double *table = m->parameters + i * num_parameters;
    if (!law && isfinite(table[0])) {
      const int last = (int)table[1] - 1;
      for (int s = 0; s < last; s++) {
        const double *strain_at = table + 2 + s, *stress_at = strain_at + last + 1;
        m->segments[s] = (stress_at[1] - stress_at[0]) / (strain_at[1] - strain_at[0]);
        m->segments[last + s] = 1.0 / (3.0 * m->shear[i] + m->segments[s]);
      }
    }
    const grain_type grain = {.node = node - first,
                              .force = force - first,
                              .cells = m->cells + 4 * begin,
                              .deviator = deviator + 6 * begin,
                              .strain = strain + begin,
                              .work = work + begin,
                              .pressure = m->pressure + begin,
                              .volume0 = m->volume0 + begin,
                              .dt = dt,
                              .bulk = m->bulk[i],
                              .shear = m->shear[i],
                              .own = m->own[i],
                              .parameters = table,
                              .segments = m->segments,
                              .law = law};
    int64_t found;
    if (x0) {
      const double *at = x0 + 3 * first;
      for (int64_t n = 0; n < num_nodes; n++, at += 3)
        node[n].d = node[n].x - (v4){at[0], at[1], at[2], 0.0};
      found = stresses_of(m, i, &grain, node, volume, element, 1);
    } else {
      found = stresses_of(m, i, &grain, node, volume, element, 0);
    }
    if (found >= 0) bad = begin + found;
    double *fn = f + 3 * first;
    for (int64_t n = 0; n < num_nodes; n++, fn += 3)
      for (int c = 0; c < 3; c++) fn[c] += force[n][c];
  }
  return bad;
}
