"""Fenced blocks of the documentation, and how a reader would run them.

A line such as `<!-- test: slow -->` before a block says how it is treated:

    slow              it takes minutes: left to `make verify`
    not run: REASON   it cannot run here; its `mufe` commands are still read, and it is listed

Scripts that begin with `#SBATCH` lines are not run either, for want of a batch system.
"""

import contextlib
import itertools
import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path

import typer

import mufe_fenicsx
from mufe_fenicsx.cli import app, main
from mufe_fenicsx.launcher import find_mpirun
from mufe_fenicsx.scene import load_scene

ROOT = Path(__file__).resolve().parents[1]
SHELL, PYTHON, TOML = ("sh", "bash", "shell"), ("python",), ("toml",)
#: Fences whose text is read, not run.
SHOWN = ("", "text", "csv", "json", "c")
#: Longest time of one command [s].
PATIENCE = 240

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
    """README and all pages under docs, as paths."""
    generated = ROOT / "docs" / "api"
    found = sorted(p for p in (ROOT / "docs").rglob("*.md") if generated not in p.parents)
    return [ROOT / "README.md", *found]


@dataclass(frozen=True)
class Block:
    """A fenced block of a page."""

    page: str  #: relative to the root
    line: int  #: of its first line of text
    language: str
    text: str
    mark: str  #: what stands in its mark; "" where it has none

    @property
    def place(self):
        return f"{self.page}:{self.line}"

    @property
    def reason(self):
        """Why it is not run; None where it is."""
        if self.mark.startswith("not run"):
            return self.mark.partition(":")[2].strip()
        return "a script for a batch system" if "#SBATCH" in self.text else None

    @property
    def slow(self):
        return self.mark == "slow"


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
            block = Block(page, number + 1, language, "\n".join(body) + "\n", mark)
            if mark and not block.slow and not block.reason:
                raise ValueError(
                    f'{page}:{number}: mark "{mark}", expected slow or not run: REASON'
                )
            found.append(block)
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


def check_mufe(words):
    """See that a `mufe` command has these options and arguments; nothing is run.

    Raises:
        click's UsageError: it has not.
    """
    group = typer.main.get_command(app)
    name, *arguments = words
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
        bin_folder: Folder with `mufe` and `python`.
    """

    def __init__(self, folder, bin_folder):
        self.folder = folder
        self.names = {"mufe_fenicsx": mufe_fenicsx, "__name__": "__main__"}
        path = [str(bin_folder), str(Path(find_mpirun() or "/").parent), os.environ["PATH"]]
        self.environment = {
            **os.environ,
            "PATH": os.pathsep.join(path),
            "PYTHONPATH": os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")]),
            "OMP_NUM_THREADS": "1",
        }

    def run(self, block):
        """Run a block; raises AssertionError with its place where it fails."""
        try:
            with contextlib.chdir(self.folder):
                if block.language in SHELL:
                    self._shell(block.text)
                elif block.language in PYTHON:
                    exec(compile(block.text, block.place, "exec"), self.names)
                else:
                    self._scene(block.text)
        except Exception as error:
            raise AssertionError(f"{block.place}: {type(error).__name__}: {error}") from error

    def _shell(self, text):
        commands = commands_in(text)
        for words in commands:
            self._make_room(mufe_part(words))
        if SYNTAX.search(re.sub(r"#.*|'[^']*'|\"[^\"$]*\"", "", text)):
            self._process(["bash", "-euc", text])
            return
        for words in commands:
            self._make_room(mufe_part(words))
            if words[0] == "mufe" and "--resume" in words:  # of a test that was stopped
                stopped = [word for word in words[1:] if word != "--resume"]
                self._make_room(stopped)
                self._here([*stopped, "--max-steps", "20", "--quiet"])
            if words[0] == "mufe":
                self._here(words[1:])
            else:
                # bash, for `source`, `cd` and the like; a page needs none that outlive a line.
                self._process(["bash", "-euc", shlex.join(words)])

    def _make_room(self, arguments):
        """Results of an earlier block with the same name go: blocks of a page are alternatives."""
        if arguments is None or "--resume" in arguments or "--overwrite" in arguments:
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
        try:
            main(arguments)
        except SystemExit as end:
            assert not end.code, f"mufe {shlex.join(arguments)} ended with status {end.code}"

    def _process(self, command):
        done = subprocess.run(
            command, env=self.environment, stdin=subprocess.DEVNULL, timeout=PATIENCE,
            capture_output=True, text=True,
        )  # fmt: skip
        assert done.returncode == 0, f"{command[-1]}: status {done.returncode}\n{done.stderr}"

    def _scene(self, text):
        """A scene, or tables of one: it is read, with the rest from ``SCENE``."""
        tables = {name: dict(table) for name, table in SCENE.items()}
        found = tomllib.loads(text)
        if "stage" in found:  # another test than the oedometer's
            del tables["oedometer"]
            tables["loading"] = {"speed": 1.0}
        for name, given in found.items():
            whole = not isinstance(given, dict) or (name == "material" and "model" in given)
            tables[name] = given if whole else {**tables.get(name, {}), **given}
        path = self.folder / "fragment.toml"
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


def write_programs(folder):
    """`mufe` and `python` as programs that use this Python and this source tree."""
    folder.mkdir()
    for name, module in (("mufe", "-m mufe_fenicsx "), ("python", "")):
        program = folder / name
        program.write_text(f'#!/bin/sh\nexec "{sys.executable}" {module}"$@"\n')
        program.chmod(0o755)
    return folder
