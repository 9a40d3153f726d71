"""The sample of known shape: the same grains in the same places on every mesh."""

import dataclasses

import numpy as np
import pytest

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.measure import boundary_triangles, centroid_of, tet_volumes
from mufe_fenicsx.synthetic.formula_grains import level, volume
from mufe_fenicsx.verification.known_sample import DIAMETER, KnownSample, known_sample
from mufe_fenicsx.verification.known_stress import APART


def few(sample, count):
    """The first grains of a sample."""
    return dataclasses.replace(
        sample,
        shapes=sample.shapes[:count],
        centre=sample.centre[:count],
        turn=sample.turn[:count],
    )


def test_meshes_have_the_same_grains_in_the_same_places():
    """A superquadric and a harmonic grain: volumes and centres agree to the second order in h."""
    sample = few(known_sample(), 2)
    errors, centres = [], []
    for elements, mesh in ((5, 1), (10, 2)):
        bodies = sample.bodies(DIAMETER / elements, APART, mesh=mesh)
        errors.append([tet_volumes(*b).sum() / volume(s) - 1
                       for b, s in zip(bodies, sample.shapes, strict=True)])  # fmt: skip
        centres.append([centroid_of(*b) for b in bodies])
    # Facets of both meshes cut off 6 and 1.5 %; bulged, a quarter of that at most is left.
    assert np.all(np.abs(errors) < [[0.015], [0.004]])
    # Of a layer of that volume, uneven by as much again, the centre is off by less than a
    # hundredth of the diameter on the coarse mesh.
    assert np.abs(np.subtract(*centres)).max() < 0.01 * DIAMETER


def test_nodes_lie_on_the_formulas_where_the_sample_says():
    """Drawn apart, in the frame of the formula, to round-off."""
    sample = few(known_sample(), 2)
    bodies = sample.bodies(DIAMETER / 5, APART, bulge=False)
    for (x, cells), shape, axes, place in zip(
        bodies, sample.shapes, sample.axes, sample.places(APART), strict=True
    ):
        outer = x[np.unique(boundary_triangles(cells))]
        assert level(shape, (outer - place) @ axes) == pytest.approx(1.0, abs=1e-11)
    middle = 0.5 * sample.edges
    assert sample.places(APART) - middle == pytest.approx((1 + APART) * (sample.centre - middle))


def test_grains_are_apart_at_the_start_and_pressed_together_as_packed():
    sample = known_sample()
    # What stands out on meshes of five elements a diameter: h² (κ₁ + κ₂)/16, of two grains.
    assert sample.gaps(APART).min() > 0.01 * DIAMETER
    packed = sample.gaps()
    assert -0.01 * DIAMETER < packed.min() and packed.max() < 0
    # Recorded when the sample was packed; a solid fraction, whatever the unit of length.
    volumes = sum(volume(shape) for shape in sample.shapes)
    assert volumes / np.prod(sample.edges) == pytest.approx(0.567534, abs=1e-6)


def test_a_sample_is_stored_and_read():
    sample = known_sample()
    again = KnownSample.from_dict(sample.to_dict())
    assert again.to_dict() == sample.to_dict()
    assert np.abs(again.centre - sample.centre).max() < 1e-9 * DIAMETER
    with pytest.raises(InputError, match="sample = 21 interlocked 1, expected one of 20 interl"):
        known_sample(21)
