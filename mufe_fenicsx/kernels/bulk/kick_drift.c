/* The end of a step and the begin of the next one; what it does, and all arrays, are described in
   kernels/bulk/kick_drift.py. Rows of three numbers are worked on as they stand, LANES nodes in three
   vectors; sums and products are those of the kernels of motion.py, in the same order. */

#include "lanes.h"

/* In the order of kernels/bulk/kick_drift.py. */
typedef struct {
  double *x, *u, *v, *f;
  const double *mass, *x0;
  const int64_t *runs;
  const double *field;
  double *moves;
} motion_type;

typedef struct {
  double half_last, half, dt, scale, damping;
} step_type;

#if LANES == 8
/* A number of each node for each of its three in a row. */
#define SPREAD(a)                                                          \
  {PICK(a, a, 0, 0, 0, 1, 1, 1, 2, 2), PICK(a, a, 2, 3, 3, 3, 4, 4, 4, 5), \
   PICK(a, a, 5, 5, 6, 6, 6, 7, 7, 7)}
/* Rows of three numbers -> a vector of each number. */
INLINE void split(vec out[3], const vec r[3]) {
  const vec x = PICK(r[0], r[1], 0, 3, 6, 9, 12, 15, 0, 0);
  const vec y = PICK(r[0], r[1], 1, 4, 7, 10, 13, 0, 0, 0);
  const vec z = PICK(r[0], r[1], 2, 5, 8, 11, 14, 0, 0, 0);
  out[0] = PICK(x, r[2], 0, 1, 2, 3, 4, 5, 10, 13);
  out[1] = PICK(y, r[2], 0, 1, 2, 3, 4, 8, 11, 14);
  out[2] = PICK(z, r[2], 0, 1, 2, 3, 4, 9, 12, 15);
}
#else
#define SPREAD(a) {PICK(a, a, 0, 0, 0, 1), PICK(a, a, 1, 1, 2, 2), PICK(a, a, 2, 3, 3, 3)}
INLINE void split(vec out[3], const vec r[3]) {
  const vec x = PICK(r[0], r[1], 0, 3, 6, 0), y = PICK(r[0], r[1], 1, 4, 7, 0);
  const vec z = PICK(r[0], r[1], 2, 5, 0, 0);
  out[0] = PICK(x, r[2], 0, 1, 2, 5);
  out[1] = PICK(y, r[2], 0, 1, 2, 6);
  out[2] = PICK(z, r[2], 0, 1, 4, 7);
}
#endif

INLINE vec larger(vec a, vec b) { return where_each(a > b, a, b); }

/* Squares of velocities, and of what they are beside the field; lanes and one node. */
#define SQUARES(type)                                                      \
  const type square = w[0] * w[0] + w[1] * w[1] + w[2] * w[2];             \
  const type a = w[0] - (F[0] + p[0] * F[3] + p[1] * F[6] + p[2] * F[9]);  \
  const type b = w[1] - (F[1] + p[0] * F[4] + p[1] * F[7] + p[2] * F[10]); \
  const type c = w[2] - (F[2] + p[0] * F[5] + p[1] * F[8] + p[2] * F[11]); \
  const type beside = a * a + b * b + c * c

/* LANES nodes from the n-th on. */
INLINE void move_lanes(const motion_type *m, step_type s, int64_t n, vec found[3]) {
  const double *F = m->field;
  const vec inverse = 1.0 / *(const vec_at *)(m->mass + n);
  const vec each[3] = SPREAD(inverse);
  vec moving[3], place[3], w[3], p[3];
  for (int k = 0; k < 3; k++) {
    const int64_t i = 3 * n + LANES * k;
    vec_at *x = (vec_at *)(m->x + i), *u = (vec_at *)(m->u + i), *v = (vec_at *)(m->v + i);
    vec_at *f = (vec_at *)(m->f + i);
    const vec acceleration = *f * each[k], end = (*v + s.half_last * acceleration) * s.scale;
    place[k] = *x;
    *v = moving[k] = end + s.half * (acceleration - s.damping * end);
    *u += s.dt * moving[k];
    *x = *(const vec_at *)(m->x0 + i) + *u;
    *f = all(0.0);
  }
  split(w, moving);
  split(p, place);
  SQUARES(vec);
  found[0] = larger(beside, found[0]);
  found[1] = larger(square, found[1]);
  found[2] += square;
}

/* One node. */
INLINE void move_one(const motion_type *m, step_type s, int64_t n, double found[3]) {
  const double *F = m->field, inverse = 1.0 / m->mass[n];
  double w[3], p[3];
  for (int k = 0; k < 3; k++) {
    const int64_t i = 3 * n + k;
    const double acceleration = m->f[i] * inverse;
    const double end = (m->v[i] + s.half_last * acceleration) * s.scale;
    p[k] = m->x[i];
    m->v[i] = w[k] = end + s.half * (acceleration - s.damping * end);
    m->u[i] += s.dt * w[k];
    m->x[i] = m->x0[i] + m->u[i];
    m->f[i] = 0.0;
  }
  SQUARES(double);
  found[0] = beside > found[0] ? beside : found[0];
  found[1] = square > found[1] ? square : found[1];
  found[2] += square;
}

/* Sum of m v² of nodes at the end of the last step, added to ``sum``. */
static double add_squares(const motion_type *m, step_type s, int64_t n, int64_t end, double sum) {
  for (; n < end; n++)
    for (int k = 0; k < 3; k++) {
      const double a = m->f[3 * n + k] * (1.0 / m->mass[n]);
      const double v = (m->v[3 * n + k] + s.half_last * a) * s.scale;
      sum += m->mass[n] * v * v;
    }
  return sum;
}

/* See kernels/bulk/kick_drift.py; ``totals``: sum of m v² at the end of the last step, which only damping
   asks for, then the largest and the sum of squares of velocities in the next one. */
void mufe_kick_and_drift(const motion_type *m, double *totals, double last, double dt,
                         double damping, int64_t num_runs) {
  const double half_last = 0.5 * last;
  const step_type s = {half_last, 0.5 * dt, dt, 1.0 / (1.0 + half_last * damping), damping};
  double lost = 0.0, one[3] = {0.0, 0.0, 0.0};
  vec many[3] = {all(0.0), all(0.0), all(0.0)};
  for (const int64_t *run = m->runs; run < m->runs + 3 * num_runs; run += 3) {
    const int64_t end = run[1];
    if (damping > 0.0) lost = add_squares(m, s, run[0], end, lost);
    int64_t n = run[0];
    one[0] = 0.0;
    many[0] = all(0.0);
    for (; n + LANES <= end; n += LANES) move_lanes(m, s, n, many);
    for (; n < end; n++) move_one(m, s, n, one);
    for (int i = 0; i < LANES; i++) one[0] = many[0][i] > one[0] ? many[0][i] : one[0];
    m->moves[run[2]] = dt * sqrt(one[0]);
  }
  for (int i = 0; i < LANES; i++) {
    one[1] = many[1][i] > one[1] ? many[1][i] : one[1];
    one[2] += many[2][i];
  }
  totals[0] = lost, totals[1] = one[1], totals[2] = one[2];
}
