"""Report of a run: figures as PNG files and one HTML page."""

from pathlib import Path

import matplotlib
import numpy as np

import mufe_fenicsx
from mufe_fenicsx.analysis.mesh_quality import mesh_quality
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.output.contacts import read_contacts
from mufe_fenicsx.output.fields import read_states
from mufe_fenicsx.output.history import COLUMNS, NEWER_COLUMNS, read_history
from mufe_fenicsx.output.run_folder import read_run_json, reason
from mufe_fenicsx.report import curves, histograms, network, style, views
from mufe_fenicsx.report.checks import check_run
from mufe_fenicsx.report.page import write_page
from mufe_fenicsx.report.render import cannot_render
from mufe_fenicsx.report.sample import load_states
from mufe_fenicsx.report.summary import failed_grains, largest_values, run_rows, sample_rows
from mufe_fenicsx.report.view import make_view
from mufe_fenicsx.results import Run


def write_report(run_folder):
    """Write ``report.html`` and ``figures/*.png`` into a run folder.

    A run that stopped early, or lacks files, gives a report of what is there, which says what
    is not.

    Args:
        run_folder: Folder that ``mufe run`` wrote.

    Returns:
        dict of plain values: ``report`` (path), ``figures`` (paths), ``missing`` (sentences),
        ``checks`` (a dict name, target, largest, mean, passed each), ``passed`` (all checks).

    Raises:
        InputError: There is no run in the folder, or it cannot be written to.
    """
    return _Report(Path(run_folder)).write()


class _Report:
    """What was read, and what was drawn of it."""

    def __init__(self, folder):
        self.folder = folder
        self.missing = []
        self.figures = []
        if not folder.is_dir():
            raise InputError(
                f"run folder {folder} is absent, expected a folder that mufe run wrote"
            )
        if not any((folder / f).exists() for f in ("run.json", "history.csv", "fields")):
            raise InputError(
                f"run folder {folder} has none of run.json, history.csv and fields, "
                "expected a folder that mufe run wrote"
            )
        self.run = self._try(lambda: read_run_json(folder), "the run summary") or {}
        self.history = self._try(self._read_history, "the curves and the checks")
        self.states = self._try(self._read_states, "pictures of the sample") or []
        if self.run and self.run.get("failed_grains") is None:
            self.run["failed_grains"] = failed_grains(folder / "quality.csv")
        if self.run and not self.run.get("finished"):
            why = self.run.get("stop_reason") or "no reason recorded"
            if why == "running":
                why = "it still runs, or was cut off"
            self.missing.append(f"The rest of the run, which did not finish ({why}).")

    def write(self):
        try:
            (self.folder / "figures").mkdir(exist_ok=True)
            with matplotlib.rc_context(style.RC):
                checks = self._draw_history()
                self._draw_states()
            self._write_page(checks)
        except OSError as error:
            raise InputError(
                f"report in {self.folder} cannot be written ({reason(error)})"
            ) from error
        return {
            "report": str(self.folder / "report.html"),
            "figures": [str(figure[0]) for figure in self.figures],
            "missing": self.missing,
            "checks": [
                {
                    "name": c.name,
                    "target": c.target,
                    "largest": _plain(c.largest),
                    "mean": _plain(c.mean),
                    "passed": c.passed,
                }
                for c in checks
            ],
            "passed": bool(checks) and all(c.passed for c in checks),
        }

    def _try(self, read, what):
        """What a reader returns, or None with a sentence about what is therefore missing."""
        try:
            return read()
        except InputError as error:
            self.missing.append(f"Without {what}: {error}.")
            return None

    def _read_history(self):
        path = self.folder / "history.csv"
        history = read_history(path)
        needed = [name for name in COLUMNS if name not in NEWER_COLUMNS]
        absent = [name for name in needed if name not in history]
        if absent:
            raise InputError(f"{path} has no column {', '.join(absent)}")
        if not len(history["step"]):
            raise InputError(f"{path} has no row, expected one a record")
        return history

    def _read_states(self):
        listed = read_states(self.folder)
        if not listed:
            raise InputError(f"{self.folder / 'fields'} has no stored states")
        return load_states(self.folder, listed, self.history)

    def _add(self, name, figure, caption, how, shape="narrow"):
        path = self.folder / "figures" / f"{name}.png"
        figure.savefig(path)
        self.figures.append((path, caption, how, shape))

    def _draw_history(self):
        history = self.history
        if history is None:
            return []
        if not (history["stage"] != "seating").any():
            self.missing.append("The loading stage was not reached: there is no strain to show.")
            return check_run(history)
        height = self.run.get("reference_height") or float(
            history["height"][history["stage"] != "seating"][0]
        )
        for name, draw, caption, how, shape in CURVES:
            figure = draw(history, height) if draw is curves.draw_forces else draw(history)
            self._add(name, figure, caption, how, shape)
        return check_run(history)

    def _draw_states(self):
        if not self.states:
            return
        start, end = self.states[0], self.states[-1]
        why_not = cannot_render()
        if why_not:
            self.missing.append(f"No 3D pictures: {why_not}.")
        else:
            strains = ", ".join(f"{state.strain:.3f}" for state in self.states)
            self._add(
                "stress-3d",
                views.draw_stress_3d(self.states),
                f"Von Mises stress in the deformed grains at strain {strains}",
                "All views share the colour scale and the camera (parallel projection; the scale "
                "bar holds for lengths across the view). The thin box is the space between the "
                "walls. One per cent of the cells of a state may lie above the scale.",
                "wide",
            )
        self._add(
            "stress-cut",
            views.draw_cut(start, end),
            f"Von Mises stress in the vertical plane through the middle, strain {end.strain:.3f}",
            "Black lines are the surfaces of grains, the grey frame is the walls. Force chains "
            "show as bands of high stress from contact to contact; a stress that changes from "
            "one tetrahedron to the next says that the mesh is too coarse there.",
        )
        if not why_not:
            self._draw_grain(end)
        self._draw_network(start)
        cells_per_grain = np.unique(end.grain, return_counts=True)[1]
        self._add(
            "mesh-quality",
            histograms.draw_mesh_quality(
                mesh_quality(end.reference, end.cells), end.quality, cells_per_grain
            ),
            "Quality of the mesh, as built and after the test",
            "Small dihedral angles spoil the accuracy; the smallest altitude of all bounds the "
            "time step. Where the red line reaches zero, tetrahedra were flattened by the test.",
            "wide",
        )

    def _draw_network(self, start):
        last = read_states(self.folder)[-1]
        contacts = self._try(lambda: read_contacts(self.folder, last["index"])[0], "contacts")
        if not contacts or self.history is None:
            self.missing.append("No picture of the contact network: it was not stored.")
            return
        self._add(
            "contact-network",
            network.draw_network(contacts, self.history, start.reference, start.cells),
            f"The contact network at strain {last['strain']:.3f}: (a) directions of contacts "
            "between grains in vertical planes, (b) their normal forces; (c) compression",
            "(a) Contacts of a compressed sample point upwards more often than sideways, strong "
            "ones more so. (b) Right of the dotted line is the strong network. (c) Void ratio "
            "against the stress over the present area; its slope is the compression index.",
            "wide",
        )

    def _draw_grain(self, end):
        if "contact_pressure" not in end.point_data:
            self.missing.append("No picture of contact pressure: the states do not hold it.")
            return
        label, mean = end.most_loaded_grain()
        nodes = np.unique(end.cells[end.grain == label])
        if not end.point_data["contact_pressure"][nodes].max() > 0:
            self.missing.append(
                f"No picture of contact pressure: grain {label}, with the largest mean von Mises "
                "stress, has no contact in the last stored state."
            )
            return
        self._add(
            "contact-pressure",
            views.draw_contact_pressure(end, label),
            f"Contact pressure on the most loaded grain, number {label}",
            f"It is the grain with the largest volume mean of von Mises stress, "
            f"{style.quantity(mean, 'Pa')}, at strain {end.strain:.3f}. Two views from opposite "
            "sides, the first towards the highest pressure; grey is free surface, lines are "
            "facets of the mesh. A contact should span several facets.",
            "wide",
        )

    def _write_page(self, checks):
        view, missing = make_view(Run(self.folder), self.states[0] if self.states else None)
        self.missing += missing
        history, run = self.history, self.run
        last = self.states[-1] if self.states else None
        about = run_rows(run)
        if last is not None and history is not None:
            about += sample_rows(self.states[0], last, run, history)
        tables = [
            ("Largest values of the loading stage", largest_values(history, last)),
            ("Run", about),
        ]
        write_page(
            self.folder / "report.html",
            run.get("title") or f"Oedometer test in {self.folder.resolve().name}",
            self._lead(),
            checks,
            self.missing,
            self.figures,
            tables,
            f"Written by mufe_fenicsx {mufe_fenicsx.__version__}, a micro finite-element model of "
            "sand after Nadimi & Fonseca (2018), Géotechnique 68(4), 290–302, "
            "doi 10.1680/jgeot.16.p.147.",
            view,
        )

    def _lead(self):
        run, parts = self.run, []
        if run.get("num_grains") and run.get("num_cells"):
            parts.append(
                f"Oedometer test on {style.number(run['num_grains'])} deformable grains of "
                f"{style.number(run['num_cells'])} tetrahedra"
            )
        else:
            parts.append("Oedometer test on deformable grains")
        if self.history is not None:
            parts.append(f"vertical strain {self.history['strain'][-1]:.4g}")
            parts.append(f"vertical stress {style.quantity(self.history['stress'][-1], 'Pa', 4)}")
        return "; ".join(parts) + " at the end."


