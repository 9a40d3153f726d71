"""The MPI launcher: where it is, and what it leaves in the environment of a process."""

import os
import shutil
import sys
from pathlib import Path

#: Beginnings of the names of such variables: PMI of MPICH and SLURM, Hydra, Open MPI.
VARIABLES = ("PMI_", "PMIX_", "HYDI_", "MPI_LOCAL", "OMPI_")
#: Beginnings of those among them by which a user tells Open MPI how to launch.
SETTINGS = (
    "OMPI_ALLOW_RUN_AS_ROOT",
    "OMPI_MCA_rmaps",
    "OMPI_MCA_hwloc",
    "OMPI_MCA_btl",
    "OMPI_MCA_pml",
    "PMIX_MCA_",
)

#: Set to 1: what this process prints reaches a terminal through the launcher.
TERMINAL = "MUFE_TERMINAL"


def environment_without_launcher():
    """Variables of this process for one that shall be an MPI world of its own, a dict."""
    return {name: value for name, value in os.environ.items() if not _of_launcher(name)}


def forget_launcher():
    """Let processes that this one starts be MPI worlds of their own.

    With these variables each would take itself for the rank that was launched here,
    and fail. This process has started MPI already and needs them no more.
    """
    for name in [name for name in os.environ if _of_launcher(name)]:
        del os.environ[name]


def find_mpirun():
    """Launcher of the MPI beside this Python, or the one on PATH, or None."""
    beside = Path(sys.executable).parent / "mpirun"
    return str(beside) if beside.exists() else shutil.which("mpirun")


def _of_launcher(name):
    return name.startswith(VARIABLES) and not name.startswith(SETTINGS)
