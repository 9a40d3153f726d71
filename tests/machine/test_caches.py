"""What is compiled and kept heals: torn, empty, of another machine, or nowhere to be kept."""

import ctypes
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.kernels.build import compiled_forms as forms
from mufe_fenicsx.kernels.build import native
from mufe_fenicsx.kernels.build.cache_files import (
    SealedCacheFile,
    read_sealed,
    seal,
    stamp,
    write_sealed,
)
from mufe_fenicsx.machine.mpi_launcher import environment_without_launcher

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def library(monkeypatch, tmp_path):
    """Loads a small library of its own from an empty cache; the number of compilations."""
    folder, compiled = tmp_path / "kernels", native._compiled
    folder.mkdir()
    (folder / "small.c").write_text("int answer(void) { return 42; }\n")
    count = []
    monkeypatch.setattr(native, "__file__", str(folder / "build" / "native.py"))
    monkeypatch.setitem(native.SOURCES, "small", ())
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(native, "_compiled", lambda *a: count.append(1) or compiled(*a))

    def load():
        native.load.cache_clear()
        found = native.load("small")
        assert isinstance(found, ctypes.CDLL) and found.answer() == 42
        return len(count)

    yield load
    native.load.cache_clear()


def kept(tmp_path):
    return list((tmp_path / "cache" / "mufe_fenicsx").glob("*.so"))


def replace(path, data):
    """Another file: the old one is mapped into this process."""
    path.unlink()
    path.write_bytes(data)


