"""Grains as level sets, clumps of spheres and surfaces, against closed forms and twins."""

import csv

import h5py
import numpy as np
import pytest
import pyvista
from scipy.spatial.transform import Rotation

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.measure import surface_volume
from mufe_fenicsx.geometry.surface.given_surfaces import read_bodies
from mufe_fenicsx.peers.body import bodies_of
from mufe_fenicsx.peers.clump_files import export_clumps
from mufe_fenicsx.peers.clumps import clump_of
from mufe_fenicsx.peers.level_set_files import export_level_sets
from mufe_fenicsx.peers.level_sets import level_set
from mufe_fenicsx.peers.surfaces import FORMATS, export_surfaces
from tests.peers.samples import PLACE, RADIUS, ball_and_brick, brick_distance


def test_signed_distances_of_a_ball_lie_between_both_spheres():
    """The polyhedron lies between the sphere through its nodes and the one within its facets."""
    ball, _ = bodies_of(ball_and_brick())
    grid = level_set(ball, 0.1 * RADIUS)
    axes = [grid.origin[i] + grid.spacing * np.arange(n) for i, n in enumerate(grid.distance.shape)]
    at = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    exact = np.linalg.norm(at + ball.centroid @ ball.axes.T, axis=-1) - RADIUS
    a, b, c = (ball.points[ball.triangles[:, i]] + ball.centroid @ ball.axes.T for i in range(3))
    normal = np.cross(b - a, c - a)
    sagitta = RADIUS - (np.einsum("ij,ij->i", a, normal) / np.linalg.norm(normal, axis=1)).min()
    assert 1e-3 * RADIUS < sagitta < 0.05 * RADIUS
    excess = grid.distance - exact
    assert excess.min() > -1e-9 * RADIUS and excess.max() < sagitta * (1 + 1e-9)


def test_level_sets_of_a_turned_brick_in_every_format(tmp_path):
    """Distances at all nodes of the grid, where each format puts them, in closed form.

    Tolerance: rounding in HDF5 and VTI.
    """
    spacing = 2.5e-5
    result = export_level_sets(tmp_path / "ls", ball_and_brick(), spacing=spacing)
    # Volume by the grid: edges of the brick are cut in the middle of a cell at worst.
    assert result["num_grains"] == 2 and result["volume_error"] < 0.15
    with h5py.File(tmp_path / "ls" / "level_sets.h5") as file:
        grain = file["grain_000012"]
        origin, distance = grain.attrs["origin"], grain["distance"][:]
        # As in the script for YADE: q takes the grid's frame to the sample.
        turn = Rotation.from_quat(grain.attrs["quaternion"])
        at = origin + spacing * np.argwhere(np.ones(distance.shape))
        exact = brick_distance(turn.apply(at) + grain.attrs["centroid"])
    assert np.abs(distance.ravel() - exact).max() < 1e-12
    image = pyvista.read(tmp_path / "ls" / "vti" / "grain_12.vti")
    shown = brick_distance(image.points)
    assert np.abs(image.point_data["distance"] - shown).max() < 1e-9
    compile((tmp_path / "ls" / "yade_level_sets.py").read_text(), "yade_level_sets.py", "exec")


def test_a_ball_is_one_sphere():
    """Inside it is the largest ball in the polyhedron; grown it has the volume and inertia.

    Tolerance: the grid of 32 cells in the diameter, whose shells of the surface are summed to
    first order; measured 2e-4.
    """
    ball, _ = bodies_of(ball_and_brick())
    inside, grown = clump_of(ball, missing=0.05, grow=False), clump_of(ball, missing=0.05)
    assert len(inside.radii) == len(grown.radii) == 1
    assert inside.radii[0] == -ball.signed_distance(inside.centres)[0]
    assert inside.volume_error < -0.005 and inside.protruding < 1e-3
    assert grown.radii[0] == pytest.approx(ball.diameter / 2, rel=1e-3)
    assert abs(grown.volume_error) < 1e-6 and grown.inertia_error < 2e-3


def test_errors_of_a_clump_are_those_of_points_at_random():
    """A brick: more spheres cover more; volume and inertia by a million points, three sigmas."""
    _, brick = bodies_of(ball_and_brick())
    few, many = clump_of(brick, 8), clump_of(brick, 60)
    assert many.missing < 0.6 * few.missing and many.inertia_error < few.inertia_error
    rng = np.random.default_rng(2)
    half = np.abs(brick.points).max(axis=0) + few.growth
    at = rng.uniform(-half, half, (1_000_000, 3))
    inside = np.zeros(len(at), dtype=bool)
    for centre, radius in zip(few.centres, few.radii, strict=True):
        inside |= ((at - centre) ** 2).sum(axis=1) < radius**2
    box = 8 * half.prod()
    volume = box * inside.mean()
    sigma = box * np.sqrt(inside.mean() * (1 - inside.mean()) / len(at))
    # The grid of the clump sums its surface to first order: 3e-3 beside the sampling.
    assert abs(volume / brick.volume - 1 - few.volume_error) < 3 * sigma / brick.volume + 3e-3
    arm = at[inside] - at[inside].mean(axis=0)
    second = volume * arm.T @ arm / len(arm)
    inertia = np.trace(second) * np.eye(3) - second
    own = np.diag(brick.moments)
    error = np.linalg.norm(inertia - own) / np.linalg.norm(own)
    assert error == pytest.approx(few.inertia_error, abs=6e-3)


def test_clumps_as_yade_reads_them(tmp_path):
    """Lines x y z r clumpId, of one clump in a row; clumps lie where the grains do."""
    result = export_clumps(tmp_path / "c", ball_and_brick(), num_spheres=30)
    clumps = {}
    for line in (tmp_path / "c" / "clumps.txt").read_text().splitlines():
        if line[0] != "#":
            *sphere, clump = line.split()
            assert clump not in clumps or clump == list(clumps)[-1]
            clumps.setdefault(clump, []).append(list(map(float, sphere)))
    assert list(clumps) == ["3", "12"]
    spheres = np.array(clumps["12"])
    with (tmp_path / "c" / "clumps.csv").open() as file:
        row = list(csv.DictReader(file))[1]
    # No sphere reaches out of the turned brick by more than all have grown.
    out = brick_distance(spheres[:, :3]) + spheres[:, 3]
    assert out.max() == pytest.approx(float(row["growth_m"]), rel=1e-6)
    assert np.linalg.norm(spheres[:, :3].mean(axis=0) - PLACE) < 0.1 * 3e-4
    assert result["num_spheres"] == sum(map(len, clumps.values()))
    with pytest.raises(InputError, match="--spheres = 0"):
        export_clumps(tmp_path / "d", ball_and_brick(), num_spheres=0)
    assert not (tmp_path / "d").exists()


@pytest.mark.parametrize("kind", FORMATS)
def test_surfaces_come_back_closed(tmp_path, kind):
    """Volumes to the seven digits of STL, as positions are read; the others keep all or eight."""
    grains = ball_and_brick()
    export_surfaces(tmp_path / "s", grains, kind=kind, unit=1e-3)
    bodies = read_bodies(tmp_path / "s", scale=1e-3)
    volumes = [surface_volume(points, triangles) for _, points, triangles in bodies]
    assert np.allclose(volumes, grains.volumes, rtol=1e-12 if kind == "ply" else 1e-5)
