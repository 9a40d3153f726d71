/* The law of a point of an opened facet: cohesion that softens and never heals (Camacho & Ortiz 1996),
   from the traction on that was there. What goes with it is told in docs/method/fracture.md.

   Openings w are those since the facet opened, and in them the stretch of a spring of stiffness k that
   bears the first traction. In effect they measure d = √(⟨w_n⟩² + β² w_t²). With the largest d so far,
   D, an open point bears T(D)/D w_n and β² T(D)/D w_t, where T falls from the strength σ at d₀ = σ/k to
   nothing at d₀ + δc. A pressed one bears k w_n, and in shear friction as well: a spring of stiffness k
   that slips at μ k |w_n|. Of the first shear it takes all it can bear. */

#include <math.h>

/* Part of the stiffness that is lost from which on all of the damper acts. */
#define MUCH_SOFTER 0.2

/* What a point keeps; kernels/cracks/cracks.py names it, in this order. Per area of the facet. */
typedef struct {
  double open;      /* 1 from the parting of its node on, 0 before */
  double start[3];  /* stretch of the spring when it opened: along the normal and across [m] */
  double strength;  /* σ: effective traction from which on it softens [Pa] */
  double ultimate;  /* δc: opening from there on to failure [m] */
  double stiffness; /* k [Pa/m] */
  double furthest;  /* D [m] */
  double anchor[2]; /* where the spring of friction is at rest [m] */
  double pull[2];   /* stretch of that spring after the last step [m] */
  double held;      /* that when the point opened [m] */
  double damper;    /* viscosity of what has softened [Pa s/m] */
  double drag[3];   /* what that bore in the last step [Pa] */
  double rubbed;    /* work of friction [J/m²] */
  double damped;    /* work of the damper [J/m²] */
} point_type;

typedef struct {
  double shear; /* β */
} law_type;

static inline double square(double a) { return a * a; }
static inline double positive(double a) { return a > 0.0 ? a : 0.0; }

static inline double first_opening(const point_type *p) { return p->strength / p->stiffness; }

/* Opening beyond that at which the point softens. */
static inline double softened(const point_type *p) { return p->furthest - first_opening(p); }
static inline int has_failed(const point_type *p) { return softened(p) >= p->ultimate; }

/* d of an opening. */
static inline double effective(law_type law, const double w[3]) {
  return sqrt(square(positive(w[0])) + square(law.shear) * (square(w[1]) + square(w[2])));
}

/* T(D)/D. */
static inline double secant(const point_type *p) {
  if (has_failed(p)) return 0.0;
  return p->strength * (1.0 - softened(p) / p->ultimate) / p->furthest;
}

/* Viscosity at an opening [Pa s/m]. A point that has softened and opens no further is damped: the kink
   at w_n = 0, where its stiffness changes, lets explicit steps gain energy. Where little of the
   stiffness is lost little is enough. Where the point softens, nothing slows it. */
static inline double viscosity(const point_type *p, law_type law, const double w[3]) {
  if (has_failed(p) || effective(law, w) >= p->furthest) return 0.0;
  return p->damper * fmin((1.0 - secant(p) / p->stiffness) / MUCH_SOFTER, 1.0);
}

/* Traction t [Pa] at an opening w; what the point keeps follows. ``friction``: μ. */
static inline void bear(double t[3], point_type *p, law_type law, double friction,
                        const double w[3]) {
  if (!has_failed(p)) p->furthest = fmax(p->furthest, effective(law, w));
  const double s = secant(p), k = p->stiffness, across = square(law.shear) * s;
  const double e[2] = {w[1] - p->anchor[0], w[2] - p->anchor[1]};
  const double stretch = sqrt(square(e[0]) + square(e[1])), most = friction * positive(-w[0]);
  const double kept = stretch > most ? most / stretch : 1.0;
  t[0] = (w[0] > 0.0 ? s : k) * w[0];
  for (int j = 0; j < 2; j++) {
    const double pull = kept * e[j];
    /* The mean force of the step times the slip: what makes the spring's energy its work. */
    p->rubbed += 0.5 * k * (p->pull[j] + pull) * (e[j] - pull);
    t[1 + j] = across * w[1 + j] + k * pull;
    p->anchor[j] = w[1 + j] - pull;
    p->pull[j] = pull;
  }
}

/* Begin to bear a traction t [Pa]. Friction takes what it can of a pressed point's shear, cohesion the
   rest; what is more than the strength softens from there on, with the same energy. */
static inline void begin(point_type *p, law_type law, double friction, const double t[3]) {
  const double shear = sqrt(square(t[1]) + square(t[2])), most = friction * positive(-t[0]);
  const double share = shear > most ? most / shear : 1.0, k = p->stiffness;
  p->start[0] = t[0] / k;
  for (int j = 0; j < 2; j++) {
    p->pull[j] = share * t[1 + j] / k;
    p->start[1 + j] = (1.0 - share) * t[1 + j] / (square(law.shear) * k);
    p->anchor[j] = p->start[1 + j] - p->pull[j];
  }
  p->held = share * shear / k;
  const double now = effective(law, p->start) * k;
  if (now > p->strength) {
    p->ultimate *= p->strength / now;
    p->strength = now;
  }
  p->furthest = first_opening(p);
  p->open = 1.0;
}

/* Energies [J/m²]: in the springs at an opening; less that with which they began, of what is not softened
   since; and lost in softening. Together they are the work of the traction since the point opened,
   friction's losses left out. Neither the first nor the last is ever negative, nor does that fall. */
static inline double in_springs(const point_type *p, law_type law, const double w[3],
                                double pulled) {
  const double k = p->stiffness;
  return 0.5 * (secant(p) * square(effective(law, w)) + k * (square(positive(-w[0])) + pulled));
}
static inline double stored(const point_type *p, law_type law, const double w[3]) {
  return in_springs(p, law, w, square(p->pull[0]) + square(p->pull[1]));
}
static inline double begun(const point_type *p, law_type law) {
  return -in_springs(p, law, p->start, square(p->held));
}
static inline double fractured(const point_type *p, law_type law) {
  const double a = fmin(softened(p), p->ultimate), s = secant(p), d0 = first_opening(p);
  const double area = p->strength * a * (1.0 - 0.5 * a / p->ultimate), k = p->stiffness;
  const double unspent = has_failed(p) ? 0.0 : s * square(p->furthest);
  return area + 0.5 * (k * square(d0) - unspent - (k - s) * square(effective(law, p->start)));
}
