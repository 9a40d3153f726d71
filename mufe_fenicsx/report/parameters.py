"""The table of a test's parameters, for the page and for a paper."""

import numpy as np

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.output.history import VOIDS
from mufe_fenicsx.report.style import listed, number, quantity
from mufe_fenicsx.units import with_unit

#: Names of the files beside the figures, without ending.
NAME = "parameters"
#: What LaTeX writes otherwise.
TEX = {
    "\\": r"\textbackslash{}", "&": r"\&", "%": r"\%", "#": r"\#", "_": r"\_", "$": r"\$",
    "{": r"\{", "}": r"\}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}",
    "µ": r"\textmu{}", "²": "$^2$", "³": "$^3$", "⁻": "$^-$", "→": r"$\to$", "±": r"$\pm$",
    "×": r"$\times$", "ν": r"$\nu$", "ρ": r"$\rho$", "σ": r"$\sigma$", "ε": r"$\varepsilon$",
    "μ": r"$\mu$", "–": "--", "−": "$-$", "\u202f": r"\,", "°": r"$^\circ$", "·": r"$\cdot$",
}  # fmt: skip


def parameter_rows(source):
    """Rows (name, value) of what a test was; what is not known is left out.

    Args:
        source: :class:`mufe_fenicsx.report.source.Source`.
    """
    scene, run = source.get("scene") or {}, source.summary
    found = [
        *_of_sample(source, run),
        *_of_material("Material", scene.get("material")),
        *(row for name, group in (scene.get("materials") or {}).items()
          for row in _of_material(f"Material of {name}", group)),
        *_of_contact(scene),
        *_of_loading(scene),
        *_of_method(source, scene, run),
        *_of_image(scene),
    ]  # fmt: skip
    return [(name, value) for name, value in found if value]


def void_rows(history):
    """Table of void ratios at the ends of each stage: (heading, rows, names of the columns)."""
    stage = history["stage"]
    starts = np.flatnonzero(np.append(True, stage[1:] != stage[:-1]))
    ends = np.append(starts[1:], len(stage)) - 1
    rows = [
        (str(stage[row]), when, number(history["void_ratio"][row]), _inside(history, row),
         number(history["porosity"][row]))
        for pair in zip(starts, ends, strict=True)
        for row, when in zip(pair, ("start", "end"), strict=True)
    ]  # fmt: skip
    columns = ("Stage", "At its", "Void ratio between the walls", "Half a median diameter "
               "away from them, ± standard error", "Porosity between the walls")  # fmt: skip
    return "Void ratio and porosity", rows, columns


def to_csv(rows):
    """Columns of the CSV file."""
    return dict(zip(("parameter", "value"), map(list, zip(*rows, strict=True)), strict=True))


def to_latex(rows):
    """A table of LaTeX that needs no package."""
    lines = [f"{_tex(name)} & {_tex(value)} \\\\" for name, value in rows]
    body = "\n".join(lines)
    head = "\\begin{tabular}{ll}\n\\hline\nParameter & Value \\\\\n\\hline\n"
    return f"{head}{body}\n\\hline\n\\end{{tabular}}\n"


def _tex(text):
    return "".join(TEX.get(letter, letter) for letter in str(text))


def _inside(history, row):
    inside, error = (history[name][row] for name in VOIDS[2:])
    return f"{number(inside)} ± {number(error, 1)}" if inside > 0 else "too small to tell"


def _of_sample(source, run):
    rows = [("Grains", number(run["num_grains"]) if run.get("num_grains") else None)]
    try:
        rows.append(("Median diameter by volume, d50", quantity(source.median_diameter, "m")))
        rows.append(("Height at strain 0", quantity(source.reference_height, "m", 4)))
        rows.append(("Height over d50", number(source.diameters)))
    except InputError:
        pass  # without states or history
    shape = (run.get("container") or {}).get("shape")
    rows.append(("Container", shape))
    area = run.get("area")
    rows.append(("Cross-section at the start", f"{area * 1e6:.4g} mm²" if area else None))
    if run.get("mass"):
        rows.append(("Mass of the grains", f"{run['mass'] * 1e6:.4g} mg"))
    history = source.get("loading")
    if history is not None and "void_ratio" in history:
        e, n = history["void_ratio"], history["porosity"]
        rows += [
            ("Void ratio between the walls, start → end", f"{number(e[0])} → {number(e[-1])}"),
            ("Void ratio away from walls, start → end",
             f"{_inside(history, 0)} → {_inside(history, -1)}"),
            ("Porosity between the walls, start → end", f"{number(n[0])} → {number(n[-1])}"),
        ]  # fmt: skip
    return rows


