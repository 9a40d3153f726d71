"""Settings of Sphinx: `make docs` builds these pages into build/docs, where a warning is an error.

The source folder is the root of the repository, so that links between README.md, docs/ and
demos/ lead to the same places here and where the repository is read. Pages of the API reference
are written anew at each build into docs/api: one for each module, an index for each folder.
"""

import ast
import dataclasses
import inspect
import os
import posixpath
import re
from pathlib import Path

# Compiled loops are shown as the Python functions that they are made of.
os.environ["NUMBA_DISABLE_JIT"] = "1"

import docutils.nodes
import latex2mathml.converter
from sphinx.util import logging

import mufe_fenicsx
from mufe_fenicsx.units import keys_of

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "mufe_fenicsx"
#: Largest page of the API reference [bytes]; more is a warning, and so an error.
LARGEST_PAGE = 400_000

project = "mufe_fenicsx"
author = "The mufe_fenicsx authors"
version = release = mufe_fenicsx.__version__

root_doc = "docs/index"
include_patterns = [
    "README.md",
    "CHANGELOG.md",
    "CONTRIBUTING.md",
    "docs/*.md",
    "docs/**/*.md",
    "docs/api/*.rst",
    "docs/api/**/*.rst",
    "meshes/*.md",
]
exclude_patterns = [
    ".venv",
    ".git",
    "build",
    "dist",
    "runs",
    "demo-output",
    "bench-cache",
]

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
needs_sphinx = "8.0"
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3
html_theme = "furo"
html_title = f"mufe_fenicsx {release}"
html_math_renderer = "mathml"
html_show_sphinx = html_show_copyright = False

autodoc_member_order = "bysource"
autodoc_default_options = {"members": True, "show-inheritance": False}
autodoc_typehints = "none"
autodoc_preserve_defaults = True
napoleon_numpy_docstring = False
napoleon_use_rtype = False  # what stands before a colon in "Returns:" is text, not a type

#: Sections of Google's style, whose indented lines belong to them.
SECTIONS = {"Args:", "Returns:", "Raises:", "Yields:", "Note:", "Attributes:", "Example:"}
LITERAL = re.compile(r"(``[^`]+``|:[a-z:]+:`[^`]+`)")
SINGLE = re.compile(r"(?<![`\w])`([^`\n]+)`(?!`)")


def as_rst(app, what, name, obj, options, lines):
    """Docstrings are plain text: indented formulae are kept as they stand, signs stay signs."""
    out, header, before = [], False, ""
    literal = False
    for i, line in enumerate(lines):
        indented, text = line.startswith("    "), line.strip()
        if text and not indented:
            header, literal = text in SECTIONS, False
        starts = indented and text and not header and not lines[i - 1].strip()
        if starts and not literal and not before.lstrip().startswith(("- ", "* ")):
            out += ["::", ""]
            literal = True
        if text and not indented:
            before = line
        out.append(line if literal else _escaped(line))
    lines[:] = out
    if what in ("attribute", "data", "property") and not SECTIONS & set(lines):
        app.kept_texts[name] = out


def add_keys(app, what, name, obj, options, lines):
    """Settings of a class say what they are in their keys, not beside them."""
    if what == "class" and dataclasses.is_dataclass(obj):
        own = [keys_of(obj)[name] for name in inspect.get_annotations(obj) if name in keys_of(obj)]
        texts = [f"    {key.name}: {key.text}" for key in own if key.meaning]
        lines += ["Attributes:", *texts, ""] if texts else []


def keep_colons(app, what, name, obj, options, lines):
    """Of an attribute napoleon takes what stands before a colon for its type; it is text."""
    lines[:] = app.kept_texts.pop(name, lines)


def skip_made_signatures(app, what, name, obj, skip, options):
    """Commands that take settings as options: `--help` tells them, the source has no defaults."""
    return True if hasattr(obj, "__wrapped__") and "__signature__" in vars(obj) else None


def _escaped(line):
    parts = LITERAL.split(SINGLE.sub(r"``\1``", line))
    for i in range(0, len(parts), 2):
        parts[i] = re.sub(r"[|*]", r"\\\g<0>", parts[i])
        parts[i] = re.sub(r"(?<=\w)_(?![\w`])", r"\\_", parts[i])
    return "".join(parts)


def complete_navigation(app, docname, source):
    """Pages that index.md lists and are not there are left out; those that it lacks come last."""
    if docname != root_doc:
        return
    entry = re.compile(r"(?:.*<)?([\w./-]+)>?")
    known, listed, lines, inside = app.env.found_docs, {root_doc}, [], False
    for line in source[0].splitlines():
        inside = line.startswith("```{toctree}") or (inside and line != "```")
        found = entry.fullmatch(line)
        if inside and found:
            page = posixpath.normpath(posixpath.join("docs", found[1]))
            if page not in known:
                continue
            listed.add(page)
        lines.append(line)
    others = sorted(page for page in known - listed if not page.startswith("docs/api/"))
    if others:
        lines += ["", "```{toctree}", ":caption: More", ":maxdepth: 1", ""]
        lines += [*(f"/{page}" for page in others), "```"]
    source[0] = "\n".join(lines) + "\n"


