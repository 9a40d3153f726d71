"""A simulation on a grown mesh goes on from the one on the mesh before.

What follows from the mesh is made anew: masses, volumes, layers, lists of nodes. What steps change
has rows from those of before, through the ``state_dict`` of each part.
"""

import numpy as np

from ..contact.growth import beside, carry_contact
from ..contact.pairs.relative_motion import SKIN, SKIN_BESIDE_CRACKS
from ..contact.taking_over import take_over
from ..errors import raise_together
from ..state import ForceTerm


def grown_mesh(specimen, between):
    """The mesh of a specimen after a growth, itself where nothing parts or comes loose. Collective.

    Args:
        specimen: :class:`~mufe_fenicsx.specimen.Specimen`.
        between: As of :meth:`~mufe_fenicsx.mesh.GrainMesh.grow`.

    Raises:
        InputError: As of :meth:`~.Simulation.grow`; on all ranks.
    """
    raise_together(specimen.comm, what_cannot_grow(specimen, between))
    holding = [term.holding() for term in specimen.opening_terms]
    mesh = specimen.mesh.grow(between)
    return mesh.in_pieces(np.concatenate([np.empty((0, 2), np.int64), *holding]), specimen.mesh)


def what_cannot_grow(specimen, between):
    """The line for what beside the mesh keeps a specimen from growing, or None. Local."""
    mesh, rigid = specimen.mesh, specimen.rigid
    if mesh.sleeves:
        return f"membrane {mesh.sleeves[0]} beside a mesh that grows, expected none"
    for term in specimen.added_terms:
        if term.mesh is None and type(term).grow is ForceTerm.grow:
            return (
                f"force term {term.name} names no mesh, expected one, whose growth its rows of "
                "STATE follow"
            )
    cells = np.asarray(between)
    if cells.dtype.kind in "iu" and cells.ndim == 2:
        known = cells[(cells >= 0) & (cells < mesh.num_cells)]
        grain = mesh.grain_of_cell[known]
        wrong = grain[np.isin(grain, rigid.grains)]
        if wrong.size:
            name = mesh.name_of(mesh.grains[wrong[0]])
            return f"facet to open in the rigid {name}, expected grains that deform"
    return None


def options_of(options, mesh):
    """Options of a specimen for a mesh that has grown, whose nodes have the old factors. Local."""
    if options.get("mass_factor") is None:
        return options
    return options | {"mass_factor": np.asarray(options["mass_factor"])[mesh.source.nodes]}


def carry_over(old, new):
    """Bring a simulation that is made on a grown mesh to the state of the one before. Collective.

    Args:
        old: :class:`~.Simulation` whose steps are complete; of no use afterwards.
        new: One of the same materials and walls on its grown mesh.
    """
    source, sp = new.mesh.source, new.specimen
    sp.terms.insert(0, new.contact_term)
    new.deform_all_but(old.mesh.grains[old.rigid.grains])
    share = new.solid.kernel.node_volume0 / old.solid.kernel.node_volume0[source.nodes]
    grains = new.mesh.parted_grains
    parted = np.flatnonzero(np.isin(new.mesh.grain_of_node, grains))
    before, inner_before = _energies(old), _internal_forces(old, grains)[source.nodes[parted]]
    inner_before *= share[parted, None]

    sp.damping = old.damping
    new.contact.layers.set_time_step(old.contact.layers.step)
    there = [term.name for term in sp.added_terms]
    moved = [term for term in old.specimen.added_terms if term.name not in there]
    for term in moved:
        term.grow(new.mesh, share)
        sp.insert_term(term)
    sp.first_energies = old.specimen.first_energies.copy()
    parts, names = new.parts, {f"term_{term.name}" for term in moved}
    for name, part in old.parts.items():
        if name not in names:
            parts[name].load_state_dict(part.grown(source, share))
    new.stable.follow_parts(new.solid.mass)
    carry_contact(old.contact, new.contact, source)

    # Only around nodes with parts: else forces and accelerations keep their last bits.
    inner = _internal_forces(new, grains)[parted]
    changed = parted[(share[parted] != 1.0) | (inner != inner_before).any(axis=1)]
    sp.f[parted] += inner - inner_before
    for term in sp.added_terms:
        term.part(old.specimen, sp)
    sp.f[sp.glued.nodes] = 0.0
    sp.mirrors.project(sp.f)
    new.state.a[changed] = sp.f[changed] / new.solid.mass[changed, None]

    apart = _energies(new)
    sp.first_energies += (apart - before)[1:]
    _meet_anew(new, _came_loose(new.mesh, old.mesh), _faces_let_go(new))
    # What terms hand to contact there stays in the balance.
    sp.parted -= (apart - before)[0] + (_energies(new) - apart).sum()
    if any([term.settle(sp, new.motion.damping) for term in sp.added_terms]):
        new.motion.begin_steps(new.state.dt, new.motion.damping)
    old.contact.destroy()
    old.stable.destroy()
    old.specimen.terms.clear()  # of which that of contact refers back: arrays are freed at once


