"""What the figures of a run are drawn from, each thing read or computed once."""

from contextlib import suppress
from functools import cached_property, partial
from pathlib import Path

import numpy as np

from mufe_fenicsx.analysis import grain_energy, inertia, kinematics
from mufe_fenicsx.analysis.carriers import find_carriers
from mufe_fenicsx.analysis.checks import check_run
from mufe_fenicsx.analysis.contact_resolution import classes_of_contacts, contact_resolution
from mufe_fenicsx.analysis.grain_stress import unstressed
from mufe_fenicsx.analysis.quasi_static import knows_balance, platens_alone, trusted_from
from mufe_fenicsx.analysis.rows import loading_rows, tool_load, turns_back
from mufe_fenicsx.container import container_of_history
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.form.proportions import median_diameter
from mufe_fenicsx.geometry.measure import tet_volumes
from mufe_fenicsx.output.fields import read_arrays, read_states
from mufe_fenicsx.output.history import NEWER_COLUMNS, history_columns, read_history
from mufe_fenicsx.report import style
from mufe_fenicsx.report.render import cannot_render, start_probe
from mufe_fenicsx.report.sample import load_states
from mufe_fenicsx.results import Run
from mufe_fenicsx.results.reference_curves import curves_of_run, read_reference, references_of
from mufe_fenicsx.scene.reference import Reference

#: Columns of the history that no figure needs, and that runs of earlier versions may lack.
UNUSED = (*NEWER_COLUMNS, "dt", "speed", "residual", "added_mass", "added_mass_of_grain")


class ReadableRun(Run):
    """A run of which only the states that can be read are counted."""

    @cached_property
    def stored_states(self):
        """Those of the stored states that can be read, as dicts."""
        try:
            listed = read_states(self.path)
        except InputError:
            return []
        return [state for state in listed if self._can_be_read(state["index"])]

    def _network(self, number):
        return self._once("network", number, super()._network)

    chain_angle = 45.0  #: of force chains [degrees]

    def active_contacts(self, number=-1):
        """Active contacts of a state, as `Run.active_contacts`, read once."""
        read = partial(super().active_contacts, angle=self.chain_angle)
        return self._once("contact table", number, read)

    def _once(self, what, number, read):
        """What several figures need of a state, read once."""
        if (what, number) not in self._kept:
            self._kept[what, number] = read(number)
        return self._kept[what, number]

    @cached_property
    def _kept(self):
        return {}

    def _can_be_read(self, index):
        try:
            read_arrays(self.path, index)
        except InputError:
            return False  # which `Run.missing` says
        return True


