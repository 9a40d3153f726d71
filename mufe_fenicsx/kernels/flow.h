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
#define TRIANGLE 0.43301270189221932 /* area of an equilateral triangle over its edge squared */
#define CLOSE 1e-10   /* part of a depth to which it is found */
#define SINGLE 1.2e-7 /* part that rounding to single precision takes */

/* Yield stresses of the materials: at an offset the number n of points, n plastic strains and n
   stresses. ``offset``: of both bodies of a pair, the own one first, -1 where one does not flow.
   ``strain``: plastic one of all cells, ``work``: that of dents over them; ``cell``: that beneath the
   point of a pair. What points keep of dents when pairs go: ``dent``, that in their own surface, for
   whoever comes next, and ``beyond``, that in the surface of the grain ``met``. ``point`` and
   ``partner``: of pairs, the latter none of walls, which do not yield. */
typedef struct {
  const double *tables;
  const int32_t *offset;
  const double *strain;
  double *work;
  const int32_t *cell, *point, *partner;
  double *dent, *beyond;
  int32_t *met;
} strength_type;

/* What a pair has to flow: its place, whether its point is a vertex, m of the law, mean edge,
   compliance of both layers, mean curvature of the gap, and area of the facet around the point over
   that of the reference, to which the stiffness belongs. */
typedef struct {
  int64_t pair;
  int is_tip;
  double m, edge, layers, bend, stretch;
} flowing_type;

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
  for (int i = 0; i < 50 && d > 0.0; i++) {
    const double change = (over - over_stiffness(d, m)) / slope_over_stiffness(d, m);
    d += change;
    if (fabs(change) <= 1e-3 * CLOSE * d) break;
  }
  return d;
}

/* Area of the facet around a point over that of the reference; of a vertex 1, since it carries no
   more once the facets around do. */
INLINE double stretch_of(const int32_t *corner, int is_tip, const double *x, double reference) {
  if (is_tip) return 1.0;
  const vec3 a = at(x, corner[0]), e1 = minus(at(x, corner[1]), a), e2 = minus(at(x, corner[2]), a);
  return 0.5 * length(cross(e1, e2)) / reference;
}

/* Largest dent, with the radius of its circle h/√2: what is wider is for the elements beneath. */
INLINE double largest_dent(flowing_type q) { return 0.25 * q.edge * q.edge * q.bend; }

/* Part of the area of a vertex in its tip: as deep as b, a part of the largest dent, it has grown as
   the square, by 4/3 at 2/3, where the centroids around touch. From there on facets carry. */
INLINE double tip(double b, double *slope) {
  *slope = b < 2.0 / 3.0 ? 6.0 * b : b < 1.0 ? -4.0 : 0.0;
  return b < 2.0 / 3.0 ? 3.0 * b * b : b < 1.0 ? 4.0 * (1.0 - b) : 0.0;
}

/* The body of a pair that yields: its yield stress, infinite where none does, the slope of that by
   the plastic strain, which the dent adds ``strain`` to, and the part of the dent in the own body. */
typedef struct {
  double Y, slope, strain, own_part;
} weaker_type;

/* The circle of the dent b has the radius a = √(2 R b), R = 1/bend. Bodies that are alike have half
   of it each, and the strain of the cell beneath in common; of others' cells nothing is known. */
static weaker_type weaker_body(const strength_type *of, flowing_type q, double b) {
  const int32_t *offset = of->offset + 2 * q.pair;
  const int alike = offset[0] == offset[1];
  const double strain = (alike ? 0.5 : 1.0) * TABOR * sqrt(2.0 * b * q.bend);
  weaker_type weaker = {INFINITY, 0.0, strain, 0.0};
  for (int side = 0; side < (alike ? 1 : 2); side++) {
    if (offset[side] < 0) continue;
    const double beneath = side == 0 ? of->strain[of->cell[q.pair]] : 0.0;
    double slope;
    const double Y = yield_stress_at(of->tables + offset[side], beneath + strain, &slope);
    if (Y < weaker.Y) weaker = (weaker_type){Y, slope, strain, alike ? 0.5 : side == 0};
  }
  return weaker;
}

