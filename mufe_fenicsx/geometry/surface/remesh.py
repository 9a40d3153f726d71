"""Even triangles on a closed surface: clustering, then short edges and flat triangles removed."""

import contextlib
import io
import itertools
import warnings

import numpy as np
import pyacvd
import pyvista

from ..measure import compact, surface_defect, surface_volume
from ..pieces import piece_of_cell
from .creases import Creases
from .shells import shells
from .sizing import FEWEST_NODES


class SurfaceError(RuntimeError):
    """No usable surface came out: what is wrong with it."""


class SurfaceTooSmall(SurfaceError):
    """A surface takes too few triangles of the wanted size.

    Args:
        nodes: Nodes that it takes.
    """

    def __init__(self, nodes):
        super().__init__(
            f"grain is too small: its surface takes {2 * nodes:.0f} triangles of the wanted "
            f"size, expected at least {2 * FEWEST_NODES}"
        )
        #: Times the wanted size that would be small enough.
        self.factor = 0.99 * (nodes / FEWEST_NODES) ** 0.5


def remesh(points, triangles, sizes):
    """Triangles of the wanted size on a surface, by centroidal clusters (pyacvd).

    Clusters across a thin part of a surface can give edges with more than two
    triangles; other numbers of clusters are tried then.

    Args:
        points, triangles: The surface.
        sizes: `Sizes`, the wanted length of edges.

    Source: S. Valette, J.-M. Chassery, Computer Graphics Forum 23 (2004) 381-389.

    Raises:
        SurfaceTooSmall: the surface takes too few triangles of this size.
        SurfaceError: no closed surface came out.
    """
    wanted = nodes_wanted(points, triangles, sizes)
    with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
        warnings.simplefilter("ignore")
        clusters = pyacvd.Clustering(pyvista.PolyData.from_regular_faces(points, triangles))
        while clusters.mesh.n_points < 15 * wanted:
            clusters.subdivide(1)
        if not sizes.even:
            # Clusters of equal weight: the weight of an area is the number of nodes it takes.
            weight = sizes.size**2 / sizes(np.asarray(clusters.mesh.points, dtype=float)) ** 2
            clusters.area, clusters.wcent = clusters.area * weight, clusters.wcent * weight[:, None]
        for factor in (1.0, 1.04, 0.96, 1.1, 1.2):
            clusters.cluster(round(factor * wanted))
            result = clusters.create_mesh(moveclus=False, flipnorm=False)
            vertices, faces = np.array(result.points, dtype=float), np.array(result.regular_faces)
            if len(faces) == 0:
                continue
            faces = closed(without_fins(faces.astype(np.int64)))
            vertices, faces = largest_surface(vertices, faces)
            faces = oriented(vertices, faces)
            defect = surface_defect(vertices, faces)
            if not defect:
                return vertices, faces
    raise SurfaceError(f"remeshed surface has {defect}")


def with_cavities(points, triangles, tags, sizes, remesh_outer):
    """Remeshed outer surface, whose triangles have tags, and cavities, which have none (0).

    Args:
        points, triangles, tags: The surface and its cavities.
        sizes: `Sizes`, the wanted length of edges.
        remesh_outer: Called with points, triangles, tags and sizes; returns these three anew.

    Raises:
        SurfaceError: as of ``remesh_outer`` and `remesh`.
    """
    part, depth, _ = shells(points, triangles)
    outer = depth[part] == 0
    x, faces, new_tags = remesh_outer(*compact(points, triangles[outer]), tags[outer], sizes)
    found = [(x, faces)]
    for p in np.flatnonzero(depth == 1):
        own = compact(points, triangles[part == p])
        try:
            y, inner = remesh(*own, sizes)
        except SurfaceTooSmall as error:
            y, inner = remesh(*own, sizes.times(error.factor))
        # Seen from outside now as the outer one is; a cavity is seen the other way round.
        found.append((y, inner[:, ::-1]))
    num_faces = [len(faces) for _, faces in found]
    first = np.cumsum([0] + [len(x) for x, _ in found])
    return (
        np.concatenate([x for x, _ in found]),
        np.concatenate([faces + n for (_, faces), n in zip(found, first, strict=False)]),
        np.concatenate([new_tags, np.zeros(sum(num_faces[1:]), dtype=np.int64)]),
    )


