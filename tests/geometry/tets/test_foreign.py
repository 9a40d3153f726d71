"""Meshes of other programs: read whole, told apart in the one way that is left, or refused."""

import meshio
import numpy as np
import pytest

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.bodies.shapes import box
from mufe_fenicsx.geometry.tets.foreign_meshes import import_grains
from mufe_fenicsx.kernels.geometry.topology import body_defect

ASSEMBLY = """*Heading
** two parts with the same numbers, one of them placed twice
*Part, name=Small
*Node, nset=all
 1, 0., 0., 0.
 2, 1., 0., 0.
 3, 0., 1., 0.
 4, 0., 0., 1.
*Element, type=C3D4, elset=SOLID
 1, 1, 2, 3,
 4
*End Part
*Part, name=Large
*Node
 4, 0., 0., 2.
*Node
 1, 0., 0., 0.
 2, 2., 0., 0.
 3, 0., 2., 0.
*Element, type=C3D4H, elset=SOLID
 1, 1, 2, 3, 4
*End Part
*Assembly, name=Assembly
*Instance, name=Small-1, part=small
*End Instance
*Instance, name=Small-2, part=Small
 10., 0., 0.
 10., 1., 0., 10., 1., 7., 90.
*End Instance
*Instance, name="Large-1", part=Large
 0., 0., 5.
*End Instance
*Elset, elset=GRAIN_9, instance=Small-1, generate
 1, 1, 1
*Elset, elset=GRAIN_4, instance=Small-2
 SOLID,
*Elset, elset=GRAIN_7, instance=Large-1
 1,
*End Assembly
*Step
*Node Print
U
*Node
 1, 99., 99., 99.
*End Step
"""


def test_parts_of_abaqus_stand_where_their_instances_do(tmp_path):
    (tmp_path / "a.inp").write_text(ASSEMBLY)
    grains = import_grains(tmp_path / "a.inp", scale=1e-3)
    assert grains.labels.tolist() == [4, 7, 9]
    np.testing.assert_allclose(grains.volumes, [1e-9 / 6, 8e-9 / 6, 1e-9 / 6], rtol=1e-12)
    # Moved by (10, 0, 0), then turned by a right angle about the axis x = 10, y = 1 along z:
    # (10, 0), (11, 0), (10, 1) become (11, 1), (11, 2), (10, 1).
    wanted = 1e-3 * np.array([[11, 1, 0], [11, 2, 0], [10, 1, 0], [11, 1, 1]])
    np.testing.assert_allclose(grains.grain(0)[0], wanted, atol=1e-16)
    np.testing.assert_allclose(grains.centroids[1], 1e-3 * np.array([0.5, 0.5, 5.5]), rtol=1e-12)


def test_a_flat_file_and_what_it_includes(tmp_path):
    flat = ASSEMBLY[ASSEMBLY.index("*Node, nset") : ASSEMBLY.index("*End Part")]
    (tmp_path / "nodes.txt").write_text(
        "** more nodes\n 11, 5, 0, 0\n 12, 6\n 13, 5, 1\n 14, 5, 0, 1\n"
    )
    more = "*Node, input=nodes.txt\n*Element, type=C3D4, elset=b\n 2, 11, 12, 13, 14\n"
    (tmp_path / "flat.inp").write_text(flat + more)
    (tmp_path / "all.inp").write_text("*Include, input=flat.inp\n")
    for name in ("flat.inp", "all.inp"):
        assert import_grains(tmp_path / name).num_grains == 2
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "b.inp").write_text("*Include, input=../flat.inp\n")
    with pytest.raises(InputError, match=r"line 1: \*Include input=../flat.inp, expected a file b"):
        import_grains(tmp_path / "in" / "b.inp")
    (tmp_path / "loop.inp").write_text("*Include, input=loop.inp\n")
    with pytest.raises(InputError, match="include each other"):
        import_grains(tmp_path / "loop.inp")


def test_one_part_without_an_assembly_is_the_mesh(tmp_path):
    """As Neper writes it; it had been refused."""
    part = ASSEMBLY[ASSEMBLY.index("*Part") : ASSEMBLY.index("*Part, name=Large")]
    (tmp_path / "a.inp").write_text(part.replace("*End", "*Elset, elset=poly1\n 1\n*End"))
    assert import_grains(tmp_path / "a.inp", labels="poly").volumes == pytest.approx([1 / 6])


