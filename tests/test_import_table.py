"""The house: folders stand on levels, and import only from lower ones; what is private stays."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[1] / "mufe_fenicsx"

#: Folders and files of the root, from the ground up. Each imports from levels below its own only.
LEVELS = (
    {"errors"},
    {"arguments"},
    {"machine", "state", "units", "theory", "container"},
    {"kernels"},
    {"mesh", "output", "solvers", "materials"},
    {"geometry", "contact"},
    {"bulk", "loading", "analysis", "scene"},
    {"specimen", "results"},
    {"explicit", "implicit", "report"},
    {"run", "synthetic"},
    {"planning", "peers"},
    {"calibration"},
    {"verification"},
    {"cli"},
)
LEVEL = {name: level for level, names in enumerate(LEVELS) for name in names}
#: `__init__` names the rest in its dict `MODULE_OF`; `python -m mufe_fenicsx` is the command.
FROM_THE_DOOR = {"__init__": {"machine"}, "__main__": {"cli"}}

#: Geometry prepares grains without the solver's libraries.
SOLVER_LIBRARIES = {"dolfinx", "dolfinx_solver", "mpi4py", "petsc4py", "ufl", "basix"}
#: Names of other libraries that begin with an underscore.
FOREIGN = {"_cpp_object", "_current_frames"}


def sources():
    return sorted(PACKAGE.rglob("*.py"))


def room(path):
    """Folder or file of the root that a source file belongs to."""
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def own_imports(path):
    """Rooms of the root that a source file imports, anywhere in it, with their lines."""
    folder = path.relative_to(PACKAGE).parent.parts
    found = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            start = node.module or ""
            if node.level:
                start = ".".join((PACKAGE.name, *folder[: len(folder) + 1 - node.level], start))
            # `from package import x` may name a module.
            names = [f"{start.rstrip('.')}.{alias.name}" for alias in node.names]
        else:
            continue
        inside = [name.split(".") for name in names if name.startswith(PACKAGE.name + ".")]
        found += {(words[1], node.lineno) for words in inside}
    return found


def test_each_room_of_the_root_has_a_level():
    rooms = {room(path) for path in sources()} - set(FROM_THE_DOOR)
    assert rooms == set(LEVEL)
    assert len([name for name in rooms if (PACKAGE / name).is_dir()]) <= 23
    assert len(list(PACKAGE.glob("*.py"))) <= 9


def test_imports_point_down():
    wrong = []
    for path in sources():
        here = room(path)
        for other, line in own_imports(path):
            if other == "__version__":
                continue
            if here in FROM_THE_DOOR:
                allowed = other in FROM_THE_DOOR[here]
            else:
                allowed = other == here or LEVEL[other] < LEVEL[here]
            if not allowed:
                wrong.append(f"{path.relative_to(PACKAGE)}:{line} imports {other}")
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("source", ["from ..bulk.solid import Solid", "import mufe_fenicsx.bulk"])
def test_a_forbidden_import_is_found(tmp_path, monkeypatch, source):
    """The reader of imports sees both forms, also inside a function."""
    package = tmp_path / "mufe_fenicsx"
    (package / "kernels").mkdir(parents=True)
    path = package / "kernels" / "fast.py"
    path.write_text(f"def f():\n    {source}\n")
    monkeypatch.setattr(sys.modules[__name__], "PACKAGE", package)
    assert own_imports(path) == [("bulk", 2)]


def private_uses(source):
    """Lines of a source that name private things of other modules."""
    tree = ast.parse(source)
    own, used = set(), []
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            own.add(node.name)
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            own.add(node.id)
        elif isinstance(node, ast.Attribute):
            if isinstance(node.ctx, ast.Store) and _is_self(node.value):
                own.add(node.attr)
            elif not _is_self(node.value):
                used.append((node.lineno, node.attr))
        elif isinstance(node, ast.ImportFrom):
            used += [(node.lineno, alias.name) for alias in node.names]
    return [
        f"{line}: {name}"
        for line, name in used
        if name.startswith("_") and not name.startswith("__") and name not in own | FOREIGN
    ]


def _is_self(node):
    return isinstance(node, ast.Name) and node.id in ("self", "cls")


def test_private_names_stay_in_their_modules():
    wrong = [
        f"{path.relative_to(PACKAGE)}:{use}"
        for path in sources()
        for use in private_uses(path.read_text(encoding="utf-8"))
    ]
    assert not wrong, "\n".join(wrong)


def test_a_private_name_of_another_module_is_found():
    assert private_uses("def f(x):\n    return x._hidden") == ["2: _hidden"]
    assert private_uses("from ..bulk import _hidden") == ["1: _hidden"]


def test_geometry_needs_no_solver_library():
    for path in (PACKAGE / "geometry").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom) and not node.level:
                names = [node.module]
            assert not SOLVER_LIBRARIES & {name.split(".")[0] for name in names}, path


def test_the_command_line_loads_nothing_heavy():
    """`mufe --help` answers at once: no library of more than some milliseconds is loaded."""
    heavy = "numpy scipy numba dolfinx gmsh skimage pyvista matplotlib pint h5py rich".split()
    said, loaded = said_and_loaded(["--help"], heavy)
    assert "oedometer" in said.lower() or "mufe" in said
    assert loaded == []


def test_a_scene_is_read_without_the_libraries_of_a_run():
    """But numpy, and pint where a scene has units."""
    heavy = "scipy.sparse numba dolfinx petsc4py gmsh skimage pyvista matplotlib h5py rich".split()
    said, loaded = said_and_loaded(["scene", str(PACKAGE.parent / "demos" / "first.toml")], heavy)
    assert "seating_stress = 1" in said
    assert loaded == []


def said_and_loaded(arguments, names):
    """Standard output of a `mufe` of its own, and which of the libraries it has loaded."""
    code = (
        "import atexit, sys; from mufe_fenicsx.cli.main import main; "
        f"atexit.register(lambda: print([m for m in {names} if m in sys.modules])); "
        f"main({arguments})"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    *said, loaded = found.stdout.splitlines()
    return "\n".join(said), ast.literal_eval(loaded)


@pytest.mark.parametrize("name", ["run.run", "verification.cases", "verification.finite_body"])
def test_hdf5_keeps_its_compression(name):
    """DOLFINx' wheel brings an HDF5 without any, which h5py must not take for its own."""
    code = f"import mufe_fenicsx.{name}, h5py; print('gzip' in h5py.filters.encode)"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "True"


def test_a_run_loads_nothing_for_images_and_pictures():
    """Each rank of `mufe run` would pay for it in memory."""
    heavy = "skimage SimpleITK pyvista matplotlib tifffile scipy.optimize scipy.stats".split()
    code = f"import sys, mufe_fenicsx.run.run; print([m for m in {heavy} if m in sys.modules])"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"
