"""What a scene file may hold, read from the sources of the dataclasses that hold it.

Names, types and defaults are those of the fields; their meaning is the text after ``#:``;
allowed values and bounds are those that ``__post_init__`` checks. Nothing is stated twice.
"""

import ast
import functools
import inspect
import re
import sys
import textwrap
import typing
from dataclasses import MISSING, dataclass, field, fields, is_dataclass
from pathlib import Path

from ..errors import InputError, nearest_name, shown
from ..materials.scatter import Scatter
from ..units import QUANTITIES
from .catalogue import MODELS, SHAPES, TABLES, TOP_KEYS, WORDS, unit_of
from .scene import Scene
from .stages import Stage
from .tables import WALLS, Wall

#: Names of the functions that check a value: condition, name of the field, value, expectation.
CHECKS = ("require", "_require")
#: The other way round, for `value < bound`.
MIRRORED = {ast.Gt: ast.Lt, ast.GtE: ast.LtE, ast.Lt: ast.Gt, ast.LtE: ast.GtE}


@dataclass(frozen=True)
class Key:
    """One key of a table."""

    name: str
    cls: type  #: dataclass that holds it
    hint: object  #: its type
    text: str  #: what it means
    unit: str | tuple  #: SI unit, or those of the columns of a list
    default: object  #: `MISSING` where it has to be given
    choices: tuple = ()  #: allowed texts, if not any
    bounds: dict = field(default_factory=dict)  #: of a number, with the names of JSON schema

    @property
    def kinds(self):
        """Its types, None left out."""
        if self.entries is not None:
            return (dict,)
        return tuple(kind for kind in typing.get_args(self.hint) or (self.hint,)
                     if kind is not type(None))  # fmt: skip

    @property
    def table(self):
        """Dataclass of a table within, or None."""
        return next((kind for kind in self.kinds if is_dataclass(kind)), None)

    @property
    def entries(self):
        """Dataclass of the entries of a table with names of one's own, or None."""
        named = typing.get_origin(self.hint) is dict
        return typing.get_args(self.hint)[1] if named else None

    @property
    def required(self):
        """Whether the key has no default."""
        return self.default is MISSING


@functools.cache
def keys_of(cls):
    """Keys of a table by name, those of the dataclass ``cls``: dict of :class:`Key`."""
    hints = typing.get_type_hints(cls)
    texts, choices, bounds = {}, {}, {}
    for base in reversed(cls.__mro__):
        if is_dataclass(base):
            body = _body(base)
            texts |= _texts(base, body)
            choices |= _choices(base, body)
            bounds |= _bounds(body)
    found = {}
    for item in fields(cls):
        default = item.default
        if default is MISSING and item.default_factory is not MISSING:
            default = item.default_factory()
        found[item.name] = Key(
            item.name,
            cls,
            hints[item.name],
            texts.get(item.name, ""),
            unit_of(cls, item.name),
            default,
            choices.get(item.name, ()),
            bounds.get(item.name, {}),
        )
    return found


@functools.cache
def tables():
    """All tables of a scene file: dotted name -> dataclass; NAME stands for any name.

    That of [material] is the one of each model; the default one is named without it.
    """
    found = dict(TABLES)
    found |= {f'material (model = "{name}")': cls for name, cls in MODELS.items()}
    found |= {"material.scatter": Scatter, "walls.NAME": Wall, "stage": Stage}
    found |= {
        f"{table}.{key.name}.NAME": key.entries
        for table, cls in TABLES.items()
        for key in keys_of(cls).values()
        if key.entries is not None
    }
    for key in keys_of(Stage).values():
        if key.table is not None:
            found[f"stage.{key.name}"] = key.table
    return found


