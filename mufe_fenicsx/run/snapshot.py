"""The whole state of a simulation, in names that know no ranks, and the state made again.

What a step changes is stored as it is; what follows from it is made again: the mesh from
the grains, masses and materials from the scene, and facets of other ranks by the exchange of
the last search, from the positions of then. On the same number of ranks the steps that
follow give the same bits.
"""

import numpy as np

from ..contact.snapshot import Rows, contact_tables, restore_contact
from ..contact.start.reference import set_reference

#: Numbers that are the same on all ranks: attribute of the simulation, its state or contact.
OF_SIMULATION = ("dt", "dt_element", "initial_kinetic", "_followed_search")
OF_REFRESH = ("clock", "at", "margin", "wait", "steady", "limit")
OF_STABLE = ("rate_of_tets", "tets_at", "element_step_then")
OF_SHARED = ("square", "misses", "failures", "rest")
OF_STATE = ("t", "dt", "num_steps")
OF_CONTACT = ("clock", "searched_at", "reach", "overlap", "num_searches", "_dt")
OF_SCALING = ("wanted", "reached")
OF_WALLS = ("point", "normal", "velocity", "angular_velocity", "rotation", "_push", "_turn")
OF_RIGID = ("mass", "inertia", "centre", "turn", "axes", "radius", "velocity", "momentum", "spin",
            "force", "torque")  # fmt: skip


def snapshot(simulation):
    """All that the next steps depend on. Collective; nothing changes.

    Args:
        simulation: :class:`~.Simulation` without glued nodes, between
            two steps.

    Returns:
        Tables of this rank: dict of dicts of arrays or Rows of some, of the present state until the
        next step, each with a column ``grain``. What this
        rank has added up, or the largest it has seen: dict of arrays, the latter with names
        that begin with ``largest``. And numbers that all ranks have in common, fit for JSON.
    """
    simulation.finish_kick()
    s, rigid, contact, walls = (
        simulation.state, simulation.rigid, simulation.contact, simulation.walls,
    )  # fmt: skip
    mesh, solid = simulation.mesh, simulation.solid
    nodes, cells = mesh.named_nodes, mesh.named_cells
    at_nodes = {"reference": mesh.x, "x": s.x, "u": s.u, "v": s.v, "a": s.a, "f": simulation._f}
    in_cells = {name: getattr(s, name) for name in ("deviator", "plastic_strain", "plastic_work")}
    if simulation.scaling is not None:
        in_cells["added_density"] = simulation.scaling.added
        at_nodes["added_mass"] = simulation.scaling.added_to_node
    if solid.element == "averaged":
        at_nodes["pressure"] = solid.pressure[: mesh.num_nodes]
    else:
        in_cells["pressure"] = solid.pressure[: mesh.num_cells]
    of_rigid = {name: getattr(rigid, name) for name in OF_RIGID}
    followed = np.zeros(mesh.num_nodes, dtype=bool)
    if simulation._any_rigid:
        at_nodes["place"] = np.zeros_like(s.x)
        at_nodes["place"][rigid.nodes] = rigid.place
        followed[rigid.followed.nodes if rigid.chosen else rigid.surface] = True
        at_nodes["followed"] = followed
    shared = simulation.stable.shared
    if shared.part is not None:
        at_nodes["part_of_tets"] = shared.part
    for name, highest in _frequencies(simulation).items():
        if highest.vector is not None:
            at_nodes[name], of_rigid[name] = _unpacked(rigid, highest.vector, mesh.num_nodes)
    tables = {
        "nodes": {"grain": mesh.grains[mesh.grain_of_node[nodes]]}
        | {name: Rows(values, nodes) for name, values in at_nodes.items()},
        "cells": {"grain": mesh.grains[mesh.grain_of_cell[cells]]}
        | {name: Rows(values, cells) for name, values in in_cells.items()},
        "rigid": {"grain": mesh.grains[rigid.grains]} | of_rigid,
        **contact_tables(contact, mesh),
    }
    own = {
        "damped": simulation.damped,
        "dissipated": contact.dissipated,
        "num_adopted": contact.num_adopted,
        "switched": contact.switched,
        "work": walls.work,
        "force": walls.force,
        "torque": walls.torque,
        "largest_deepest": contact.deepest,
        "largest_moved": rigid.moved,
        "largest_radius": walls._radius,
        "largest_box": walls._box,
        "largest_overrun": contact.overrun,
        "largest_overrun_of_all": contact.overrun_of_all,
        "largest_everything_moves": contact.moving is None,
        "largest_chosen": rigid.chosen,
    }
    scaling = simulation.scaling
    common = {
        "scaling": scaling and {name: getattr(scaling, name) for name in OF_SCALING},
        "simulation": {name: getattr(simulation, name) for name in OF_SIMULATION},
        "refresh": {name: getattr(simulation.refresh, name) for name in OF_REFRESH},
        "stable": {name: getattr(simulation.stable, name) for name in OF_STABLE},
        "shared": {name: getattr(shared, name) for name in OF_SHARED},
        "state": {name: getattr(s, name) for name in OF_STATE},
        "contact": {name: getattr(contact, name) for name in OF_CONTACT},
        "walls": {name: getattr(walls, name).tolist() for name in OF_WALLS},
        "field": simulation._field.tolist(),
        "num_products": {n: h.num_products for n, h in _frequencies(simulation).items()},
    }
    return tables, {name: np.asarray(value) for name, value in own.items()}, common


def restore_reference(mesh, tables):
    """Give the mesh the reference configuration of then. Collective."""
    x = np.empty_like(mesh.x)
    x[mesh.named_nodes] = tables["nodes"]["reference"]
    # DOLFINx's geometry has other last digits than `mesh.x` until it is set, and so have masses.
    if mesh.comm.allreduce(np.count_nonzero(x != mesh.x)):
        set_reference(mesh, x)


