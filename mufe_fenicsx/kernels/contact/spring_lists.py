"""Springs of contact written one after another into a list, for `kernels.contact.springs`."""

import numba


@numba.njit(cache=True)
def list_pairs(
    nodes, share, normal, kn, kt, on, point_of_pair, candidate, closest, facets, weights,
    normals, closed, stiffness, area_at_point, area_of_facet, area, layer, layer_of_facet, ratio,
):  # fmt: skip
    """Springs of pairs of points and facets.

    Args:
        nodes, share, normal, kn, kt: The list, one row for each entry of ``on``, in place; of the
            nodes and their shares the last three, those of the facets.
        on: Pairs to be listed.
        point_of_pair, candidate, closest: Point of each pair; facets that pairs may meet, and
            which of them each pair has.
        facets: Nodes of each facet, shape (num_facets, 3).
        weights, normals, closed, stiffness: Of all pairs: barycentric weights, normal, whether
            in contact, and stiffness then [N/m].
        area_at_point, area, layer, ratio: Of points: area of the facet and of the point [m²], its
            layer [m³/N], tangential over normal stiffness.
        area_of_facet, layer_of_facet: Of facets [m²], [m³/N].
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
            # As stiffness_of in pairs.h.
            other = area_of_facet[facet] ** 2
            part = other / (other + area_at_point[point] ** 2)
            kn[p] = part * area[point] / (layer[point] + layer_of_facet[facet])
        kt[p] = kn[p] * ratio[point]
