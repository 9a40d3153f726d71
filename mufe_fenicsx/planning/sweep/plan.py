"""Which runs a sweep has: checked before the first one begins, and kept in its folder."""

import json
import tomllib
from dataclasses import dataclass
from pathlib import Path

from ...errors import InputError, shown
from ...machine.files import check_place, reason, regular, write_atomically
from ...results.reference_curves import read_reference
from ...run.resume_check import file_of_grains
from ...scene import Scene, load_scene
from ...scene.values import build
from ...synthetic.rigid_packing.settings import PackSettings
from ...units import keys_of
from .parameters import Range, hypercube, product, read_parameters, stated, table_text

#: What is kept of a sweep in its folder, and its parameters as a table.
KEPT, PARAMETERS = "sweep.json", "parameters.txt"
#: Parameters of packings begin so; two of them are no settings.
PACK, SOURCE, SPHERES = "pack.", "source", "spheres"
#: Keys of a scene that do nothing to a run.
IDLE = ("image.", "mesh.")


@dataclass(frozen=True)
class Sweep:
    """The runs of a sweep: number k has the parameters ``rows[k]``, texts by name."""

    scene: Path
    rows: list[dict[str, str]]
    grains: Path | None  #: of all runs; None: that of the scene, or of packings
    described: list[str] | None  #: of the rows in the table of an outer loop

    @property
    def names(self) -> list[str]:
        """Names of the runs: 001, 002 and so on."""
        width = max(3, len(str(len(self.rows))))
        return [f"{k:0{width}d}" for k in range(1, len(self.rows) + 1)]

    def changes(self, number: int) -> dict[str, str]:
        """What run ``number`` changes of the scene, without its packing."""
        row = self.rows[number]
        return {key: text for key, text in row.items() if not key.startswith(PACK)}

    def packing(self, number: int) -> tuple[tuple[str, str], ...]:
        """What it says of its packing, (name, text) each; () where there is none."""
        row = self.rows[number]
        return tuple((key, text) for key, text in row.items() if key.startswith(PACK))

    def load(self, number: int) -> Scene:
        """The scene of a run."""
        return load_scene(self.scene, self.changes(number))

    @property
    def varied(self) -> list[str]:
        """Names of the parameters that differ between the runs."""
        first = self.rows[0]
        return [key for key in first if any(row[key] != first[key] for row in self.rows)]

    def words(self, number: int) -> str:
        """Parameters of a run that differ from others, in words."""
        row = self.rows[number]
        return ", ".join(f"{key} = {row[key]}" for key in self.varied or row)


def make_sweep(scene, changes, table=None, num_samples=None, seed=0, grains=None) -> Sweep:
    """The runs of a scene with lists, ranges and a table of parameters.

    Args:
        scene: Scene file.
        changes: Texts "name=values", see :mod:`.parameters`.
        table: File of :func:`.parameters.read_parameters`, or None.
        num_samples: Of the ranges; None: there are none.
        seed: Of their random numbers.
        grains: Folder that `mufe mesh` wrote, of all runs; None: that of the scene, or packings.

    Raises:
        InputError: A parameter cannot be used, or a run has no grains.
    """
    lists, ranges = stated(changes)
    if bool(ranges) != (num_samples is not None):
        one = f"{ranges[0].name} = {ranges[0].low}:{ranges[0].high}" if ranges else ""
        raise InputError(
            f"{one} is a range, expected --samples N beside it"
            if ranges
            else f"--samples {num_samples}, expected a range such as name=low:high to sample"
        )
    rows, described = ([{}], None) if table is None else read_parameters(table)
    samples = hypercube(ranges, num_samples, seed)
    blocks = [[{name: text} for text in texts] for name, texts in lists.items()]
    whole = product(rows, samples, *blocks)
    if not whole[0]:
        raise InputError(
            "no parameter is given, expected --set name=value,value or --table, or --resume to "
            "take those of the folder"
        )
    sweep = Sweep(Path(scene), whole, grains, described if len(whole) == len(rows) else None)
    _check(sweep, ranges)
    return sweep


def kept_sweep(scene, folder, grains=None) -> Sweep:
    """The sweep that a folder keeps, to go on with it.

    Args:
        scene: Scene file.
        folder: Of the sweep.
        grains: As of :func:`make_sweep`; None: as the folder says.

    Raises:
        InputError: The folder is that of no sweep, or its runs cannot begin any more.
    """
    kept = _kept(Path(folder) / KEPT)
    place = grains or (None if kept["grains"] is None else Path(kept["grains"]))
    rows = [{key: text for key, text in row.items() if key != "name"} for row in kept["runs"]]
    sweep = Sweep(Path(scene), rows, place, kept["described"])
    _check(sweep, [])
    return sweep


