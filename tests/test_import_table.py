"""Imports between the parts of the package point one way."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[1] / "mufe_fenicsx"

#: Modules that are one part of the design under more than one name.
PART_OF = {
    "body_mass": "rigid",
    "loading": "simulation",
    "staged_loading": "simulation",
    "servo": "simulation",
    "energy_guard": "simulation",
    "refresh": "simulation",
    "restart": "simulation",
    "interruption": "run",
    "origin": "run",
    "preparation": "run",
    "recorder": "run",
    "march": "run",
    "progress": "run",
    "recovery": "run",
    "profile": "run",
    "balance": "run",
    "speed_control": "simulation",
    "implicit": "simulation",
    "increment_end": "simulation",
    "increment_start": "simulation",
    "increment_equations": "simulation",
    "held_nodes": "simulation",
    "near_tangent": "tangent",
    "near_system": "linear_system",
    "coarse_space": "linear_system",
}

#: What each part may import, besides itself and `errors`, which any may.
TABLE = {
    "errors": set(),
    "kernels": set(),
    "theory": set(),
    # memory: what there is of it, before a file fills it.
    "geometry": {"kernels", "memory", "topology"},
    "state": set(),
    "bounds": set(),
    "caches": set(),
    "units": {"bounds"},
    "petsc_options": {"bounds"},
    "topology": set(),
    "mesh": {"topology"},
    "time_step": {"kernels"},
    "stable_step": {"mesh", "solid", "rigid", "contact", "time_step", "shared_mass"},
    "shared_mass": {"mesh", "solid", "contact", "time_step"},
    "mass_scaling": {"mesh", "solid", "kernels"},
    "launcher": set(),
    "memory": set(),
    "materials": {"kernels"},
    "forms": set(),
    "solid": {"mesh", "materials", "kernels", "forms"},
    "rigid": {"mesh", "materials", "kernels"},
    "fidelity": {"materials", "rigid"},
    "contact": {"mesh", "kernels", "forms"},
    "integrators": {"state"},
    "tangent": {"solid", "kernels", "forms"},
    "linear_system": {"mesh", "tangent", "kernels", "petsc_options"},
    # geometry: its settings, of which the scene is the written form.
    "scene": {"materials", "contact", "bounds", "units", "geometry", "petsc_options"},
    # units: its settings; geometry: files and labels; materials: that of its scene; report:
    # pictures without a screen.
    "synthetic": {"kernels", "geometry", "bounds", "units", "materials", "report"},
    "simulation": {
        *("kernels", "geometry", "state", "mesh", "materials", "solid", "rigid", "contact"),
        *("fidelity", "integrators", "scene", "stable_step", "mass_scaling", "tangent"),
        "linear_system",
    },
    # geometry: measures of tetrahedra, which are numbers from arrays.
    "analysis": {"mesh", "state", "solid", "contact", "geometry"},
    "output": {"mesh", "state", "solid", "contact", "bounds"},
    # A scene from grains on disk to a run folder.
    "run": {
        *("kernels", "geometry", "state", "mesh", "materials", "solid", "rigid", "contact"),
        *("integrators", "scene", "time_step", "simulation", "output", "launcher", "memory"),
        "mass_scaling",
    },
    # Files for other programs; a test becomes a deck with what a run makes of it.
    "peers": {
        *("kernels", "geometry", "mesh", "materials", "contact", "scene", "units", "run"),
    },
    # Measured points: a stored table.
    "evidence": set(),
    # A scene and what it needs; it steps the scene for a second.
    "planning": {
        *("evidence", "scene", "materials", "geometry", "contact", "mesh", "simulation", "run"),
        *("memory", "output", "kernels"),
    },
    # What a user reads of a run folder.
    "results": {"analysis", "output", "geometry", "bounds"},
    # results: the tables of a run, which its page and ParaView show too.
    "report": {"analysis", "output", "geometry", "results", "bounds", "memory"},
    "watch": {"analysis", "output"},
}

#: The program around the parts, and the cases of verification: they import anything.
ANYTHING = {
    "cli",
    "cli_app",
    "cli_grains",
    "cli_scene",
    "new_scene",
    "cli_peers",
    "cli_paraview",
    "cli_watch",
    "cli_chart",
    "cli_plan",
    "charts",
    "arguments",
    "terminal",
    "summary_words",
    "exit_status",
    "demo",
    "__main__",
    "verification",
}

#: Geometry prepares grains without the solver's libraries.
SOLVER_LIBRARIES = {"dolfinx", "dolfinx_solver", "mpi4py", "petsc4py", "ufl", "basix"}


def part(module):
    """Part of the design that a dotted name inside the package belongs to."""
    first = module.split(".")[0]
    return PART_OF.get(first, first)


def own_imports(path):
    """Parts of the package that a source file imports, anywhere in it, with their lines."""
    folder = path.relative_to(PACKAGE).parent.parts
    found = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            start = node.module or ""
            if node.level:
                start = ".".join((PACKAGE.name, *folder[: len(folder) + 1 - node.level], start))
            start = start.rstrip(".")
            # `from package import x` may name a module; `from package.x import y` has it already.
            only_package = start == PACKAGE.name
            names = [f"{start}.{alias.name}" for alias in node.names] if only_package else [start]
        else:
            continue
        for name in names:
            if name.startswith(PACKAGE.name + "."):
                found.append((part(name.removeprefix(PACKAGE.name + ".")), node.lineno))
    return found


def sources():
    return sorted(path for path in PACKAGE.rglob("*.py") if path != PACKAGE / "__init__.py")


def part_of_file(path):
    return part(".".join(path.relative_to(PACKAGE).with_suffix("").parts))


def test_every_part_has_a_place_in_the_table():
    assert {part_of_file(path) for path in sources()} <= set(TABLE) | ANYTHING


def test_imports_follow_the_table():
    wrong = [
        f"{path.relative_to(PACKAGE)}:{line} imports {imported}"
        for path in sources()
        if (importer := part_of_file(path)) in TABLE
        for imported, line in own_imports(path)
        if imported not in TABLE[importer] | {importer, "errors"}
        and not imported.startswith("__version__")
    ]
    assert not wrong, "\n".join(wrong)


def test_the_table_has_no_circle():
    order = []
    while len(order) < len(TABLE):
        free = [p for p in TABLE if p not in order and TABLE[p] <= set(order)]
        assert free, f"circle among {set(TABLE) - set(order)}"
        order += free


@pytest.mark.parametrize("source", ["from ..solid import Solid", "import mufe_fenicsx.solid"])
def test_a_forbidden_import_is_found(tmp_path, monkeypatch, source):
    """The reader of imports sees both forms, also inside a function."""
    package = tmp_path / "mufe_fenicsx"
    (package / "kernels").mkdir(parents=True)
    path = package / "kernels" / "fast.py"
    path.write_text(f"def f():\n    {source}\n")
    monkeypatch.setattr(sys.modules[__name__], "PACKAGE", package)
    assert own_imports(path) == [("solid", 2)]


def test_geometry_needs_no_solver_library():
    for path in (PACKAGE / "geometry").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom) and not node.level:
                names = [node.module]
            assert not SOLVER_LIBRARIES & {name.split(".")[0] for name in names}, path


def test_the_command_line_loads_nothing_heavy():
    """`mufe --help` answers at once: no library of more than some milliseconds is loaded."""
    heavy = "numpy scipy numba dolfinx gmsh skimage pyvista matplotlib pint h5py".split()
    code = f"import sys, mufe_fenicsx.cli; print([m for m in {heavy} if m in sys.modules])"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"


@pytest.mark.parametrize("name", ["run", "verification.cases", "verification.finite_body"])
def test_hdf5_keeps_its_compression(name):
    """DOLFINx' wheel brings an HDF5 without any, which h5py must not take for its own."""
    code = f"import mufe_fenicsx.{name}, h5py; print('gzip' in h5py.filters.encode)"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "True"


def test_a_run_loads_nothing_for_images_and_pictures():
    """Each rank of `mufe run` would pay for it in memory."""
    heavy = "skimage SimpleITK pyvista matplotlib tifffile scipy.optimize scipy.stats".split()
    code = f"import sys, mufe_fenicsx.run; print([m for m in {heavy} if m in sys.modules])"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"
