/* Contact of nodes, or of points in facets, with rigid planes. The law and all arrays are
   described in kernels/walls.py. */

#include "due.h"
#include "vectors.h"

/* What a pair keeps, two cache lines; the anchor from ``point`` of the wall. */
typedef struct {
  int32_t node, wall;
  uint8_t closed, sliding, none[6];
  double gap, offset, push, area, recess, ratio;
  vec3 anchor, shear;
  double slip, work;
} state_type;

/* In the order of kernels/walls.py. */
typedef struct {
  state_type *state;
  double *due;
  int32_t *scratch;
  const double *layer;
  points_type points;
  double *x, *f, *wall_force, *wall_torque;
  const double *point, *normal, *velocity, *friction, *friction_kinetic;
} walls_type;

/* Ask for what the pairs after the i-th of the list need; from i = -2 AHEAD on. */
INLINE void fetch_ahead(const walls_type *m, int64_t i, int64_t num_due) {
  if (i + 2 * AHEAD < num_due) {
    const char *row = (const char *)(m->state + m->scratch[i + 2 * AHEAD]);
    FETCH(row);
    FETCH(row + 64);
  }
  if (i + AHEAD >= 0 && i + AHEAD < num_due) {
    const int64_t n = m->state[m->scratch[i + AHEAD]].node;
    FETCH(m->layer + n);
    FETCH(m->x + 3 * n);
    if (m->points.corner) {
      FETCH(m->points.corner + 3 * n);
      FETCH(m->points.weight + 3 * n);
    }
  }
  if (i + AHEAD / 2 >= 0 && i + AHEAD / 2 < num_due) {
    const int64_t n = m->state[m->scratch[i + AHEAD / 2]].node;
    for (int k = 0; k < 3 && m->points.corner; k++) {
      FETCH(m->x + 3 * (int64_t)m->points.corner[3 * n + k]);
      FETCH(m->f + 3 * (int64_t)m->points.corner[3 * n + k]);
    }
  }
}

/* See kernels/walls.py; ``totals``: energy dissipated, adopted pairs. */
void mufe_add_wall_forces(const walls_type *m, double *totals, double clock, double ahead,
                          int64_t num_pairs, int64_t adopt) {
  double dissipated = 0.0, num_adopted = 0.0;
  int64_t num_due = find_due(m->scratch, m->due, clock, num_pairs);
  for (int64_t i = -2 * AHEAD; i < num_due; i++) {
    fetch_ahead(m, i, num_due);
    if (i < 0) continue;
    const int64_t p = m->scratch[i];
    state_type *s = m->state + p;
    const int64_t n = s->node, w = s->wall;
    const vec3 normal = at(m->normal, w);
    const vec3 plane = along(at(m->point, w), ahead, at(m->velocity, w));
    const vec3 r = minus(place(&m->points, m->x, n), plane);
    const double g = dot(r, normal) + s->recess;
    s->gap = g;
    if (!s->closed) {
      if (s->offset < 0.0) s->offset = least(most(s->offset, g), 0.0);
      if (adopt && g < s->offset) {
        num_adopted += 1.0;
        s->offset = g;
      }
    }
    const double depth = s->offset - g;
    const double kn = s->area / m->layer[n], kt = kn * s->ratio;
    if (depth <= 0.0) {
      if (s->closed) {
        double lost = dot(s->shear, s->shear) / (2.0 * kt);
        dissipated += lost;
        s->work += lost;
        s->closed = s->sliding = 0;
        s->push = 0.0;
        s->shear = (vec3){0.0, 0.0, 0.0};
      }
      m->due[p] = clock + most(g, 0.0);
      continue;
    }
    m->due[p] = clock;
    if (!s->closed) {
      s->closed = 1;
      s->anchor = r;
    }
    const double N = kn * depth;
    s->push = N;
    vec3 spring = across(minus(r, s->anchor), normal);
    const double T = kt * length(spring);
    s->sliding = T > (s->sliding ? m->friction_kinetic[w] : m->friction[w]) * N;
    if (s->sliding) {
      /* Work of the mean friction of the step: exact for the trapezoidal rule. */
      double limit = m->friction_kinetic[w] * N, slipped = (T - limit) / kt;
      double lost = 0.5 * (length(s->shear) + limit) * slipped;
      dissipated += lost;
      s->work += lost;
      s->slip += slipped;
      spring = times(limit / T, spring);
      s->anchor = minus(r, spring);
    }
    s->shear = times(-kt, spring);
    const vec3 force = along(s->shear, N, normal);
    spread(&m->points, m->f, n, force);
    add_to(m->wall_force, w, times(-1.0, force));
    add_to(m->wall_torque, w, cross(force, r));
  }
  totals[0] = dissipated, totals[1] = num_adopted;
}