/* What a pair bears with the dent b, as a force over stiffness. ``slope``: its derivative by b.
   Infinite where nothing flows. */
static double borne(const strength_type *of, flowing_type q, double b, double *slope) {
  const double most_dent = largest_dent(q);
  *slope = 0.0;
  if (!of->tables || !(most_dent > 0.0)) return INFINITY;
  const weaker_type weaker = weaker_body(of, q, b);
  if (!isfinite(weaker.Y)) return INFINITY;
  double part = 1.0, by_dent = 0.0;
  if (q.is_tip) part = tip(b / most_dent, &by_dent);
  const double scale = MEAN_PRESSURE * q.layers * q.stretch;
  if (b > 0.0)
    *slope = scale * (part * weaker.slope * weaker.strain / (2.0 * b) +
                      by_dent / most_dent * weaker.Y);
  return scale * part * weaker.Y;
}

/* Depth at which a pair flows with the dent b; the largest one flows no more. */
static double yield_depth(const strength_type *of, flowing_type q, double b) {
  double slope;
  if (!q.is_tip && b >= largest_dent(q)) return INFINITY;
  const double force = borne(of, q, b, &slope);
  return isfinite(force) ? depth_of(force, q.m) : INFINITY;
}

/* The dent that a pair finds where it closes, from those before it. */
INLINE double kept_dent(const strength_type *of, int64_t pair) {
  const int32_t i = of->point[pair];
  return of->dent[i] + (of->partner && of->met[i] == of->partner[pair] ? of->beyond[i] : 0.0);
}

/* Both bodies of a pair take their parts of what its dent deepens by. */
INLINE void keep_dent(const strength_type *of, int64_t pair, double own_part, double deeper) {
  const int32_t i = of->point[pair];
  of->dent[i] += own_part * deeper;
  if (own_part == 1.0) return;
  if (of->met[i] != of->partner[pair]) of->met[i] = of->partner[pair], of->beyond[i] = 0.0;
  of->beyond[i] += (1.0 - own_part) * deeper;
}

/* By how much the dent b of a pair deepens at a depth: until the law has, at the depth d that is
   left, what the pair bears with the dent b + depth - d. ``limit``: the yield depth, set anew. Newton's
   method from there, within bounds. A tip that bears less with more of a dent keeps its force.
   ``left``: part of the law's slope that is left meanwhile. */
static double flow(const strength_type *of, flowing_type q, double b, double depth, double *limit,
                   double *left) {
  double slope, low = (1.0 - SINGLE) * *limit, high = depth, d = low;
  if (over_stiffness(depth, q.m) <= borne(of, q, b, &slope)) {
    *limit = depth; /* the cell beneath has hardened */
    return 0.0;
  }
  double over = over_stiffness(low, q.m) - borne(of, q, b + depth - low, &slope);
  if (over >= 0.0) {
    *left = 0.0;
    *limit = yield_depth(of, q, b + depth - low);
  } else {
    double rise = slope_over_stiffness(low, q.m) + slope;
    for (int i = 0; i < 60; i++) {
      const double last = d, next = d - over / rise;
      d = low < next && next < high ? next : 0.5 * (low + high);
      over = over_stiffness(d, q.m) - borne(of, q, b + depth - d, &slope);
      rise = slope_over_stiffness(d, q.m) + slope;
      if (fabs(d - last) <= CLOSE * depth) break;
      *(over < 0.0 ? &low : &high) = d;
    }
    *left = most(slope, 0.0) / rise;
    *limit = d;
  }
  const double wider = largest_dent(q) - b;
  double deeper = depth - d;
  if (!q.is_tip && deeper >= wider) {
    *left = 1.0;
    *limit = INFINITY;
    deeper = wider;
  }
  keep_dent(of, q.pair, weaker_body(of, q, b).own_part, deeper);
  return deeper;
}

#endif
