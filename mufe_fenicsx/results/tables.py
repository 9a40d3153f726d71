"""Tables that follow from the files of a run: analysis applied to what is stored."""

import numpy as np
import pandas

from ..analysis import contact_forces, fabric, grain_stress, inertia, kinematics, macro, probes
from ..analysis.by_grain import index_grains
from ..analysis.contact_age import active_since
from ..analysis.quasi_static import kinetic_ratio
from ..analysis.yield_place import yield_place
from ..container import BOX, WALLS
from ..errors import InputError
from ..scene.pairs import REST, by_materials

STRESS = ("xx", "yy", "zz", "xy", "yz", "xz")


def exact_csv(path):
    """A CSV file as a DataFrame, each number the double that is nearest to its text.

    ``pandas.read_csv`` by itself is off by a last bit here and there before pandas 3.1, which
    deprecates the option that cures it. Columns are int64, float64 (blank: NaN) or text.

    Raises:
        OSError, ValueError: those of ``pandas.read_csv``.
    """
    return pandas.read_csv(path, dtype=str).apply(_numbers)


def check_finite(name, table):
    """See that all numbers of a table that a run wrote are such.

    Args:
        name: Of its file.
        table: DataFrame; columns of text are left out.

    Raises:
        InputError: One is nan or infinite: a fault of the run.
    """
    numbers = table.select_dtypes("number")
    wrong = ~np.isfinite(numbers.to_numpy(dtype=float))
    if wrong.any():
        row, column = np.argwhere(wrong)[0]
        raise InputError(
            f"fault: {name} has {wrong.sum()} values that are not numbers, the first of column "
            f"{numbers.columns[column]} in line {row + 2}"
        )


def _numbers(column):
    texts = column.to_numpy(dtype=object)
    for kind in (np.int64, np.float64):
        try:
            return pandas.Series(texts.astype(kind), column.index)
        except ValueError:
            continue
    return column


def vectors(table, name):
    """Columns name_x, name_y, name_z of a table, shape (num_rows, 3)."""
    return table[[f"{name}_{axis}" for axis in "xyz"]].to_numpy(dtype=float)


def columns_of(name, values, ends="xyz"):
    """Columns name_x, name_y, … of an array with one for each end, dict name -> array."""
    return {f"{name}_{end}": column for end, column in zip(ends, values.T, strict=True)}


def curves(run, width=0.01):
    """Stress, void ratio, moduli and K0 a row of the history, see :meth:`Run.curves`."""
    history = run.history
    found = macro.oedometer_curves(history, run.lengths(history), run.solid_volume, width)
    return pandas.DataFrame({"time": history["time"], "stage": history["stage"], **found})


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
        walls[:4] = np.repeat(run.summary["container"]["centre"], 2)
    for number, name in enumerate(BOX.walls):
        at = contacts[(contacts["wall"] == name) & (contacts["num_points"] > 0)]
        force = at["normal_force"].to_numpy(dtype=float)
        if force.sum() > 0:
            walls[number] = force @ at[f"centroid_{name[0]}"] / force.sum()
    return walls.reshape(3, 2).mean(axis=1)


def contact_table(run, number=-1):
    """Active contacts of a stored state with their part in the network.

    The columns of the stored table, and ``ratio`` f/<f> of the normal force over the mean of its
    kind (between grains, or with walls), ``strong`` (at least 1), ``mobilised`` (friction over
    μ times the normal force), ``sliding``, and ``chain`` (both grains are linked in one; its
    number, -1: none).
    """
    contacts, grains = run.contacts(number), run.grains(number)
    contacts = contacts[contacts["num_points"] > 0].reset_index(drop=True)
    force = contacts["normal_force"].to_numpy(dtype=float)
    wall = contacts["grain_b"].to_numpy() == 0
    ratio = np.full(force.shape, np.nan)
    for kind in (wall, ~wall):
        if kind.any() and force[kind].mean() > 0:
            ratio[kind] = force[kind] / force[kind].mean()
    contacts["ratio"], contacts["strong"] = ratio, ratio >= 1
    mobilised = contact_forces.mobilised_friction(
        vectors(contacts, "force"), vectors(contacts, "friction"), _friction(run, contacts)
    )
    contacts["mobilised"] = mobilised
    contacts["sliding"] = np.nan_to_num(mobilised) >= contact_forces.SLIDING
    chains, first = _chains(run, number, contacts, grains)
    number_of_chain = np.full(force.shape, -1)
    number_of_chain[~wall] = np.where(chains.links, chains.chain[first], -1)
    contacts["chain"] = number_of_chain
    return contacts


