"""A deck says what the scene says, and CalculiX finds the force that we find."""

import os
import shutil
import subprocess

import numpy as np
import pytest

import mufe_fenicsx  # noqa: F401  first: the wheel's MPI

# isort: split
from mpi4py import MPI

from mufe_fenicsx.contact.laws import edge_of_area
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.bodies.half_ball import half_ball
from mufe_fenicsx.geometry.bodies.shapes import box
from mufe_fenicsx.geometry.grains import Grains, save_grains
from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.materials.j2 import J2
from mufe_fenicsx.materials.rigid import Rigid
from mufe_fenicsx.output.history import read_history
from mufe_fenicsx.peers.calculix import export_calculix
from mufe_fenicsx.peers.deck_forces import read_wall_forces
from mufe_fenicsx.run.run import run_scene
from mufe_fenicsx.scene import (
    Contact,
    Group,
    Implicit,
    Oedometer,
    Pair,
    Sample,
    Scene,
    Solver,
    Wall,
)

RADIUS = 1e-4
SOFT = Elastic(1e9, 0.15, 2650.0)


def scene_of(material=SOFT, **changes):
    """A short static test."""
    parts = {
        "material": material,
        "contact": Contact(0.23, wall_friction=0.1),
        "oedometer": Oedometer(strain=0.02, speed=0.1, seating_stress=1e4),
        "sample": Sample(separation=False),
        "solver": Solver(integrator="static", element="p1"),
        "implicit": Implicit(step=2e-3),
    }
    return Scene(**(parts | changes))


def read_deck(path):
    """Lines of data of each keyword, in order: [(keyword with parameters, [fields, ...]), ...]."""
    cards = []
    for line in path.read_text().splitlines():
        if line.startswith("**"):
            continue
        if line.startswith("*"):
            cards.append((line.replace(" ", ""), []))
        else:
            cards[-1][1].append([field.strip() for field in line.split(",")])
    return cards


