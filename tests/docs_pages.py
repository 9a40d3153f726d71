"""Fenced blocks of the documentation, and how a reader would run them.

A line such as `<!-- test: slow -->` before a block says how it is treated:

    slow              a reader waits for minutes: its `mufe run` get `--max-steps`, its `mufe pack`
                      few grains, and one process does what `mpirun` is to share among several
    later             only `make verify` runs it; its `mufe` commands are still read
    needs PROGRAM     it runs where that program is installed, and is listed elsewhere
    as FILE           of TOML: it is a whole scene, kept as FILE; of Python: all Python of the page
                      up to here becomes FILE
    not run: REASON   it cannot run here; its `mufe` commands are still read, and it is listed

Several marks are parted by semicolons. Of a report of one run one figure is drawn. `make verify`
runs pages with slow blocks once more, with all steps and figures. Slurm's `sbatch`, `srun` and
`scontrol` are imitated, on one rank; `apt install` is simulated.
"""

import contextlib
import functools
import itertools
import os
import re
import shlex
import shutil
import tomllib
from dataclasses import dataclass
from pathlib import Path

import typer

import mufe_fenicsx
from mufe_fenicsx.cli.main import app, main
from mufe_fenicsx.machine.mpi_launcher import find_mpirun
from mufe_fenicsx.scene import load_scene
from tests.docs_programs import lacking, run_command

ROOT = Path(__file__).resolve().parents[1]
SHELL, PYTHON, TOML = ("sh", "bash", "shell"), ("python",), ("toml",)
#: Fences whose text is read, not run.
SHOWN = ("", "text", "csv", "json", "c")
#: Steps of a run in a block that is slow.
FEW_STEPS = 400
#: Grains of a packing in a block that is slow.
FEW_GRAINS = 8
#: Figures of a report of one run; the tests of the report draw all of them.
FEW_FIGURES = ("--only", "stress-strain")
#: `mufe` in a pipe or a substitution, or with its output sent elsewhere.
HEARD = re.compile(r"\bmufe\b[^\n#]*[|>]|\$\(\s*mufe")

FENCE = re.compile(r"^( *)(`{3,}|~{3,})\s*([^\s`]*)")
MARK = re.compile(r"<!--\s*test:\s*(.*?)\s*-->")
#: What a plain command line has none of; with one of these, bash runs the whole block.
SYNTAX = re.compile(r"[|<>;&$`(){}]|^\s*(for|if|while|export|set)\b", re.MULTILINE)

#: The scene that fragments of one are put into.
SCENE = {
    "material": {"model": "elastic", "E": 100e9, "nu": 0.15, "rho": 2650},
    "contact": {"friction": 0.23},
    "oedometer": {"strain": 0.1, "speed": 2.0},
}


def pages():
    """README and all pages under docs but the record, whose commands are those of its dates."""
    left_out = {ROOT / "docs" / "api", ROOT / "docs" / "record"}
    found = sorted(p for p in (ROOT / "docs").rglob("*.md") if not left_out & {*p.parents})
    return [ROOT / "README.md", *found]


@dataclass(frozen=True)
class Block:
    """A fenced block of a page."""

    page: str  #: relative to the root
    line: int  #: of its first line of text
    language: str
    text: str
    slow: bool = False
    later: bool = False  #: than `make test`
    needs: tuple = ()  #: programs
    file: str = ""  #: that it becomes
    excuse: str | None = None  #: why it is never run

    @property
    def place(self):
        return f"{self.page}:{self.line}"

    @property
    def reason(self):
        """Why it is not run here; None where it is."""
        if self.excuse is not None:
            return self.excuse
        absent = [program for program in self.needs if lacking(program)]
        return f"needs {', '.join(absent)}, not installed here" if absent else None


def marks_of(text):
    """Fields of a :class:`Block` that a mark stands for.

    Raises:
        ValueError: it is no mark.
    """
    if text.startswith("not run"):
        return {"excuse": text.partition(":")[2].strip()}
    found = {}
    for mark in filter(None, text.split(";")):
        name, _, value = mark.strip().partition(" ")
        if name in ("slow", "later") and not value:
            found[name] = True
        elif name == "needs" and value:
            found["needs"] = tuple(value.split(", "))
        elif name == "as" and value:
            found["file"] = value
        else:
            raise ValueError(
                f'mark "{mark}", expected slow, later, needs PROGRAM, as FILE or not run: REASON'
            )
    return found


