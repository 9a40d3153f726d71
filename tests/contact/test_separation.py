"""Overlaps are removed, and gaps closed, without strain."""

import numpy as np
import pytest
import pyvista
from mpi4py import MPI

from mufe_fenicsx.contact.results.network import find_network
from mufe_fenicsx.contact.separation import TOLERANCE, separate
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.bodies.shapes import box
from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.run.from_bodies import build
from mufe_fenicsx.run.from_scene import load_mesh
from mufe_fenicsx.verification.case import on_first_ranks
from tests.bodies import RADIUS, packed_spheres, simulation_of

COMM = MPI.COMM_WORLD
SOFT = Elastic(1e9, 0.15, 2650.0)


@pytest.mark.mpi
def test_overlapping_spheres_are_parted_and_release_no_energy():
    mesh = packed_spheres(COMM, (3, 1, 1), gap=-0.06)
    done = separate(mesh, max_shift=0.3)
    # Poles on a line: an overlap of 0.06 R less what the facets cut off (h²/8R = 0.025 R each).
    assert 0 < done.max_depth <= 0.06 * RADIUS
    assert done.remaining_nodes == 0
    assert done.max_shift <= 0.06 * RADIUS
    # Two lenses of height 0.03 R a contact: 2 pi h² (R - h/3) of 3 spheres, at most.
    lens = np.pi * 0.03**2 * (1 - 0.01)
    assert -4 * lens / (3 * 4 / 3 * np.pi) * 2 < done.volume_change < 0

    sim = simulation_of(mesh, SOFT, friction=0.3)
    for _ in range(50):
        sim.step()
    energies = sim.energies()
    # The reference is free of stress and nothing pushes: not one joule appears.
    scale = 1e9 * RADIUS**3 * TOLERANCE**2
    assert max(energies["kinetic"], energies["elastic"], energies["contact"]) < 1e-12 * scale


def test_overlap_that_stays_becomes_an_offset_and_releases_no_energy():
    mesh = packed_spheres(COMM, (3, 1, 1), gap=-0.12)
    sim = simulation_of(mesh, SOFT)
    accepted = COMM.allreduce(sim.contact.overlaps.num_accepted)
    assert accepted > 0
    for _ in range(50):
        sim.step()
    energies = sim.energies()
    # As above: forces start from the offset, so nothing moves.
    assert energies["kinetic"] == 0.0
    assert energies["elastic"] == 0.0


@pytest.mark.mpi
def test_gap_between_blocks_is_closed_to_one_flat_contact():
    """The gap's volume goes to the blocks, the whole face touches, and a push is felt at once."""
    on_first_ranks(COMM, 2, closed_blocks)


def closed_blocks(comm):
    side, gap = 1e-3, 3e-5
    below = box((side, side, side / 2), (4, 4, 2))
    above = box((side, side, side / 2), (5, 5, 2), (0, 0, side / 2 + gap))
    turn = np.linalg.qr(np.array([[2.0, 1, 0], [1, -3, 1], [0.5, 1, 2]]))[0]
    turn *= np.sign(np.linalg.det(turn))
    bodies = [(points @ turn.T, cells) for points, cells in (below, above)]
    unused = build(comm, bodies, SOFT, np.zeros(3), np.zeros(3), axes="")
    mesh = unused.mesh
    done = separate(mesh, 0.3, close_gaps=1.2 * gap)
    assert done.gap_nodes == 25 + 36 and done.remaining_gap_nodes == 0
    # Flat faces move as they are, each by half of the gap: round-off, and the solver's 1e-13.
    assert done.max_shift == pytest.approx(gap / 2, rel=1e-9)
    assert done.volume_change == pytest.approx(gap / side, rel=1e-9)
    assert done.contact_area == pytest.approx(side**2, rel=1e-9)
    assert done.contact_area_before == done.overlap_nodes == 0

    # Towards each other at 1 m/s: after 1e-9 s a force on all facets of the faces.
    along = np.where(mesh.grains[mesh.grain_of_node, None] == 0, turn[:, 2], -turn[:, 2])
    sim = simulation_of(mesh, SOFT, velocity=1.0 * along, time_step_factor=0.6)
    assert sim.energies()["contact"] == 0.0
    while sim.state.t < 1e-9:
        sim.step()
    network = find_network(sim.contact, mesh, sim.solid.mass, sim.state.x)
    if comm.rank == 0:
        assert network.contacts.num_points[0] == 2 * 16 + 2 * 25
        assert -network.contacts.normal[0] @ turn[:, 2] > 0.9


