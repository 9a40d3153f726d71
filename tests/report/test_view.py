"""The 3D view of the page: what it holds is the run, and a browser shows it."""

import base64
import json
import re
import shutil
import subprocess
import zlib

import numpy as np
import pytest
from scipy.spatial import cKDTree

from mufe_fenicsx.analysis.same_nodes import same_nodes
from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.measure import boundary_triangles
from mufe_fenicsx.output.contacts import ContactWriter
from mufe_fenicsx.report import packing, write_report
from mufe_fenicsx.report.packing import Packer, to_bytes
from mufe_fenicsx.report.page import write_page
from mufe_fenicsx.report.view import make_view
from mufe_fenicsx.report.view_data import A_STAGE, ONCE, view_data
from mufe_fenicsx.results import Run
from tests.made_up_run import write_run
from tests.networks import lattice_network
from tests.results.test_results import SCENE

from mpi4py import MPI  # isort: skip  (after the package, which may bring MPI)


def from_grid(steps, low, high):
    """Positions [m] of :func:`packing.to_grid`, off by half a step at most."""
    return low + steps / packing.GRID_STEPS * (np.asarray(high) - low)


def from_bytes(q, low, high, power):
    """Values of :func:`to_bytes`, off by :func:`byte_error` at most."""
    return low + (high - low) * (np.asarray(q) / packing.BYTE_STEPS) ** power


def byte_error(values, low, high, power):
    """Largest difference that one byte leaves, for each value.

    Half a step where power is 1. Where it is 2, v = H s² with s off by 1/510 at most is off by
    2 H s/510 + H/510², and a value that was lifted off 0 by H/255² at most.
    """
    size = high - low
    if power == 1:
        return np.full(np.shape(values), 0.5 * size / packing.BYTE_STEPS)
    share = (np.asarray(values) - low) / size
    return size * (np.sqrt(share) / packing.BYTE_STEPS + 1 / packing.BYTE_STEPS**2)