def explain(wanted):
    """Lines that say what a key or a table of a scene file is.

    Args:
        wanted: Dotted name such as "oedometer.speed", a table, or a key without its table.

    Raises:
        InputError: There is none of that name.
    """
    name = re.sub(r"\[\d*\]", "", wanted.strip().strip("[]"))
    parts = name.split(".")
    if parts[0] == "materials":  # of one's own name: as [material]
        parts = ["material", *parts[2:]]
    if parts[:2] == ["contact", "pairs"] and len(parts) > 2:
        parts[2] = "NAME"
    if parts[0] == "walls" and len(parts) > 1 and parts[1] in WALLS:
        parts[1] = "NAME"
    name = ".".join(parts)
    if name in TOP_KEYS:
        return _explain_key("", keys_of(Scene)[name])
    if name in ("walls", "contact.pairs"):
        name += ".NAME"
    found = [(table, cls) for table, cls in tables().items() if _plain(table) == name]
    if found:
        return _explain_table(*found[0] if len(found) == 1 else (name, found[0][1]), found)
    lines, seen = [], set()
    for table, cls in tables().items():
        for key in keys_of(cls).values():
            full = f"{_plain(table)}.{key.name}"
            same = {(full, key.text), (cls, key.name)}
            if name in (full, key.name) and not same & seen:
                seen |= same
                lines += ([""] if lines else []) + _explain_key(table, key)
    if not lines:
        known = list(dict.fromkeys([*TOP_KEYS, *map(_plain, tables())]))
        keys = [f"{_plain(t)}.{key}" for t, cls in tables().items() for key in keys_of(cls)]
        near = nearest_name(name, known + keys)
        near = near if near in known + keys else nearest_name(name, known)
        raise InputError(f"{shown(wanted)} is not a key of a scene, expected {near}")
    return lines


def expectation(key):
    """What a value of a key has to be, in words."""
    if key.table is not None:
        return f"a table {{ … }}: {', '.join(keys_of(key.table))}"
    if key.entries is not None:
        keys = keys_of(key.entries)
        return f"a table of NAME = {next(iter(keys))}, or {{ … }}: {', '.join(keys)}"
    parts = []
    if key.choices:
        parts.append(" or ".join(f'"{choice}"' for choice in key.choices))
    if bool in key.kinds:
        parts.append("true or false")
    elif key.name in SHAPES and float not in key.kinds:
        sizes = " x ".join("n" if size < 0 else str(size) for size in SHAPES[key.name])
        parts.append(f"a list of {sizes} numbers")
    elif int in key.kinds:
        parts.append("a whole number")
    elif float in key.kinds:
        what, example = QUANTITIES[key.unit if isinstance(key.unit, str) else ""]
        parts.append(f'{what} such as "{example}", or a number in {key.unit}' if key.unit else what)
        if Path in key.kinds:
            parts += [*(f'"{word}"' for word in WORDS.get(key.name, ())), "a path"]
    elif Path in key.kinds:
        parts.append("a path")
    elif not key.choices:
        parts.append("a text")
    limits = " and ".join(
        f"{sign} {key.bounds[word]:g}"
        for word, sign in (
            ("minimum", ">="), ("exclusiveMinimum", ">"),
            ("maximum", "<="), ("exclusiveMaximum", "<"),
        )
        if word in key.bounds
    )  # fmt: skip
    return ", or ".join(parts) + (f"; {limits}" if limits else "")


def first_lines(cls):
    """First paragraph of the docstring of a table."""
    text = inspect.getdoc(cls) or ""
    text = re.sub(r"^\[.*?\]+( and so on)?: ", "", text.split("\n\n")[0].replace("\n", " "))
    return text.replace("``", "").replace("`", "")


def _plain(table):
    """Name of a table without the model."""
    return table.split(" ")[0]


def _explain_table(name, cls, found):
    lines = [f"[{name}]" if name != "stage" else "[[stage]]"]
    for table, member in found:
        if len(found) > 1:
            lines += ["", table]
        lines += textwrap.wrap(first_lines(member), 92, initial_indent="    ",
                               subsequent_indent="    ")  # fmt: skip
        width = max(map(len, keys_of(member)))
        for key in keys_of(member).values():
            lines.append(f"    {key.name:{width}}  {key.text or expectation(key)}")
    return lines


def _explain_key(table, key):
    where = _plain(table)
    if key.required:
        default = "has to be given"
    elif key.default in (None, "", {}):
        default = "left out: not set"
    else:
        shown = str(key.default).lower() if isinstance(key.default, bool) else key.default
        default = f"left out: {shown}"
    having = [name for name, cls in MODELS.items() if key.name in keys_of(cls)]
    only = where == "material" and len(having) < len(MODELS)
    return [
        f"{where}.{key.name}".lstrip(".") + (f"  (model = {' or '.join(having)})" if only else ""),
        f"    {key.text}",
        f"    {expectation(key)}",
        f"    {default}",
    ]


# --- reading the sources ------------------------------------------------------------------


def _body(cls):
    """The class statement and its lines; an empty one where there is no source to read."""
    try:
        source = textwrap.dedent(inspect.getsource(cls))
    except OSError:  # a material of one's own, typed into Python
        source = f"class {cls.__name__}: pass"
    return ast.parse(source).body[0], source.splitlines()


