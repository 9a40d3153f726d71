"""What an MPI launcher leaves in the environment of a process."""

import os

#: Beginnings of the names of such variables: PMI of MPICH and SLURM, Hydra, Open MPI.
VARIABLES = ("PMI_", "PMIX_", "HYDI_", "MPI_LOCAL", "OMPI_")


def forget_launcher():
    """Let processes that this one starts be MPI worlds of their own.

    With these variables each would take itself for the rank that was launched here,
    and fail. This process has started MPI already and needs them no more.
    """
    for name in [name for name in os.environ if name.startswith(VARIABLES)]:
        del os.environ[name]
