"""Parameters of a stone that was pressed come back from `mufe calibrate --scene`."""

import tempfile
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
import pyvista
from scipy.interpolate import PchipInterpolator
from scipy.spatial import ConvexHull

from ..calibration.calibrate import Options, calibrate
from ..calibration.data import Size
from ..calibration.fit import Given
from ..calibration.model import Setup
from ..calibration.rounds import read_grain
from ..geometry.grains import Grains, save_grains
from ..geometry.settings import MeshSettings
from ..geometry.tets.jobs import surface_jobs
from ..geometry.tets.mesher import mesh_one
from ..results.run import Run
from ..run.run import run_scene
from ..scene import load_scene
from ..synthetic.shapes import make_grains
from ..synthetic.triangulated import icosphere
from .calibrate import COMPLIANCE, GLASS_NU, MODULUS, SLOPE, STRESS, YIELD, E
from .case import case, compare

#: Of the ball of the same volume [m]; W/L and T/W; roughness of the formula's stones.
DIAMETER, FORM, ROUGHNESS = 0.7e-3, (0.85, 0.85), 0.15
#: Edges at the platens and elsewhere over the diameter, and how they grow.
FINE, COARSE, GROWTH = 0.012, 0.2, 0.9
#: Displacement at first touch [m]; strain of the test.
OFFSET, STRAIN = 2e-6, 0.03
#: Material of the first round: modulus, yield stress, slope [Pa].
GUESS = (90e9, 2.5e9, 7.5e9)
SCENE = """
[sample]
grains = "grains"
[material]
model = "j2"
E = {E}
nu = {nu}
rho = 2650
yield_stress = [[0.0, {first}], [1.0, {last}]]
[contact]
friction = 0.3
wall_friction = 0.3
[container]
shape = "cylinder"
radius = "0.8 mm"
{solver}
[output]
fields = 2
history = 300
"""
SOLVERS = {
    "static": """
[solver]
integrator = "static"
[implicit]
step = 2.5e-4
largest = 5e-4
[oedometer]
strain = {strain}
speed = 1
ramp = 0
""",
    "explicit": """
[loading]
speed = 0.5
ramp = 0.002
[[stage]]
zero = true
z = {{ stress = "0.5 MPa" }}
r = {{ strain = -0.01 }}
[[stage]]
z = {{ strain = {strain} }}
""",
}


@case("calibrate-stone", num_bodies=1)
def calibrate_stone(
    comm, seed=2, surface="", noise=0.03, points=4000,
    integrator: Literal["static", "explicit"] = "static", known: Literal["yes", "no"] = "yes",
):  # fmt: skip
    """A stone is pressed in a run; noise, an offset and a soft machine make it a measured curve.

    From another material the rounds of `mufe calibrate --scene` have to find that of the run.

    Args:
        comm: MPI communicator.
        seed: Of the stone and of the noise.
        surface: File of a closed surface that is the stone instead.
        noise: Standard deviation of forces, over these.
        points: Of the curve.
        integrator: Of all runs.
        known: Whether the compliance of the machine is.
    """
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        save_grains(
            folder / "grains", Grains.from_list(np.array([1]), [stone(seed, surface)], DIAMETER)
        )
        for name, values in (("true", (E, YIELD, SLOPE)), ("guess", GUESS)):
            (folder / f"{name}.toml").write_text(scene_text(*values, integrator))
        scene = load_scene(folder / "true.toml")
        run_scene(scene, folder / "grains", folder / "true", comm, quiet=True)
        write_curve(folder / "curve.csv", folder / "true", Curve(noise, points, seed))
        given = Given(compliance=COMPLIANCE if known == "yes" else "common")
        grain = read_grain(folder / "guess.toml")
        options = Options(Setup(GLASS_NU), given, 2650.0, Size(*[DIAMETER] * 3), grain)
        start = time.perf_counter()
        found = calibrate([folder / "curve.csv"], options, folder / "found")
        wall = time.perf_counter() - start
        rounds = len(list((folder / "found" / "grain" / "runs").iterdir()))
    rows = {row["name"]: row["value"] or np.nan for row in found["parameters"]}  # None: not told
    name = next(name for name in rows if name.startswith("yield stress at"))
    last = YIELD + SLOPE * float(name.split()[-1])
    results = {
        "Young's modulus [Pa]": compare(rows["Young's modulus"], E, MODULUS),
        "yield stress [Pa]": compare(rows["yield stress"], YIELD, STRESS),
        f"{name} [Pa]": compare(rows[name], last, STRESS),
        "rounds": compare(rounds, 0, np.inf),
        "time [s]": compare(wall, 0, np.inf),
    }
    return results, []


