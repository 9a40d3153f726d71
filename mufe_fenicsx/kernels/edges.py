"""Contact of sharp edges that cross: how they close, slide, move on and open."""

import math

import numba

from .crossing import END, crossing, piercings
from .edge_search import segment_distance
from .edge_springs import OVERRUN, crossing_stiffness
from .springs import stored_energy

#: Crossings first seen deeper than this part of the mean facet edge are none.
DEEPEST = 0.25
#: Crossings farther outside, as of :func:`.crossing.crossing`, are not asked whether edges pierce.
BESIDE = 0.5


@numba.njit(cache=True, error_model="numpy")
def _spring(x, ends, i, j, ds, dt):
    """The vector ds u - dt v of edges u and v: from anchor to anchor, along the surfaces [m]."""
    a, b, c, d = ends[i, 0], ends[i, 1], ends[j, 0], ends[j, 1]
    return (
        ds * (x[b, 0] - x[a, 0]) - dt * (x[d, 0] - x[c, 0]),
        ds * (x[b, 1] - x[a, 1]) - dt * (x[d, 1] - x[c, 1]),
        ds * (x[b, 2] - x[a, 2]) - dt * (x[d, 2] - x[c, 2]),
    )


@numba.njit(cache=True, error_model="numpy")
def _parts(x, ends, i, j, dx, dy, dz):
    """ds and dt with ds u - dt v equal to a vector, less its part across both edges."""
    a, b, c, d = ends[i, 0], ends[i, 1], ends[j, 0], ends[j, 1]
    ux, uy, uz = x[b, 0] - x[a, 0], x[b, 1] - x[a, 1], x[b, 2] - x[a, 2]
    vx, vy, vz = x[d, 0] - x[c, 0], x[d, 1] - x[c, 1], x[d, 2] - x[c, 2]
    uu, vv = ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz
    uv = ux * vx + uy * vy + uz * vz
    du, dv = dx * ux + dy * uy + dz * uz, dx * vx + dy * vy + dz * vz
    det = uu * vv - uv * uv
    return (vv * du - uv * dv) / det, (uv * du - uu * dv) / det


