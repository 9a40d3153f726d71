/* Contact of points with rigid planes, cylinders and spheres: what is known of a pair. */

#ifndef WALLS_H
#define WALLS_H

#include "contact_law.h"

#define RULE_BITS 4 /* of the rule of a point, above the number of its wall */
#define TINY 1e-300 /* keeps what divides by a length from dividing by none */

INLINE int wall_of(const wall_pair_row *s) { return s->wall >> RULE_BITS; }
INLINE int rule_of(const wall_pair_row *s) { return s->wall & ((1 << RULE_BITS) - 1); }
INLINE spring_type spring_of_wall(const wall_pair_row *s) {
  return (spring_type){s->stiffness, s->softer, INFINITY, s->ratio};
}

/* Gap of a point r from ``point`` of a wall, and the normal there, which points into the sample.
   ``axis``: normal of a plane, axis of a cylinder, zero for a sphere; R: 0 of a plane, negative where
   the sample is outside. */
INLINE double gap_to(vec3 axis, double R, vec3 r, vec3 *normal) {
  const double along_axis = dot(r, axis);
  *normal = axis;
  if (R == 0.0) return along_axis;
  const vec3 away = along(r, -along_axis, axis);
  const double distance = sqrt(dot(away, away)), side = R > 0.0 ? 1.0 : -1.0;
  *normal = times(-side / most(distance, TINY), away);
  return R - side * distance;
}

#endif
