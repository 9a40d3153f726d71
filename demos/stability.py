"""The stability map: each method driven to failure, its limit beside theory, and who notices.

    python demos/stability.py FOLDER                      all subjects, some minutes
    python demos/stability.py FOLDER SUBJECT ...          some of them
    python demos/stability.py FOLDER SUBJECT --draw       figures again, from the numbers there

Writes SUBJECT.json, the numbers, and SUBJECT.png into FOLDER. The page is
docs/method/stability.md; the sharp ones of its numbers are cases of `mufe verify`, whose names
begin with `stability-`. What is measured and drawn of each subject is in demos/stability_map.
"""

import argparse
import json
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import mufe_fenicsx  # noqa: F401  first: one BLAS thread, the wheel's MPI

# isort: split
import matplotlib
import numpy as np
from stability_map import SUBJECTS

from mufe_fenicsx.report.style import PAGE, RC, new_figure, panel_letter


def numbers(value):
    """Fields of a measurement that JSON can hold; simulations are left out."""
    if isinstance(value, SimpleNamespace):
        value = vars(value)
    if isinstance(value, dict):
        return {k: numbers(v) for k, v in value.items() if k != "simulation"}
    if isinstance(value, list | tuple):
        return [numbers(v) for v in value]
    if isinstance(value, np.ndarray):
        return value.tolist()
    return value.item() if isinstance(value, np.generic) else value


def draw(name, data, folder):
    """The figure of a subject."""

    def new(panels, height=0.42):
        width = PAGE if panels > 1 else 0.6 * PAGE
        figure, axes = new_figure(width, height * PAGE, ncols=panels)
        axes = np.atleast_1d(axes)
        if panels > 1:
            for k, axis in enumerate(axes):
                panel_letter(axis, k)
        return figure, axes

    with matplotlib.rc_context(RC):
        SUBJECTS[name][1](data, new).savefig(folder / f"{name}.png", dpi=130)


def main(arguments=None):
    """Measure and draw the subjects that were asked for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("subjects", nargs="*", metavar="SUBJECT", help=", ".join(SUBJECTS))
    parser.add_argument("--draw", action="store_true", help="from the numbers in FOLDER")
    given = parser.parse_args(arguments)
    unknown = [name for name in given.subjects if name not in SUBJECTS]
    if unknown:
        parser.error(f"subject {unknown[0]}, expected one of {', '.join(SUBJECTS)}")
    given.folder.mkdir(parents=True, exist_ok=True)
    for name in given.subjects or SUBJECTS:
        path, begin = given.folder / f"{name}.json", time.perf_counter()
        if not given.draw:
            path.write_text(json.dumps(numbers(SUBJECTS[name][0]()), indent=1))
        draw(name, json.loads(path.read_text()), given.folder)
        print(f"{name}: {time.perf_counter() - begin:.1f} s", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