@pytest.mark.parametrize(
    "old, new, said",
    [
        (" 2, 1., 0., 0.", " 1, 1., 0., 0.", r"Small: node 1 is there twice, at \(0, 0, 0\) and"),
        (" 2, 2., 0., 0.", " 4, 2., 0., 0.", "Large: node 4 is there twice"),
        (" 1, 1, 2, 3, 4", " 1, 1, 2, 3, 4\n 1, 2, 3, 4, 1", "element 1 is there twice"),
        (" 1, 1, 2, 3, 4", " 1, 1, 2, 3, 5", "Large: an element has node 5, which is not there"),
        (" 1, 1, 2, 3, 4", " 1, 1, 2, 3, 4, 4", "has 5 nodes, expected 4"),
        ("type=C3D4H", "type=C3D10", "2 tetra, 1 tetra10, expected linear tetrahedra"),
        ("part=Large", "part=Huge", "of part Huge, which is not there"),
        (" 0., 0., 5.", " 0., 5.", "expected 3 of a translation"),
        ("1., 7., 90.", "1., 0., 90.", "an axis of length 0"),
        (" 1, 0., 0., 0.", " 1, 0., x, 0.", r"\.inp: line 4: \*Node: .*x'.*, expected numbers"),
        ("*Step", "*Ngen\n 1, 9, 1\n*Step", "NGEN is not followed"),
        ("*Assembly", "*Step\n*Assembly", r"2 parts \(Small, …\) without an .Instance"),
        ("*Node\n 4", "*Node, system=C\n 4", "expected Cartesian"),
    ],
)
def test_what_cannot_be_taken_of_abaqus(tmp_path, old, new, said):
    assert old in ASSEMBLY
    (tmp_path / "a.inp").write_text(ASSEMBLY.replace(old, new, 1))
    with pytest.raises(InputError, match=said):
        import_grains(tmp_path / "a.inp")


def row_of_cubes(num=4):
    """Nodes and cells of cubes in a row that share nodes, and the number of each cell's cube."""
    points, cells = map(np.asarray, box((float(num), 1.0, 1.0), (num, 1, 1)))
    return points, cells, np.floor(points[cells].mean(axis=1)[:, 0]).astype(int)


def write(path, points, cells, data=None, sets=None, more=()):
    data = {name: [values] for name, values in (data or {}).items()}
    sets = {name: [members] for name, members in (sets or {}).items()}
    mesh = meshio.Mesh(points, [("tetra", cells), *more], cell_data=data, cell_sets=sets)
    mesh.write(path)


@pytest.mark.parametrize("name", ["GrainId", "material", "medit:ref"])
def test_numbers_under_another_name_are_named_and_taken_on_request(tmp_path, name):
    points, cells, cube = row_of_cubes()
    ending = ".mesh" if name == "medit:ref" else ".vtu"
    path = tmp_path / f"a{ending}"
    write(path, points, cells, {name: cube + 5, "number": np.arange(len(cells))})
    with pytest.raises(InputError, match=rf"by pieces are 1, and parted by {name} \(4 values\)"):
        import_grains(path)
    grains = import_grains(path, labels=name)
    assert grains.labels.tolist() == [5, 6, 7, 8] and np.allclose(grains.volumes, 1)
    assert import_grains(path, labels="pieces").num_grains == 1
    with pytest.raises(InputError, match=rf"--labels nothing names no .*{name}.*pieces"):
        import_grains(path, labels="nothing")


def test_numbers_that_change_nothing_are_not_asked_about(tmp_path):
    points, cells, cube = row_of_cubes()
    stress, ones = np.random.default_rng(0).random(len(cells)), np.ones(len(cells), dtype=int)
    write(tmp_path / "a.vtu", points, cells, {"grain": cube + 1, "stress": stress, "one": ones})
    assert import_grains(tmp_path / "a.vtu").num_grains == 4


def test_numbers_that_only_name_the_pieces_are_said_to_be_left_out(tmp_path):
    points, cells, _ = row_of_cubes(1)
    far = np.concatenate([np.add(points, [3.0 * k, 0, 0]) for k in range(3)])
    cells3 = np.concatenate([cells + k * len(points) for k in range(3)])
    number = np.repeat([7, 3, 11], len(cells))
    write(tmp_path / "a.vtu", far, cells3, {"GrainId": number, "load": 0 * number})
    notices = []
    assert import_grains(tmp_path / "a.vtu", notices=notices).labels.tolist() == [1, 2, 3]
    said = "grains told apart by: pieces (GrainId not used; --labels GrainId takes it)"
    assert notices == [said]
    notices.clear()
    taken = import_grains(tmp_path / "a.vtu", labels="GrainId", notices=notices)
    assert taken.labels.tolist() == [3, 7, 11] and notices == []
    write(tmp_path / "b.vtu", far, cells3, {"GrainId": number - 3})
    with pytest.raises(InputError, match=r"from 0 to 8, .*: --labels pieces, or add 1"):
        import_grains(tmp_path / "b.vtu", labels="GrainId")


