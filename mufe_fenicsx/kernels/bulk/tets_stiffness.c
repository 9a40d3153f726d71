/* Products of the elastic tangent of linear tetrahedra, eight (or four) at a time.

   What it is, and all arguments, are described in kernels/bulk/solid.py; how it is made fast, in
   tets.c. */

#include <string.h>

#include "tets.h"

/* Of a batch of elements: edges e and differences d of the packed displacements. */
INLINE void differences(const grain_type *g, int64_t e, int count, vec edge[3][4], vec move[3][4],
                        vec *sum) {
  const int32_t *cells = g->cells + 4 * e;
#pragma GCC unroll 4
  for (int j = 0; j < 4; j++) {
    const int i = FIRST(j), k = i + SECOND;
    const int32_t *c = cells + 4 * (i < count ? i : count - 1);
    const int32_t *cc = cells + 4 * (k < count ? k : count - 1);
    vec x = join(NODE(c[0])->x, NODE(cc[0])->x), d = join(NODE(c[0])->d, NODE(cc[0])->d);
    sum[j] = x;
#pragma GCC unroll 3
    for (int n = 0; n < 3; n++) {
      vec there = join(NODE(c[n + 1])->x, NODE(cc[n + 1])->x);
      sum[j] += there;
      edge[n][j] = there - x;
      move[n][j] = join(NODE(c[n + 1])->d, NODE(cc[n + 1])->d) - d;
    }
  }
#pragma GCC unroll 3
  for (int n = 0; n < 3; n++) to_lanes(edge[n]), to_lanes(move[n]);
  to_lanes(sum);
}

/* Six times the volume times the gradients of nodes b, c, d. */
INLINE void cofactors(vec edge[3][4], vec h[3][3]) {
#pragma GCC unroll 3
  for (int n = 0; n < 3; n++) {
    vec *u = edge[(n + 1) % 3], *v = edge[(n + 2) % 3];
    h[n][0] = u[1] * v[2] - u[2] * v[1];
    h[n][1] = u[2] * v[0] - u[0] * v[2];
    h[n][2] = u[0] * v[1] - u[1] * v[0];
  }
}

/* Six times the change of the volumes by the packed displacements. */
INLINE vec six_changes(const grain_type *g, int64_t e, int count) {
  vec edge[3][4], move[3][4], sum[4], h[3][3], change = all(0.0);
  differences(g, e, count, edge, move, sum);
  cofactors(edge, h);
#pragma GCC unroll 3
  for (int n = 0; n < 3; n++)
    change += h[n][0] * move[n][0] + h[n][1] * move[n][1] + h[n][2] * move[n][2];
  return change;
}

/* Add the forces that a batch of elements resists the packed displacements with. */
INLINE void resist(const grain_type *g, int64_t e, int count, int element) {
  vec edge[3][4], d[3][4], sum[4], h[3][3];
  differences(g, e, count, edge, d, sum);
  cofactors(edge, h);
  vec det = edge[0][0] * h[0][0] + edge[0][1] * h[0][1] + edge[0][2] * h[0][2];
  vec l[3][3]; /* gradient of the displacement times six volumes */
#pragma GCC unroll 3
  for (int i = 0; i < 3; i++)
#pragma GCC unroll 3
    for (int k = 0; k < 3; k++) l[i][k] = d[0][i] * h[0][k] + d[1][i] * h[1][k] + d[2][i] * h[2][k];
  vec trace = l[0][0] + l[1][1] + l[2][2], volume0 = all(0.0), p;
  for (int i = 0; i < LANES; i++) volume0[i] = g->volume0[e + (i < count ? i : count - 1)];
  if (element == AVERAGED) {
    const vec ratio = volume0 * (6.0 / det), grown = (1.0 - ratio) * ratio;
    p = 0.25 * sum[3] + 3.0 * g->own * grown * grown * trace / det;
  } else {
    p = g->bulk * trace / (6.0 * volume0);
  }
  vec G = (1.0 / 3.0) * g->shear / det;
  vec diagonal = (1.0 / 6.0) * p - (1.0 / 3.0) * G * trace;
  vec txx = G * l[0][0] + diagonal, tyy = G * l[1][1] + diagonal, tzz = G * l[2][2] + diagonal;
  vec txy = 0.5 * G * (l[0][1] + l[1][0]), tyz = 0.5 * G * (l[1][2] + l[2][1]);
  vec txz = 0.5 * G * (l[0][2] + l[2][0]);
  vec f[3][4];
#pragma GCC unroll 3
  for (int n = 0; n < 3; n++) {
    f[n][0] = txx * h[n][0] + txy * h[n][1] + txz * h[n][2];
    f[n][1] = txy * h[n][0] + tyy * h[n][1] + tyz * h[n][2];
    f[n][2] = txz * h[n][0] + tyz * h[n][1] + tzz * h[n][2];
    f[n][3] = all(0.0);
    to_rows(f[n]);
  }
  const int32_t *cells = g->cells + 4 * e;
#pragma GCC unroll 4
  for (int j = 0; j < 4; j++) {
    const int i = FIRST(j), k = i + SECOND;
    vec first = f[0][j] + f[1][j] + f[2][j];
    if (i < count) {
      const int32_t *c = cells + 4 * i;
      FORCE(c[0]) -= low(first);
      FORCE(c[1]) += low(f[0][j]);
      FORCE(c[2]) += low(f[1][j]);
      FORCE(c[3]) += low(f[2][j]);
    }
    if (SECOND && k < count) {
      const int32_t *c = cells + 4 * k;
      FORCE(c[0]) -= high(first);
      FORCE(c[1]) += high(f[0][j]);
      FORCE(c[2]) += high(f[1][j]);
      FORCE(c[3]) += high(f[2][j]);
    }
  }
}

