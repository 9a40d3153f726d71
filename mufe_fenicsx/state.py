"""What changes with time: motion of the nodes and history of the material points."""

from dataclasses import dataclass

import numpy as np


@dataclass
class State:
    """Motion and history on one rank; the arrays are changed in place."""

    t: float  #: time [s]
    dt: float  #: length of the last step [s]
    num_steps: int  #: steps so far
    x: np.ndarray  #: positions [m], shape (num_nodes, 3)
    u: np.ndarray  #: displacements [m], shape (num_nodes, 3)
    v: np.ndarray  #: velocities [m/s], shape (num_nodes, 3)
    a: np.ndarray  #: accelerations [m/s²], shape (num_nodes, 3)
    deviator: np.ndarray  #: J times that of Cauchy stress [Pa], xx yy zz xy yz xz, (num_cells, 6)
    plastic_strain: np.ndarray  #: equivalent plastic strain, shape (num_cells,)
    plastic_work: np.ndarray  #: plastic work [J], shape (num_cells,)


def initial_state(x, num_cells, u=None, v=None):
    """At rest and without stress, at the positions ``x``, shape (num_nodes, 3).

    ``u`` and ``v`` are the arrays to use for displacement and velocity, for
    instance views of vectors that live elsewhere; otherwise new ones are made.
    """
    return State(
        t=0.0,
        dt=0.0,
        num_steps=0,
        x=x.copy(),
        u=np.zeros_like(x) if u is None else u,
        v=np.zeros_like(x) if v is None else v,
        a=np.zeros_like(x),
        deviator=np.zeros((num_cells, 6)),
        plastic_strain=np.zeros(num_cells),
        plastic_work=np.zeros(num_cells),
    )
