"""Micro finite-element model of sand on FEniCSx.

A µCT scan becomes labelled grains, each grain a tetrahedral mesh, all grains
one DOLFINx mesh partitioned by grain; the grains deform as elasto-plastic
bodies in hard, frictional contact.

The public names are those of ``MODULE_OF``; docs/reference/python.md has a line on each.
"""

import importlib
import importlib.util
import os

from .machine.caches import use_writable_caches

# Work is shared among MPI ranks. BLAS threads that wait for more work take the cores
# from them: two ranks on two cores then ran at a fifth of their speed.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

use_writable_caches()

# The binary wheel of DOLFINx has to load its MPI before dolfinx, petsc4py or
# mpi4py are imported. Debian, conda-forge and Spack do without this module.
if importlib.util.find_spec("dolfinx_solver") is not None:
    import dolfinx_solver  # noqa: F401

__version__ = "0.2.0"

#: Public names and the modules that they come from, which are loaded at the first use of one.
#: `__init__.pyi` says the same to type checkers.
MODULE_OF = {
    "Auto": "materials.auto",
    "Elastic": "materials.elastic",
    "GrainMesh": "mesh",
    "Grains": "geometry.grains",
    "ImplicitSimulation": "implicit.simulation",
    "InputError": "errors",
    "J2": "materials.j2",
    "Membrane": "loading.membrane",
    "NeoHookean": "materials.neo_hookean",
    "Pressure": "loading.pressure",
    "Rigid": "materials.rigid",
    "Run": "run.opened",
    "Scene": "scene.scene",
    "Simulation": "explicit.simulation",
    "SolverError": "errors",
    "Tool": "bulk.tools",
    "ToolPath": "bulk.tools",
    "Wall": "contact.walls",
    "box": "geometry.bodies.shapes",
    "build": "run.from_bodies",
    "cylinder": "geometry.bodies.shapes",
    "drive": "run.from_bodies",
    "half_ball": "geometry.bodies.half_ball",
    "load_grains": "geometry.grains",
    "load_scene": "scene.reading",
    "open_run": "run.opened",
    "register_material": "scene.catalogue",
    "run_scene": "run.run",
    "save_grains": "geometry.grains",
    "scene_to_toml": "scene.writing",
    "settle": "run.from_bodies",
    "sleeve": "geometry.bodies.sleeve",
    "sphere": "geometry.bodies.shapes",
}
__all__ = ["__version__", *MODULE_OF]


def __getattr__(name):
    if name not in MODULE_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(f".{MODULE_OF[name]}", __name__), name)
    globals()[name] = value  # found at once from now on
    return value


def __dir__():
    return sorted({*globals(), *__all__})