def num_nodes(points, triangles, sizes):
    """Nodes that a surface takes where each stands for a hexagon of the wanted size."""
    x = points[triangles]
    area = np.linalg.norm(np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]), axis=1) / 2
    return float((area / sizes(x.mean(axis=1)) ** 2).sum() * 2 / np.sqrt(3))


def nodes_wanted(points, triangles, sizes):
    """The same, where they are enough for a body.

    Raises:
        SurfaceTooSmall: they are not.
    """
    wanted = num_nodes(points, triangles, sizes)
    if wanted < FEWEST_NODES:
        raise SurfaceTooSmall(wanted)
    return wanted


def without_fins(triangles):
    """Triangles without those that stick out of the surface.

    Fins are pairs back to back on the same three vertices, and triangles that
    have an open edge and hang on an edge with more than two triangles.
    """
    _, number, count = np.unique(
        np.sort(triangles, axis=1), axis=0, return_inverse=True, return_counts=True
    )
    triangles = triangles[count[number.ravel()] == 1]
    while True:
        edges = np.sort(np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2), axis=2)
        _, number, count = np.unique(
            edges.reshape(-1, 2), axis=0, return_inverse=True, return_counts=True
        )
        count = count[number.ravel()].reshape(-1, 3)
        fin = (count == 1).any(axis=1) & (count > 2).any(axis=1)
        if not fin.any():
            return triangles
        triangles = triangles[~fin]


def closed(triangles, longest=6):
    """Triangles with holes of up to ``longest`` edges filled."""
    edges = np.sort(np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2), axis=2)
    edges, count = np.unique(edges.reshape(-1, 2), axis=0, return_counts=True)
    around = {}
    for a, b in edges[count == 1].tolist():
        around.setdefault(a, []).append(b)
        around.setdefault(b, []).append(a)
    new = []
    while around:
        loop = [next(iter(around))]
        while around.get(loop[-1]):
            following = around[loop[-1]].pop()
            around[following].remove(loop[-1])
            if following == loop[0]:
                break
            loop.append(following)
        around = {vertex: others for vertex, others in around.items() if others}
        if 3 <= len(loop) <= longest:
            new += [(loop[0], b, c) for b, c in itertools.pairwise(loop[1:])]
    return np.concatenate([triangles, np.array(new, dtype=np.int64)]) if new else triangles


def oriented(points, triangles):
    """Triangles turned so that neighbours agree and the body is seen from outside.

    Edges with other than two triangles are not crossed. The surface of a cavity lies inside that
    of the body, and is seen from the cavity.
    """
    defect = surface_defect(points, triangles)
    if not defect and piece_of_cell(triangles).max() == 0:
        return triangles
    if defect == "inside out" and piece_of_cell(triangles).max() == 0:
        return np.ascontiguousarray(triangles[:, ::-1])
    at_edge = {}
    for t, (a, b, c) in enumerate(triangles.tolist()):
        for edge in ((a, b), (b, c), (c, a)):
            at_edge.setdefault((min(edge), max(edge)), []).append((t, edge[0] < edge[1]))
    neighbours = [[] for _ in triangles]
    for sides in at_edge.values():
        if len(sides) == 2:
            (s, forward_s), (t, forward_t) = sides
            neighbours[s].append((t, forward_s == forward_t))
            neighbours[t].append((s, forward_s == forward_t))
    turn = np.zeros(len(triangles), dtype=bool)
    part = np.full(len(triangles), -1)
    for first in range(len(triangles)):
        if part[first] >= 0:
            continue
        part[first], stack = first, [first]
        while stack:
            s = stack.pop()
            for t, differ in neighbours[s]:
                if part[t] < 0:
                    part[t], turn[t] = first, turn[s] ^ differ
                    stack.append(t)
    result = np.where(turn[:, None], triangles[:, ::-1], triangles)
    shell, depth, _ = shells(points, result)
    for first in np.unique(part):
        own = part == first
        inward = depth[shell[first]] % 2
        if (surface_volume(points, result[own]) < 0) != inward:
            result[own] = result[own][:, ::-1]
    return result


