"""Small halls: signatures, classes and functions of the package stay small enough to read.

A class reaches through another one where it names an attribute of an attribute, ``self.a.b``.

Frozen dataclasses assign nothing to ``self``, so that settings may have as many fields as they
need. Kernels take arrays, one by one, and are left out.
"""

import ast
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1] / "mufe_fenicsx"

#: Parameters of a signature, without ``self``.
PARAMETERS = 10
#: Attributes of a class, assigned as ``self.name``.
ATTRIBUTES = 20
#: Lines of a function, without its docstring.
LINES = 60
#: Different reaches of a class.
REACHES = 40

_OPTIONS = "each choice of a chart is an option of `mufe verify`"
_SCRIPT = "a case reads from top to bottom as a script"

#: What is larger, "file:name", and why.
EXCEPTIONS = {
    "cli/calibrate.py:calibrate": "options of a command stand in its signature, with their help",
    "cli/compare.py:compare": "options of a command stand in its signature, with their help",
    "cli/main.py:run": "options of a command stand in its signature, with their help",
    "cli/sweep.py:sweep": "options of a command stand in its signature, with their help",
    "verification/bar_impact.py:bar_impact": _SCRIPT,
    "verification/charts/points.py:hertz_point": _OPTIONS,
    "verification/charts/points.py:jammed_point": _OPTIONS,
    "verification/charts/points.py:mindlin_point": _OPTIONS,
    "verification/charts/points.py:plastic_sphere_point": _OPTIONS,
    "verification/known_stress.py:known_stress": _OPTIONS,
    "verification/known_stress.py:sample_point": _OPTIONS,
    "verification/mindlin.py:shear_balls": _SCRIPT,
    "verification/overlap.py:overlap": _SCRIPT,
    "verification/plastic_ball.py:press_ball": _SCRIPT + ", with the options of all its cases",
    "verification/torsion.py:twist_balls": _SCRIPT,
}


def sources():
    """Files of the package whose halls are measured."""
    left_out = PACKAGE / "kernels", PACKAGE / "report" / "assets"
    found = sorted(PACKAGE.rglob("*.py"))
    return [path for path in found if not any(path.is_relative_to(folder) for folder in left_out)]


def num_parameters(function):
    """Parameters of a function, those that it collects as ``**options`` left out."""
    a = function.args
    names = [arg.arg for arg in a.posonlyargs + a.args + a.kwonlyargs]
    return len([name for name in names if name not in ("self", "cls")])


def num_lines(function):
    """Lines of a function without its decorators and its docstring."""
    docstring = ast.get_docstring(function, clean=False)
    inside = 0 if docstring is None else docstring.count("\n") + 1
    return function.end_lineno - function.lineno + 1 - inside


def num_attributes(cls):
    """Attributes that methods of a class assign."""
    return len(
        {
            node.attr
            for node in ast.walk(cls)
            if isinstance(node, ast.Attribute)
            and isinstance(node.ctx, ast.Store)
            and isinstance(node.value, ast.Name)
            and node.value.id == "self"
        }
    )


def reaches(cls):
    """Different attributes of attributes, "a.b", that a class names."""
    return {
        f"{node.value.attr}.{node.attr}"
        for node in ast.walk(cls)
        if isinstance(node, ast.Attribute)
        and isinstance(node.value, ast.Attribute)
        and isinstance(node.value.value, ast.Name)
        and node.value.value.id == "self"
    }


def too_large(source):
    """(name, what is too large) of all functions and classes of a source."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            if num_parameters(node) > PARAMETERS:
                yield node.name, f"{num_parameters(node)} parameters, expected {PARAMETERS}"
            if num_lines(node) > LINES:
                yield node.name, f"{num_lines(node)} lines, expected {LINES}"
        elif isinstance(node, ast.ClassDef) and num_attributes(node) > ATTRIBUTES:
            yield node.name, f"{num_attributes(node)} attributes, expected {ATTRIBUTES}"


def test_halls_are_small():
    """At most the limits, but for the exceptions; each exception is needed."""
    found = {}
    for path in sources():
        for name, what in too_large(path.read_text(encoding="utf-8")):
            place = f"{path.relative_to(PACKAGE).as_posix()}:{name}"
            found.setdefault(place, []).append(what)
    new = [f"{place}: {', '.join(found[place])}" for place in found if place not in EXCEPTIONS]
    assert not new, "\n".join(new)
    assert not sorted(EXCEPTIONS.keys() - found.keys()), "exceptions that are not needed any more"


def num_reaches(source):
    """{class: number of its reaches} of a source."""
    classes = [node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.ClassDef)]
    return {cls.name: len(reaches(cls)) for cls in classes}


def test_classes_reach_through_few_others():
    """At most the limit; none has an exception."""
    found = {}
    for path in sources():
        for name, number in num_reaches(path.read_text(encoding="utf-8")).items():
            if number > REACHES:
                found[f"{path.relative_to(PACKAGE).as_posix()}:{name}"] = number
    assert not found


def test_reaches_are_counted_once():
    assert num_reaches("class A:\n    def f(self):\n        self.a.b = self.a.b.c + self.d\n") == {
        "A": 1
    }


def test_large_halls_are_found():
    """One parameter, attribute and line too many each."""
    parameters = ", ".join(f"p{k}" for k in range(PARAMETERS + 1))
    attributes = "".join(f"        self.a{k} = 0\n" for k in range(ATTRIBUTES + 1))
    lines = "    pass\n" * LINES
    source = (
        f"def many({parameters}):\n    pass\n"
        f"class Big:\n    def __init__(self):\n{attributes}"
        f'def long():\n    """Two\n    lines."""\n{lines}'
    )
    assert [name for name, _ in too_large(source)] == ["many", "Big", "long"]
