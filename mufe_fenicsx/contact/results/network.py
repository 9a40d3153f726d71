"""The contact network: what each pair of grains, and each grain and wall, do to each other.

Sign convention of a contact between a (the grain with the lower index) and b (the other
grain, or a wall):

- ``force`` and ``torque`` are those of b on a; the torque is about the contact's centroid;
- ``normal`` points from b to a, so compression has force · normal > 0;
- ``branch`` points from b to a as well: from centre of mass to centre of mass, or from the
  centroid on the wall to the centre of mass. Compression positive, the mean stress
  of a volume V at rest is Σ force ⊗ branch / V (Love 1927; Weber 1966).

Both sides of a contact carry a share of it at their own points, and sharp edges of both
carry it where they cross: force, torque, area and work are sums over all of these. The
force on a point and its opposite on the facet have no moment about each other (a couple
sees to that), so both act at the point; the forces on crossing edges neither, and their
moment is that of the forces on the nodes at their ends.
"""

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from .dissipation import sum_by_pair
from .edge_contacts import closed_crossings
from .patches import Patches, find_patches


@dataclass(frozen=True)
class Contacts:
    """Contacts in increasing order of ``a``, then ``b``; forces are zero where they are open.

    An open contact is listed where friction did work there before.
    """

    a: np.ndarray  #: index of the grain, shape (num_contacts,)
    b: np.ndarray  #: index of the other grain, or the number of grains + that of the wall
    num_points: np.ndarray  #: points with pressure > 0 of both sides, and crossings of edges
    area: np.ndarray  #: that they stand for, in the reference configuration [m²]
    area_deformed: np.ndarray  #: the same as their facets are now [m²]
    normal: np.ndarray  #: mean over the area, unit length, shape (num_contacts, 3)
    centroid: np.ndarray  #: of the area [m], shape (num_contacts, 3); nan where open
    branch: np.ndarray  #: from b to a [m], shape (num_contacts, 3)
    force: np.ndarray  #: on a [N], shape (num_contacts, 3)
    friction: np.ndarray  #: the part of it that is friction [N], shape (num_contacts, 3)
    torque: np.ndarray  #: on a, about the centroid [N m], shape (num_contacts, 3)
    work: np.ndarray  #: dissipated by friction (and in springs let go at edges) so far [J]

    @property
    def active(self):
        """Whether there is pressure, shape (num_contacts,)."""
        return self.num_points > 0

    @property
    def within(self):
        """Whether it is between pieces of one grain, shape (num_contacts,)."""
        return self.a == self.b

    @property
    def normal_force(self):
        """Component of the force along the mean normal [N], shape (num_contacts,)."""
        return np.einsum("ij,ij->i", self.force, self.normal)

    @property
    def shear_force(self):
        """Force less its part along the mean normal [N], shape (num_contacts, 3)."""
        return self.force - self.normal_force[:, None] * self.normal


@dataclass(frozen=True)
class Network:
    """All contacts of a sample at one time, and its grains."""

    labels: np.ndarray  #: of the grains, shape (num_grains,)
    walls: list  #: names of sleeves and tools, if any, and of the walls
    mass: np.ndarray  #: of the grains [kg], shape (num_grains,)
    centre: np.ndarray  #: their centres of mass [m], shape (num_grains, 3)
    contacts: Contacts
    patches: Patches  #: of these contacts, as facets resolve them
    num_fragments: np.ndarray  #: pieces that each grain is in, shape (num_grains,)

    def num_active(self, walls=False):
        """Active contacts of each grain with grains, or with walls, shape (num_grains,).

        The first is N_cA of Nadimi & Fonseca (2018).
        """
        c, n = self.contacts, self.labels.size
        wanted = c.active & ((c.b >= n) == walls) & ~c.within
        count = np.bincount(c.a[wanted], minlength=n)
        return count if walls else count + np.bincount(c.b[wanted], minlength=n)

    def sum_over_contacts(self, on_a, on_b):
        """Sum of a quantity of contacts over those of each grain, shape (num_grains, …).

        Args:
            on_a, on_b: What it is for a and for b, shape (num_contacts, …).
        """
        c, n = self.contacts, self.labels.size
        total = np.zeros((n, *np.shape(on_a)[1:]))
        np.add.at(total, c.a, on_a)
        grain = c.b < n
        np.add.at(total, c.b[grain], on_b[grain])
        return total


