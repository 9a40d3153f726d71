/* The law of a contact: the force of its normal spring, and Coulomb's friction with a static and a
   kinetic coefficient. kernels/contact_law.py has the same for edges and for tangents. */

#ifndef CONTACT_LAW_H
#define CONTACT_LAW_H

#include "lane_vectors.h"

/* Normal force over stiffness at a depth d: d, less what a contact smaller than an element yields
   more, A d² m²/(m + d/2)³. ``m`` is XI h²/R, of a flat contact 0. Beyond the largest depth it grows
   no more. Written once for one pair and for lanes of them. */
#define SOFTER 1.69
#define NOTHING 1e-300 /* keeps a flat contact of no depth from 0/0 */
#define XI 0.104
#define NORMAL_LAW(name, share, slope, real)                                       \
  INLINE real share(real d, real m) {                                              \
    const real u = m + 0.5 * d;                                                    \
    return 1.0 - SOFTER * m * m * d / (u * u * u + NOTHING);                       \
  }                                                                                \
  INLINE real name(real d, real m) { return d * share(d, m); }                     \
  /* The derivative of that share. */                                              \
  INLINE real slope(real d, real m) {                                              \
    const real u = m + 0.5 * d;                                                    \
    return SOFTER * m * m * (d - m) / (u * u * u * u + NOTHING);                   \
  }
NORMAL_LAW(over_stiffness, share_of_stiffness, slope_of_share, double)
INLINE double slope_over_stiffness(double d, double m) {
  const double u = m + 0.5 * d;
  return 1.0 - SOFTER * m * m * d * (2.0 * m - 0.5 * d) / (u * u * u * u + NOTHING);
}
NORMAL_LAW(over_stiffness_each, share_of_stiffness_each, slope_of_share_each, vec)
INLINE double normal_force(double stiffness, double m, double depth, double largest_depth) {
  return stiffness * over_stiffness(least(depth, largest_depth), m);
}
/* The energy of its spring, the integral of the force. */
INLINE double stored_energy(double stiffness, double m, double depth, double largest_depth) {
  const double d = least(depth, largest_depth), u = m > 0.0 ? 1.0 + 0.5 * d / m : 1.0;
  const double less = m * m * (8.0 * log(u) + 16.0 / u - 4.0 / (u * u) - 12.0);
  return stiffness * (0.5 * d * d - SOFTER * less) +
         normal_force(stiffness, m, d, largest_depth) * (depth - d);
}

/* Friction's spring softens with the depth as the normal one does, so its energy ½ kt u² lowers the
   normal force to N + ½ kt' u², with the derivative kt' of kt by the depth. Friction that slips is
   μ times that: T = μ (N + ½ kt' T²/kt²), where 2 μ² kt' N < kt², which all but μ > 1.2 fulfil. */
#define LIMIT(name, real, root, larger)                                                      \
  INLINE real name(real mu, real N, real kt, real slope) {                                   \
    const real square = 1.0 - 2.0 * mu * mu * slope * N / (kt * kt);                         \
    return 2.0 * mu * N / (1.0 + root(larger(square)));                                      \
  }
INLINE double not_negative(double a) { return a > 0.0 ? a : 0.0; }
INLINE vec not_negative_each(vec a) { return where(a > 0.0, a, all(0.0)); }
LIMIT(limit_of_friction, double, sqrt, not_negative)
LIMIT(limit_of_friction_each, vec, square_root, not_negative_each)

/* Coulomb's law, written once for one pair and for lanes of them: whether a spring slips, the part
   of it that is left, the distance that slipped and the energy of that.

   One that sticks slips where its force T exceeds the limit ``held`` of static friction, one that
   ``slid`` where it exceeds ``kinetic``; then it carries ``kinetic``. ``against``: the product of T
   and the friction of the last step, against the spring. The energy is the work of the mean
   friction of the step: exact for the trapezoidal rule. */
#define COULOMB(name, type, real, truth, choose, any)                                        \
  typedef struct {                                                                           \
    truth sliding;                                                                           \
    real left, slipped, lost;                                                                \
  } type;                                                                                    \
  INLINE type name(real T, real kt, truth slid, real held, real kinetic, real against) {     \
    const real none = {0.0}, whole = none + 1.0;                                             \
    const truth sliding = T > choose(slid, kinetic, held);                                   \
    if (!any(sliding)) return (type){sliding, whole, none, none};                            \
    const real over = choose(sliding, T, whole);                                             \
    const real slipped = choose(sliding, (T - kinetic) / kt, none);                          \
    return (type){sliding, choose(sliding, kinetic / over, whole), slipped,                  \
                  0.5 * (against / over + kinetic) * slipped};                               \
  }
INLINE double choose(int a, double b, double c) { return a ? b : c; }
COULOMB(coulomb, slip_type, double, int, choose, )
COULOMB(coulomb_each, slips_type, vec, mask, where, any)

/* Lay a spring, from the stick point to the point, across the normal n and let it slip. ``shear``:
   friction of the last step. */
INLINE slip_type slip(vec3 *spring, vec3 n, double kt, int slid, double held, double kinetic,
                      vec3 shear) {
  const vec3 s = across(*spring, n);
  const slip_type found =
      coulomb(kt * length(s), kt, slid, held, kinetic, -kt * dot(shear, s));
  *spring = times(found.left, s);
  return found;
}
INLINE slips_type slip_each(lanes3 *spring, lanes3 n, vec kt, mask slid, vec held, vec kinetic,
                            lanes3 shear) {
  const lanes3 s = moved_along(*spring, -product(*spring, n), n);
  const slips_type found = coulomb_each(kt * square_root(product(s, s)), kt, slid, held, kinetic,
                                        -kt * product(shear, s));
  *spring = scaled(found.left, s);
  return found;
}

/* Energy that friction takes where a contact opens: all of the spring slips, and it ends at none. */
INLINE double lost_at_opening(vec3 shear, vec3 spring) { return -0.5 * dot(shear, spring); }

#endif
