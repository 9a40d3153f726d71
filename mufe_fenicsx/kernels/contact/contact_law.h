/* The law of a contact (law.h) for one contact and for LANES of them, and what it asks for. */

#ifndef CONTACT_LAW_H
#define CONTACT_LAW_H

#include "due.h"

#include "pair_rows.h" /* written by kernels/build/pair_rows.py */

#define SOFTER 1.69
#define XI 0.104
#define NOTHING 1e-300 /* keeps a flat contact of no depth from 0/0 */
/* Mean pressure of a round contact that flows, over the yield stress at a strain that stands for it,
   and that strain over the radius of the contact over that of the body (Tabor 1951). */
#define MEAN_PRESSURE 2.8
#define TABOR 0.2
#define CLOSE 1e-10     /* part of a depth to which it is found */
#define LAST 1e-5       /* its last change by Newton's method, whose error is squared: √CLOSE */
#define ROUNDING 1.2e-7 /* part that rounding to single precision takes */

/* Bodies that yield. At an offset of ``tables`` the number n of points, n plastic strains and n
   stresses. ``strain``: plastic one of all cells, ``work``: that of dents over them. ``row``: of each
   pair. What points keep of dents when pairs go: ``dent``, that in their own surface, for whoever
   comes next, and ``beyond``, that in the surface of the grain ``met``. */
typedef struct {
  const double *tables;
  dent_row *row;
  const double *strain;
  double *work;
  point_dent_row *point;
} strength_type;

#define WIDTH 1
#include "law.h"
#undef WIDTH
#define WIDTH LANES
#include "law.h"
#undef WIDTH

#define FLOWED 0.999 /* part of its yield depth that a pair has that flowed */

/* Whether a pair is likely to flow: it has flowed in the last step. */
#define FLOWS(s) ((s)->closed && (s)->offset - (s)->gap >= FLOWED * (s)->yield_depth)

/* Ask for what a pair needs to flow, its row of dents being there. */
INLINE void fetch_flow(const strength_type *of, int64_t pair) {
  const dent_row *row = of->row + pair;
  FETCH(of->strain + row->cell);
  FETCH(of->work + row->cell);
  FETCH(of->point + row->point);
}

/* The dent that a pair finds where it closes, from those before it. */
INLINE double kept_dent(const strength_type *of, int64_t pair) {
  const dent_row *row = of->row + pair;
  const point_dent_row *kept = of->point + row->point;
  return kept->dent + (row->partner >= 0 && kept->met == row->partner ? kept->beyond : 0.0);
}

/* The dent of a pair deepens: both bodies take their parts, and its ``work`` is kept beneath. */
INLINE void deepen(const strength_type *of, int64_t pair, double deeper, double own_part,
                   double slope_left, double work) {
  dent_row *row = of->row + pair;
  point_dent_row *kept = of->point + row->point;
  row->dent += deeper;
  row->slope_left = (float)slope_left;
  of->work[row->cell] += work;
  kept->dent += own_part * deeper;
  if (own_part == 1.0) return;
  if (kept->met != row->partner) kept->met = row->partner, kept->beyond = 0.0;
  kept->beyond += (1.0 - own_part) * deeper;
}

/* What a pair has to flow; ``m`` of the law and the nodes around its point. */
INLINE flowing_type flowing(const strength_type *of, int64_t pair, double m, triangle around) {
  const dent_row *row = of->row + pair;
  const double area = 0.5 * length(cross(minus(around.b, around.a), minus(around.c, around.a)));
  /* A vertex carries no more once the facets around do. */
  const int is_tip = row->reference == 0.0, alike = row->own == row->other;
  flowing_type q = {is_tip,
                    alike,
                    m,
                    row->layers * (is_tip ? 1.0 : area / row->reference),
                    row->bend,
                    0.25 * row->edge * row->edge * row->bend,
                    of->strain[row->cell],
                    no_line(),
                    no_line()};
  if (row->own >= 0) q.own.table[0] = of->tables + row->own;
  if (row->other >= 0 && !alike) q.other.table[0] = of->tables + row->other;
  return q;
}
/* What the dents of those ``lanes`` deepen by at a depth, as of flow_each. Seldom wanted, so that its
   numbers shall not take the registers of what always is. */
typedef struct {
  vec deeper, limit, left, own_part;
} flowed_type;
static __attribute__((noinline)) void flow_lanes(flowed_type *out, const strength_type *of,
                                                 const int32_t *pair, unsigned lanes, vec depth,
                                                 vec m, vec yields, const vec3_each around[3]) {
  const vec none = all(0.0);
  flowing_type_each q = {lanes_of(0),    lanes_of(0),   m, none, none, none, none,
                         no_line_each(), no_line_each()};
  const vec area = 0.5 * length_each(cross_each(minus_each(around[1], around[0]),
                                                minus_each(around[2], around[0])));
  double number[5][LANES] __attribute__((aligned(64))) = {{0.0}};
  for (unsigned some = lanes; some; some &= some - 1) {
    const int i = __builtin_ctz(some);
    const dent_row *row = of->row + pair[i];
    const int alike = row->own == row->other;
    number[0][i] = row->layers, number[1][i] = row->bend, number[2][i] = row->edge;
    number[3][i] = row->reference, number[4][i] = row->dent;
    q.beneath[i] = of->strain[row->cell];
    q.alike[i] = -(int64_t)alike;
    if (row->own >= 0) q.own.table[i] = of->tables + row->own;
    if (row->other >= 0 && !alike) q.other.table[i] = of->tables + row->other;
  }
  const vec reference = *(vec *)number[3], edge = *(vec *)number[2], dent = *(vec *)number[4];
  q.is_tip = (reference == 0.0) & lanes_of(lanes);
  q.layers = *(vec *)number[0] * where_each(reference == 0.0, all(1.0), area / reference);
  q.bend = *(vec *)number[1], q.largest = 0.25 * edge * edge * q.bend;
  out->limit = yields, out->left = out->own_part = all(1.0);
  out->deeper =
      flow_each(&q, lanes_of(lanes), dent, depth, &out->limit, &out->left, &out->own_part);
}

#endif
