"""Files are data: nothing that is read from one is executed, and scenes stay where they are."""

import ast
from pathlib import Path

import pytest

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.scene import load_scene
from tests.scene.scene_files import SMALLEST

ROOT = Path(__file__).resolve().parents[2]

#: Calls that make code of text, and modules whose readers do.
CALLS = {"eval", "exec", "compile", "__import__", "execfile"}
MODULES = {"pickle", "cPickle", "dill", "cloudpickle", "joblib", "marshal", "shelve", "yaml",
           "jsonpickle", "code", "codeop", "runpy"}  # fmt: skip
ATTRIBUTES = {"system", "popen", "read_pickle", "to_pickle"}


def dangers(source):
    """Lines of a source that could execute what a file holds, with what they do."""
    found = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import | ast.ImportFrom):
            names = [alias.name for alias in node.names]
            if isinstance(node, ast.ImportFrom):
                if node.level == 0 and node.module.split(".")[0] == "numpy" and "load" in names:
                    found.append((node.lineno, "numpy.load by another name"))
                names = [node.module or ""] if node.level == 0 else []
            found += [(node.lineno, n) for n in names if n.split(".")[0] in MODULES]
        if not isinstance(node, ast.Call):
            continue
        given = {k.arg: k.value.value for k in node.keywords if isinstance(k.value, ast.Constant)}
        called = node.func
        if isinstance(called, ast.Name) and called.id in CALLS:
            found.append((node.lineno, called.id))
        elif isinstance(called, ast.Attribute):
            owner = called.value.id if isinstance(called.value, ast.Name) else ""
            if called.attr in ATTRIBUTES:
                found.append((node.lineno, called.attr))
            if owner in ("np", "numpy") and called.attr == "load":
                if given.get("allow_pickle") is not False:
                    found.append((node.lineno, "numpy.load without allow_pickle=False"))
        if given.get("shell") or given.get("allow_pickle"):
            found.append((node.lineno, "shell or allow_pickle"))
    return found


def test_nothing_that_is_read_is_executed():
    sources = [p for part in ("mufe_fenicsx", "demos") for p in (ROOT / part).rglob("*.py")]
    assert len(sources) > 100
    wrong = {str(p): d for p in sources if (d := dangers(p.read_text(encoding="utf-8")))}
    assert not wrong


@pytest.mark.parametrize(
    "line",
    ["import yaml", "from pickle import load", "np.load(p)", "np.load(p, allow_pickle=True)",
     "from numpy import load", "eval(text)", "os.system(text)", "run(text, shell=True)"],
)  # fmt: skip
def test_each_danger_is_seen(line):
    assert dangers(f"def f():\n    {line}\n")


def test_relative_paths_of_a_scene_stay_in_its_folder(tmp_path):
    scene, inside = tmp_path / "here" / "scene.toml", tmp_path / "here" / "data" / "grains"
    scene.parent.mkdir()

    def grains(path):
        scene.write_text(SMALLEST + f'[sample]\ngrains = "{path}"\n')
        return load_scene(scene).sample.grains

    assert grains("data/grains") == grains("data/../data/grains") == inside
    assert grains(tmp_path / "there") == tmp_path / "there"  # the user wrote all of it
    for path in ("../there", "data/../../there", "..", "data/../../here2"):
        with pytest.raises(InputError, match=r'sample.grains = "\S+" leaves the folder of the sce'):
            grains(path)