def _texts(cls, body):
    """Text after ``#:`` of each field that a class states itself."""
    tree, lines = body
    found = {}
    for node in tree.body:
        if not (isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name)):
            continue
        for line in lines[node.lineno - 1 : node.end_lineno]:
            if "#:" in line:
                found[node.target.id] = line.partition("#:")[2].strip()
    return found


def _post_init(tree):
    return [n for n in tree.body if isinstance(n, ast.FunctionDef) and n.name == "__post_init__"]


def _choices(cls, body):
    """Allowed texts of fields, from `one_of(...)` and from `self.name in (...)`."""
    names, found = vars(sys.modules[cls.__module__]), {}
    for function in _post_init(body[0]):
        local = {
            node.targets[0].id: node.value
            for node in ast.walk(function)
            if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name)
        }
        for node in ast.walk(function):
            name, values = None, None
            if _calls(node, ("one_of",)) and isinstance(node.args[0], ast.Constant):
                name, values = node.args[0].value, node.args[2]
            elif isinstance(node, ast.Compare) and isinstance(node.ops[0], ast.In | ast.NotIn):
                name, values = _own(node.left), node.comparators[0]
            if isinstance(values, ast.Name):
                values = local.get(values.id, values)
            if isinstance(values, ast.Call) and isinstance(values.func, ast.Name) and name:
                texts = names[values.func.id]() if not values.args else None
            else:
                texts = _constant(values, names) if name else None
            if isinstance(texts, tuple) and all(isinstance(text, str) for text in texts):
                found[name] = texts
    return found


def _bounds(body):
    """Bounds of numbers that `require(0 < self.name < 1, "name", ...)` states as constants."""
    found = {}
    for function in _post_init(body[0]):
        loops = {}
        for node in ast.walk(function):
            if isinstance(node, ast.For) and isinstance(node.target, ast.Name):
                names = _constant(node.iter, {})
                if isinstance(names, tuple):
                    for inner in ast.walk(node):
                        loops[id(inner)] = (node.target.id, names)
        for node in ast.walk(function):
            test, names = None, ()
            if _calls(node, CHECKS):
                test, named = node.args[:2]
                if isinstance(named, ast.Constant):
                    names = (named.value,)
                elif isinstance(named, ast.Name) and loops.get(id(node), ("",))[0] == named.id:
                    names = loops[id(node)][1]
            elif isinstance(node, ast.If) and isinstance(node.test, ast.UnaryOp):
                test = node.test.operand
                names = [name for name in map(_own, ast.walk(test)) if name]
            if isinstance(test, ast.BoolOp) and isinstance(test.op, ast.Or):
                # `x is None or 0 < x`
                rest = [part for part in test.values if not _asks_for_none(part)]
                test = rest[0] if len(rest) == 1 else None
            if isinstance(test, ast.Compare):
                for name in names:
                    found[name] = found.get(name, {}) | _limits(test, name)
    return found


def _asks_for_none(node):
    return isinstance(node, ast.Compare) and isinstance(node.ops[0], ast.Is)


def _limits(test, name):
    """Bounds of a chain of comparisons of constants with one value."""
    words = {
        ast.Gt: "exclusiveMinimum", ast.GtE: "minimum",
        ast.Lt: "exclusiveMaximum", ast.LtE: "maximum",
    }  # fmt: skip
    sides, found = [test.left, *test.comparators], {}
    for left, op, right in zip(sides, test.ops, sides[1:], strict=False):
        kind = type(op)
        if kind not in words:
            continue
        low, high = _constant(left, {}), _constant(right, {})
        if isinstance(low, int | float) and _is_value(right, name):
            found[words[MIRRORED[kind]]] = low
        elif isinstance(high, int | float) and _is_value(left, name):
            found[words[kind]] = high
    return found


def _is_value(node, name):
    """Whether an expression is the value of the field itself."""
    own = _own(node)
    read = isinstance(node, ast.Call) and getattr(node.func, "id", "") == "getattr"
    return own == name if own else read or isinstance(node, ast.Name)


def _calls(node, names):
    return (
        isinstance(node, ast.Call)
        and isinstance(node.func, ast.Name)
        and node.func.id in names
        and len(node.args) >= 3
    )


def _own(node):
    """NAME of an expression `self.NAME`, or None."""
    own = isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name)
    return node.attr if own and node.value.id == "self" else None


def _constant(node, names):
    """Value of an expression of constants and of the module's names, or None."""
    if node is None:
        return None
    if isinstance(node, ast.Name):
        return names.get(node.id)
    if isinstance(node, ast.Tuple):
        return tuple(_constant(item, names) for item in node.elts)
    try:
        return ast.literal_eval(node)
    except ValueError:
        return None