def blocks_of(text, page):
    """Blocks of a page that are shell, Python or TOML.

    Raises:
        ValueError: a fence without end, in an unknown language, or with an unknown mark.
    """
    found, mark, lines = [], "", iter(enumerate(text.splitlines(), start=1))
    for number, line in lines:
        fence = FENCE.match(line)
        if not fence:
            if line.strip():
                given = MARK.fullmatch(line.strip())
                mark = given.group(1) if given else ""
            continue
        indent, ticks, language = fence.groups()
        body, end = [], re.compile(rf"^ *{ticks[0]}{{{len(ticks)},}}\s*$")
        for _, inner in lines:
            if end.match(inner):
                break
            body.append(inner.removeprefix(indent))
        else:
            raise ValueError(f"{page}:{number}: the fence has no end")
        if language in (*SHELL, *PYTHON, *TOML):
            try:
                marks = marks_of(mark)
            except ValueError as error:
                raise ValueError(f"{page}:{number}: {error}") from error
            found.append(Block(page, number + 1, language, "\n".join(body) + "\n", **marks))
        elif language not in SHOWN and not language.startswith("{"):
            raise ValueError(f"{page}:{number}: a fence in {language}, expected one of "
                             f"{', '.join((*SHELL, *PYTHON, *TOML, *SHOWN[1:]))}")  # fmt: skip
        mark = ""
    return found


def commands_in(text):
    """Command lines of a shell block as lists of words, comments and line ends taken out."""
    lines = re.sub(r"\\\n", " ", text).splitlines()
    words = [shlex.split(line, comments=True) for line in lines if not line.startswith("#!")]
    return [found for found in words if found]


@functools.cache
def command_group():
    """`mufe` as the library that reads its arguments has it."""
    return typer.main.get_command(app)


def check_mufe(words):
    """See that a `mufe` command has these options and arguments; nothing is run.

    Raises:
        click's UsageError: it has not.
    """
    group = command_group()
    name, *arguments = words
    if name.startswith("-"):  # options of the program itself
        group.make_context("mufe", words, resilient_parsing=True)
        return
    context = group.make_context("mufe", [name, *arguments], resilient_parsing=True)
    command = group.get_command(context, name)
    assert command is not None, f"mufe {name} is no command"
    if "--help" not in arguments:
        command.make_context(f"mufe {name}", arguments)


def mufe_part(words):
    """The words after `mufe` in a command line, also behind mpirun or srun; None without."""
    if "mufe" not in words or words[0] not in ("mufe", "mpirun", "srun", "mpiexec"):
        return None
    return words[words.index("mufe") + 1 :]


