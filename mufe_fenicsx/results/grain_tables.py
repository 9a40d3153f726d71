"""Tables of the grains of a run: form, motion and stress, first yield, and probes."""

import numpy as np
import pandas

from ..analysis import grain_stress, inertia, kinematics, probes
from ..analysis.by_grain import index_grains
from ..analysis.yield_place import yield_place
from ..errors import InputError
from .columns import STRESS, columns_of


def grain_volumes(state):
    """Labels and present volumes [m³] of the grains of a state, both of shape (num_grains,)."""
    labels, index = index_grains(state.grain)
    return labels, np.bincount(index, state.volume)


def grain_table(run, number=-1):
    """Form, motion and stress of each grain at a stored state, a row a grain.

    Motion counts from strain 0, the first stored state. Columns: ``grain`` (label), ``volume``
    [m³]; ``center_x`` … of its volume now [m]; ``num_active_contacts``, ``num_active_walls``, the
    neighbours and walls that press on it, where the state has tables of contacts; ``inertia_1`` …
    ``inertia_3``, principal moments in the reference configuration for unit density [m⁵];
    ``translation_x`` …, ``rotation_x`` … (rotation vector [rad]), ``rotation_angle`` [rad],
    ``misfit`` [m] of the best rigid motion; ``volume_expansion`` and ``shear_strain`` (√(2/3 e:e)
    of the deviator) of what it leaves; ``tensile_stress_xx`` …, the mean Cauchy stress, tension
    positive, ``von_mises_mean``, ``von_mises_peak``, ``von_mises_percentile_95`` [Pa];
    ``yielded_volume_fraction``; ``unstressed``: mean below 1 % of the sample's. Where the grains
    were surfaces, ``file`` and ``body`` say which: the body of that number in that file.
    """
    state = run.state(number)
    mesh = state.cells, state.grain
    form = inertia.grain_inertia(state.reference, *mesh)
    first = run.state(int(run.states.index[0]))
    motion = kinematics.grain_motion(state.points_of(first), state.points, *mesh)
    found = grain_stress.grain_stress(
        state.stress, state.von_mises, state.plastic_strain, state.volume, state.grain
    )
    strain = motion.remaining_strain
    deviator = strain - np.trace(strain, axis1=1, axis2=2)[:, None, None] / 3 * np.eye(3)
    table = pandas.DataFrame(
        {"grain": found.labels, "volume": found.volume}
        | columns_of("center", motion.centre + motion.translation)
        | _num_contacts(run, number, found.labels)
        | columns_of("inertia", form.moments, "123")
        | columns_of("translation", motion.translation)
        | columns_of("rotation", motion.rotation_vector)
        | {
            "rotation_angle": motion.angle,
            "misfit": motion.misfit,
            "volume_expansion": motion.volume_ratio - 1,
            "shear_strain": np.sqrt(2 / 3 * (deviator**2).sum(axis=(1, 2))),
        }
        | columns_of("tensile_stress", found.stress, STRESS)
        | {
            "von_mises_mean": found.mean,
            "von_mises_peak": found.peak,
            "von_mises_percentile_95": found.percentile,
            "yielded_volume_fraction": found.plastic_fraction,
            "unstressed": grain_stress.unstressed(found.mean, found.volume),
        }
    )
    if (run.path / "labels.csv").is_file():
        origin = run.table("labels")
        if {"label", "file", "body"} <= set(origin):
            origin = origin[["label", "file", "body"]].rename(columns={"label": "grain"})
            table = table.merge(origin, how="left", on="grain")
    return table


def _num_contacts(run, number, labels):
    """Columns of the numbers of contacts, none where the state has no table of them."""
    try:
        stored = run.grains(number).set_index("grain")
    except InputError:
        return {}
    names = ("num_active_contacts", "num_active_walls")
    return {name: stored[name].reindex(labels).to_numpy() for name in names}