def restore(simulation, tables, own, common):
    """Bring a new simulation of the same scene to the state of then. Collective.

    Args:
        simulation: :class:`~.Simulation` at its start, its mesh with the
            reference of then.
        tables, own, common: Of :func:`snapshot`, with the rows of this rank's grains. The tables
            are emptied: there is no room for them beside what is made of them.

    Raises:
        InputError: The tables are not those of these grains; on one rank or more.
    """
    s, rigid, contact, walls = (
        simulation.state, simulation.rigid, simulation.contact, simulation.walls,
    )  # fmt: skip
    mesh, solid = simulation.mesh, simulation.solid
    _deform_again(simulation, tables["rigid"]["grain"])
    del tables["nodes"]["reference"]  # the mesh has it
    at_nodes = _scattered(tables.pop("nodes"), mesh.named_nodes)
    in_cells = _scattered(tables.pop("cells"), mesh.named_cells)
    simulation._f[:] = at_nodes.pop("f")
    scaling = simulation.scaling
    if scaling is not None and common["scaling"]:
        scaling.added = in_cells.pop("added_density")
        scaling.added_to_node[:] = at_nodes.pop("added_mass")
        scaling.set_masses()
        simulation.take_masses()
        for name in OF_SCALING:
            setattr(scaling, name, common["scaling"][name])
    for name in ("x", "u", "v", "a"):
        getattr(s, name)[:] = at_nodes.pop(name)
    for name in ("deviator", "plastic_strain", "plastic_work"):
        getattr(s, name)[:] = in_cells.pop(name)
    pressure = (at_nodes if solid.element == "averaged" else in_cells).pop("pressure")
    solid.pressure[: len(pressure)] = pressure

    row = {int(grain): k for k, grain in enumerate(tables["rigid"]["grain"])}
    rows = np.array([row[int(g)] for g in mesh.grains[rigid.grains]], dtype=np.int64)
    for name in OF_RIGID:
        getattr(rigid, name)[:] = tables["rigid"][name][rows]
    if simulation._any_rigid:
        rigid.place[:] = at_nodes.pop("place")[rigid.nodes]
    for name, highest in _frequencies(simulation).items():
        highest.num_products = common["num_products"][name]
        if name in at_nodes:
            turning = tables["rigid"][name][rows[: rigid.num_always]]
            highest.vector = _packed(rigid, at_nodes.pop(name), turning)

    simulation.stable.shared.part = at_nodes.pop("part_of_tets", None)
    simulation.damped = float(own["damped"])
    contact.dissipated = float(own["dissipated"])
    contact.switched = float(own["switched"])
    contact.num_adopted, contact.deepest = int(own["num_adopted"]), float(own["largest_deepest"])
    rigid.moved = float(own["largest_moved"])
    walls.work, walls._radius = float(own["work"]), own["largest_radius"]
    walls._box = own["largest_box"]
    walls.force[:], walls.torque[:] = own["force"], own["torque"]
    for target, part, names in (
        (simulation, "simulation", OF_SIMULATION),
        (simulation.refresh, "refresh", OF_REFRESH),
        (simulation.stable, "stable", OF_STABLE),
        (simulation.stable.shared, "shared", OF_SHARED),
        (s, "state", OF_STATE),
        (contact, "contact", OF_CONTACT),
    ):
        for name in names:
            setattr(target, name, common[part][name])
    for name in OF_WALLS:
        getattr(walls, name)[:] = np.reshape(common["walls"][name], getattr(walls, name).shape)
    contact.overrun = float(own["largest_overrun"])
    contact.overrun_of_all = float(own["largest_overrun_of_all"])
    simulation.set_field(np.array(common["field"]))
    restore_contact(contact, mesh, tables, bool(own["largest_everything_moves"]))
    if simulation._any_rigid and own["largest_chosen"]:
        rigid.follow(at_nodes["followed"])


def _deform_again(simulation, still_rigid):
    """Let those grains deform that did then; ``still_rigid`` are the others' global indices."""
    rigid, mesh = simulation.rigid, simulation.mesh
    which = ~np.isin(mesh.grains[rigid.grains], still_rigid)
    if which.any():
        rigid.release(which)
        simulation._watch.release(which)
        grains = np.arange(mesh.num_grains)
        simulation.solid.set_deforming(grains[~np.isin(grains, rigid.grains)])


def _frequencies(simulation):
    stable = simulation.stable
    names = "highest", "highest_of_springs", "highest_of_tets"
    return {name: getattr(stable, name) for name in names} | {"of_shares": stable.shared.highest}


def _scattered(table, order):
    """Columns of a table of all nodes or cells of this rank, in the order of its mesh.

    The table is empty then; its grains are left out, which the mesh has.
    """
    columns = {}
    del table["grain"]
    while table:
        name, values = table.popitem()
        columns[name] = np.empty_like(values)
        columns[name][order] = values
    return columns


def _unpacked(rigid, rows, num_nodes):
    """Rows of :meth:`RigidGrains.free_masses` as values at nodes and of rigid grains."""
    n, free = rigid.num_always, rigid.unconstrained
    of_grains = np.zeros((rigid.num_grains, 2, 3))
    if not n:
        return rows, of_grains
    at_nodes = np.zeros((num_nodes, 3))
    at_nodes[free] = rows[: free.size]
    of_grains[:n] = rows[free.size :].reshape(n, 2, 3)
    return at_nodes, of_grains


def _packed(rigid, at_nodes, of_grains):
    """The reverse of :func:`_unpacked`."""
    if not rigid.num_always:
        return at_nodes
    return np.concatenate([at_nodes[rigid.unconstrained], of_grains.reshape(-1, 3)])
