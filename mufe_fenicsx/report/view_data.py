"""What the 3D view of the page shows of a run: surfaces, fields, grains and contacts of stages."""

import json
from dataclasses import dataclass, replace

import numpy as np

from mufe_fenicsx.analysis.same_nodes import same_nodes
from mufe_fenicsx.container import CYLINDER, WALLS
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.report import style
from mufe_fenicsx.report.packing import GRID_STEPS, Packer, to_bytes, to_grid
from mufe_fenicsx.report.surfaces import NodeMeans, grain_surfaces, thinned
from mufe_fenicsx.report.view_tables import PALETTE, pack_columns, pack_contacts

#: Size that the packed data aim at [characters]; each node takes so many, once and a stage.
BUDGET, ONCE, A_STAGE = 15e6, 9.5, 8.7
MOST_STAGES = 12


@dataclass(frozen=True)
class Field:
    """A field that colours surfaces."""

    name: str  #: in the stored states
    title: str
    symbol: str  #: unit without prefix, "" without unit
    colours: str  #: name of a map
    power: int = 2  #: of the packed bytes; 1: it has both signs
    low: float = 0.0
    high: float = 0.0  #: range over all stages
    limit: float = 1.0  #: upper end of the colours at first


FIELDS = (
    Field("von_mises", "von Mises stress", "Pa", "stress"),
    Field("plastic_strain", "Plastic strain", "", "stress"),
    Field("pressure", "Mean pressure, compression positive", "Pa", "signed", power=1),
    Field("contact_pressure", "Contact pressure", "Pa", "pressure"),
    Field("contact_shear", "Shear traction at contacts", "Pa", "pressure"),
    Field("contact_slip", "Slip distance at contacts", "m", "pressure"),
    Field("fragment", "Fragment of its grain, 0: the largest", "", "stress"),
    Field("crack", "Softening of its worst facet, 1: failed", "", "stress"),
)


@dataclass(frozen=True)
class ViewData:
    """The view of a run, ready for the page."""

    header: str  #: JSON
    data: str  #: arrays, base64
    description: str  #: what is shown and how exact it is, in a sentence or two


def view_data(run, budget=BUDGET, known=None):
    """Pack what the page shows in 3D.

    Args:
        run: :class:`mufe_fenicsx.results.Run`.
        budget: Size of the data to aim at [characters]: it bounds the number of stages, and
            where two of them are too large, surfaces are thinned.
        known: A :class:`~mufe_fenicsx.report.sample.State` of the run, whose boundary faces are
            not looked for again if its cells are the same, or None.

    Returns:
        :class:`ViewData` or None, and a list of sentences about what is not shown.
    """
    return _Builder(run, budget, known).build()