def test_a_deck_of_two_cubes(tmp_path):
    """Every card of two cubes on each other, where all numbers are known."""
    edge, n = 2e-4, 2
    points, cells = box((edge,) * 3, (n,) * 3)
    grains = Grains.from_list(
        [4, 9], [(points, cells), (points + np.array([0, 0, edge]), cells)], edge / n
    )
    save_grains(tmp_path / "grains", grains)
    hard = J2(100e9, 0.15, 2650.0, ((0.0, 10e6), (0.05, 110e6)))
    walls = {"x_min": Wall(velocity=0.01)}
    contact = Contact(0.23, wall_friction=0.1, pairs={"top-material": Pair(0.17)})
    scene = scene_of(hard, walls=walls, contact=contact, materials={"top": Group((9,), hard)})
    result = export_calculix(
        tmp_path / "deck.inp",
        scene,
        tmp_path / "grains",
        MPI.COMM_SELF,
        units="mm",
        reach=edge / 10,
    )
    cards = read_deck(tmp_path / "deck.inp")
    # CalculiX reads twenty characters of a number, and lines of up to 132.
    assert all(len(field) <= 20 for _, rows in cards[1:] for row in rows for field in row)
    text = (tmp_path / "deck.inp").read_text()
    assert max(map(len, text.splitlines())) <= 132

    nodes = {int(row[0]): np.array(row[1:], float) for c, r in cards if c == "*NODE" for row in r}
    elements = {
        int(row[0]): [int(k) for k in row[1:]]
        for card, rows in cards
        if card.startswith("*ELEMENT,TYPE=C3D")
        for row in rows
    }
    assert len(nodes) == 2 * len(points) + 6 * 8 and len(elements) == 2 * len(cells) + 6
    surfaces = {
        c.split("NAME=")[1].split(",")[0]: r for c, r in cards if c.startswith("*SURFACE,N")
    }
    # Faces of C3D4 in the manual's order of nodes, seen from outside: closed, area and volume.
    faces = {"S1": (0, 2, 1), "S2": (0, 1, 3), "S3": (1, 2, 3), "S4": (2, 0, 3)}
    for name in ("S_GRAIN_4", "S_GRAIN_9"):
        triangles = np.array(
            [[nodes[elements[int(e)][k]] for k in faces[face]] for e, face in surfaces[name]]
        )
        a, b, c = (triangles[:, i] for i in range(3))
        area = 0.5 * np.cross(b - a, c - a)
        assert np.linalg.norm(area, axis=1).sum() == pytest.approx(6 * 0.2**2, rel=1e-12)
        assert np.einsum("ij,ij->", a, area) / 3 == pytest.approx(0.2**3, rel=1e-9)
    low, high = np.zeros(3), np.array([0.2, 0.2, 0.4])
    for axis, side in ((a, s) for a in range(3) for s in ("min", "max")):
        (element, face), *more = surfaces[f"S_WALL_{'XYZ'[axis]}_{side.upper()}"]
        corners = np.array([nodes[k] for k in elements[int(element)]])
        assert face == "S1" and not more
        assert corners[:4, axis] == pytest.approx((low if side == "min" else high)[axis], abs=1e-12)
        a, b, d, e = corners[[0, 1, 3, 4]]
        assert np.cross(b - a, d - a) @ (e - a) > 0  # a brick, not inside out
        middle = corners.mean(axis=0)[axis]
        assert middle < 0 if side == "min" else middle > high[axis]  # beyond the sample
        for i in set(range(3)) - {axis}:
            assert corners[:, i].min() < 0 and corners[:, i].max() > high[i]

    card = dict(cards)
    assert card["*ELASTIC"] == [["100000", "0.15"]] and card["*DENSITY"] == [["2.65e-09"]]
    assert card["*PLASTIC"] == [["10", "0"], ["110", "0.05"]]
    # All facets are alike, so are all layers: c h/E*, with h of their area; four times as stiff.
    layer = 0.25 / 4 * edge_of_area((edge / n) ** 2 / 2, 1) * (1 - 0.15**2) / 100e9
    ratio = 2 * (1 - 0.15) / (2 - 0.15)
    at = {c: i for i, (c, _) in enumerate(cards)}
    pairs = {}
    for k in range(1, 1 + result["num_grain_pairs"] + result["num_wall_pairs"]):
        i = at[f"*SURFACEINTERACTION,NAME=I{k}"]
        (stiffness,), (mu, slope) = cards[i + 1][1][0], cards[i + 2][1][0]
        assert cards[i + 3][0] == f"*CONTACTPAIR,INTERACTION=I{k},TYPE=SURFACETOSURFACE"
        names = tuple(cards[i + 3][1][0])
        pairs[names] = float(stiffness), float(mu), float(slope) / float(stiffness)
    assert len(pairs) == 1 + 2 * 4 + 2
    assert pairs.pop(("S_GRAIN_4", "S_GRAIN_9")) == pytest.approx((1e-9 / 2 / layer, 0.17, ratio))
    for names, values in pairs.items():
        assert names[1].startswith("S_WALL") and values == pytest.approx((1e-9 / layer, 0.1, ratio))

    assert card["*STATIC"][0][1] == "8e-05" and result["travel_m"] == pytest.approx(0.02 * 2 * edge)
    assert card["*AMPLITUDE,NAME=A_WALL_Z_MAX"] == [["0", "0"], ["8e-05", "0.008"]]
    assert card["*BOUNDARY,AMPLITUDE=A_WALL_Z_MAX"] == [["WALL_Z_MAX", "3", "3", "-1"]]
    assert card["*BOUNDARY,AMPLITUDE=A_WALL_X_MIN"] == [["WALL_X_MIN", "1", "1", "1"]]
    fixed = [tuple(row) for row in card["*BOUNDARY"]]
    assert len(fixed) == len(set(fixed)) == 6 * 3 - 2


def test_the_platen_of_a_dynamic_deck_moves_as_that_of_a_run(tmp_path):
    """Speed rises with the same quintic; integrated with fine steps. Round-off of 12 digits."""
    from mufe_fenicsx.loading.oedometer import smooth_step

    points, cells = box((1e-4,) * 3, (1,) * 3)
    save_grains(
        tmp_path / "g", Grains.from_list([1, 2], [(points, cells), (points + 1e-4, cells)], 1e-4)
    )
    oedometer = Oedometer(strain=0.02, speed=2.0, ramp=0.01)
    scene = scene_of(oedometer=oedometer, solver=Solver())
    result = export_calculix(tmp_path / "d.inp", scene, tmp_path / "g", MPI.COMM_SELF, units="m")
    card = dict(read_deck(tmp_path / "d.inp"))
    assert result["procedure"] == "dynamic" and "*DYNAMIC,ALPHA=-0.111111" in card
    motion = np.array(card["*AMPLITUDE,NAME=A_WALL_Z_MAX"], float)
    ramp = 0.01 * 2e-4 / 2.0
    t = (np.arange(200_000) + 0.5) / 200_000 * motion[-1, 0]
    way = np.cumsum([2.0 * smooth_step(s) for s in t / ramp]) * (t[1] - t[0])
    assert np.allclose(motion[1:, 1], np.interp(motion[1:, 0], t + t[0], way), rtol=1e-6)
    assert motion[-1, 1] == pytest.approx(0.02 * 2e-4)


