/* The law of a contact: its normal spring, Coulomb's friction with a static and a kinetic
   coefficient, and the dent of a body that yields. Written once, for WIDTH contacts (width.h): pairs
   of points with facets and with walls, and of edges, call it, and their tangents. */

#include "width.h"

/* --- normal spring: energy, force and slope --------------------------------------------

   Normal force over stiffness at a depth d: d, less what a contact smaller than an element yields
   more, A d² m²/(m + d/2)³. m is XI h²/R, of a flat contact 0. Beyond the largest depth it grows no
   more. */
INLINE real OF(share_of_stiffness)(real d, real m) {
  const real u = m + 0.5 * d;
  return 1.0 - SOFTER * m * m * d / (u * u * u + NOTHING);
}
INLINE real OF(over_stiffness)(real d, real m) { return d * OF(share_of_stiffness)(d, m); }
/* Their derivatives by the depth. */
INLINE real OF(slope_of_share)(real d, real m) {
  const real u = m + 0.5 * d;
  return SOFTER * m * m * (d - m) / (u * u * u * u + NOTHING);
}
INLINE real OF(slope_over_stiffness)(real d, real m) {
  const real u = m + 0.5 * d;
  return 1.0 - SOFTER * m * m * d * (2.0 * m - 0.5 * d) / (u * u * u * u + NOTHING);
}
INLINE real OF(normal_force)(real stiffness, real m, real depth, real largest_depth) {
  const real d = OF(least)(depth, largest_depth);
  return stiffness * OF(share_of_stiffness)(d, m) * d;
}
/* The integral of the force. */
INLINE real OF(stored_energy)(real stiffness, real m, real depth, real largest_depth) {
  const real d = OF(least)(depth, largest_depth);
  const real u = OF(where)(m > 0.0, 1.0 + 0.5 * d / (m + NOTHING), OF(number)(1.0));
  real less = m * m;
  for (int i = 0; i < WIDTH; i++)
    LANE(less, i) *=
        8.0 * log(LANE(u, i)) + 16.0 / LANE(u, i) - 4.0 / (LANE(u, i) * LANE(u, i)) - 12.0;
  return stiffness * (0.5 * d * d - SOFTER * less) +
         OF(normal_force)(stiffness, m, d, largest_depth) * (depth - d);
}

/* --- what a closed contact is ----------------------------------------------------------- */

typedef struct {
  real stiffness, softer, largest_depth, ratio; /* ratio: tangential over normal stiffness */
} OF(spring_type);

/* Stiffness of friction's spring: as much of the layer's as of the normal one's is there. */
INLINE real OF(tangential_stiffness)(OF(spring_type) s, real depth) {
  const real d = OF(least)(depth, s.largest_depth);
  return s.stiffness * OF(share_of_stiffness)(d, s.softer) * s.ratio;
}
/* Its derivative by the depth. */
INLINE real OF(tangential_slope)(OF(spring_type) s, real depth) {
  const real slope = s.stiffness * s.ratio * OF(slope_of_share)(depth, s.softer);
  return OF(where)(depth < s.largest_depth, slope, OF(number)(0.0));
}
/* The force along the depth, of both springs: the derivative of their energy. */
INLINE real OF(force_along_depth)(OF(spring_type) s, real depth, real square_of_spring) {
  return OF(normal_force)(s.stiffness, s.softer, depth, s.largest_depth) +
         0.5 * OF(tangential_slope)(s, depth) * square_of_spring;
}
/* Energy of both springs of a closed contact that carries the friction ``shear``. */
INLINE real OF(energy_of)(OF(spring_type) s, real depth, OF(vec3) shear) {
  const real T2 = OF(dot)(shear, shear), kt = OF(tangential_stiffness)(s, depth);
  return OF(stored_energy)(s.stiffness, s.softer, depth, s.largest_depth) +
         OF(where)(T2 > 0.0, T2 / (2.0 * kt), OF(number)(0.0));
}

/* --- friction ----------------------------------------------------------------------------

   Friction's spring softens with the depth as the normal one does, so its energy ½ kt u² lowers the
   normal force to N + ½ kt' u², with the derivative kt' of kt by the depth. Friction that slips is
   μ times that: T = μ (N + ½ kt' T²/kt²), where 2 μ² kt' N < kt², which all but μ > 1.2 fulfil. */
