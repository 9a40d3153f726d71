/* Work of Coulomb's friction. */

#ifndef FRICTION_H
#define FRICTION_H

#include "vectors.h"

/* Energy that friction takes in a step: ``both`` is the sum of its forces at the start and at the
   end of the step, ``slipped`` the way by which the spring yields, all of it where a contact opens.
   Exact for the trapezoidal rule. */
INLINE double lost_in_slip(vec3 both, vec3 slipped) { return -0.5 * dot(both, slipped); }

#endif
