/* Contact of sharp edges that cross: how they close, slide, move on and open. The law and all arrays
   are described in kernels/contact/edges.py. */

#include "crossing.h"

/* Crossings deeper than this part of the mean edge are none. The vertices of right-angled edges that
   cross at their middles are inside from a half on, and nodes and facets hold those. */
#define DEEPEST 0.6
/* Angle by which an open crossing may seem outside its facets by rounding [rad]. */
#define APART 1e-3
/* A crossing takes over from one that fades out: both parts add up to one, and to no more than this
   on uneven edges. Else it came in from the side, beside one that stays. */
#define BOTH_PARTS 1.3
/* How far from its end, in parts of its edge, one may be that takes over and pierces no facet. */
#define ARRIVING END
/* How far ``outside`` a crossing is whose edges or facets end before they meet. */
#define UNPIERCED 2.0
/* Crossings up to this part of their edges, or this angle [rad], outside can carry soon. */
#define BEYOND 0.1

/* In the order of kernels/contact/edges.py. */
typedef struct {
  edge_pair_row *row;
  double *next_check;
  int32_t *scratch; /* the pairs that are due, then those of them that leave */
  const double *x;
  double *f;
  const double *friction; /* static and kinetic of pairs of materials */
  edges_type edges;
} edge_pairs_type;

/* What a step finds. */
typedef struct {
  double dissipated, switched, num_accepted, deepest;
} found_type;

INLINE place_type two_of(const double *a) { return (place_type){a[0], a[1]}; }
INLINE void set_two(double *out, place_type a) { out[0] = a.s, out[1] = a.t; }
INLINE double depth_now(const edge_pair_row *s) { return s->offset - s->gap - s->recess; }
INLINE spring_type spring_of(const edge_pair_row *s) {
  return (spring_type){s->stiffness, 0.0, s->largest_depth, s->ratio};
}
INLINE two_edges edges_of(const edge_pairs_type *m, const edge_pair_row *s) {
  return both_edges(m->x, m->edges.ends + 2 * s->first, m->edges.ends + 2 * s->second);
}
INLINE series_type stiffness_now(const edge_pairs_type *m, const edge_pair_row *s) {
  return crossing_stiffness(&m->edges, s->first, s->second, two_of(s->place));
}
/* Energy of the normal spring at a depth, of a part of its stiffness. */
INLINE double energy_over(const edge_pair_row *s, double stiffness, double depth) {
  return stored_energy(stiffness, 0.0, depth, s->largest_depth);
}

/* Find the crossing of a pair, and when to look at it again; what it accepts. */
static void look(const edge_pairs_type *m, found_type *found, int64_t p, double bound,
                 int64_t accept) {
  const edges_type *e = &m->edges;
  edge_pair_row *s = m->row + p;
  double *next_check = m->next_check + p;
  const int32_t i = s->first, j = s->second;
  const int was_open = s->outside <= 0.0, was_inside = was_open && s->gap < 0.0;
  const crossing_type now = crossing(m->x, e, i, j);
  s->outside = now.outside;
  if (now.gap < INFINITY) { /* not parallel */
    /* What the stiffness changes by along even edges is a work of the forces. */
    if (s->closed)
      s->stiffness = in_series(at_place(e, i, j, two_of(s->place)), now.place, e->compliance[i],
                               e->compliance[j])
                         .stiffness;
    s->gap = now.gap, s->normal = now.normal;
    set_two(s->place, now.place);
  }
  if (s->closed) {
    *next_check = bound;
    return;
  }
  const double g = now.gap, begins = g + s->recess;
  if (s->outside <= 0.0 && g < 0.0 && !(was_open && now.turned <= APART) &&
      (g <= -DEEPEST * s->size || !pierce(m->x, e, i, j)))
    s->outside = UNPIERCED;
  /* What overlapped at the start: the offset of a pair that moves out follows it. */
  if (s->offset < 0.0) s->offset = least(most(s->offset, begins), 0.0);
  if (accept && s->outside <= 0.0 && begins < s->offset) {
    found->num_accepted += 1.0;
    found->deepest = most(found->deepest, -g);
    s->offset = begins;
  }
  /* What is deeper than it can have moved since it was last open came in from the side. */
  const int deep = -g > bound - *next_check + 1e-9 * s->size;
  if (s->outside <= 0.0 && deep && !was_inside && !accept) s->offset = least(s->offset, begins);
  if (s->outside > 0.0) {
    /* An edge can come in from the side, below the other one, or begin to pierce a facet. */
    const double way = s->outside == UNPIERCED ? 0.0 : 0.25 * least(s->outside, 1.0) * now.across;
    *next_check = bound + most(distance_of(m->x, e, i, j) - DEEPEST * s->size, way);
  } else {
    *next_check = bound + most(g, 0.0);
  }
}