def test_what_a_deck_has_no_words_for(tmp_path):
    points, cells = box((1e-4,) * 3, (1,) * 3)
    save_grains(
        tmp_path / "g", Grains.from_list([1, 2], [(points, cells), (points + 1e-4, cells)], 1e-4)
    )
    explicit = Solver()
    held = {"x_min": Wall(stress=1e5, speed=1.0)}
    for scene, options, why in (
        (scene_of(Rigid(1e9, 0.2, 2650.0), solver=explicit), {}, "Rigid, expected elastic or j2"),
        (scene_of(walls=held, solver=explicit), {}, "x_min.stress = 100000, expected none"),
        (scene_of(), {"units": "inch"}, 'units = "inch", expected m, mm, um'),
        (scene_of(), {"procedure": "explicit"}, "expected static or dynamic"),
        (scene_of(), {"penalty": 0.0}, "penalty = 0.0, expected a factor > 0"),
        (scene_of(), {"reach": -1.0}, "reach = -1.0 m, expected a length > 0"),
    ):
        with pytest.raises(InputError, match=why):
            export_calculix(tmp_path / "a.inp", scene, tmp_path / "g", MPI.COMM_SELF, **options)
    without = scene_of()
    object.__setattr__(without, "oedometer", None)  # as in a scene with another kind of test
    with pytest.raises(InputError, match="is missing, expected it: a deck"):
        export_calculix(tmp_path / "a.inp", without, tmp_path / "g", MPI.COMM_SELF)
    kinetic = Contact(0.23, pairs={"material-material": Pair(0.2, 0.1)})
    damped = scene_of(contact=kinetic, solver=Solver(damping=10.0))
    notes = export_calculix(tmp_path / "a.inp", damped, tmp_path / "g", MPI.COMM_SELF)["notes"]
    for text in ("element: C3D4", "implicit increments", "kinetic ones", "damping"):
        assert any(text in note for note in notes), text
    assert [path.name for path in tmp_path.iterdir() if path.name != "g"] == ["a.inp"]


def test_calculix_finds_our_force(tmp_path):
    """Two half balls pressed on each other between rigid planes: same mesh, element and walls.

    Elastic, plain tetrahedra, static in both. Three per cent: contact is enforced in two ways,
    whose errors at two to three elements in its radius are of that size.
    """
    ccx = shutil.which("ccx")
    if ccx is None:
        pytest.skip("ccx is not installed")
    options = {"growth": 0.5, "contact_radius": 0.12 * RADIUS}
    low, cells = half_ball(RADIUS, 0.05 * RADIUS, direction=(0, 0, 1), **options)
    top, cells2 = half_ball(RADIUS, 0.055 * RADIUS, direction=(0, 0, -1), **options)
    top[:, 2] += low[:, 2].max() - top[:, 2].min()
    save_grains(tmp_path / "g", Grains.from_list([1, 2], [(low, cells), (top, cells2)], 1e-5))
    scene = scene_of(
        contact=Contact(0.23, wall_friction=0.5), implicit=Implicit(step=4e-3, largest=4e-3)
    )
    run_scene(scene, tmp_path / "g", tmp_path / "run", MPI.COMM_SELF, quiet=True)
    rows = read_history(tmp_path / "run" / "history.csv")
    way, force = rows["height"][0] - rows["height"], rows["force_z_max"]

    deck = tmp_path / "deck.inp"
    result = export_calculix(deck, scene, tmp_path / "g", MPI.COMM_SELF)
    environment = os.environ | {"OMP_NUM_THREADS": "1"}
    done = subprocess.run(
        [ccx, "-i", "deck"], cwd=tmp_path, env=environment, capture_output=True, text=True,
        timeout=600, check=False,
    )  # fmt: skip
    assert "Job finished" in done.stdout, done.stdout[-2000:]
    times, forces = read_wall_forces(deck)
    theirs, theirs_way = forces["z_max"][:, 2], 0.1 * times
    assert theirs_way[-1] == pytest.approx(result["travel_m"], rel=1e-5)
    # A Hertz force to the power 2/3 is linear in the approach.
    ours = np.interp(theirs_way, way, np.cbrt(np.maximum(force, 0)) ** 2) ** 1.5
    compared = theirs_way > 0.3 * theirs_way[-1]
    assert np.count_nonzero(compared) >= 3
    assert np.abs(theirs / ours - 1)[compared].max() < 0.03
    assert forces["z_min"][-1, 2] == pytest.approx(-theirs[-1], rel=1e-3)


def test_forces_of_a_deck_that_was_not_run(tmp_path):
    deck = tmp_path / "a.inp"
    with pytest.raises(InputError, match="no file"):
        read_wall_forces(deck)
    deck.write_text("*HEADING\nx\n** units: mm, N, t, s, MPa\n")
    (tmp_path / "a.dat").write_text("nothing\n")
    with pytest.raises(InputError, match="holds no total forces"):
        read_wall_forces(deck)