def _of_material(name, table):
    if not isinstance(table, dict) or "model" not in table:
        return []
    words = [str(table["model"])]
    for key, unit in (("E", "Pa"), ("nu", ""), ("rho", "kg/m^3")):
        if isinstance(table.get(key), int | float):
            words.append(
                f"{ {'nu': 'ν', 'rho': 'ρ'}.get(key, key) } = {with_unit(table[key], unit)}"
            )
    rows = [(name, ", ".join(words))]
    points = table.get("yield_stress")
    if points:
        text = "; ".join(f"{with_unit(stress, 'Pa')} at {strain:g}" for strain, stress in points)
        beyond = {"flat": "constant beyond", "slope": "with the last slope beyond"}
        after = beyond.get(table.get("beyond"), f"beyond: {table.get('beyond')}")
        rows.append((f"{name}, yield stress of Jσ at plastic strain", f"{text}; {after}"))
    return rows


def _of_contact(scene):
    contact = scene.get("contact") or {}
    rows = [("Friction between grains", contact.get("friction"))]
    rows.append(("Friction while sliding", contact.get("friction_kinetic")))
    walls = scene.get("walls") or {}
    values = sorted({w["friction"] for w in walls.values() if w.get("friction") is not None})
    rows.append(("Friction of walls", listed([f"{v:g}" for v in values], " to ")))
    rows.append(("Contact", ", ".join(str(contact[k]) for k in ("law", "points") if k in contact)))
    return [(name, f"{v:g}" if isinstance(v, float) else v) for name, v in rows]


def _of_loading(scene):
    rows, oedometer, loading = [], scene.get("oedometer"), scene.get("loading") or {}
    if oedometer:
        rows = [
            ("Test", f"oedometer to strain {oedometer['strain']:g}"),
            ("Speed of the platen", with_unit(oedometer["speed"], "m/s")),
            ("Seating", f"{with_unit(oedometer['seating_stress'], 'Pa')} at "
                        f"{with_unit(oedometer['seating_speed'], 'm/s')}"
                        + ", then at rest" * bool(oedometer.get("seating_at_rest"))),
        ]  # fmt: skip
    elif scene.get("stage"):
        names = [str(stage.get("name")) for stage in scene["stage"]]
        rows = [("Test", f"stages: {listed(names)}")]
        if loading.get("speed"):
            rows.append(("Speed of loading, at most", with_unit(loading["speed"], "m/s")))
    for name, wall in (scene.get("walls") or {}).items():
        if wall.get("stress"):
            rows.append((f"Stress of wall {name}", with_unit(wall["stress"], "Pa")))
    return rows


def _of_method(source, scene, run):
    solver, rows = scene.get("solver") or {}, []
    if run.get("num_cells"):
        rows.append(("Tetrahedra", number(run["num_cells"])))
    edges = run.get("edges_per_diameter")
    if edges:
        rows.append(("Edges of the mesh a diameter", number(edges)))
        form = source.get("inertia")
        if form is not None:
            mean = np.cbrt(6 * form.mass.mean() / np.pi)
            rows.append(("Length of edges on surfaces, h", quantity(mean / edges, "m")))
    rows.append(("Element", run.get("element")))
    rows.append(("Integrator", solver.get("integrator")))
    if run.get("time_step"):
        rows.append(("Time step at the end", quantity(run["time_step"], "s")))
    if "damping" in solver:
        rows.append(("Mass damping", with_unit(solver["damping"], "s^-1")))
    if run.get("added_mass") and run.get("mass"):
        rows.append(
            ("Mass added by scaling", f"{run['added_mass'] / run['mass']:.2%} of the grains")
        )
    return rows


def _crop(crop):
    """A crop, given along z, y and x, in words."""
    if not crop:
        return None
    ends = dict(zip("zyx", crop, strict=True))
    return ", ".join(f"{axis} {ends[axis][0]}–{ends[axis][1]}" for axis in "xyz") + " voxels"


def _of_image(scene):
    image, mesh = scene.get("image") or {}, scene.get("mesh") or {}
    size = image.get("voxel_size") or mesh.get("voxel_size")
    sizes = size if isinstance(size, list) else [size] if size else []
    rows = [
        ("Image", image.get("file")),
        ("Voxel size", " × ".join(with_unit(each, "m") for each in sizes)),
        ("Crop of the image", _crop(image.get("crop"))),
        ("Resampled, times as fine", image.get("upsample")),
        ("Filter", image.get("filter")),
        ("Threshold between void and solid", image.get("threshold")),
        ("Grains parted by", image.get("separation")),
        ("Length of edges asked for", with_unit(mesh["size"], "m") if mesh.get("size") else None),
    ]
    return [(name, str(value)) for name, value in rows if value is not None]
