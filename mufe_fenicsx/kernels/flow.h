/* A dent in a body that yields under a contact smaller than an element. kernels/pairs.py and walls.py
   describe the arrays. */

#ifndef FLOW_H
#define FLOW_H

#include "contact_law.h"
#include <stdint.h>

/* Mean pressure of a round contact that flows, over the yield stress at a strain that stands for it,
   and that strain over the radius of the contact over that of the body (Tabor 1951). */
#define MEAN_PRESSURE 2.8
#define TABOR 0.2

/* Yield stresses of the materials: at an offset the number n of points, n plastic strains and n
   stresses. ``offset``: of both bodies of a pair, the own one first, -1 where one does not flow.
   ``strain``: of all cells; ``cell``: that beneath the point of a pair. */
typedef struct {
  const double *tables;
  const int32_t *offset;
  const double *strain;
  const int32_t *cell;
} strength_type;

/* What a pair has to flow: its place, m of the law, mean edge, compliance of both layers, and mean
   curvature of the gap. */
typedef struct {
  int64_t pair;
  double m, edge, layers, bend;
} flowing_type;

/* Yield stress at a plastic strain, constant beyond the table. */
INLINE double yield_stress_at(const double *table, double strain) {
  const int32_t last = (int32_t)table[0] - 1;
  const double *strains = table + 1, *stresses = strains + last + 1;
  int32_t k = 0;
  while (k < last && strain >= strains[k + 1]) k++;
  if (k == last) return stresses[last];
  const double part = (strain - strains[k]) / (strains[k + 1] - strains[k]);
  return stresses[k] + part * (stresses[k + 1] - stresses[k]);
}

/* The depth at which the law has a force over stiffness: Newton's method, as in contact_law.py. */
static double depth_of(double over, double m) {
  double d = over;
  for (int i = 0; i < 50; i++) {
    const double change = (over - over_stiffness(d, m)) / slope_over_stiffness(d, m);
    d += change;
    if (fabs(change) <= 1e-14 * d) break;
  }
  return d;
}

/* Largest dent, with the radius of its circle h/√2: what is wider is for the elements beneath. */
INLINE double largest_dent(flowing_type q) { return 0.25 * q.edge * q.edge * q.bend; }

/* Depth at which a pair flows with the dent b, whose circle has the radius a = √(2 R b), R = 1/bend.
   Bodies that are alike have half of the dent each, and the strain of the cell beneath in common; of
   others' cells nothing is known. */
static double yield_depth(const strength_type *of, flowing_type q, double b) {
  if (!of->tables || !(b < largest_dent(q))) return INFINITY;
  const int32_t *offset = of->offset + 2 * q.pair;
  const int alike = offset[0] == offset[1];
  const double of_dent = (alike ? 0.5 : 1.0) * TABOR * sqrt(2.0 * b * q.bend);
  double weaker = INFINITY;
  for (int side = 0; side < 2; side++) {
    if (offset[side] < 0) continue;
    const double beneath = side == 0 || alike ? of->strain[of->cell[q.pair]] : 0.0;
    weaker = least(weaker, yield_stress_at(of->tables + offset[side], beneath + of_dent));
  }
  return isfinite(weaker) ? depth_of(MEAN_PRESSURE * weaker * q.layers, q.m) : INFINITY;
}

/* By how much the dent b of a pair deepens at a depth: by nothing up to ``limit``, its yield depth,
   which is set anew; beyond, depth - deeper = yield_depth(b + deeper), or until the dent is the
   largest one. The left side falls and the right side rises with ``deeper``: the false position,
   Illinois' way. */
static double flow(const strength_type *of, flowing_type q, double b, double depth, double *limit) {
  *limit = yield_depth(of, q, b);
  double low = 0.0, above = depth - *limit;
  if (above <= 0.0) return 0.0;
  double high = least(above, largest_dent(q) - b);
  *limit = yield_depth(of, q, b + high);
  double below = depth - high - *limit;
  if (!isfinite(*limit) || below >= 0.0) return high;
  for (int i = 0; i < 60 && high - low > 1e-14 * depth; i++) {
    const double trial = high - below * (high - low) / (below - above);
    *limit = yield_depth(of, q, b + trial);
    const double over = depth - trial - *limit;
    if (fabs(over) <= 1e-14 * depth) return trial;
    if (over > 0.0) {
      low = trial, above = over, below *= 0.5;
    } else {
      high = trial, below = over, above *= 0.5;
    }
  }
  *limit = yield_depth(of, q, b + high);
  return high;
}

/* Part of the law's slope that is left while the dent b of a pair deepens: r/(1 + r), r being the
   slope of the yield depth by the dent. */
static double slope_left(const strength_type *of, flowing_type q, double b, double limit) {
  if (!isfinite(limit) || !(b > 0.0)) return 1.0;
  const double less = (1.0 - 1e-6) * b;
  const double r = (limit - yield_depth(of, q, less)) / (b - less);
  return r / (1.0 + r);
}

#endif
