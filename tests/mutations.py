"""What the tests catch: `python -m tests.mutations OUTPUT.csv [--before TREE]`.

One line of the package at a time is changed in a copy of this tree: a sign, a factor, an index, a
number by one. Then the files of tests run that pass through it, which one run of all finds out at
first, until a test fails. Of lines in compiled loops, and of constants, all files count. With
`--before`, another checkout, lines that stand in both are taken; what this suite misses is tried
against files of the same names there, where they differ.

Rows stand in the output as they are found; numbers that have one are not tried again.
"""

import argparse
import ast
import contextlib
import csv
import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from threading import Lock

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = "mufe_fenicsx"
KINDS = ("sign", "factor", "index", "off by one")
#: Folders with the laws and loops have more lines tried than the others.
WEIGHTS = {"kernels": 4, "contact": 3, "bulk": 2, "explicit": 2, "implicit": 2, "loading": 2}
#: Cases of verification are tests themselves.
LEFT_OUT = {"verification"}
OPTIONS = ("-x", "-q", "-p", "no:cacheprovider", "-o", "addopts=")
#: A test that takes longer hangs, which is noticed [s].
LIMIT = 300
#: In the column of the suite before, where that was not asked.
NOT_TRIED = "not tried"
COLUMNS = ("number", "place", "kind", "before", "after", "caught_by", "caught_before_by")


@dataclass(frozen=True)
class Mutation:
    """A change of one line."""

    file: str  #: relative to the root
    line: int  #: its number, from 0
    kind: str
    before: str
    after: str

    @property
    def room(self):
        """Folder of the package."""
        parts = Path(self.file).parts
        return parts[1] if len(parts) > 2 else ""

    def apply(self, tree):
        """Change the line in a tree, wherever it stands there; a function that restores it."""
        path = tree / self.file
        text = path.read_text(encoding="utf-8")
        lines = text.split("\n")
        lines[lines.index(self.before)] = self.after
        path.write_text("\n".join(lines), encoding="utf-8")
        return lambda: path.write_text(text, encoding="utf-8")


def mutations_of(path, text):
    """All changes of a file that are tried."""
    lines = text.split("\n")
    found = _in_python(text) if path.endswith(".py") else _in_c(lines)
    for line, start, end, kind, new in found:
        before = lines[line]
        if lines.count(before) == 1:  # found again in the other tree
            yield Mutation(path, line, kind, before, before[:start] + new + before[end:])


def _in_python(text):
    """(line, first column, last column, kind, new text) of each place."""
    lines = text.split("\n")
    subscripts = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Subscript):
            subscripts |= {id(n) for n in ast.walk(node.slice) if isinstance(n, ast.Constant)}
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add | ast.Sub):
            left, right = node.left, node.right
            texts = any(isinstance(n, ast.Constant | ast.JoinedStr) and not _number(n)
                        for n in (left, right))  # fmt: skip
            if left.end_lineno == right.lineno and not texts:
                between = lines[right.lineno - 1][left.end_col_offset : right.col_offset]
                sign = "+" if isinstance(node.op, ast.Add) else "-"
                at = left.end_col_offset + between.index(sign)
                yield right.lineno - 1, at, at + 1, "sign", "-" if sign == "+" else "+"
        if _number(node):
            place = node.lineno - 1, node.col_offset, node.end_col_offset
            if isinstance(node.value, float) and node.value:
                yield *place, "factor", repr(2.0 * node.value)
            elif isinstance(node.value, int):
                yield *place, "off by one", str(node.value + 1)
    tree = ast.parse(text)
    for node in ast.walk(tree):
        if isinstance(node, ast.Subscript):
            for n in ast.walk(node.slice):
                if _number(n) and isinstance(n.value, int):
                    new = str(n.value - 1 if n.value else 1)
                    yield n.lineno - 1, n.col_offset, n.end_col_offset, "index", new


def _number(node):
    kind = getattr(node, "value", None)
    return isinstance(node, ast.Constant) and isinstance(kind, int | float) and kind not in (
        True, False)  # fmt: skip


def _in_c(lines):
    """The same of C, by its signs alone."""
    patterns = (
        ("sign", re.compile(r"(?<=[\w)\]] )[+-](?= [\w(])"), lambda s: "-" if s == "+" else "+"),
        ("factor", re.compile(r"\b\d+\.\d+\b"), lambda s: repr(2.0 * float(s) or 1.0)),
        ("index", re.compile(r"(?<=\[)\d(?=\])"), lambda s: str((int(s) + 1) % 3)),
        ("off by one", re.compile(r"(?<= )<=?(?= )"), lambda s: "<=" if s == "<" else "<"),
    )
    comment = False
    for number, line in enumerate(lines):
        comment = comment or line.lstrip().startswith("/*")
        if not comment and not line.lstrip().startswith(("//", "#")):
            code = line.partition("//")[0].partition("/*")[0]
            for kind, pattern, new in patterns:
                for match in pattern.finditer(code):
                    yield number, match.start(), match.end(), kind, new(match[0])
        comment = comment and "*/" not in line


