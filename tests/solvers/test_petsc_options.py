"""Options of PETSc in a scene: some of them, with some values; no file and no code."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from mpi4py import MPI

from mufe_fenicsx.errors import InputError, SolverError
from mufe_fenicsx.implicit.linear_system import SOLVERS
from mufe_fenicsx.implicit.simulation import ImplicitSimulation
from mufe_fenicsx.machine.mpi_launcher import environment_without_launcher
from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.solvers.petsc_options import LEVELS, OPTIONS, check, check_command_line, parse
from tests.bodies import packed_spheres

ROOT = Path(__file__).resolve().parents[2]
#: What empties a file, loads a library, calls Python, attaches a debugger or reads more options.
HARMFUL = """
-ksp_view :/path/precious.txt
-ksp_monitor :/path/precious.txt
-snes_monitor draw
-snes_converged_reason ascii:x
-mat_view binary:x
-log_view :x
-options_file x
-pc_type python -pc_python_type os.abort
-ksp_type python -ksp_python_type evil.go
-snes_type python
-snes_type shell
-snes_linesearch_type shell
-mg_levels_pc_type python
-mg_levels_sub_sub_sub_pc_type lu
-mg_levels_1_ksp_view
-dll_append x
-on_error_attach_debugger
-start_in_debugger
-trust
-mufe_ksp_rtol 1e-8
-mat_mumps_icntl_22 1
-mat_mumps_icntl_22=1
-ksp_rtol nan
-ksp_rtol
-ksp_max_it 1e3
-ksp_type "gmres -ksp_view"
-pc_type "lu
""".strip().splitlines()


@pytest.mark.parametrize("text", HARMFUL)
def test_what_can_do_harm_is_refused_in_one_line(text):
    with pytest.raises(InputError, match=r'^petsc (has -|has "-|= )') as refused:
        parse(text)
    assert "\n" not in str(refused.value) and "expected" in str(refused.value)


def test_usual_options_are_taken():
    text = "-ksp_type gmres -ksp_rtol 1e-9 -snes_monitor -mg_levels_1_sub_pc_type ilu"
    assert parse(text) == {
        "ksp_type": "gmres", "ksp_rtol": "1e-9", "snes_monitor": None,
        "mg_levels_1_sub_pc_type": "ilu",
    }  # fmt: skip
    for options in SOLVERS.values():  # a scene may state what a solver has anyway
        own = {n: str(v).lower() for n, v in options.items() if n != "pc_mg_levels"}
        check(own, "petsc")


def test_the_command_line_of_petsc_is_held_to_the_same_list():
    check_command_line({"ksp_rtol": "1e-8"}, "mufe_")
    with pytest.raises(InputError, match=r'PETSC_OPTIONS has "-ksp_view".* or -mufe_trust for any'):
        check_command_line({"ksp_view": ":x"}, "mufe_")
    check_command_line({"ksp_view": ":x", "trust": None}, "mufe_")


def test_the_page_lists_what_is_allowed():
    text = (ROOT / "docs" / "howto" / "static_increments.md").read_text(encoding="utf-8")
    table = text.partition("## Options of PETSc")[2].partition("\n## ")[0]
    assert [n for n in OPTIONS if f"`{n}`" not in table] == []
    assert [n for n in LEVELS if f"`{n.replace('N', '1')}`" not in table] == []


@pytest.mark.mpi
def test_what_petsc_cannot_do_is_one_line(capfd):
    """As a preconditioner that is not part of an installed PETSc; here one that nobody has."""
    mesh = packed_spheres(MPI.COMM_WORLD, (3, 1, 1), h=1e-3)
    materials = [Elastic(1e11, 0.2, 2650.0)] * mesh.num_grains
    with pytest.raises(SolverError, match=r"PETSc stopped \(.*KSP type nosuch\)") as stopped:
        ImplicitSimulation(mesh, materials, first_step=1.0, petsc={"ksp_type": "nosuch"})
    assert "\n" not in str(stopped.value)


@pytest.mark.skipif(MPI.COMM_WORLD.size > 1, reason="starts a process of its own")
def test_options_that_lie_in_the_folder_are_not_read(tmp_path):
    (tmp_path / ".petscrc").write_text("-mufe_trust\n-mufe_ksp_view :precious\n")
    program = (
        "from mufe_fenicsx.cli.app import world; world(); from petsc4py import PETSc; "
        "import os; print(PETSc.Options('mufe_').getAll())"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, text=True, capture_output=True, check=True,
        env=environment_without_launcher()
        | {"PYTHONPATH": str(ROOT), "PETSC_OPTIONS": "-mufe_ksp_rtol 1e-3"},
    )  # fmt: skip
    assert done.stdout.splitlines()[0] == "{'ksp_rtol': '1e-3'}"
    assert os.listdir(tmp_path) == [".petscrc"]
