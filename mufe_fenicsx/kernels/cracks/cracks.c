/* Forces on opened facets, and facets that are strained enough to open; described in
   kernels/cracks/cracks.py. */

#include <stdint.h>
#include <string.h>

#include "law.h"

/* Facets are near their strength from this part of it on. */
#define NEAR 0.8
/* Facets of such a cell are looked at. */
#define LOOKED_AT 16
/* A failed point so many times the root of its facet's area away from its partner is alone. */
#define REACH 0.5

/* In the order of kernels/cracks/cracks.py. */
typedef struct {
  const int32_t *nodes; /* of the three corners on one side, then on the other */
  const double *area, *friction;
  point_type *points; /* three a facet */
} cracks_type;

/* Rows: normal, and two directions across it; of the mean of both sides. */
static void frame_of(double frame[3][3], const double *x, const int32_t *node) {
  double e[2][3], *n = frame[0];
  for (int k = 0; k < 2; k++)
    for (int j = 0; j < 3; j++)
      e[k][j] =
          x[3 * node[k + 1] + j] + x[3 * node[k + 4] + j] - x[3 * node[0] + j] - x[3 * node[3] + j];
  n[0] = e[0][1] * e[1][2] - e[0][2] * e[1][1];
  n[1] = e[0][2] * e[1][0] - e[0][0] * e[1][2];
  n[2] = e[0][0] * e[1][1] - e[0][1] * e[1][0];
  memcpy(frame[1], e[0], sizeof e[0]);
  for (int k = 0; k < 2; k++) {
    const double *a = frame[k], length = sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]);
    for (int j = 0; j < 3; j++) frame[k][j] /= length;
  }
  frame[2][0] = n[1] * frame[1][2] - n[2] * frame[1][1];
  frame[2][1] = n[2] * frame[1][0] - n[0] * frame[1][2];
  frame[2][2] = n[0] * frame[1][1] - n[1] * frame[1][0];
}

/* Stretch of a point in its frame. */
static void stretch_of(double w[3], const point_type *p, double frame[3][3], const double *x,
                       int32_t one, int32_t other) {
  for (int k = 0; k < 3; k++) {
    w[k] = p->start[k];
    for (int j = 0; j < 3; j++) w[k] += frame[k][j] * (x[3 * other + j] - x[3 * one + j]);
  }
}

/* A failed point that has come far from its partner has lost it. */
static int is_lost(const point_type *p, const double w[3], double reach) {
  return has_failed(p) && square(w[0]) + square(w[1]) + square(w[2]) > square(reach);
}

void mufe_add_cracks(const cracks_type *c, double shear, const double *x, const double *v,
                     double *f, double dt, int64_t num) {
  const law_type law = {shear};
  for (int64_t i = 0; i < num; i++) {
    const int32_t *node = c->nodes + 6 * i;
    double frame[3][3], w[3], t[3];
    int known = 0;
    for (int k = 0; k < 3; k++) {
      point_type *kept = c->points + 3 * i + k, p = *kept;
      if (p.open <= 0.0) continue;
      if (!known++) frame_of(frame, x, node);
      const int32_t one = node[k], other = node[3 + k];
      stretch_of(w, &p, frame, x, one, other);
      if (dt > 0.0 && is_lost(&p, w, REACH * sqrt(c->area[i]))) {
        /* What its springs hold is counted as rubbed off; it bears no more. */
        kept->rubbed += stored(&p, law, w);
        kept->open = -1.0;
        continue;
      }
      const double damper = viscosity(&p, law, w);
      bear(t, &p, law, c->friction[i], w);
      const double weight = c->area[i] / 3.0;
      for (int j = 0; j < 3; j++) {
        const double speed = v[3 * other + j] - v[3 * one + j], before = p.drag[j];
        if (dt > 0.0) p.drag[j] = damper * speed;
        p.damped += 0.5 * dt * speed * (before + p.drag[j]);
        const double force =
            weight * (t[0] * frame[0][j] + t[1] * frame[1][j] + t[2] * frame[2][j] + p.drag[j]);
        f[3 * one + j] += force;
        f[3 * other + j] -= force;
      }
      if (dt > 0.0) *kept = p;
    }
  }
}

/* ``found``: sums of stored, fractured, rubbed and damped energy, and of that begun with [J]. */
void mufe_crack_energies(const cracks_type *c, double shear, const double *x, double *found,
                         int64_t num) {
  const law_type law = {shear};
  for (int64_t i = 0; i < num; i++) {
    double frame[3][3], w[3];
    frame_of(frame, x, c->nodes + 6 * i);
    for (int k = 0; k < 3; k++) {
      const point_type *p = c->points + 3 * i + k;
      const double weight = c->area[i] / 3.0;
      if (p->open == 0.0) continue;
      stretch_of(w, p, frame, x, c->nodes[6 * i + k], c->nodes[6 * i + 3 + k]);
      if (p->open > 0.0) found[0] += weight * stored(p, law, w);
      found[1] += weight * fractured(p, law);
      found[2] += weight * p->rubbed;
      found[3] += weight * p->damped;
      found[4] += weight * begun(p, law);
    }
  }
}

