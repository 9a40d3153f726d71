"""Reports of tests by stages: walls that all move, strain that turns back, extension."""

import matplotlib
import numpy as np
import pytest

from mufe_fenicsx.analysis import macro, rows
from mufe_fenicsx.output import fields, history
from mufe_fenicsx.report import curves, style, summary, triaxial, write_report
from mufe_fenicsx.report.source import Source
from tests.made_up_run import ball, fake_history

from mpi4py import MPI  # isort: skip  (after the package, which may bring MPI)

#: Slope of stress over strain in each stage [Pa].
SLOPES = {"load": 1e9, "unload": 3e9, "reload": 2e9}
SIDES = (2e-4, 3e-4)

#: Columns that a test by stages adds.
STAGED = tuple(f"{name}_{axis}" for name in ("stress", "strain") for axis in "xyz")


def staged_history(path=(0.0, 0.02, 0.01, 0.04), num=40):
    """Stages along straight lines between strains, each with a slope of its own."""
    strain, stage, stress = [], [], [1e6]
    for name, a, b in zip(SLOPES, path[:-1], path[1:], strict=True):
        part = np.linspace(a, b, num)
        strain += list(part)
        stage += [name] * num
        stress += list(stress[-1] + SLOPES[name] * (part - a))
    strain, h = np.array(strain), fake_history()
    h = {name: np.zeros(strain.size) for name in h}
    h |= {"step": np.arange(strain.size), "time": 1e-6 * np.arange(strain.size)}
    h |= {"stage": np.array(stage), "strain": strain, "stress": np.array(stress[1:])}
    h |= {"height": 1e-4 * (1 - strain), "length_x": np.linspace(2e-4, SIDES[0], strain.size)}
    h |= {"length_y": np.linspace(2e-4, SIDES[1], strain.size), **dict.fromkeys(STAGED, strain)}
    for name in ("force_z_min", "force_z_max"):
        h[name] = h["stress"] * h["length_x"] * h["length_y"]
    return h


def write_staged_run(folder, h, moved, num_states=4, columns=None):
    """States evenly in time, of one lumpy ball that is moved by the last one."""
    columns = columns or (*history.COLUMNS, *STAGED)
    with history.HistoryWriter(folder / "history.csv", columns) as writer:
        for i in range(len(h["step"])):
            writer.append({n: str(h[n][i]) if n == "stage" else h[n][i] for n in columns})
    points, cells = ball(2, 1e-4, np.random.default_rng(0))
    writer = fields.FieldWriter(MPI.COMM_SELF, folder, points, cells, np.ones(len(cells), int))
    for index, at in enumerate(np.linspace(0, len(h["step"]) - 1, num_states).astype(int)):
        part = np.tile(index / (num_states - 1) * np.asarray(moved), (len(points), 1))
        values = {"von_mises": np.ones(len(cells)), "plastic_strain": np.zeros(len(cells))}
        listed = h["time"][at], h["strain"][at], h["stage"][at]
        writer.write(index, *listed, {"displacement": part}, values)
    return points


def test_branches_and_their_moduli():
    """Each stage has the slope of its own line, to rounding, though strains come three times."""
    h = staged_history()
    found = [(part.stage, part.kind) for part in rows.branches(h)]
    assert found == [("load", "loading"), ("unload", "unloading"), ("reload", "reloading")]
    assert rows.turns_back(h) and not rows.turns_back(fake_history())
    modulus = macro.oedometer_curves(h, macro.inner_lengths(h), 1e-13, width=0.002)["modulus"]
    for name, slope in SLOPES.items():
        inside = np.flatnonzero(h["stage"] == name)[2:-2]
        assert modulus[inside] == pytest.approx(slope, rel=1e-9)  # sums of squares of strains


