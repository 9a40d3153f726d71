"""The whole state of a simulation, in names that know no ranks, and the state made again.

What a step changes is stored as it is; what follows from it is made again: the mesh from
the grains, masses and materials from the scene, and facets of other ranks by the exchange of
the last search, from the positions of then. On the same number of ranks the steps that
follow give the same bits.
"""

from dataclasses import replace

import numpy as np
from mpi4py import MPI

from ..contact.snapshot import Rows, contact_tables, restore_contact
from ..contact.start.reference import set_reference
from ..errors import raise_together

#: Columns of the tables that :func:`restore_mesh` reads, beside ``grain``.
OF_MESH = {
    "nodes": ("reference",),
    "topology": ("cell", "across", "version"),
    "pieces": ("cell", "piece"),
}


def snapshot(simulation):
    """All that the next steps depend on. Collective; nothing changes.

    Args:
        simulation: :class:`~.Simulation` between two steps.

    Returns:
        Tables of this rank: dict of dicts of arrays or Rows of some, of the present state until the
        next step, each with a column ``grain``, others named ``part.value``. What this
        rank has added up, or the largest it has seen: dict of arrays, the latter with names
        that begin with ``largest``. And numbers that all ranks have in common, fit for JSON.
    """
    simulation.complete()
    mesh, rigid, contact = simulation.mesh, simulation.rigid, simulation.contact
    nodes, cells = mesh.named_nodes, mesh.named_cells
    tables = {
        "nodes": {
            "grain": mesh.grains[mesh.grain_of_node[nodes]],
            "reference": Rows(mesh.x, nodes),
        },
        "cells": {"grain": mesh.grains[mesh.grain_of_cell[cells]]},
        "rigid": {"grain": mesh.grains[rigid.grains]},
    }
    own, common = {"largest.everything_moves": contact.ghosts.moving is None}, {}
    for part, thing in simulation.parts.items():
        kept = thing.state_dict()
        for place, order in (("nodes", nodes), ("cells", cells), ("rigid", slice(None))):
            for name, values in kept.get(place, {}).items():
                column = values if place == "rigid" else Rows(values, order)
                tables[place][f"{part}.{name}"] = column
        for place in ("sum", "largest"):
            for name, value in kept.get(place, {}).items():
                own[f"{place}.{part}.{name}"] = np.array(value)
        common[part] = {
            name: value.tolist() if isinstance(value, np.ndarray) else value
            for name, value in kept.get("common", {}).items()
        }
    tables |= _topology(mesh) | contact_tables(contact, mesh)
    for term in simulation.specimen.added_terms:
        tables |= {f"term_{term.name}.{name}": table for name, table in term.tables().items()}
    return tables, {name: np.asarray(value) for name, value in own.items()}, common


def _topology(mesh):
    """Facets that opened and pieces, by the numbers of cells in their grain. Collective."""
    opened = mesh.all_opened
    if not mesh.comm.allreduce(len(opened)):
        return {}
    number = np.empty(mesh.num_cells, dtype=np.int64)
    number[mesh.named_cells] = np.arange(mesh.num_cells)
    grain = mesh.grain_of_cell[opened[:, 0]]
    cell, across = number[opened[:, :2]].T - mesh.cell_offset[grain]
    names = {"cell": cell, "across": across, "version": opened[:, 2]}
    tables = {"topology": {"grain": mesh.grains[grain]} | names}
    piece = np.zeros(mesh.num_cells, dtype=np.int32)
    if mesh.piece_of_cell is not None:
        piece[:] = mesh.piece_of_cell
    at = mesh.named_cells[piece[mesh.named_cells] > 0]
    grain = mesh.grain_of_cell[at]
    names = {"cell": number[at] - mesh.cell_offset[grain], "piece": piece[at]}
    return tables | {"pieces": {"grain": mesh.grains[grain]} | names}