def choose(trees, count, seed):
    """That many changes across folders and kinds, the same for the same seed and trees."""
    by_room = {}
    for path in sorted((trees[0] / PACKAGE).rglob("*")):
        name = str(path.relative_to(trees[0]))
        if path.suffix not in (".py", ".c", ".h") or not all((t / name).exists() for t in trees):
            continue
        others = [(t / name).read_text(encoding="utf-8").split("\n") for t in trees[1:]]
        for found in mutations_of(name, path.read_text(encoding="utf-8")):
            if found.room not in LEFT_OUT | {""} and all(found.before in o for o in others):
                by_room.setdefault(found.room, []).append(found)
    dice, chosen, lines = random.Random(seed), [], set()
    rooms = [room for room in sorted(by_room) for _ in range(WEIGHTS.get(room, 1))]
    while len(chosen) < count:
        dice.shuffle(rooms)
        for room in rooms[: count - len(chosen)]:
            kind = KINDS[len(chosen) % len(KINDS)]
            some = [m for m in by_room[room] if m.kind == kind] or by_room[room]
            found = dice.choice(some)
            if (found.file, found.line) not in lines:
                lines.add((found.file, found.line))
                chosen.append(found)
    return chosen


def find_reached(chosen, folder):
    """{number of a change: files of tests that pass through its line}, by one run of all tests."""
    lines = {}
    for mutation in chosen:
        lines.setdefault(str(ROOT / mutation.file), []).append(mutation.line + 1)
    wanted = folder / "lines.json"
    wanted.write_text(json.dumps(lines), encoding="utf-8")
    environment = os.environ | {"REACHED_LINES": str(wanted), "REACHED_TO": str(folder)}
    command = [sys.executable, "-m", "tests", "-p", "tests.reached"]
    subprocess.run(command, cwd=ROOT, env=environment, stdin=subprocess.DEVNULL)
    found = {}
    for path in set(folder.glob("*.json")) - {wanted}:
        for file, line, test in json.loads(path.read_text(encoding="utf-8")):
            found.setdefault((file, line), set()).add(test)
    return {
        number: sorted(found.get((str(ROOT / m.file), m.line + 1), ()))
        for number, m in enumerate(chosen)
    }


def files_for(tree, mutation, reached):
    """Files of tests for a change, those first that are near to it."""
    module = Path(mutation.file).stem
    everything = sorted(str(p.relative_to(tree)) for p in (tree / "tests").rglob("test_*.py"))
    files = [name for name in everything if not reached or name in reached]

    def distance(name):
        here = mutation.room in Path(name).parts
        text = (tree / name).read_text(encoding="utf-8")
        return 2 - here - (re.search(rf"\b{module}\b", text) is not None)

    return sorted(files, key=distance)


def caught_by(tree, mutation, files):
    """First test that fails in a tree with a change, and passes without; "" if none does."""
    marked = [f for f in files if "mark.mpi" in (tree / f).read_text(encoding="utf-8")]
    python = [sys.executable, "-m"]
    mpirun = [str(Path(sys.executable).with_name("mpirun")), "-n", "3", *python, "mpi4py", "-m"]
    one = [*python, "pytest", *OPTIONS, "-m", "not slow"]
    three = [*mpirun, "pytest", *OPTIONS, "-m", "mpi and not slow"]
    for command, those in ((one, files), (three, marked)):
        failing = []  # also without a change
        while those:
            restore = mutation.apply(tree)
            try:
                left = [f"--deselect={name}" for name in failing]
                found = _first_failure(tree, [*command, *left, *those])
            finally:
                restore()
            if "::" not in found or not _first_failure(tree, [*command, found]):
                break
            failing.append(found)
        if those and found:
            return found
    return ""