class Reader:
    """Someone who goes through a page, in a folder of its own.

    Args:
        folder: The folder, which has what the pages start from.
        bin_folder: Folder with the programs of :func:`~tests.docs_programs.write_programs`.
        patient: Slow runs take all their steps, reports have all figures.
    """

    def __init__(self, folder, bin_folder, patient=False):
        self.folder, self.patient, self.few = folder, patient, False
        self.names = {"mufe_fenicsx": mufe_fenicsx, "__name__": "__main__"}
        self.python = []
        path = [str(bin_folder), str(Path(find_mpirun() or "/").parent), os.environ["PATH"]]
        self.environment = {
            **os.environ,
            "PATH": os.pathsep.join(path),
            "PYTHONPATH": os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")]),
            "OMP_NUM_THREADS": "1",
        }

    def run(self, block):
        """Run a block; raises AssertionError with its place where it fails."""
        self.few = block.slow and not self.patient
        try:
            with contextlib.chdir(self.folder):
                if block.language in SHELL:
                    self._shell(block.text)
                elif block.language in PYTHON:
                    self._python(block)
                else:
                    self._scene(block)
        except Exception as error:
            raise AssertionError(f"{block.place}: {type(error).__name__}: {error}") from error

    def _python(self, block):
        self.python.append(block.text)
        if block.file:
            Path(block.file).write_text("\n\n".join(self.python), encoding="utf-8")
        elif block.needs:  # in that program's own Python
            Path("block.py").write_text(block.text, encoding="utf-8")
            self._process(shlex.join([*block.needs, "block.py"]))
        else:
            exec(compile(block.text, block.place, "exec"), self.names)

    def _shell(self, text):
        commands = commands_in(text)
        for words in commands:
            self._make_room(mufe_part(words))
        if "#SBATCH" in text or SYNTAX.search(re.sub(r"#.*|'[^']*'|\"[^\"$]*\"", "", text)):
            self._process(text)
            return
        written = set()
        for words in commands:
            self._make_room(mufe_part(words))
            if self.few and words[0] == "mpirun" and "mufe" in words:
                words = words[words.index("mufe") :]
            if words[0] == "mufe":
                folder = words[words.index("-o") + 1] if "-o" in words else None
                if "--resume" in words and folder not in written:  # of a test that was stopped
                    stopped = [word for word in words[1:] if word != "--resume"]
                    self._make_room(stopped)
                    self._here([*stopped, "--max-steps", "20", "--quiet"])
                written.add(folder)
                self._here(words[1:])
            else:
                # bash, for `source`, `cd` and the like; a page needs none that outlive a line.
                self._process(shlex.join(words))

    def _make_room(self, arguments):
        """Results of an earlier block with the same name go: blocks of a page are alternatives."""
        if arguments is None or {"--resume", "--overwrite", "chart"} & set(arguments):
            return
        for flag, value in itertools.pairwise(arguments):
            if flag in ("-o", "--output"):
                path = self.folder / value
                assert path.resolve().is_relative_to(self.folder.resolve())
                if path.is_dir():
                    shutil.rmtree(path)
                elif path.suffix:  # and what stands beside it, as labels.csv beside labels.tif
                    for beside in path.parent.glob(f"{path.stem}[._]*"):
                        beside.unlink()

    def _here(self, arguments):
        """`mufe` in this process, which has its libraries loaded."""
        if self.few and arguments[0] == "run" and "--max-steps" not in arguments:
            arguments = [*arguments, "--max-steps", str(FEW_STEPS)]
            if "seating_at_rest = true" in Path(arguments[1]).read_text(encoding="utf-8"):
                # To come to rest takes too many.
                arguments = [*arguments, "--set", "oedometer.seating_at_rest=false"]
        if self.few and arguments[0] == "pack":
            at = arguments.index("--count") + 1
            arguments = [*arguments[:at], str(FEW_GRAINS), *arguments[at + 1 :]]
        status = self._status(arguments)
        assert not status, f"mufe {shlex.join(arguments)} ended with status {status}"

    def _status(self, arguments):
        of_one_run = arguments[0] == "report" and all(a.startswith("-") for a in arguments[2:3])
        if of_one_run and not self.patient:
            arguments = [*arguments, *FEW_FIGURES]
        try:
            main(arguments)
        except SystemExit as end:
            return end.code or 0
        return 0

    def _process(self, text):
        """Lines of a shell; their `mufe` is this process unless something listens to it."""
        environment = dict(self.environment)
        if self.few:
            environment["MUFE_FEW_STEPS"] = str(FEW_STEPS)
        status, errors = run_command(
            ["bash", "-euc", text], environment, None if HEARD.search(text) else self._status
        )
        assert status == 0, f"{text}: status {status}\n{errors}"

    def _scene(self, block):
        """A scene, or tables of one: it is read, with the rest from ``SCENE``."""
        found = tomllib.loads(block.text)
        tables = {name: dict(table) for name, table in SCENE.items()}
        if "stage" in found:  # another test than the oedometer's
            del tables["oedometer"]
            tables["loading"] = {"speed": 1.0}
        self._write_scene("fragment.toml", tables, found)
        if block.file:  # a reader copies it as it stands
            Path(block.file).write_text(block.text, encoding="utf-8")
            load_scene(block.file)

    def _write_scene(self, name, tables, found):
        for table, given in found.items():
            whole = not isinstance(given, dict) or (table == "material" and "model" in given)
            tables[table] = given if whole else {**tables.get(table, {}), **given}
        path = self.folder / name
        path.write_text("\n".join(as_toml(tables)), encoding="utf-8")
        load_scene(path)


def as_toml(tables, prefix=""):
    """Lines of TOML for nested dicts of numbers, texts and lists."""
    plain = {k: v for k, v in tables.items() if not _is_table(v)}
    yield from (f"{key} = {_value(value)}" for key, value in plain.items())
    for key, value in tables.items():
        if isinstance(value, dict):
            yield f"[{prefix}{key}]"
            yield from as_toml(value, f"{prefix}{key}.")
        elif _is_table(value):
            for one in value:
                yield f"[[{prefix}{key}]]"
                yield from as_toml(one, f"{prefix}{key}.")


def _is_table(value):
    return isinstance(value, dict) or (
        isinstance(value, list) and bool(value) and all(isinstance(one, dict) for one in value)
    )


def _value(value):
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list):
        return "[" + ", ".join(map(_value, value)) + "]"
    return (
        '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
        if isinstance(value, str)
        else repr(value)
    )
