"""A program that leaves without reading what it was given is a BrokenPipeError, and no death."""

import subprocess
import sys

import pytest

#: What starts the libraries that take SIGPIPE for themselves, in either order.
STARTING = {
    "PETSc": "import mufe_fenicsx.mesh",
    "gmsh": "from mufe_fenicsx.geometry.bodies.shapes import sphere; sphere(1.0, 0.5)",
}
BREAKING = """
import os
reads, writes = os.pipe()
os.close(reads)
try:
    os.write(writes, b"to nobody")
except BrokenPipeError:
    print("told")
"""


@pytest.mark.parametrize("first, second", [("PETSc", "gmsh"), ("gmsh", "PETSc")])
def test_python_hears_of_a_reader_that_left(first, second):
    program = "\n".join((STARTING[first], BREAKING, STARTING[second], BREAKING))
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert (done.returncode, done.stdout.split()) == (0, ["told"] * 2), done.stderr