class _Builder:
    def __init__(self, run, budget, known):
        self.run, self.budget, self.known = run, budget, known
        self.lacking = {}  # what some stages lack -> why, one for each of them
        self.left_out = []  # why a state is not among the stages

    def build(self):
        try:
            numbers = self.run.states.index
        except InputError as error:
            return None, [f"No 3D view: {error}."]
        states = [state for number in numbers if (state := self._readable(number))]
        if not states:
            return None, ["No 3D view: no stored state can be read.", *self._missing()]
        first = states[0]
        if "fragment" in states[-1].fields:
            first = states[-1]  # that has the faces of all cracks
        try:
            self.mesh = first.reference, first.cells, first.grain
        except InputError as error:
            return None, [f"No 3D view: {error}."]
        known, boundary = self.known, None
        if known is not None and np.array_equal(known.cells, first.cells):
            boundary = known.faces
        surfaces = grain_surfaces(first.cells, first.grain, boundary)
        at_most = int(self.budget / (ONCE + 2 * A_STAGE))
        self.surfaces = thinned(surfaces, first.reference, at_most)
        self.whole = surfaces.nodes.size
        num = int((self.budget / self.surfaces.nodes.size - ONCE) / A_STAGE)
        num = min(max(num, 2), MOST_STAGES, len(states))
        chosen = np.unique(np.linspace(0, len(states) - 1, num).round().astype(int))
        self.num_stored = len(states)
        return self._pack([states[i] for i in chosen]), self._missing()

    def _without(self, what, error):
        self.lacking.setdefault(what, []).append(str(error))

    def _missing(self):
        """A sentence for each thing that is lacking; paths are those in the run folder."""
        found = [
            f"The 3D view lacks {what} at {len(why)} of its stages: {why[0]}."
            for what, why in self.lacking.items()
        ]
        if self.left_out:
            found.append(f"The 3D view leaves out {len(self.left_out)} states: {self.left_out[0]}.")
        return [sentence.replace(f"{self.run.path}/", "") for sentence in found]

    def _readable(self, number):
        try:
            state = self.run.state(number)
            if "displacement" not in state.fields:
                raise InputError(f"state {number} has no field displacement, expected one")
            return state
        except InputError as error:
            self.left_out.append(error)
            return None

    def _pack(self, states):
        stages, points, values = [], [], {field.name: [] for field in FIELDS}
        for state in states:
            try:
                here, found = self._read(self.run.state(state.index))  # keeps no arrays
            except InputError as error:
                self.left_out.append(error)
                continue
            points.append(here)
            for name, of_stage in values.items():
                of_stage.append(found.get(name))
            stages.append(
                {"state": int(state.index), "strain": float(state.strain), "time": state.time}
                | {"stage": state.stage}
            )
        if not stages:
            return None
        packer = Packer()
        low, high = self._pack_points(packer, points)
        fields = self._pack_fields(packer, values)
        labels, numbers = self.surfaces.labels, [stage["state"] for stage in stages]
        columns = pack_columns(packer, self.run, numbers, labels, self._without)
        pack_contacts(packer, self.run, numbers, labels, self._without)
        for name, table in maps().items():
            packer.add(f"map.{name}", table, "u1")
        header = {
            "low": low.tolist(),
            "high": high.tolist(),
            "labels": self.surfaces.labels.tolist(),
            "stages": stages,
            "fields": fields,
            "columns": columns,
            "walls": list(WALLS),
            "round": self.run.container is CYLINDER,
            "arrays": packer.entries,
        }
        step = (high - low).max() / GRID_STEPS / 2
        return ViewData(
            json.dumps(header, ensure_ascii=False).replace("<", "\\u003c"),
            packer.text(),
            self._description(len(stages), step),
        )

    def _read(self, state):
        """Surface nodes of a state now [m], and fields at them, dict name -> values."""
        same = same_nodes(self.mesh, (state.reference, state.cells, state.grain))
        at = same[self.surfaces.nodes]
        points, found = state.points, {}
        means = NodeMeans(points, state.cells)
        for field in FIELDS:
            if field.name not in state.fields:
                continue
            values = state.field(field.name)
            if len(values) == len(state.cells) and len(values) != len(points):
                values = means(values)
            if values.ndim == 2:
                values = np.linalg.norm(values, axis=1)
            found[field.name] = values[at].astype(np.float32)
        return points[at], found

    def _pack_points(self, packer, points):
        """Reference positions and those of each stage as differences; the corners of the box."""
        surfaces = self.surfaces
        reference = self.mesh[0][surfaces.nodes]
        everything = [reference, *points]
        low = np.min([x.min(axis=0) for x in everything], axis=0)
        high = np.max([x.max(axis=0) for x in everything], axis=0)
        packer.add("num_of_grain", surfaces.num_of_grain, "u4")
        a, b, c = surfaces.faces.T
        packer.add("faces", np.concatenate([np.diff(a, prepend=0), b - a, c - a]), "u4")
        before = np.zeros(reference.shape, np.uint16)
        for number, x in enumerate(everything):
            steps = to_grid(x, low, high)
            # Modulo 2¹⁶, as is the sum.
            packer.add(f"points.{number}", (steps - before).T, "u2", differences=True)
            before = steps
        return low, high

    def _pack_fields(self, packer, values):
        rows = []
        for field in FIELDS:
            of_stage = values[field.name]
            there = [v for v in of_stage if v is not None]
            if not there:
                continue
            field = _with_range(field, there)
            name = f"field.{field.name}"
            for number, v in enumerate(of_stage):
                if v is None:
                    continue
                q = to_bytes(v, field.low, field.high, field.power)
                packer.add(f"{name}.{number}", q, "u1", differences=True)
            factor, unit = style.unit_of([field.limit], field.symbol)
            if not field.symbol:
                factor, unit = 1.0, ""
            rows.append(
                {"name": field.name, "title": field.title, "unit": unit, "factor": factor}
                | {"low": field.low, "high": field.high, "power": field.power}
                | {"limit": field.limit, "colours": field.colours}
            )
        return rows

    def _description(self, num_stages, step):
        shown, whole = self.surfaces.nodes.size, self.whole
        text = (
            f"Surfaces of {style.number(self.surfaces.labels.size)} grains, "
            f"{style.number(len(self.surfaces.faces))} facets of the mesh"
        )
        if shown < whole:
            text += f", thinned from {style.number(whole)} to {style.number(shown)} nodes"
        return (
            f"{text}, at {num_stages} of {self.num_stored} stored states. Positions are exact to "
            f"{style.quantity(step, 'm', 2)}. Stress and strain at a node are the mean of the "
            "tetrahedra around it by volume, so that peaks of single tetrahedra are lower than in "
            "the tables. Values have 255 steps, finer where they are small."
        )


def _with_range(field, values):
    """The field with its range over all stages and the upper end of the colours."""
    high = float(max(v.max(initial=0.0) for v in values))
    low = float(min(v.min(initial=0.0) for v in values))
    last = np.abs(values[-1][values[-1] != 0])
    limit = float(np.percentile(last, 99)) if last.size else high
    if field.power != 1:
        low = 0.0
    return replace(field, low=low, high=high, limit=style.round_limit(limit))


def maps():
    """Tables of 256 colours, uint8, shape (256, 3), by the names that fields use."""
    import matplotlib
    from matplotlib.colors import to_rgb

    at = np.linspace(0, 1, 256)
    tables = {
        "stress": matplotlib.colormaps[style.STRESS_MAP](at)[:, :3],
        "pressure": matplotlib.colormaps[style.PRESSURE_MAP](at)[:, :3],
        "signed": matplotlib.colormaps[style.SIGNED_MAP](at)[:, :3],
    }
    tables["pressure"][0] = 0.86  # free surface is grey
    palette = np.array([to_rgb(colour) for colour in (*PALETTE, style.GREY)])
    tables["labels"] = np.repeat(palette, 32, axis=0)
    return {name: np.rint(255 * table).astype(np.uint8) for name, table in tables.items()}
