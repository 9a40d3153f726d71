"""Every command of README and of the pages under docs is run, page by page, as a reader would."""

import re
import shutil

import numpy as np
import pytest

from mufe_fenicsx.analysis.evidence import TABLE
from mufe_fenicsx.contact.laws import LAYERS
from mufe_fenicsx.geometry.bodies.half_ball import half_ball
from mufe_fenicsx.geometry.grains import Grains, save_grains
from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.run.demo import demo_scene
from mufe_fenicsx.scene import (
    Contact,
    Implicit,
    Oedometer,
    Sample,
    Scene,
    Solver,
    scene_to_toml,
)
from mufe_fenicsx.scene.catalogue import MODELS
from tests.docs_pages import (
    ROOT,
    SHELL,
    Reader,
    blocks_of,
    check_mufe,
    command_group,
    commands_in,
    mufe_part,
    pages,
)
from tests.docs_programs import write_programs

BLOCKS, UNREADABLE = {}, []
for path in pages():
    page = str(path.relative_to(ROOT))
    try:
        BLOCKS[page] = blocks_of(path.read_text(encoding="utf-8"), page)
    except ValueError as error:
        UNREADABLE.append(str(error))
ALL = [block for blocks in BLOCKS.values() for block in blocks]

#: What makes the demonstration's scene small: eight balls instead of its image, and little strain.
SMALLER = {
    r'file = "spam:snow".*': 'file = "scan.npy"',
    r"crop = .*\n": "",
    r"upsample = .*\n": "",
    r'size = "40 um".*': 'size = "120 um"\nprocesses = 1',
    r"strain = 0.1 .*": "strain = 0.004",
    r'speed = "1 m/s".*': 'speed = "40 m/s"',
    r"ramp = .*": "ramp = 0.001",
    r"fields = .*": "fields = 4",
    r"history = .*": "history = 21",
}


def write_half_balls(folder):
    """Scenes of two half balls between planes: static, and by time steps to a smaller strain."""
    (low, cells), (top, cells2) = (
        half_ball(1e-4, 5e-5, direction=(0, 0, side), growth=0.5) for side in (1, -1)
    )
    top[:, 2] += low[:, 2].max() - top[:, 2].min()
    save_grains(folder / "halves", Grains.from_list([1, 2], [(low, cells), (top, cells2)], 5e-5))
    for name, strain, integrator in (
        ("scene.toml", 0.005, "static"),
        ("settle.toml", 0.002, "explicit"),
        ("load.toml", 0.003, "static"),
    ):
        scene = Scene(
            material=Elastic(1e9, 0.15, 2650.0),
            contact=Contact(0.23, wall_friction=0.5),
            oedometer=Oedometer(strain=strain, speed=0.5, seating_stress=1e4, ramp=1e-3),
            sample=Sample(grains="halves", separation=False),
            solver=Solver(integrator=integrator, element="p1"),
            implicit=Implicit(step=1e-3, largest=2.5e-3),
        )
        (folder / name).write_text(scene_to_toml(scene), encoding="utf-8")


def small_scene():
    text = demo_scene().read_text(encoding="utf-8")
    for pattern, value in SMALLER.items():
        text, number = re.subn(pattern, value, text)
        assert number == 1, f"{pattern} is in the demonstration's scene {number} times"
    return text


@pytest.fixture(scope="module")
def start(tmp_path_factory):
    """What a reader has: a scan, the demos, a scene, and the labels, grains and results of it."""
    bin_folder = write_programs(tmp_path_factory.mktemp("programs") / "bin")
    folder = tmp_path_factory.mktemp("start")
    (folder / ".venv" / "bin").mkdir(parents=True)
    (folder / ".venv" / "bin" / "activate").touch()  # the programs are on PATH already
    shutil.copytree(ROOT / "demos", folder / "demos")
    (folder / "demos" / demo_scene().name).write_text(small_scene(), encoding="utf-8")
    (folder / "mine.toml").write_text(small_scene(), encoding="utf-8")
    grey = np.full((36, 36, 36), 60, np.uint8)
    z, y, x = np.indices(grey.shape) % 18 - 8.5
    grey[z * z + y * y + x * x < 8.9**2] = 180
    np.save(folder / "scan.npy", grey)
    reader = Reader(folder, bin_folder)
    reader.run(
        blocks_of(
            "```sh\n"
            "mufe segment --scene mine.toml -o labels.tif\n"
            "mufe mesh labels.tif --scene mine.toml -o grains\n"
            "mufe run mine.toml --grains grains -o results --quiet\n"
            "mufe export spam labels.tif -o spam\n```\n",
            "start",
        )[0]
    )
    write_half_balls(folder)
    # A table as SPAM writes it (tests/peers holds both equal), and what was charted before.
    np.save(folder / "contactTable.npy", np.loadtxt(folder / "spam" / "contactTable.txt"))
    (folder / "charts").mkdir()
    shutil.copy(TABLE, folder / "charts" / "points.csv")
    return folder, bin_folder


def go_through(page, start, tmp_path, monkeypatch, patient):
    monkeypatch.setenv("MPLBACKEND", "Agg")
    folder = tmp_path / "page"
    shutil.copytree(start[0], folder)
    reader = Reader(folder, start[1], patient)
    if not patient:  # this process has its libraries loaded
        monkeypatch.setattr("mufe_fenicsx.report.write.num_processes", lambda num_cells: 1)
        monkeypatch.setattr("mufe_fenicsx.report.source.Source.start_probe", lambda source: None)
        monkeypatch.setattr("mufe_fenicsx.report.source.Source._probe", None, raising=False)
    # What a page registers is of that page.
    registered = [(names, dict(names)) for names in (MODELS, LAYERS)]
    try:
        for block in BLOCKS[page]:
            if block.reason is None and (patient or not block.later):
                reader.run(block)
            else:
                check_options_of(block)
    finally:
        for names, before in registered:
            names.clear()
            names.update(before)