def _came_loose(mesh, before):
    """Cells of pieces that a mesh has since a growth, of which cells stay. Local."""
    now, then = (
        np.zeros(of.num_cells, np.int32) if of.piece_of_cell is None else of.piece_of_cell
        for of in (mesh, before)
    )
    return np.flatnonzero(now != then)


def _faces_let_go(simulation):
    """Faces of cracks that become contact, tractions and energy, as of ForceTerm.let_go. Local."""
    found = [term.let_go(simulation.state) for term in simulation.specimen.opening_terms]
    none = np.empty((0, 2), dtype=np.int64), np.empty((0, 3)), 0.0
    sides, traction, held = zip(none, *found, strict=True)
    return np.concatenate(sides), np.concatenate(traction), sum(held)


def _meet_anew(simulation, loose, faces):
    """Find pairs of new facets, and look anew at those that a crack ends beside. Collective.

    What overlaps now that was not in contact, as nodes do that have become vertices, is accepted as
    at the start: it carries from there on. So do all faces of what has come ``loose``, whenever
    they opened, as of :func:`_came_loose`. Walls keep their loads of the last step. ``faces``: of
    :func:`_faces_let_go`, whose pairs bear what these bore.
    """
    contact, walls, x = simulation.contact, simulation.walls, simulation.state.x
    mesh, (sides, traction, held) = simulation.mesh, faces
    any_faces = simulation.comm.allreduce(len(sides)) > 0
    # Faces of pieces may lie deep in each other; else the mesh is likely to grow again soon.
    is_loose = simulation.comm.allreduce(loose.size) > 0
    contact.search(x, skin=SKIN if is_loose else SKIN_BESIDE_CRACKS)
    contact.bind()
    if contact.layers.kinematic:  # which stores nothing, and acts at other positions
        return
    new, of_pieces = np.zeros((2, len(x)), dtype=bool)
    new[mesh.facets[mesh.source.facets < 0]] = True
    of_pieces[mesh.cells[loose]] = True
    pairs, edges = contact.pairs, contact.edges.pairs
    tables = pairs, walls.pairs, edges
    within = pairs.within, np.zeros(len(walls.pairs.node), dtype=bool), edges.grain == edges.partner
    at_new, at_pieces = beside(contact, new), beside(contact, of_pieces)
    touched = [a | b & of for a, b, of in zip(at_new, at_pieces, within, strict=True)]
    if not simulation.comm.allreduce(sum(map(np.count_nonzero, touched))):
        return
    loads = walls.force, walls.torque, walls.curved.pressing
    kept = [load.copy() for load in loads]
    waits = [table.next_check.copy() for table in tables]
    for table, which in zip(tables, touched, strict=True):
        table.next_check[~which] = np.inf  # the others stay as they are, to the last bit
    contact.begin_step(x)
    of_start = contact.overlaps.state_dict()
    contact.add_forces(np.zeros_like(x), x, accept=True)
    contact.overlaps.load_state_dict(of_start)
    if any_faces:
        take_over(contact, sides, traction, held, x)
    for load, value in zip(loads, kept, strict=True):
        load[:] = value
    for table, which, wait in zip(tables, touched, waits, strict=True):
        table.next_check[~which] = wait[~which]


def _internal_forces(simulation, grains):
    """Those of local grains on the nodes as they are [N], shape (num_nodes, 3). Local."""
    s, offset = simulation.state, simulation.mesh.cell_offset
    history = s.state_dict()["cells"].values()
    parts = [values[offset[k] : offset[k + 1]] for values in history for k in grains]
    f, kept = np.zeros_like(s.x), [part.copy() for part in parts]
    simulation.solid.add_internal_forces(f, s, 0.0, grains)
    for part, before in zip(parts, kept, strict=True):
        part[:] = before
    return f


def _energies(simulation):
    """What a growth changes without the added terms, and what each of these has [J]. Local."""
    sp, contact = simulation.specimen, simulation.contact
    stored = simulation.kinetic_energy() + simulation.solid.elastic_energy(sp.state).sum()
    done = contact.dissipation
    stored += contact.energy()[0] + done.total + done.switched + done.dents.work.sum()
    pairs = zip(sp.added_terms, sp.first_energies, strict=True)
    of_terms = [0.0 if np.isnan(first) else term.energy(sp.state) for term, first in pairs]
    return np.array([stored, *of_terms])
