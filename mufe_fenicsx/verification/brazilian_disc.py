"""A disc that flat platens split."""

import numpy as np

from ..bulk.cracks.cracks import Cracks
from ..contact.walls import Wall
from ..geometry.bodies.contact_mesh import even_edges, tets
from ..geometry.tets.gmsh_model import gmsh_model
from ..materials.elastic import Elastic
from ..materials.fracture import Fracture
from ..run.from_bodies import build
from .case import at_least, case, compare

E, NU, RHO, DIAMETER, STRENGTH = 60e9, 0.2, 2500.0, 10e-3, 60e6
Z = np.array([0.0, 0.0, 1.0])
#: Of the second mesh about an axis across the load [rad].
TURN = 0.4
#: Steps from one look at the force to the next; passes of a wave over which it is a mean, and for
#: which a run goes on after the largest one.
EVERY, WINDOW, LATE = 20, 1.0, 4.0
#: Of the largest force over theory, and between two meshes: facets lie as they happen to. That of
#: the disc was 1.045 and, turned, 0.984 with 24 edges; 1.10 and 1.06 with 16.
PEAK, MESHES = 0.05, 0.08


@case("brazilian-disc", num_bodies=1)
def brazilian_disc(
    comm, edges=24, coarser=16, flat=5.0, zone=0.1875, speed=0.1, shear_ratio=2.0, friction=1.0,
    damping=0.2,
):  # fmt: skip
    """A disc between two platens splits through its middle where 2P/(πDt) is its strength.

    On narrow flats; on wide ones the halves go on bearing. Three meshes are pressed: one, the same
    turned, and a coarser one. The first goes on until it is split.

    Args:
        comm: MPI communicator.
        edges, coarser: Of the meshes, along a diameter; one is the disc's thickness.
        flat: Half of the angle of each flat [degrees].
        zone: E G/σ² over the diameter.
        speed: Of the platens towards each other, over c σ/E.
        shear_ratio, friction: β, μ.
        damping: Of all motion, in passes of a wave through the disc.

    Source: G. Hondros, Aust. J. Appl. Sci. 10, 1959, 243-268.
    """
    results, peaks, simulations = {}, [], []
    law = zone, speed, shear_ratio, friction, damping
    meshes = ("", edges, 0.0), (", turned", edges, TURN), (", coarser", coarser, 0.0)
    for name, num, turn in meshes:
        points, cells = flattened(2.0 / num, np.radians(flat), turn)
        found, s = press(comm, (0.5 * DIAMETER * points, cells), *law, to_end=not name)
        peaks.append(2.0 * found["peak"] / (np.pi * DIAMETER * DIAMETER / num) / STRENGTH)
        bound = PEAK if num == edges else np.inf
        results[f"largest force over that of theory{name}"] = compare(peaks[-1], 1.0, bound)
        results[f"kinetic over elastic energy then{name}"] = compare(found["kinetic"], 0.0, np.inf)
        if not name:
            results |= {
                "volume of the second piece": at_least(found["second"], 0.3),
                "way between both along the load, over it": compare(found["along"], 0.0, 0.25, 1.0),
                "growths of the mesh": compare(s.mesh.version, 0.0, np.inf),
                "least time step over the first": compare(found["step"], 1.0, np.inf),
            }
        simulations.append(s)
    results["turned over not turned"] = compare(peaks[1] / peaks[0], 1.0, MESHES)
    results["coarser over fine"] = compare(peaks[2] / peaks[0], 1.0, MESHES)
    return results, simulations


def flattened(edge, flat, turn):
    """A disc about y of radius 1 and one edge's thickness, with two flats across z.

    Args:
        edge: Length of edges.
        flat: Half of the angle of each flat [rad].
        turn: Of the body about y before it is meshed [rad].
    """
    with gmsh_model(even_edges(edge)) as gmsh:
        occ, high = gmsh.model.occ, np.cos(flat)
        body = occ.addCylinder(0, -0.5 * edge, 0, 0, edge, 0, 1)
        block = occ.addBox(-2, -2, -high, 4, 4, 2 * high)
        occ.rotate([(3, block)], 0, 0, 0, 0, 1, 0, turn)
        occ.intersect([(3, body)], [(3, block)])
        occ.synchronize()
        points, cells = tets(gmsh)
    c, s = np.cos(turn), np.sin(turn)
    return points @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]), cells


def between_platens(comm, body, diameter, law, speed, damping):
    """A body between two platens that close on it.

    Args:
        comm: MPI communicator.
        body: Points [m] and cells, the middle at 0.
        diameter: [m].
        law: :class:`~mufe_fenicsx.materials.fracture.Fracture`.
        speed: Of the platens towards each other, over c σ/E.
        damping: Of all motion, in passes of a wave through the body.

    Returns:
        The simulation, its cracks, and the time of a pass [s].
    """
    material, high = Elastic(E, NU, RHO), body[0][:, 2].max()
    c = material.wave_speed
    passes, v = diameter / c, 0.5 * speed * c * law.strength / E
    walls = [
        Wall("low", -high * Z, Z, velocity=v * Z),
        Wall("high", high * Z, -Z, velocity=-v * Z),
    ]
    s = build(
        comm, [body], material, (0, 0, 0), (0, 0, 0), axes="", walls=walls,
        damping=damping / passes, friction=law.friction,
        velocity=lambda x, _grain: -v / high * x[:, 2:] * Z,
    )  # fmt: skip
    cracks = Cracks(s.specimen, law)
    s.add_term(cracks)
    return s, cracks, passes


def press(comm, body, zone, speed, shear_ratio, friction, damping, to_end):
    """Press a body along z until its force has fallen by a tenth, or until it is split.

    Returns:
        Largest force [N], kinetic over elastic energy then, least time step over the first, part
        of the volume in the second piece and the share along z of the way between both; and the
        simulation.
    """
    law = Fracture(STRENGTH, zone * DIAMETER * STRENGTH**2 / E, shear_ratio, friction)
    s, _, passes = between_platens(comm, body, DIAMETER, law, speed, damping)
    first, steps, t, force = s.dt, [], [], []
    found, when = {"peak": 0.0}, 0.0
    while True:
        s.step(everywhere=False)
        if s.state.num_steps % EVERY:
            continue
        steps.append(s.dt)
        t.append(s.state.t)
        force.append(s.wall_forces().mean())
        mean = np.mean(np.array(force)[np.array(t) > s.state.t - WINDOW * passes])
        if mean > found["peak"]:
            e, when = s.energies(), s.state.t
            found |= {"peak": mean, "kinetic": e["kinetic"] / e["elastic"]}
        if mean > (0.5 if to_end else 0.9) * found["peak"]:
            continue
        second, along = _second_piece(s)
        if not to_end or second >= 0.3 or s.state.t > when + LATE * passes:
            return found | {"step": min(steps) / first, "second": second, "along": along}, s


def _second_piece(s):
    """Part of the volume in the second piece, and the share along z of the way to the first."""
    piece, volume = s.mesh.piece_of_cell, s.solid.volume0
    if piece is None:
        return 0.0, 1.0
    of = np.bincount(piece, volume) / volume.sum()
    x = s.mesh.x[s.mesh.cells].mean(axis=1)
    one, other = (
        np.average(x[piece == k], weights=volume[piece == k], axis=0) for k in np.argsort(-of)[:2]
    )
    return float(np.sort(of)[-2]), float(abs((one - other)[2]) / np.linalg.norm(one - other))