@numba.njit(cache=True, error_model="numpy")
def add_edge_forces(
    f,
    due,
    outside,
    pierced,
    place,
    normal,
    gap,
    offset,
    closed,
    stiffness,
    anchor,
    shear,
    slip,
    work,
    clock,
    x,
    first,
    second,
    ends,
    beyond,
    area,
    layer,
    share,
    ratio,
    friction,
    size,
    largest_depth,
    recess,
    adopt,
):
    """Find the crossings of all pairs and add the forces of the closed ones to ``f``, in place.

    A closed pair with gap g (less its offset) carries the normal force -k g at the
    closest points p of the one and q of the other edge, p - q = g n: the gradient of
    k g²/2, with net force and net moment zero. Friction is the force of a spring between
    two anchors, points of the edges that start as p and q and that Coulomb's limit drags
    along. What separates them beside g n is a vector d = ds u - dt v of the edges u and
    v; friction T = -k_t d acts at the anchors, and its couple g n x T is borne by forces
    ± h n at the ends of the edges, h u + h' v = g T. That is the gradient of k_t d²/2.

    A contact begins at a gap that was open the step before, as in kernels.pairs, and a
    crossing that was not there before counts only where edges pierce facets. A closed
    crossing that leaves its edges or their facets hands depth and springs to the crossing
    of an edge beside that took its place; where there is none it is let go (OVERRUN), and
    what its springs stored counts as dissipated.

    Args:
        f: Forces on surface nodes [N], shape (num_nodes, 3).
        due: Reading of the clock before which a pair cannot close, shape (num_pairs,).
        outside: By how much the crossing lies outside, as of :func:`crossing`, (num_pairs,).
        pierced: Whether the edges of an open pair pierced a facet, shape (num_pairs,).
        place: s and t of the crossing, shape (num_pairs, 2).
        normal: Unit normals, from the second to the first edge, shape (num_pairs, 3).
        gap, offset: Gap and its offset (<= 0) [m], shape (num_pairs,).
        closed: Whether the pair carries force, shape (num_pairs,).
        stiffness: Of closed pairs [N/m], set when they close, shape (num_pairs,).
        anchor: s and t of the anchors, shape (num_pairs, 2).
        shear: Friction on the first edge [N], shape (num_pairs, 3).
        slip: Slip since the last search [m], shape (num_pairs,).
        work: Energy dissipated since the last search [J], shape (num_pairs,).
        clock: Bound of all relative motion so far [m].
        x: Positions [m], shape (num_nodes, 3).
        first, second: The edges of each pair, shape (num_pairs,).
        ends, beyond: Edges, as in kernels.edge_search.
        area: Area that stands for an edge [m²], shape (num_edges,).
        layer: Compliance c h/E* of the edges [m/Pa], shape (num_edges,).
        share: Part of the stiffness that acts at the ends of the edges, shape (num_edges, 2).
        ratio: Tangential over normal stiffness, shape (num_own_edges,).
        friction: Coefficient of friction.
        size: Mean facet edge [m].
        largest_depth: Depth beyond which the force does not grow [m].
        recess: Depth at which the contact of edges begins [m].
        adopt: True to adopt every pair that overlaps (start of a test).

    Returns:
        Energy dissipated [J], and the part of it in normal springs that were let go; number of
        adopted pairs; number of pairs beyond the largest depth; largest adopted depth [m].
    """
    dissipated, lost, num_adopted, num_deep, deepest = 0.0, 0.0, 0, 0, 0.0
    num_leaving = 0
    for p in range(first.size):
        if due[p] > clock:
            continue
        i, j = first[p], second[p]
        was_open = outside[p] <= 0.0 and gap[p] >= 0.0
        was_inside = outside[p] > 0.0 and pierced[p]
        outside[p], s, t, nx, ny, nz, g, across, turned = crossing(x, ends, beyond, i, j)
        beside = min(outside[p], 1.0)
        if not closed[p]:
            near = -DEEPEST * size < g < 0.0 and outside[p] < BESIDE
            count = piercings(x, ends, beyond, i, j) if near else 0
            pierced[p] = count > 0
            if g < 0.0 and count == 0 and not (was_open and turned <= END):
                outside[p] = max(outside[p], 1.0)
                # Nearer than that, edges can begin to pierce facets at any time.
                beside = max(beside - BESIDE, 0.0)
        if g < math.inf:  # not parallel
            gap[p], place[p, 0], place[p, 1] = g, s, t
            normal[p, 0], normal[p, 1], normal[p, 2] = nx, ny, nz
        if closed[p]:
            due[p] = clock
            if outside[p] > 0.0:
                num_leaving += 1
            continue
        if outside[p] > 0.0:
            # An edge can come in from the side, below the other one.
            distance = segment_distance(x, ends[i, 0], ends[i, 1], ends[j, 0], ends[j, 1])
            due[p] = clock + max(distance - largest_depth, 0.25 * beside * across)
            continue
        offset[p] = min(max(offset[p], g), 0.0) if offset[p] < 0.0 else 0.0
        # What was inside before it crossed, came in from the side.
        allowed = 0.0 if adopt or was_inside else clock - due[p] + 1e-9 * size
        if offset[p] - g > allowed:
            num_adopted += 1
            deepest = max(deepest, -g)
            offset[p] = g
        due[p] = clock + max(g, 0.0)

    if num_leaving:
        released, let_go = _hand_over(
            outside, gap, offset, closed, stiffness, anchor, shear, work, place, normal, clock,
            due, x, first, second, ends, ratio, largest_depth,
        )  # fmt: skip
        dissipated, lost = dissipated + released, lost + let_go

    for p in range(first.size):
        if due[p] > clock or not (closed[p] or outside[p] <= 0.0):
            continue
        i, j = first[p], second[p]
        if not closed[p]:
            offset[p] = min(offset[p], -recess)
        depth = offset[p] - gap[p]
        if depth <= 0.0:
            if closed[p]:
                t2 = shear[p, 0] ** 2 + shear[p, 1] ** 2 + shear[p, 2] ** 2
                released = t2 / (2.0 * stiffness[p] * ratio[i])
                dissipated += released
                work[p] += released
                closed[p] = False
                shear[p, 0] = shear[p, 1] = shear[p, 2] = 0.0
                due[p] = clock + max(gap[p], 0.0)
            continue
        if not closed[p]:
            closed[p] = True
            stiffness[p] = crossing_stiffness(i, j, place[p, 0], place[p, 1], area, layer, share)
            anchor[p, 0], anchor[p, 1] = place[p, 0], place[p, 1]
        due[p] = clock
        if depth > largest_depth:
            num_deep += 1
            depth = largest_depth
        kn = stiffness[p]
        kt = kn * ratio[i]
        N = kn * depth
        ds, dt = anchor[p, 0] - place[p, 0], anchor[p, 1] - place[p, 1]
        dx, dy, dz = _spring(x, ends, i, j, ds, dt)
        T = kt * math.sqrt(dx * dx + dy * dy + dz * dz)
        limit = friction * N
        if T > limit:
            keep = limit / T
            # Work of the mean friction of the step: exact for the trapezoidal rule.
            before2 = shear[p, 0] ** 2 + shear[p, 1] ** 2 + shear[p, 2] ** 2
            slipped = (T - limit) / kt
            released = 0.5 * (math.sqrt(before2) + limit) * slipped
            dissipated += released
            work[p] += released
            slip[p] += slipped
            ds, dt = keep * ds, keep * dt
            dx, dy, dz = keep * dx, keep * dy, keep * dz
            anchor[p, 0], anchor[p, 1] = place[p, 0] + ds, place[p, 1] + dt
        shear[p, 0], shear[p, 1], shear[p, 2] = -kt * dx, -kt * dy, -kt * dz
        # Couple: T = -kt (ds u - dt v), so h = -kt g ds on the first edge, kt g dt on the second.
        h0, h1 = -kt * gap[p] * ds, kt * gap[p] * dt
        a, b, c, d = ends[i, 0], ends[i, 1], ends[j, 0], ends[j, 1]
        s, t = place[p, 0], place[p, 1]
        ps, pt = anchor[p, 0], anchor[p, 1]
        for m in range(3):
            n, T = normal[p, m], shear[p, m]
            f[a, m] += ((1.0 - s) * N - h0) * n + (1.0 - ps) * T
            f[b, m] += (s * N + h0) * n + ps * T
            f[c, m] -= ((1.0 - t) * N + h1) * n + (1.0 - pt) * T
            f[d, m] -= (t * N - h1) * n + pt * T
    return dissipated, lost, num_adopted, num_deep, deepest


