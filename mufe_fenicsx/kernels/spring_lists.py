"""Springs of contact written one after another into a list, as `kernels.springs` wants them."""

import numba


@numba.njit(cache=True)
def list_pairs(
    nodes, share, normal, kn, kt, on, point_of_pair, candidate, closest, facets, x, weights,
    normals, closed, stiffness, facet_area, area, layer, layer_of_facet, ratio,
):  # fmt: skip
    """Springs of pairs of points and facets.

    Args:
        nodes, share, normal, kn, kt: The list, one row for each entry of ``on``, in place; of the
            nodes and their shares the last three, those of the facets.
        on: Pairs to be listed.
        point_of_pair, candidate, closest: Point of each pair; facets that pairs may meet, and
            which of them each pair has.
        facets: Nodes of each facet, shape (num_facets, 3).
        x: Positions [m] of these nodes.
        weights, normals, closed, stiffness: Of all pairs: barycentric weights, normal, whether
            in contact, and stiffness then [N/m].
        facet_area, area, layer, ratio: Of points: area of the facet and of the point [m²], its
            layer [m³/N], tangential over normal stiffness.
        layer_of_facet: [m³/N].
    """
    for p in range(on.size):
        pair = on[p]
        point, facet = point_of_pair[pair], candidate[closest[pair]]
        for m in range(3):
            nodes[p, 3 + m], share[p, 3 + m] = facets[facet, m], -weights[pair, m]
            normal[p, m] = normals[pair, m]
        if closed[pair]:
            kn[p] = stiffness[pair]
        else:
            # As pairs.c shares a contact between both sides when it closes.
            a, b, c = facets[facet, 0], facets[facet, 1], facets[facet, 2]
            square = 0.0
            for m in range(3):
                i, j = (m + 1) % 3, (m + 2) % 3
                cross = (x[b, i] - x[a, i]) * (x[c, j] - x[a, j]) - (x[b, j] - x[a, j]) * (
                    x[c, i] - x[a, i]
                )
                square += cross * cross
            other = 0.25 * square  # area of the facet, squared
            part = other / (other + facet_area[point] ** 2)
            kn[p] = part * area[point] / (layer[point] + layer_of_facet[facet])
        kt[p] = kn[p] * ratio[point]


@numba.njit(cache=True)
def list_walls(normal, kn, kt, on, point_of_pair, wall_of_pair, normals, area, layer, ratio):
    """Springs of points and walls; arguments as of :func:`list_pairs`, ``normals`` of walls."""
    for p in range(on.size):
        point, wall = point_of_pair[on[p]], wall_of_pair[on[p]]
        for m in range(3):
            normal[p, m] = normals[wall, m]
        kn[p] = area[point] / layer[point]
        kt[p] = kn[p] * ratio[point]
