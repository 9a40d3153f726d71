"""Do walls carry the stress that they are led to?

A history has for each axis whose walls a servo leads the stress that these are to carry, 0 where
nothing is asked.
"""

import numpy as np

from mufe_fenicsx.container import CONTAINERS

#: How columns begin that have what the walls across an axis are to carry [Pa].
TARGET = "target_"
#: Targets below this part of the largest one of their axis are not compared.
SMALL = 0.1


def axes_led(history):
    """Letters of the axes that a history has targets of, in some row."""
    letters = dict.fromkeys(axis for each in CONTAINERS.values() for axis in each.axes)
    return [a for a in letters if np.any(history.get(f"{TARGET}{a}", 0.0))]


def lack_of_stress(history):
    """Stress less what it is to be, over that, of the axis that is off most, shape (num_rows,).

    nan where nothing is asked. None where nothing is in all rows.
    """
    found = []
    for axis in axes_led(history):
        target = np.asarray(history[f"{TARGET}{axis}"], dtype=float)
        asked = np.abs(target) > SMALL * np.abs(target).max()
        off = np.asarray(history[f"stress_{axis}"], dtype=float) - target
        found.append(np.divide(off, target, out=np.full(off.shape, np.nan), where=asked))
    if not found:
        return None
    off = np.stack(found)
    most = np.argmax(np.nan_to_num(np.abs(off), nan=-1.0), axis=0)
    return off[most, np.arange(off.shape[1])]