def test_a_physical_group_of_several_volumes(tmp_path):
    points, cells, cube = row_of_cubes()
    data = {"gmsh:physical": np.ones(len(cells), int), "gmsh:geometrical": cube + 1}
    mesh = meshio.Mesh(points, [("tetra", cells)], cell_data={k: [v] for k, v in data.items()})
    mesh.write(tmp_path / "a.msh", file_format="gmsh22", binary=False)
    with pytest.raises(InputError, match=r"gmsh:physical are 1, .*gmsh:geometrical \(4 values\)"):
        import_grains(tmp_path / "a.msh")
    assert import_grains(tmp_path / "a.msh", labels="gmsh:geometrical").num_grains == 4
    data["gmsh:physical"][cube > 1] = 0  # no group
    mesh = meshio.Mesh(points, [("tetra", cells)], cell_data={k: [v] for k, v in data.items()})
    mesh.write(tmp_path / "b.msh", file_format="gmsh22", binary=False)
    assert import_grains(tmp_path / "b.msh").num_grains == 4


def test_element_sets(tmp_path):
    points, cells, cube = row_of_cubes()
    every = {"Eall": np.arange(len(cells))}
    named = {f"poly{k + 3}": np.flatnonzero(cube == k) for k in range(4)}
    write(tmp_path / "a.inp", points, cells, sets=every | named)
    with pytest.raises(InputError, match=r"poly \(4 element sets: poly3, .*: say .* --labels poly"):
        import_grains(tmp_path / "a.inp")
    assert import_grains(tmp_path / "a.inp", labels="poly").labels.tolist() == [3, 4, 5, 6]
    words = dict(zip(("sand", "lime", "clay", "silt"), named.values(), strict=True))
    write(tmp_path / "b.inp", points, cells, sets=every | words)
    with pytest.raises(InputError, match=r"sets \(4 element sets: sand, .*--labels sets"):
        import_grains(tmp_path / "b.inp")
    assert import_grains(tmp_path / "b.inp", labels="sets").num_grains == 4
    words["lime"] = words["lime"][1:]
    write(tmp_path / "c.inp", points, cells, sets=words)
    with pytest.raises(InputError, match="is in 0 of the 4 element sets"):
        import_grains(tmp_path / "c.inp", labels="sets")


@pytest.mark.parametrize(
    "value, said",
    [(3.2, "label of cell 2 is 3.2, expected whole"), (np.nan, "is nan, exp"), (0, "from 0 to 1"),
     (3e9, "to 2147483647")],
)  # fmt: skip
def test_labels_are_whole_numbers(tmp_path, value, said):
    points, cells, _ = row_of_cubes()
    label = np.ones(len(cells))
    label[2] = value
    write(tmp_path / "a.vtu", points, cells, {"label": label})
    with pytest.raises(InputError, match=said):
        import_grains(tmp_path / "a.vtu")


def test_cells_of_other_kinds(tmp_path):
    points, cells, _ = row_of_cubes()
    hexa = [("hexahedron", np.array([[0, 1, 6, 5, 10, 11, 16, 15]]))]
    write(tmp_path / "a.vtu", points, cells, more=hexa)
    with pytest.raises(InputError, match="holds 1 hexahedron, 24 tetra, expected linear tetrah"):
        import_grains(tmp_path / "a.vtu")
    flat = [("triangle", np.array([[0, 1, 6]])), ("line", np.array([[0, 1], [1, 2]]))]
    write(tmp_path / "b.vtu", points, cells, more=flat)
    notices = []
    assert import_grains(tmp_path / "b.vtu", notices=notices).num_grains == 1
    assert notices == ["b.vtu: left out 2 line, 1 triangle"]


GMSH = """$MeshFormat
2.2 0 8
$EndMeshFormat
$Nodes
5
1 0 0 0
2 1 0 0
3 0 1 0
4 0 0 1
1 5 0 0
$EndNodes
$Elements
1
1 4 2 1 1 1 2 3 4
$EndElements
"""
NASTRAN = "BEGIN BULK\nGRID,1,,0.,0.,0.\nGRID,2,,1.,0.,0.\nGRID,3,,0.,1.,0.\nGRID,4,,0.,0.,1.\n"
NASTRAN += "GRID,1,,5.,0.,0.\nCTETRA,1,1,1,2,3,4\nENDDATA\n"


AVS = "# by hand\n5 1 0 0 0\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n1 5 0 0\n1 1 tet 1 2 3 4\n"


