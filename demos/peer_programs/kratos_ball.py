"""The pressed ball in Kratos: static, linear tetrahedra, mortar contact by augmented Lagrangian.

    python kratos_ball.py SCENE.npz INCREMENTS

Needs NumPy and Kratos only (PyPI: KratosMultiphysics and its applications StructuralMechanics,
ContactStructuralMechanics, LinearSolvers, ConstitutiveLaws), and prints one line of JSON: forces
on the base [N] after each increment and time of the processor [s]. Files of the model are left
beside the scene. Lengths are in mm, stresses in MPa.
"""

import json
import sys
import time
from pathlib import Path

import KratosMultiphysics as Kratos
import KratosMultiphysics.ConstitutiveLawsApplication
import KratosMultiphysics.ContactStructuralMechanicsApplication
import KratosMultiphysics.LinearSolversApplication
import numpy as np
from KratosMultiphysics.StructuralMechanicsApplication.structural_mechanics_analysis import (
    StructuralMechanicsAnalysis,
)

MM, MPA = 1e3, 1e-6
#: Of Newton's method, of the residual, and iterations of an increment at most.
TOLERANCE, MOST = 1e-6, 60


def write_model(path, s):
    """Kratos's mesh file: nodes, elements, facets that may touch, and the parts by name."""
    first, num_ball = len(s["points"]), len(s["cells"])
    points = MM * np.vstack([s["points"], s["block_points"]])
    cells = np.vstack([s["cells"], s["block_cells"] + first])
    facets = np.vstack([s["pole"], s["plane"] + first])
    num_pole = len(s["pole"])
    lines = ["Begin Properties 0", "End Properties", "Begin Properties 1", "End Properties"]
    lines += ["Begin Nodes"]
    lines += [f"{k} {x:.14e} {y:.14e} {z:.14e}" for k, (x, y, z) in enumerate(points, 1)]
    lines += ["End Nodes"]
    for kind, name, number, rows in (
        ("Elements", "SmallDisplacementElement3D4N", 1, cells),
        ("Conditions", "SurfaceCondition3D3N", 0, facets),
    ):
        lines += [f"Begin {kind} {name}"]
        lines += [f"{k} {number} " + " ".join(map(str, row + 1)) for k, row in enumerate(rows, 1)]
        lines += [f"End {kind}"]
    block = np.arange(first, len(points))
    for name, nodes, elements, conditions in (
        ("ball", range(first), range(num_ball), ()),
        ("block", block, range(num_ball, len(cells)), ()),
        ("base", s["base"], (), ()),
        ("pole", np.unique(s["pole"]), (), range(num_pole)),
        ("plane", np.unique(s["plane"]) + first, (), range(num_pole, len(facets))),
    ):
        lines += [f"Begin SubModelPart {name}"]
        for kind, members in (("Nodes", nodes), ("Elements", elements), ("Conditions", conditions)):
            lines += [f"Begin SubModelPart{kind}", *(str(k + 1) for k in members)]
            lines += [f"End SubModelPart{kind}"]
        lines += ["End SubModelPart"]
    path.write_text("\n".join([*lines, ""]), encoding="ascii")


def material(part, s, flows):
    """Properties of the ball or the block."""
    law = {"name": "LinearElastic3DLaw"}
    values = {"DENSITY": 2.65e-9, "YOUNG_MODULUS": MPA * float(s["E"]),
              "POISSON_RATIO": float(s["nu"])}  # fmt: skip
    if flows:
        law = {"name": "SmallStrainIsotropicPlasticity3DVonMisesVonMises"}
        # The curve 3 is perfect plasticity; the fracture energy is asked for and not used.
        values |= {"YIELD_STRESS": MPA * float(s["yield_stress"]), "HARDENING_CURVE": 3,
                   "FRACTURE_ENERGY": 1e16}  # fmt: skip
    inner = {"constitutive_law": law, "Variables": values, "Tables": {}}
    return {"model_part_name": f"Structure.{part}", "properties_id": 1 + (part == "block"),
            "Material": inner}  # fmt: skip


def fixed(part, way):
    """A process that prescribes the displacement of a part."""
    return {
        "python_module": "assign_vector_variable_process",
        "kratos_module": "KratosMultiphysics",
        "Parameters": {
            "model_part_name": f"Structure.{part}",
            "variable_name": "DISPLACEMENT",
            "value": [0.0, 0.0, way],
            "interval": [0.0, "End"],
        },
    }


def parameters(scene, s, increments):
    """Kratos's parameters of the test."""
    solver = {
        "solver_type": "Static",
        "model_part_name": "Structure",
        "domain_size": 3,
        "echo_level": 0,
        "analysis_type": "non_linear",
        "model_import_settings": {
            "input_type": "mdpa", "input_filename": str(scene.with_suffix(""))},
        "material_import_settings": {"materials_filename": str(scene.with_suffix(".mat.json"))},
        "time_stepping": {"time_step": 1.0 / increments},
        "contact_settings": {"mortar_type": "ALMContactFrictionless"},
        "convergence_criterion": "contact_residual_criterion",
        "residual_relative_tolerance": TOLERANCE,
        "residual_absolute_tolerance": 1e-9,
        "max_iteration": MOST,
        "compute_reactions": True,
        "linear_solver_settings": {"solver_type": "LinearSolversApplication.sparse_lu"},
    }  # fmt: skip
    contact = {
        "python_module": "alm_contact_process",
        "kratos_module": "KratosMultiphysics.ContactStructuralMechanicsApplication",
        "Parameters": {
            "model_part_name": "Structure",
            "contact_model_part": {"0": ["pole", "plane"]},
            "assume_master_slave": {"0": ["pole"]},
            "contact_type": "Frictionless",
        },
    }
    end = 1.0 - 0.5 / increments
    way = f"-{MM * float(s['approach']):.12g}*t"
    return {
        "problem_data": {"problem_name": "ball", "parallel_type": "OpenMP", "start_time": 0.0,
                         "end_time": end, "echo_level": 0},
        "solver_settings": solver,
        "processes": {"constraints_process_list": [fixed("base", 0.0), fixed("block", way)],
                      "contact_process_list": [contact]},
    }  # fmt: skip


class Test(StructuralMechanicsAnalysis):
    """Keeps the force on the base after each increment [N]."""

    def Initialize(self):
        self.forces = []
        super().Initialize()

    def FinalizeSolutionStep(self):
        super().FinalizeSolutionStep()
        nodes = self.model["Structure.base"].Nodes
        self.forces.append(abs(sum(n.GetSolutionStepValue(Kratos.REACTION_Z) for n in nodes)))


def main():
    scene, increments = Path(sys.argv[1]), int(sys.argv[2])
    with np.load(scene, allow_pickle=False) as file:
        s = {name: file[name] for name in file.files}
    write_model(scene.with_suffix(".mdpa"), s)
    flows = bool(np.isfinite(s["yield_stress"]))
    materials = [material("ball", s, flows), material("block", s, False)]
    scene.with_suffix(".mat.json").write_text(json.dumps({"properties": materials}))
    Kratos.Logger.GetDefaultOutput().SetSeverity(Kratos.Logger.Severity.WARNING)
    test = Test(Kratos.Model(), Kratos.Parameters(json.dumps(parameters(scene, s, increments))))
    begin = time.process_time()
    test.Run()
    print(json.dumps({"forces": test.forces, "seconds": time.process_time() - begin}))


if __name__ == "__main__":
    main()