/* Facets bear no more; what their springs held [J]. ``traction``: the mean one on their first sides
   until now [Pa], row after row. */
double mufe_leave_cracks(const cracks_type *c, double shear, const double *x, const int64_t *which,
                         double *traction, int64_t num) {
  const law_type law = {shear};
  double held = 0.0;
  for (int64_t m = 0; m < num; m++) {
    double frame[3][3], w[3], t[3];
    frame_of(frame, x, c->nodes + 6 * which[m]);
    for (int k = 0; k < 3; k++) {
      point_type *kept = c->points + 3 * which[m] + k, p = *kept;
      if (p.open <= 0.0) continue;
      stretch_of(w, &p, frame, x, c->nodes[6 * which[m] + k], c->nodes[6 * which[m] + 3 + k]);
      bear(t, &p, law, c->friction[which[m]], w);
      for (int j = 0; j < 3; j++)
        traction[3 * m + j] += (t[0] * frame[0][j] + t[1] * frame[1][j] + t[2] * frame[2][j]) / 3.0;
      held += c->area[which[m]] / 3.0 * stored(kept, law, w);
      kept->open = -1.0;
    }
  }
  return held;
}

/* Points begin to bear a traction [Pa] of three global components each, row after row. */
void mufe_begin_cracks(const cracks_type *c, double shear, const double *x, const int64_t *which,
                       const double *traction, int64_t num) {
  const law_type law = {shear};
  for (int64_t m = 0; m < num; m++) {
    const int64_t i = which[m] / 3;
    double frame[3][3], t[3];
    frame_of(frame, x, c->nodes + 6 * i);
    for (int k = 0; k < 3; k++) {
      t[k] = 0.0;
      for (int j = 0; j < 3; j++) t[k] += frame[k][j] * traction[3 * m + j];
    }
    begin(c->points + which[m], law, c->friction[i], t);
  }
}

/* --- facets that open -------------------------------------------------------------------- */

/* In the order of kernels/cracks/cracks.py. */
typedef struct {
  const int32_t *cells;   /* nodes of cells */
  const double *volume;   /* first volumes of cells */
  const double *weakest;  /* least strength of the facets of each cell that are closed, inf: none */
  const int32_t *across;  /* cells on both sides of a facet */
  const uint8_t *corner;  /* corners of the first cell that are those of the facet */
  const double *strength; /* of the facets; inf: open, or never opens */
  const double *friction; /* of the facets */
  uint8_t *near;          /* of cells: LOOKED_AT, and bit_of facets that are listed */
  int64_t *listed;        /* facets that have come near their strength */
  const double *softens;  /* from which effective traction on facets open at once, as strength */
  int64_t *found;         /* facets that open */
} facets_type;

/* Whether some plane can bear an effective traction of ``least``, or a part of it that makes the bound
   hold for means of cells; s: xx yy zz xy yz xz of a deviator. Of the mean stress m, no plane bears more
   than the largest principal stress, at most m + 2/3 q, and shear q/√3. Where none is pulled
   |t_t| + μ t_n decides, at most (σ₁ - σ₃)/2 √(1 + μ²) + μ (σ₁ + σ₃)/2, where (σ₁ + σ₃)/2 is at most
   m + q/6. The part: what bears √(t_n² + (t_t/β)²) = 1 has |t_t| + μ t_n of at most √(β² + μ²). */
static inline int can_bear(const double *s, double mean, double shear, double friction,
                           double least) {
  const double q2 = 1.5 * (s[0] * s[0] + s[1] * s[1] + s[2] * s[2]) +
                    3.0 * (s[3] * s[3] + s[4] * s[4] + s[5] * s[5]);
  const double sheared = q2 / (3.0 * shear * shear),
               part = least / sqrt(1.0 + square(friction / shear));
  /* First without a root: (a + b)² is at most 2 a² + 2 b². */
  if (2.0 * mean * mean + q2 * (8.0 / 9.0) + sheared < part * part) return 0;
  const double q = sqrt(q2), pulled = mean + q * (2.0 / 3.0);
  if (pulled > 0.0) return square(pulled) + sheared >= part * part;
  return sqrt((1.0 + friction * friction) / 3.0) * q + friction * (mean + q / 6.0) >= shear * least;
}

static double mean_of(const facets_type *m, const double *pressure, int64_t c, int averaged) {
  const int32_t *n = m->cells + 4 * c;
  if (!averaged) return pressure[c];
  return 0.25 * (pressure[n[0]] + pressure[n[1]] + pressure[n[2]] + pressure[n[3]]);
}