def find_network(contact, mesh, mass, x, strength=None):
    """The network at the positions of the last forces. Collective.

    Sleeves and tools are among the walls, before the others: what they touch but grains is left
    out.

    Each rank sums over its own points; rank 0 receives these sums, a few numbers for each
    contact and grain, and adds up the two sides.

    Args:
        contact: :class:`~mufe_fenicsx.contact.contact.Contact`.
        mesh: :class:`~mufe_fenicsx.mesh.GrainMesh`.
        mass: Nodal masses [kg], shape (num_nodes,).
        x: Positions of the nodes [m], shape (num_nodes, 3).
        strength: As of :func:`.patches.find_patches`.

    Returns:
        :class:`Network` on rank 0, None on the others.
    """
    comm = contact.comm
    patches = find_patches(contact, mesh, x, strength)
    grain_mass = np.bincount(mesh.grain_of_node, mass, mesh.num_grains)
    first_moment = np.zeros((mesh.num_grains, 3))
    np.add.at(first_moment, mesh.grain_of_node, mass[:, None] * x)
    parts = comm.gather(
        (
            mesh.grains, mesh.num_pieces, grain_mass, first_moment / grain_mass[:, None],
            _own_sums(contact, x),
        )
    )  # fmt: skip
    if comm.rank:
        return None
    num_bodies, num_grains = mesh.labels.size, mesh.num_sample_grains
    all_mass, centre = np.empty(num_bodies), np.empty((num_bodies, 3))
    num_pieces = np.empty(num_bodies, dtype=np.int64)
    for grains, number, grain_mass, grain_centre, _ in parts:
        num_pieces[grains], all_mass[grains], centre[grains] = number, grain_mass, grain_centre
    (a, b), (sums,) = sum_by_pair(
        *(np.concatenate(p) for p in zip(*(s for *_, s in parts), strict=True))
    )
    of_grains, centre = a < num_grains, centre[:num_grains]
    return Network(
        labels=mesh.labels[:num_grains],
        walls=[*mesh.sleeves, *mesh.tools, *contact.walls.names],
        mass=all_mass[:num_grains],
        centre=centre,
        contacts=_contacts(a[of_grains], b[of_grains], sums[of_grains], centre),
        patches=patches,
        num_fragments=num_pieces[:num_grains],
    )


def num_active_pairs(contact, num_grains=None):
    """Number of pairs of grains that press on each other. Collective.

    Args:
        contact: :class:`~mufe_fenicsx.contact.contact.Contact`.
        num_grains: Only of the first so many; None: of all bodies.
    """
    p = contact.pairs
    on = np.flatnonzero(p.closed)
    mine, other = contact.points.grain_of_point[p.node[on]], p.grain[on]
    points = np.column_stack([np.minimum(mine, other), np.maximum(mine, other)])
    found = np.unique(np.vstack([points, contact.edges.closed_grains()]), axis=0)
    found = found[found[:, 0] != found[:, 1]]  # of pieces of one grain
    if num_grains is not None:
        found = found[found[:, 1] < num_grains]
    parts = contact.comm.gather(found)
    number = np.unique(np.concatenate(parts), axis=0).shape[0] if contact.comm.rank == 0 else None
    return contact.comm.bcast(number)


def num_active_grains(contact, num_grains):
    """Number of grains that press on another or a wall, of the first ``num_grains``. Collective."""
    active = np.zeros(contact.dissipation.num_grains, dtype=bool)
    p, w, grain_of_point = contact.pairs, contact.walls.pairs, contact.points.grain_of_point
    both = np.column_stack([grain_of_point[p.node[p.closed]], p.grain[p.closed]])
    both = np.vstack([both, contact.edges.closed_grains()])
    active[both[both[:, 0] != both[:, 1]]] = True
    active[grain_of_point[w.node[w.closed]]] = True
    contact.comm.Allreduce(MPI.IN_PLACE, active, op=MPI.LOR)
    return int(active[:num_grains].sum())


#: Columns of the sums over points.
_COUNT, _AREA, _DEFORMED, _WORK = range(4)
_NORMAL, _PLACE, _FORCE, _FRICTION, _MOMENT = (slice(k, k + 3) for k in range(4, 19, 3))
_NUM_COLUMNS = 19


