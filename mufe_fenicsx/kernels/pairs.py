"""Contact of nodes with the facets of other grains: closest feature, then forces."""

import math

import numba

from .closest import INTERIOR, closest_point, facet_normal, pseudo_normal
from .due import AHEAD, fetch_ahead, find_due
from .facing import BESIDE, faces, find_facing
from .points import add_force, place_point
from .springs import stored_energy


@numba.njit(cache=True, error_model="numpy")
def _find_closest(pair, clock, x, node, first, candidate, candidate_due, closest, facets):
    """Closest candidate of a pair, testing only those that can be it.

    ``candidate_due`` is the reading of the clock at which a candidate can be at
    distance zero; the clock advances by all relative motion, so that due - clock
    is a lower bound of the distance now.
    """
    n = node[pair]
    px, py, pz = x[n, 0], x[n, 1], x[n, 2]
    best, best_k, best_feature = math.inf, -1, 0
    best_wa, best_wb, best_wc = 1.0, 0.0, 0.0
    remembered = closest[pair]
    for trial in range(-1, first[pair + 1] - first[pair]):
        if trial < 0:
            if remembered < 0:
                continue
            k = remembered
        else:
            k = first[pair] + trial
            if k == remembered or candidate_due[k] - clock >= best:
                continue
        f = candidate[k]
        a, b, c = facets[f, 0], facets[f, 1], facets[f, 2]
        wa, wb, wc, feature = closest_point(px, py, pz, x, a, b, c)
        dx = px - wa * x[a, 0] - wb * x[b, 0] - wc * x[c, 0]
        dy = py - wa * x[a, 1] - wb * x[b, 1] - wc * x[c, 1]
        dz = pz - wa * x[a, 2] - wb * x[b, 2] - wc * x[c, 2]
        distance = math.sqrt(dx * dx + dy * dy + dz * dz)
        candidate_due[k] = clock + distance
        if distance < best:
            best, best_k, best_feature = distance, k, feature
            best_wa, best_wb, best_wc = wa, wb, wc
    return best, best_k, best_feature, best_wa, best_wb, best_wc


@numba.njit(cache=True, error_model="numpy")
def project(px, py, pz, x, a, b, c):
    """Weights of the foot of a point on the plane of the triangle a, b, c."""
    ux, uy, uz = x[b, 0] - x[a, 0], x[b, 1] - x[a, 1], x[b, 2] - x[a, 2]
    vx, vy, vz = x[c, 0] - x[a, 0], x[c, 1] - x[a, 1], x[c, 2] - x[a, 2]
    dx, dy, dz = px - x[a, 0], py - x[a, 1], pz - x[a, 2]
    uu, vv = ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz
    uv = ux * vx + uy * vy + uz * vz
    du, dv = dx * ux + dy * uy + dz * uz, dx * vx + dy * vy + dz * vz
    det = uu * vv - uv * uv
    wb, wc = (vv * du - uv * dv) / det, (uu * dv - uv * du) / det
    return 1.0 - wb - wc, wb, wc


@numba.njit(cache=True, error_model="numpy")
def _share(own_area, x, a, b, c):
    """Part of a contact that a point carries whose facet has ``own_area``, against facet a, b, c.

    Both surfaces carry points, and what they find of each other adds up to one contact.
    The finer one carries the greater part: few points of a coarse surface would load a
    fine one unevenly.
    """
    ux, uy, uz = x[b, 0] - x[a, 0], x[b, 1] - x[a, 1], x[b, 2] - x[a, 2]
    vx, vy, vz = x[c, 0] - x[a, 0], x[c, 1] - x[a, 1], x[c, 2] - x[a, 2]
    cx, cy, cz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    other2 = 0.25 * (cx * cx + cy * cy + cz * cz)
    return other2 / (other2 + own_area * own_area)