def _first_failure(tree, command):
    environment = {**os.environ, "PYTHONPATH": str(tree), "OMP_NUM_THREADS": "1"}
    environment |= {"MPIR_CVAR_ENABLE_HEAVY_YIELD": "1"}
    with tempfile.TemporaryFile("w+") as output:
        running = subprocess.Popen(
            command, cwd=tree, env=environment, stdout=output, stderr=subprocess.STDOUT,
            stdin=subprocess.DEVNULL, start_new_session=True,
        )  # fmt: skip
        told = -1
        while running.poll() is None:
            with contextlib.suppress(subprocess.TimeoutExpired):
                running.wait(LIMIT)
            told, before = os.fstat(output.fileno()).st_size, told
            if running.returncode is None and told == before:
                os.killpg(running.pid, signal.SIGKILL)
                running.wait()
                return "none ends"
        if running.returncode in (0, 5):  # 5: no test is left
            return ""
        output.seek(0)
        text = output.read()
    named = re.search(r"^(?:FAILED|ERROR) (.+?)(?: - |$)", text, re.MULTILINE)
    return named[1] if named else f"status {running.returncode}"


def copy_of(tree, folder):
    """What git knows of a tree, with its compiled loops, in a folder."""
    names = subprocess.run(
        ["git", "ls-files"], cwd=tree, capture_output=True, text=True, check=True
    ).stdout.splitlines()
    loops = [str(p.relative_to(tree)) for p in (tree / PACKAGE).rglob("*.nb[ic]")]
    for name in [*names, *loops]:
        to = folder / name
        to.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(tree / name, to)
    return folder


def _differs(name, trees):
    first, second = (tree / name for tree in trees)
    return not first.exists() or first.read_bytes() != second.read_bytes()


def main(arguments):
    """Try all that have no row yet; a line for each, and the sums."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("output", type=Path)
    parser.add_argument("--before", type=Path)
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--processes", type=int, default=2)
    asked = parser.parse_args(arguments)
    trees = [ROOT] if asked.before is None else [ROOT, asked.before.resolve()]
    chosen = choose(trees, asked.count, asked.seed)
    rows = list(csv.DictReader(asked.output.open())) if asked.output.exists() else []
    left = [k for k in range(len(chosen)) if str(k) not in {row["number"] for row in rows}]
    stored = asked.output.with_suffix(".json")
    if not stored.exists():
        with tempfile.TemporaryDirectory() as folder:
            stored.write_text(json.dumps(find_reached(chosen, Path(folder))), encoding="utf-8")
    reached = json.loads(stored.read_text(encoding="utf-8"))
    lock = Lock()

    with tempfile.TemporaryDirectory() as scratch:
        free = []
        for k in range(asked.processes):
            places = [Path(scratch, f"{k}-{n}", "tree") for n in range(len(trees))]
            free.append([copy_of(tree, to) for tree, to in zip(trees, places, strict=True)])
            for place in places:  # real data lies beside a tree
                if (ROOT.parent / "shared").exists():
                    (place.parent / "shared").symlink_to((ROOT.parent / "shared").resolve())

        def write():
            with asked.output.open("w", newline="", encoding="utf-8") as file:
                writer = csv.DictWriter(file, COLUMNS)
                writer.writeheader()
                writer.writerows(sorted(rows, key=lambda row: int(row["number"])))

        @contextlib.contextmanager
        def a_place():
            with lock:
                copies = free.pop()
            try:
                yield copies
            finally:
                with lock:
                    free.append(copies)

        def attempt(number):
            mutation = chosen[number]
            with a_place() as copies:
                files = files_for(copies[0], mutation, reached[str(number)])
                found = caught_by(copies[0], mutation, files)
            place, texts = f"{mutation.file}:{mutation.line + 1}", (mutation.before, mutation.after)
            values = number, place, mutation.kind, *(t.strip() for t in texts), found
            row = dict(zip(COLUMNS, (*map(str, values), NOT_TRIED * (not found)), strict=True))
            with lock:
                rows.append(row)
                write()
                print(*row.values(), sep=" | ", flush=True)

        def attempt_before(row):
            mutation = chosen[int(row["number"])]
            with a_place() as copies:
                files = files_for(copies[1], mutation, reached[row["number"]])
                found = caught_by(copies[1], mutation, [f for f in files if _differs(f, copies)])
            with lock:
                row["caught_before_by"] = found
                write()
                print(*row.values(), sep=" | ", flush=True)

        with ThreadPoolExecutor(asked.processes) as pool:
            list(pool.map(attempt, left))
            if len(trees) == 2:
                missed = [row for row in rows if row["caught_before_by"] == NOT_TRIED]
                list(pool.map(attempt_before, missed))
    caught = sum(bool(row["caught_by"]) for row in rows)
    before = sum(row["caught_before_by"] not in ("", NOT_TRIED) for row in rows)
    print(f"{caught} of {len(rows)} caught; of the others {before} by the suite before")


if __name__ == "__main__":
    main(sys.argv[1:])