INLINE real OF(limit_of_friction)(real mu, real N, real kt, real slope) {
  const real square = 1.0 - 2.0 * mu * mu * slope * N / (kt * kt);
  return 2.0 * mu * N / (1.0 + OF(root)(OF(most)(square, OF(number)(0.0))));
}

/* What a contact brings to a step. ``steep``: how much faster than a point along the normal of the
   smooth surface its gap grows. ``normal``: friction lies across it. ``spring``: from the stick
   point to the point. ``shear``: friction of the last step, ``was``: depth then, 0 of an open one. */
typedef struct {
  OF(spring_type) of;
  real depth, steep;
  OF(vec3) normal, spring, shear;
  truth slid;
  real held, kinetic; /* coefficients of friction */
} OF(contact_type);

/* What it carries, and what the step took: the distance that slipped and the energy of that. */
typedef struct {
  real N;
  OF(vec3) spring, shear;
  truth sliding;
  real slipped, lost;
} OF(carried_type);

/* Coulomb's law: whether a spring slips, and the part of it that is ``left``. One that sticks slips
   where its force exceeds the limit of static friction, one that ``slid`` where it exceeds the
   kinetic one; then it carries that. ``is_known``: it slips where it slid, whatever its force. */
INLINE truth OF(coulomb_as)(real force, real held, real kinetic, truth slid, truth is_known,
                            real *left) {
  const real whole = OF(number)(1.0);
  const truth exceeds = force > OF(where)(slid, kinetic, held);
  const truth slips = (is_known & slid) | (OF(no)(is_known) & exceeds);
  *left = whole;
  if (OF(any)(slips)) *left = OF(where)(slips, kinetic / OF(where)(slips, force, whole), whole);
  return slips;
}
INLINE truth OF(coulomb)(real force, real held, real kinetic, truth slid, real *left) {
  return OF(coulomb_as)(force, held, kinetic, slid, (truth){0}, left);
}

/* The energy that slip takes is the work of the mean friction of the step: exact for the trapezoidal
   rule. */
INLINE OF(carried_type) OF(carry_as)(OF(contact_type) c, truth is_known) {
  const real none = OF(number)(0.0);
  const real kt = OF(tangential_stiffness)(c.of, c.depth);
  const real kt_slope = c.steep * OF(tangential_slope)(c.of, c.depth);
  OF(carried_type) now;
  now.N = c.steep * OF(normal_force)(c.of.stiffness, c.of.softer, c.depth, c.of.largest_depth);
  now.spring = OF(across)(c.spring, c.normal);
  const real T = kt * OF(length)(now.spring);
  const real held = OF(limit_of_friction)(c.held, now.N, kt, kt_slope);
  const real kinetic = OF(limit_of_friction)(c.kinetic, now.N, kt, kt_slope);
  real left;
  now.sliding = OF(coulomb_as)(T, held, kinetic, c.slid, is_known, &left);
  now.slipped = now.lost = none;
  if (OF(any)(now.sliding)) {
    const real over = OF(where)(now.sliding, T, OF(number)(1.0));
    const real against = -kt * OF(dot)(c.shear, now.spring);
    now.slipped = OF(where)(now.sliding, (T - kinetic) / kt, none);
    now.lost = 0.5 * (against / over + kinetic) * now.slipped;
    now.spring = OF(times)(left, now.spring);
  }
  now.shear = OF(times)(-kt, now.spring);
  now.N += 0.5 * kt_slope * OF(dot)(now.spring, now.spring);
  return now;
}
INLINE OF(carried_type) OF(carry)(OF(contact_type) c) { return OF(carry_as)(c, (truth){0}); }

/* Energy that friction takes where a contact opens: all of the spring slips, and it ends at none. */
INLINE real OF(lost_at_opening)(OF(vec3) shear, OF(vec3) spring) {
  return -0.5 * OF(dot)(shear, spring);
}

/* What contacts without friction carry: all of the spring slips. */
INLINE OF(carried_type) OF(carry_smooth)(OF(contact_type) c) {
  const real none = OF(number)(0.0);
  const OF(vec3) slip = OF(across)(c.spring, c.normal);
  OF(carried_type) now;
  now.N = c.steep * OF(normal_force)(c.of.stiffness, c.of.softer, c.depth, c.of.largest_depth);
  now.spring = now.shear = (OF(vec3)){none, none, none};
  now.slipped = OF(length)(slip);
  now.sliding = now.slipped > 0.0;
  now.lost = OF(lost_at_opening)(c.shear, slip);
  return now;
}