def first_yield_table(run):
    """When and where each grain was first seen to yield, a row a grain.

    Columns: ``grain``; ``state`` (its number, -1: never), ``strain``, ``rank`` (1: the first; those
    of one state share it); in that state the largest ``plastic_strain``, and at its cell ``depth``
    under the surface, ``under_contact``, ``edge_distance`` to the edge of the contact and its
    ``contact_radius`` [m], see :func:`mufe_fenicsx.analysis.yield_place.yield_place`.
    """
    numbers = run.states.index
    # One state in memory at a time.
    states = (run.state(number) for number in numbers)
    found = grain_stress.first_yield((s.plastic_strain, s.grain) for s in states)
    rows = {}
    for label, rank in zip(found.labels, found.rank, strict=True):
        row = {"grain": label, "state": -1, "strain": np.nan, "rank": rank}
        row |= {"plastic_strain": 0.0, "depth": np.nan, "under_contact": False}
        rows[label] = row | {"edge_distance": np.nan, "contact_radius": np.nan}
    for at in np.unique(found.state[found.state >= 0]):
        state = run.state(numbers[at])
        points, cells = state.points, state.cells
        order = np.argsort(state.grain, kind="stable")
        ends = np.searchsorted(state.grain[order], found.labels, side="right")
        cells_of = dict(zip(found.labels, np.split(order, ends[:-1]), strict=True))
        for label in found.labels[found.state == at]:
            mine = cells_of[label]
            place = yield_place(
                points, cells[mine], state.plastic_strain[mine], state.contact_pressure
            )
            rows[label] |= {
                "state": state.index,
                "strain": state.strain,
                "depth": place.depth,
                "under_contact": place.under_contact,
                "edge_distance": place.edge_distance,
                "contact_radius": place.contact_radius,
                "plastic_strain": state.plastic_strain[mine].max(),
            }
    return pandas.DataFrame(list(rows.values()))


def probe(run, points=None, grains=None):
    """Displacement and stress of places or grains through all stored states.

    Args:
        run: :class:`~mufe_fenicsx.results.run.Run`.
        points: Places in the reference configuration [m], shape (num_points, 3); they move with
            the grain. Displacement is linear in a cell, stress that of the cell.
        grains: Labels: means over the volumes of these grains.

    Returns:
        DataFrame with a row a state and probe: ``state``, ``time``, ``strain``, ``probe`` (number
        of the place, or label), ``grain``, ``displacement_x`` … [m], ``tensile_stress_xx`` …
        (Cauchy stress) and ``von_mises`` [Pa], ``plastic_strain``.

    Raises:
        InputError: Not one of both was given, a place is in no grain, or a label unknown.
    """
    if (points is None) == (grains is None):
        raise InputError("probe of both or neither of points and grains, expected one of them")
    tables, before, where = [], None, None
    for index in run.states.index:
        state = run.state(index)
        at_nodes = {"displacement": state.displacement}
        cells = {
            "stress": state.stress,
            "von_mises": state.von_mises,
            "plastic_strain": state.plastic_strain,
        }
        if points is not None:
            if before is None or not np.array_equal(before, state.cells):
                where = probes.find_cells(state.reference, state.cells, points)
                before = state.cells
            values = probes.at_places(state.cells, *where, at_nodes, cells | {"grain": state.grain})
            name = np.arange(len(where[0]))
        else:
            name = np.atleast_1d(grains)
            values = probes.of_grains(
                state.points, state.cells, state.grain, name, at_nodes, cells
            ) | {"grain": name}
        tables.append(
            pandas.DataFrame(
                {"state": index, "time": state.time, "strain": state.strain, "probe": name}
                | {"grain": values["grain"]}
                | columns_of("displacement", values["displacement"])
                | columns_of("tensile_stress", values["stress"], STRESS)
                | {k: values[k] for k in ("von_mises", "plastic_strain")}
            )
        )
    if not tables:
        raise InputError(f"{run.path / 'fields'} has no stored states, expected some to probe")
    return pandas.concat(tables, ignore_index=True)