/* Pressures of the nodes by the packed displacements, into their packed data. */
INLINE void averaged_pressure(const grain_type *g, int64_t num_cells, node_type *node,
                              const double *volume0, double *change, int64_t num_nodes,
                              int64_t first) {
  memset(change, 0, num_nodes * sizeof(double));
  for (int64_t e = 0; e < num_cells; e += LANES) {
    const int count = num_cells - e < LANES ? (int)(num_cells - e) : LANES;
    vec quarter = count == LANES ? six_changes(g, e, LANES) : six_changes(g, e, count);
    quarter *= 1.0 / 24.0;
#pragma GCC unroll 8
    for (int i = 0; i < LANES; i++) {
      if (i == count) break;
      const int32_t *c = g->cells + 4 * (e + i);
      for (int k = 0; k < 4; k++) change[(uint32_t)c[k] - first] += quarter[i];
    }
  }
  for (int64_t n = 0; n < num_nodes; n++) node[n].x[3] = g->bulk * change[n] / volume0[n];
}

/* Add K q to y: the elastic tangent at the positions x, see kernels/bulk/solid.py. */
void mufe_add_stiffness(const model_type *m, double *y, const double *q, const double *x,
                        const int64_t *grains, int64_t num_grains, int64_t element) {
  for (int64_t k = 0; k < num_grains; k++) {
    const int64_t i = grains[k], begin = m->cell_offset[i], count = m->cell_offset[i + 1] - begin;
    const int64_t first = m->first_node[i], num_nodes = m->num_nodes[i];
    node_type *node = (node_type *)m->scratch;
    v4 *force = (v4 *)(node + num_nodes);
    const double *xn = x + 3 * first, *qn = q + 3 * first;
    for (int64_t n = 0; n < num_nodes; n++, xn += 3, qn += 3) {
      node[n].x = (v4){xn[0], xn[1], xn[2], 0.0};
      node[n].d = (v4){qn[0], qn[1], qn[2], 0.0};
      force[n] = (v4){0.0, 0.0, 0.0, 0.0};
    }
    const grain_type grain = {.node = node - first,
                              .force = force - first,
                              .cells = m->cells + 4 * begin,
                              .volume0 = m->volume0 + begin,
                              .bulk = m->bulk[i],
                              .shear = m->shear[i],
                              .own = m->own[i]};
    if (element == AVERAGED) {
      double *change = (double *)(force + num_nodes);
      averaged_pressure(&grain, count, node, m->node_volume0 + first, change, num_nodes, first);
    }
    for (int64_t e = 0; e < count; e += LANES) {
      const int some = count - e < LANES ? (int)(count - e) : LANES;
      if (element == AVERAGED && some == LANES) {
        resist(&grain, e, LANES, AVERAGED);
      } else if (element == AVERAGED) {
        resist(&grain, e, some, AVERAGED);
      } else {
        resist(&grain, e, some, PLAIN);
      }
    }
    double *yn = y + 3 * first;
    for (int64_t n = 0; n < num_nodes; n++, yn += 3)
      for (int c = 0; c < 3; c++) yn[c] += force[n][c];
  }
}