/* --- dents -------------------------------------------------------------------------------

   A body that yields under a contact smaller than an element: the pair bears 2.8 times the yield
   stress at the strain of its dent, and deepens the dent by what the law would carry beyond. */

/* The line of a hardening table that a plastic strain is on: where it begins and ends, the yield
   stress at its beginning, and its slope. Without a table the stress is infinite. */
typedef struct {
  const double *table[WIDTH];
  real begin, end, Y, slope;
} OF(line_type);
INLINE OF(line_type) OF(no_line)(void) {
  return (OF(line_type)){{0}, OF(number)(0.0), OF(number)(0.0), OF(number)(0.0), OF(number)(0.0)};
}

/* Yield stress at a plastic strain, constant beyond the table, and its slope. */
INLINE real OF(yield_stress)(OF(line_type) * line, real strain, real *slope) {
  if (OF(any)((strain < line->begin) | (strain >= line->end)))
    for (int i = 0; i < WIDTH; i++) {
      const double *table = line->table[i];
      const int32_t last = table ? (int32_t)table[0] - 1 : 0;
      const double *strains = table + 1, *stresses = strains + last + 1;
      int32_t k = 0;
      while (k < last && LANE(strain, i) >= strains[k + 1]) k++;
      LANE(line->begin, i) = table ? strains[k] : 0.0;
      LANE(line->Y, i) = table ? stresses[k] : INFINITY;
      LANE(line->end, i) = k < last ? strains[k + 1] : INFINITY;
      LANE(line->slope, i) =
          k < last ? (stresses[k + 1] - stresses[k]) / (strains[k + 1] - strains[k]) : 0.0;
    }
  *slope = line->slope;
  return line->Y + line->slope * (strain - line->begin);
}

/* What a pair has to flow: m of the law, compliance of both layers times the stretch of the area
   around the point, to which the stiffness belongs, mean curvature of the gap, the largest dent, and
   the yield stresses of the own body, at the plastic strain ``beneath``, and of the other. */
typedef struct {
  truth is_tip, alike; /* whether the point is a vertex; whether both have one table */
  real m, layers, bend, largest, beneath;
  OF(line_type) own, other;
} OF(flowing_type);

/* Part of the area of a vertex in its tip: as deep as b, a part of the largest dent, it has grown as
   the square, by 4/3 at 2/3, where the centroids around touch. From there on facets carry. */
INLINE real OF(tip)(real b, real *slope) {
  const real none = OF(number)(0.0);
  const truth grows = b < 2.0 / 3.0, fades = b < 1.0;
  *slope = OF(where)(grows, 6.0 * b, OF(where)(fades, OF(number)(-4.0), none));
  return OF(where)(grows, 3.0 * b * b, OF(where)(fades, 4.0 * (1.0 - b), none));
}

/* What a pair bears with the dent b, as a force over stiffness, infinite where nothing flows: that of
   the weaker body. The circle of the dent has the radius a = √(2 R b), R = 1/bend. Bodies that are
   alike have half of it each, and the strain of the cell beneath in common; of others' cells nothing
   is known. ``slope``: its derivative by b. ``own_part``: of a dent in the own body. */
INLINE real OF(borne)(OF(flowing_type) * q, real b, real *slope, real *own_part) {
  const real none = OF(number)(0.0), whole = OF(number)(1.0), half = OF(number)(0.5);
  const real strain = OF(where)(q->alike, half, whole) * (TABOR * OF(root)(2.0 * b * q->bend));
  real by_strain, by_strain_of_other;
  const real own = OF(yield_stress)(&q->own, q->beneath + strain, &by_strain);
  const real other = OF(yield_stress)(&q->other, strain, &by_strain_of_other);
  const truth is_own = own <= other,
              flows = (q->largest > 0.0) & ((own < INFINITY) | (other < INFINITY));
  const real Y = OF(where)(is_own, own, other);
  *own_part = OF(where)(q->alike, half, OF(where)(is_own, whole, none));
  const real scale = MEAN_PRESSURE * q->layers;
  *slope = scale * OF(where)(is_own, by_strain, by_strain_of_other) * strain / (2.0 * b);
  real part = whole;
  if (OF(any)(q->is_tip)) {
    real by_dent;
    part = OF(where)(q->is_tip, OF(tip)(b / q->largest, &by_dent), whole);
    *slope = part * *slope + OF(where)(q->is_tip, scale * by_dent / q->largest * Y, none);
  }
  *slope = OF(where)(flows & (b > 0.0), *slope, none);
  return OF(where)(flows, scale * part * Y, OF(number)(INFINITY));
}

