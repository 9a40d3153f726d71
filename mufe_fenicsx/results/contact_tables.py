"""Tables of the contacts of a run: their part in the network, their age, the network in numbers."""

import numpy as np
import pandas

from ..analysis import contact_forces, fabric
from ..analysis.contact_age import active_since
from ..container import WALLS
from ..errors import InputError
from ..scene.pairs import REST, by_materials
from .columns import STRESS, vectors
from .grain_tables import grain_volumes


def active_contacts(run, number=-1, angle=45.0):
    """Active contacts of a stored state with their part in the network.

    The columns of the stored table, and ``ratio`` f/<f> of the normal force over the mean of those
    between grains (of those with walls where no grains touch), ``strong`` (at least 1),
    ``mobilised`` (friction over μ times the normal force), ``sliding``, and ``chain`` (both grains
    are linked in one; its number, -1: none).

    Args:
        run: :class:`~mufe_fenicsx.results.run.Run`.
        number: Of the stored state; -1 is the last.
        angle: Of force chains [degrees], as of
            :func:`~mufe_fenicsx.analysis.contact_forces.force_chains`.
    """
    contacts, grains = run.contacts(number), run.grains(number)
    contacts = contacts[contacts["num_points"] > 0].reset_index(drop=True)
    force = contacts["normal_force"].to_numpy(dtype=float)
    wall = contacts["grain_b"].to_numpy() == 0
    inner = force[~wall] if (~wall).any() else force
    ratio = (
        force / inner.mean() if inner.size and inner.mean() > 0 else np.full(force.shape, np.nan)
    )
    contacts["ratio"], contacts["strong"] = ratio, ratio >= 1
    mobilised = contact_forces.mobilised_friction(
        vectors(contacts, "force"), vectors(contacts, "friction"), _friction(run, contacts)
    )
    contacts["mobilised"] = mobilised
    contacts["sliding"] = np.nan_to_num(mobilised) >= contact_forces.SLIDING
    chains, first = _chains(run, number, contacts, grains, angle)
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


def _chains(run, number, active, grains, angle):
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
    if not np.isfinite(stress).all():
        raise InputError(f"fault: contacts of state {state.index} have values that are not numbers")
    chains = contact_forces.force_chains(
        stress, centre, first[~wall], second[~wall], angle, force=vectors(active, "force")[~wall]
    )
    return chains, first[~wall]


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
        active, grains = run.active_contacts(index), run.grains(index)
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
