"""Where the time of a run goes: methods of one simulation replaced by ones that keep time.

Without a profile nothing is measured and nothing costs. Time spent in a part that another one
calls counts for the inner one alone, so that the parts add up to the whole.
"""

import time

import numpy as np

#: Parts and the methods that they are made of: (attribute of the simulation, method).
PARTS = {
    "tets": (("solid", "add_internal_forces"),),
    "contact search": (("contact", "search"),),
    "contact forces": (("contact", "begin_step"), ("contact", "add_forces")),
    "walls": (("walls", "add_forces"), ("walls", "move"), ("walls", "add_work")),
    "communication": (
        *(("contact.ghosts", name) for name in ("send", "receive", "begin_reverse", "end_reverse")),
        ("contact.motion", "end_agreement"),
    ),
    "motion": (("motion", "drift"), ("motion", "kick")),
    "rigid": (("rigid", "add_forces"), ("rigid", "drift"), ("rigid", "kick")),
    "cracks": (),  # terms that open facets, and growths of the mesh
    "time step": (("", "update_time_step"),),
    "checks": (("", "check"), ("", "energies")),
}


class Profile:
    """Seconds of this rank in each part of a simulation; local until :meth:`summary`.

    Args:
        simulation: :class:`~mufe_fenicsx.explicit.simulation.Simulation`.
    """

    def __init__(self, simulation):
        self.simulation = simulation
        self.seconds = dict.fromkeys([*PARTS, "output"], 0.0)
        self._inner = [0.0]  # time of parts within the one that runs now
        self._course = []  # rows of the table
        self._start, self._first = time.perf_counter(), simulation.state.num_steps
        self._searches = simulation.contact.num_searches
        self._keep_time()
        grow = self.timed(simulation.grow, "cracks")

        def grow_and_keep_time(between):
            grow(between)
            self._keep_time()  # of what is new

        simulation.grow = grow_and_keep_time

    def _keep_time(self):
        """Replace methods of all parts, where they are not yet, by ones that keep time. Local."""
        simulation = self.simulation
        for part, methods in PARTS.items():
            for owner, name in methods:
                thing = simulation
                for attribute in filter(None, owner.split(".")):
                    thing = getattr(thing, attribute, None)
                if thing is not None:  # increments know no such part
                    self._replace(thing, name, part)
        for term in simulation.specimen.opening_terms:
            for name in ("facets_to_open", "add_forces"):
                self._replace(term, name, "cracks")

    def _replace(self, thing, name, part):
        if name not in vars(thing):
            setattr(thing, name, self.timed(getattr(thing, name), part))

    def timed(self, function, part):
        """The function with its time kept under ``part``."""

        def timed(*arguments, **named):
            start = time.perf_counter()
            self._inner.append(0.0)
            try:
                return function(*arguments, **named)
            finally:
                spent = time.perf_counter() - start
                self.seconds[part] += spent - self._inner.pop()
                self._inner[-1] += spent

        return timed

    def watch(self, recorder):
        """Time what a recorder writes, and keep a row of the table with each of its rows. Local.

        Args:
            recorder: :class:`~.recorder.Recorder`.
        """
        after_step = self.timed(recorder.after_step, "output")

        def after_step_and_note():
            after_step()
            if recorder.last.get("row") == self.simulation.state.num_steps:
                self._note(recorder.loading.strain)

        recorder.after_step = after_step_and_note

    def _note(self, strain):
        steps = self.simulation.state.num_steps - self._first
        total = time.perf_counter() - self._start
        self._course.append([strain, steps, *self.seconds.values(), total])

    def table(self, strain):
        """Text of profile.csv, with a last row of now. Collective."""
        self._note(strain)
        comm, width = self.simulation.comm, 3 + len(self.seconds)
        rows = comm.allreduce(np.array(self._course).reshape(-1, width)) / comm.size
        rows[:, -1] -= rows[:, 2:-1].sum(axis=1)  # what no part is
        head = ",".join(["strain", "steps", *self.seconds, "other"])
        return "\n".join([head, *(",".join(f"{v:.9g}" for v in row) for row in rows), ""])

    def summary(self):
        """Seconds of each part on every rank, sizes, and what is sent in a step. Collective.

        Returns:
            dict: "steps", "searches"; "ranks": a dict of each rank with "seconds" by part ("other":
            the rest), "cells", "contact_points", "contact_pairs", "ghost_nodes" (of other ranks'
            surfaces), "ranks_around" (that have those), "bytes_per_step"; "imbalance": largest over
            mean of "cells" and of the seconds in "contact forces".
        """
        simulation, comm = self.simulation, self.simulation.comm
        total = time.perf_counter() - self._start
        contact, seconds = simulation.contact, dict(self.seconds)
        seconds["other"] = total - sum(seconds.values())
        ghosts, owners = contact.ghosts.positions.numbers, np.empty(0)
        if ghosts.size:
            last = contact.ghosts.forces.vector.getOwnershipRanges()[1:] // 3
            owners = np.unique(np.searchsorted(last, ghosts, side="right"))
        mine = {
            "seconds": seconds,
            "cells": simulation.mesh.num_cells,
            "contact_points": contact.points.num_points,
            "contact_pairs": int(contact.pairs.node.size),
            "ghost_nodes": ghosts.size,
            "ranks_around": owners.size,
            # Positions in, forces back.
            "bytes_per_step": 3 * 8 * sum(contact.ghosts.num_exchanged),
        }
        ranks = comm.allgather(mine)
        work = {
            "cells": [rank["cells"] for rank in ranks],
            "contact forces": [rank["seconds"]["contact forces"] for rank in ranks],
        }
        return {
            "steps": simulation.state.num_steps - self._first,
            "searches": contact.num_searches - self._searches,
            "ranks": ranks,
            "imbalance": {
                name: float(np.max(w) / np.mean(w)) if np.mean(w) > 0 else 1.0
                for name, w in work.items()
            },
        }


def profile_rows(summary):
    """Rows of a table: part, then for each rank its seconds; and the headings."""
    ranks = summary["ranks"]
    head = ["part", *(f">rank {r} [s]" for r in range(len(ranks)))]
    rows = [[part, *(f"{r['seconds'][part]:.2f}" for r in ranks)] for part in ranks[0]["seconds"]]
    sizes = ("cells", "contact_points", "contact_pairs", "ghost_nodes", "ranks_around")
    for name in (*sizes, "bytes_per_step"):
        rows.append([name.replace("_", " "), *(str(rank[name]) for rank in ranks)])
    return head, rows