/* Whether two edges are the same, or one goes on as the other. */
INLINE int goes_on(const edges_type *e, int64_t i, int64_t j) {
  for (int m = 0; m < 2; m++)
    for (int n = 0; n < 2; n++)
      if (e->ends[2 * i + m] == e->ends[2 * j + n] && e->share[2 * i + m] == 1.0) return 1;
  return i == j;
}

/* Part of a crossing that has not faded out. */
INLINE double part_of(const edge_pairs_type *m, const edge_pair_row *s) {
  return at_place(&m->edges, s->first, s->second, two_of(s->place)).fade;
}

/* List the closed crossings that are due and fade out, or have left; how many. */
static int64_t list_leaving(const edge_pairs_type *m, int64_t num_due) {
  int64_t count = 0;
  for (int64_t k = 0; k < num_due; k++) {
    const edge_pair_row *q = m->row + m->scratch[k];
    m->scratch[num_due + count] = m->scratch[k];
    count += q->closed && (q->outside > 0.0 || part_of(m, q) < 1.0);
  }
  return count;
}

/* The deepest of those that are ``leaving`` where that of s goes on; NULL if none. Both edges of s are
   its edges, or go on from these. */
static const edge_pair_row *left_to(const edge_pairs_type *m, const int32_t *leaving,
                                    int64_t num_leaving, const edge_pair_row *s) {
  const edge_pair_row *best = NULL;
  const double fade = part_of(m, s);
  for (int64_t k = 0; k < num_leaving; k++) {
    const edge_pair_row *q = m->row + leaving[k];
    if ((!best || q->gap < best->gap) && goes_on(&m->edges, q->first, s->first) &&
        goes_on(&m->edges, q->second, s->second) &&
        (q->outside > 0.0 || fade + part_of(m, q) <= BOTH_PARTS))
      best = q;
  }
  return best;
}

/* The spring of the pair q as one of the pair s: it keeps its length and turns. */
INLINE place_type turned_spring(const edge_pairs_type *m, const edge_pair_row *q,
                                const edge_pair_row *s) {
  const place_type by = {q->stick_point[0] - q->place[0], q->stick_point[1] - q->place[1]};
  const vec3 d = between(edges_of(m, q), by);
  const double along_normal = dot(d, s->normal), d2 = dot(d, d);
  const double now2 = d2 - along_normal * along_normal;
  const vec3 now = times(now2 > 0.0 ? sqrt(d2 / now2) : 0.0, d);
  const two_edges both = edges_of(m, s);
  return parts_along(both, dot(now, both.u), dot(now, both.v));
}

/* A crossing that takes over from one that fades out begins as deep, and has its stick points. */
static void begin(const edge_pairs_type *m, found_type *found, int64_t p, const int32_t *leaving,
                  int64_t num_leaving, double bound) {
  edge_pair_row *s = m->row + p;
  if (m->next_check[p] > bound || s->closed || -s->gap <= s->recess) return;
  const place_type here = two_of(s->place);
  const double inside = least(least(here.s, 1.0 - here.s), least(here.t, 1.0 - here.t));
  if (s->outside > 0.0 && (s->outside != UNPIERCED || inside > ARRIVING)) return;
  set_two(s->stick_point, here);
  s->sliding = 0;
  const edge_pair_row *q = left_to(m, leaving, num_leaving, s);
  if (!q) return;
  /* Near a corner of facets, edges need not pierce those beside them. */
  s->outside = least(s->outside, 0.0), s->offset = q->offset, m->next_check[p] = bound;
  found->switched -= energy_over(s, stiffness_now(m, s).stiffness, most(depth_now(s), 0.0));
  const place_type by = turned_spring(m, q, s);
  set_two(s->stick_point, (place_type){here.s + by.s, here.t + by.t});
  s->sliding = q->sliding;
}