def unpack(text, entries):
    """What was packed, dict name -> flat array.

    Args:
        text: Of :meth:`Packer.text`.
        entries: :attr:`Packer.entries`.
    """
    data = zlib.decompress(base64.b64decode(text))
    found = {}
    for entry in entries:
        kind = np.dtype(packing.KINDS[entry["kind"]])
        count, width = entry["count"], kind.itemsize
        planes = np.frombuffer(data, np.uint8, count * width, entry["at"]).reshape(width, count)
        values = np.ascontiguousarray(planes.T).view(kind).ravel()
        if entry.get("differences"):
            step = (values >> 1) ^ (-(values & 1).astype(f"i{width}")).view(kind)
            values = np.cumsum(step, dtype=kind)
        found[entry["name"]] = values
    return found


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A made-up run of 2 x 2 x 3 lumpy balls at three states with contacts."""
    path = tmp_path_factory.mktemp("run")
    write_run(path)
    (path / "scene.toml").write_text(SCENE)
    writer = ContactWriter(MPI.COMM_SELF, path)
    for index in range(3):
        writer.write(index, 1e-6 * index, lattice_network(1.0 + index))
    return path


class Decoded:
    """The packed view, read back."""

    def __init__(self, data):
        self.header = json.loads(data.header)
        self.arrays = unpack(data.data, self.header["arrays"])
        self.low, self.high = (np.array(self.header[name]) for name in ("low", "high"))
        self.grain = np.repeat(np.arange(12), self.arrays["num_of_grain"])
        a, b, c = self.arrays["faces"].reshape(3, -1)
        first = np.cumsum(a)
        self.faces = np.column_stack([first, first + b, first + c])

    def points(self, number):
        """Positions: 0 is the reference configuration, 1 the first stage."""
        steps = np.zeros((3, self.grain.size), np.uint16)
        for k in range(number + 1):
            steps += self.arrays[f"points.{k}"].reshape(3, -1)
        return from_grid(steps.T, self.low, self.high)

    def volumes(self, number):
        """Of the grains, by the flux of x through their triangles."""
        a, b, c = self.points(number)[self.faces].transpose(1, 0, 2)
        flux = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6
        return np.bincount(self.grain[self.faces[:, 0]], flux)


def test_packed_numbers_come_back():
    rng = np.random.default_rng(0)
    whole = rng.integers(0, 1 << 32, 999, dtype=np.uint64)
    kinds = {"u1": whole % 256, "u2": whole % 65536, "u4": whole, "f4": rng.normal(size=999)}
    packer = Packer()
    for name, values in kinds.items():
        packer.add(name, values, name)
        if name != "f4":
            packer.add(f"{name}-differences", values, name, differences=True)
    found = unpack(packer.text(), packer.entries)
    for name, values in found.items():
        kind = name.split("-")[0]
        assert np.array_equal(values, kinds[kind].astype(values.dtype)), name
    values = np.append(0, 10 ** rng.uniform(-9, 0, 500))
    for low, power in ((0.0, 2), (-0.5, 1)):
        q = to_bytes(values, low, 1.0, power)
        off = np.abs(from_bytes(q, low, 1.0, power) - values)
        # Beyond the stated bound only round-off.
        assert (off <= byte_error(values, low, 1.0, power) + 1e-15).all()
    assert (to_bytes(values, 0.0, 1.0, 2) > 0).sum() == 500  # what is not 0 is not shown as 0


def test_the_view_is_the_run(folder):
    """Decoded positions, fields and numbers against those that `open_run` reads."""
    run = Run(folder)
    data, missing = view_data(run)
    view = Decoded(data)
    assert missing == [] and [s["state"] for s in view.header["stages"]] == [0, 1, 2]
    half = (view.high - view.low) / 65535 / 2 * (1 + 1e-9)
    first = run.state(0)
    node_grain = np.zeros(len(first.reference), int)
    node_grain[first.cells] = (first.grain - 10)[:, None]
    distance, node = cKDTree(first.reference).query(view.points(0))
    assert (distance <= np.linalg.norm(half)).all() and len(np.unique(node)) == node.size
    assert np.array_equal(node_grain[node], view.grain)
    # By facets: seven tetrahedra of these balls lie outside in the fold of a corner.
    outer = boundary_triangles(first.cells)
    # Of a cube of 3³ small ones, 4³ - 2³ nodes are on the surface.
    assert node.size == 12 * 56 and len(view.faces) == 12 * 6 * 9 * 2
    for number in range(3):
        state = run.state(number)
        off = np.abs(view.points(number + 1) - state.points[node])
        assert (off <= half).all()
        a, b, c = state.points[outer].transpose(1, 0, 2)
        flux = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6
        exact = np.bincount(node_grain[outer[:, 0]], flux)
        # A shift by `half` of a surface 6 R² or so wide, of a body of R³.
        assert view.volumes(number + 1) == pytest.approx(exact, rel=6 * half.max() / 5e-5, abs=0.0)
        around = np.zeros((2, len(state.reference)))
        for cell, mises, volume in zip(state.cells, state.von_mises, state.volume, strict=True):
            around[:, cell] += [[volume * mises], [volume]]
        twins = {"von_mises": around[0] / around[1], "contact_pressure": state.contact_pressure}
        for field in view.header["fields"]:
            if field["name"] not in twins:
                continue
            values = twins[field["name"]][node]
            ends = field["low"], field["high"], field["power"]
            found = from_bytes(view.arrays[f"field.{field['name']}.{number}"], *ends)
            # Values are single before they are bytes.
            allowed = byte_error(values, *ends) + 1e-6 * field["high"]
            assert (np.abs(found - values) <= allowed).all(), field["name"]
        table = run.grain_table(number)
        for name in ("von_mises_mean", "rotation_angle", "volume_expansion"):
            found = view.arrays[f"grain.{name}.{number}"]
            assert found == pytest.approx(table[name].to_numpy(), rel=1e-6, abs=1e-9)
        force = view.arrays[f"contact.force.{number}"]
        assert force == pytest.approx(np.full(16, 1.0 + number), rel=1e-6)
    ends = view.arrays["contact.ends.2"].reshape(-1, 6)
    assert (
        np.abs(ends[:, :2] - ends[:, 3:5]).max() < 1e-9
    )  # all contacts of the lattice are upright
    a, b = view.arrays["contact.a.2"], view.arrays["contact.b.2"]
    inner = b < 12
    colour = view.arrays["colour"]
    assert (colour[a[inner]] != colour[b[inner]]).all()


def test_surfaces_that_are_too_large_are_thinned(folder):
    """Half of the room: about the nodes that fit into it, two stages, and closed surfaces."""
    whole = Decoded(view_data(Run(folder))[0])
    data, _ = view_data(Run(folder), budget=0.6 * whole.grain.size * (ONCE + 2 * A_STAGE))
    view = Decoded(data)
    assert 0.5 * whole.grain.size < view.grain.size < 0.75 * whole.grain.size
    assert len(view.header["stages"]) == 2 and "thinned from" in data.description
    edges = np.sort(view.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()
    # Coarse balls lose some of their volume; an open or turned surface would lose all.
    assert view.volumes(0) == pytest.approx(whole.volumes(0), rel=0.25)


def test_nodes_in_another_order_are_found():
    """Two grains that touch in a node of their own each, then all in another order."""
    rng = np.random.default_rng(3)
    points = rng.normal(size=(9, 3))
    points[8] = points[0]
    cells = np.array([[0, 1, 2, 3], [1, 2, 3, 4], [8, 5, 6, 7]])
    grain = np.array([5, 5, 2])
    order = rng.permutation(9)
    where = np.argsort(order)
    other = points[order], where[cells[[2, 0, 1]]], grain[[2, 0, 1]]
    assert np.array_equal(same_nodes((points, cells, grain), other), where)
    moved = points + np.array([1e-9, 0, 0])
    with pytest.raises(InputError, match="expected the same grains"):
        same_nodes((points, cells, grain), (moved, cells[[1, 0, 2]], grain))


def test_nodes_that_have_parted_are_found_by_their_cells():
    """Two tetrahedra on a face; two of its nodes have parted in the other state."""
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]])
    whole = points, np.array([[0, 1, 2, 3], [1, 2, 3, 4]]), np.array([5, 5])
    apart = points[[4, 1, 2, 3, 0, 2, 1]], np.array([[1, 2, 3, 0], [4, 6, 5, 3]]), np.array([5, 5])
    assert np.array_equal(same_nodes(apart, whole), [4, 1, 2, 3, 0, 2, 1])
    turned = apart[0], apart[1][::-1, [1, 0, 2, 3]], apart[2]
    assert np.array_equal(same_nodes(apart, turned), np.arange(7))
    there = same_nodes(whole, apart)
    assert np.array_equal(apart[0][there], points)


@pytest.mark.usefixtures("unpainted")
def test_report_of_a_run_that_goes_on(tmp_path):
    """A row half written, a state whose contacts are not there yet, run.json of the start."""
    write_run(tmp_path, (1, 1, 2), 2, 2)
    (tmp_path / "scene.toml").write_text(SCENE)
    ContactWriter(MPI.COMM_SELF, tmp_path).write(0, 0.0, lattice_network(1.0, (1, 1, 2)))
    summary = json.loads((tmp_path / "run.json").read_text())
    summary |= {"finished": False, "stop_reason": "running"}
    (tmp_path / "run.json").write_text(json.dumps(summary))
    history = tmp_path / "history.csv"
    history.write_bytes(history.read_bytes()[:-9])
    result = write_report(tmp_path, only=["forces", "active-contacts"])
    page = (tmp_path / "report.html").read_text()
    assert "it still runs, or was cut off" in page and 'id="view-data"' in page
    assert any("lacks contacts at 1 of its stages" in sentence for sentence in result["missing"])


# -- in a browser ---------------------------------------------------------------------------

#: Looks at the page as a reader would: what it shows, a click on a grain, the slider, a map.
LOOK = """
<script>
const errors = [];
addEventListener("error", (e) => errors.push(String(e.message)));
addEventListener("unhandledrejection", (e) => errors.push(String(e.reason)));
addEventListener("securitypolicyviolation", (e) => errors.push("loads " + e.blockedURI));
const id = (name) => document.getElementById(name);
const send = (element, kind) => element.dispatchEvent(new Event(kind, { bubbles: true }));
async function lookAround() {
  const view = await window.mufeView;
  const { canvas, run } = view;
  const colours = () => {
    view.draw();
    const gl = canvas.getContext("webgl2");
    const pixels = new Uint8Array(4 * canvas.width * canvas.height);
    gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
    const found = new Map();
    for (let i = 0; i < pixels.length; i += 4) {
      const key = pixels.slice(i, i + 3).join();
      found.set(key, (found.get(key) ?? 0) + 1);
    }
    return { kinds: found.size, white: (found.get("255,255,255") ?? 0) / (pixels.length / 4),
      sum: [...found].reduce((s, [key, n]) => (s * 31 + n * (key.length + 7)) % 1e9, 0) };
  };
  const result = { message: id("view-message").textContent, first: colours() };
  result.places = [0, 1, 2].map((axis) => [...view.run.coordinates(2, axis)]);
  result.values = [...view.values];
  result.faces = [...run.faces];
  const click = (x, y) => {
    const { left, top } = canvas.getBoundingClientRect();
    const at = { clientX: left + x, clientY: top + y, pointerId: 1, button: 0, bubbles: true };
    canvas.dispatchEvent(new PointerEvent("pointerdown", at));
    canvas.dispatchEvent(new PointerEvent("pointerup", at));
  };
  const { width, height } = canvas.getBoundingClientRect();
  click(width / 2, height / 2);
  result.picked = id("view-label").value;
  result.row = id("view-grain").textContent;
  result.chosen = colours();
  id("view-stage").value = "0";
  send(id("view-stage"), "input");
  result.stage = id("view-stage-text").textContent;
  result.rowBefore = id("view-grain").textContent;
  result.second = colours();
  click(2, 2);
  result.nothing = id("view-label").value;
  id("view-stage").value = "2";
  send(id("view-stage"), "input");
  id("view-field").value = "grain";
  send(id("view-field"), "change");
  result.grains = colours();
  id("view-contacts").value = "all";
  send(id("view-contacts"), "change");
  result.lines = view.numLines;
  result.contacts = colours();
  id("view-cut").value = "0";
  send(id("view-cut"), "change");
  result.cut = colours();
  id("view-grains").value = "hidden";
  send(id("view-grains"), "change");
  result.onlyLines = colours();
  result.overflow = document.documentElement.scrollWidth - innerWidth;
  return result;
}
lookAround().catch((e) => ({ failed: String(e.stack) })).then((result) => {
  const place = document.createElement("pre");
  place.id = "result";
  place.textContent = JSON.stringify({ ...result, errors });
  document.body.append(place);
});
</script>
</body>"""


@pytest.fixture(scope="module")
def seen(folder, tmp_path_factory):
    """What a browser found on the page, and the run."""
    names = ("chromium", "chromium-browser", "google-chrome", "chrome")
    browser = next((path for name in names if (path := shutil.which(name))), None)
    if browser is None:
        pytest.skip(f"no browser on PATH: none of {', '.join(names)}")
    scratch = tmp_path_factory.mktemp("page")
    page = scratch / "page.html"
    view, _ = make_view(Run(folder))
    write_page(page, "A made-up run", "For a test.", [], [], [], [], "The end.", view)
    page.write_text(page.read_text().replace("</body>", LOOK))
    command = [browser, "--headless=new", "--no-sandbox", "--disable-dev-shm-usage"]
    command += ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--window-size=1200,900"]
    command += [f"--user-data-dir={scratch / 'profile'}", "--enable-logging=stderr"]
    command += ["--virtual-time-budget=20000", "--dump-dom", page.as_uri()]
    done = subprocess.run(command, capture_output=True, text=True, timeout=600)
    found = re.search(r'<pre id="result">(.*?)</pre>', done.stdout, re.DOTALL)
    assert found, f"the page gave no result: {done.stderr[-2000:]}"
    result = json.loads(found[1].replace("&lt;", "<").replace("&gt;", ">").replace("&amp;", "&"))
    result["console"] = [line for line in done.stderr.splitlines() if ":CONSOLE" in line]
    return result


def test_a_browser_shows_the_view_without_complaint(seen):
    assert "failed" not in seen, seen.get("failed")
    assert seen["errors"] == [] and seen["console"] == [] and seen["message"] == ""
    assert 0.1 < seen["first"]["white"] < 0.9 and seen["first"]["kinds"] > 100
    assert seen["overflow"] <= 0


def test_a_browser_decodes_what_was_packed(seen, folder):
    """The program of the page against its twin: positions, faces and values, but for single."""
    run = Run(folder)
    view = Decoded(view_data(run)[0])
    assert np.array_equal(np.reshape(seen["faces"], (-1, 3)), view.faces)
    exact = view.points(3).T
    assert np.abs(np.array(seen["places"]) - exact).max() < 2e-7 * exact.max()
    field = view.header["fields"][0]
    values = from_bytes(view.arrays["field.von_mises.2"], field["low"], field["high"], 2)
    assert seen["values"] == pytest.approx(values, rel=1e-6)


def test_a_click_shows_the_row_of_a_grain_and_the_slider_another_stage(seen, folder):
    label = int(seen["picked"])
    table = Run(folder).grain_table(2).set_index("grain")
    assert label in table.index and seen["nothing"] == ""
    assert f"Grain {label} at strain 0.1" in seen["row"]
    mean = table.loc[label, "von_mises_mean"] / 1e6
    assert f"mean over the grain{float(f'{mean:.3g}'):g} MPa" in seen["row"]
    contacts = Run(folder).active_contacts(2)
    touched = set()
    for one, other in (("grain_a", "grain_b"), ("grain_b", "grain_a")):
        mine = contacts[contacts[one] == label]
        names = "grain " + mine[other].astype(str)
        touched |= set(names.where(mine["grain_b"] != 0, "wall " + mine["wall"]))
    assert len(touched) == 2 and all(name in seen["row"] for name in touched)
    assert seen["stage"].startswith("strain 0,") and "at strain 0" in seen["rowBefore"]
    sums = [
        seen[name]["sum"] for name in ("first", "chosen", "second", "grains", "contacts", "cut")
    ]
    assert len(set(sums)) == len(sums)  # each of them changed the picture
    assert seen["lines"] == 16
    assert seen["onlyLines"]["white"] > 0.9 and seen["onlyLines"]["kinds"] > 1
