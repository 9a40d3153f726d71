/* The law of a contact: the force of its normal spring, and Coulomb's friction with a static and a
   kinetic coefficient. kernels/contact_law.py has the same for edges and for tangents. */

#ifndef CONTACT_LAW_H
#define CONTACT_LAW_H

#include "lane_vectors.h"

/* Normal force, which grows no more beyond the largest depth, and the energy of its spring. */
INLINE double normal_force(double stiffness, double depth, double largest_depth) {
  return stiffness * least(depth, largest_depth);
}
INLINE double stored_energy(double stiffness, double depth, double largest_depth) {
  const double within = least(depth, largest_depth);
  return stiffness * within * (depth - 0.5 * within);
}

/* Coulomb's friction of lanes. */
typedef struct {
  mask sliding;
  vec slipped, lost; /* distance and energy; zero where nothing slides */
} slip_type;

/* What slides of ``spring``, from the anchor to the point, which is laid across the normals n.
   A spring that holds slides beyond the limit ``held`` of static friction, one that slides beyond
   ``kinetic``; it is shortened to carry ``kinetic``. ``shear``: friction of the last step. */
INLINE slip_type slip(lanes3 *spring, lanes3 n, vec kt, mask was_sliding, vec held, vec kinetic,
                      lanes3 shear) {
  lanes3 s = moved_along(*spring, -product(*spring, n), n);
  const vec T = kt * square_root(product(s, s));
  const mask sliding = T > where(was_sliding, kinetic, held);
  const vec slipped = where(sliding, (T - kinetic) / kt, all(0.0));
  *spring = scaled(where(sliding, kinetic / T, all(1.0)), s);
  /* Work of the mean friction of the step: exact for the trapezoidal rule. It acts against s. */
  const vec before = -kt * product(shear, s) / where(sliding, T, all(1.0));
  return (slip_type){sliding, slipped, 0.5 * (before + kinetic) * slipped};
}

/* The same of one pair, in all lanes. */
INLINE slip_type slip_one(vec3 *spring, vec3 n, double kt, int was_sliding, double held,
                          double kinetic, vec3 shear) {
  lanes3 s = in_all(*spring);
  const slip_type found = slip(&s, in_all(n), all(kt), lanes_of(was_sliding ? ~0u : 0u), all(held),
                               all(kinetic), in_all(shear));
  *spring = (vec3){s.x[0], s.y[0], s.z[0]};
  return found;
}

/* Energy that friction takes where a contact opens: all of the spring slips, and it ends at none. */
INLINE double lost_at_opening(vec3 shear, vec3 spring) { return -0.5 * dot(shear, spring); }

#endif