@numba.njit(cache=True, error_model="numpy")
def _hand_over(
    outside, gap, offset, closed, stiffness, anchor, shear, work, place, normal, clock, due, x,
    first, second, ends, ratio, largest_depth,
):  # fmt: skip
    """Closed crossings that left their edges pass offset and springs on, or are let go.

    What is released counts as the work of the pair that left, of the same two grains.

    Returns:
        Energy of the springs that were let go [J], and the part in normal springs.
    """
    dissipated, lost = 0.0, 0.0
    for p in range(first.size):
        if not closed[p] or outside[p] <= 0.0:
            continue
        best = -1
        for q in range(first.size):
            if (
                outside[q] <= 0.0
                and due[q] <= clock
                and gap[q] < 0.0
                and _beside(ends, first[p], first[q])
                and _beside(ends, second[p], second[q])
                and (best < 0 or gap[q] < gap[best])
            ):
                best = q
        if best < 0 and outside[p] <= OVERRUN:
            continue
        i, kt = first[p], stiffness[p] * ratio[first[p]]
        t2 = shear[p, 0] ** 2 + shear[p, 1] ** 2 + shear[p, 2] ** 2
        depth = max(offset[p] - gap[p], 0.0)
        normal_energy = stored_energy(stiffness[p], depth, largest_depth)
        shear_energy = 0.0
        closed[p] = False
        # As deep as before, so that no energy appears.
        passed = min(gap[best] + depth, 0.0) if best >= 0 else 0.0
        if best >= 0 and offset[best] < passed:
            q = best
            if closed[q]:
                q2 = shear[q, 0] ** 2 + shear[q, 1] ** 2 + shear[q, 2] ** 2
                shear_energy = q2 / (2.0 * stiffness[q] * ratio[first[q]])
                depth = max(offset[q] - gap[q], 0.0)
                normal_energy += stored_energy(stiffness[q], depth, largest_depth)
            offset[q], stiffness[q], closed[q] = passed, stiffness[p], True
            due[q] = clock
            # The spring keeps its length and turns with the normal.
            dx, dy, dz = _spring(
                x, ends, i, second[p], anchor[p, 0] - place[p, 0], anchor[p, 1] - place[p, 1]
            )
            along = dx * normal[q, 0] + dy * normal[q, 1] + dz * normal[q, 2]
            d2 = dx * dx + dy * dy + dz * dz
            now2 = d2 - along * along
            keep = math.sqrt(d2 / now2) if now2 > 0.0 else 0.0
            dx, dy, dz = keep * dx, keep * dy, keep * dz
            ds, dt = _parts(x, ends, first[q], second[q], dx, dy, dz)
            anchor[q, 0], anchor[q, 1] = place[q, 0] + ds, place[q, 1] + dt
            for m in range(3):
                shear[q, m] = 0.0
            shear[q, 0] = math.sqrt(t2)  # its size before the step; the direction follows
            left = stored_energy(stiffness[q], max(offset[q] - gap[q], 0.0), largest_depth)
            normal_energy = max(normal_energy - left, 0.0)
        else:
            shear_energy = t2 / (2.0 * kt)
        work[p] += shear_energy + normal_energy
        dissipated += shear_energy + normal_energy
        lost += normal_energy
        shear[p, 0] = shear[p, 1] = shear[p, 2] = 0.0
    return dissipated, lost


@numba.njit(cache=True)
def _beside(ends, i, j):
    """Whether two edges are the same or have an end in common."""
    a, b, c, d = ends[i, 0], ends[i, 1], ends[j, 0], ends[j, 1]
    return a == c or a == d or b == c or b == d
