"""Tables of the sample as a whole: curves of its history, stress of contacts and walls."""

from dataclasses import asdict

import numpy as np
import pandas

from ..analysis import macro
from ..analysis.breakage import breakage as numbers_of
from ..analysis.breakage import fragments_of
from ..analysis.quasi_static import kinetic_ratio
from ..container import BOX
from ..errors import InputError
from ..geometry.measure import tet_volumes
from .columns import STRESS, vectors


def curves(run, width=0.01):
    """Stress, void ratio, moduli and K0 a row of the history, see :meth:`Run.curves`."""
    history = run.history
    found = macro.oedometer_curves(history, run.lengths(history), run.solid_volume, width)
    return pandas.DataFrame({"time": history["time"], "stage": history["stage"], **found})


def breakage(run):
    """Numbers of breakage at each stored state, a row a state.

    Columns: ``state``, ``time``, ``strain`` and those of
    :class:`~mufe_fenicsx.analysis.breakage.Breakage`, of the volumes in the reference
    configuration.

    Raises:
        InputError: Its grains cannot break: states have no field ``fragment``.
    """
    rows = []
    for listed in run.stored_states:
        state = run.state(listed["index"])
        volume = tet_volumes(state.reference, state.cells)
        found = numbers_of(*fragments_of(volume, state.grain, state.field("fragment")))
        row = {"state": state.index, "time": state.time, "strain": state.strain}
        rows.append(row | asdict(found))
    return pandas.DataFrame(rows)


def stresses(run):
    """Stress of the contacts (Love and Weber) against that of the walls, a row a stored state.

    Columns: ``contact_xx`` … ``contact_xz`` (symmetric part), ``wall_xx``, ``wall_yy``, ``wall_zz``
    of a box, ``wall_rr`` and ``wall_zz`` of a cylinder, ``wall_hh``, the mean of σr and σθ, and
    ``wall_zz`` of a hollow one [Pa], compression positive;
    ``difference_zz`` = contact over wall - 1, the same of the sides (of rr with the mean of xx and
    yy): small where the test is quasi-static; ``closure_zz`` …, the same with the inertia of the
    grains added, which is small at any speed; ``kinetic`` over internal energy; ``unbalanced``,
    top less bottom force over their mean. In a box that is sheared ``wall_xx`` supposes that the
    pressure on its tilted walls is even. States without tables of contacts are left out.
    """
    history = run.history
    times, kinetic = history["time"], kinetic_ratio(history)
    container, course = run.container, run.lengths(history)
    names = [name for name, _ in container.compared]
    rows = []
    for index, state in run.with_contacts().iterrows():
        contacts, grains = run.contacts(index), run.grains(index)

        def now(values, at=state["time"]):
            return float(np.interp(at, times, values))

        lengths = np.array([now(length) for length in course.T])
        normal = contacts.groupby("wall")["normal_force"].sum()
        normal = normal.reindex(list(container.walls)).fillna(0.0)
        tilt = now(history[macro.TILT]) if macro.TILT in history else 0.0
        wall = container.stresses(macro.across_areas(normal.to_numpy(), tilt), lengths)
        wall = container.means(container.three_stresses(wall, lengths))
        if tilt:  # the pressure on a tilted plane is σxx + γ τ, if it is smooth
            wall[0] -= tilt * now(history[macro.SHEAR_STRESS[0]])
        volume = float(container.volume(lengths))
        inner = macro.contact_stress(
            vectors(contacts, "force"), vectors(contacts, "branch"), volume
        )
        dynamic = macro.inertial_stress(
            vectors(grains, "force"), vectors(grains, "center"), _middle(run, contacts), volume
        )
        with np.errstate(divide="ignore", invalid="ignore"):
            difference = container.means(np.diag(inner)) / wall - 1
            closure = container.means(np.diag(inner + dynamic)) / wall - 1
            unbalanced = (normal["z_max"] - normal["z_min"]) / (
                0.5 * (normal["z_max"] + normal["z_min"])
            )
        both = 0.5 * (inner + inner.T)
        rows.append(
            {"state": index, "time": state["time"], "strain": state["strain"]}
            | {f"contact_{e}": both["xyz".index(e[0]), "xyz".index(e[1])] for e in STRESS}
            | {f"wall_{name}": value for name, value in zip(names, wall, strict=True)}
            | {f"difference_{name}": value for name, value in zip(names, difference, strict=True)}
            | {f"closure_{name}": value for name, value in zip(names, closure, strict=True)}
            | {"kinetic": now(kinetic), "unbalanced": unbalanced}
        )
    return pandas.DataFrame(rows)


def _middle(run, contacts):
    """Middle of the space between the walls [m], each plane where its contacts are."""
    walls = run.box.T.ravel().copy()  # x_min, x_max, y_min, …
    if run.container is not BOX:
        centre = (run.summary.get("container") or {}).get("centre")
        if centre is None:
            raise InputError(f"{run.path}/run.json has no container, expected its shape and centre")
        walls[:4] = np.repeat(centre, 2)
    for number, name in enumerate(BOX.walls):
        at = contacts[(contacts["wall"] == name) & (contacts["num_points"] > 0)]
        force = at["normal_force"].to_numpy(dtype=float)
        if force.sum() > 0:
            walls[number] = force @ at[f"centroid_{name[0]}"] / force.sum()
    return walls.reshape(3, 2).mean(axis=1)


def wall_friction(run, number=-1):
    """Normal and tangential force of the grains on each wall, a row a wall.

    Columns: ``wall``, ``num_contacts``, ``normal`` [N], ``shear_x`` … [N], ``mobilised``: Σ |t| by
    Σ n of its contacts.
    """
    contacts = run.contacts(number)
    rows = []
    for name in run.container.walls:
        at = contacts[(contacts["wall"] == name) & (contacts["num_points"] > 0)]
        found = macro.wall_friction(vectors(at, "force"), vectors(at, "normal"))
        rows.append(
            {"wall": name, "num_contacts": len(at), "normal": found.normal}
            | {f"shear_{a}": value for a, value in zip("xyz", found.shear, strict=True)}
            | {"mobilised": found.mobilised}
        )
    return pandas.DataFrame(rows)