def gaps_between_balls(mesh):
    """Areas of facets; gaps of surface nodes to other grains, and their areas along the way."""
    corners, facets, x = mesh.x[mesh.facets], mesh.facets, mesh.x
    normal = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    around = np.zeros_like(x)
    np.add.at(around, facets, normal[:, None] / 3)
    nodes, gap, area = np.unique(facets), [], []
    for grain in range(mesh.num_grains):
        faces = facets[mesh.grain_of_facet == grain]
        other = pyvista.PolyData.from_regular_faces(x, faces)
        outside = nodes[mesh.grain_of_node[nodes] != grain]
        way = other.find_closest_cell(x[outside], return_closest_point=True)[1] - x[outside]
        gap.append(np.linalg.norm(way, axis=1))
        area.append(np.einsum("ni,ni->n", around[outside], way) / gap[-1])
    return np.linalg.norm(normal, axis=1), np.concatenate(gap), np.concatenate(area)


def test_gap_between_balls_is_closed_to_a_disc():
    """g(r) = g₀ + r²/R up to G: a disc of radius √(R (G - g₀)) touches, and nothing overlaps."""
    mesh = packed_spheres(COMM, (3, 1, 1), gap=0.002, h=0.12 * RADIUS)
    first, gap, area = gaps_between_balls(mesh)
    done = separate(mesh, 0.3, close_gaps_over_h=0.4)
    h = np.sqrt(4 / np.sqrt(3) * first.mean())  # edge of the mean facet
    G, first_gap = done.close_gaps, 0.002 * RADIUS
    assert G == pytest.approx(0.4 * h, rel=1e-12, abs=0.0)
    assert done.contact_area_before == 0.0
    # Nodes touch where less than 0.01 h is to stay of the gap: all of it closes up to G, beyond
    # less and less, by a cubic step.
    s = np.maximum(gap / G - 1, 0)
    touches = (gap < 2 * G) & (gap * s**2 * (3 - 2 * s) < 0.01 * h)
    assert done.gap_nodes == np.count_nonzero(gap < G)
    assert done.contact_area == pytest.approx(0.5 * area[touches].sum(), rel=1e-9, abs=0.0)
    assert done.remaining_nodes == 0
    # Between spheres dA = π R dg: ∫ g dA is G²/2 up to G, and 0.65 G² in the taper. Facets of both
    # lie h²/8R within them, which adds 1.5 G times that. Second order in the moves: some per cents.
    sag = h**2 / (8 * RADIUS)
    lens = np.pi * RADIUS * ((G**2 - first_gap**2) / 2 + 0.65 * G**2 + 3 * sag * G)
    volume = 3 * 4 / 3 * np.pi * RADIUS**3
    assert done.volume_change * volume / (2 * lens) == pytest.approx(1.0, abs=0.05)
    assert done.smallest_volume >= 0.5
    sim = simulation_of(mesh, SOFT, friction=0.3)
    for _ in range(20):
        sim.step()
    assert sim.energies()["kinetic"] == 0.0


def test_wider_gaps_than_a_mesh_can_close_are_refused():
    mesh = packed_spheres(COMM, (3, 1, 1), gap=0.1)
    with pytest.raises(InputError, match=r"sample\.close_gaps = 0\.0004 m, expected at most 0\.6"):
        separate(mesh, 0.3, close_gaps=4e-4)


@pytest.mark.slow
def test_gaps_of_a_label_image_are_closed(tmp_path):
    """Grains from a voxel image: contacts grow many times, elements and time step stay sound."""
    from mufe_fenicsx.bulk.solid import Solid
    from mufe_fenicsx.geometry.mesh import mesh_labels
    from mufe_fenicsx.geometry.settings import MeshSettings

    # Four blocks with rounded corners, cut by oblique planes, as voxels.
    z, y, x = np.meshgrid(*[np.arange(28) - 13.5] * 3, indexing="ij")
    inside = (np.abs(x) ** 4 + np.abs(y) ** 4 + np.abs(z) ** 4) < 12**4
    labels = 1 + (x + 0.3 * y + 0.2 * z > 0) + 2 * (y - 0.4 * x + 0.1 * z > 0)
    inside &= np.abs(x + 0.3 * y + 0.2 * z) > 0.6  # a void of a voxel between halves
    np.save(tmp_path / "labels.npy", (labels * inside).astype(np.uint16))
    settings = MeshSettings(size=4e-5, voxel_size=1e-5, processes=1)
    mesh_labels(tmp_path / "labels.npy", settings, tmp_path / "grains")
    mesh = load_mesh(MPI.COMM_SELF, tmp_path / "grains")
    solid = Solid(mesh, [SOFT] * mesh.num_grains)
    time_step = solid.element_time_step(mesh.x)
    done = separate(mesh, 0.3, close_gaps=1e-5)
    # A void of 1 voxel, of which smoothing left about G: measured 2.8 times, 93 %, and, as closing
    # moves surfaces by 0.3 of an edge of the grains that took a finer mesh for their volume, 0.70.
    assert done.contact_area > 2 * done.contact_area_before
    # Open may stay nodes of the line where all four meet, of which each faces three grains.
    assert done.remaining_gap_nodes < 0.3 * done.gap_nodes
    assert done.remaining_nodes == 0 and 0 < done.volume_change < 0.02
    assert done.smallest_volume >= 0.5
    assert solid.element_time_step(mesh.x) > 0.6 * time_step