/* What friction loses goes to the pair's account too. */
INLINE void lose(found_type *found, edge_pair_row *s, double lost) {
  found->dissipated += lost;
  s->work += lost;
}

/* A pair opens, upwards or sideways. ``spring``: of friction; ``half``: its energy over stiffness.
   Sideways its springs lose what they stored, less the work of half of the last force in this step:
   the mean of then and of what they would store here. */
static void open_pair(const edge_pairs_type *m, found_type *found, int64_t p, vec3 spring,
                      double half, double bound) {
  edge_pair_row *s = m->row + p;
  const double depth = depth_now(s);
  if (depth <= 0.0)
    lose(found, s, lost_at_opening(s->shear, spring));
  else
    found->switched +=
        0.5 * (s->stored + energy_over(s, s->stiffness, depth) + s->stiffness * half);
  s->closed = 0;
  s->shear = (vec3){0.0, 0.0, 0.0};
  m->next_check[p] = bound + (s->outside <= 0.0 ? most(s->gap, 0.0) : 0.0);
}

/* Friction, then what the pair carries; or it opens. */
static void add_one(const edge_pairs_type *m, found_type *found, int64_t p, double bound) {
  edge_pair_row *s = m->row + p;
  if (m->next_check[p] > bound || !(s->closed || s->outside <= 0.0)) return;
  const place_type at = two_of(s->place);
  const two_edges both = edges_of(m, s);
  const double depth = depth_now(s), carried = s->stiffness;
  place_type by = {s->stick_point[0] - at.s, s->stick_point[1] - at.t};
  vec3 spring = between(both, by);
  const double trial = length(spring);
  /* As long as friction holds it, whatever the stiffness; its energy over that. */
  const double held = most(least(depth, s->largest_depth), 0.0) / s->ratio;
  const double *mu = m->friction + 2 * (int64_t)s->friction;
  double keep;
  s->sliding = coulomb(trial, mu[0] * held, mu[1] * held, s->sliding, &keep);
  const double now = keep * trial, half = 0.5 * s->ratio * (now * now);
  if (s->outside > 0.0 || depth <= 0.0) {
    if (s->closed) open_pair(m, found, p, spring, half, bound);
    s->sliding = 0;
    return;
  }
  const series_type k = stiffness_now(m, s);
  const double kn = k.stiffness, kt = kn * s->ratio;
  if (s->closed) {
    found->switched += energy_over(s, carried - kn, depth);
    found->switched += (carried - kn) * half;
  } else {
    found->switched -= kn * half;
    s->closed = 1;
  }
  s->stiffness = kn;
  m->next_check[p] = bound;
  if (s->sliding) {
    /* The work of the mean friction of the step on what slips. */
    const double against = kt * keep * dot(spring, spring) - dot(s->shear, spring);
    lose(found, s, 0.5 * (1.0 - keep) * against);
    s->slip += (1.0 - keep) * trial;
    by = (place_type){keep * by.s, keep * by.t}, spring = times(keep, spring);
    set_two(s->stick_point, (place_type){at.s + by.s, at.t + by.t});
  }
  s->shear = times(-kt, spring);
  /* The same energy moves it along the edges, towards where the spring is softer. */
  const double stored = energy_over(s, 1.0, depth) + half;
  s->stored = kn * stored;
  const push_type push = push_along(both, (place_type){k.slope.s * stored, k.slope.t * stored});
  vec3 on[4];
  forces_on_ends(on, normal_force(kn, 0.0, depth, s->largest_depth), kt, at, by, s->gap, s->normal,
                 s->shear, push);
  const int32_t *first = m->edges.ends + 2 * s->first, *second = m->edges.ends + 2 * s->second;
  for (int k = 0; k < 4; k++) add_to(m->f, k < 2 ? first[k] : second[k - 2], on[k]);
}

