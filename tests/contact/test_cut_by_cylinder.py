"""Grains that a cylinder has cut stay on it, and its wall stands there."""

from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI

from mufe_fenicsx.contact.start.reference import kept_in_cylinder
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.run.from_scene import find_bounds
from mufe_fenicsx.scene import ContainerSettings

CYLINDER = np.array([2e-3, 3e-3, 1e-3])


def nodes(radii, last=6.0):
    """Places at some distances from the axis of the cylinder, over the radius."""
    r, angle = CYLINDER[2] * np.asarray(radii)[:, None], np.arange(0.0, last, 0.1)[None]
    flat = np.stack([r * np.cos(angle), r * np.sin(angle)], axis=-1).reshape(-1, 2)
    return np.column_stack([CYLINDER[:2] + flat, np.linspace(0, 1e-3, len(flat))])


def test_nodes_on_the_cylinder_stay_on_it_and_others_within():
    """Surfaces that are parted move along chords: by u²/2R off the cylinder, 5e-5 R here."""
    first = nodes([0.5, 0.999, 1.0])
    move = np.zeros_like(first)
    move[:, 0] = 1e-2 * CYLINDER[2]
    move[::7] = 0.0
    mesh = SimpleNamespace(cylinder=CYLINDER)
    x = kept_in_cylinder(mesh, first, first + move)
    distance = np.linalg.norm(x[:, :2] - CYLINDER[:2], axis=1) / CYLINDER[2]
    on = slice(len(first) // 3 * 2, None)
    assert np.abs(distance[on] - 1).max() < 1e-15 * 4
    assert distance.max() < 1 + 4e-16
    assert (x[::7] == first[::7]).all()
    inside = slice(0, len(first) // 3)
    assert (x[inside] == (first + move)[inside]).all() and (x[:, 2] == first[:, 2]).all()
    mesh.cylinder = None
    assert (kept_in_cylinder(mesh, first, first + move) == first + move).all()


def test_the_container_is_the_cylinder_that_cut_the_grains():
    """Whatever part of it they cover; the scene may place another that holds them."""
    x = nodes([0.7, 1.0], 2.0)
    mesh = SimpleNamespace(
        comm=MPI.COMM_SELF, x=x, sample_nodes=np.arange(len(x)), cylinder=CYLINDER
    )

    def bounds(**stated):
        return find_bounds(
            SimpleNamespace(container=ContainerSettings(shape="cylinder", **stated)), mesh
        )

    found = bounds()
    assert found.centre.tolist() == CYLINDER[:2].tolist()
    assert found.radius == pytest.approx(CYLINDER[2], rel=1e-15)
    assert bounds(radius=1.5e-3).radius == 1.5e-3
    with pytest.raises(InputError, match=r"container.radius = 0.0009, expected at least 0.001"):
        bounds(radius=0.9e-3)
    mesh.cylinder = (
        None  # the smallest circle around what they cover: less than half, so by its chord
    )
    widest = max(np.linalg.norm(x[:, :2] - place, axis=1).max() for place in x[:, :2])
    assert bounds().radius == pytest.approx(0.5 * widest, rel=1e-9)
