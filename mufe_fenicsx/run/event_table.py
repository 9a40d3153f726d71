"""Tables of grains that break: the strengths that they were given, and what opened."""

from ..bulk.cracks.cracks import STRENGTHS
from ..output.history import HistoryWriter

#: Columns of events.csv: facets of a grain that opened together, by time.
COLUMNS = (
    "time", "strain", "stage", "grain", "x", "y", "z", "area", "mode", "energy", "strength",
)  # fmt: skip


class EventTable:
    """Writes events.csv and strengths.csv where grains can break. Collective, as its methods.

    Args:
        folder: The run folder.
        simulation: :class:`~mufe_fenicsx.explicit.simulation.Simulation`.
        kept: What :attr:`kept` was, where a run goes on.
    """

    def __init__(self, folder, simulation, kept=None):
        self.terms, self._table, kept = simulation.specimen.opening_terms, None, kept or {}
        if self.terms:
            self._table = HistoryWriter(
                folder / "events.csv", COLUMNS, simulation.comm, kept.get("bytes"), kept.get("rows")
            )
        for term in self.terms:
            rows = term.strengths_of_grains()
            with HistoryWriter(folder / "strengths.csv", STRENGTHS, simulation.comm) as table:
                for row in rows:
                    table.append(dict(zip(STRENGTHS, row, strict=True)))

    @property
    def kept(self):
        """What a table that goes on from here has to know, fit for JSON."""
        if self._table is None:
            return {}
        return {"bytes": self._table.sync(), "rows": self._table.rows}

    def write(self, strain, stage):
        """Write what opened since the last call."""
        for term in self.terms:
            for event in term.take_events() if term.news else ():
                place = dict(zip("xyz", map(float, event.place), strict=True))
                row = {"time": event.time, "strain": strain, "stage": stage, "grain": event.grain}
                row |= place | {"area": event.area, "mode": event.mode, "energy": event.energy}
                self._table.append(row | {"strength": event.strength})
