"""What differs between the scenes of several runs, and names of runs by it."""

from pathlib import Path

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.report import style

#: Tables and keys of a scene that say nothing of the physics.
OF_NO_INTEREST = ("title", "image", "output", "reference", "sample.grains")
#: So many differences fit into a name, and so many letters.
MOST, LONGEST = 3, 60
#: Keys whose values have a unit, by their last word.
UNITS = {"E": "Pa", "speed": "m/s", "size": "m", "seating_stress": "Pa", "seating_speed": "m/s",
         "element_size": "m", "d50": "m"}  # fmt: skip
YIELD = "material.yield_stress"
MESH, PACK, TETRAHEDRA = "mesh.", "pack.", "tetrahedra"


def name_runs(sources):
    """Names of runs by what differs in their scenes, else by their folders.

    Args:
        sources: List of :class:`mufe_fenicsx.report.source.Source`.

    Returns:
        List of different texts.
    """
    folders = [source.folder.resolve() for source in sources]
    by_folder = [folder.name for folder in folders]
    if len(set(by_folder)) < len(by_folder):
        by_folder = [str(Path(folder.parent.name, folder.name)) for folder in folders]
    if len(set(by_folder)) < len(by_folder):
        by_folder = [f"{k}: {name}" for k, name in enumerate(by_folder, start=1)]
    found = differences(sources)
    if not 1 <= len(found) <= MOST:
        return by_folder
    names = [
        ", ".join(words(key, value) for key, value in zip(found, values, strict=True))
        for values in zip(*found.values(), strict=True)
    ]
    fit = len(set(names)) == len(names) and max(map(len, names)) <= LONGEST
    return names if fit else by_folder


def differences(sources):
    """What differs in scenes of runs, their packings and meshes; empty where one has no scene.

    Args:
        sources: List of :class:`mufe_fenicsx.report.source.Source`.

    Returns:
        dict of a key such as "contact.friction" -> its value in each run, None where not set.
    """
    try:
        scenes = [_flat(source.run.scene) | source.packing for source in sources]
    except InputError:
        return {}
    keys = dict.fromkeys(key for scene in scenes for key in scene)
    found = {key: [scene.get(key) for scene in scenes] for key in keys}
    found[TETRAHEDRA] = [source.summary.get("num_cells") for source in sources]
    found = {key: values for key, values in found.items() if len(set(map(str, values))) > 1}
    if any(key.startswith((MESH, PACK)) for key in found):  # says it already
        found.pop(TETRAHEDRA, None)
    return found


def _flat(table, before=""):
    """A scene as one dict "contact.friction" -> value."""
    found = {}
    for key, value in table.items():
        name = f"{before}{key}"
        if name in OF_NO_INTEREST:
            continue
        found |= _flat(value, f"{name}.") if isinstance(value, dict) else {name: value}
    return found


def words(key, value):
    """The last word of a key and its value: "friction 0.1"."""
    if key == YIELD and value:
        return f"yield {style.quantity(value[0][1], 'Pa')}"
    return f"{key.rsplit('.', 1)[-1]} {value_text(key, value)}"


def value_text(key, value):
    """A value of a scene as a text, with its unit where that is known."""
    unit = UNITS.get(key.rsplit(".", 1)[-1])
    if value is None:
        return "not set"
    if key == YIELD:
        return "; ".join(f"{style.quantity(y, 'Pa')} at {strain:g}" for strain, y in value)
    return style.quantity(value, unit) if unit and isinstance(value, float) else str(value)