/* The depth at which the law has a force over stiffness: Newton's method. */
INLINE real OF(depth_of)(real force, real m) {
  real d = force;
  truth going = d > 0.0;
  for (int i = 0; i < 50 && OF(any)(going); i++) {
    const real change = (force - OF(over_stiffness)(d, m)) / OF(slope_over_stiffness)(d, m);
    d = OF(where)(going, d + change, d);
    going = going & (OF(size)(change) > 1e-3 * CLOSE * d) & (d > 0.0);
  }
  return d;
}

/* Depth at which a pair flows with the dent b; the largest one flows no more. */
INLINE real OF(yield_depth)(OF(flowing_type) * q, real b) {
  real slope, part;
  const real force = OF(borne)(q, b, &slope, &part);
  const truth flows = (force < INFINITY) & (q->is_tip | (b < q->largest));
  const real depth = OF(depth_of)(OF(where)(flows, force, OF(number)(0.0)), q->m);
  return OF(where)(flows, depth, OF(number)(INFINITY));
}

/* By how much the dents b of those that flow deepen at a depth: until the law has, at the depth d
   that is left, what the pair bears with the dent b + depth - d. Newton's method from the yield depth
   of before, within bounds. A tip that bears less with more of a dent keeps its force. ``limit``: the
   yield depth, set anew. ``left``: part of the law's slope that is left meanwhile. ``own_part``: of
   the dent. */
INLINE real OF(flow)(OF(flowing_type) * q, truth flows, real b, real depth, real *limit, real *left,
                     real *own_part) {
  const real none = OF(number)(0.0);
  real slope, part, low = (1.0 - 2.0 * ROUNDING) * *limit, high = depth, d = low;
  /* Else the cell beneath has hardened. */
  const truth deepens =
      flows & (OF(over_stiffness)(depth, q->m) > OF(borne)(q, b, &slope, own_part));
  real over = OF(over_stiffness)(low, q->m) - OF(borne)(q, b + depth - low, &slope, &part);
  const truth at_once = deepens & (over >= 0.0), steps = deepens & (over < 0.0);
  truth going = steps;
  for (int i = 0; i < 60 && OF(any)(going); i++) {
    const real next = d - over / (OF(slope_over_stiffness)(d, q->m) + slope), last = d;
    const real now = OF(where)((low < next) & (next < high), next, 0.5 * (low + high));
    d = OF(where)(going, now, d);
    over = OF(over_stiffness)(d, q->m) - OF(borne)(q, b + depth - d, &slope, &part);
    going = going & (OF(size)(d - last) > LAST * depth);
    low = OF(where)(going & (over < 0.0), d, low);
    high = OF(where)(going & (over >= 0.0), d, high);
  }
  slope = OF(most)(slope, none);
  *left = OF(where)(steps, slope / (OF(slope_over_stiffness)(d, q->m) + slope), *left);
  *left = OF(where)(at_once, none, *left);
  *limit = OF(where)(steps, d, *limit);
  const truth others = flows & OF(no)(steps);
  if (OF(any)(others)) {
    const real dent = OF(where)(at_once, b + depth - low, b);
    *limit = OF(where)(others, OF(yield_depth)(q, dent), *limit);
  }
  const real deeper = depth - d, wider = q->largest - b;
  const truth ends = deepens & OF(no)(q->is_tip) & (deeper >= wider);
  *limit = OF(where)(ends, OF(number)(INFINITY), *limit);
  *left = OF(where)(ends, OF(number)(1.0), *left);
  return OF(where)(deepens, OF(where)(ends, wider, deeper), none);
}

/* What it took to deepen a dent: the mean of the force along the depth before, at a friction
   ``shear``, and now, at a spring. ``was``: depth before, none of a contact that was open. */
INLINE real OF(work_of_dent)(OF(spring_type) s, real was, OF(vec3) shear, real depth,
                             OF(vec3) spring, real deeper) {
  const real kt = OF(tangential_stiffness)(s, was), T2 = OF(dot)(shear, shear);
  const real before = OF(force_along_depth)(s, was, T2 / (kt * kt));
  const real now = OF(force_along_depth)(s, depth, OF(dot)(spring, spring));
  return 0.5 * (OF(where)(was > 0.0, before, OF(number)(0.0)) + now) * deeper;
}
