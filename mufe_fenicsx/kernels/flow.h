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

/* Largest dent: that with the radius of its circle h/√2, b = h²/4R. ``m`` is XI h²/R. */
INLINE double largest_dent(double m) { return m / (4.0 * XI); }

/* Depth of the pair p at which it flows with the dent b. ``layers``: compliance of both sides;
   ``h``: edge. A dent of this depth is as wide as a circle of the radius √(2 R b). */
static double yield_depth(const strength_type *of, int64_t p, double m, double h, double layers,
                          double b) {
  if (!of->tables || !(m > 0.0) || b >= largest_dent(m)) return INFINITY;
  const double strain = TABOR * sqrt(8.0 * b * largest_dent(m)) / h;
  double weaker = INFINITY;
  for (int side = 0; side < 2; side++) {
    const int32_t offset = of->offset[2 * p + side];
    if (offset >= 0) weaker = least(weaker, yield_stress_at(of->tables + offset, strain));
  }
  return isfinite(weaker) ? depth_of(PUNCH * weaker * layers, m) : INFINITY;
}

/* By how much a dent b of the pair p deepens at a depth beyond ``limit``, its yield depth, which is
   set anew: depth - deeper = yield_depth(b + deeper), or until the dent is the largest one. The left
   side falls and the right side rises with ``deeper``: the false position, Illinois' way. */
static double flow(const strength_type *of, int64_t p, double m, double h, double layers, double b,
                   double depth, double *limit) {
  double low = 0.0, above = depth - *limit;
  double high = least(above, largest_dent(m) - b);
  *limit = yield_depth(of, p, m, h, layers, b + high);
  double below = depth - high - *limit;
  if (!isfinite(*limit) || below >= 0.0) return high;
  for (int i = 0; i < 60 && high - low > 1e-14 * depth; i++) {
    const double trial = high - below * (high - low) / (below - above);
    *limit = yield_depth(of, p, m, h, layers, b + trial);
    const double over = depth - trial - *limit;
    if (fabs(over) <= 1e-14 * depth) return trial;
    if (over > 0.0) {
      low = trial, above = over, below *= 0.5;
    } else {
      high = trial, below = over, above *= 0.5;
    }
  }
  *limit = yield_depth(of, p, m, h, layers, b + high);
  return high;
}

/* Part of the law's slope that is left while the dent b of the pair p deepens: r/(1 + r), r being
   the slope of the yield depth by the dent. */
static double slope_left(const strength_type *of, int64_t p, double m, double h, double layers,
                         double b, double limit) {
  if (!isfinite(limit)) return 1.0;
  const double less = (1.0 - 1e-6) * b;
  const double r = (limit - yield_depth(of, p, m, h, layers, less)) / (b - less);
  return r / (1.0 + r);
}

#endif
