"""The public names of the package: each loads at its first use, and the docs list it."""

import ast
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import mufe_fenicsx

ROOT = Path(__file__).resolve().parents[1]
NAMES = sorted(mufe_fenicsx.MODULE_OF)


@pytest.mark.parametrize("name", NAMES)
def test_a_public_name_loads_and_has_a_docstring(name):
    value = getattr(mufe_fenicsx, name)
    assert value.__name__ == name
    # Each comes from where it is defined.
    assert value.__module__ == f"mufe_fenicsx.{mufe_fenicsx.MODULE_OF[name]}"
    # Dataclasses without a docstring get their signature for one.
    assert value.__doc__ and not value.__doc__.startswith(f"{name}(")


def test_docs_have_a_line_on_each_public_name():
    page = (ROOT / "docs" / "reference" / "python.md").read_text(encoding="utf-8")
    assert sorted(re.findall(r"^\| `(\w+)` \| .+ \|$", page, re.MULTILINE)) == NAMES


def test_type_checkers_know_the_same_names():
    stub = ast.parse(Path(mufe_fenicsx.__file__).with_suffix(".pyi").read_text(encoding="utf-8"))
    found = {
        alias.asname: node.module
        for node in stub.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert found == mufe_fenicsx.MODULE_OF


def test_names_are_listed_and_unknown_ones_refused():
    assert set(NAMES) <= set(dir(mufe_fenicsx)) and set(NAMES) < set(mufe_fenicsx.__all__)
    with pytest.raises(AttributeError, match="has no attribute 'Sceen'"):
        _ = mufe_fenicsx.Sceen


def test_the_package_loads_no_name_before_its_use():
    """What is loaded of the package is what looks for caches that can be written."""
    code = "import sys, mufe_fenicsx; print(*(m for m in sys.modules if m.startswith('mufe_')))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert set(done.stdout.split()) == {
        "mufe_fenicsx", "mufe_fenicsx.machine", "mufe_fenicsx.machine.caches"
    }  # fmt: skip


def test_the_modules_of_public_names_have_types():
    """`make lint` checks them, and the marker `py.typed` says so to other checkers."""
    assert (ROOT / "mufe_fenicsx" / "py.typed").exists()
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    files = [ROOT / name for name in settings["tool"]["mypy"]["files"]]
    for name in mufe_fenicsx.MODULE_OF.values():
        module = ROOT / "mufe_fenicsx" / (name.replace(".", "/") + ".py")
        assert any(module == path or path in module.parents for path in files), module