def _friction(run, contacts):
    """Coefficient of friction of each contact while it slides, shape (num_contacts,)."""
    try:
        among = run.scene["contact"]
        of = {"": among} | {name: run.scene["walls"][name] for name in run.container.walls}
        of |= {tool["name"]: tool for tool in run.scene.get("tool", [])}
        mu = {name: _kinetic(table) for name, table in of.items()}
        groups = {name: group["labels"] for name, group in run.scene.get("materials", {}).items()}
        of_pairs = by_materials(among.get("pairs", {}), groups)
        of_pairs = {pair: _kinetic(entry) for pair, entry in of_pairs.items()}
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(
            f"{run.path / 'scene.toml'} has no friction of contacts and walls ({error!r}), "
            "expected the scene that mufe run writes"
        ) from error
    found = contacts["wall"].map(mu).to_numpy(dtype=float, copy=True)
    if of_pairs:
        group_of = {label: name for name, labels in groups.items() for label in labels}
        both = contacts[["grain_a", "grain_b"]].to_numpy()
        for k in np.flatnonzero(both[:, 1] > 0):
            pair = tuple(sorted(group_of.get(int(label), REST) for label in both[k]))
            found[k] = of_pairs.get(pair, found[k])
    return found


def _kinetic(table):
    """Coefficient of friction while a contact slides, of a table of a scene that was run."""
    return float(table.get("friction_kinetic", table["friction"]))


def _chains(run, number, active, grains):
    """Force chains of a state, and the first grain of each active contact between grains."""
    labels = grains["grain"].to_numpy()
    wall = active["grain_b"].to_numpy() == 0
    first = np.searchsorted(labels, active["grain_a"].to_numpy())
    second = np.where(wall, -1, np.searchsorted(labels, active["grain_b"].to_numpy()))
    state = run.state(number)
    found, volume = grain_volumes(state)
    if not np.array_equal(found, labels):
        raise InputError(f"state {state.index} has other grains in fields than in contacts")
    centre = vectors(grains, "center")
    stress = contact_forces.contact_stress_of_grains(
        first, second, vectors(active, "force"), vectors(active, "centroid"), centre, volume
    )
    chains = contact_forces.force_chains(stress, centre, first[~wall], second[~wall])
    return chains, first[~wall]


def grain_volumes(state):
    """Labels and present volumes [m³] of the grains of a state, both of shape (num_grains,)."""
    labels, index = index_grains(state.grain)
    return labels, np.bincount(index, state.volume)


def network(run):
    """The contact network in numbers, a row a stored state.

    Columns: ``num_contacts`` between grains and ``num_wall_contacts`` (active ones), ``N_cA`` (mean
    of the active contacts of a grain), ``coordination`` (the same without grains that have none or
    one), ``area`` and ``area_deformed`` of the contacts between grains (reference and present
    configuration; the latter only of runs that stored it), ``fabric_xx`` … of their normals,
    ``anisotropy``, ``anisotropy_force`` (normals weighted by the normal force), ``mean_force``,
    ``strong`` (share of the contacts), ``strong_force`` (their share of the sum of forces),
    ``sliding`` (share of the contacts), ``num_chains`` and ``grains_in_chains``. States without
    tables of contacts are left out.
    """
    rows = []
    for index, state in run.with_contacts().iterrows():
        active, grains = run.contact_table(index), run.grains(index)
        inner = active[active["grain_b"] != 0]
        labels = grains["grain"].to_numpy()
        ends = [np.searchsorted(labels, inner[k].to_numpy()) for k in ("grain_a", "grain_b")]
        count = contact_forces.active_contacts(*ends, labels.size)
        normals, force = vectors(inner, "normal"), inner["normal_force"].to_numpy(dtype=float)
        tensor = fabric.fabric_tensor(normals)
        chain = inner["chain"].to_numpy()
        in_chains = np.unique(np.concatenate([end[chain >= 0] for end in ends]))
        strong_force = force[inner["strong"]].sum() / force.sum() if force.size else np.nan
        row = {
            "state": index,
            "time": state["time"],
            "strain": state["strain"],
            "num_contacts": len(inner),
            "num_wall_contacts": len(active) - len(inner),
            "N_cA": count.mean(),
            "coordination": contact_forces.mechanical_coordination(count),
            "area": inner["area"].sum(),
        }
        if "area_deformed" in inner:
            row["area_deformed"] = inner["area_deformed"].sum()
        row |= {f"fabric_{e}": tensor["xyz".index(e[0]), "xyz".index(e[1])] for e in STRESS}
        rows.append(
            row
            | {
                "anisotropy": fabric.anisotropy(tensor),
                "anisotropy_force": fabric.anisotropy(
                    fabric.fabric_tensor(normals, np.maximum(force, 0))
                ),
                "mean_force": force.mean() if force.size else np.nan,
                "strong": inner["strong"].mean(),
                "strong_force": strong_force,
                "sliding": contact_forces.sliding_fraction(inner["mobilised"].to_numpy()),
                "num_chains": len(np.unique(chain[chain >= 0])),
                "grains_in_chains": in_chains.size,
            }
        )
    return pandas.DataFrame(rows)


