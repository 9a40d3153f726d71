"""An elastic block between six smooth walls, pressed from above."""

import math

import numpy as np

from ..contact.laws import COMPLIANCE
from ..geometry.bodies.shapes import box
from ..materials.elastic import Elastic
from ..run.from_bodies import build, drive, settle, sum_over_nodes
from ..theory.elasticity import lateral_stress_ratio, oedometric_modulus
from .case import case, compare

E, RHO, SIZE = 100e9, 2650.0, 1e-3


@case("column", num_bodies=1)
def column(comm, nu=0.15, other_nu=0.3, strain=1e-6, divisions=4):
    """Elastic oedometer: sigma/epsilon = E(1-nu)/((1+nu)(1-2nu)).

    The contact layer lets the block move a little into the walls, unevenly at its
    edges. So strains are means over the block, from its surface, and both moduli
    of the confined block follow from its mean stresses and strains:

        σz = M εz + λ (εx + εy),  σx + σy = 2 λ εz + (M + λ)(εx + εy)

    exactly, however uneven the stress is.

    Args:
        comm: MPI communicator.
        nu, other_nu: Poisson's ratios of the first and of the second block.
        strain: Axial strain, walls to walls.
        divisions: Bricks along an edge.
    """
    results, simulations = {}, []
    for ratio in (nu, other_nu):
        lines, simulation = _press(comm, ratio, strain, divisions)
        results |= {f"{name} (nu = {ratio:g})": line for name, line in lines.items()}
        simulations.append(simulation)
    return results, simulations


def _press(comm, nu, strain, divisions):
    material = Elastic(E, nu, RHO)
    bodies = [box((SIZE,) * 3, (divisions,) * 3)]
    lowest = math.pi * material.wave_speed / SIZE
    s = build(comm, bodies, material, np.zeros(3), np.full(3, SIZE), damping=lowest)
    drive(s, {"z_max": (0, 0, -strain * SIZE)}, 8 * SIZE / material.wave_speed)
    settle(s, 1e-18)

    force = s.wall_forces()
    mean_strain = np.log1p(_mean_strain(s))
    lengths = SIZE * np.exp(mean_strain)
    area = np.prod(lengths) / lengths
    stress = -0.5 * (force[0::2] + force[1::2]) / area
    # The deviator that goes with the strain is that of Kirchhoff stress.
    stress = stress.mean() + math.exp(mean_strain.sum()) * (stress - stress.mean())
    # Two equations for the two moduli.
    across = mean_strain[0] + mean_strain[1]
    matrix = [
        [mean_strain[2], across],
        [across, 2 * mean_strain[2] + across],
    ]
    M, lame = np.linalg.solve(matrix, [stress[2], stress[0] + stress[1]])

    theory = oedometric_modulus(E, nu)
    # Logarithmic strain, current area and Kirchhoff's deviator make a homogeneous state exact.
    # Remain the strain times its unevenness near the block's edges (some percent), and
    # round-off eps/strain.
    small = 0.1 * strain + 10 * np.finfo(float).eps / strain
    # The layer takes c h/E* per unit pressure on top and bottom; h is at most a brick's edge.
    layer = 2 * COMPLIANCE * oedometric_modulus(E, nu) * (1 - nu**2) / E / divisions
    lines = {
        "modulus": compare(M, theory, small),
        "lateral stress ratio": compare(lame / M, lateral_stress_ratio(nu), small),
        "modulus between walls": compare(stress[2] / -strain, theory, 1.5 * layer),
        # Forces decay as the root of the energies, so to 1e-9; positions are rounded to
        # eps/strain of the displacements, which a node of the mesh feels some ten times.
        "top against bottom force": compare(
            force[5], force[4], 1e-9 + 50 * np.finfo(float).eps / strain
        ),
    }
    return lines, s


def _mean_strain(s):
    """Mean displacement gradients xx, yy, zz from the surface: 1/V ∮ u n dA."""
    corners, u = s.mesh.x[s.mesh.facets], s.state.u[s.mesh.facets].mean(axis=1)
    normal_area = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return sum_over_nodes(s, u * normal_area) / SIZE**3
