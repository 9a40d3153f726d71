/* Contact of nodes, or of points in facets, with the facets of other grains: the closest feature,
   then the forces. The law, its rules and all arrays are described in kernels/pairs.py. */

#include "due.h"
#include "surface.h"

#define FACING 0.342 /* sine of the angle a node around may lie below such a plane: 20 degrees */
#define BESIDE 1e-3  /* part of a facet by which the foot of a node may lie beside it */

/* What a pair keeps, three cache lines: that of the facet that was closest last, where ``known``,
   and what it remembers. */
typedef struct {
  double other_due; /* least ``candidate_due`` of the other candidates */
  int32_t node;
  uint8_t closed, sliding, sharp, known;
  int32_t vertices[4];
  double recess, ratio, gap, offset;
  vec3 weights, normal;
  double stiffness, push;
  vec3 anchor, shear;
  double slip, work;
} state_type;

/* In the order of kernels/pairs.py. */
typedef struct {
  state_type *state;
  double *due, *candidate_due;
  int64_t *closest;
  int32_t *scratch;
  const int64_t *first;
  const int32_t *candidate;
  surface_type surface;
  const uint8_t *sharp;
  const double *layer_of_node, *layer_of_facet, *area, *facet_area;
  points_type points;
  double *x, *f;
} pairs_type;

/* A length that is nothing beside the facets around the node n. */
INLINE double tiny(const pairs_type *m, int64_t n) { return 1e-9 * sqrt(m->area[n]); }

/* Energy of a normal spring, as in kernels/springs.py. */
INLINE double stored_energy(double stiffness, double depth, double largest_depth) {
  double within = least(depth, largest_depth);
  return stiffness * within * (depth - 0.5 * within);
}

/* Part of a contact that a point carries whose facet has ``own_area``. Both surfaces carry points,
   and what they find of each other adds up to one contact. The finer one carries the greater part:
   few points of a coarse surface would load a fine one unevenly. */
INLINE double share(double own_area, triangle t) {
  vec3 c = cross(minus(t.b, t.a), minus(t.c, t.a));
  double other2 = 0.25 * dot(c, c);
  return other2 / (other2 + own_area * own_area);
}

/* Edge of the smaller of both facets, were it equilateral. */
INLINE double finer_edge(double own_area, triangle t) {
  vec3 c = cross(minus(t.b, t.a), minus(t.c, t.a));
  return sqrt(4.0 / sqrt(3.0) * least(own_area, 0.5 * length(c)));
}

/* Weights of the point of a facet that a spring s from the node p leads to. ``foot`` is the
   closest point and ``n`` the normal of the contact, which differs from that of the facet on its
   edges and vertices. The spring lies across n, so its end is moved along n into the facet: along
   the facet's own normal a node at depth would find another spring in the next step. */
INLINE vec3 anchor_of(vec3 s, vec3 foot, vec3 n, vec3 facet_normal, triangle t) {
  double slant = dot(n, facet_normal);
  double shift = slant > 0.1 ? dot(s, facet_normal) / slant : 0.0;
  return project(along(minus(foot, s), shift, n), t);
}

INLINE triangle vertices_at(const int32_t *v, const double *x) {
  return (triangle){at(x, v[0]), at(x, v[1]), at(x, v[2])};
}

/* Closest candidate of the pair p, testing only those that can be it: ``candidate_due`` is the
   reading of the clock at which a candidate can be at distance zero; the clock advances by all
   relative motion, so that due - clock is a lower bound of the distance now. */
static int64_t find_closest(const pairs_type *m, int64_t p, double clock, vec3 point) {
  double best = INFINITY;
  int64_t begin = m->first[p], end = m->first[p + 1], remembered = m->closest[p], closest = -1;
  for (int64_t trial = begin - 1; trial < end; trial++) {
    int64_t k = trial;
    if (trial < begin) {
      if (remembered < 0) continue;
      k = remembered;
    } else if (k == remembered || m->candidate_due[k] - clock >= best) {
      continue;
    }
    triangle t = facet_at(&m->surface, m->x, m->candidate[k]);
    int feature;
    vec3 w = closest_point(point, t, &feature);
    double distance = length(minus(point, mean(w, t.a, t.b, t.c)));
    m->candidate_due[k] = clock + distance;
    if (distance < best) best = distance, closest = k;
  }
  return closest;
}