def stone(seed, surface=""):
    """A stone of the formula or of a file, flat side down: points [m] and cells. Local.

    Its mesh is fine where it is near to one of the planes above and below it.
    """
    if surface:
        smooth = pyvista.read(surface).triangulate().subdivide(2, "loop")
        points = np.asarray(smooth.points, dtype=float)
        points *= DIAMETER / np.cbrt(6 / np.pi * smooth.volume)
        triangles = smooth.faces.reshape(-1, 4)[:, 1:].astype(np.int64)
    else:
        rng = np.random.default_rng(seed)
        shape = make_grains(rng, [DIAMETER], FORM[:1], FORM[1:], ROUGHNESS, 1.5, 8)
        directions, triangles = icosphere(5)
        points = shape.surface(directions)[0]
    sides = ConvexHull(points).equations[:, :3]
    height = np.ptp(points @ sides.T, axis=0)
    down = -sides[int(np.argmin(height))]
    turn = np.vstack([np.linalg.svd(down[None])[2][1:], down])
    turn[0] *= np.sign(np.linalg.det(turn))
    points = points @ turn.T
    low, high = points[:, 2].min(), points[:, 2].max()
    settings = MeshSettings(
        size=COARSE * DIAMETER, smallest_size=FINE * DIAMETER, sizing="contact", growth=GROWTH
    )
    (job,) = surface_jobs(
        [(1, points, triangles)], settings, lambda x: np.minimum(x[:, 2] - low, high - x[:, 2])
    )
    mesh = mesh_one(replace(job, attempts=job.attempts[:1]))  # a try takes ten seconds
    return mesh.points, mesh.cells


def scene_text(E, Y, H, integrator):
    """A scene that presses one grain of a material [Pa], by "static" or "explicit"."""
    solver = SOLVERS[integrator].format(strain=STRAIN)
    return SCENE.format(E=E, nu=GLASS_NU, first=Y, last=Y + H, solver=solver)


@dataclass(frozen=True)
class Curve:
    """What a machine adds to the force of a grain."""

    noise: float  #: standard deviation of forces, over these
    points: int
    seed: int = 1
    offset: float = OFFSET  #: [m]


def write_curve(path, run, curve):
    """Write the force of a run over what a soft machine with an offset measures. Local.

    Args:
        path: CSV file.
        run: Folder of the run.
        curve: :class:`Curve`.
    """
    history = Run(run).history
    height = history["height"].to_numpy()
    force = history[["force_z_min", "force_z_max"]].to_numpy()
    touch = height[np.flatnonzero(force.min(axis=1) > 0)[0]]
    way, first = np.unique(np.maximum.accumulate(touch - height), return_index=True)
    x = np.linspace(0.0, way[-1], curve.points + 1)[1:]
    # Between rows of a run a force that bends, as that of a contact does.
    F = PchipInterpolator(way, force.mean(axis=1)[first])(x)
    D = x + COMPLIANCE * F + curve.offset
    F = F * (1 + curve.noise * np.random.default_rng(curve.seed).standard_normal(curve.points))
    rows = "".join(f"{a:.9g}, {b:.9g}\n" for a, b in zip(D, F, strict=True))
    Path(path).write_text("displacement [m], force [N]\n" + rows)