def test_every_fence_is_understood():
    assert not UNREADABLE, "\n".join(UNREADABLE)


@pytest.mark.parametrize("page", [page for page, blocks in BLOCKS.items() if blocks])
def test_blocks_of_a_page(page, start, tmp_path, monkeypatch):
    go_through(page, start, tmp_path, monkeypatch, patient=False)


@pytest.mark.slow
@pytest.mark.parametrize(
    "page", [p for p, blocks in BLOCKS.items() if any(b.slow or b.later for b in blocks)]
)
def test_blocks_of_a_page_with_all_steps(page, start, tmp_path, monkeypatch):
    go_through(page, start, tmp_path, monkeypatch, patient=True)


def check_options_of(block):
    """See that the `mufe` commands of a block that is not run have their options."""
    if block.language in SHELL:
        for words in commands_in(block.text):
            if (arguments := mufe_part(words)) is not None:
                check_mufe(arguments)


def test_commands_stand_in_fences():
    """Those in indented lines would be run by nobody; but `make`, whose targets exist."""
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    wrong = []
    for path in pages():
        text = re.sub(r"^ *```.*?^ *```", "", path.read_text(encoding="utf-8"), flags=re.S | re.M)
        for program, word in re.findall(r"^    (mufe|python|mpirun|make) +(\S+)", text, re.M):
            if program != "make" or word not in targets:
                wrong.append(f"{path.name}: {program} {word}")
    assert not wrong, f"expected these in fences: {wrong}"


@pytest.mark.parametrize("block", [b for b in ALL if b.reason is not None], ids=lambda b: b.place)
def test_a_block_that_is_not_run(block):
    """Its commands exist with these options; the summary of the tests lists it as skipped."""
    assert block.reason, f"{block.place}: expected a reason"
    check_options_of(block)
    pytest.skip(f"{block.place} is not run: {block.reason}")


def test_commands_within_sentences():
    """`mufe …`, `make …` and demos that the text names exist, with these options."""
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    wrong = []
    for path in pages():
        text = re.sub(r"^ *```.*?^ *```", "", path.read_text(encoding="utf-8"), flags=re.S | re.M)
        for span in re.findall(r"`((?:mufe|make|python demos/)[^`\n]*)`", text):
            words = span.split()
            if "…" in span or len(words) == 1 or not re.fullmatch(r"[a-z-]+", words[1]):
                names = re.findall(r"demos/\w+\.py", span)
                wrong += [f"{path.name}: {name}" for name in names if not (ROOT / name).exists()]
            elif words[0] == "make" and words[1] not in targets:
                wrong.append(f"{path.name}: {span}")
            elif words[0] == "mufe":
                try:
                    known = [w for w in words[1:] if w.startswith("--") and w != "--set"]
                    check_options(words[1:], known)
                except AssertionError as error:
                    wrong.append(f"{path.name}: {span}: {error}")
    assert not wrong, "\n".join(wrong)


def check_options(words, options):
    command = command_group()
    for name in words:
        if not hasattr(command, "commands"):
            break
        command = command.commands.get(name, command.commands.get("mesh"))
        assert command is not None, f"no command {name}"
    known = {o for p in command.params for o in (*p.opts, *p.secondary_opts)} | {"--help"}
    unknown = [option for option in options if option.split("=")[0] not in known]
    assert not unknown, f"no option {', '.join(unknown)}"


def test_links_between_pages_lead_somewhere():
    wrong = []
    for path in [*pages(), *sorted((ROOT / "demos").glob("*.md"))]:
        text = re.sub(r"```.*?```|`[^`]*`", "", path.read_text(encoding="utf-8"), flags=re.S)
        for target in re.findall(r"\]\(([^)#\s]+)[^)]*\)", text):
            if "://" not in target and not (path.parent / target).exists():
                wrong.append(f"{path.relative_to(ROOT)}: {target}")
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize(
    "text, message",
    [
        ("```sh\nmufe run nowhere.toml --grains grains -o new\n```", "(?s)page:2: .*status 2"),
        ("```sh\nfor a in b; do mufe run $a.toml -o new; done\n```", "(?s)page:2: .*status 2"),
        ("```sh\nls nowhere | cat\nfalse\n```", "(?s)page:2: .*status 1"),
        ("```python\nassert run is None\n```", "page:2: NameError"),
        ("```toml\n[oedometer]\nspeed = -1\n```", "page:2: InputError: oedometer.speed = -1"),
    ],
)
def test_a_block_that_fails_is_named(text, message, tmp_path):
    reader = Reader(tmp_path, write_programs(tmp_path / "bin"))
    with pytest.raises(AssertionError, match=message):
        reader.run(blocks_of(text, "page")[0])


def test_marks():
    text = "<!-- test: not run: no cluster here -->\n```sh\nsrun mufe run a.toml\n```\n"
    (block,) = blocks_of(text, "page")
    assert block.reason == "no cluster here"
    text = "<!-- test: slow; needs no-such-program, sh -->\n```sh\nls\n```\n"
    (block,) = blocks_of(text, "page")
    assert block.slow and block.reason == "needs no-such-program, not installed here"
    with pytest.raises(ValueError, match='mark "sometimes"'):
        blocks_of("<!-- test: sometimes -->\n```sh\nls\n```\n", "page")
    with pytest.raises(ValueError, match="a fence in fish"):
        blocks_of("```fish\nls\n```\n", "page")
    with pytest.raises(Exception, match="No such option"):
        check_mufe(["run", "a.toml", "--fast"])