@numba.njit(cache=True, error_model="numpy")
def anchor_of(sx, sy, sz, px, py, pz, nx, ny, nz, x, a, b, c):
    """Weights of the point of the facet a, b, c that a spring s from the node leads to.

    ``p`` is the closest point of the facet to the node and ``n`` the normal of the contact,
    which differs from that of the facet on its edges and vertices. The spring lies
    across n, so its end is moved along n into the facet: along the facet's own normal a
    node at depth would find another spring in the next step.
    """
    ux, uy, uz = facet_normal(x, a, b, c)
    slant = nx * ux + ny * uy + nz * uz
    along = (sx * ux + sy * uy + sz * uz) / slant if slant > 0.1 else 0.0
    return project(px - sx + along * nx, py - sy + along * ny, pz - sz + along * nz, x, a, b, c)


@numba.njit(cache=True, error_model="numpy")
def add_pair_forces(
    f,
    due_pairs,
    due,
    candidate_due,
    closest,
    weights,
    normal,
    gap,
    offset,
    closed,
    stiffness,
    anchor,
    shear,
    slip,
    push,
    work,
    sliding,
    clock,
    x,
    corner,
    corner_weight,
    node,
    first,
    candidate,
    facets,
    neighbor,
    ring_offset,
    ring,
    sharp,
    layer_of_node,
    layer_of_facet,
    area,
    facet_area,
    recess,
    ratio_of_node,
    friction,
    friction_kinetic,
    largest_depth,
    adopt,
):
    """Find the gaps of all pairs and add the forces of the closed ones to ``f``, in place.

    A closed pair with gap g (less its offset) carries the normal force -k g and the
    tangential force of a spring between the node and its anchor, a point that
    sticks to the facet until Coulomb's limit drags it along. The facet receives
    the opposite force at the closest point, and the couple gap x friction, so that
    linear and angular momentum are kept.

    A contact begins at a gap that was open the step before. A node found deeper than
    it can have moved is adopted: its depth becomes the offset of its gap.

    Args:
        f: Forces on surface nodes [N], shape (num_nodes_with_ghosts, 3).
        due_pairs: Scratch, int64, shape (num_pairs,).
        due: Reading of the clock before which a pair cannot close, shape (num_pairs,).
        candidate_due: The same for each candidate, shape (num_candidates,).
        closest: Candidate that was closest last, -1 unknown, shape (num_pairs,).
        weights, normal: Closest point and normal, facet to node, shape (num_pairs, 3).
        gap, offset: Gap and its offset (<= 0, but for multipliers) [m], shape (num_pairs,).
        closed: Whether the pair carries force, shape (num_pairs,).
        stiffness: Of closed pairs [N/m], set when they close, shape (num_pairs,).
        anchor: Weights of the anchor in the closest facet, shape (num_pairs, 3).
        shear: Friction on the node [N], shape (num_pairs, 3).
        slip: Accumulated slip [m], shape (num_pairs,).
        push: Normal force on the node [N], shape (num_pairs,).
        work: Energy dissipated since the last search [J], shape (num_pairs,).
        sliding: Whether the pair slipped in this step, shape (num_pairs,).
        clock: Bound of all relative motion so far [m].
        x: Positions [m], shape (num_nodes_with_ghosts, 3); of points in facets those of pairs that
            are due are set here.
        corner, corner_weight: As in kernels.points, where the nodes of pairs are points in
            facets, which hand their forces on; else of shape (0, 3).
        node, first, candidate: Pairs, as in kernels.search.
        facets, neighbor, ring_offset, ring: Surface, as in kernels.closest.
        sharp: Whether a facet has a vertex on a sharp edge, shape (num_facets,).
        layer_of_node, layer_of_facet: Compliance c h/E* of a side [m/Pa].
        area: Areas that the nodes stand for [m²], shape (num_nodes,).
        facet_area: Areas of the facets there [m²], shape (num_nodes,).
        recess: How far the nodes lie behind the surface that carries contact [m], (num_nodes,).
        ratio_of_node: Tangential over normal stiffness, shape (num_nodes,).
        friction: Coefficient of friction that a pair has to overcome to slip.
        friction_kinetic: Coefficient while it slips; until a step in which it sticks.
        largest_depth: Depth beyond which the force does not grow [m].
        adopt: True to adopt every node that lies inside (start of a test).

    Returns:
        Energy dissipated [J]; number of adopted pairs; number of pairs
        beyond the largest depth; largest adopted depth [m].
    """
    dissipated, num_adopted, num_deep, deepest = 0.0, 0, 0, 0.0
    num_due = find_due(due_pairs, due, clock)
    for i in range(-2 * AHEAD, num_due):
        fetch_ahead(
            i, num_due, due_pairs, weights, shear, work, closest, node, first, candidate,
            candidate_due, facets, corner, corner_weight, x, f,
        )  # fmt: skip
        if i < 0:
            continue
        p = due_pairs[i]
        n = node[p]
        if corner.shape[0]:
            place_point(x, n, corner, corner_weight)
        before = closest[p]
        d, k, feature, wa, wb, wc = _find_closest(
            p, clock, x, node, first, candidate, candidate_due, closest, facets
        )
        closest[p] = k
        t = candidate[k]
        a, b, c = facets[t, 0], facets[t, 1], facets[t, 2]
        rx = x[n, 0] - wa * x[a, 0] - wb * x[b, 0] - wc * x[c, 0]
        ry = x[n, 1] - wa * x[a, 1] - wb * x[b, 1] - wc * x[c, 1]
        rz = x[n, 2] - wa * x[a, 2] - wb * x[b, 2] - wc * x[c, 2]
        nx, ny, nz = pseudo_normal(x, facets, t, feature, neighbor, ring_offset, ring)
        tiny = 1e-9 * math.sqrt(area[n])
        side = rx * nx + ry * ny + rz * nz
        g = d if side >= 0.0 else -d
        if feature != INTERIOR:
            if d > tiny:
                scale = 1.0 / g
                nx, ny, nz = rx * scale, ry * scale, rz * scale
            else:
                scale = 1.0 / math.sqrt(nx * nx + ny * ny + nz * nz)
                nx, ny, nz = nx * scale, ny * scale, nz * scale
        height = g
        beside = sharp[t] and g < BESIDE * math.sqrt(area[n])
        if beside and not faces(x, n, nx, ny, nz, facets, ring_offset, ring):
            other = find_facing(
                p, x, node, first, candidate, facets, ring_offset, ring, 3.0 * largest_depth
            )
            # A node just outside counts where it came through that facet now.
            if other[0] >= 0 and (g < 0.0 or closed[p] or -other[1] <= clock - due[p] + tiny):
                closest[p], g, wa, wb, wc, nx, ny, nz = other
                height = g
                t = candidate[closest[p]]
                a, b, c = facets[t, 0], facets[t, 1], facets[t, 2]
        g += recess[n]
        if closed[p] and abs(g - gap[p]) > clock - due[p] + tiny:
            # Across a sharp edge: no energy appears, and what is lost counts as dissipated.
            was = offset[p] - gap[p]
            offset[p] = min(offset[p], g + was)
            left = max(offset[p] - g, 0.0)
            lost = stored_energy(stiffness[p], was, largest_depth)
            lost -= stored_energy(stiffness[p], left, largest_depth)
            dissipated += lost
            work[p] += lost
        ox, oy, oz = normal[p, 0], normal[p, 1], normal[p, 2]
        weights[p, 0], weights[p, 1], weights[p, 2] = wa, wb, wc
        normal[p, 0], normal[p, 1], normal[p, 2] = nx, ny, nz
        gap[p] = g

        if not closed[p]:
            # The offset of a pair that moves out follows it, and never grows again.
            if offset[p] < 0.0:
                offset[p] = min(max(offset[p], g), 0.0)
            # Motion since the pair was last known to be open bounds its depth.
            if offset[p] - g > 0.0 if adopt else offset[p] - g > clock - due[p] + tiny:
                num_adopted += 1
                deepest = max(deepest, -g)
                offset[p] = g
        depth = offset[p] - g

        if depth <= 0.0:
            if closed[p]:
                kt = stiffness[p] * ratio_of_node[n]
                tx = shear[p, 0]
                ty = shear[p, 1]
                tz = shear[p, 2]
                lost = (tx * tx + ty * ty + tz * tz) / (2.0 * kt)
                dissipated += lost
                work[p] += lost
                closed[p] = sliding[p] = False
                push[p] = 0.0
                shear[p, 0] = shear[p, 1] = shear[p, 2] = 0.0
            due[p] = clock + max(g, 0.0)
            continue

        if not closed[p]:
            closed[p] = True
            share = _share(facet_area[n], x, a, b, c)
            stiffness[p] = share * area[n] / (layer_of_node[n] + layer_of_facet[t])
            anchor[p, 0], anchor[p, 1], anchor[p, 2] = wa, wb, wc
        elif before >= 0 and candidate[before] != t:
            # Another facet: the spring keeps its length and turns with the normal.
            o = candidate[before]
            q, r, m = facets[o, 0], facets[o, 1], facets[o, 2]
            sx = x[n, 0] - anchor[p, 0] * x[q, 0] - anchor[p, 1] * x[r, 0] - anchor[p, 2] * x[m, 0]
            sy = x[n, 1] - anchor[p, 0] * x[q, 1] - anchor[p, 1] * x[r, 1] - anchor[p, 2] * x[m, 1]
            sz = x[n, 2] - anchor[p, 0] * x[q, 2] - anchor[p, 1] * x[r, 2] - anchor[p, 2] * x[m, 2]
            along = sx * ox + sy * oy + sz * oz
            sx, sy, sz = sx - along * ox, sy - along * oy, sz - along * oz
            length2 = sx * sx + sy * sy + sz * sz
            along = sx * nx + sy * ny + sz * nz
            sx, sy, sz = sx - along * nx, sy - along * ny, sz - along * nz
            now2 = sx * sx + sy * sy + sz * sz
            keep = math.sqrt(length2 / now2) if now2 > 0.0 else 0.0
            anchor[p, 0], anchor[p, 1], anchor[p, 2] = anchor_of(
                keep * sx, keep * sy, keep * sz, x[n, 0] - height * nx, x[n, 1] - height * ny,
                x[n, 2] - height * nz, nx, ny, nz, x, a, b, c,
            )  # fmt: skip
        if depth > largest_depth:
            num_deep += 1
            depth = largest_depth
        due[p] = clock

        kn = stiffness[p]
        kt = kn * ratio_of_node[n]
        N = kn * depth
        push[p] = N
        sx = x[n, 0] - anchor[p, 0] * x[a, 0] - anchor[p, 1] * x[b, 0] - anchor[p, 2] * x[c, 0]
        sy = x[n, 1] - anchor[p, 0] * x[a, 1] - anchor[p, 1] * x[b, 1] - anchor[p, 2] * x[c, 1]
        sz = x[n, 2] - anchor[p, 0] * x[a, 2] - anchor[p, 1] * x[b, 2] - anchor[p, 2] * x[c, 2]
        along = sx * nx + sy * ny + sz * nz
        sx, sy, sz = sx - along * nx, sy - along * ny, sz - along * nz
        T = kt * math.sqrt(sx * sx + sy * sy + sz * sz)
        sliding[p] = T > (friction_kinetic if sliding[p] else friction) * N
        if sliding[p]:
            limit = friction_kinetic * N
            keep = limit / T
            # Work of the mean friction of the step: exact for the trapezoidal rule.
            before2 = shear[p, 0] ** 2 + shear[p, 1] ** 2 + shear[p, 2] ** 2
            slipped = (T - limit) / kt
            lost = 0.5 * (math.sqrt(before2) + limit) * slipped
            dissipated += lost
            work[p] += lost
            slip[p] += slipped
            sx, sy, sz = keep * sx, keep * sy, keep * sz
            # The anchor that leaves just this much of the spring.
            anchor[p, 0], anchor[p, 1], anchor[p, 2] = anchor_of(
                sx,
                sy,
                sz,
                x[n, 0] - height * nx,
                x[n, 1] - height * ny,
                x[n, 2] - height * nz,
                nx,
                ny,
                nz,
                x,
                a,
                b,
                c,
            )
        tx, ty, tz = -kt * sx, -kt * sy, -kt * sz
        shear[p, 0], shear[p, 1], shear[p, 2] = tx, ty, tz

        fx, fy, fz = N * nx + tx, N * ny + ty, N * nz + tz
        add_force(f, n, corner, corner_weight, fx, fy, fz)
        # Couple height x friction as normal forces on the facet: h_i = height grad N_i . T.
        ux, uy, uz = facet_normal(x, a, b, c)
        e1x, e1y, e1z = x[b, 0] - x[a, 0], x[b, 1] - x[a, 1], x[b, 2] - x[a, 2]
        e2x, e2y, e2z = x[c, 0] - x[a, 0], x[c, 1] - x[a, 1], x[c, 2] - x[a, 2]
        twice = (
            ux * (e1y * e2z - e1z * e2y)
            + uy * (e1z * e2x - e1x * e2z)
            + uz * (e1x * e2y - e1y * e2x)
        )
        # Less what is across the facet, along the normal, where that is of an edge or vertex.
        tilt = (tx * ux + ty * uy + tz * uz) / (nx * ux + ny * uy + nz * uz)
        tx, ty, tz = tx - tilt * nx, ty - tilt * ny, tz - tilt * nz
        # grad N_b = (e2 x n)/2A and grad N_c = (n x e1)/2A
        cx, cy, cz = e2y * uz - e2z * uy, e2z * ux - e2x * uz, e2x * uy - e2y * ux
        hb = height / twice * (tx * cx + ty * cy + tz * cz)
        cx, cy, cz = uy * e1z - uz * e1y, uz * e1x - ux * e1z, ux * e1y - uy * e1x
        hc = height / twice * (tx * cx + ty * cy + tz * cz)
        ha = -hb - hc
        f[a, 0] += ha * nx - wa * fx
        f[a, 1] += ha * ny - wa * fy
        f[a, 2] += ha * nz - wa * fz
        f[b, 0] += hb * nx - wb * fx
        f[b, 1] += hb * ny - wb * fy
        f[b, 2] += hb * nz - wb * fz
        f[c, 0] += hc * nx - wc * fx
        f[c, 1] += hc * ny - wc * fy
        f[c, 2] += hc * nz - wc * fz
    return dissipated, num_adopted, num_deep, deepest


