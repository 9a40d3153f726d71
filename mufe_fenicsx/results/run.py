"""A run folder opened for reading: what is there, what is not, and what follows from it."""

import csv
import tomllib
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas
from numpy.typing import ArrayLike

from ..analysis.macro import inner_lengths
from ..container import Container, container_of_history
from ..errors import InputError, shortened
from ..geometry.measure import renumbered, tet_volumes
from ..machine.files import reason, regular
from ..machine.notebook import html_table
from ..output.contacts import CONTACT_COLUMNS, contact_files, read_contacts, read_patches
from ..output.fields import MESH, read_arrays, read_states
from ..output.history import history_columns, read_history
from ..output.run_folder import read_run_json, wrong_entries
from . import contact_tables, grain_tables, graph, localisation, sample_tables
from .columns import check_finite, described, exact_csv
from .rows import run_rows
from .state import State

if TYPE_CHECKING:
    import networkx

#: Table of the pairs of grains that `mufe segment` saw to touch.
LABEL_CONTACTS = "label_contacts"
#: By one of these a folder is known as that of a run.
SIGNS = ("run.json", "history.csv", "fields")


class _Table(pandas.DataFrame):
    """A table that lacks what a damaged file, or one of an earlier version, lacks."""

    @property
    def _constructor(self):
        return _Table

    def __getitem__(self, key):
        try:
            return super().__getitem__(key)
        except KeyError as error:
            raise InputError(f"the table has no column: {shortened(error.args[0])}") from None


def _of(table, within):
    """A table of contacts or patches; with those of pieces of one grain, or without."""
    if within:
        return table
    return table[table["grain_a"] != table["grain_b"]].reset_index(drop=True)