def flipped(data):
    return data[: len(data) // 2] + bytes([data[len(data) // 2] ^ 4]) + data[len(data) // 2 + 1 :]


@pytest.mark.parametrize(
    "damage",
    [lambda d: b"", lambda d: d[:1000], lambda d: d[:-1], flipped, lambda d: seal(b"no library"),
     lambda d: seal(d[:-100])],
    ids=["empty", "cut", "short", "flipped", "other", "unsealed"],
)  # fmt: skip
def test_a_damaged_library_is_made_again(library, tmp_path, damage):
    assert library() == library() == 1  # kept
    (path,) = kept(tmp_path)
    replace(path, damage(path.read_bytes()))
    assert library() == library() == 2
    assert kept(tmp_path) == [path]


def test_a_library_of_another_processor_is_not_taken(library, monkeypatch, tmp_path):
    """Two kinds of processors share a cache: each has its own, and a file moved over is found."""
    assert library() == 1
    (path,) = kept(tmp_path)
    monkeypatch.setattr(native, "_processor", lambda: "another")
    assert library() == library() == 2
    other = next(p for p in kept(tmp_path) if p != path)
    replace(other, path.read_bytes())
    assert library() == 3


@pytest.mark.parametrize("in_the_way", ["file", "folder"])
def test_without_a_place_to_keep_it_a_library_is_made_for_the_process(
    library, tmp_path, in_the_way
):
    if in_the_way == "file":  # where the cache folder should be
        (tmp_path / "cache").write_text("")
    else:  # where the library should be
        assert library() == 1
        (path,) = kept(tmp_path)
        path.unlink()
        path.mkdir()
    before = library()
    assert library() == before + 1


def test_what_numba_kept_heals(tmp_path):
    """Index and loops, each empty, cut and changed: they count as absent, and are made again."""
    cache = SealedCacheFile(str(tmp_path), "loop", ("stamp", 1))
    assert cache.load("key") is None
    for name in ("loop.nbi", "loop.1.nbc"):
        for damage in (lambda d: b"", lambda d: d[:-3], flipped, lambda d: b"\x80\x05."):
            cache.save("key", {"code": b"machine code"})
            assert cache.load("key") == {"code": b"machine code"}
            path = tmp_path / name
            path.write_bytes(damage(path.read_bytes()))
            assert cache.load("key") is None
    assert SealedCacheFile(str(tmp_path), "loop", ("stamp", 2)).load("key") is None
    SealedCacheFile("/proc/nowhere", "loop", 1).save("key", 1)  # not kept, and no error


def test_a_loop_is_compiled_anew_where_one_that_it_calls_has_changed(tmp_path):
    """Of a <- b <- c and d: what is changed makes those anew that import it, and no others."""
    sources = {
        "a": "x = 1\n",
        "b": "from .a import (\n    x,\n)\n",
        "c": "import numba\n\nfrom . import b\n",
        "d": "# from .a import x\n",
    }

    def stamps(name, changed):
        folder = tmp_path / name
        folder.mkdir()
        for module, text in (sources | changed).items():
            (folder / f"{module}.py").write_text(text)
        return {module: stamp(str(folder), module) for module in (*sources, "of a user")}

    before = stamps("before", {})
    assert stamps("same", {}) == before and len(set(before.values())) == 5
    after = stamps("after", {"a": "x = 2\n"})
    assert {m for m in before if after[m] != before[m]} == {"a", "b", "c", "of a user"}


def test_a_sealed_file_is_there_whole_or_not_at_all(tmp_path, monkeypatch):
    path = tmp_path / "kept"
    write_sealed(path, b"first")
    monkeypatch.setattr(os, "fsync", lambda _: (_ for _ in ()).throw(OSError(28, "full")))
    with pytest.raises(OSError):
        write_sealed(path, b"second")
    assert read_sealed(path) == b"first" and os.listdir(tmp_path) == ["kept"]


def start(program, **variables):
    environment = environment_without_launcher() | {"PYTHONPATH": str(ROOT)} | variables
    environment = {name: value for name, value in environment.items() if value is not None}
    return subprocess.run(
        [sys.executable, "-c", program], env=environment, text=True, capture_output=True
    )


SHOW = "import mufe_fenicsx, os; print(os.environ.get('XDG_CACHE_HOME'))"


def test_where_no_cache_can_be_written_it_is_said_once(tmp_path):
    """A home in which nothing can be made, even by root; programs that it starts say nothing."""
    both = (
        f"{SHOW}; import subprocess, sys; "
        f"print(subprocess.run([sys.executable, '-c', {SHOW!r}], text=True, "
        "capture_output=True, check=True))"
    )
    done = start(both, HOME="/proc/nowhere", XDG_CACHE_HOME=None, NUMBA_CACHE_DIR=None)
    assert done.returncode == 0, done.stderr
    folder, child = done.stdout.splitlines()
    assert "/mufe_fenicsx-" in folder and not Path(folder).exists()  # removed at the end
    assert folder in child and "stderr=''" in child
    lines = [line for line in done.stderr.splitlines() if line.startswith("mufe: ")]
    assert len(lines) == 1 and "cache folder /proc/nowhere/.cache cannot be written" in lines[0]
    quiet = start(SHOW, HOME="/proc/nowhere", XDG_CACHE_HOME=None, PMI_RANK="1")
    assert quiet.returncode == 0 and "mufe: " not in quiet.stderr
    kept = start(SHOW, XDG_CACHE_HOME=str(tmp_path))
    assert kept.stdout.strip() == str(tmp_path) and "mufe: " not in kept.stderr


def test_without_a_compiler_a_form_is_one_clear_line(tmp_path):
    """Nothing is cached and PATH leads nowhere: no traceback."""
    program = (
        "import mufe_fenicsx, mufe_fenicsx.cli.exit_status as end\n"
        "from mpi4py import MPI\n"
        "def action():\n"
        "    import ufl\n"
        "    from dolfinx import fem, mesh\n"
        "    from mufe_fenicsx.kernels.build.compiled_forms import compiled_form\n"
        "    cube = mesh.create_unit_cube(MPI.COMM_WORLD, 1, 1, 1)\n"
        "    V = fem.functionspace(cube, ('Lagrange', 1))\n"
        "    compiled_form(ufl.TestFunction(V) * ufl.dx)\n"
        "end.run_to_exit(action)"
    )
    cache = tmp_path / "cache"
    done = start(program, PATH=str(tmp_path), CC=None, XDG_CACHE_HOME=str(cache))
    assert done.returncode == 2, done.stderr
    assert done.stderr.count("\n") == 1 and "expected a C compiler, GCC or clang" in done.stderr


def test_two_processors_share_a_cache_of_numba(tmp_path):
    """Each finds its own loops again, and none of the other's."""
    program = (
        "import numpy as np; from mufe_fenicsx.kernels.bulk.lanczos import square; "
        "assert square(np.ones((4, 3)), np.ones((4, 1))) == 12.0; "
        "print(sum(square.stats.cache_hits.values()), sum(square.stats.cache_misses.values()))"
    )
    found = []
    for name in (None, "generic", None, "generic"):
        features = None if name is None else ""
        done = start(program, NUMBA_CACHE_DIR=str(tmp_path),
                     NUMBA_CPU_NAME=name, NUMBA_CPU_FEATURES=features)  # fmt: skip
        assert done.returncode == 0, done.stderr
        found.append(tuple(map(int, done.stdout.split())))
    assert found == [(0, 1), (0, 1), (1, 0), (1, 0)]


@pytest.mark.parametrize("age, is_left", [(3600, True), (1, False)])
def test_a_form_that_a_killed_program_left_half_made_is_made_anew(
    monkeypatch, tmp_path, age, is_left
):
    """FFCx waits for a library whose source is there; the younger one may still be compiled."""
    source = tmp_path / "libffcx_forms_1.c"
    source.write_text("")
    os.utime(source, (time.time() - age,) * 2)

    def form(expression):
        if source.exists():
            raise TimeoutError(f"timed out. Try cleaning cache (e.g. remove {source}) or increase")
        return expression

    monkeypatch.setattr(forms.fem, "form", form)
    if is_left:
        assert forms.compiled_form("form") == "form"
    else:
        with pytest.raises(InputError, match="cannot be compiled"):
            forms.compiled_form("form")
    assert source.exists() is not is_left
