"""One DOLFINx mesh of all grains, each grain whole on one rank."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import basix.ufl
import numpy as np
from dolfinx import fem, graph, mesh
from mpi4py import MPI
from numpy.typing import ArrayLike
from petsc4py import PETSc  # noqa: F401  starts it, and with it its handlers of signals

from .errors import raise_on_broken_pipes, raise_together
from .kernels.geometry.topology import (
    body_defect,
    boundary_sides,
    inner_facets,
    nodes_of_sides,
    number_pieces,
    part_nodes,
    rows_of,
)
from .machine.notebook import html_table
from .units import with_unit

raise_on_broken_pipes()

#: An element with less volume than this times the cube of its longest edge has none.
FLAT = 1e-9


def partition_grains(weights: ArrayLike, centroids: ArrayLike, num_ranks: int) -> np.ndarray:
    """Rank of each grain by weighted recursive coordinate bisection.

    The longest side of the grains' bounding box is cut where the weights divide
    in proportion to the ranks on both sides. Every rank receives a grain. The
    same on every rank, without communication.

    Args:
        weights: Work of the grains, e.g. their numbers of cells, shape (num_grains,).
        centroids: Their centres [m], shape (num_grains, 3).
        num_ranks: Number of ranks, at most the number of grains.

    Returns:
        rank_of_grain, shape (num_grains,).

    Raises:
        ValueError: More ranks than grains.
    """
    weights, centroids = np.asarray(weights, float), np.asarray(centroids, float)
    if num_ranks > weights.size:
        raise ValueError(
            f"number of ranks = {num_ranks}, expected at most the number of grains, {weights.size}"
        )
    rank_of_grain = np.empty(weights.size, dtype=np.int32)
    parts = [(np.arange(weights.size), 0, num_ranks)]
    while parts:
        grains, first, count = parts.pop()
        if count == 1:
            rank_of_grain[grains] = first
            continue
        left = count // 2
        axis = np.argmax(np.ptp(centroids[grains], axis=0))
        grains = grains[np.argsort(centroids[grains, axis], kind="stable")]
        done = np.cumsum(weights[grains])
        cut = 1 + int(np.argmin(np.abs(done - done[-1] * left / count)))
        cut = min(max(cut, left), grains.size - (count - left))
        parts.append((grains[:cut], first, left))
        parts.append((grains[cut:], first + left, count - left))
    return rank_of_grain


class View(NamedTuple):
    """The DOLFINx mesh of one version of a :class:`GrainMesh`, without ghosts."""

    mesh: mesh.Mesh  #: the DOLFINx mesh
    V: fem.FunctionSpace  #: continuous piecewise linear vectors
    cell_order: np.ndarray  #: DOLFINx cell of each row of ``cells``, shape (num_cells,)
    node_of_dof: np.ndarray  #: node at each degree of freedom of ``V``, shape (num_nodes,)


class Source(NamedTuple):
    """Rows that those of a grown mesh come from, in the mesh before; rows of cells stay."""

    nodes: np.ndarray  #: old node of each node, shape (num_nodes,)
    facets: np.ndarray  #: old facet of each facet, -1 of those that opened, shape (num_facets,)


@dataclass(frozen=True)
class GrainMesh:
    """Grains of this rank as part of one distributed mesh. All arrays are local.

    Build it with :func:`create_grain_mesh`; :meth:`grow` opens facets. The nodes of a grain have
    numbers in a row. Those of version 0 are numbered as the degrees of freedom of ``V``.
    """

    comm: MPI.Intracomm  #: communicator of the mesh
    labels: np.ndarray  #: labels of the grains of all ranks, shape (num_grains_global,)
    rank_of_grain: np.ndarray  #: their ranks, shape (num_grains_global,)
    grains: np.ndarray  #: indices into ``labels`` of this rank's grains, shape (num_grains,)
    x: np.ndarray  #: reference positions of nodes [m], shape (num_nodes, 3)
    cells: np.ndarray  #: nodes of cells, grain after grain, int32, shape (num_cells, 4)
    cell_offset: np.ndarray  #: first row of each grain, shape (num_grains + 1,)
    nodes: np.ndarray  #: nodes, grain after grain, int32, shape (num_nodes,)
    node_offset: np.ndarray  #: first entry of each grain, shape (num_grains + 1,)
    grain_of_node: np.ndarray  #: local grain of each node, int32, shape (num_nodes,)
    facets: np.ndarray  #: nodes of boundary facets, outward, int32, shape (num_facets, 3)
    grain_of_facet: np.ndarray  #: local grain of each facet, shape (num_facets,)
    #: Side of a cell that each facet is, 4 c + i across from corner i of cell c, increasing.
    side_of_facet: np.ndarray
    cylinder: np.ndarray | None = None  #: that cut the grains: x, y, radius [m], shape (3,)
    sleeves: tuple[str, ...] = ()  #: names of bodies after the grains in ``labels``, around them
    tools: tuple[str, ...] = ()  #: names of the last of ``labels``, which are tools and no grains
    first_view: View | None = None  #: of version 0, whose communicator all versions have
    first_node: int = 0  #: number of this rank's first node among those of all ranks
    #: ``named_nodes`` and ``named_cells``; None: as they were given to ``view``.
    named: tuple[np.ndarray, np.ndarray] | None = None
    version: int = 0  #: how often the mesh has grown, the same on all ranks
    source: Source | None = None  #: rows of the version before; None at version 0
    origin: np.ndarray | None = None  #: node of version 0 of each node, (num_nodes,); as source
    #: What was opened so far: rows (cell, cell across, version that the facet opened in).
    opened: list[np.ndarray] = field(default_factory=list)
    #: Number of the piece of its grain that each cell is in, int32; None: all grains are whole.
    #: Of a piece that parts, what has most cells keeps the number, and others get the next ones.
    piece_of_cell: np.ndarray | None = None

    def _repr_html_(self) -> str:
        """Counts and size of this rank's part in a short table, which notebooks show. Local."""
        size = np.ptp(self.x, axis=0)
        where = "" if self.comm.size == 1 else f" of {self.labels.size}, on this rank"
        return html_table(
            "Mesh of grains",
            [
                ("grains", f"{self.num_grains}{where}"),
                ("tetrahedra", self.num_cells),
                ("nodes", self.num_nodes),
                ("facets of the surface", len(self.facets)),
                ("size", " × ".join(with_unit(length, "m") for length in size)),
                ("ranks", self.comm.size),
            ],
        )

    @cached_property
    def view(self) -> View:
        """The DOLFINx mesh of this version, made when it is first asked for. Collective then."""
        if self.version == 0 and self.first_view is not None:
            return self.first_view
        first_cell = self.comm.exscan(self.num_cells) or 0
        domain = _create_domain(self.comm, self.x, self.cells.astype(np.int64) + self.first_node)
        V = _vectors_on(domain)
        cell_order = np.empty(self.num_cells, dtype=np.int32)
        cell_order[domain.topology.original_cell_index - first_cell] = np.arange(self.num_cells)
        node_of_dof = np.empty(self.num_nodes, dtype=np.int32)
        node_of_dof[V.dofmap.list] = _given_nodes(domain) - self.first_node
        return View(domain, V, cell_order, node_of_dof)

    @property
    def mesh(self) -> mesh.Mesh:
        """The DOLFINx mesh of :attr:`view`."""
        return self.view.mesh

    @property
    def V(self) -> fem.FunctionSpace:
        """Continuous piecewise linear vectors on :attr:`view`."""
        return self.view.V

    @property
    def cell_order(self) -> np.ndarray:
        """DOLFINx cell of each row of ``cells``, shape (num_cells,)."""
        return self.view.cell_order

    @property
    def node_of_dof(self) -> np.ndarray:
        """Node at each degree of freedom of ``V``, shape (num_nodes,)."""
        return self.view.node_of_dof

    @property
    def num_cells(self) -> int:
        """Cells on this rank."""
        return self.cells.shape[0]

    @property
    def num_nodes(self) -> int:
        """Nodes on this rank."""
        return self.x.shape[0]

    @property
    def num_grains(self) -> int:
        """Grains on this rank."""
        return self.grains.size

    @property
    def num_sample_grains(self) -> int:
        """Grains of the sample on all ranks: the first of ``labels``, before sleeves and tools."""
        return self.labels.size - len(self.sleeves) - len(self.tools)

    @property
    def labels_of_sleeves(self) -> list[int]:
        """Labels of the sleeves, in their order."""
        return self.labels[self.num_sample_grains : self.first_tool].tolist()

    @property
    def first_tool(self) -> int:
        """Index into ``labels`` of the first tool, their size where there is none."""
        return self.labels.size - len(self.tools)

    @cached_property
    def is_tool(self) -> np.ndarray:
        """Whether each grain of this rank is a tool, shape (num_grains,)."""
        return self.grains >= self.first_tool

    @cached_property
    def is_of_sample(self) -> np.ndarray:
        """Whether each body of this rank is a grain, no sleeve and no tool, shape (num_grains,)."""
        return self.grains < self.num_sample_grains

    @property
    def num_sample_cells(self) -> int:
        """Cells of this rank's grains: those of sleeves and tools are the last of ``cells``."""
        return int(self.cell_offset[np.count_nonzero(self.is_of_sample)])

    @cached_property
    def sample_nodes(self) -> np.ndarray:
        """Nodes of this rank's grains, those of sleeves and tools left out, increasing."""
        return np.flatnonzero(self.is_of_sample[self.grain_of_node])

    @property
    def num_shown_cells(self) -> int:
        """Cells in the fields, of grains and sleeves: those of tools are the last of ``cells``."""
        return int(self.cell_offset[np.count_nonzero(~self.is_tool)])

    @cached_property
    def shown_nodes(self) -> np.ndarray:
        """Nodes in the fields, of this rank's grains and sleeves, increasing."""
        return np.flatnonzero(~self.is_tool[self.grain_of_node])

    def name_of(self, grain: int) -> str:
        """What messages call a grain, by its index into ``labels``."""
        if grain >= self.first_tool:
            return f"tool {self.tools[grain - self.first_tool]}"
        if grain >= self.num_sample_grains:
            return f"membrane {self.labels[grain]}"
        return f"grain {self.labels[grain]}"

    @cached_property
    def grain_of_cell(self) -> np.ndarray:
        """Local grain of each row of ``cells``, shape (num_cells,)."""
        return np.repeat(np.arange(self.num_grains, dtype=np.int32), np.diff(self.cell_offset))

    @cached_property
    def cell_of_facet(self) -> np.ndarray:
        """Row of ``cells`` beneath each facet, int32, shape (num_facets,)."""
        return (self.side_of_facet // 4).astype(np.int32)

    def sides_between(self, pairs: np.ndarray) -> np.ndarray:
        """Sides of both cells that their facet is, which may have opened, shape (n, 2). Local.

        Args:
            pairs: Rows of the cells, shape (n, 2).
        """
        nodes = self.cells[pairs] if self.origin is None else self.origin[self.cells[pairs]]
        shared = nodes[:, 0, :, None] == nodes[:, 1, None, :]
        beyond = [np.argmin(shared.any(axis=axis), axis=1) for axis in (2, 1)]
        return 4 * pairs + np.stack(beyond, axis=1)

    @property
    def _nodes_before(self) -> np.ndarray:
        """Node of the version before that each is a part of, shape (num_nodes,)."""
        return np.arange(self.num_nodes) if self.source is None else self.source.nodes

    @cached_property
    def parted_grains(self) -> np.ndarray:
        """Local grains in which nodes parted in the last growth, increasing."""
        nodes = self._nodes_before
        return np.unique(self.grain_of_node[np.bincount(nodes)[nodes] > 1]).astype(np.int64)

    def near_parts(self, num_cells: int) -> np.ndarray:
        """Whether each node parted in the last growth, or is so many cells away. Local."""
        nodes = self._nodes_before
        near = np.bincount(nodes)[nodes] > 1
        rows = self.cells_of(self.parted_grains)
        for _ in range(num_cells):
            cells = self.cells[rows]
            near[cells[near[cells].any(axis=1)]] = True
        return near

    @cached_property
    def name_of_cell(self) -> np.ndarray:
        """Place of each row of ``cells`` among :attr:`named_cells`, shape (num_cells,)."""
        name = np.empty(self.num_cells, dtype=np.int64)
        name[self.named_cells] = np.arange(self.num_cells)
        return name

    @cached_property
    def num_pieces(self) -> np.ndarray:
        """Pieces of each grain of this rank, shape (num_grains,)."""
        if self.piece_of_cell is None:
            return np.ones(self.num_grains, dtype=np.int64)
        return 1 + np.maximum.reduceat(self.piece_of_cell, self.cell_offset[:-1]).astype(np.int64)

    @property
    def cell_tags(self):
        """Label of each cell, as DOLFINx mesh tags; made anew."""
        label = np.empty(self.num_cells, dtype=np.int32)
        label[self.cell_order] = self.labels[self.grains[self.grain_of_cell]]
        return mesh.meshtags(self.mesh, 3, np.arange(label.size, dtype=np.int32), label)

    @cached_property
    def named_nodes(self) -> np.ndarray:
        """Nodes grain after grain, in each as they were given: an order that knows no ranks."""
        if self.named is not None:
            return self.named[0]
        given = np.empty(self.num_nodes, dtype=np.int64)
        given[self.V.dofmap.list] = _given_nodes(self.mesh)
        return np.lexsort((given, self.grain_of_node)).astype(np.int32)

    @cached_property
    def named_cells(self) -> np.ndarray:
        """Rows of ``cells`` grain after grain, in each as they were given."""
        if self.named is not None:
            return self.named[1]
        given = self.mesh.topology.original_cell_index[self.cell_order]
        return np.lexsort((given, self.grain_of_cell)).astype(np.int32)

    def cell_function(self, values: np.ndarray) -> fem.Function:
        """Piecewise constant DOLFINx function from values in the order of ``cells``."""
        function = fem.Function(fem.functionspace(self.mesh, ("DG", 0)))
        function.x.array[self.cell_order] = values
        return function

    def function(self, values: np.ndarray) -> fem.Function:
        """DOLFINx function on ``V`` from values at nodes, shape (num_nodes, 3)."""
        function = fem.Function(self.V)
        function.x.array[:] = values[self.node_of_dof].ravel()
        return function

    def inner_facets(self) -> tuple[np.ndarray, np.ndarray]:
        """Nodes of the facets between two cells, (n, 3), and rows of both cells, (n, 2). Local."""
        return inner_facets(self.cells)

    def grow(self, between: ArrayLike) -> "GrainMesh":
        """The mesh after facets between cells have opened. Collective.

        Two cells stay joined at a node where a path of cells around it joins them, through facets
        that never opened. A node whose cells are not all joined is doubled, once for each further
        part. A facet all of whose nodes are still those of both cells is no surface yet: it waits
        for others to open around it.

        Each part of a node has its place. The first one, by the names of its cells, keeps its name;
        others are named after the last node of their grain. Rows of cells stay.

        Args:
            between: Pairs of rows of ``cells`` on the two sides of each facet, as of
                :meth:`inner_facets`, shape (n, 2); those of this rank's grains.

        Returns:
            The next version, with ``source``; this mesh itself where no rank has a node to part.

        Raises:
            InputError: A pair is none of rows of ``cells`` that share a facet; on all ranks.
        """
        pairs, message = _pairs_of_cells(self, between)
        raise_together(self.comm, message)
        row = np.column_stack([pairs, np.full(len(pairs), self.version + 1)])
        opened = np.concatenate([self.all_opened, row])
        rows = self.cells_of(np.unique(self.grain_of_cell[pairs[:, 0]]))
        cells, parted = part_nodes(self.cells, rows, opened[:, :2], pairs, self.name_of_cell)
        if not self.comm.allreduce(parted.size):
            self.opened[:] = [opened]
            return self
        return self._with_parted(cells, parted, opened)

    @property
    def all_opened(self) -> np.ndarray:
        """The rows of :attr:`opened`, shape (num_opened, 3)."""
        return np.concatenate([np.empty((0, 3), dtype=np.int64), *self.opened])

    def cells_of(self, grains: np.ndarray) -> np.ndarray:
        """Rows of ``cells`` of some local grains, one after another. Local."""
        first, end = self.cell_offset[grains], self.cell_offset[grains + 1]
        return np.concatenate([np.arange(0), *map(np.arange, first, end)])

    def in_pieces(self, holding: np.ndarray, before: "GrainMesh") -> "GrainMesh":
        """The same mesh with the pieces of now, which no node and no other hold joins. Collective.

        Args:
            holding: Pairs of rows of ``cells`` that hang together beside those of one node, (n, 2).
            before: What this one has grown from, or itself: then the version stays.

        Returns:
            It, with a ``source`` from ``before``; this mesh itself where no piece has come loose.
        """
        old = self.piece_of_cell
        if old is None:
            old = np.zeros(self.num_cells, dtype=np.int32)
        broken = np.unique(self.grain_of_cell[self.all_opened[:, 0]])
        rows = self.named_cells[self.cells_of(broken)]
        piece = number_pieces(self.cells, old, self.grain_of_cell, rows, holding)
        if not self.comm.allreduce(int((piece != old).any())):
            return self
        source = self.source
        if self is before:
            source = Source(np.arange(self.num_nodes), np.arange(len(self.facets)))
        return replace(self, piece_of_cell=piece if piece.any() else None, source=source)

    def _with_parted(self, cells, parted, opened):
        """The next version. Collective.

        Args:
            cells: New nodes of the cells: ``num_nodes`` + k where they have part k.
            parted: Old nodes of these parts, shape (num_parts,).
            opened: As the field of that name.
        """
        num, named = self.num_nodes, self.named_nodes
        name = np.empty(num, dtype=np.int64)
        name[named] = np.arange(num)
        # Parts stand after the last node of their grain, by the name of their old node.
        last = np.maximum.reduceat(self.nodes, self.node_offset[:-1])
        order = np.argsort(name[parted], kind="stable")
        parts = parted[order]
        after = last[self.grain_of_node[parts]]
        source = np.insert(np.arange(num), after + 1, parts)
        new_number = np.empty(num + parted.size, dtype=np.int32)
        new_number[:num] = np.arange(num) + np.searchsorted(np.sort(after), np.arange(num))
        by_place = np.argsort(after, kind="stable")
        new_number[num + order[by_place]] = after[by_place] + 1 + np.arange(parts.size)
        grain_of_node = self.grain_of_node[source]
        nodes = np.argsort(grain_of_node, kind="stable").astype(np.int32)
        new_cells = new_number[cells]
        named_after = self.node_offset[1:][self.grain_of_node[parts]]
        sides = self._sides_with(new_cells, opened)
        return replace(
            self,
            x=self.x[source],
            cells=new_cells,
            nodes=nodes,
            node_offset=np.searchsorted(grain_of_node[nodes], np.arange(self.num_grains + 1)),
            grain_of_node=grain_of_node,
            facets=nodes_of_sides(new_cells, sides),
            grain_of_facet=self.grain_of_cell[sides // 4],
            side_of_facet=sides,
            first_node=self.comm.exscan(source.size) or 0,
            named=(
                np.insert(new_number[named], named_after, new_number[num + order]),
                self.named_cells,
            ),
            version=self.version + 1,
            origin=source if self.origin is None else self.origin[source],
            source=Source(source, rows_of(self.side_of_facet, sides)),
            opened=[opened],
        )

    def _sides_with(self, cells, opened):
        """Sides of cells that are facets once nodes have parted, increasing. Local.

        Args:
            cells: Their nodes afterwards, shape (num_cells, 4).
            opened: As the field of that name.
        """
        one, other = cells[opened[:, :2]].transpose(1, 0, 2)
        apart = (one[:, :, None] == other[:, None, :]).sum(axis=(1, 2)) != 3
        sides = self.sides_between(opened[apart, :2])
        new = np.unique(sides[rows_of(self.side_of_facet, sides) < 0])
        return np.sort(np.append(self.side_of_facet, new))


def create_grain_mesh(
    comm: MPI.Intracomm,
    points: np.ndarray,
    cells: np.ndarray,
    cell_grain: np.ndarray,
    labels: np.ndarray,
    rank_of_grain: np.ndarray,
    sleeves: Sequence[str] = (),
    tools: Sequence[str] = (),
) -> GrainMesh:
    """Make the distributed mesh from each rank's own grains. Collective.

    Args:
        comm: MPI communicator.
        points: Positions of the nodes of this rank's grains [m], shape (num_nodes, 3).
        cells: Local nodes of this rank's tetrahedra, shape (num_cells, 4).
        cell_grain: Index into ``labels`` of each tetrahedron, shape (num_cells,).
        labels: Labels of all grains, shape (num_grains_global,).
        rank_of_grain: Rank of all grains, shape (num_grains_global,).
        sleeves: Names of the bodies after the grains in ``labels``, which are around them.
        tools: Names of the last of ``labels``, which are tools.

    Raises:
        InputError: A grain is no body (see `topology.body_defect`), or one of its cells has no
            volume or lies in another; on all ranks.
    """
    _check_bodies(comm, points, cells, cell_grain, labels)
    first_node = comm.exscan(points.shape[0]) or 0
    first_cell = comm.exscan(cells.shape[0]) or 0
    domain = _create_domain(comm, points, cells.astype(np.int64) + first_node)
    V = _vectors_on(domain)
    grain_of_cell = cell_grain[domain.topology.original_cell_index - first_cell]
    cell_order = np.argsort(grain_of_cell, kind="stable").astype(np.int32)
    grains, cell_offset = np.unique(grain_of_cell[cell_order], return_index=True)
    cell_offset = np.append(cell_offset, cell_order.size).astype(np.int64)

    dofs = V.dofmap.list[cell_order].astype(np.int32)
    x = V.tabulate_dof_coordinates()[: V.dofmap.index_map.size_local].copy()
    edges = x[dofs[:, 1:]] - x[dofs[:, :1]]
    inside_out = np.linalg.det(edges) < 0
    dofs[inside_out] = dofs[inside_out][:, [0, 2, 1, 3]]

    local_grain = np.repeat(np.arange(grains.size, dtype=np.int32), np.diff(cell_offset))
    grain_of_node = np.empty(x.shape[0], dtype=np.int32)
    grain_of_node[dofs] = local_grain[:, None]
    nodes = np.argsort(grain_of_node, kind="stable").astype(np.int32)
    node_offset = np.searchsorted(grain_of_node[nodes], np.arange(grains.size + 1))

    sides = boundary_sides(dofs, cell_offset)
    facets, grain_of_facet = nodes_of_sides(dofs, sides), local_grain[sides // 4]
    _check_elements(comm, x, dofs, cell_offset, facets, grain_of_facet, np.asarray(labels)[grains])
    return GrainMesh(
        comm=domain.comm,
        labels=np.asarray(labels),
        rank_of_grain=np.asarray(rank_of_grain),
        grains=grains,
        x=x,
        cells=dofs,
        cell_offset=cell_offset,
        nodes=nodes,
        node_offset=node_offset,
        grain_of_node=grain_of_node,
        facets=facets,
        grain_of_facet=grain_of_facet,
        side_of_facet=sides,
        sleeves=tuple(sleeves),
        tools=tuple(tools),
        first_view=View(domain, V, cell_order, np.arange(len(x), dtype=np.int32)),
        first_node=V.dofmap.index_map.local_range[0],
    )


def _create_domain(comm, points, cells):
    """The mesh of DOLFINx, whose cells stay on the rank that has them. Collective.

    Args:
        comm: MPI communicator.
        points: Positions of this rank's nodes [m], shape (num_nodes, 3).
        cells: Nodes of this rank's tetrahedra, numbered through all ranks, shape (num_cells, 4).
    """
    element = basix.ufl.element("Lagrange", "tetrahedron", 1, shape=(3,))
    rank = comm.rank

    def stay(_comm, num_parts, cell_types, cell_nodes):
        num_cells = cell_nodes[0].size // 4
        return graph.adjacencylist(
            np.full(num_cells, rank, np.int32), np.arange(num_cells + 1, dtype=np.int32)
        )._cpp_object

    points = np.ascontiguousarray(points, dtype=np.float64)
    return mesh.create_mesh(comm, cells, element, points, stay)


def _vectors_on(domain):
    """Continuous piecewise linear vectors on a mesh whose ranks share no nodes."""
    V = fem.functionspace(domain, ("Lagrange", 1, (3,)))
    if V.dofmap.index_map.num_ghosts:
        raise RuntimeError(
            f"ghosts = {V.dofmap.index_map.num_ghosts}, expected a grain on one rank"
        )
    return V


def _given_nodes(domain):
    """Nodes of the cells of a DOLFINx mesh by the numbers that they were given with, (n, 4)."""
    return domain.geometry.input_global_indices[domain.geometry.dofmaps[0]]


def _check_bodies(comm, points, cells, cell_grain, labels):
    """Each grain is one body on nodes of its own: whatever follows relies on it. Collective.

    Raises:
        InputError: It is none; on all ranks.
    """
    message = None
    owner = np.full(len(points), -1)
    order = np.argsort(cell_grain, kind="stable")
    for part in np.split(order, np.flatnonzero(np.diff(cell_grain[order])) + 1):
        if part.size == 0:
            continue
        grain = cell_grain[part[0]]
        defect = body_defect(cells[part], len(points))
        if not defect:
            shared = owner[cells[part]].max()
            owner[cells[part]] = grain
            if shared >= 0:
                defect = f"a node of grain {labels[shared]}, expected nodes of its own"
            elif not np.isfinite(points[cells[part]]).all():
                defect = "a node whose place is not finite"
        if defect:
            message = f"grain {labels[grain]} has {defect}: mesh that grain anew"
            break
    raise_together(comm, message)


def _check_elements(comm, x, cells, cell_offset, facets, grain_of_facet, labels):
    """Every element has a volume, and they fill the surface of their grain once. Collective.

    The volume that the surface encloses is the sum of those of the elements with their sign: where
    some lie inside out among others, as after a node was moved too far, it falls short of theirs.

    Raises:
        InputError: An element is flat, or some lie inside out; on all ranks.
    """
    grain_of_cell = np.repeat(np.arange(cell_offset.size - 1), np.diff(cell_offset))
    corner = x[cells]
    edges = corner[:, 1:] - corner[:, :1]
    volume = np.linalg.det(edges) / 6
    largest = np.abs(edges).max(axis=(1, 2), initial=0.0)
    flat = np.flatnonzero(~(volume > FLAT * largest**3))
    # From a point of each grain: far from the origin its volume would be rounded off.
    place = x[cells[cell_offset[:-1], 0]]
    a, b, c = (x[facets[:, i]] - place[grain_of_facet] for i in range(3))
    enclosed = np.bincount(
        grain_of_facet, np.einsum("ij,ij->i", a, np.cross(b, c)) / 6, cell_offset.size - 1
    )
    filled = np.bincount(grain_of_cell, volume, cell_offset.size - 1)
    tangled = np.flatnonzero(np.abs(filled - enclosed) > 1e-6 * filled)
    message = None
    if flat.size:
        message = (
            f"volume of an element of grain {labels[grain_of_cell[flat[0]]]} = "
            f"{volume[flat[0]]:.3g} m³ on edges of {largest[flat[0]]:.3g} m, expected more than "
            f"{FLAT:g} of their cube: mesh that grain anew"
        )
    elif tangled.size:
        k = tangled[0]
        message = (
            f"volume of the elements of grain {labels[k]} = {filled[k]:.6g} m³ in a surface around "
            f"{enclosed[k]:.6g} m³, expected the same: elements lie inside out or in each other"
        )
    raise_together(comm, message)


def _pairs_of_cells(mesh, between):
    """Pairs of cells as integers, and the line for what shares no facet, or None. Local."""
    pairs = np.asarray(between)
    if not pairs.size:
        return np.empty((0, 2), dtype=np.int64), None
    if pairs.ndim != 2 or pairs.shape[1] != 2 or pairs.dtype.kind not in "iu":
        return np.empty((0, 2), dtype=np.int64), (
            f"facets to open of shape {pairs.shape} ({pairs.dtype}), expected pairs of rows of "
            "cells, whole numbers of shape (n, 2)"
        )
    pairs = pairs.astype(np.int64)
    wrong = ((pairs < 0) | (pairs >= mesh.num_cells)).any(axis=1)
    one, other = mesh.cells[np.where(wrong[:, None], 0, pairs)].transpose(1, 0, 2)
    wrong |= (one[:, :, None] == other[:, None, :]).sum(axis=(1, 2)) != 3
    if not wrong.any():
        return pairs, None
    a, b = pairs[np.argmax(wrong)]
    return pairs, (
        f"facet to open between the cells {a} and {b}, expected two of {mesh.num_cells} rows of "
        "cells that share a facet that is closed"
    )
