"""The stress of a sample that is the same body on every mesh.

Grains and box start drawn apart. All move towards the middle as the box shrinks, so that grains
meet as they were packed, with next to no rearrangement, and on until they confine each other. Then
the sides stand, and top and bottom approach each other. Walls are led by displacements, so all
meshes go through the same strains, and a strain belongs to one place of the walls.
"""

import math
import time
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..bulk.solid import ELEMENTS
from ..errors import InputError
from ..explicit.simulation import Simulation
from ..run.from_bodies import build
from .case import case, compare
from .charts.answers import LAWS, Law, TimeStep, lines_of, options_of, work_of
from .fidelity import FIDELITIES
from .known_sample import DIAMETER, State, known_sample

#: Strain by which grains are drawn apart: more than nodes of coarse meshes stand out.
APART = 0.04
#: Strain of the box, along each edge, beyond that as packed from which on it is pressed.
CONFINED = 0.01
#: At which top and bottom approach each other [m/s].
SPEED = 2.5
#: Of grains in the test; walls are smooth.
FRICTION = 0.23
#: Where stresses are told, and half of the range of strain that they are the mean of.
STRAINS, AROUND = (0.01, 0.05), 1e-3
#: Stresses there [Pa] of twenty interlocked grains at the speed of the case, to which meshes go
#: from above and below (`demos/known_sample.py`), by the seed of the sample and the fidelity.
LIMITS = {
    (1, "j2"): (5.06e6, 14.5e6),
    (1, "elastic"): (100e6, 411e6),
    # By the two finest meshes from above alone, which makes errors rather larger.
    (2, "j2"): (4.29e6, 11.63e6),
    (3, "j2"): (4.88e6, 13.70e6),
}


@dataclass(frozen=True)
class Course:
    """One test from the confined box on; arrays of shape (num_steps,)."""

    strain: np.ndarray  #: shortening of the height over that of the confined box
    stress: np.ndarray  #: mean of top and bottom [Pa]
    processor_s: float  #: time of the processor for all steps
    simulation: Simulation

    def stress_at(self, strain):
        """Mean within `AROUND` of a strain [Pa]: steps see waves go to and fro."""
        return float(self.stress[np.abs(self.strain - strain) <= AROUND].mean())


def press(comm, sample, bodies, material, strain, speed, **options):
    """Close the box until grains confine each other, then press it along z. Collective.

    Args:
        comm: MPI communicator of at most as many ranks as bodies.
        sample: `known_sample.KnownSample`.
        bodies: Of it, drawn apart by `APART`.
        material: Of all grains.
        strain: Vertical strain of the confined box.
        speed: At which top and bottom approach each other [m/s].
        options: Of :class:`~mufe_fenicsx.explicit.simulation.Simulation`.

    Returns:
        :class:`Course`.
    """
    edges, confined = sample.edges, (1 - CONFINED) * sample.edges
    middle, rate = 0.5 * edges, speed / edges[2]
    inwards = rate * (middle - sample.places(APART))
    s = build(
        comm, bodies, material, middle - 0.5 * (1 + APART) * edges,
        middle + 0.5 * (1 + APART) * edges, friction=FRICTION,
        velocity=lambda x, grain: inwards[grain - 1], **options,
    )  # fmt: skip
    number = {name: s.walls.names.index(name) for name in s.walls.names}
    for axis, edge in enumerate(edges):
        for end, sign in (("min", 0.5), ("max", -0.5)):
            s.walls.velocity[number["xyz"[axis] + "_" + end], axis] = sign * rate * edge
    bottom, top = number["z_min"], number["z_max"]
    sides = [number[name] for name in ("x_min", "x_max", "y_min", "y_max")]
    rows, now, began = [], -math.inf, time.process_time()
    while now < strain:
        s.step()
        now = 1 - (s.walls.point[top, 2] - s.walls.point[bottom, 2]) / confined[2]
        if now >= 0:
            s.walls.velocity[sides] = 0.0
            forces = s.wall_forces()
            rows.append((now, 0.5 * (forces[top] + forces[bottom]) / (confined[0] * confined[1])))
    s.check()
    return Course(*np.array(rows).T, time.process_time() - began, s)