def test_each_branch_has_its_line(tmp_path):
    write_staged_run(tmp_path, staged_history(), [0, 0, 0])
    source = Source(tmp_path)
    with matplotlib.rc_context(style.RC):
        drawing = curves.draw_stress_strain(source)
    drawn = {line.get_label(): line for line in drawing.figure.axes[0].get_lines()}
    assert set(drawn) == set(style.BRANCHES)
    for kind, (dashes, colour) in style.BRANCHES.items():
        assert drawn[kind].get_linestyle() == dashes and drawn[kind].get_color() == colour
    assert drawn["unloading"].get_xdata()[[0, -1]] == pytest.approx([0.02, 0.01])
    assert len(drawing.figure.axes[0].texts) == 3  # an arrow each
    # Over time what lies over each other in strain is apart.
    assert source.over([0.0], [1e-6])[1].startswith("Time")


@pytest.mark.parametrize("moved", [(0, 0, 0), (5e-5, 0, 2e-5)])
def test_walls_of_a_box_whose_sides_move(tmp_path, moved):
    """As far apart as the history says, round the middle or so far beside it that grains fit."""
    h = staged_history()
    # The ball grows into none of the walls: 0.2 mm at first, then the sides go apart.
    points = write_staged_run(tmp_path, h, moved)
    source = Source(tmp_path)
    box = source.end.box(source.start)
    size = np.array([*SIDES, h["height"][-1]])
    assert np.ptp(box, axis=0) == pytest.approx(size, rel=1e-12)
    low, high = points.min(axis=0), points.max(axis=0)
    room = 0.5 * (size - (high - low))  # on each side, below 0 where the ball is squeezed
    beside = np.sign(moved) * np.maximum(np.abs(moved) - np.maximum(room, 0), 0)
    beside = np.where(room < 0, moved, beside)
    assert box.mean(axis=0) == pytest.approx(0.5 * (low + high) + beside, abs=1e-12 * size[0])


def test_the_page_has_volumes_between_the_walls_of_that_time(tmp_path):
    """Its void ratio is that of the table of curves, its cross-section said to be the first."""
    write_staged_run(tmp_path, staged_history(), (0, 0, 0))
    source = Source(tmp_path)
    area = 4e-8  # at the start; at the end half as much again
    found = dict(summary.sample_rows(source.start, source.end, {"area": area}, source.history))
    ratio = source.run.curves()["void_ratio"]
    assert found["Void ratio, start → end"] == f"{ratio.iloc[0]:.3f} → {ratio.iloc[-1]:.3f}"
    assert ratio.iloc[-1] > 1.3 * ratio.iloc[0]
    assert "Cross-section at the start" in dict(summary.run_rows({"area": area}))


@pytest.mark.usefixtures("unpainted")
def test_deviator_mean_stress_and_volume_of_known_stresses(tmp_path):
    """x = 2, y = 3, z = 7 and then 1 MPa: q = √21 and -√3 MPa, p = 4 and 2 MPa; sides give way."""
    h = staged_history((0.0, 0.02, 0.03, 0.05))
    num = len(h["step"])
    late = np.arange(num) >= num // 2
    h |= {"stress_x": np.full(num, 2e6), "stress_y": np.full(num, 3e6)}
    h |= {"stress_z": np.where(late, 1e6, 7e6), "strain_x": np.full(num, -0.01)}
    h |= {"strain_y": np.zeros(num), "strain_z": h["strain"]}
    found = macro.triaxial_curves(h)
    assert found["q"][[0, -1]] == pytest.approx([np.sqrt(21) * 1e6, -np.sqrt(3) * 1e6], rel=1e-12)
    assert found["p"][[0, -1]] == pytest.approx([4e6, 2e6], rel=1e-12)
    assert found["strain_volume"][-1] == pytest.approx(1 - 1.01 * 0.95, rel=1e-12)
    write_staged_run(tmp_path, h, [0, 0, 0])
    result = write_report(tmp_path, tmp_path / "out", only=["triaxial", "stress-strain"])
    assert len(result["figures"]) == 2
    page = (tmp_path / "out" / "report.html").read_text()
    assert "Constrained modulus" not in page and "constrained modulus" not in page


