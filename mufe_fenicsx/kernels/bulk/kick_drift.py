"""The end of a step of central differences and the begin of the next one, in one pass."""

import ctypes
import math

import numpy as np

from ..build.native import Addresses, address, load


class KickAndDrift:
    """The end of a step and the begin of the next one in one pass over the nodes; local.

    The same numbers, to the last bit, as of :func:`.motion.accelerate_and_half_kick` and then
    :func:`.motion.half_kick_and_drift`, with less memory to read and write.
    """

    def __init__(self):
        real, whole = np.float64, np.int64
        self._addresses = Addresses(*[real] * 6, whole, real, real)
        self._known, self._table = None, None
        self._totals = np.zeros(3)
        self._totals_at = address(self._totals)
        pointer, number, integer = ctypes.c_void_p, ctypes.c_double, ctypes.c_int64
        self._call = load("kick_drift").mufe_kick_and_drift
        self._call.argtypes = [pointer, pointer, number, number, number, integer]
        self._call.restype = None

    def __call__(self, x, u, v, f, mass, x0, runs, last, dt, damping, field, moves):
        """Arguments as in kernels.bulk.motion; ``last`` is the length of the last step [s].

        Returns:
            Energy that the damping took in the last step [J], and the largest distance that a node
            moved [m]; infinity where one is not finite.

        Raises:
            ValueError: An array is of another type, or not contiguous.
        """
        addresses = self._addresses(x, u, v, f, mass, x0, runs, field, moves)
        if addresses is not self._known:
            self._known, self._table = addresses, (ctypes.c_void_p * len(addresses))(*addresses)
        self._call(self._table, self._totals_at, last, dt, damping, len(runs))
        squares, largest, total = self._totals.tolist()
        return last * damping * squares, dt * math.sqrt(largest) if total < math.inf else math.inf
