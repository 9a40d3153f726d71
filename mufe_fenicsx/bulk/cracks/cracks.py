"""Grains that break: facets between cells open, soften, and rub where they are pressed."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from mpi4py import MPI

from ...contact.stiffness.springs import SpringList, Springs
from ...contact.surface.exchange import SurfaceVector
from ...errors import raise_together
from ...kernels.cracks.cracks import ENERGIES, POINT, CrackForces
from ...materials.auto import Auto
from ...materials.fracture import IN_ZONE
from ...materials.rigid import Rigid
from ...state import ForceTerm
from ...units import with_unit
from .dust import Dust
from .facets import Facets
from .parting import first_tractions


class Event(NamedTuple):
    """Facets of a grain that opened in one look."""

    time: float  #: [s]
    grain: int  #: its label
    place: np.ndarray  #: their middle [m], shape (3,)
    area: float  #: [m²]
    mode: str  #: "tension" or "shear", what bears more
    energy: float  #: that it takes to open them [J]
    strength: float  #: drawn for them, mean by area [Pa]


#: Columns of :meth:`Cracks.strengths_of_grains`: label, volume [m³], facets that may open, and the
#: least, the median and the largest of their strengths [Pa].
STRENGTHS = ("grain", "volume", "num_facets", "least", "median", "largest")
#: Steps from one look at all cells to the next; facets near their strength are looked at in each.
STEPS_BETWEEN_LOOKS = 4
#: Facets beside those that soften open at this part of their strength: nodes at a front of cracks
#: bear more than means of cells tell. They soften where their points reach the strength.
BESIDE = 0.55
#: Steps from one growth to the next of facets that only those beside them let open, and the least
#: length of such a step over that of single elements: of shorter ones it takes more. At twice the
#: time a crack takes 11 % less energy than its own (`mufe verify cracked-strip`).
STEPS_BETWEEN_GROWTHS, LEAST_STEP = 32, 0.375
#: Steps from one look for pieces that come loose to the next.
STEPS_BETWEEN_PIECES = 40
#: Least stiffness of a point over E/h of the cells beside it.
SOFTEST = 0.25


class Cracks(ForceTerm):
    """Extrinsic cohesive facets (M. Ortiz, A. Pandolfi, IJNME 44, 1999). Collective.

    Nothing acts until a facet opens. From then on each of its corners whose node has parted is a
    point that bears the law of kernels/cracks/law.h. The first tractions are such that all parts of
    a node go on with the same acceleration (K. D. Papoulia, C.-H. Sam, S. A. Vavasis, IJNME 58,
    2003).

    A piece of a grain that hangs by no facet any more that is closed, or open and not yet failed,
    has come loose: its faces become contact, which bears what they did.

    Args:
        specimen: :class:`~mufe_fenicsx.specimen.Specimen`.
        fracture: :class:`~mufe_fenicsx.materials.fracture.Fracture`.

    Attributes:
        facets: :class:`~.facets.Facets` that may open.
        strength: Of each [Pa], inf of those that are open, shape (num_facets,).
        opened: Rows of the open ones, increasing, shape (num_opened,).
        points: What their corners keep, of type POINT, shape (num_opened, 3).
        events: What opened on this rank since the last :meth:`take_events`.
        news: Whether anything did on some rank.
        near, watching: Which facets of cells were near their strength at the last look, as of
            FacetSearch, shape (num_cells,), and whether any were on some rank.

    Raises:
        InputError: A grain is rigid, there is a membrane, or dust beside the kinematic law; on all
            ranks.
    """

    STATE = {"common": ("any", "watching", "_element_step"), "cells": ("near",)}

    name = "cracks"
    opens = True

    def __init__(self, specimen, fracture):
        raise_together(specimen.comm, _what_cannot_break(specimen, fracture))
        self.mesh, solid, self.fracture = specimen.mesh, specimen.solid, fracture
        self.facets = facets = Facets(self.mesh, solid.volume0)
        self.constraint = Dust(self.mesh, fracture.dust) if fracture.dust else None
        self._E = np.array([m.E for m in solid.materials])[facets.grain]
        self._solid, grain = solid, self.mesh.grains[facets.grain]
        self.strength = self.drawn()
        if fracture.friction is None:
            friction = specimen.contact.friction
            rows = friction.rows(grain, grain)
            self._friction = friction.coefficients[rows if rows.size else np.zeros_like(grain), 0]
        else:
            self._friction = np.full(grain.size, fracture.friction)
        self.opened, self.points = np.empty(0, dtype=np.int64), np.zeros((0, 3), POINT)
        self.any = False  #: whether a facet is open on some rank
        self.near, self.watching = np.zeros(self.mesh.num_cells, np.uint8), False
        self._num_failed = 0  # of this rank, at the last look for pieces
        self.events, self.news = [], False
        self._element_step = self.mesh.comm.allreduce(solid.first_time_step, op=MPI.MIN)
        self._follow(solid)

    # --- which facets are open ------------------------------------------------------------

    def drawn(self, lowered=True):
        """Strengths of all facets while they are whole [Pa], shape (num_facets,). Local.

        ``lowered``: as lower_strength asks for.
        """
        facets, mesh = self.facets, self.mesh
        label = mesh.labels[mesh.grains][facets.grain]
        names, volume = np.column_stack([label, facets.name]), facets.volume
        if self.fracture.scatter == "grain":
            names = names[:, :1]
            volume = np.add.reduceat(self._solid.volume0, mesh.cell_offset[:-1])[facets.grain]
        law = self.fracture if lowered else replace(self.fracture, lower_strength=False)
        return law.strengths(names, volume, facets.height, self._E)

    def _open(self, rows):
        """Take facets into the list of open ones. Local."""
        before, points = self.opened, self.points
        self.opened = np.union1d(before, rows)
        self.points = np.zeros((self.opened.size, 3), POINT)
        self.points[np.searchsorted(self.opened, before)] = points
        new, strength = np.searchsorted(self.opened, rows), self.strength[rows]
        for name, values in (
            ("strength", strength),
            ("ultimate", 2.0 * self.fracture.energy / strength),
            ("stiffness", self._E[rows] / self.facets.height[rows]),
        ):
            self.points[name][new] = values[:, None]
        self.strength[rows] = np.inf

    def _follow(self, solid):
        """Take nodes and cells of the mesh as they are now. Local."""
        self._solid, facets, shear = solid, self.facets, self.fracture.shear_ratio
        if self.constraint is not None:
            self.strength[self.constraint.inside(facets.across)] = np.inf
        self._softer = self._softened()
        front = facets.touch(self.opened[self._softer])
        opens = self.strength * np.where(front, BESIDE, 1.0)
        self._search = facets.search(
            self.mesh, solid.volume0, opens, self._friction, self.near, self.strength,
            shear, solid.element == "averaged",
        )  # fmt: skip
        nodes, area = facets.nodes(self.mesh, self.opened), facets.area[self.opened]
        friction = self._friction[self.opened]
        self._forces = CrackForces(nodes, area, friction, self.points, shear)

    def _areas(self, which):
        """Areas of points, three to an open facet [m²], shape (n,). Local."""
        return self.facets.area[self.opened[which // 3]] / 3.0

    def _softened(self):
        """Whether a point of each open facet has begun to soften, shape (num_opened,). Local."""
        p = self.points
        return ((p["open"] != 0.0) & (p["furthest"] * p["stiffness"] > p["strength"])).any(axis=1)

    def facets_to_open(self, state):
        """As of the term; none, of shape (0, 2), where pieces may have come loose. Collective."""
        stress = state.deviator, self._solid.pressure
        if not state.num_steps % STEPS_BETWEEN_LOOKS:
            if self.opened.size and (self._softened() != self._softer).any():
                self._follow(self._solid)
            self._search.watch(*stress, state.x)
            self.watching = self.mesh.comm.allreduce(self._search.num_listed) > 0
        if not self.watching:
            return self._look_for_pieces(state)
        rows, now = self._search(*stress, state.x)
        shorter = LEAST_STEP * self._element_step / state.dt if state.dt else 1.0
        waits = state.num_steps % (STEPS_BETWEEN_GROWTHS * max(1, round(shorter)))
        if not self.mesh.comm.allreduce(now if waits else rows.size):
            return self._look_for_pieces(state)
        self.news = True
        self._note(rows, state)
        return self.declare_open(rows)

    def declare_open(self, rows):
        """Take closed facets for open, which the mesh opens next. Collective.

        Args:
            rows: Those of this rank, increasing, shape (n,).

        Returns:
            Pairs of their cells, as of :meth:`~mufe_fenicsx.mesh.GrainMesh.grow`, shape (n, 2).
        """
        self.any = self.any or self.mesh.comm.allreduce(rows.size) > 0
        self._open(rows)
        self._follow(self._solid)
        return self.facets.across[rows]

    def _tractions(self, rows, state):
        """Tractions on first sides of facets, of the stress of both cells [Pa], (n, 3). Local."""
        across, solid = self.facets.across[rows], self._solid
        stress = np.zeros((rows.size, 6))
        for side in across.T:
            stress += solid.volume0[side][:, None] * solid.stress(state, side)
        stress /= solid.volume0[across].sum(axis=1)[:, None]
        a, b, c = state.x[self.facets.nodes(self.mesh, rows)[:, :3]].transpose(1, 0, 2)
        normal = np.cross(b - a, c - a)
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        whole = stress[:, [[0, 3, 5], [3, 1, 4], [5, 4, 2]]]
        return np.einsum("nij,nj->ni", whole, normal), normal

    def coarse_line(self):
        """A line where the cohesive zone has too few facets of the mesh, or None. Collective.

        Of strengths that scatter it is that of their geometric mean.
        """
        facets, drawn = self.facets, self.drawn(lowered=False)
        edges, zones = np.sqrt(4.0 / np.sqrt(3.0) * facets.area), self.fracture.zone(self._E, drawn)
        own = edges, np.log(zones), np.log(self.drawn() / drawn), np.ones(drawn.size)
        total = self.mesh.comm.allreduce(np.array([values.sum() for values in own]))
        edge, zone, left, _ = total / max(total[-1], 1.0)
        wanted = float(np.exp(zone)) / IN_ZONE
        if edge <= wanted:
            return None
        lowered = self.fracture.lower_strength
        what = (f"lower_strength leaves {np.exp(left):.0%} of strengths in the mean" if lowered
                else "cracks take more than their energy")  # fmt: skip
        return (
            f"{what}: edges of the mesh = {with_unit(edge, 'm')}, a fifth of the cohesive zone "
            f"E·energy/strength² of the strengths drawn is {with_unit(wanted, 'm')}; mesh finer"
            f"{'' if lowered else ', or lower_strength = true'}"
        )

    # --- forces ---------------------------------------------------------------------------

    def add_forces(self, f, state, dt):
        """Add the forces on both sides of open facets. Local."""
        if self.opened.size:
            self._forces.add(f, state.x, state.v, dt)

    def act_on_rigid(self, rigid, state):
        """Tools do not break."""

    def energy(self, state):
        """Stored and lost in open facets [J]. Local."""
        total = float(self._forces.energies(state.x).sum())
        return total if self.constraint is None else total + self.constraint.energy(state)

    def parts_of_energy(self, state):
        """What of that is stored, and where the rest went [J], by name. Local."""
        parts = dict(zip(ENERGIES, self._forces.energies(state.x), strict=True))
        if self.constraint is not None:
            parts["dust"] = self.constraint.energy(state)
        return parts

    def springs(self, state, margin):
        """Springs of points that are pressed or can be, as stiff as they are now. Collective."""
        if not self.any:
            return None
        which = np.flatnonzero(self.points["open"].ravel() > 0.0)
        p, pair = self.points.ravel()[which], self._forces.nodes.reshape(-1, 2, 3).swapaxes(1, 2)
        pair, area = pair.reshape(-1, 2)[which], self._areas(which)
        at, place = np.unique(pair, return_inverse=True)
        listed = SpringList.empty(which.size, 2)
        listed.nodes[:] = place.reshape(-1, 2)
        listed.share[:] = [1.0, -1.0]
        sides = state.x[self._forces.nodes].reshape(-1, 2, 3, 3)
        x = sides.mean(axis=1)
        normal = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        listed.normal[:] = np.repeat(normal, 3, axis=0)[which]
        listed.kn[:] = area * p["stiffness"]
        d0 = p["strength"] / p["stiffness"]
        whole = 1.0 - np.minimum((p["furthest"] - d0) / p["ultimate"], 1.0)
        across = self.fracture.shear_ratio**2 * p["strength"] * whole / p["furthest"]
        apart = (sides[:, 1] - sides[:, 0]).reshape(-1, 3)[which]
        stretch = p["start_n"] + np.einsum("ni,ni->n", listed.normal, apart)
        rubs = (stretch < 2.0 * margin) & (self._friction[self.opened][which // 3] > 0.0)
        listed.kt[:] = area * np.maximum(across + p["stiffness"] * rubs, p["stiffness"])
        none = np.empty(0, dtype=np.int64)
        moves, forces = (SurfaceVector(self.mesh.comm, at.size, none) for _ in range(2))
        return Springs(at.astype(np.int32), (listed,), moves, forces)

    # --- pieces that come loose -----------------------------------------------------------

    def _spent(self):
        """Part of the softening of each point that is done: 1 failed, (num_opened, 3). Local."""
        p = self.points
        part = (p["furthest"] - p["strength"] / p["stiffness"]) / p["ultimate"]
        part[p["open"] == 0.0] = 0.0
        part[p["open"] < 0.0] = 1.0
        return np.clip(part, 0.0, 1.0)

    def _holds(self):
        """Whether a point of each open facet is still whole, or softens, or is in dust. Local."""
        holds = (self._spent() < 1.0).any(axis=1)
        if self.constraint is not None:
            holds |= self.constraint.inside(self.facets.across[self.opened])
        return holds

    def opened_and_failed(self):
        """As of the term: a point that has failed counts for a third of its facet. Local."""
        area = self.facets.area[self.opened]
        failed = area @ (self._spent() == 1.0).mean(axis=1)
        return np.array([area.size, area.sum(), failed])

    def cell_fields(self):
        """``crack``: softening of the worst facet of each cell, 0 none opened, 1 failed. Local."""
        worst, spent = np.zeros(self.mesh.num_cells), self._spent().mean(axis=1)
        for side in self.facets.across[self.opened].T:
            np.maximum.at(worst, side, spent)
        return {"crack": worst}

    def holding(self):
        """As of the term: across what has not failed at all of its points. Local."""
        return self.facets.across[self.opened[self._holds()]].astype(np.int64)

    def _look_for_pieces(self, state):
        """No facets to open where more have failed than at the last look, else None. Collective."""
        if not self.any or state.num_steps % STEPS_BETWEEN_PIECES:
            return None
        num, before = np.count_nonzero(~self._holds()), self._num_failed
        self._num_failed = num
        more = self.mesh.comm.allreduce(int(num > before))
        return np.empty((0, 2), dtype=np.int64) if more else None

    def let_go(self, state):
        """As of the term; these points bear no more. Local."""
        if self.mesh.piece_of_cell is None:
            return super().let_go(state)
        piece = self.mesh.piece_of_cell[self.facets.across[self.opened]]
        rows = np.flatnonzero(
            (piece[:, 0] != piece[:, 1]) & (self.points["open"] > 0.0).any(axis=1)
        )
        which = self.opened[rows]
        across = 6 - self.facets.corners[which].sum(axis=2, dtype=np.int64)  # from the facet
        return 4 * self.facets.across[which] + across, *self._forces.leave(rows, state.x)

    def settle(self, specimen, damping):
        """Make dust of small pieces, whose facets neither open nor bear any more. Local."""
        if self.constraint is None:
            return False

        def inner(of_cell, num):
            held, (one, other) = np.zeros(num), of_cell[self.facets.across[self.opened]].T
            for row in np.flatnonzero((one == other) & (one >= 0)):
                held[one[row]] += self._forces.leave(np.array([row]), specimen.state.x)[1]
            return held

        found = self.constraint.take(specimen, damping, inner)
        if found:
            self._follow(specimen.solid)
        return found

    # --- growth ---------------------------------------------------------------------------

    def grow(self, mesh, share):
        """Wait for :meth:`part`, but for dust. Local."""
        if self.constraint is not None:
            self.constraint.grow(mesh, share)

    def part(self, before, after):
        """Points whose node has parted bear what holds its parts together. Local.

        Args:
            before, after: :class:`~mufe_fenicsx.specimen.Specimen` of the mesh before, and of that
                which has grown, whose forces lack only those of cracks.
        """
        old, new, source = before.state, after.state, after.mesh.source.nodes
        held = np.zeros_like(old.x)
        self.add_forces(held, old, 0.0)
        closed = self.points["open"].ravel() == 0.0
        guess = self._tractions(self.opened, old)[0]
        self.mesh = after.mesh
        self._follow(after.solid)
        share = after.solid.mass / before.solid.mass[source]
        after.f -= share[:, None] * held[source]
        self.add_forces(after.f, new, 0.0)
        sides = self._forces.nodes.reshape(-1, 2, 3)
        apart = (sides[:, 0] != sides[:, 1]).ravel()
        which = np.flatnonzero(closed & apart)
        if not which.size:
            return
        one, other = sides[:, 0].ravel()[which], sides[:, 1].ravel()[which]
        area, mass = self._areas(which), after.solid.mass
        traction = first_tractions(one, other, area, guess[which // 3], after.f, mass)
        self._stiffen(which, one, other, area, mass)
        self._forces.begin(which, traction, new.x)
        bears = area[:, None] * traction
        np.add.at(after.f, one, bears)
        np.subtract.at(after.f, other, bears)

    def _stiffen(self, which, one, other, area, mass):
        """Give new points their stiffness and damper. Local.

        k is E/h of the cells beside, but where few cells hang on a node what half the step of
        single elements allows, down to :data:`SOFTEST`. A spring gives back energy where it is
        unloaded, the more the softer it is: at a quarter of E/h cracks run on that. The damper is a
        part of the critical one of both nodes with all these springs.
        """
        at_node = np.zeros(mass.size)
        for side in (one, other):
            np.add.at(at_node, side, area)
        reduced = 1.0 / (1.0 / mass[one] + 1.0 / mass[other])
        per_area = reduced / np.maximum(at_node[one], at_node[other])
        points = self.points.reshape(-1)
        k = points["stiffness"][which]
        stiffest = max(self.fracture.shear_ratio, 1.0) * 0.5 * self._element_step
        allowed = per_area / stiffest**2
        k = np.minimum(k, np.maximum(allowed, SOFTEST * k))
        points["stiffness"][which] = k
        points["damper"][which] = 2.0 * self.fracture.damping * np.sqrt(k * per_area)

    # --- what is kept and told ------------------------------------------------------------

    def strengths_of_grains(self):
        """Strengths that were drawn, grain by grain, of all ranks. Collective.

        Returns:
            Rows of :data:`STRENGTHS`, one a grain in the order of the labels, on all ranks.
        """
        drawn, mesh, rows = self.drawn(), self.mesh, []
        volume = np.add.reduceat(self._solid.volume0, mesh.cell_offset[:-1])
        for k in np.unique(self.facets.grain):
            own = drawn[self.facets.grain == k]
            label = int(mesh.labels[mesh.grains[k]])
            rows.append((label, volume[k], own.size, own.min(), np.median(own), own.max()))
        return sorted(row for some in mesh.comm.allgather(rows) for row in some)

    def tables(self):
        """Open facets and their points."""
        f, rows = self.facets, self.opened
        names = {"cell": f.name[rows, 0], "across": f.name[rows, 1]}
        points = {name: self.points[name].copy() for name in POINT.names}
        found = {"facets": {"grain": self.mesh.grains[f.grain[rows]]} | names | points}
        return found if self.constraint is None else found | self.constraint.tables()

    def load_tables(self, tables):
        """Become what :meth:`tables` told. Collective."""
        table = tables["facets"]
        local = np.searchsorted(self.mesh.grains, table["grain"])
        names = np.column_stack([table["cell"], table["across"]])
        rows = self.facets.rows_of(local, names)
        self.opened, order = np.sort(rows), np.argsort(rows)
        self.points = np.zeros((rows.size, 3), POINT)
        for name in POINT.names:
            self.points[name] = table[name][order]
        self.strength[rows] = np.inf
        self.any = self.mesh.comm.allreduce(rows.size) > 0
        if self.constraint is not None:
            self.constraint.load_tables(tables)
        self._follow(self._solid)

    def _note(self, rows, state):
        """Note what opens, grain by grain. Local."""
        t, normal = self._tractions(rows, state)
        facets, area = self.facets, self.facets.area[rows]
        along = np.maximum(np.einsum("ni,ni->n", t, normal), 0.0)
        across = np.linalg.norm(np.cross(t, normal), axis=1) / self.fracture.shear_ratio
        place = state.x[facets.nodes(self.mesh, rows)[:, :3]].mean(axis=1)
        grain = facets.grain[rows]
        for k in np.unique(grain):
            mine = grain == k
            total = area[mine].sum()
            self.events.append(
                Event(
                    state.t, int(self.mesh.labels[self.mesh.grains[k]]),
                    area[mine] @ place[mine] / total, total,
                    "tension" if along[mine].sum() > across[mine].sum() else "shear",
                    self.fracture.energy * total, area[mine] @ self.strength[rows[mine]] / total,
                )
            )  # fmt: skip

    def take_events(self):
        """What opened on any rank since the last call, by time and grain. Collective."""
        found, self.events, self.news = self.mesh.comm.allgather(self.events), [], False
        return sorted((e for some in found for e in some), key=lambda e: (e.time, e.grain))


def _what_cannot_break(specimen, fracture):
    """The line for what keeps grains from breaking, or None. Local."""
    mesh = specimen.mesh
    if fracture.dust and specimen.contact.layers.kinematic:
        return 'normal law of contact = kinematic, expected "matched" with dust'
    if mesh.sleeves:
        return f"membrane {mesh.sleeves[0]} beside grains that break, expected none"
    for grain, material in zip(mesh.grains, specimen.solid.materials, strict=True):
        if isinstance(material, Rigid | Auto) and grain < mesh.num_sample_grains:
            return f"{mesh.name_of(grain)} is rigid, expected grains that deform with fracture"
    return None
