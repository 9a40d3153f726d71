/* A dent in a body that yields under a contact smaller than an element. kernels/pairs.py and walls.py
   describe the arrays. */

#ifndef FLOW_H
#define FLOW_H

#include "contact_law.h"
#include <stdint.h>

#define PUNCH 3.6  /* largest pressure under a flat round punch over the yield stress */
#define TABOR 0.2  /* strain that stands for a round contact, over its radius over that of the body */

/* Yield stresses of the materials: at an offset the number n of points, n plastic strains and n
   stresses. ``offset``: of both bodies of a pair, -1 where one does not flow. */
typedef struct {
  const double *tables;
  const int32_t *offset;
} strength_type;

#define CLOSE 1e-10 /* part of a depth to which it is found */

/* Yield stress at a plastic strain, constant beyond the table, and its slope. */
INLINE double yield_stress_at(const double *table, double strain, double *slope) {
  const int32_t last = (int32_t)table[0] - 1;
  const double *strains = table + 1, *stresses = strains + last + 1;
  int32_t k = 0;
  while (k < last && strain >= strains[k + 1]) k++;
  *slope = k == last ? 0.0 : (stresses[k + 1] - stresses[k]) / (strains[k + 1] - strains[k]);
  return stresses[k] + *slope * (strain - strains[k]);
}

/* The depth at which the law has a force over stiffness: Newton's method, as in contact_law.py. */
static double depth_of(double over, double m) {
  double d = over;
  for (int i = 0; i < 50; i++) {
    const double change = (over - over_stiffness(d, m)) / slope_over_stiffness(d, m);
    d += change;
    if (fabs(change) <= 1e-3 * CLOSE * d) break;
  }
  return d;
}

/* Largest dent: that with the radius of its circle h/√2, b = h²/4R. ``m`` is XI h²/R. */
INLINE double largest_dent(double m) { return m / (4.0 * XI); }

/* Depth of the pair p at which it flows with the dent b. ``layers``: compliance of both sides;
   ``h``: edge. A dent of this depth is as wide as a circle of the radius √(2 R b).
   ``slope``: its derivative by b. */
static double yield_depth(const strength_type *of, int64_t p, double m, double h, double layers,
                          double b, double *slope) {
  *slope = 0.0;
  if (!of->tables || !(m > 0.0) || b >= largest_dent(m)) return INFINITY;
  const double strain = TABOR * sqrt(8.0 * b * largest_dent(m)) / h;
  double weaker = INFINITY, by_strain = 0.0;
  for (int side = 0; side < 2; side++) {
    const int32_t offset = of->offset[2 * p + side];
    if (offset < 0) continue;
    double slope_of_side;
    const double Y = yield_stress_at(of->tables + offset, strain, &slope_of_side);
    if (Y < weaker) weaker = Y, by_strain = slope_of_side;
  }
  if (!isfinite(weaker)) return INFINITY;
  const double d = depth_of(PUNCH * weaker * layers, m);
  if (b > 0.0)
    *slope = PUNCH * by_strain * strain / (2.0 * b) * layers / slope_over_stiffness(d, m);
  return d;
}

/* By how much a dent b of the pair p deepens at a depth beyond ``limit``, its yield depth, which is
   set anew: depth - deeper = yield_depth(b + deeper), or until the dent is the largest one. The left
   side falls and the right side rises with ``deeper``: the false position, Illinois' way.
   ``left``: part of the law's slope that is left meanwhile, r/(1 + r), r being that of the limit. */
static double flow(const strength_type *of, int64_t p, double m, double h, double layers, double b,
                   double depth, double *limit, double *left) {
  double low = 0.0, above = depth - *limit, r;
  double high = least(above, largest_dent(m) - b), deeper = high;
  *limit = yield_depth(of, p, m, h, layers, b + high, &r);
  double below = depth - high - *limit;
  if (!isfinite(*limit) || below >= 0.0) {
    *left = isfinite(*limit) ? r / (1.0 + r) : 1.0;
    return high;
  }
  for (int i = 0; i < 60; i++) {
    deeper = high - below * (high - low) / (below - above);
    *limit = yield_depth(of, p, m, h, layers, b + deeper, &r);
    const double over = depth - deeper - *limit;
    if (fabs(over) <= CLOSE * depth) break;
    if (over > 0.0) {
      low = deeper, above = over, below *= 0.5;
    } else {
      high = deeper, below = over, above *= 0.5;
    }
  }
  *left = r / (1.0 + r);
  return deeper;
}

#endif
