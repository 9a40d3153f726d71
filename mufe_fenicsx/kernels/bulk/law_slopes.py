"""Slopes of a law of plastic flow at the increments that it gave."""

import functools

import numba

from .hardening import plastic_increment

#: Step of the differences, over the stress.
STEP = 1e-6


def _slopes(increment_of):
    def slopes(
        by_trial, by_mean, trial, mean, strain0, increment, dt, grains, cell_offset, shear,
        parameters,
    ):  # fmt: skip
        """Derivatives of the plastic increment by trial and mean stress, by central differences.

        They are exact on each line of a hardening table, to rounding.

        Args:
            by_trial, by_mean: Written where plastic flow occurs [1/Pa], shape (num_cells,).
            trial: Von Mises stress of the trial state [Pa], shape (num_cells,).
            mean: Mean stress [Pa], tension positive, shape (num_cells,).
            strain0: Plastic strain before the increment, shape (num_cells,).
            increment: Increment of the plastic strain, shape (num_cells,).
            dt: Length of the increment [s].
            grains: Grains of this law.
            cell_offset: First cell of each grain, shape (num_grains + 1,).
            shear: Shear modulus of the grains [Pa].
            parameters: Rows of parameters of the law, shape (num_grains, m).
        """
        for g in grains:
            G, row = shear[g], parameters[g]
            for e in range(cell_offset[g], cell_offset[g + 1]):
                if increment[e] <= 0.0:
                    continue
                q, p, a, d = trial[e], mean[e], strain0[e], STEP * trial[e]
                up = increment_of(q + d, p, a, dt, G, row)
                by_trial[e] = (up - increment_of(q - d, p, a, dt, G, row)) / (2.0 * d)
                up = increment_of(q, p + d, a, dt, G, row)
                by_mean[e] = (up - increment_of(q, p - d, a, dt, G, row)) / (2.0 * d)

    return slopes


@functools.cache
def law_slopes_of(increment):
    """:func:`law_slopes` of another law, compiled by numba, than that of von Mises."""
    return numba.njit(error_model="numpy")(_slopes(increment))


law_slopes = numba.njit(error_model="numpy")(_slopes(plastic_increment))