def write_api_pages(app):
    """A page for each module in docs/api, and an index for each folder of the package."""
    folder, pages = ROOT / "docs" / "api", api_pages()
    for old in folder.rglob("*.rst"):
        if old.relative_to(folder).as_posix() not in pages:
            old.unlink()
    for name, text in pages.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


def api_pages():
    """{name of a page within docs/api: its text}."""
    pages = {}
    for init in sorted(PACKAGE.rglob("__init__.py")):
        folder = init.parent
        modules = [p for p in sorted(folder.glob("*.py")) if not p.name.startswith("__")]
        folders = [p.parent for p in sorted(folder.glob("*/__init__.py"))]
        place = folder.relative_to(PACKAGE)
        pages[(place / "index.rst").as_posix()] = _index(folder, folders, modules)
        for module in modules:
            name = f"{_name(folder)}.{module.stem}"
            text = f"{_heading(name, '=')}\n.. automodule:: {name}\n"
            pages[(place / f"{module.stem}.rst").as_posix()] = text
    return pages


def _index(folder, folders, modules):
    """Page of a folder: what its own docstring says, then its folders and modules, a line each."""
    name = _name(folder)
    # The public names of the package stand where they are defined.
    options = ["   :no-members:"] if folder == PACKAGE else []
    title = "Reference of the package" if folder == PACKAGE else name
    lines = [_heading(title, "="), f".. automodule:: {name}", *options, ""]
    entries = [(p.name, f"{p.name}/index", p / "__init__.py") for p in folders]
    entries += [(p.stem, p.stem, p) for p in modules]
    lines += [f"- :doc:`{word} <{page}>`: {_first_line(path)}" for word, page, path in entries]
    toctree = [f"   {word} <{page}>" for word, page, _ in entries]
    return "\n".join([*lines, "", ".. toctree::", "   :hidden:", "", *toctree, ""])


def _name(folder):
    return ".".join(folder.relative_to(ROOT).parts)


def _first_line(path):
    """What a module is, by the first sentence of its docstring."""
    text = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
    return _escaped(" ".join(text.partition("\n\n")[0].split()))


def _heading(title, line):
    return f"{title}\n{line * len(title)}\n"


def visit_math(translator, node):
    """Equations as MathML: browsers show it as it is, without a script from elsewhere."""
    block = node.tagname == "math_block"
    mathml = latex2mathml.converter.convert(node.astext(), display="block" if block else "inline")
    translator.body.append(f'<div class="math">{mathml}</div>' if block else mathml)
    raise docutils.nodes.SkipNode


def fold_navigation(app, pagename, templatename, context, doctree):
    """Of the list of all pages each page shows its own branch only: there are hundreds."""
    whole = context.get("toctree")
    if whole is not None:
        context["toctree"] = lambda **options: whole(**options | {"collapse": True})


def measure_api_pages(app, exception):
    """Warn of pages that take a browser long."""
    if exception is None and app.builder.name == "html":
        for page in sorted(Path(app.outdir, "docs", "api").rglob("*.html")):
            if (size := page.stat().st_size) > LARGEST_PAGE:
                logging.getLogger(__name__).warning(
                    f"{page.name}: {size} bytes, expected at most {LARGEST_PAGE}"
                )


def write_front_page(app, exception):
    """build/docs/index.html leads to the first page."""
    if exception is None and app.builder.name == "html":
        Path(app.outdir, "index.html").write_text(
            '<!DOCTYPE html><meta charset="utf-8"><title>mufe_fenicsx</title>'
            '<meta http-equiv="refresh" content="0; url=docs/index.html">'
            '<a href="docs/index.html">mufe_fenicsx</a>\n',
            encoding="utf-8",
        )


def setup(app):
    app.add_html_math_renderer("mathml", (visit_math, None), (visit_math, None))
    app.kept_texts = {}
    app.connect("autodoc-skip-member", skip_made_signatures)
    app.connect("autodoc-process-docstring", add_keys, priority=50)
    app.connect("autodoc-process-docstring", as_rst, priority=100)
    app.connect("autodoc-process-docstring", keep_colons, priority=900)  # after napoleon's
    app.connect("builder-inited", write_api_pages)
    app.connect("source-read", complete_navigation)
    app.connect("html-page-context", fold_navigation, priority=100)  # before the theme's
    app.connect("build-finished", measure_api_pages)
    app.connect("build-finished", write_front_page)