class Source:
    """A run, and what follows from it.

    Args:
        folder: The run folder.
        grains: Labels of the grains that are shown one by one; None: three by their stress.
        points: Places whose course is shown [m], shape (num_points, 3); None: two by stress.
        chain_angle: Of force chains [degrees].
        overlays: Files of measured curves, beside those that the scene names.
        packing: Settings of its packing by name, such as "pack.seed", where they are known.

    Raises:
        InputError: There is no run; from each attribute, that it cannot be had.
    """

    def __init__(
        self, folder, grains=None, points=None, chain_angle=45.0, overlays=(), packing=None
    ):
        self.run = ReadableRun(folder)
        self.run.chain_angle = chain_angle
        self.folder = self.run.path
        self._grains, self._points = grains, points
        self.overlays = tuple(map(Path, overlays))
        self.packing = packing or {}
        self._probe = None

    @property
    def asked(self):
        """What was asked for: grains and points, as tuples or None, the angle and the overlays."""
        points = self._points
        return (
            tuple(self._grains) if self._grains else None,
            tuple(map(tuple, points)) if points is not None and len(points) else None,
            self.run.chain_angle,
            self.overlays,
        )

    def get(self, name):
        """An attribute, or None where it cannot be had; that was said with the files."""
        try:
            return getattr(self, name)
        except InputError:
            return None

    @cached_property
    def summary(self):
        """run.json, empty where it cannot be read."""
        try:
            return dict(self.run.summary)
        except InputError:
            return {}

    @property
    def scene(self):
        """scene.toml as of :class:`Run`."""
        return self.run.scene

    @cached_property
    def history(self):
        """dict column -> array with at least one row."""
        path = self.folder / "history.csv"
        history = read_history(path)
        needed = history_columns(container_of_history(history))
        absent = [name for name in needed if name not in {*history, *UNUSED}]
        if absent:
            raise InputError(f"{path} has no column {', '.join(absent)}")
        if not len(history["step"]):
            raise InputError(f"{path} has no row, expected one a record")
        scene = self.get("scene")
        if scene and not knows_balance(history) and platens_alone(scene):
            history["unbalanced_z"] = history["force_z_min"] - history["force_z_max"]
        return history

    @cached_property
    def references(self):
        """Measured curves: those of the scene that can be read, then the overlays.

        Raises:
            InputError: An overlay cannot be read.
        """
        found = []
        for given in self._stated_references:
            with suppress(InputError):  # a sentence says so
                found.append(read_reference(given))
        found += [read_reference(Reference(path)) for path in self.overlays]
        return list({one.label: one for one in found}.values())

    @property
    def unreadable_references(self):
        """Sentences about measured curves of the scene that cannot be read."""
        found = []
        for given in self._stated_references:
            try:
                read_reference(given)
            except InputError as error:
                found.append(f"Measured curves: {error}.")
        return found

    @property
    def _stated_references(self):
        """[[reference]] of the scene; none where the scene cannot be read."""
        try:
            return references_of(self.run.scene)
        except InputError:
            return []

    @cached_property
    def curves(self):
        """What can be compared with measured curves, dict quantity -> values since strain 0."""
        return curves_of_run(self.run)

    @cached_property
    def mass(self):
        """Mass of all grains, with what was added [kg]; None where it is not known."""
        if self.summary.get("mass"):
            return self.summary["mass"] + self.summary.get("added_mass", 0.0)
        try:  # of a run of earlier versions
            return float(self.run.grains(0)["mass"].sum())
        except (InputError, KeyError):
            return None

    @cached_property
    def loading(self):
        """The rows of the history after seating, dict column -> array."""
        rows = loading_rows(self.history)
        if not rows.any():
            raise InputError("the loading stage was not reached")
        return {name: values[rows] for name, values in self.history.items()}

    @cached_property
    def events(self):
        """What opened in grains that break, dict column -> array."""
        return read_history(self.folder / "events.csv")

    @cached_property
    def turns_back(self):
        """Whether the strain falls in some stage of the test; False without a history."""
        try:
            return turns_back(self.loading)
        except InputError:
            return False

    def over(self, strain, time):
        """What curves are drawn over, and its label: strain [-], or time.

        It is time where the strain turns back, and where tools load, as it stays zero there.

        Args:
            strain: Vertical strains.
            time: Of the same rows or states [s].
        """
        if not self.turns_back and tool_load(self.history) is None:
            return np.asarray(strain), style.STRAIN
        factor, unit = style.unit_of(self.history["time"], "s")
        return np.asarray(time) / factor, f"Time: {unit}"

    @property
    def reference_height(self):
        """Height of the sample at strain 0 [m]."""
        return self.summary.get("reference_height") or float(self.loading["height"][0])

    @cached_property
    def states(self):
        """Stored states at the start, middle and end of loading, :class:`State`; one at least."""
        if not self.run.stored_states:
            raise InputError(f"{self.folder / 'fields'} has no stored states that can be read")
        try:
            history = self.history
        except InputError:
            history = None
        return load_states(self.run, history)

    @property
    def start(self):
        """The first state."""
        return self.states[0]

    @property
    def end(self):
        """The last state."""
        return self.states[-1]

    @cached_property
    def no_pictures(self):
        """Why bodies in space cannot be drawn, None where they can."""
        return cannot_render(self._probe)

    def start_probe(self):
        """Let another process find out whether pictures can be drawn, while this one goes on."""
        self._probe = start_probe()

    def end_probe(self):
        """Wait for that process, if nothing asked for what it found out."""
        if self._probe is not None:
            self.no_pictures  # noqa: B018

    def need_rendering(self):
        """Raise InputError where bodies in space cannot be drawn."""
        if self.no_pictures:
            raise InputError(f"no 3D pictures: {self.no_pictures}")

    # --- contacts -------------------------------------------------------------------------

    @cached_property
    def contact_states(self):
        """Numbers of the stored states at the start, middle and end that have contacts."""
        index = self.run.with_contacts().index.to_numpy()
        if not index.size:
            raise InputError(f"{self.folder / 'contacts'} has no tables of stored states")
        wanted = [state.index for state in self.states]
        chosen = [i for i in wanted if i in index] or [index[-1]]
        if chosen[-1] != index[-1] and wanted[-1] not in index:
            chosen.append(index[-1])  # the last that there is
        return [int(i) for i in chosen]

    def active_contacts(self, index):
        """Active contacts of a state, as `Run.active_contacts`."""
        return self.run.active_contacts(index)

    def strain_of(self, index):
        """Strain of a state [-]."""
        return float(self.run.states.loc[index, "strain"])

    @cached_property
    def network(self):
        """A row a state with contacts, as `Run.network`."""
        if not len(self.run.with_contacts()):
            raise InputError(f"{self.folder / 'contacts'} has no tables of stored states")
        return self.run.network()

    @cached_property
    def patches(self):
        """Patches of contact, and of which contacts and when in words.

        Of the shown state whose contacts carry most; of those with walls where no grains touch.
        """
        tables = {i: self.run.patches(i) for i in self.contact_states}
        index = max(tables, key=lambda i: tables[i]["normal_force"].sum())
        between = tables[index]["grain_b"] != 0
        at_walls = not between.any()
        what = "contacts with walls" if at_walls else "contacts between grains"
        return tables[index][between | at_walls], f"{what}, strain {self.strain_of(index):.4f}"

    @cached_property
    def resolution(self):
        """How finely contacts are meshed, (:class:`Resolution`, words of which contacts)."""
        patches, which = self.patches
        found = contact_resolution(patches["elements_per_radius"], patches["normal_force"])
        if found is None:
            raise InputError("no stored state has contacts that carry a normal force")
        return found, which

    @cached_property
    def classes(self):
        """Those patches by their elements per contact radius, list of :class:`ClassOfContacts`."""
        names = ("elements_per_radius", "normal_force", "area_deformed", "yield_stress")
        return classes_of_contacts(*(self.patches[0][name] for name in names))

    @cached_property
    def checks(self):
        """All checks of a run, as far as its files go: list of :class:`Check`."""
        history = self.get("history")
        if history is None:
            return []
        known = "elements_per_radius" in history
        resolution = self.get("resolution") if known else None
        contacts = resolution and (*resolution, self.summary.get("edges_per_diameter"))
        sample = None
        if self.get("carriers") is not None and len(history["height"]):
            sample = self.carriers, self.diameters
        return check_run(history, self.mass, contacts, sample)

    @cached_property
    def carriers(self):
        """Who carries the load in the stored state whose contacts carry most; None: nobody."""
        tables = {i: self.run.contacts(i) for i in self.contact_states}
        index = max(tables, key=lambda i: tables[i]["normal_force"].sum())
        return find_carriers(tables[index], self.run.grains(index), self.run.doubted)

    @property
    def diameters(self):
        """Height of the sample at strain 0 in median diameters of its grains."""
        return self.reference_height / self.median_diameter

    @cached_property
    def median_diameter(self):
        """Diameter that half of the volume of the grains is finer than [m]."""
        if self.summary.get("diameters"):  # without a look at the mesh
            return self.reference_height / self.summary["diameters"]
        return median_diameter(self.inertia.mass)  # for unit density: volumes

    @cached_property
    def trust(self):
        """From where on the test is quasi-static."""
        return trusted_from(self.history, self.mass)

    @property
    def last_dynamic(self):
        """Number of the last row of :attr:`loading` that is not quasi-static; None: all are."""
        num_rows, row = len(self.loading["time"]), self.trust.row
        first = num_rows if row is None else row - (len(self.history["time"]) - num_rows)
        return first - 1 if first > 0 else None

    # --- grains ---------------------------------------------------------------------------

    @cached_property
    def inertia(self):
        """Of the grains in the reference configuration, for unit density."""
        state = self.end
        return inertia.grain_inertia(state.reference, state.cells, state.grain)

    @cached_property
    def motion(self):
        """Of the grains, from strain 0, the first stored state, to the last one."""
        state = self.end
        return kinematics.grain_motion(self.at_zero, state.points, state.cells, state.grain)

    @cached_property
    def at_zero(self):
        """Nodes at strain 0, in the order of those of the last state [m], (num_nodes, 3)."""
        return self.end.stored.points_of(self.start.stored)

    @cached_property
    def chosen(self):
        """dict label -> why it is shown, of the grains that are shown one by one."""
        labels, means = self.end.grain_means
        if self._grains:
            for label in self._grains:
                if label not in labels:
                    raise InputError(
                        f"grain {label} is not in the run, expected a label between {labels[0]} "
                        f"and {labels[-1]} that it has"
                    )
            return {int(label): "chosen" for label in self._grains}
        volume = np.bincount(np.searchsorted(labels, self.end.grain), self.end.volume)
        loaded = np.flatnonzero(~unstressed(means, volume) & (means > 0))
        if not loaded.size:
            raise InputError("no grain is loaded in the last stored state")
        order = loaded[np.argsort(means[loaded])]
        found = {}
        n = order.size
        for at, why in ((-1, "most loaded"), (n // 2, "median"), (n // 4, "lower quartile")):
            found.setdefault(int(labels[order[at]]), why)
        return found

    @cached_property
    def points(self):
        """dict name -> place in the reference configuration [m], whose course is shown."""
        if self._points is not None and len(self._points):
            return {f"point {k}": np.array(x) for k, x in enumerate(self._points, start=1)}
        label, state = next(iter(self.chosen)), self.end
        mine = np.flatnonzero(state.grain == label)
        middle = state.reference[state.cells[mine]].mean(axis=1)
        centre = state.volume[mine] @ middle / state.volume[mine].sum()
        return {
            "peak": middle[np.argmax(state.von_mises[mine])],
            "centre": middle[np.argmin(np.linalg.norm(middle - centre, axis=1))],
        }

    @cached_property
    def material(self):
        """E, nu, rho and, where grains yield, the table of the one material of all grains."""
        scene = self.run.scene
        found = scene.get("material") or {}
        if scene.get("materials") or found.get("scatter"):
            raise InputError("grains differ in material, expected one for all")
        if found.get("model") not in ("elastic", "j2"):
            raise InputError(f"material model is {found.get('model')!r}, expected elastic or j2")
        try:
            return {name: float(found[name]) for name in ("E", "nu", "rho")} | {
                "yield_stress": found.get("yield_stress"),
                "beyond": found.get("beyond", "flat"),
            }
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(f"scene.toml has an incomplete [material] ({error!r})") from error

    # --- all states in turn ---------------------------------------------------------------

    @cached_property
    def course(self):
        """Numbers of the stored states, of one state after the other, so that memory holds one.

        Returns:
            dict ``state``, ``time``, ``strain``, ``yielded`` (share of the grains) and
            ``plastic_volume`` (share of the volume), shape (num_states,); and, where all grains
            are of one known material and element, ``labels`` and ``energy``, dict elastic, plastic,
            kinetic -> [J], shape (num_states, num_grains); and ``without_work``, whether a state
            has no plastic work, so that its plastic energy has no dents.
        """
        try:
            material = self.material
        except InputError:
            material = None
        element = self.summary.get("element", "averaged")
        if element not in grain_energy.ELEMENTS:  # of an earlier version
            material = None
        found = {"state": [], "time": [], "strain": [], "yielded": [], "plastic_volume": []}
        energies, without_work = [], False
        for index in self.run.states.index:
            state = self.run.state(index)
            yields = state.plastic_strain > 0
            volume = tet_volumes(state.reference, state.cells)
            labels = state.labels
            found["state"].append(index)
            found["time"].append(state.time)
            found["strain"].append(state.strain)
            found["yielded"].append(np.unique(state.grain[yields]).size / labels.size)
            found["plastic_volume"].append(volume[yields].sum() / volume.sum())
            if material is not None:
                velocity = state.field("velocity") if "velocity" in state.fields else None
                if "plastic_work" in state.fields:
                    work = state.field("plastic_work")
                elif table := material["yield_stress"]:  # a state of an earlier version
                    without_work = True
                    work = volume * grain_energy.plastic_work(
                        state.plastic_strain, table, material["beyond"]
                    )
                else:
                    work = np.zeros(len(volume))
                energies.append(
                    grain_energy.grain_energy(
                        state.reference,
                        state.points,
                        state.cells,
                        state.grain,
                        state.stress,
                        work,
                        velocity,
                        grain_energy.GrainMaterial(
                            *(material[name] for name in ("E", "nu", "rho")),
                            flows=bool(material["yield_stress"]),
                        ),
                        element=element,
                    )
                )
        result = {name: np.array(values) for name, values in found.items()}
        if energies:
            result["labels"] = energies[0].labels
            result["without_work"] = without_work
            result["energy"] = {
                name: np.array([getattr(e, name) for e in energies])
                for name in ("elastic", "plastic", "kinetic")
            }
        return result