@pytest.mark.parametrize("name, text", [("a.msh", GMSH), ("a.bdf", NASTRAN), ("a.avs", AVS)])
def test_a_node_number_that_is_there_twice(tmp_path, name, text):
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match="node 1 is there twice, expected each number once"):
        import_grains(tmp_path / name)


def test_nodes_in_a_coordinate_system_of_their_own(tmp_path):
    polar = "CORD2C,7,,0.,0.,0.,0.,0.,1.\n,1.,0.,1.\n"
    text = NASTRAN.replace("GRID,1,,5.,0.,0.\n", polar)
    (tmp_path / "a.bdf").write_text(text)
    with pytest.raises(InputError, match="coordinate systems"):
        import_grains(tmp_path / "a.bdf")


def cells_again(rng, points, cells):
    some = rng.choice(len(cells), rng.integers(1, len(cells)), replace=False)
    return points, np.concatenate([cells, rng.permuted(cells[some], axis=1)])


def third_cell(rng, points, cells):
    facet = rng.choice(cells[rng.integers(len(cells))], 3, replace=False)
    extra = np.full((3, 4), -1)
    extra[:, :3], extra[:, 3] = facet, len(points) + np.arange(3)
    return np.concatenate([points, rng.random((3, 3)) + 9]), np.concatenate([cells, extra])


def mirrored(rng, points, cells):
    return points, np.where(rng.random(len(cells))[:, None] < 0.5, cells[:, [0, 2, 1, 3]], cells)


def folded(rng, points, cells):
    """A node moved far through the mesh: cells around it lie in others."""
    points = points.copy()
    points[rng.integers(len(points))] = points.mean(axis=0) + 3 * rng.choice([-1, 1], 3)
    return points, cells


def pierced(rng, points, cells):
    return points, cells[rng.random(len(cells)) < 0.6]


def not_finite(rng, points, cells):
    points = points.copy()
    points[rng.integers(len(points)), rng.integers(3)] = rng.choice([np.nan, np.inf])
    return points, cells


def soup(rng, points, cells):
    """Every cell has nodes of its own."""
    return points[cells.ravel()], np.arange(cells.size).reshape(-1, 4)


def stray_nodes(rng, points, cells):
    shift = int(rng.integers(1, 9))
    return np.concatenate([rng.random((shift, 3)) * 50, points]), cells + shift


HOSTILE = [
    *(cells_again, third_cell, mirrored, folded, pierced, not_finite, soup, stray_nodes),
]


@pytest.mark.parametrize("damage", HOSTILE, ids=lambda f: f.__name__)
@pytest.mark.parametrize("ending", [".vtu", ".msh", ".inp", ".mesh"])
def test_hostile_meshes_are_refused_or_whole(tmp_path, damage, ending):
    """What is taken is sound: bodies that fill each their own surface, and nothing is lost."""
    accepted = 0
    for seed in range(4):
        rng = np.random.default_rng([seed, HOSTILE.index(damage)])
        points, cells = box((3.0, 2.0, 2.0), (3, 2, 2))
        points, cells = damage(rng, np.asarray(points), np.asarray(cells))
        path = tmp_path / f"{seed}{ending}"
        if ending == ".msh":
            ones = {"gmsh:physical": np.ones(len(cells), int)}
            data = {k: [v] for k, v in (ones | {"gmsh:geometrical": ones["gmsh:physical"]}).items()}
            mesh = meshio.Mesh(points, [("tetra", cells)], cell_data=data)
            mesh.write(path, file_format="gmsh22")
        else:
            write(path, points, cells)
        try:
            grains = import_grains(path)
        except InputError:
            continue
        accepted += 1
        for g in range(grains.num_grains):
            x, own = grains.grain(g)
            assert body_defect(own, len(x)) == ""
        assert len(grains.cells) == len(cells) and (grains.volumes > 0).all()
        lost = np.abs(np.linalg.det(points[cells[:, 1:]] - points[cells[:, :1]])).sum() / 6
        assert grains.volumes.sum() == pytest.approx(lost, rel=1e-6)
    assert accepted == (4 if damage in (mirrored, stray_nodes) else 0)


def test_a_file_that_is_absent_or_cut_short_is_named_once(tmp_path):
    points, cells, _ = row_of_cubes()
    path = tmp_path / "a.vtu"
    with pytest.raises(InputError) as absent:
        import_grains(path)
    assert str(absent.value) == f"mesh {path} cannot be read: No such file or directory"
    write(path, points, cells)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(InputError, match=r"a\.vtu cannot be read: it may be cut short, expected"):
        import_grains(path)