def test_lines_over_strain_end_where_it_is_set_to_zero(tmp_path):
    """What lies before the last zero is no part of the test; its path of stress leads there."""
    h = staged_history((0.0, 0.02, 0.02, 0.05))
    late = h["stage"] != "load"
    h["strain"] = np.where(late, 1.0 - h["height"] / (0.98e-4), h["strain"])
    h |= {f"strain_{axis}": h["strain"] for axis in "xyz"}
    assert [part.is_zeroed for part in rows.branches(h, whole=True)] == [False, True, False]
    assert [part.stage for part in rows.branches(h)] == ["unload", "reload"]
    assert np.array_equal(rows.loading_rows(h), late)
    assert not any(part.kind == "unloading" for part in rows.branches(h))
    write_staged_run(tmp_path, h, [0, 0, 0])
    with matplotlib.rc_context(style.RC):
        figure = triaxial.draw_triaxial(Source(tmp_path)).figure
    over, path, _ = (axis.get_lines() for axis in figure.axes[:3])
    assert min(np.min(line.get_xdata(), initial=0.0) for line in over) > -1e-9
    assert path[0].get_xdata()[-1] == path[1].get_xdata()[0]


def test_a_test_in_extension(tmp_path):
    """No strain is positive: there are states and loaded rows all the same."""
    h = staged_history((0.0, -0.02, -0.03, -0.05))
    write_staged_run(tmp_path, h, [0, 0, 0])
    assert [state.index for state in Source(tmp_path).states] == [0, 2, 3]
    assert rows.loaded_rows(h).sum() == (h["strain"] < -0.025).sum()


def undrained_history(num_cycles=8, num=30):
    """Cycles of q at a total side stress of 100 kPa that lose effective stress, of no real test."""
    parts = []
    for k in range(num_cycles):
        for name, way in (("load", (-1, 1)), ("unload", (1, -1))):
            q = 3e4 * np.linspace(*way, num)
            parts.append((name if k == 0 else f"{name} {k + 1}", q))
    h = staged_history()
    total = num * len(parts)
    h = {n: np.resize(v, total) if n == "stage" else np.zeros(total) for n, v in h.items()}
    q = np.concatenate([q for _, q in parts])
    u = 6e4 * (1 - np.exp(-3 * np.arange(total) / total)) + q / 3
    h["stage"] = np.repeat([name for name, _ in parts], num)
    h |= {"step": np.arange(total), "time": 1e-6 * np.arange(total), "pore_pressure": u}
    h |= {"stress_x": 1e5 - u, "stress_y": 1e5 - u, "stress_z": 1e5 - u + q}
    strain = 0.01 * q / 3e4 * (1 + 2 * np.arange(total) / total)
    h |= {"strain_x": -strain / 2, "strain_y": -strain / 2, "strain_z": strain, "strain": strain}
    return h | {"stress": h["stress_z"], "height": 1e-4 * (1 - strain)}


@pytest.mark.parametrize("num_cycles", [2, 8])
def test_total_stress_paths_of_undrained_stages(tmp_path, num_cycles):
    """The grey path is p + u over q: a straight line of slope 3 where σside is constant."""
    h = undrained_history(num_cycles)
    write_staged_run(tmp_path, h, [0, 0, 0], columns=(*history.COLUMNS, *STAGED, "pore_pressure"))
    source = Source(tmp_path)
    with matplotlib.rc_context(style.RC):
        drawing = triaxial.draw_triaxial(source)
    lines = [line for line in drawing.figure.axes[1].get_lines() if len(line.get_xdata()) > 2]
    (total,) = (line for line in lines if line.get_linewidth() == 0.8)
    p, q = total.get_xdata(), total.get_ydata()
    on = np.isfinite(p)
    assert q[on] == pytest.approx(3 * (p[on] - 100), abs=1e-9)  # kPa
    legend = [text.get_text() for text in drawing.figure.legends[0].get_texts()]
    assert "total stress" in legend and ("load 2" in legend) == (num_cycles == 2)
    assert "grey path" in drawing.how


def test_lists_of_many_names_are_short():
    assert style.listed(["a", "b"]) == "a, b"
    names = [str(k) for k in range(40)]
    assert style.listed(names) == f"{', '.join(names[:11])} and 28 more, to 39"