def _own_sums(contact, x):
    """a and b of this rank's contacts, and sums over its points, shape (num, _NUM_COLUMNS). Local.

    Crossings of edges count as points, on the rank that evaluates them.
    Moments are about the origin. ``x`` are the positions of the nodes [m].
    """
    contact.ghosts.place_points()
    grain_of_point = contact.points.grain_of_point
    num_grains = contact.dissipation.num_grains
    p, w = contact.pairs, contact.walls.pairs
    of_work, with_work, done = contact.dissipation.totals(p, w, contact.edges.pairs)
    on, at = np.flatnonzero(p.closed), np.flatnonzero(w.closed)
    work = np.zeros((done.size, _NUM_COLUMNS))
    work[:, _WORK] = done
    at_walls, areas = contact.ghosts.positions.array[w.node[at]], contact.points.area[w.node[at]]
    _, wall_normal = contact.walls.gaps(at_walls, w.wall[at])
    of_nodes = contact.ghosts.positions.array[contact.ghosts.num_before :]
    stand = contact.points.stand(of_nodes, p.node[on], p.stands[on])
    crossings = closed_crossings(contact)
    bodies = contact.edges.edges.body
    e = contact.edges.pairs
    crossed = np.flatnonzero(e.closed)
    lower = [
        contact.points.body_of_point[p.node[on]] < p.body[on],
        np.ones(at.size, dtype=bool),
        bodies[e.first[crossed]] < bodies[e.second[crossed]],
        np.ones(done.size, dtype=bool),
    ]
    grain = [
        grain_of_point[p.node[on]],
        grain_of_point[w.node[at]],
        crossings.grain,
        of_work,
    ]
    partner = [p.grain[on], w.wall[at] + num_grains, crossings.partner, with_work]
    sums = [
        _sums_of_points(contact, p, on, stand, p.normal[on], contact.areas(on), x),
        _sums_of_points(contact, w, at, at_walls, wall_normal, areas, x),
        _sums_of_crossings(crossings),
        work,
    ]
    grain, partner, sums, lower = map(np.concatenate, (grain, partner, sums, lower))
    # Seen from the grain with the lower index, or the lower piece of one, what has a direction
    # changes its sign.
    swap = (partner < grain) | (partner == grain) & ~lower
    sums[swap, 4:] *= -1.0
    sums[swap, _PLACE] *= -1.0
    (a, b), (sums,) = sum_by_pair(np.minimum(grain, partner), np.maximum(grain, partner), sums)
    return a, b, sums


def _sums_of_points(contact, pairs, on, place, normal, area, x):
    """Terms of the sums for pairs ``on`` at a ``place``, seen from the grain of the point."""
    stretch = contact.points.stretch(contact.own, x, pairs.node[on])
    terms = np.zeros((on.size, _NUM_COLUMNS))
    terms[:, _COUNT] = 1
    terms[:, _AREA] = area
    terms[:, _DEFORMED] = area * stretch
    terms[:, _NORMAL] = area[:, None] * normal
    terms[:, _PLACE] = area[:, None] * place
    terms[:, _FRICTION] = pairs.shear[on]
    terms[:, _FORCE] = pairs.normal_force[on, None] * normal + pairs.shear[on]
    terms[:, _MOMENT] = np.cross(place, terms[:, _FORCE])
    return terms


def _sums_of_crossings(crossings):
    """Terms of the sums for crossings, seen from the grain of the first edge."""
    c = crossings
    terms = np.zeros((c.normal_force.size, _NUM_COLUMNS))
    terms[:, _COUNT] = 1
    terms[:, _AREA] = terms[:, _DEFORMED] = c.area
    terms[:, _NORMAL] = c.area[:, None] * c.normal
    terms[:, _PLACE] = c.area[:, None] * c.place
    terms[:, _FRICTION] = c.friction
    terms[:, _FORCE] = c.force
    terms[:, _MOMENT] = np.cross(c.ends[:, :2], c.forces[:, :2]).sum(axis=1)
    return terms


def _contacts(a, b, sums, centre):
    """:class:`Contacts` from the sums over both sides."""
    num_grains = centre.shape[0]
    force = sums[:, _FORCE]
    with np.errstate(invalid="ignore", divide="ignore"):  # open contacts have no area
        centroid = sums[:, _PLACE] / sums[:, _AREA, None]
        normal = sums[:, _NORMAL] / np.linalg.norm(sums[:, _NORMAL], axis=1)[:, None]
    other = np.empty_like(centroid)
    grain = b < num_grains
    other[grain] = centre[b[grain]]
    other[~grain] = centroid[~grain]
    branch = centre[a] - other
    is_open = sums[:, _COUNT] == 0
    torque = sums[:, _MOMENT] - np.cross(centroid, force)
    normal[is_open] = torque[is_open] = 0.0
    return Contacts(
        a=a,
        b=b,
        num_points=sums[:, _COUNT].astype(np.int64),
        area=sums[:, _AREA],
        area_deformed=sums[:, _DEFORMED],
        normal=normal,
        centroid=centroid,
        branch=branch,
        force=force,
        friction=sums[:, _FRICTION],
        torque=torque,
        work=sums[:, _WORK],
    )
