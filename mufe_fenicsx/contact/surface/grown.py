"""The surface of a mesh that has grown: made anew for grains that changed, as before for others.

Nodes, facets and points stand grain after grain, and a growth leaves the order of the grains. So
what each grain has is one block of rows. Blocks of grains that stayed are those of before. Where
rows are numbers of other rows, these have moved on.
"""

from dataclasses import replace
from itertools import groupby

import numpy as np

from ...kernels.geometry.rings import rings
from .points import point_lists
from .surface import faces_of_cracks, own_surface

#: Fields of points that are rows of them, and no numbers of others.
OF_POINTS = (
    "grain_of_point", "body_of_point", "local_grain", "area", "layer", "facet_area", "depth",
    "curvature", "cell", "stands", "recess",
)  # fmt: skip


class Blocks:
    """Rows of one kind, a block a grain. Local.

    Args:
        order: Grains in the order of their rows.
        before, part: Grain of each row before, and of each row made anew, (num_rows,).
        anew: Whether the rows of a grain are made anew, shape (num_grains_global,).

    Attributes:
        grain: Of each row, shape (num_rows,).
        shift: What is added to the number of a row of each grain, shape (num_grains_global,).
    """

    def __init__(self, order, before, part, anew):
        grains = before, part
        count = [np.bincount(grain, minlength=anew.size) for grain in grains]
        first = np.zeros((2, anew.size), np.int64)
        for starts, grain in zip(first, grains, strict=True):
            begins = np.flatnonzero(np.diff(grain, prepend=-1))
            starts[grain[begins]] = begins
        count, first = (np.where(anew, new, old) for old, new in (count, first))
        order = order[count[order] > 0]
        self.shift = np.zeros(anew.size, np.int64)
        self.shift[order] = np.cumsum(count[order]) - count[order] - first[order]
        # Blocks one after another in the same source are copied together.
        self._slices = []
        for new, of in groupby(order, key=lambda grain: int(anew[grain])):
            one, *_, last = [*of] * 2
            self._slices.append((new, slice(first[one], first[last] + count[last])))
        self.grain = self.rows(before, part)

    def rows(self, before, part):
        """Rows from those of before and those made anew, which have the same shape. Local."""
        sources = before, part
        return np.concatenate([before[:0], *(sources[new][rows] for new, rows in self._slices)])

    def numbers(self, of, before, part):
        """The same where they are numbers of rows ``of`` another kind, or negative. Local."""
        numbers = self.rows(before, part)
        moved = of.shift[self.grain].astype(numbers.dtype)
        return np.where(numbers < 0, numbers, numbers + moved[:, None])


class GrownSurface:
    """The surface after a growth. Local.

    Args:
        mesh: The :class:`~mufe_fenicsx.mesh.GrainMesh` that has grown.
        x, on_mirror, mirror_normal: As of :func:`~.surface.own_surface`.
        before: :class:`~.surface.OwnSurface` of before.
        everything: Whether all of it is made anew.

    Attributes:
        own: The surface, :class:`~.surface.OwnSurface`.
        part: That of the grains which changed alone.
        facets: :class:`Blocks` of facets.
    """

    def __init__(self, mesh, x, on_mirror, mirror_normal, before, everything):
        self.before = before
        self._anew = anew = np.full(mesh.labels.size, everything)
        anew[mesh.grains[mesh.parted_grains]] = True
        if mesh.piece_of_cell is not None:
            piece = mesh.piece_of_cell[before.cell_of_facet]
            loose = before.body_of_facet != before.grain_of_facet + mesh.labels.size * piece
            anew[before.grain_of_facet[loose]] = True
        self.part = part = own_surface(mesh, x, on_mirror, mirror_normal, anew[mesh.grains])
        grains = before.grain_of_node, before.grain_of_facet
        self._orders = [grain[np.flatnonzero(np.diff(grain, prepend=-1))] for grain in grains]
        self._nodes = self._blocks(0, before.grain_of_node, part.grain_of_node)
        self.facets = self._blocks(1, before.grain_of_facet, part.grain_of_facet)
        own = self._merged(before, mesh.source.nodes)
        self.own = replace(own, cracks=faces_of_cracks(mesh, own.side, own.body_of_facet))

    def _blocks(self, kind, before, part):
        """Blocks of what stands in the order of nodes (0) or of facets (1)."""
        return Blocks(self._orders[kind], before, part, self._anew)

    def _merged(self, before, source):
        """The whole surface; ``source``: old node of each node of the mesh."""
        part, nodes, facets = self.part, self._nodes, self.facets
        now = np.zeros(source.max(initial=-1) + 1, np.int32)
        now[source] = np.arange(source.size)
        corners = facets.numbers(nodes, before.facets, part.facets)
        offset, ring = rings(corners, nodes.grain.size)
        return replace(
            part,
            nodes=nodes.rows(now[before.nodes], part.nodes),
            facets=corners,
            neighbour=facets.numbers(facets, before.neighbour, part.neighbour),
            ring_offset=offset,
            ring=ring,
            **_rows(nodes, before, part, "grain_of_node body_of_node area whole_area"),
            **_rows(
                facets, before, part, "grain_of_facet body_of_facet side facet_area facet_edge "
                "local_grain_of_facet cell_of_facet mirror sharp_edge",
            ),
        )  # fmt: skip

    def points(self, before, part):
        """:class:`~.points.Points` of it, from those of before and those of ``part``. Local."""
        sources, halves = (before, part), []
        for k, of_half in enumerate((in_facets, at_nodes)):
            rows = [of_half(of) for of in sources]
            grains = (of.grain_of_point[some] for of, some in zip(sources, rows, strict=True))
            halves.append((self._blocks(1 - k, *grains), rows))

        def joined(name, *of):
            parts = []
            for kind, rows in halves:
                both = [getattr(s, name)[some] for s, some in zip(sources, rows, strict=True)]
                parts.append(kind.numbers(*of, *both) if of else kind.rows(*both))
            return np.concatenate(parts)

        corner = joined("corner", self._nodes)
        num = halves[0][0].grain.size
        return replace(
            part,
            corner=corner,
            num_in_facets=num,
            **point_lists(self.own, corner[num:, 0], num),
            **{name: joined(name) for name in OF_POINTS},
        )


def in_facets(points):
    """Rows of those in facets."""
    return slice(0, points.num_in_facets)


def at_nodes(points):
    """Rows of those at nodes."""
    return slice(points.num_in_facets, None)


def _rows(blocks, before, part, names):
    """Fields of both with the rows of ``blocks``, by name. Local."""
    return {name: blocks.rows(getattr(before, name), getattr(part, name)) for name in names.split()}