def restore_mesh(mesh, tables):
    """The mesh of then, made of that of the start. Collective.

    Nodes have their reference positions, and facets open as they did, one version after another.

    Args:
        mesh: :class:`~mufe_fenicsx.mesh.GrainMesh` of version 0.
        tables: Of :func:`snapshot`, with the columns ``OF_MESH`` at least; without a table
            ``topology`` no facet opened.

    Raises:
        InputError: A facet that opened is none of these grains; on all ranks.
    """
    _restore_reference(mesh, tables["nodes"])
    opened = tables.get("topology")
    if opened is not None:
        local = np.searchsorted(mesh.grains, opened["grain"])
        first, end = mesh.cell_offset[local], mesh.cell_offset[local + 1]
        place = first[:, None] + np.stack([opened["cell"], opened["across"]], axis=1)
        wrong = ((place < first[:, None]) | (place >= end[:, None])).any()
        line = "a facet that opened is between cells of other grains, expected those of the start"
        raise_together(mesh.comm, line if wrong else None)
        pairs, last = mesh.named_cells[place], opened["version"].max(initial=0)
        for version in range(1, mesh.comm.allreduce(int(last), op=MPI.MAX) + 1):
            mesh = mesh.grow(pairs[opened["version"] == version])
        mesh = _with_pieces(mesh, tables["pieces"])
    return mesh


def _with_pieces(mesh, table):
    """The mesh with the pieces of grains that a table tells. Local."""
    if not table["cell"].size:
        return mesh
    piece = np.zeros(mesh.num_cells, dtype=np.int32)
    first = mesh.cell_offset[np.searchsorted(mesh.grains, table["grain"])]
    piece[mesh.named_cells[first + table["cell"]]] = table["piece"]
    return replace(mesh, piece_of_cell=piece)


def _restore_reference(mesh, table):
    """Nodes of the start, which are the first ones of their grain in a table of all. Collective."""
    local = np.searchsorted(mesh.grains, table["grain"])
    number = np.arange(local.size) - np.searchsorted(local, np.arange(mesh.num_grains))[local]
    x = np.empty_like(mesh.x)
    x[mesh.named_nodes] = table["reference"][number < np.diff(mesh.node_offset)[local]]
    # DOLFINx's geometry has other last digits than `mesh.x` until it is set, and so have masses.
    if mesh.comm.allreduce(np.count_nonzero(x != mesh.x)):
        set_reference(mesh, x)


def restore(simulation, tables, own, common):
    """Bring a new simulation of the same scene to the state of then. Collective.

    Args:
        simulation: :class:`~.Simulation` at its start, its mesh with the reference of then.
        tables, own, common: Of :func:`snapshot`, with the rows of this rank's grains. The tables
            are emptied: there is no room for them beside what is made of them.

    Raises:
        InputError: The tables are not those of these grains; on one rank or more.
    """
    mesh, rigid = simulation.mesh, simulation.rigid
    simulation.deform_all_but(tables["rigid"]["grain"])
    del tables["nodes"]["reference"]  # the mesh has it
    row = {int(grain): k for k, grain in enumerate(tables["rigid"]["grain"])}
    rows = np.array([row[int(g)] for g in mesh.grains[rigid.grains]], dtype=np.int64)
    found = {
        "nodes": _scattered(tables.pop("nodes"), mesh.named_nodes),
        "cells": _scattered(tables.pop("cells"), mesh.named_cells),
        "rigid": {name: values[rows] for name, values in tables["rigid"].items()},
    }
    for place in ("sum", "largest"):
        some = {name.partition(".")[2]: v for name, v in own.items() if name.startswith(place)}
        found[place] = some
    for part, thing in simulation.parts.items():
        kept = {"common": common.get(part, {})}
        for place, values in found.items():
            names = [name for name in values if name.startswith(f"{part}.")]
            kept[place] = {name.removeprefix(f"{part}."): values.pop(name) for name in names}
        kept = {place: values for place, values in kept.items() if values}
        if kept:  # none where another integrator was there, which knew no such part
            thing.load_state_dict(kept)
    for term in simulation.specimen.added_terms:
        first = f"term_{term.name}."
        names = [name for name in tables if name.startswith(first)]
        term.load_tables({name.removeprefix(first): tables.pop(name) for name in names})
    everything_moves = bool(own["largest.everything_moves"])
    restore_contact(simulation.contact, mesh, tables, everything_moves)


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