def contact_ages(run, number=-1):
    """Since when the active contacts of a stored state have been active without a break.

    Columns: ``grain_a``, ``grain_b`` and ``wall`` of the contact, its ``normal_force`` [N], and the
    first stored state of the unbroken row: its number ``since``, ``since_time`` [s] and
    ``since_strain``; ``age`` [s] and ``age_strain`` from there to this state. Stored states
    resolve no more: a contact may be older by up to a distance of states, and one that opened
    and closed between two counts as unbroken.

    Raises:
        InputError: The state was not stored, or its table of contacts was not.
    """
    last = _active(run.contacts(number))
    states = run.with_contacts().loc[: run.state(number).index]
    active = [*(_active(run.contacts(index)) for index in states.index[:-1]), last]
    first = active_since([table[["grain_a", "body_b"]].to_numpy() for table in active])[-1]
    table = last[["grain_a", "grain_b", "wall", "normal_force"]].reset_index(drop=True)
    since = states.iloc[first]
    table["since"] = since.index.to_numpy()
    for name, age in (("time", "age"), ("strain", "age_strain")):
        table[f"since_{name}"] = since[name].to_numpy()
        table[age] = states[name].iloc[-1] - table[f"since_{name}"]
    return table


def _active(contacts):
    """Active ones, with ``body_b``: the second grain, or the wall as a number below zero."""
    contacts = contacts[contacts["num_points"] > 0]
    tools = sorted(set(contacts["wall"]) - {"", *WALLS})
    walls = contacts["wall"].map({name: -1 - k for k, name in enumerate((*WALLS, *tools))})
    return contacts.assign(body_b=contacts["grain_b"].where(walls.isna(), walls).astype(np.int64))


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


def grain_table(run, number=-1):
    """Form, motion and stress of each grain at a stored state, a row a grain.

    Columns: ``grain`` (label), ``volume`` [m³]; ``inertia_1`` … ``inertia_3``, principal moments in
    the reference configuration for unit density [m⁵]; ``translation_x`` …, ``rotation_x`` …
    (rotation vector [rad]), ``angle`` [rad], ``misfit`` [m] of the best rigid motion;
    ``volume_strain`` and ``shear_strain`` (√(2/3 e:e) of the deviator) of what it leaves;
    ``stress_xx`` …, ``mean``, ``peak``, ``percentile_95`` of von Mises stress [Pa];
    ``plastic_fraction`` of the volume; ``unstressed``: mean below 1 % of the sample's. Where the
    grains were surfaces, ``file`` and ``body`` say which: the body of that number in that file.
    """
    state = run.state(number)
    mesh = state.cells, state.grain
    form = inertia.grain_inertia(state.reference, *mesh)
    motion = kinematics.grain_motion(state.reference, state.points, *mesh)
    found = grain_stress.grain_stress(
        state.stress, state.von_mises, state.plastic_strain, state.volume, state.grain
    )
    strain = motion.remaining_strain
    deviator = strain - np.trace(strain, axis1=1, axis2=2)[:, None, None] / 3 * np.eye(3)
    table = pandas.DataFrame(
        {"grain": found.labels, "volume": found.volume}
        | columns_of("inertia", form.moments, "123")
        | columns_of("translation", motion.translation)
        | columns_of("rotation", motion.rotation_vector)
        | {
            "angle": motion.angle,
            "misfit": motion.misfit,
            "volume_strain": motion.volume_ratio - 1,
            "shear_strain": np.sqrt(2 / 3 * (deviator**2).sum(axis=(1, 2))),
        }
        | columns_of("stress", found.stress, STRESS)
        | {
            "mean": found.mean,
            "peak": found.peak,
            "percentile_95": found.percentile,
            "plastic_fraction": found.plastic_fraction,
            "unstressed": grain_stress.unstressed(found.mean, found.volume),
        }
    )
    if (run.path / "labels.csv").is_file():
        origin = run.table("labels")
        if {"label", "file", "body"} <= set(origin):
            origin = origin[["label", "file", "body"]].rename(columns={"label": "grain"})
            table = table.merge(origin, how="left", on="grain")
    return table


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
        of the place, or label), ``grain``, ``displacement_x`` … [m], ``stress_xx`` … [Pa],
        ``von_mises`` [Pa], ``plastic_strain``.

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
                | columns_of("stress", values["stress"], STRESS)
                | {k: values[k] for k in ("von_mises", "plastic_strain")}
            )
        )
    if not tables:
        raise InputError(f"{run.path / 'fields'} has no stored states, expected some to probe")
    return pandas.concat(tables, ignore_index=True)
