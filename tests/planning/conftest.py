"""What the tests of plans share."""

import pytest

from tests.planning.samples import course, point


@pytest.fixture
def table():
    """Errors that are known: mesh 32, 8, 2 %; 1 % of mass 0.5 %; rigid 50 %; rounding 0.2 %."""

    def of(error, n, **parameters):
        return point(error, 1.0, "plastic-sphere", cells=round(500 * n**2),
                     elements_per_radius=n, **parameters)  # fmt: skip

    def stress(error, n, **parameters):
        # Their contacts have radii of a tenth of a diameter.
        return point(error, 1.0, "sample", elements_per_diameter=10 * n, **parameters)

    def grains(error, **parameters):
        return point(error, 1.0, "oedometer", curve=course(error), element_size=0.5, **parameters)

    return [
        *(of(e, n) for e, n in ((0.32, 0.5), (0.08, 1.0), (0.02, 2.0))),
        *(stress(e, n) for e, n in ((0.32, 0.5), (0.08, 1.0), (0.02, 2.0))),
        *(of(e, n, element="p1") for e, n in ((0.6, 0.5), (0.3, 1.0), (0.15, 2.0))),
        *(stress(e, n, element="p1") for e, n in ((0.6, 0.5), (0.3, 1.0), (0.15, 2.0))),
        of(0.085, 1.0, added_mass=0.01),
        grains(0.0), grains(0.5, fidelity="rigid"), grains(0.002, time_step_factor=0.85),
    ]  # fmt: skip
