"""The HTML page: self-contained, light, printable."""

import base64
from html import escape
from pathlib import Path

from mufe_fenicsx.machine.files import replacing

CSS = """
:root { color-scheme: light; }
body { font: 15px/1.5 Georgia, "Times New Roman", serif; color: #1a1a1a; background: #fff;
  max-width: 62em; margin: 2em auto; padding: 0 1.5em; }
h1 { font-size: 1.7em; margin: 0 0 .1em; } h2 { font-size: 1.2em; margin: 2em 0 .5em;
  border-bottom: 1px solid #bbb; padding-bottom: .2em; }
.lead { color: #555; margin: 0 0 1.2em; }
table { border-collapse: collapse; width: 100%; font-size: .92em; }
td, th { text-align: left; vertical-align: top; padding: .28em .8em .28em 0;
  border-bottom: 1px solid #e2e2e2; overflow-wrap: anywhere; }
th { font-weight: 600; } tr > td:first-child { width: 32%; color: #444; }
table.columns { width: auto; } table.columns td:first-child { width: auto; white-space: nowrap; }
table.columns td, table.columns th { overflow-wrap: normal; }
ul.checks { list-style: none; padding: 0; }
ul.checks li { padding: .45em .8em; margin: .35em 0; border-left: 4px solid #888; }
ul.checks li.pass { border-color: #009e73; background: #f1faf7; }
ul.checks li.warn { border-color: #e6b800; background: #fffae5; }
ul.checks li.fail { border-color: #c0392b; background: #fdeeec; }
.mark { font-weight: 700; margin-right: .5em; } .pass .mark { color: #00704f; }
.warn .mark { color: #7a5c00; } .fail .mark { color: #a02015; }
figure { margin: 1.6em 0; break-inside: avoid; }
figure.wide img { width: 100%; } figure.narrow { display: flex; gap: 1.6em;
  align-items: center; } figure.narrow img { width: 56%; } figure.narrow figcaption { flex: 1; }
figure.narrow { flex-wrap: nowrap; }
img { height: auto; display: block; } figcaption { font-size: .92em; }
figcaption b { display: block; } figcaption .how { color: #444; }
nav { font-size: .92em; margin: 0 0 1em; } nav a { margin-right: 1.2em; }
footer { margin-top: 3em; color: #666; font-size: .85em; }
@media (max-width: 44em) { figure.narrow { display: block; } figure.narrow img { width: 100%; } }
@media print { nav { display: none; } body { margin: 0; max-width: none; font-size: 10pt; }
  h2 { break-after: avoid; } ul.checks li { background: none; } tr { break-inside: avoid; } }
"""

#: Of the grades of a check.
MARKS = {"pass": "✓ pass", "warn": "⚠ look", "fail": "✗ fail"}
#: What the browser may load: nothing but what the page holds.
POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'"


def write_page(path, title, lead, checks, missing, figures, tables, footer, view=None):
    """Write the page.

    Args:
        path: HTML file; written beside and renamed.
        title, lead: Its heading and a sentence below.
        checks: List of :class:`mufe_fenicsx.analysis.checks.Check`.
        missing: Sentences about what is not in the report.
        figures: List of (path of a PNG or GIF, caption, how to read it, "wide" or "narrow").
        tables: List of (heading, rows of cells), or (heading, rows, names of the columns).
        footer: A closing sentence.
        view: :class:`mufe_fenicsx.report.view.View`, or None.
    """
    sections = []
    if checks:
        lines = "\n".join(_check(check) for check in checks)
        sections.append(("checks", "Checks", f"<ul class='checks'>\n{lines}\n</ul>"))
    if missing:
        lines = "\n".join(f"<li>{escape(sentence)}</li>" for sentence in missing)
        sections.append(("missing", "Not in this report", f"<ul>\n{lines}\n</ul>"))
    if view is not None:
        sections.append(("view", "The grains in 3D", view.section))
    if figures:
        lines = "\n".join(_figure(i, *figure) for i, figure in enumerate(figures, start=1))
        sections.append(("figures", "Figures", lines))
    for number, (heading, rows, *columns) in enumerate(tables, start=1):
        if rows:
            sections.append((f"table-{number}", heading, _table(rows, *columns)))
    links = "\n".join(f'<a href="#{name}">{escape(head)}</a>' for name, head, _ in sections)
    css = CSS if view is None else CSS + view.css
    parts = [
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">',
        f"<title>{escape(title)}</title>\n<style>{css}</style>\n</head>\n<body>",
        f'<h1>{escape(title)}</h1>\n<p class="lead">{escape(lead)}</p>',
        f"<nav>{links}</nav>",
        *(
            f'<section id="{name}">\n<h2>{escape(heading)}</h2>\n{content}\n</section>'
            for name, heading, content in sections
        ),
        f"<footer>{escape(footer)}</footer>",
        "" if view is None else view.program,
        "</body>\n</html>\n",
    ]
    with replacing(path) as part:
        part.write_text("\n".join(parts), encoding="utf-8")


def _check(check):
    kind, mark = check.grade, MARKS[check.grade]
    return f'<li class="{kind}"><span class="mark">{mark}</span>{escape(check.text)}</li>'


def _figure(index, image, caption, how, shape):
    data = base64.b64encode(Path(image).read_bytes()).decode("ascii")
    kind = f"image/{Path(image).suffix[1:]}"  # png or gif
    return (
        f'<figure class="{shape}"><img alt="{escape(caption)}" src="data:{kind};base64,{data}">'
        f"<figcaption><b>Figure {index}. {escape(caption)}</b> "
        f'<span class="how">{escape(how)}</span></figcaption></figure>'
    )


def _table(rows, columns=()):
    lines = ["".join(f"<td>{escape(str(cell))}</td>" for cell in row) for row in rows]
    if columns:
        lines.insert(0, "".join(f'<th scope="col">{escape(name)}</th>' for name in columns))
    kind = ' class="columns"' if columns else ""
    return f"<table{kind}>\n" + "\n".join(f"<tr>{line}</tr>" for line in lines) + "\n</table>"