class Run:
    """A run folder: finished, still running, or killed.

    Files are read when they are asked for. :attr:`missing` says what is not there; what needs it
    raises an InputError of one line. Lengths are in m, stresses in Pa, all else in SI units. Tables
    say so by column in ``attrs["units"]``, and in ``attrs["signs"]`` what is positive.

    Args:
        path: Folder that `mufe run` wrote.

    Raises:
        InputError: It is no such folder.
    """

    def __init__(self, path: str | Path):
        self.path = Path(path)
        if not self.path.is_dir():
            raise InputError(f"run folder {path} is absent, expected a folder that mufe run wrote")
        if not any((self.path / name).exists() for name in SIGNS):
            raise InputError(
                f"run folder {path} has none of run.json, history.csv and fields, expected a "
                "folder that mufe run wrote"
            )

    def __repr__(self):
        return (
            f"Run {self.path}: {len(self.stored_states)} states, {len(self.missing)} things missing"
        )

    def _repr_html_(self) -> str:
        """What was run and how far it came in a short table, which notebooks show."""
        return html_table(f"Run {self.path}", run_rows(self))

    # --- what the files hold --------------------------------------------------------------

    @cached_property
    def summary(self) -> dict:
        """run.json, a dict."""
        return read_run_json(self.path)

    @cached_property
    def scene(self) -> dict:
        """scene.toml with every default written out, a dict of dicts in SI units."""
        path = self.path / "scene.toml"
        try:
            return tomllib.loads(regular(path).read_text(encoding="utf-8"))
        except OSError as error:
            raise InputError(f"{path} cannot be read ({reason(error)})") from error
        except (ValueError, RecursionError) as error:
            raise InputError(f"{path} is not valid TOML ({shortened(error)})") from error

    @property
    def finished(self) -> bool:
        """Whether the test reached its end, as run.json says it; False without that file."""
        try:
            return bool(self.summary.get("finished"))
        except InputError:
            return False

    @property
    def history(self) -> pandas.DataFrame:
        """history.csv as it is now, a DataFrame with a row a record."""
        return described(_Table(read_history(self.path / "history.csv")), "history")

    @property
    def stored_states(self) -> list[dict]:
        """The stored states as dicts with index, time [s], strain and stage."""
        return read_states(self.path)

    @property
    def states(self) -> pandas.DataFrame:
        """The stored states: time [s], strain, stage; the index is their number."""
        table = pandas.DataFrame(self.stored_states, columns=["index", "time", "strain", "stage"])
        return described(table.set_index("index"), "states")

    def state(self, number: int = -1) -> State:
        """One stored state, :class:`~mufe_fenicsx.results.state.State`; -1 is the last.

        Raises:
            InputError: It was not stored.
        """
        listed = self.stored_states
        if number < 0:
            found = listed[number] if -number <= len(listed) else None
        else:
            found = next((s for s in listed if s["index"] == number), None)
        if found is None:
            raise InputError(
                f"state {number} is not in {self.path / 'fields'}, expected one of the "
                f"{len(listed)} that are stored"
            )
        return State(self.path, found, self._no_grains)

    @property
    def _no_grains(self):
        """Labels in the fields that are no grains: that of a membrane, where run.json tells it."""
        try:
            membrane = self.summary.get("membrane")
        except InputError:
            return ()
        return () if membrane is None else (membrane["label"],)

    def contacts(self, number: int = -1, within: bool = False) -> pandas.DataFrame:
        """Contacts of a stored state as stored, open ones too: a row a pair of bodies.

        Those between pieces of one grain, of which it is both, are there only ``within``.

        :meth:`active_contacts` has those that carry a force, and more of each. Columns:
        :data:`mufe_fenicsx.output.contacts.CONTACT_COLUMNS`.
        """
        return _of(self._network(number)[0], within)

    def patches(self, number: int = -1, within: bool = False) -> pandas.DataFrame:
        """Patches of contact of a stored state, and how facets resolve them: a row a patch.

        ``within`` as of :meth:`contacts`.

        Columns: :data:`mufe_fenicsx.output.contacts.PATCH_COLUMNS`.
        """
        table = _Table(read_patches(self.path, self.state(number).index))
        return _of(described(table, "patches"), within)

    def grains(self, number: int = -1) -> pandas.DataFrame:
        """Contacts' sums of each grain of a stored state as stored, a row a grain.

        :meth:`grain_table` has form, motion and stress. Columns:
        :data:`mufe_fenicsx.output.contacts.GRAIN_COLUMNS`.
        """
        return self._network(number)[1]

    def _network(self, number):
        index = self.state(number).index
        contacts, grains = read_contacts(self.path, index)
        if not contacts:
            raise InputError(
                f"{self.path / 'contacts'} has no tables of state {index}, expected "
                f"contacts_{index:04d}.csv and grains_{index:04d}.csv"
            )
        return described(_Table(contacts), "contacts"), described(_Table(grains), "grains")

    def with_contacts(self) -> pandas.DataFrame:
        """The rows of :attr:`states` whose tables of contacts were written, as a DataFrame.

        A run that is killed, or read, just before it writes them has a last state without.
        """
        states = self.states
        return states[[all(p.exists() for p in contact_files(self.path, i)) for i in states.index]]

    def table(self, name: str) -> pandas.DataFrame:
        """A table of the grains that was kept with the run: "labels" or "quality"."""
        path = self.path / f"{name}.csv"
        try:
            return exact_csv(path)
        except OSError as error:
            raise InputError(f"{path} cannot be read ({reason(error)})") from error
        except ValueError as error:  # pandas' errors of parsing, and torn text
            raise InputError(f"{path} is not a table ({reason(error)})") from error

    @property
    def doubted(self) -> list[tuple[int, int]] | None:
        """Pairs of labels whose contact `mufe segment` doubts; None where that is not known."""
        if not (self.path / f"{LABEL_CONTACTS}.csv").is_file():
            return None
        table = self.table(LABEL_CONTACTS)
        if not {"label_a", "label_b", "doubt"} <= set(table):
            return None
        doubts = table[table["doubt"].notna() & (table["doubt"].astype(str) != "")]
        return list(zip(doubts["label_a"].tolist(), doubts["label_b"].tolist(), strict=True))

    # --- the box and its content ----------------------------------------------------------

    @cached_property
    def _start(self):
        """Corners of the box at the start [m], shape (2, 3), and volume of the grains [m³]."""
        arrays = read_arrays(self.path, MESH, ["Points", "Connectivity", "CellData/grain"])
        cells = arrays["Connectivity"].reshape(-1, 4)
        nodes, cells = renumbered(cells[~np.isin(arrays["CellData/grain"], self._no_grains)])
        points = arrays["Points"][nodes]
        volume = tet_volumes(points, cells).sum()
        return np.array([points.min(axis=0), points.max(axis=0)]), float(volume)

    @property
    def box(self) -> np.ndarray:
        """Corners of the box between the walls at the start of the run [m], shape (2, 3)."""
        return self._start[0]

    @property
    def container(self) -> Container:
        """Names and measures of the walls, :class:`~mufe_fenicsx.container.Container`."""
        return container_of_history(self.history)

    @property
    def solid_volume(self) -> float:
        """Volume of all grains in the reference configuration [m³]."""
        return self._start[1]

    def lengths(self, history: pandas.DataFrame) -> np.ndarray:
        """Lengths along the axes of the container [m], shape (num_rows, num_axes).

        Those of a box are along x, y and z; of a cylinder its diameter and its height.

        Raises:
            InputError: Walls moved, and the history does not say how far.
        """
        found = inner_lengths(history)
        if found is not None:
            return found
        walls = self.scene.get("walls", {})
        for name in ("x_min", "x_max", "y_min", "y_max"):
            wall = walls.get(name, {})
            if wall.get("velocity") or wall.get("stress"):
                raise InputError(
                    f"wall {name} moved, and {self.path / 'history.csv'} has no columns length_x "
                    "and length_y, expected those of a newer version of the program"
                )
        size = self.box[1] - self.box[0]
        return np.column_stack([np.tile(size[:2], (len(history), 1)), history["height"]])

    # --- what follows ---------------------------------------------------------------------

    def curves(self, width: float = 0.01) -> pandas.DataFrame:
        """Stress, void ratio, moduli and K0 a row of the history, a DataFrame.

        Columns: those of :func:`mufe_fenicsx.analysis.macro.oedometer_curves`, time and stage.
        """
        return described(sample_tables.curves(self, width), "curves")

    def stresses(self) -> pandas.DataFrame:
        """Stress of the contacts against that of the walls at each stored state, a DataFrame.

        See :func:`mufe_fenicsx.results.sample_tables.stresses`.
        """
        return described(sample_tables.stresses(self), "stresses")

    def breakage(self) -> pandas.DataFrame:
        """Sizes of fragments and numbers of breakage at each stored state, a DataFrame.

        See :func:`mufe_fenicsx.results.sample_tables.breakage`.
        """
        return described(sample_tables.breakage(self), "breakage")

    @property
    def events(self) -> pandas.DataFrame:
        """What opened in grains that break, a row for the facets of a grain that did together.

        Columns: ``time`` [s], ``strain``, ``stage``, ``grain``, middle ``x``, ``y``, ``z`` [m],
        ``area`` [m²], ``mode``, ``energy`` to open them [J] and mean ``strength`` drawn [Pa].

        Raises:
            InputError: Its grains cannot break: there is no events.csv.
        """
        return described(self._of_fracture("events"), "events")

    @property
    def strengths(self) -> pandas.DataFrame:
        """Strengths that were drawn for grains that break, a row a grain.

        Columns: ``grain``, ``volume`` [m³], ``num_facets``, and the ``least``, ``median`` and
        ``largest`` of their strengths [Pa]; with ``scatter = "grain"`` all three are one.

        Raises:
            InputError: Its grains cannot break: there is no strengths.csv.
        """
        return described(self._of_fracture("strengths"), "strengths")

    def _of_fracture(self, name):
        return _Table(read_history(self.path / f"{name}.csv"))

    def network(self) -> pandas.DataFrame:
        """Fabric, coordination, sliding and force chains at each stored state, a DataFrame.

        See :func:`mufe_fenicsx.results.contact_tables.network`.
        """
        return described(contact_tables.network(self), "network")

    def graph(self, number: int = -1) -> "networkx.Graph":
        """Grains, walls and active contacts of a stored state, a networkx.Graph.

        See :func:`mufe_fenicsx.results.graph.contact_graph`.
        """
        return graph.contact_graph(self, number)

    def write_graphml(self, path: str | Path, number: int = -1) -> None:
        """Write :meth:`graph` as GraphML, which Gephi and Cytoscape read.

        See :func:`mufe_fenicsx.results.graph.write_graphml`.
        """
        graph.write_graphml(self, path, number)

    def active_contacts(self, number: int = -1, angle: float = 45.0) -> pandas.DataFrame:
        """Active contacts with their part in the network, a DataFrame.

        See :func:`mufe_fenicsx.results.contact_tables.active_contacts`.
        """
        return described(contact_tables.active_contacts(self, number, angle), "active_contacts")

    def contact_ages(self, number: int = -1) -> pandas.DataFrame:
        """Since when each active contact has been active, a DataFrame with a row a contact.

        See :func:`mufe_fenicsx.results.contact_tables.contact_ages`.
        """
        return described(contact_tables.contact_ages(self, number), "contact_ages")

    def wall_friction(self, number: int = -1) -> pandas.DataFrame:
        """Normal and tangential force on each wall, a DataFrame with a row a wall."""
        return described(sample_tables.wall_friction(self, number), "wall_friction")

    def grain_table(self, number: int = -1) -> pandas.DataFrame:
        """Form, motion, stress and contacts of each grain at a stored state, a DataFrame.

        See :func:`mufe_fenicsx.results.grain_tables.grain_table`.
        """
        return described(grain_tables.grain_table(self, number), "grain_table")

    def localisation(self, number: int = -1, since: int | None = None) -> pandas.DataFrame:
        """Strain around each grain between two stored states, a DataFrame with a row a grain.

        See :func:`mufe_fenicsx.results.localisation.localisation`.
        """
        return described(localisation.localisation(self, number, since), "localisation")

    def first_yield(self) -> pandas.DataFrame:
        """When and where each grain was first seen to yield, a DataFrame with a row a grain.

        See :func:`mufe_fenicsx.results.grain_tables.first_yield_table`.
        """
        return described(grain_tables.first_yield_table(self), "first_yield")

    def probe(self, points: ArrayLike | None = None, grains: ArrayLike | None = None):
        """Displacement and stress of places or of grains through all stored states.

        See :func:`mufe_fenicsx.results.grain_tables.probe`.
        """
        return described(grain_tables.probe(self, points, grains), "probe")

    # --- what is not there ----------------------------------------------------------------

    @property
    def missing(self) -> list[str]:
        """Sentences about what the folder lacks or what cannot be read; empty: all is there."""
        found = []

        def attempt(read):
            try:
                return read()
            except InputError as error:
                found.append(f"{error}.")
                return None

        summary = attempt(lambda: read_run_json(self.path))
        wrong = attempt(lambda: wrong_entries(self.path)) or []
        if wrong:
            found.append(f"run.json: {', '.join(sorted(wrong))}, which is not what a run writes.")
        if summary is not None and not summary.get("finished"):
            why = summary.get("stop_reason") or "no reason recorded"
            if why == "running":
                why = "it still runs, or was cut off"
            found.append(f"The rest of the run, which did not finish ({why}).")
        attempt(lambda: self.scene)
        history = attempt(lambda: self.history)
        if history is not None:
            needed = history_columns(container_of_history(history))
            absent = [name for name in needed if name not in history]
            if absent:
                found.append(f"history.csv has no column {', '.join(absent)}.")
            if "stage" in history and not (history["stage"] != "seating").any():
                found.append("The loading stage: history.csv has no row of it.")
            attempt(lambda: check_finite("history.csv", history))
        states = attempt(lambda: self.stored_states)
        if states == []:
            found.append("Stored states: there is none in the folder fields.")
        mesh = attempt(lambda: self._start)
        for state in states or [] if mesh is not None else []:
            attempt(lambda s=state: read_arrays(self.path, s["index"]))
            attempt(lambda s=state: self._check_contacts(s["index"]))
        return list(dict.fromkeys(found))

    def _check_contacts(self, index):
        """See that the tables of contacts of a state have all columns, and numbers in them."""
        contacts, grains = contact_files(self.path, index)
        try:
            with regular(contacts).open(newline="", encoding="utf-8") as file:
                columns = next(csv.reader(file), [])
            grains.stat()
        except OSError as error:
            raise InputError(
                f"contacts of state {index}: {error.filename} cannot be read ({reason(error)})"
            ) from error
        except (UnicodeDecodeError, csv.Error) as error:
            raise InputError(
                f"contacts of state {index}: {contacts} cannot be read ({shortened(error)})"
            ) from error
        absent = [name for name in CONTACT_COLUMNS if name not in columns]
        if absent:
            raise InputError(f"the tables of contacts have no column {', '.join(absent)}")
        table, of_grains = self._network(index)
        # A contact that has opened has no place any more, and on a wall no branch to it.
        places = [name for name in table if name.startswith(("centroid_", "branch_"))]
        is_open = table["num_points"] == 0
        known = table[places].mask(is_open, 0.0)
        check_finite(contacts.name, table.assign(**known))
        check_finite(grains.name, of_grains)