def _plain(value):
    """A JSON number, None instead of nan."""
    return float(value) if np.isfinite(value) else None


#: (file name, function, caption, how to read it, shape) of the figures from the history.
CURVES = (
    (
        "stress-strain",
        curves.draw_stress_strain,
        "Vertical stress against vertical strain",
        "Stress is the mean force of both platens over the cross-section, compression positive. "
        "Strain counts from the end of seating, so that gaps left by the segmentation do not "
        "count. The slope is the constrained modulus.",
        "narrow",
    ),
    (
        "forces",
        curves.draw_forces,
        "Normal forces (a) on the platens and (b) on the side walls",
        "Top and bottom should coincide: what separates them is inertia or friction on the side "
        "walls. Side walls that differ show an uneven packing or a small sample.",
        "wide",
    ),
    (
        "energies",
        curves.draw_energies,
        "Work of the walls and what it became",
        "The coloured curves add up to the black one if the balance closes. Kinetic energy "
        "should be invisible here.",
        "narrow",
    ),
    (
        "dissipation",
        curves.draw_dissipation,
        "Dissipated energy, logarithmic",
        "Nadimi & Fonseca found the frictional dissipation an order of magnitude below the "
        "plastic one. Damping, if used, should be far below both.",
        "narrow",
    ),
    (
        "quasi-static",
        curves.draw_monitors,
        "Quasi-static monitors: (a) kinetic over internal energy, (b) difference of the platens' "
        "forces, (c) energy residual over work",
        "Grey is the part where the sample counts as loaded (beyond half of the final strain); "
        "there the curves should stay below the dashed targets.",
        "wide",
    ),
)