/* Make the candidate k what is known of the pair p. */
static void know(const pairs_type *m, int64_t p, int64_t k) {
  state_type *s = m->state + p;
  m->closest[p] = k;
  const int64_t facet = m->candidate[k];
  for (int v = 0; v < 3; v++) s->vertices[v] = m->surface.facets[3 * facet + v];
  s->sharp = m->sharp[facet];
  s->known = 1;
  s->other_due = INFINITY;
  for (int64_t o = m->first[p]; o < m->first[p + 1]; o++)
    if (o != k) s->other_due = least(s->other_due, m->candidate_due[o]);
}

/* Whether a body can rest with its node n on a plane of the given normal, towards the body. The
   facet closest to a node just inside a sharp edge can be one that the body around the node cannot
   touch: pushed out there, the node would slip off the edge while its body stays inside. A body
   rests with a node on a plane only if no node around it lies below. */
INLINE int below(vec3 node, vec3 p, vec3 normal) {
  vec3 d = minus(node, p);
  double height = dot(d, normal);
  return height < 0.0 && height * height > FACING * FACING * dot(d, d);
}
INLINE int faces(const pairs_type *m, int64_t n, vec3 normal) {
  const surface_type *s = &m->surface;
  const vec3 p = at(m->x, n);
  if (m->points.corner && m->points.weight[3 * n + 1] > 0.0) { /* in a facet: its corners */
    const int32_t *c = m->points.corner + 3 * n;
    return !below(at(m->x, c[0]), p, normal) && !below(at(m->x, c[1]), p, normal) &&
           !below(at(m->x, c[2]), p, normal);
  }
  for (int64_t k = s->ring_offset[n]; k < s->ring_offset[n + 1]; k++)
    for (int v = 0; v < 3; v++)
      if (below(at(m->x, s->facets[3 * (int64_t)s->ring[k] + v]), p, normal)) return 0;
  return 1;
}

/* The nearest facet that the node of the pair p is straight behind, no deeper than ``limit``, and
   that its body faces; -1 if none. */
static int64_t find_facing(const pairs_type *m, int64_t p, double limit, double *gap,
                           vec3 *weights, vec3 *normal) {
  int64_t n = m->state[p].node, best = -1;
  vec3 point = at(m->x, n);
  *gap = -limit;
  for (int64_t k = m->first[p]; k < m->first[p + 1]; k++) {
    triangle t = facet_at(&m->surface, m->x, m->candidate[k]);
    vec3 u = normal_of(t);
    double g = dot(minus(point, t.a), u);
    if (!(*gap < g && g < 0.0)) continue;
    vec3 w = project(point, t);
    if (least(w.x, least(w.y, w.z)) >= -BESIDE && faces(m, n, u))
      best = k, *gap = g, *weights = w, *normal = u;
  }
  return best;
}

/* Ask for what the pairs after the i-th of the list need; from i = -2 AHEAD on. */
INLINE void fetch_ahead(const pairs_type *m, int64_t i, int64_t num_due) {
  const int32_t *list = m->scratch;
  if (i + 2 * AHEAD < num_due) {
    const char *row = (const char *)(m->state + list[i + 2 * AHEAD]);
    FETCH(row);
    FETCH(row + 64);
    FETCH(row + 128);
  }
  if (i + AHEAD >= 0 && i + AHEAD < num_due) {
    const state_type *s = m->state + list[i + AHEAD];
    if (m->points.corner) {
      FETCH(m->points.corner + 3 * (int64_t)s->node);
      FETCH(m->points.weight + 3 * (int64_t)s->node);
    }
    if (s->sharp) FETCH(m->area + s->node);
    for (int v = 0; v < 3 && s->known; v++) {
      FETCH(m->x + 3 * (int64_t)s->vertices[v]);
      FETCH(m->f + 3 * (int64_t)s->vertices[v]);
    }
  }
  if (i + AHEAD / 2 >= 0 && i + AHEAD / 2 < num_due) {
    const int64_t n = m->state[list[i + AHEAD / 2]].node;
    FETCH(m->x + 3 * n);
    for (int k = 0; k < 3 && m->points.corner; k++) {
      FETCH(m->x + 3 * (int64_t)m->points.corner[3 * n + k]);
      FETCH(m->f + 3 * (int64_t)m->points.corner[3 * n + k]);
    }
  }
}

