/* Contact of nodes, or of points in facets, with the facets of other grains: the closest feature,
   then the forces. The law, its rules and all arrays are described in kernels/contact/pairs.py. */

#include "pairs_lanes.h"
#include "pairs_one.h"

#define NOT_SEEN INT32_MIN /* among the candidates of a pair: it was not looked at in this step */

/* Ask for what the pairs after the i-th of the list need; from i = -FAR_AHEAD on. */
INLINE void fetch_ahead(const pairs_type *m, const int32_t *list, int64_t i, int64_t num_due) {
  if (i + FAR_AHEAD < num_due) {
    const char *row = (const char *)(m->row + list[i + FAR_AHEAD]);
    for (size_t line = 0; line < sizeof(pair_row); line += 64) FETCH(row + line);
  }
  if (m->strength.tables) {
    const int64_t far = i + 3 * AHEAD, near = i + 2 * AHEAD;
    if (far >= 0 && far < num_due && FLOWS(m->row + list[far])) FETCH(m->strength.row + list[far]);
    if (near >= 0 && near < num_due && FLOWS(m->row + list[near]))
      fetch_flow(&m->strength, list[near]);
  }
  if (i + AHEAD >= 0 && i + AHEAD < num_due) {
    const pair_row *s = m->row + list[i + AHEAD];
    for (int k = 0; k < 3; k++) {
      FETCH_ROW(m->x, s->corner[k]);
      FETCH_ROW(m->f, s->corner[k]);
      FETCH_ROW(m->x, s->vertices[k]);
      FETCH_ROW(m->f, s->vertices[k]);
    }
    if (s->num_around) FETCH(m->around + s->around);
  }
  if (i + AHEAD / 2 >= 0 && i + AHEAD / 2 < num_due) {
    const pair_row *s = m->row + list[i + AHEAD / 2];
    for (int32_t k = 0; k < s->num_around; k++) FETCH(m->x + 3 * (int64_t)m->around[s->around + k]);
  }
}

/* The pairs of a part that are due; how many there are. The others are found with the early ones. */
INLINE int64_t list_due(const pairs_type *m, call_type *c, int32_t **list, int64_t num) {
  int32_t *others = m->scratch + num + 1;
  *list = c->part == OTHER_PAIRS ? others : m->scratch;
  if (c->part == OTHER_PAIRS) return c->num_others;
  if (c->part == ALL_PAIRS) {
    return find_due(m->scratch, m->next_check, m->bounds, m->bound_row, num);
  }
  return find_both(m->scratch, others, &c->num_others, m->next_check, m->bounds, m->bound_row,
                   m->early, num);
}

/* See kernels/contact/pairs.py. What is found of the others is added to that of the early ones.

   First all that stay in contact inside their facets, then all others, each in the order of pairs:
   pairs that carry nothing do not change the order of the sums. */
void mufe_add_pair_forces(const pairs_type *m, call_type *c, int64_t num) {
  int32_t *list;
  const int64_t num_due = list_due(m, c, &list, num);
  int64_t num_rest = 0; /* they take the places of those that have been done */
  if (c->part != OTHER_PAIRS) {
    c->dissipated = c->switched = c->num_accepted = c->deepest = c->sunk = 0.0;
    c->sunken = -1;
  }
  vec dissipated = all(0.0);
  for (int64_t i = -FAR_AHEAD; i < num_due; i += LANES) {
    for (int k = 0; k < LANES; k++) fetch_ahead(m, list, i + k, num_due);
    if (i < 0) continue;
    const int count = num_due - i < LANES ? (int)(num_due - i) : LANES;
    int32_t pair[LANES];
    for (int k = 0; k < LANES; k++) pair[k] = list[i + (k < count ? k : 0)];
    unsigned looked = 0, left = (1u << count) - 1;
    int64_t before[LANES];
    for (int k = 0; k < count; k++)
      if (!m->row[pair[k]].known) {
        before[k] = look(m, pair[k], c->range, point_of(m, m->row + pair[k]));
        looked |= 1u << k;
      }
    if (TOGETHER) left = add_lanes(m, c, pair, left, &dissipated, &looked, before);
    for (; left; left &= left - 1, num_rest++) {
      const int k = __builtin_ctz(left);
      const int64_t first = m->first[pair[k]];
      list[num_rest] = pair[k];
      m->seen[num_rest] = !(looked >> k & 1) ? NOT_SEEN : before[k] < 0 ? -1 : before[k] - first;
    }
  }
  for (int k = 0; k < LANES; k++) c->dissipated += dissipated[k];
  for (int64_t i = 0; i < num_rest; i++) {
    const int32_t p = list[i], seen = m->seen[i];
    const int64_t before = seen == NOT_SEEN ? m->closest[p] : seen < 0 ? -1 : m->first[p] + seen;
    add_one(m, c, p, seen != NOT_SEEN, before);
  }
}

/* Energy stored in the springs of the pairs that are ``closed``. */
double mufe_energy(const pair_row *row, const uint8_t *closed, int64_t num_pairs) {
  double energy = 0.0;
  for (int64_t p = 0; p < num_pairs; p++)
    if (closed[p])
      energy += energy_of(spring_of(row + p), row[p].offset - row[p].gap, row[p].shear);
  return energy;
}
