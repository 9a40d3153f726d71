"""The pressed ball in Akantu: static, linear tetrahedra, linear penalty at nodes.

    python akantu_ball.py SCENE.npz INCREMENTS

Needs NumPy and Akantu only (PyPI: akantu), and prints one line of JSON: forces on the base [N]
after each increment and time of the processor [s]. Files of the mesh and of the materials are
left beside the scene. Lengths are in edges of the contact: Akantu's tolerances are absolute.
"""

import json
import sys
import time
from pathlib import Path

import akantu
import numpy as np

#: Stiffness of the penalty over E/h, as in the deck of CalculiX.
PENALTY = 50.0
#: Of Newton's method: change of the solution, over the first one.
TOLERANCE, MOST = 1e-6, 100
#: Solutions of one increment: the first one finds contacts alone.
SOLUTIONS = 6

MATERIALS = """
material {law} [
  name = ball
  rho = 2650
  E = {E}
  nu = {nu}{flow}
]
material elastic [
  name = block
  rho = 2650
  E = {E}
  nu = {nu}
]
contact_detector [
  type = explicit
  master = plane
  slave = pole
  projection_tolerance = 1e-10
  max_iterations = 100
  extension_tolerance = 1e-5
]
contact_resolution penalty_linear [
  name = touch
  mu = 0.0
  epsilon_n = {penalty}
  epsilon_t = 0.0
  is_master_deformable = false
]
"""


def write_mesh(path, points, groups):
    """Gmsh's format 2.2: ``groups`` are (name, dimension, gmsh's type of element, nodes)."""
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$PhysicalNames", str(len(groups))]
    lines += [f'{dim} {tag} "{name}"' for tag, (name, dim, _, _) in enumerate(groups, 1)]
    lines += ["$EndPhysicalNames", "$Nodes", str(len(points))]
    lines += [f"{k} {x:.12e} {y:.12e} {z:.12e}" for k, (x, y, z) in enumerate(points, 1)]
    elements = [
        f"{kind} 2 {tag} {tag} " + " ".join(map(str, nodes + 1))
        for tag, (_, _, kind, own) in enumerate(groups, 1)
        for nodes in own
    ]
    lines += ["$EndNodes", "$Elements", str(len(elements))]
    lines += [f"{k} {element}" for k, element in enumerate(elements, 1)]
    path.write_text("\n".join([*lines, "$EndElements", ""]), encoding="ascii")


def main():
    scene, increments = Path(sys.argv[1]), int(sys.argv[2])
    with np.load(scene, allow_pickle=False) as file:
        s = {name: file[name] for name in file.files}
    h, first = float(s["h"]), len(s["points"])
    points = np.vstack([s["points"], s["block_points"]]) / h
    mesh_file, material_file = scene.with_suffix(".msh"), scene.with_suffix(".dat")
    write_mesh(mesh_file, points, [
        ("ball", 3, 4, s["cells"]), ("block", 3, 4, s["block_cells"] + first),
        ("pole", 2, 2, s["pole"]), ("plane", 2, 2, s["plane"] + first),
    ])  # fmt: skip
    law, flow = "elastic", ""
    if np.isfinite(s["yield_stress"]):
        law = "plastic_linear_isotropic_hardening"
        flow = f"\n  sigma_y = {float(s['yield_stress'])}\n  h = 0.0"
    E = float(s["E"])
    material_file.write_text(
        MATERIALS.format(law=law, flow=flow, E=E, nu=float(s["nu"]), penalty=PENALTY * E),
        encoding="ascii",
    )
    akantu.parseInput(str(material_file))
    mesh = akantu.Mesh(3)
    mesh.read(str(mesh_file))
    coupler = akantu.CouplerSolidContact(mesh)
    solid = coupler.getSolidMechanicsModel()
    solid.setMaterialSelector(akantu.MeshDataMaterialSelectorString("physical_names", solid))
    coupler.initFull(_analysis_method=akantu._static)
    detector = coupler.getContactMechanicsModel().getContactDetector()
    detector.setSurfaceSelector(akantu.PhysicalSurfaceSelector(mesh))
    displacement, blocked = solid.getDisplacement(), solid.getBlockedDOFs()
    blocked[s["base"]] = True
    blocked[first:] = True
    solver = coupler.getNonLinearSolver()
    solver.set("max_iterations", MOST)
    solver.set("threshold", TOLERANCE)
    solver.set("convergence_type", akantu.SolveConvergenceCriteria.solution)
    forces, begin = [], time.process_time()
    for k in range(1, increments + 1):
        displacement[first:, 2] = -float(s["approach"]) / h * k / increments
        force = []
        while len(force) < 2 or (
            abs(force[-1] - force[-2]) > TOLERANCE * force[-1] and len(force) < SOLUTIONS
        ):
            coupler.solveStep()
            force.append(abs(float(solid.getInternalForce()[s["base"], 2].sum())) * h**2)
        forces.append(force[-1])
    print(json.dumps({"forces": forces, "seconds": time.process_time() - begin}))


if __name__ == "__main__":
    main()