def _check(sweep: Sweep, ranges: list[Range]) -> None:
    """Raise InputError unless each run can begin; its scene and packing are what they have to be.

    Ends of ranges are tried as they are written, so that a unit of another dimension is seen.
    Measured curves that the scene names are read.
    """
    for key in sweep.rows[0]:
        if key.startswith(IDLE):
            raise InputError(
                f"{key} is a parameter, expected one that changes a run: its grains are there "
                f"before, and {PACK}element_size makes them anew"
            )
    for end in ("low", "high"):
        first = sweep.rows[0] | {r.name: getattr(r, end) for r in ranges}
        _check_row(Sweep(sweep.scene, [first], sweep.grains, None), 0)
    for number in range(len(sweep.rows)):
        _check_row(sweep, number)
    for reference in sweep.load(0).references:
        read_reference(reference)


def _check_row(sweep, number):
    loaded, packing = sweep.load(number), sweep.packing(number)
    if packing:
        pack_settings(packing)
        if sweep.grains is not None:
            raise InputError(f"--grains beside {packing[0][0]}, expected one of them")
        return
    place = sweep.grains or loaded.sample.grains
    if place is None:
        raise InputError(
            "sample.grains is missing, expected the folder that `mufe mesh` wrote, --grains, or "
            f"--set {PACK}count=… and so on for packings"
        )
    file_of_grains(place)


def pack_settings(packing):
    """Source, whether spheres are packed, and :class:`PackSettings`, of (name, text) pairs.

    Raises:
        InputError: One is no setting of `mufe pack`, or of another type.
    """
    values = {key.removeprefix(PACK): value_of(text) for key, text in packing}
    source, spheres = values.pop(SOURCE, None), values.pop(SPHERES, False)
    if not isinstance(spheres, bool):
        raise InputError(f"{PACK}{SPHERES} = {shown(spheres)}, expected true or false")
    for name, key in keys_of(PackSettings).items():
        value = values.get(name)  # whole numbers of tables have fractions
        if int in key.kinds and isinstance(value, float) and value.is_integer():
            values[name] = int(value)
    settings = build(PackSettings, values, lambda key: f"{PACK}{key}")
    if settings.count is None and settings.container is None:
        raise InputError(
            f"{PACK}count is missing, expected a number of grains, or {PACK}box or {PACK}cylinder "
            "to fill"
        )
    return source, spheres, settings


def value_of(text):
    """A value of TOML, or the text itself."""
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except ValueError:
        return text


def open_folder(folder, sweep: Sweep, resume: bool) -> None:
    """Make the folder of a sweep, or see that it is that of the same one. Local.

    Raises:
        InputError: It is in use by something else, or by another sweep.
    """
    folder, kept = Path(folder), json.dumps(_identity(sweep), indent=1, ensure_ascii=False) + "\n"
    path = folder / KEPT
    if resume:
        _check_same(path, json.loads(kept))
        return
    check_place(folder)
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        more = ", or --resume to go on with its sweep" if path.exists() else ""
        raise InputError(f"output folder {folder} is not empty, expected a new one{more}")
    folder.mkdir(parents=True, exist_ok=True)
    text = table_text(sweep.rows)
    if text:
        write_atomically(folder / PARAMETERS, text)
    write_atomically(path, kept)


def _identity(sweep):
    return {
        "scene": sweep.scene.read_text(encoding="utf-8-sig"),
        "grains": None if sweep.grains is None else str(sweep.grains.resolve()),
        "described": sweep.described,
        "runs": [{"name": name, **row} for name, row in zip(sweep.names, sweep.rows, strict=True)],
    }


def _check_same(path, now):
    """Raise InputError unless a sweep is the one that a folder keeps."""
    then = _kept(path)
    differs = next((name for name in now if now[name] != then.get(name)), None)
    if differs is not None:
        what = {"scene": "the scene was changed", "grains": "the grains are others"}
        raise InputError(
            f"{what.get(differs, 'the parameters are others')} since the sweep in {path.parent} "
            "began, expected what it began with: another sweep needs a new folder"
        )


def _kept(path):
    """What a folder keeps of its sweep.

    Raises:
        InputError: It keeps none.
    """
    try:
        kept = json.loads(regular(path).read_text(encoding="utf-8"))
        texts = [*kept["runs"][0], kept["grains"] or "", *(kept["described"] or ())]
        texts += [text for row in kept["runs"] for text in row.values()]
        if all(isinstance(text, str) for text in texts):
            return kept
        why = "its values are no texts"
    except (OSError, ValueError, LookupError, TypeError, AttributeError) as error:
        why = reason(error)
    raise InputError(f"{path} cannot be read ({why}), expected the folder of a sweep to resume")