@case("known-sample", num_bodies=20)
def known_stress(
    comm,
    grains=20,
    state: State = "interlocked",
    sample=1,
    elements_per_diameter=5.0,
    nodes: Literal["bulged", "surface"] = "bulged",
    mesh=1,
    element: Literal[*ELEMENTS] = "averaged",
    law: Law = "matched",
    fidelity: Literal["elastic", "j2"] = "j2",
    time_step: TimeStep = "assembled",
    speed=SPEED,
):
    """Grains of known shape, the same body on every mesh, compressed: stress at two strains.

    Theory is the limit of fine meshes, of the sample of which `demos/known_sample.py` found it.

    Args:
        comm: MPI communicator.
        grains, state, sample: Which of the stored samples: its number of grains, whether there
            is room to rearrange, and its seed.
        elements_per_diameter: Mean diameter of grains over the length of edges.
        nodes: Whether nodes of surfaces stand out so that facets enclose the volume of the grain,
            or lie on its surface.
        mesh: Seed of the meshes.
        element, law, fidelity, time_step: The choices of the charts.
        speed: At which top and bottom approach each other [m/s].
    """
    known = known_sample(grains, state, sample)
    size = DIAMETER / elements_per_diameter
    bodies = known.bodies(size, APART, bulge=nodes == "bulged", mesh=mesh)
    course = press(
        comm, known, bodies, FIDELITIES[fidelity], STRAINS[-1] + AROUND, speed, element=element,
        assembled=time_step == "assembled", **LAWS[law],
    )  # fmt: skip
    s = course.simulation
    energies = s.energies()
    start = comm.allreduce(s.contact.overlaps.num_accepted)
    limits = (math.nan,) * len(STRAINS)
    if (grains, state) == (20, "interlocked"):
        limits = LIMITS.get((sample, fidelity), limits)
    results = {
        f"stress at a strain of {strain:g} [Pa]": compare(course.stress_at(strain), limit, math.inf)
        for strain, limit in zip(STRAINS, limits, strict=True)
    }
    return results | {
        # Apart, no mesh of the body touches another: all start from the same state.
        "pairs that overlap at the start": compare(start, 0.0, 0.0),
        # The budget of a run, 1 %.
        "energy residual over work": compare(
            abs(energies["residual"]) / energies["work"], 0.0, 0.01, scale=1.0
        ),
        "time of the processor [s]": compare(course.processor_s, 0.0, math.inf, scale=1.0),
    }, [s]


@case("sample-point", num_bodies=20)
def sample_point(
    comm,
    elements_per_diameter=10.0,
    element: Literal[*ELEMENTS] = "averaged",
    law: Law = "matched",
    fidelity: Literal["elastic", "j2"] = "j2",
    time_step: TimeStep = "assembled",
    added_mass=0.0,
    loading=1.0,
    sample=1,
    mesh=1,
    inner_size=1.0,
    accuracy=0.05,
):
    """Twenty interlocked grains of known shape: mean error of the stress at two strains, and cost.

    The error is that of `known-sample` against the stress that meshes go to.

    Args:
        comm: MPI communicator of one rank.
        elements_per_diameter: Mean diameter of grains over the length of edges.
        element, law, fidelity, time_step: The choices.
        added_mass: Most mass that is added for a longer time step, over that of all grains.
        loading: Duration over that at the speed of `known-sample`.
        sample: Seed of the sample.
        mesh: Seed of the meshes.
        inner_size: Length of edges far inside grains over that on their surfaces.
        accuracy: Error that is wanted.

    Raises:
        InputError: The stress of that sample is not known.
    """
    if (sample, fidelity) not in LIMITS:
        known = sorted(seed for seed, of in LIMITS if of == fidelity)
        raise InputError(f"sample = {sample}, expected a known one, of {fidelity} grains {known}")
    known = known_sample(seed=sample)
    size = DIAMETER / elements_per_diameter
    bodies = known.bodies(size, APART, mesh=mesh, inner=inner_size)
    course = press(
        comm, known, bodies, FIDELITIES[fidelity], STRAINS[-1] + AROUND, SPEED / loading,
        element=element, **options_of(law, time_step, added_mass),
    )  # fmt: skip
    errors = [
        abs(course.stress_at(strain) / limit - 1)
        for strain, limit in zip(STRAINS, LIMITS[sample, fidelity], strict=True)
    ]
    work = work_of(course.simulation)
    return lines_of(float(np.mean(errors)), accuracy, course.processor_s, work), [course.simulation]
