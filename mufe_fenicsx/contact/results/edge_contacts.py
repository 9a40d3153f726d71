"""What crossing edges carry, for the contact network and the fields at nodes."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Crossings:
    """Closed crossings of this rank. Nodes: ends of the first edge, then of the second.

    They may belong to other ranks: nodes of the surface with its ghosts.
    """

    grain: np.ndarray  #: of the first edge, global index, shape (num,)
    partner: np.ndarray  #: grain of the second edge, a higher index, shape (num,)
    nodes: np.ndarray  #: surface nodes, shape (num, 4)
    share: np.ndarray  #: of the crossing in these nodes, 1 in all for each edge, shape (num, 4)
    ends: np.ndarray  #: places of these nodes [m], shape (num, 4, 3)
    area: np.ndarray  #: that the crossing stands for, in the reference configuration [m²], (num,)
    depth: np.ndarray  #: by which they overlap, the offset left out [m], shape (num,)
    normal_force: np.ndarray  #: normal force [N], shape (num,)
    normal: np.ndarray  #: unit normal, from the second to the first edge, shape (num, 3)
    friction: np.ndarray  #: on the first edge [N], shape (num, 3)
    #: Normal force, friction, and what pushes it along where the spring is softer [N], (num, 3)
    force: np.ndarray
    forces: np.ndarray  #: on the nodes [N], shape (num, 4, 3)

    @property
    def place(self):
        """Half-way between the edges [m], shape (num, 3)."""
        return 0.5 * np.einsum("ck,cki->ci", self.share, self.ends)


def closed_crossings(contact):
    """:class:`Crossings` at the positions of the last forces. Local.

    Args:
        contact: :class:`~mufe_fenicsx.contact.contact.Contact`.
    """
    contact.bind()
    p = contact.edges.pairs
    on = np.flatnonzero(p.closed)
    depth = p.offset[on] - p.gap[on] - p.recess[on]
    normal_force = p.stiffness[on] * np.minimum(depth, p.largest_depth[on])
    normal, friction = p.normal[on], p.shear[on]
    # As in kernels.contact.edges: friction acts at the stick points, with a couple.
    s, t = p.place[on].T
    stick_point_s, stick_point_t = p.stick_point[on].T
    lever = p.stiffness[on] * p.ratio[on] * p.gap[on]
    x = contact.ghosts.positions.array[contact.ghosts.num_before :]
    area, pushes = p.forces.areas_and_pushes(on)
    q, r, pulled = pushes[:, 0], pushes[:, 1], pushes[:, 2:]
    h0 = -lever * (stick_point_s - s) + p.gap[on] * q
    h1 = lever * (stick_point_t - t) + p.gap[on] * r
    N = normal_force
    along = np.stack([(1 - s) * N - h0, s * N + h0, (t - 1) * N - h1, h1 - t * N], axis=1)
    across = np.stack([1 - stick_point_s, stick_point_s, stick_point_t - 1, -stick_point_t], axis=1)
    at_place = np.stack([1 - s, s, t - 1, -t], axis=1)
    nodes, share = _ends(contact.edges, on)
    return Crossings(
        grain=p.grain[on],
        partner=p.partner[on],
        nodes=nodes,
        share=share,
        ends=x[nodes],
        area=area,
        depth=depth,
        normal_force=normal_force,
        normal=normal,
        friction=friction,
        force=normal_force[:, None] * normal + friction + pulled,
        forces=along[..., None] * normal[:, None]
        + across[..., None] * friction[:, None]
        + at_place[..., None] * pulled[:, None],
    )


def crossings_at_nodes(contact):
    """What own surface nodes have from crossings of all ranks. Collective.

    Each edge's force goes to its ends, by where the crossing lies between them.

    Returns:
        Normal force [N], shape (num_nodes,); friction [N], shape (num_nodes, 3); slip so far
        [m], shape (num_nodes,); and depth of the deepest [m], 0 where there is none, (num_nodes,).
    """
    c = closed_crossings(contact)
    sign = np.array([1.0, 1.0, -1.0, -1.0])
    friction = (sign * c.share)[..., None] * c.friction[:, None]
    return (
        _at_owners(contact, c.nodes, c.share * c.normal_force[:, None])[:, 0].copy(),
        _at_owners(contact, c.nodes, friction),
        contact.edges.slip + new_slip(contact),
        _at_owners(contact, c.nodes, c.depth[:, None], largest=True)[:, 0].copy(),
    )


def new_slip(contact):
    """Slip of crossings since the last search at own surface nodes [m], (num_nodes,). Collective.

    Each node takes its share of the slip of the edge that it ends.
    """
    p = contact.edges.pairs
    on = np.flatnonzero(p.slip)
    nodes, share = _ends(contact.edges, on)
    return _at_owners(contact, nodes, share * p.slip[on, None])[:, 0]


def _at_owners(contact, nodes, values, largest=False):
    """Sums, or the largest, of values at own surface nodes, (num_nodes, 3). Collective.

    Args:
        contact: As above.
        nodes: Where they are on this rank, shape (num, 4).
        values: Vectors, shape (num, 4, 3), or numbers, which become first components, (num, 4).
        largest: The largest instead of the sum.
    """
    there = np.zeros((contact.ghosts.num_nodes, 3))
    gather = np.maximum if largest else np.add
    gather.at(there if values.ndim == 3 else there[:, 0], nodes, values)
    return contact.ghosts.reverse_scatter(there, largest)


def _ends(edges, on):
    """Nodes at the ends of both edges of pairs, and the crossing's share in them, (num, 4)."""
    p, ends = edges.pairs, edges.edges.ends
    s, t = np.clip(p.place[on], 0.0, 1.0).T
    nodes = np.hstack([ends[p.first[on]], ends[p.second[on]]])
    return nodes, np.column_stack([1 - s, s, 1 - t, t])
