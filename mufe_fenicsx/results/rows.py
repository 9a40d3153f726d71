"""A run in a few rows of words, as notebooks show it."""

from contextlib import suppress

import numpy as np

from ..errors import InputError, shortened
from ..scene.reading import load_scene
from ..scene.rows import scene_rows
from ..units import with_unit


def run_rows(run) -> list[tuple[str, object]]:
    """(name, words) of a run: how far it came, its size, and what its scene says.

    What cannot be read is left out; :attr:`~.Run.missing` says why.

    Args:
        run: :class:`~mufe_fenicsx.results.run.Run`.
    """
    rows = []
    with suppress(InputError):
        summary = run.summary
        ended = "finished" if run.finished else f"not finished: {summary.get('stop_reason')}"
        rows += [
            ("title", shortened(summary.get("title") or "")),
            ("state", shortened(ended)),
            ("grains", summary.get("num_grains")),
            ("tetrahedra", summary.get("num_cells")),
        ]
    with suppress(InputError):
        history = run.history
        if len(history):
            strain, stress = (float(history[name].iloc[-1]) for name in ("strain", "stress"))
            if np.isfinite([strain, stress]).all():
                rows.append(("reached", f"strain {strain:.4g}, stress {with_unit(stress, 'Pa')}"))
    with suppress(InputError):
        rows.append(("stored states", len(run.stored_states)))
    with suppress(InputError):
        scene = load_scene(run.path / "scene.toml")
        rows += [row for row in scene_rows(scene) if row[0] != "grains"]  # of which there are
    return rows