/* Stress of a cell times its volume, added. */
static void add_stress(double sum[6], const facets_type *m, const double *deviator,
                       const double *pressure, int64_t c, int averaged) {
  const double mean = mean_of(m, pressure, c, averaged);
  for (int k = 0; k < 6; k++) sum[k] += m->volume[c] * (deviator[6 * c + k] + (k < 3 ? mean : 0.0));
}

/* Effective traction of a facet times twice its area and the volume of both cells, squared; ``whole``:
   these two factors, squared. */
static double reached_by(const facets_type *m, const double *deviator, const double *pressure,
                         const double *x, double shear, int64_t i, int averaged, double *whole) {
  const int32_t a = m->across[2 * i], b = m->across[2 * i + 1];
  double s[6] = {0.0}, n[3], t[3], e[2][3];
  add_stress(s, m, deviator, pressure, a, averaged);
  add_stress(s, m, deviator, pressure, b, averaged);
  const int32_t *cell = m->cells + 4 * a;
  const uint8_t *corner = m->corner + 3 * i;
  for (int k = 0; k < 2; k++)
    for (int j = 0; j < 3; j++)
      e[k][j] = x[3 * cell[corner[k + 1]] + j] - x[3 * cell[corner[0]] + j];
  n[0] = e[0][1] * e[1][2] - e[0][2] * e[1][1];
  n[1] = e[0][2] * e[1][0] - e[0][0] * e[1][2];
  n[2] = e[0][0] * e[1][1] - e[0][1] * e[1][0];
  t[0] = s[0] * n[0] + s[3] * n[1] + s[5] * n[2];
  t[1] = s[3] * n[0] + s[1] * n[1] + s[4] * n[2];
  t[2] = s[5] * n[0] + s[4] * n[1] + s[2] * n[2];
  const double size = square(n[0]) + square(n[1]) + square(n[2]);
  const double normal = (t[0] * n[0] + t[1] * n[1] + t[2] * n[2]);
  const double all = square(t[0]) + square(t[1]) + square(t[2]);
  const double rubs = m->friction[i] * positive(-normal);
  double across = positive(all * size - square(normal));
  if (rubs > 0.0) across = square(positive(sqrt(across) - rubs));
  *whole = square(size * (m->volume[a] + m->volume[b]));
  return square(positive(normal)) + across / square(shear);
}

/* A bit of ``near`` of its first cell for each facet: the number of the corner across from it. */
static inline uint8_t bit_of(const facets_type *m, int64_t i) {
  const uint8_t *corner = m->corner + 3 * i;
  return (uint8_t)(1 << (6 - corner[0] - corner[1] - corner[2]));
}

/* Lists closed facets that have come near their strength; returns how many. */
int64_t mufe_list_near(const facets_type *m, const double *deviator, const double *pressure,
                       const double *x, double shear, double friction, int64_t num_cells,
                       int64_t num_facets, int averaged) {
  int64_t some = 0, count = 0;
  for (int64_t c = 0; c < num_cells; c++) {
    const double mean = mean_of(m, pressure, c, averaged);
    const int looks = can_bear(deviator + 6 * c, mean, shear, friction, NEAR * m->weakest[c]);
    m->near[c] = looks ? LOOKED_AT : 0;
    some += looks;
  }
  for (int64_t i = 0; some && i < num_facets; i++) {
    const int32_t a = m->across[2 * i], b = m->across[2 * i + 1];
    if (!((m->near[a] | m->near[b]) & LOOKED_AT) || m->strength[i] == INFINITY) continue;
    double whole;
    const double reached = reached_by(m, deviator, pressure, x, shear, i, averaged, &whole);
    if (reached < square(NEAR * m->strength[i]) * whole) continue;
    m->near[a] |= bit_of(m, i);
    m->listed[count++] = i;
  }
  return count;
}

/* Lists those again that are still closed. */
int64_t mufe_list_again(const facets_type *m, int64_t num_facets) {
  int64_t count = 0;
  for (int64_t i = 0; i < num_facets; i++)
    if (m->near[m->across[2 * i]] & bit_of(m, i) && m->strength[i] < INFINITY)
      m->listed[count++] = i;
  return count;
}

/* Listed facets whose effective traction has reached their strength, into ``found``; returns how many.
   ``now``: how many of them open at once. */
int64_t mufe_find_strained(const facets_type *m, const double *deviator, const double *pressure,
                           const double *x, double shear, int64_t num_listed, int averaged,
                           int64_t *now) {
  int64_t count = 0;
  *now = 0;
  for (int64_t k = 0; k < num_listed; k++) {
    const int64_t i = m->listed[k];
    double whole;
    const double reached = reached_by(m, deviator, pressure, x, shear, i, averaged, &whole);
    if (reached < square(m->strength[i]) * whole) continue;
    m->found[count++] = i;
    *now += reached >= square(m->softens[i]) * whole;
  }
  return count;
}
