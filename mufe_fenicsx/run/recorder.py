"""What a test writes as it goes on: rows of its history and states of all fields."""

import copy
import math
import operator

import numpy as np

from ..analysis.contact_resolution import of_patches
from ..analysis.voids import Voids
from ..bulk.solid import von_mises
from ..bulk.strength import surface_strength
from ..contact.results.network import find_network
from ..contact.results.nodal_fields import nodal_contact
from ..errors import InputError, SolverError, raise_together
from ..geometry.form.proportions import median_diameter
from ..output.contacts import ContactWriter
from ..output.fields import Computed, FieldWriter
from ..output.history import HistoryWriter, history_columns
from ..output.record import ResultRecord
from ..output.tools import ToolWriter
from .energy_guard import EnergyGuard
from .event_table import EventTable

#: Columns of the history where grains can break: pieces of broken grains, how many these are, and
#: facets that opened, their area and what of it bears no more [m²].
BROKEN = ("num_fragments", "broken_grains", "num_opened", "opened_area", "failed_area")
#: Volume in which grains overlap over theirs, from which on a test means nothing.
MOST_OVERLAP = 0.2


class Recorder:
    """Writes history and fields of a test as it goes on. Collective.

    With ``kept``, of :meth:`state_dict`, it goes on from there; ``same_ranks``: on as many ranks.
    ``lock``, a :class:`~.output.run_lock.RunLock`, is that of the folder.
    """

    def __init__(
        self, folder, simulation, loading, output, energy_limit, kept=None, same_ranks=True,
        lock=None,
    ):  # fmt: skip
        mesh = simulation.mesh
        kept = kept or {}
        self.simulation, self.loading, self.lock = simulation, loading, lock
        self.container = loading.measures.container
        cells = slice(mesh.num_sample_cells)
        volume = simulation.solid.volume0[cells]
        #: Volumes of all grains at the start [m³], shape (num_grains,).
        self.volumes = mesh.comm.allreduce(
            np.bincount(mesh.grains[mesh.grain_of_cell[cells]], volume, mesh.num_sample_grains)
        )
        diameter = median_diameter(self.volumes)
        self.voids = Voids(mesh.comm, self.container, mesh.cells[cells], volume, diameter)
        self.guard = EnergyGuard(simulation, energy_limit)
        self.history = HistoryWriter(
            folder / "history.csv",
            (
                *history_columns(self.container),
                *loading.columns,
                *simulation.specimen.energy_columns,
                *(BROKEN if simulation.specimen.opening_terms else ()),
                *simulation.tools.columns,
            ),
            comm=mesh.comm,
            kept=kept.get("history"),
            rows=kept.get("history_rows"),
        )
        self.num_states = operator.index(kept.get("num_states", 0))
        of_fields = kept.get("fields")
        same = same_ranks and of_fields is not None  # the next state follows a mesh that has grown
        version = of_fields.get("version", 0) if same else mesh.version
        self.fields = self._field_writer(folder, of_fields, same_ranks, version)
        self.tools = ToolWriter(mesh, folder, kept.get("tools", ())) if mesh.tools else None
        self.contacts = ContactWriter(mesh.comm, folder, kept.get("contacts", ()))
        self.record = ResultRecord(folder, kept.get("record"))
        if self.fields.wrote_mesh:
            self._note([f"fields/{self.fields.mesh}"])
        self.events = EventTable(folder, simulation, kept.get("events"))
        self._history_interval = loading.interval(output.history)
        self._field_interval = loading.state_interval(output.fields)
        self._stage, *following = kept.get("next", (None, 0.0, 0.0))
        self._next_row, self._next_state = map(float, following)
        self.last = dict(kept.get("last", {}))  #: steps of the last "row" and "state", if any

    def state_dict(self):
        """What a recorder that goes on from here has to know, fit for JSON; rows are on disk."""
        return {
            "history": self.history.sync(),
            "history_rows": self.history.rows and list(self.history.rows),
            "record": copy.deepcopy(self.record.kept),
            "fields": copy.deepcopy(self.fields.kept),
            "contacts": copy.deepcopy(self.contacts.kept),
            "tools": [] if self.tools is None else copy.deepcopy(self.tools.kept),
            "num_states": self.num_states,
            "events": self.events.kept,
            "next": (self._stage, self._next_row, self._next_state),
            "last": dict(self.last),
        }

    def _field_writer(self, folder, kept, same_ranks, version):
        """Writer of the fields on the mesh as it is now, of a version. Collective."""
        mesh = self.simulation.mesh
        cells = slice(mesh.num_shown_cells)
        return FieldWriter(
            mesh.comm, folder, mesh.x[mesh.shown_nodes],
            np.searchsorted(mesh.shown_nodes, mesh.cells[cells]),
            mesh.labels[mesh.grains[mesh.grain_of_cell[cells]]], kept, same_ranks, self.num_states,
            version,
        )  # fmt: skip

    def _follow_mesh(self):
        """Write states on a mesh that has grown. Collective."""
        mesh, folder = self.simulation.mesh, self.history.path.parent
        if mesh.version == self.fields.version:
            return
        self.fields = self._field_writer(folder, self.fields.kept, True, mesh.version)
        if self.fields.wrote_mesh:
            self._note([f"fields/{self.fields.mesh}"])
        if self.tools is not None:
            self.tools = ToolWriter(mesh, folder, self.tools.kept)

    def after_step(self):
        """Write what is due."""
        loading = self.loading
        self.events.write(loading.strain, loading.stage)
        if loading.stage != self._stage:
            self._stage, self._next_row = loading.stage, 0.0
        if loading.loaded:
            interval = self._field_interval
            number = loading.state_course(interval) / interval
            if number * interval >= self._next_state:
                self._next_state = (math.floor(number + 1e-9) + 1) * interval * (1 - 1e-12)
                self.write_state()
        course = loading.course
        if course >= self._next_row:
            self._next_row = course - math.fmod(course, self._history_interval)
            self._next_row += self._history_interval * (1 - 1e-12)
            self.write_row()

    def write_last(self):
        """Row and state of the step that a run ends with, unless they are written already."""
        if self.last.get("row") != self.simulation.state.num_steps:
            self.write_row()
        self.write_last_state()

    def write_last_state(self):
        """The state of that step, unless it is written already."""
        if self.last.get("state") != self.simulation.state.num_steps:
            self.write_state()

    def write_row(self):
        """One row of the history. Returns its energies [J]."""
        self._check_lock()
        sim, loading = self.simulation, self.loading
        forces, energies = loading.measures.forces(), sim.energies()
        active = sim.num_active_grains()
        added, largest = sim.scaling.shares() if sim.scaling else (0.0, 0.0)
        fine, overlap = self._contacts()
        row = {
            "step": sim.state.num_steps,
            "time": sim.state.t,
            "dt": sim.dt,
            "stage": loading.stage,
            "strain": loading.strain,
            "height": loading.height,
            "speed": loading.speed_now,
            "stress": self.vertical_stress(forces),
            "added_mass": added,
            "added_mass_of_grain": largest,
            "num_contacts": sim.num_contacts,
            "num_active_grains": active,
            "num_active_contacts": sim.mean_active_contacts(),
            # Only rank 0, which writes, has it; without a contact there is none.
            "elements_per_radius": fine.half if fine else 0.0,
            "elements_per_radius_tenth": fine.tenth if fine else 0.0,
            "overlap": overlap,
        }
        lengths, container = loading.measures.lengths(), self.container
        row.update(zip(container.widths, lengths[:-1], strict=True))
        row.update({f"force_{name}": f for name, f in zip(container.walls, forces, strict=True)})
        unbalanced = sim.unbalanced_force()
        row.update({f"unbalanced_{a}": f for a, f in zip("xyz", unbalanced, strict=True)})
        row.update(energies)
        self.voids.cells = sim.mesh.cells[: sim.mesh.num_sample_cells]
        row.update(self.voids.row(sim.state.x, lengths))
        if self.tools is not None:
            row.update(sim.tools.row())
        row.update(loading.row(forces))
        if sim.specimen.opening_terms:
            pieces = sim.mesh.num_pieces[sim.mesh.is_of_sample]
            broken = pieces[pieces > 1]
            opened = sum(term.opened_and_failed() for term in sim.specimen.opening_terms)
            numbers = sim.comm.allreduce(np.array([broken.sum(), broken.size, *opened]))
            row |= dict(zip(BROKEN, numbers.tolist(), strict=True))
            row |= {name: int(row[name]) for name in BROKEN[:3]}
        self.history.append(row)
        self._check_overlap(overlap)
        self.last["row"] = sim.state.num_steps
        self.check_energy(energies)
        return energies

    def _contacts(self):
        """Resolution of contacts or None, and overlap over the grains' volume. Collective."""
        patches = self.simulation.contact_patches()
        if patches is None:
            return None, 0.0
        overlap = float(patches.overlap.sum()) / self.voids.solid
        return of_patches(patches), overlap

    def _check_overlap(self, overlap):
        """Raise SolverError where grains lie in each other. Collective."""
        overlap = self.simulation.comm.bcast(overlap)  # only rank 0 has it
        if overlap > MOST_OVERLAP:
            raise SolverError(
                f"grains lie in each other by {overlap:.0%} of their volume at strain "
                f"{self.loading.strain:.4f}, expected at most {MOST_OVERLAP:.0%}: they have no "
                "room left, and contact no longer keeps them apart; end the test before"
            )

    def vertical_stress(self, forces=None):
        """Mean of those on the bottom and on the top [Pa]. Collective without the forces [N]."""
        measures = self.loading.measures
        forces = measures.forces() if forces is None else forces
        return float(self.container.stresses(forces, measures.lengths())[-1])

    def _check_lock(self):
        if self.lock is not None:
            self.lock.check()

    def check_energy(self, energies):
        """Stop where the balance of these energies is off. Collective.

        Raises:
            UnstableError: It is.
        """
        loading = self.loading
        self.guard.check(energies, f"at strain {loading.strain:.4f}", loaded=loading.loaded)

    def write_state(self):
        """One state of all fields."""
        self._check_lock()
        self._follow_mesh()
        sim, state = self.simulation, self.simulation.state
        sim.complete()
        solid, num_cells, nodes = sim.solid, sim.mesh.num_shown_cells, sim.mesh.shown_nodes
        dents = sim.contact.dissipation.dents

        def work(rows):
            return state.plastic_work[rows] + dents.work[rows]

        at_nodes = {
            "displacement": state.u,
            "velocity": state.v,
            **nodal_contact(sim.contact, sim.mesh.num_nodes),
        }
        self.fields.write(
            self.num_states,
            state.t,
            self.loading.strain,
            self.loading.stage,
            {name: values[nodes] for name, values in at_nodes.items()} if self.tools else at_nodes,
            {
                "stress": Computed((num_cells, 6), lambda rows: solid.stress(state, rows)),
                "von_mises": Computed(
                    (num_cells,), lambda rows: von_mises(solid.deviator(state, rows))
                ),
                "pressure": Computed((num_cells,), lambda rows: -solid.mean_stress(state, rows)),
                "plastic_strain": state.plastic_strain[:num_cells],
                **self._broken(num_cells),
                **({"plastic_work": Computed((num_cells,), work)} if dents.any else {}),
            },
        )
        strength = surface_strength(solid, sim.contact.own, state.plastic_strain)
        # Masses and centres of grains are those without additions.
        mass = sim.scaling.first_mass if sim.scaling else solid.mass
        network = find_network(sim.contact, sim.mesh, mass, state.x, strength)
        self.contacts.write(self.num_states, state.t, network)
        number, mesh = f"{self.num_states:04d}", f"fields/{self.fields.mesh}"
        self._note([f"fields/{number}.vtkhdf"], mesh)
        tables = (f"{name}_{number}.csv" for name in ("contacts", "grains", "patches"))
        self._note([f"contacts/{name}" for name in (*tables, f"{number}.vtkhdf")])
        if self.tools is not None:
            loads = sim.tools.forces()
            self._note([self.tools.write(self.num_states, state.t, state.x, loads)])
        self.num_states += 1
        self.last["state"] = state.num_steps

    def _broken(self, num_cells):
        """Fields of grains that can break: their pieces, and what terms know of cells. Local."""
        terms = self.simulation.specimen.opening_terms
        if not terms:
            return {}
        piece = self.simulation.mesh.piece_of_cell
        whole = np.zeros(num_cells, dtype=np.int32)
        found = {"fragment": whole if piece is None else piece[:num_cells]}
        for term in terms:
            found |= {name: values[:num_cells] for name, values in term.cell_fields().items()}
        return found

    def _note(self, names, mesh=None):
        """Record files that were written; rank 0 does so, whose checkpoint header counts."""
        message = None
        if self.simulation.comm.rank == 0:
            try:
                self.record.add(names, self.loading.strain, mesh)
            except (InputError, OSError) as error:
                message = str(error)
        raise_together(self.simulation.comm, message)