def largest_surface(points, triangles):
    """The connected part that encloses the largest volume; pores inside go."""
    return compact(points, triangles[in_largest_surface(points, triangles)])


def in_largest_surface(points, triangles):
    """True for the triangles of the connected part that encloses the largest volume."""
    piece = piece_of_cell(triangles)
    volumes = [
        abs(surface_volume(points, triangles[piece == p])) for p in range(piece.max(initial=0) + 1)
    ]
    return piece == np.argmax(volumes)


def collapse_short_edges(points, triangles, shortest, sizes, tags=None):
    """Shrink edges shorter than ``shortest`` to their middle; the surface stays closed.

    Edges between faces, triangles of different tags, stay: their nodes move along them only, and
    their ends, where they meet others, do not move.

    Args:
        points, triangles: A closed surface.
        shortest: Least length of edges, times ``sizes``.
        sizes: `Sizes`.
        tags: Face that each triangle belongs to, or None.

    Returns:
        points, triangles; and tags if they were given.
    """
    given = tags is not None
    points, triangles, stuck = points.copy(), triangles.copy(), set()
    tags = tags if given else np.zeros(len(triangles), dtype=np.int64)
    while True:
        start, end = _edges(triangles)
        length = _relative_length(points, start, end, sizes)
        creases = Creases(triangles, tags, len(points)) if given else None
        for i in np.argsort(length):
            if length[i] >= shortest:
                return (*compact(points, triangles), tags)[: 2 + given]
            keep, gone = int(start[i]), int(end[i])
            if (keep, gone) in stuck:
                continue
            weight = 0.5 if creases is None else creases.weight(keep, gone)
            if weight is not None:
                place = weight * points[keep] + (1 - weight) * points[gone]
                if len(triangles) > 8 and _may_collapse(points, triangles, keep, gone, place):
                    break
            stuck.add((keep, gone))
        else:
            return (*compact(points, triangles), tags)[: 2 + given]
        points[keep] = place
        triangles[triangles == gone] = keep
        a, b, c = triangles.T
        whole = (a != b) & (b != c) & (c != a)
        triangles, tags = triangles[whole], tags[whole]


def split_long_edges(points, triangles, longest, sizes, tags=None):
    """Halve edges longer than ``longest * sizes``, the longest first; the surface stays closed.

    Returns:
        points, triangles; and the tags of the triangles if they were given.
    """
    points, triangles = list(points), [tuple(t) for t in triangles.tolist()]
    given = tags is not None
    tags = tags.tolist() if given else [0] * len(triangles)
    while True:
        x = np.asarray(points)
        start, end = _edges(np.asarray(triangles))
        length = _relative_length(x, start, end, sizes)
        changed = set()
        for i in np.argsort(-length):
            if length[i] <= longest:
                break
            a, b = int(start[i]), int(end[i])
            sides = [k for k, t in enumerate(triangles) if a in t and b in t]
            if any(v in changed for k in sides for v in triangles[k]):
                continue
            for k in sides:
                t = triangles[k]
                changed.update(t)
                triangles[k] = tuple(len(points) if v == a else v for v in t)
                triangles.append(tuple(len(points) if v == b else v for v in t))
                tags.append(tags[k])
            points.append((points[a] + points[b]) / 2)
        if not changed:
            return (np.asarray(points), np.asarray(triangles), np.asarray(tags))[: 2 + given]