/* See kernels/pairs.py; ``totals``: energy dissipated, adopted pairs, pairs beyond the largest
   depth, largest adopted depth, largest depth over the edge of the finer facet, and its pair. */
void mufe_add_pair_forces(const pairs_type *m, double *totals, double clock, double friction,
                          double friction_kinetic, double largest_depth, int64_t num_pairs,
                          int64_t adopt) {
  double dissipated = 0.0, num_adopted = 0.0, num_deep = 0.0, deepest = 0.0, sunk = 0.0;
  int64_t sunken = -1;
  double *x = m->x, *f = m->f;
  const surface_type *surface = &m->surface;
  int64_t num_due = find_due(m->scratch, m->due, clock, num_pairs);
  for (int64_t i = -2 * AHEAD; i < num_due; i++) {
    fetch_ahead(m, i, num_due);
    if (i < 0) continue;
    const int64_t p = m->scratch[i];
    state_type *s = m->state + p;
    const int64_t n = s->node;
    const vec3 point = place(&m->points, x, n);

    /* The closest point: most often in the facet where it was, the others being too far. All is
       computed in one place, so that a run that is resumed finds the same last digits. */
    const int64_t before = m->closest[p];
    int feature = INTERIOR;
    vec3 w = {1.0, 0.0, 0.0};
    triangle t = {point, point, point};
    double distance = 0.0;
    for (int looked = 0;; looked = 1) {
      if (s->known) {
        t = vertices_at(s->vertices, x);
        w = closest_point(point, t, &feature);
        distance = length(minus(point, mean(w, t.a, t.b, t.c)));
        if (looked || s->other_due - clock >= distance) break;
      }
      know(m, p, find_closest(m, p, clock, point));
    }
    int64_t k = m->closest[p];

    /* The gap, and the normal from the facet to the point. */
    vec3 facet_normal = normal_of(t);
    vec3 normal = facet_normal, r = minus(point, mean(w, t.a, t.b, t.c));
    if (feature != INTERIOR)
      normal = pseudo_normal(surface, x, m->candidate[k], feature, facet_normal);
    double g = dot(r, normal) >= 0.0 ? distance : -distance;
    if (feature != INTERIOR)
      normal = distance > tiny(m, n) ? times(1.0 / g, r) : times(1.0 / length(normal), normal);
    double height = g;
    if (s->sharp && g < BESIDE * sqrt(m->area[n]) && !faces(m, n, normal)) {
      double other_gap;
      vec3 other_weights, other_normal;
      int64_t other =
          find_facing(m, p, 3.0 * largest_depth, &other_gap, &other_weights, &other_normal);
      /* A node just outside counts where it came through that facet now. */
      if (other >= 0 &&
          (g < 0.0 || s->closed || -other_gap <= clock - m->due[p] + tiny(m, n))) {
        k = other, g = height = other_gap, w = other_weights, normal = other_normal;
        t = facet_at(surface, x, m->candidate[k]);
        facet_normal = normal;
        know(m, p, k);
      }
    }
    g += s->recess;
    const double moved = clock - m->due[p];
    if (s->closed && fabs(g - s->gap) > moved && fabs(g - s->gap) > moved + tiny(m, n)) {
      /* Across a sharp edge: no energy appears, and what is lost counts as dissipated. */
      double was = s->offset - s->gap;
      s->offset = least(s->offset, g + was);
      double lost = stored_energy(s->stiffness, was, largest_depth) -
                    stored_energy(s->stiffness, most(s->offset - g, 0.0), largest_depth);
      dissipated += lost;
      s->work += lost;
    }
    const vec3 old_normal = s->normal;
    s->weights = w;
    s->normal = normal;
    s->gap = g;

    if (!s->closed) {
      /* The offset of a pair that moves out follows it, and never grows again. */
      if (s->offset < 0.0) s->offset = least(most(s->offset, g), 0.0);
      /* Motion since the pair was last known to be open bounds its depth. */
      if (s->offset - g > (adopt ? 0.0 : moved + tiny(m, n))) {
        num_adopted += 1.0;
        deepest = most(deepest, -g);
        s->offset = g;
      }
    }
    double depth = s->offset - g;
    if (depth <= 0.0) {
      if (s->closed) {
        double lost = dot(s->shear, s->shear) / (2.0 * s->stiffness * s->ratio);
        dissipated += lost;
        s->work += lost;
        s->closed = s->sliding = 0;
        s->push = 0.0;
        s->shear = (vec3){0.0, 0.0, 0.0};
      }
      m->due[p] = clock + most(g, 0.0);
      continue;
    }

    const vec3 foot = along(point, -height, normal);
    if (!s->closed) {
      s->closed = 1;
      s->stiffness = share(m->facet_area[n], t) * m->area[n] /
                     (m->layer_of_node[n] + m->layer_of_facet[m->candidate[k]]);
      s->anchor = w;
    } else if (before >= 0 && before != k) {
      /* Another facet: the spring keeps its length and turns with the normal. */
      triangle old = facet_at(surface, x, m->candidate[before]);
      vec3 spring = minus(point, mean(s->anchor, old.a, old.b, old.c));
      spring = across(spring, old_normal);
      vec3 turned = across(spring, normal);
      double now2 = dot(turned, turned);
      double keep = now2 > 0.0 ? sqrt(dot(spring, spring) / now2) : 0.0;
      s->anchor = anchor_of(times(keep, turned), foot, normal, facet_normal, t);
    }
    if (depth > largest_depth) {
      num_deep += 1.0;
      double part = depth / finer_edge(m->facet_area[n], t);
      if (part > sunk) sunk = part, sunken = p;
      depth = largest_depth;
    }
    m->due[p] = clock;

    /* Normal force, and friction of the spring between the node and its anchor. */
    const double kn = s->stiffness, kt = kn * s->ratio, N = kn * depth;
    s->push = N;
    vec3 spring = across(minus(point, mean(s->anchor, t.a, t.b, t.c)), normal);
    double T = kt * length(spring);
    s->sliding = T > (s->sliding ? friction_kinetic : friction) * N;
    if (s->sliding) {
      /* Work of the mean friction of the step: exact for the trapezoidal rule. */
      double limit = friction_kinetic * N, slipped = (T - limit) / kt;
      double lost = 0.5 * (length(s->shear) + limit) * slipped;
      dissipated += lost;
      s->work += lost;
      s->slip += slipped;
      spring = times(limit / T, spring);
      /* The anchor that leaves just this much of the spring. */
      s->anchor = anchor_of(spring, foot, normal, facet_normal, t);
    }
    vec3 shear = times(-kt, spring);
    s->shear = shear;
    vec3 force = along(shear, N, normal);
    spread(&m->points, f, n, force);

    /* Couple height x friction as normal forces on the facet, h_i = height grad N_i . T, less what
       is across the facet, along the normal, where that is of an edge or vertex. */
    vec3 e1 = minus(t.b, t.a), e2 = minus(t.c, t.a);
    vec3 in_plane = along(shear, -dot(shear, facet_normal) / dot(normal, facet_normal), normal);
    double scale = height / dot(facet_normal, cross(e1, e2));
    /* grad N_b = (e2 x n)/2A and grad N_c = (n x e1)/2A */
    double hb = scale * dot(in_plane, cross(e2, facet_normal));
    double hc = scale * dot(in_plane, cross(facet_normal, e1));
    const int32_t *v = s->vertices;
    add_to(f, v[0], along(times(-hb - hc, normal), -w.x, force));
    add_to(f, v[1], along(times(hb, normal), -w.y, force));
    add_to(f, v[2], along(times(hc, normal), -w.z, force));
  }
  totals[0] = dissipated, totals[1] = num_adopted, totals[2] = num_deep, totals[3] = deepest;
  totals[4] = sunk, totals[5] = (double)sunken;
}
