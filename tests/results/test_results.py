"""Run folders opened for reading: whole, torn, and the same numbers as computed another way."""

import json
import shutil

import h5py
import networkx
import numpy as np
import pytest
import pyvista

import mufe_fenicsx
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.output.contacts import ContactWriter
from mufe_fenicsx.output.fields import read_state
from mufe_fenicsx.output.quantities import about_field
from mufe_fenicsx.results import Run
from mufe_fenicsx.results.columns import vectors
from tests.made_up_run import write_run
from tests.networks import lattice_network

from mpi4py import MPI  # isort: skip  (after the package, which may bring MPI)

SCENE = "[contact]\nfriction = 0.5\n" + "".join(
    f"[walls.{axis}_{end}]\nfriction = 0.25\n" for axis in "xyz" for end in ("min", "max")
)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A made-up run of 2 x 2 x 3 lumpy balls, with the contacts of a loaded lattice."""
    folder = tmp_path_factory.mktemp("run")
    write_run(folder)
    (folder / "scene.toml").write_text(SCENE)
    writer = ContactWriter(MPI.COMM_SELF, folder)
    for index in range(3):
        writer.write(index, 1e-6 * index, lattice_network(1.0 + index))
    return folder


#: What names a contact.
KEY = ["grain_a", "grain_b", "wall"]


def test_a_whole_run_lacks_nothing(whole):
    run = mufe_fenicsx.open_run(whole)
    assert isinstance(run, Run) and run.missing == [] and run.finished
    assert run.summary["num_grains"] == 12 and run.scene["contact"]["friction"] == 0.5
    assert run.states["strain"].tolist() == [0.0, 0.05, 0.1]
    state, grid = run.state(), read_state(whole, 2)
    assert state.index == 2 and np.array_equal(state.stress, grid.cell_data["stress"])
    assert np.array_equal(state.points, grid.points + grid.point_data["displacement"])
    assert np.array_equal(state.field("velocity"), grid.point_data["velocity"])
    assert state.fields["stress"] == state.stress.shape and len(state.labels) == 12
    assert len(run.contacts(0)) == 16 and run.grains()["grain"].tolist() == list(range(10, 22))
    with pytest.raises(InputError, match="state 7 is not in"):
        run.state(7)
    with pytest.raises(InputError, match="no field nothing, expected one of contact_pressure"):
        state.field("nothing")


def test_tables_of_a_lattice(whole):
    """What is known of it: stress F/D², vertical contacts, half of the friction mobilised."""
    run = mufe_fenicsx.open_run(whole)
    stresses = run.stresses()
    D, height = 2e-4, run.history["height"].to_numpy()
    at = np.interp(run.states["time"], run.history["time"], height)
    # Friction is balanced; branches are those of the height of 3 D, the volume is that now.
    walls = stresses["wall_zz"].to_numpy()
    assert walls == pytest.approx(np.array([1.0, 2, 3]) / D**2, rel=1e-12)
    exact = walls * 3 * D / at
    assert stresses["contact_zz"].to_numpy() == pytest.approx(exact, rel=1e-12)
    assert np.abs(stresses["contact_xx"]).max() < 1e-9 * exact.max()
    network = run.network().iloc[-1]
    assert network["num_contacts"] == network["num_wall_contacts"] == 8
    assert network["N_cA"] == pytest.approx(16 / 12) and network["coordination"] == 2
    assert network["fabric_zz"] == pytest.approx(1) and network["anisotropy"] == pytest.approx(7.5)
    assert network["area_deformed"] == pytest.approx(8 * 1.1e-10, abs=0.0)
    contacts = run.active_contacts()
    assert contacts["ratio"].to_numpy() == pytest.approx(1)
    wall = (contacts["wall"] != "").to_numpy()
    assert contacts["mobilised"].to_numpy() == pytest.approx(np.where(wall, 0.0, 0.5))
    assert not contacts["sliding"].any() and network["sliding"] == 0
    friction = run.wall_friction().set_index("wall")["normal"]
    assert friction["z_max"] == pytest.approx(12) and friction["x_min"] == 0


def test_mobilised_friction_is_that_of_the_pair_of_materials(whole, tmp_path):
    """Half of 0.5 is the whole of 0.25, of grains of one group each; others keep theirs."""
    folder = shutil.copytree(whole, tmp_path / "run")
    contacts = Run(folder).contacts(2)
    inner = contacts[contacts["grain_b"] > 0]
    a, b = (int(inner[name].iloc[0]) for name in ("grain_a", "grain_b"))
    pairs = "[contact.pairs]\nhard-soft = { friction = 0.3, friction_kinetic = 0.25 }\n"
    groups = f"[materials.soft]\nlabels = [{a}]\n[materials.hard]\nlabels = [{b}]\n"
    (folder / "scene.toml").write_text(SCENE + pairs + groups)
    found = Run(folder).active_contacts()
    here = ((found["grain_a"] == a) & (found["grain_b"] == b)).to_numpy()
    wall = (found["wall"] != "").to_numpy()
    expected = np.where(here, 1.0, np.where(wall, 0.0, 0.5))
    assert here.sum() == 1 and found["mobilised"].to_numpy() == pytest.approx(expected)


def edit(path, line, column, value):
    """Change one cell of a CSV file; line 1 is that of the names."""
    rows = [row.split(",") for row in path.read_text().splitlines()]
    rows[line - 1][rows[0].index(column)] = value
    path.write_text("\n".join(map(",".join, rows)) + "\n")


def test_a_wall_contact_that_opened_takes_no_part_and_other_nans_are_named(whole, tmp_path):
    folder = shutil.copytree(whole, tmp_path / "run")
    table = folder / "contacts" / "contacts_0002.csv"
    contacts = Run(folder).contacts(2)
    line = int(np.flatnonzero(contacts["wall"] == "z_max")[0]) + 2
    before = Run(folder).stresses().iloc[2]
    part = before["contact_zz"] * (1 / 6) / 4  # one of four columns, its half ball of three balls
    for name in ("num_points", "area", "normal_force", *(f"force_{a}" for a in "xyz")):
        edit(table, line, name, "0")
    for name in (f"{what}_{a}" for what in ("centroid", "branch") for a in "xyz"):
        edit(table, line, name, "nan")
    run = Run(folder)
    # The sums are exact to rounding.
    assert run.stresses()["contact_zz"][2] == pytest.approx(before["contact_zz"] - part, rel=1e-12)
    assert run.missing == []

    edit(table, line, "torque_x", "nan")
    edit(folder / "contacts" / "grains_0001.csv", 3, "mass", "inf")
    edit(folder / "history.csv", 7, "elastic", "nan")
    named = [sentence for sentence in Run(folder).missing if "not numbers" in sentence]
    expected = (("history.csv", "elastic in line 7"), ("grains_0001.csv", "mass in line 3"),
                ("contacts_0002.csv", f"torque_x in line {line}"))  # fmt: skip
    assert [all(part in s for part in e) for s, e in zip(named, expected, strict=True)] == [
        True
    ] * 3


def test_a_contact_that_was_open_for_a_state_is_younger(whole, tmp_path):
    shutil.copytree(whole, tmp_path / "run")
    middle = tmp_path / "run" / "contacts" / "contacts_0001.csv"
    lines = middle.read_text().splitlines()
    middle.write_text("\n".join([lines[0], *lines[2:]]) + "\n")
    run = mufe_fenicsx.open_run(tmp_path / "run")
    before, now, after = (run.contact_ages(k).set_index(KEY) for k in range(3))
    assert len(now) == len(before) - 1 and not now["age"].sum() == 0
    opened = before.index.difference(now.index)
    assert after.loc[opened, "since"].tolist() == [2] and after.loc[opened, "age"].tolist() == [0]
    others = after.drop(opened)
    assert (others["since"] == 0).all()
    assert others["age_strain"].to_numpy() == pytest.approx(0.1)
    middle.unlink()
    with pytest.raises(InputError, match="has no tables of state 1"):
        run.contact_ages(1)
    assert set(run.contact_ages()["since"]) == {0}  # what is not stored breaks no row


@pytest.mark.parametrize(
    ("method", "given", "told"),
    [
        ("history", None, {"friction": ("J", ""), "force_z_max": ("N", "compression positive")}),
        ("states", None, {"time": ("s", "")}),
        ("contacts", {}, {"normal_force": ("N", "compression positive"), "area": ("m^2", ""),
                          "friction_x": ("N", "on grain_a"), "friction_work": ("J", ""),
                          "branch_z": ("m", "from grain_b to grain_a")}),
        ("grains", {}, {"mass": ("kg", ""), "contact_area": ("m^2", "")}),
        ("patches", {}, {"overlap": ("m^3", ""), "yield_stress": ("Pa", "")}),
        ("curves", {}, {"modulus": ("Pa", ""), "stress_x": ("Pa", "compression positive")}),
        ("stresses", {}, {"wall_zz": ("Pa", "compression positive"), "kinetic": ("-", "")}),
        ("network", {}, {"fabric_xx": ("-", ""), "mean_force": ("N", "")}),
        ("active_contacts", {}, {"ratio": ("-", ""), "torque_x": ("N m", "on grain_a")}),
        ("contact_ages", {}, {"age": ("s", ""), "age_strain": ("-", "compression positive")}),
        ("wall_friction", {}, {"normal": ("N", "compression positive"),
                               "shear_x": ("N", "on the wall")}),
        ("grain_table", {}, {
            "tensile_stress_zz": ("Pa", "tension positive"), "von_mises_peak": ("Pa", ""),
            "volume_expansion": ("-", "expansion positive"), "center_x": ("m", ""),
            "num_active_contacts": ("-", ""), "inertia_1": ("m^5", ""),
        }),
        ("localisation", {}, {"angle": ("rad", ""), "strain_zz": ("-", "compression positive"),
                              "strain_deviator": ("-", "")}),
        ("first_yield", {}, {"depth": ("m", ""), "contact_radius": ("m", "")}),
        ("probe", {"grains": [10]}, {"tensile_stress_zz": ("Pa", "tension positive")}),
    ],
)  # fmt: skip
def test_tables_say_unit_and_sign_of_each_number(whole, method, given, told):
    table = getattr(mufe_fenicsx.open_run(whole), method)
    table = table if given is None else table(**given)
    units, signs = table.attrs["units"], table.attrs["signs"]
    assert set(units) == set(table.select_dtypes(["number", "bool"])) and all(units.values())
    for name, (unit, sign) in told.items():
        assert (units[name], signs.get(name, "")) == (unit, sign), name


@pytest.mark.parametrize("method", ["contacts", "active_contacts", "grains", "wall_friction"])
def test_what_is_below_zero_somewhere_has_a_sign(whole, method):
    """But for places, which are along the axes, and numbers of chains, -1 of none."""
    table = getattr(mufe_fenicsx.open_run(whole), method)()
    numbers = table.select_dtypes("number")
    signed = {name for name in numbers if (numbers[name] < 0).any()}
    signed = {name for name in signed if not name.startswith(("centroid_", "center_", "chain"))}
    assert signed <= set(table.attrs["signs"])


def test_fields_say_unit_sign_and_components_to_paraview(whole):
    """As attributes, and as lines of field data, since the format has no place for them."""
    stress = "stress [Pa], tension positive, XX YY ZZ XY YZ XZ"
    for name, expected in (
        ("fields/0001.vtkhdf", {stress, "pressure [Pa], compression positive"}),
        ("contacts/0001.vtkhdf", {"force [N], X Y Z", "normal_force [N], compression positive"}),
    ):
        with h5py.File(whole / name) as file:
            group = file["VTKHDF"]
            fields = [f for k in ("PointData", "CellData") for f in group[k].values()]
            own = [f for f in fields if f.file.filename == file.filename]  # not of the mesh
            assert all(f.attrs["units"] for f in own) and len(own) > 7
        lines = set(pyvista.read(whole / name).field_data["about"])
        assert expected < lines and len(lines) == len(own)
    names = ("contact_gap", "contact_slip", "plastic_work", "contact_shear")
    assert [about_field(k, 1)[0]["units"] for k in names] == ["m", "m", "J", "Pa"]


def test_tables_of_curves_grains_and_probes(whole):
    run = mufe_fenicsx.open_run(whole)
    history, curves = run.history, run.curves()
    assert curves["stress"].to_numpy() == pytest.approx(history["stress"].to_numpy(), rel=0.02)
    area = run.summary["area"]
    # Two balls a side, each with lumps of 6 % of its radius.
    assert np.prod(run.box[1, :2] - run.box[0, :2]) == pytest.approx(area, rel=0.06, abs=0.0)
    e = area * history["height"] / run.solid_volume - 1
    assert curves["void_ratio"].to_numpy() == pytest.approx(e.to_numpy(), rel=1e-12)
    grains, state = run.grain_table(), run.state()
    stored = run.grains()
    assert grains["num_active_contacts"].tolist() == stored["num_active_contacts"].tolist()
    mine = state.grain == grains["grain"][0]
    places = state.points[state.cells[mine]].mean(axis=1)
    middle = np.average(places, axis=0, weights=state.volume[mine])
    assert vectors(grains, "center")[0] == pytest.approx(middle, rel=1e-6, abs=1e-12)
    assert grains["volume"].sum() == pytest.approx(state.volume.sum(), rel=1e-12, abs=0.0)
    assert grains["von_mises_peak"].max() == state.von_mises.max()
    probe = run.probe(grains=[10, 15])
    assert probe["probe"].tolist() == [10, 15] * 3
    row = grains[grains["grain"] == 15].iloc[0]
    assert probe["tensile_stress_zz"].iloc[-1] == pytest.approx(row["tensile_stress_zz"], rel=1e-12)
    middle = state.reference[state.cells[7]].mean(axis=0)
    place = run.probe(points=[middle])
    assert place["von_mises"].iloc[-1] == state.von_mises[7]
    assert place["grain"].iloc[0] == state.grain[7]
    first = run.first_yield()
    assert set(first["state"]) <= {-1, 1, 2} and (first["depth"][first["state"] > 0] > 0).all()
    for wrong in ({}, {"points": [middle], "grains": [10]}):
        with pytest.raises(InputError, match="expected one of them"):
            run.probe(**wrong)


def torn(folder, name, keep=0.6):
    path = folder / name
    path.write_bytes(path.read_bytes()[: int(keep * path.stat().st_size)])


def test_grains_of_surfaces_name_their_files(whole, tmp_path):
    copy = tmp_path / "run"
    shutil.copytree(whole, copy)
    rows = [f"{label},sand-{label}.stl,1" for label in range(10, 22)]
    (copy / "labels.csv").write_text("\n".join(["label,file,body", *rows]))
    table = Run(copy).grain_table()
    assert table["file"].tolist() == [f"sand-{label}.stl" for label in table["grain"]]
    assert "file" not in Run(whole).grain_table()


def test_a_network_goes_into_graphml_and_back(whole, tmp_path):
    run = Run(whole)
    run.write_graphml(tmp_path / "network.graphml")
    graph = networkx.read_graphml(tmp_path / "network.graphml", node_type=str)
    contacts = run.active_contacts()
    grains = [name for name, kind in graph.nodes(data="kind") if kind == "grain"]
    assert sorted(map(int, grains)) == run.grains()["grain"].tolist()
    assert {name for name in graph if name not in grains} == {"z_min", "z_max"}
    assert graph.number_of_edges() == len(contacts)
    total = sum(force for _, _, force in graph.edges(data="normal_force"))
    assert total == pytest.approx(contacts["normal_force"].sum(), rel=1e-12)
    with pytest.raises(InputError, match="cannot be written"):
        run.write_graphml(tmp_path / "none" / "network.graphml")


def test_a_killed_run_says_what_is_not_there(whole, tmp_path):
    folder = shutil.copytree(whole, tmp_path / "run")
    run = json.loads((folder / "run.json").read_text()) | {"finished": False}
    (folder / "run.json").write_text(json.dumps(run | {"stop_reason": "running"}))
    torn(folder, "history.csv")  # the end of its last row is lost with it
    torn(folder, "fields/0002.vtkhdf")
    (folder / "contacts/contacts_0001.csv").unlink()
    run = mufe_fenicsx.open_run(folder)
    assert not run.finished and 0 < len(run.history) < 220
    assert len(run.missing) == 3
    for sentence, part in zip(
        run.missing, ("still runs, or was cut off", "contacts of state 1: ", "0002.vtkhdf"),
        strict=True,
    ):  # fmt: skip
        assert part in sentence and "\n" not in sentence
    # What is whole can still be used.
    assert len(run.contacts(0)) and run.grain_table(1)["volume"].sum() > 0
    with pytest.raises(InputError, match=r"0002\.vtkhdf cannot be read"):
        run.grain_table()
    with pytest.raises(InputError, match="no tables of state 1"):
        run.contacts(1)
    assert run.stresses()["state"].tolist() == [0, 2]
    with pytest.raises(InputError, match=r"0002\.vtkhdf cannot be read"):
        run.network()


@pytest.mark.parametrize(
    ("name", "call"),
    [
        ("run.json", lambda run: run.summary),
        ("scene.toml", lambda run: run.scene),
        ("fields/mesh.h5", lambda run: run.curves()),
        ("fields/states.vtkhdf.series", lambda run: run.states),
    ],
)
def test_a_torn_file_is_one_clear_line(whole, tmp_path, name, call):
    folder = shutil.copytree(whole, tmp_path / "run")
    torn(folder, name, 1 - 20 / len(SCENE) if name == "scene.toml" else 0.5)
    run = mufe_fenicsx.open_run(folder)
    with pytest.raises(InputError, match=name.split("/")[-1].replace(".", r"\.")) as failure:
        call(run)
    assert "\n" not in str(failure.value)
    assert any(name.split("/")[-1] in sentence for sentence in run.missing)


def test_side_walls_that_moved_need_their_places(whole, tmp_path):
    """In a history without them, as of earlier versions; at rest they are where they were."""
    folder = shutil.copytree(whole, tmp_path / "run")
    lines = (folder / "history.csv").read_text().splitlines()
    old = [line.rsplit(",", 2)[0] for line in lines]
    (folder / "history.csv").write_text("\n".join(old) + "\n")
    run = mufe_fenicsx.open_run(folder)
    assert "length_x" not in run.history and run.missing[0].endswith("length_x, length_y.")
    sides = run.box[1] - run.box[0]
    assert run.lengths(run.history)[-1, :2].tolist() == sides[:2].tolist()
    moved = SCENE.replace("[walls.y_max]\n", "[walls.y_max]\nstress = 1e5\n")
    (folder / "scene.toml").write_text(moved)
    with pytest.raises(InputError, match="wall y_max moved"):
        mufe_fenicsx.open_run(folder).curves()


def test_what_is_no_run_is_refused(tmp_path):
    for path, message in ((tmp_path, "none of run.json"), (tmp_path / "nothing", "is absent")):
        with pytest.raises(InputError, match=message):
            mufe_fenicsx.open_run(path)


def test_tables_of_text_are_read_to_the_last_bit(tmp_path):
    """Python writes the shortest text of a double, and that text names no other double.

    The first two numbers are those that quick converters take for their neighbours.
    """
    random = np.random.default_rng(5)
    values = np.append([0.10000000149011612, 1.1922602995224986e-9], random.normal(size=998))
    values[2:] *= 10.0 ** random.integers(-300, 300, 998)
    rows = [f"{i},{value!r},{'ok' if i else ''}" for i, value in enumerate(values.tolist())]
    path = tmp_path / "quality.csv"
    path.write_text("label,size_m,status\n" + "\n".join(rows) + "\n")
    (tmp_path / "run.json").write_text("{}")
    table = Run(tmp_path).table("quality")
    assert np.array_equal(table["size_m"], values)
    assert table["label"].dtype == np.int64 and table["label"].tolist() == list(range(1000))
    assert table["status"].isna().tolist() == [True] + 999 * [False]
    path.write_text("label,size_m\n1,\n2,0.5\n")
    assert np.isnan(Run(tmp_path).table("quality")["size_m"][0])
    path.write_text("label\n1,2,3\n1,2,3,4\n")
    with pytest.raises(InputError, match=r"quality\.csv is not a table"):
        Run(tmp_path).table("quality")