def flip_long_edges(points, triangles, flat=0.6, passes=20, tags=None):
    """Flip edges where that makes the flatter of their two triangles less flat.

    Args:
        points, triangles: A surface, which may be open.
        flat: Triangles of less than this flatness are tried, 1 being equilateral.
        passes: Over these triangles at most.
        tags: Face that each triangle belongs to, or None; edges between faces stay.
    """
    taken = set()  # edges (start < end) that flips have made, which none makes again
    triangles = triangles.copy()
    for _ in range(passes):
        shape = _flatness(points, triangles)
        corner_across = {}
        for t, (a, b, c) in enumerate(triangles.tolist()):
            corner_across[a, b], corner_across[b, c], corner_across[c, a] = (t, c), (t, a), (t, b)
        # One pass flips edges that have no vertex in common.
        touched = np.zeros(len(points), dtype=bool)
        for t in np.argsort(shape)[: np.count_nonzero(shape < flat)]:
            if touched[triangles[t]].any():
                continue
            flip = _best_flip(points, triangles, t, shape, corner_across, taken, tags)
            if flip is not None and not touched[flip[1]].any():
                (first, second), new = flip
                taken.add((min(new[0, 1:]), max(new[0, 1:])))
                triangles[first], triangles[second] = new
                touched[new] = True
        if not touched.any():
            break
    return triangles


def _best_flip(points, triangles, t, shape, corner_across, taken, tags):
    """The two triangles to exchange and what for; None if no flip of triangle t helps."""
    best, gain = None, 1.05
    for i in range(3):
        a, b, c = np.roll(triangles[t], -i).tolist()
        other, d = corner_across.get((b, a), (-1, -1))
        if other < 0 or (c, d) in corner_across or (d, c) in corner_across:
            continue
        if (min(c, d), max(c, d)) in taken:
            continue
        if tags is not None and tags[t] != tags[other]:
            continue
        new = np.array([[a, d, c], [d, b, c]])
        # The surface may neither fold nor leave its shape: normals stay close.
        old_normals = _normals(points, triangles[[t, other]])
        if (_normals(points, new) @ old_normals.T).min() < 0.75:
            continue
        quotient = _flatness(points, new).min() / max(min(shape[t], shape[other]), 1e-9)
        if quotient > gain:
            best, gain = ((t, other), new), quotient
    return best


def _edges(triangles):
    """Ends of each edge once, start < end."""
    pairs = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    return np.unique(np.sort(pairs, axis=1), axis=0).T


def _relative_length(points, start, end, sizes):
    """Lengths of edges over the wanted ones at their middles."""
    length = np.linalg.norm(points[end] - points[start], axis=1)
    return length / sizes((points[start] + points[end]) / 2)


def _may_collapse(points, triangles, keep, gone, place):
    """Whether an edge may shrink to a place.

    Its ends have to share exactly the two corners opposite to it (link
    condition), and no triangle may turn over.
    """

    def neighbours(v):
        return set(triangles[(triangles == v).any(axis=1)].ravel()) - {v}

    shared = neighbours(keep) & neighbours(gone)
    if len(shared) != 2:
        return False
    # Neither corner may be left with two triangles only.
    if any(np.count_nonzero(triangles == v) <= 3 for v in shared):
        return False
    has_keep, has_gone = (triangles == keep).any(axis=1), (triangles == gone).any(axis=1)
    around = triangles[has_keep ^ has_gone]
    moved = points.copy()
    moved[[keep, gone]] = place
    return bool(((_normals(points, around) * _normals(moved, around)).sum(axis=1) > 0.5).all())


def _normals(points, triangles):
    x = points[triangles]
    normal = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
    return normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)


def _flatness(points, triangles):
    """Smallest altitude over longest edge, 1 for an equilateral triangle."""
    x = points[triangles]
    longest = ((x - np.roll(x, -1, axis=1)) ** 2).sum(axis=2).max(axis=1)
    area2 = np.linalg.norm(np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]), axis=1)
    return area2 / np.maximum(longest, 1e-300) * 2 / np.sqrt(3)
