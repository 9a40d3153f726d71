"""Micro finite-element model of sand on FEniCSx.

A µCT scan becomes labelled grains, each grain a tetrahedral mesh, all grains
one DOLFINx mesh partitioned by grain; the grains deform as elasto-plastic
bodies in hard, frictional contact.
"""

import importlib.util
import os

from .machine.caches import use_writable_caches

# Work is shared among MPI ranks. BLAS threads that wait for more work take the cores
# from them: two ranks on two cores then ran at a fifth of their speed.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

use_writable_caches()

# The binary wheel of DOLFINx has to load its MPI before dolfinx, petsc4py or
# mpi4py are imported. Debian, conda-forge and Spack do without this module.
if importlib.util.find_spec("dolfinx_solver") is not None:
    import dolfinx_solver  # noqa: F401

__version__ = "0.1.0"


def open_run(path):
    """What a run folder holds, as arrays and tables; finished, running or killed.

    Args:
        path: Folder that `mufe run` wrote.

    Returns:
        :class:`mufe_fenicsx.results.Run`.

    Raises:
        InputError: It is no such folder.
    """
    from .results import Run  # pandas and HDF5 are loaded only where they are used

    return Run(path)
