"""What ranks know of each other's surfaces, counted for any number of ranks in one process."""

import time

import numpy as np

from ...contact.laws import edge_of_area
from ...contact.pairs.relative_motion import SKIN
from ...contact.surface.exchange import with_rings
from ...contact.surface.occupancy import occupied_cells
from ...geometry.grains import load_grains
from ...geometry.measure import boundary_triangles
from ...mesh import partition_grains
from ..family import SIZE, member
from .launch import case_of, row

#: Bytes of a ghost node in a step at most: its position comes, the force on it goes back.
PER_GHOST = 2 * 3 * 8
#: Largest part of the ghosts that boxes of ranks alone would give, on 64 ranks.
TARGET_PART = 0.5


def exchange(parameters):
    """Ghost nodes of a rank and what they cost, for several numbers of ranks.

    The facets that ranks would send each other by `contact.search`, for a part of the benchmark
    family, and for comparison those that overlap the box around the other rank's surface.

    Parameters: ``cache``, ``size``, ``grains`` (see `family.member`); ``folder``, grains of one's
    own instead; ``ranks``, numbers of ranks with commas between.
    """
    folder = parameters.pop("folder", None)
    cache, size = str(parameters.pop("cache", "bench-cache")), float(parameters.pop("size", SIZE))
    number = int(parameters.pop("grains", 630))
    counts = [int(n) for n in str(parameters.pop("ranks", "2,4,16,64")).split(",")]
    grains = load_grains(folder or member(cache, number, size) / "grains")
    bodies = [_surface(*grains.grain(g)) for g in range(grains.num_grains)]
    weights, centres = np.diff(grains.cell_offset), grains.centroids
    _count(bodies[:2], np.arange(2), 2)  # kernels are compiled
    results = {"num_cells": {"computed": int(weights.sum())}}
    for num_ranks in counts:
        found = _count(bodies, partition_grains(weights, centres, num_ranks), num_ranks)
        for name, value in found.items():
            results[f"{name}_{num_ranks}_ranks"] = {"computed": value}
    name = f"part_of_boxes_{max(counts)}_ranks"
    part = results[name]["computed"]
    results[name] = row(part, TARGET_PART, part <= TARGET_PART)
    given = {"folder": folder} if folder else {"cache": cache, "size": size, "grains": number}
    return case_of("exchange", given | {"ranks": ",".join(map(str, counts))}, results)


def _surface(points, cells):
    """Nodes on the surface of a body and its facets."""
    facets = boundary_triangles(cells)
    nodes, facets = np.unique(facets, return_inverse=True)
    return points[nodes], facets.reshape(-1, 3)


def _count(bodies, rank_of_grain, num_ranks):
    """Means and largest values over the ranks."""
    surfaces = [
        _joined([bodies[g] for g in np.flatnonzero(rank_of_grain == r)]) for r in range(num_ranks)
    ]
    area = np.concatenate([_areas(x, facets) for x, facets in surfaces])
    reach = SKIN * edge_of_area(area.mean(), 1)
    boxes = [_boxes(x, facets) for x, facets in surfaces]
    start = time.perf_counter()
    cells = [occupied_cells(low, high) for low, high in boxes]
    told = np.zeros(num_ranks)  # bytes that each rank tells others of its cells
    ghosts, by_boxes, neighbours, sources = np.zeros((4, num_ranks))
    spent = time.perf_counter() - start
    for r in range(num_ranks):
        low, high = (f(b, axis=0) for f, b in zip((np.min, np.max), boxes[r], strict=True))
        for q in range(num_ranks):
            inside = ((boxes[q][0] - reach <= high) & (boxes[q][1] + reach >= low)).all(axis=1)
            if q == r or not _overlap(boxes[r], boxes[q], reach):
                continue
            start = time.perf_counter()
            other = boxes[q][0].min(axis=0) - reach, boxes[q][1].max(axis=0) + reach
            part = cells[r].within(*other)
            near = part.near(*boxes[q], reach)
            told[r] += part.packed().size
            spent += time.perf_counter() - start
            new = _nodes(surfaces[q], near)
            neighbours[r] += 1
            sources[r] += new > 0
            ghosts[r] += new
            by_boxes[r] += _nodes(surfaces[q], inside)
    return {
        "nodes": float(np.mean([len(x) for x, _ in surfaces])),
        "ghosts": float(ghosts.mean()),
        "ghosts_largest": int(ghosts.max()),
        "ghosts_by_boxes": float(by_boxes.mean()),
        "part_of_boxes": float(ghosts.sum() / max(by_boxes.sum(), 1)),
        "bytes_per_step": float(PER_GHOST * ghosts.mean()),
        "bytes_per_step_largest": float(PER_GHOST * ghosts.max()),
        "neighbours_largest": int(neighbours.max()),
        "sources_largest": int(sources.max()),
        "bytes_of_cells": float(told.mean()),
        "selection_s": spent / num_ranks,
    }


def _joined(bodies):
    first = np.cumsum([0] + [len(x) for x, _ in bodies])
    facets = [f + n for (_, f), n in zip(bodies, first, strict=False)]
    return np.concatenate([x for x, _ in bodies]), np.concatenate(facets)


def _areas(x, facets):
    a, b, c = (x[facets[:, i]] for i in range(3))
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)


def _boxes(x, facets):
    corners = x[facets]
    return corners.min(axis=1), corners.max(axis=1)


def _overlap(one, other, reach):
    apart = np.maximum(
        one[0].min(axis=0) - other[1].max(axis=0), other[0].min(axis=0) - one[1].max(axis=0)
    )
    return apart.max() <= reach


def _nodes(surface, near):
    """Nodes that travel with the facets ``near``."""
    x, facets = surface
    return np.unique(facets[with_rings(facets, near, len(x))]).size