/* See kernels/contact/edges.py. */
void mufe_add_edge_forces(const edge_pairs_type *m, found_type *found, double bound,
                          int64_t num_pairs, int64_t accept) {
  *found = (found_type){0.0, 0.0, 0.0, 0.0};
  int64_t num_due = 0;
  for (int64_t p = 0; p < num_pairs; p++) {
    m->scratch[num_due] = (int32_t)p;
    num_due += m->next_check[p] <= bound;
  }
  for (int64_t k = 0; k < num_due; k++) look(m, found, m->scratch[k], bound, accept);
  const int64_t num_leaving = list_leaving(m, num_due);
  for (int64_t k = 0; k < num_due; k++)
    begin(m, found, m->scratch[k], m->scratch + num_due, num_leaving, bound);
  for (int64_t k = 0; k < num_due; k++) add_one(m, found, m->scratch[k], bound);
}

/* Energy stored in the springs of the pairs that are ``closed``. */
double mufe_energy(const edge_pair_row *row, const uint8_t *closed, int64_t num_pairs) {
  double energy = 0.0;
  for (int64_t p = 0; p < num_pairs; p++)
    if (closed[p]) energy += energy_of(spring_of(row + p), depth_now(row + p), row[p].shear);
  return energy;
}

/* Whether a crossing can come between edges and facets, and close, by a motion of ``margin``. */
INLINE int can_close(const edge_pair_row *s, double wait, double margin) {
  const double nearest = wait > 0.0 ? wait : s->gap; /* not looked at since: the gap is of then */
  return nearest < margin && s->outside <= BEYOND + 2.0 * margin / s->size;
}

/* Pairs ``on`` that are closed or can close, and their stiffness ``k``; how many. */
int64_t mufe_find_springs(const edge_pairs_type *m, int64_t *on, double *k, double margin,
                          double bound, int64_t num_pairs) {
  int64_t count = 0;
  for (int64_t p = 0; p < num_pairs; p++) {
    const edge_pair_row *s = m->row + p;
    if (!s->closed && !can_close(s, m->next_check[p] - bound, margin)) continue;
    /* As if it did not fade out where one edge goes on as the next, and were at nodes. */
    on[count] = p;
    k[count++] = at_place(&m->edges, s->first, s->second, two_of(s->place)).stiffness;
  }
  return count;
}

/* Areas that the closed crossings ``on`` stand for, and q, r and Q of push_along, rows of five. */
void mufe_areas_and_pushes(const edge_pairs_type *m, double *area, double *pushes,
                           const int64_t *on, int64_t num) {
  const edges_type *e = &m->edges;
  for (int64_t k = 0; k < num; k++) {
    const edge_pair_row *s = m->row + on[k];
    const int32_t i = s->first, j = s->second;
    const place_type at = two_of(s->place);
    const even_type even = at_place(e, i, j, at);
    area[k] = even.fade * even.stiffness * (e->layer[i] + e->layer[j]);
    const series_type now = in_series(even, at, e->compliance[i], e->compliance[j]);
    const double T2 = dot(s->shear, s->shear), kn = now.stiffness, kt = kn * s->ratio;
    const double of_friction = T2 > 0.0 ? 0.5 * T2 / kt / kn : 0.0;
    const double stored = energy_over(s, 1.0, depth_now(s)) + of_friction;
    const push_type push =
        push_along(edges_of(m, s), (place_type){now.slope.s * stored, now.slope.t * stored});
    double *out = pushes + 5 * k;
    out[0] = push.q, out[1] = push.r;
    out[2] = push.force.x, out[3] = push.force.y, out[4] = push.force.z;
  }
}