@numba.njit(cache=True)
def pair_energy(gap, offset, closed, stiffness, shear, node, ratio_of_node, largest_depth):
    """Energy stored in the springs of closed pairs [J], and their number."""
    energy, count = 0.0, 0
    for p in range(node.size):
        if closed[p]:
            count += 1
            t2 = shear[p, 0] ** 2 + shear[p, 1] ** 2 + shear[p, 2] ** 2
            energy += stored_energy(stiffness[p], offset[p] - gap[p], largest_depth)
            energy += 0.5 * t2 / (stiffness[p] * ratio_of_node[node[p]])
    return energy, count


@numba.njit(cache=True)
def add_pair_stiffness(y, q, x, margin, due, clock, node, first, candidate, closest, closed,
                       weights, normal, stiffness, facets, layer_of_node, layer_of_facet, area,
                       facet_area, ratio_of_node):  # fmt: skip
    """Add the springs of all pairs nearer than ``margin`` [m] times ``q`` to ``y``, in place.

    ``x`` are the positions. Sliding pairs count with their tangential spring: an upper
    bound. ``y`` and ``q`` have the shape of ``x``; others as in :func:`add_pair_forces`.
    """
    for p in range(node.size):
        if closest[p] < 0 or not (closed[p] or due[p] - clock < margin):
            continue
        n, t = node[p], candidate[closest[p]]
        kn = stiffness[p]
        if not closed[p]:
            share = _share(facet_area[n], x, facets[t, 0], facets[t, 1], facets[t, 2])
            kn = share * area[n] / (layer_of_node[n] + layer_of_facet[t])
        kt = kn * ratio_of_node[n]
        along = 0.0
        for i in range(3):
            along += normal[p, i] * (
                q[n, i]
                - weights[p, 0] * q[facets[t, 0], i]
                - weights[p, 1] * q[facets[t, 1], i]
                - weights[p, 2] * q[facets[t, 2], i]
            )
        for i in range(3):
            d = (
                q[n, i]
                - weights[p, 0] * q[facets[t, 0], i]
                - weights[p, 1] * q[facets[t, 1], i]
                - weights[p, 2] * q[facets[t, 2], i]
            )
            s = kt * d + (kn - kt) * along * normal[p, i]
            y[n, i] += s
            for m in range(3):
                y[facets[t, m], i] -= weights[p, m] * s
