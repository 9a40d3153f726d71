"""A made-up run: lumpy balls on a lattice, squeezed, with the files that `mufe run` leaves."""

import numpy as np

from mufe_fenicsx.analysis import energy_check
from mufe_fenicsx.output import fields, history, run_folder
from mufe_fenicsx.output.contacts import ContactWriter
from tests.networks import lattice_network

from mpi4py import MPI  # isort: skip  (after the package, which may bring MPI)

SCENE = (
    'title = "title"\n[material]\nmodel = "j2"\nE = 1e11\nnu = 0.15\nrho = 2650.0\n'
    "yield_stress = [[0.0, 1e7]]\n[contact]\nfriction = 0.5\n"
) + "".join(f"[walls.{a}_{end}]\nfriction = 0.25\n" for a in "xyz" for end in ("min", "max"))


def ball(n, radius, rng):
    """A lumpy ball: a cube of n³ small cubes of six tets each, blown up."""
    i = np.arange(n + 1)
    grid = np.stack(np.meshgrid(i, i, i, indexing="ij"), axis=-1).reshape(-1, 3)
    x = 2.0 * grid / n - 1
    length = np.linalg.norm(x, axis=1)
    x *= (np.abs(x).max(axis=1) / np.where(length > 0, length, 1))[:, None]
    x *= 1 + 0.06 * np.sin(3 * x @ rng.normal(size=3) + rng.random())[:, None]
    corner = np.array(
        [(a * (n + 1) + b) * (n + 1) + c for a in range(n) for b in range(n) for c in range(n)]
    )
    steps = np.array([(n + 1) ** 2, n + 1, 1])
    orders = np.array([[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]])
    path = np.concatenate([np.zeros((6, 1), int), np.cumsum(steps[orders], axis=1)], axis=1)
    cells = (corner[:, None, None] + path).reshape(-1, 4)
    volume = np.linalg.det(x[cells[:, 1:]] - x[cells[:, :1]])
    cells[volume < 0] = cells[volume < 0][:, [0, 2, 1, 3]]
    return radius * x, cells


def fake_history(num_rows=200, strain=0.1, area=1e-6, height=1e-3):
    """A plausible oedometer test whose energies add up to the work but for 0.05 %."""
    e = np.concatenate([np.linspace(-0.003, 0, num_rows // 10), np.linspace(0, strain, num_rows)])
    x = np.maximum(e, 0)
    stress = 5e4 * np.exp(e / 0.003) * (e <= 0) + (e > 0) * (5e4 + 40e6 * x + 4e9 * x**2.2)
    force = stress * area
    step = np.diff(e, prepend=e[0]) * height
    work = np.cumsum(force * step)
    wiggle = 1 + 0.01 * np.sin(900 * e)
    share = {
        "elastic": 0.12,
        "plastic": 0.78,
        "friction": 0.0865,
        "contact": 0.01,
        "kinetic": 0.003,
        "damping": 0.0,
    }
    h = {name: share_of * work for name, share_of in share.items()}
    h["plastic"] = np.where(e > 0.005, 0.78 * (work - np.interp(0.005, e, work)), 0.0)
    h["elastic"] = work * 0.9 - h["plastic"]
    h["plastic_dents"] = 0.4 * h["plastic"]
    h |= {
        "step": 50 * np.arange(e.size),
        "time": 1e-6 * np.arange(e.size),
        "dt": np.full(e.size, 2e-8),
        "strain": e,
        "height": height * (1 - e),
        "stress": stress,
        "speed": np.full(e.size, 2.0),
        "added_mass": np.zeros(e.size),
        "switching": np.zeros(e.size),
        "parting": np.zeros(e.size),
        "added_mass_of_grain": np.zeros(e.size),
        "stage": np.where(np.arange(e.size) < num_rows // 10, "seating", "loading"),
        "force_z_max": force * wiggle,
        "force_z_min": force / wiggle,
        "work": work,
        "num_contacts": (200 + 4e4 * x).astype(int),
        "num_active_grains": 60 + (e > 0.02),
        "num_active_contacts": 3 + 40 * e,
        "elements_per_radius": 1.2 + 10 * x,
        "elements_per_radius_tenth": 0.8 + 5 * x,
        "overlap": 0.05 * x,
        "length_x": np.full(e.size, area**0.5),
        "length_y": np.full(e.size, area**0.5),
    }
    for i, name in enumerate(("x_min", "x_max", "y_min", "y_max")):
        h[f"force_{name}"] = (0.3 + 0.02 * i) * force
    h |= {"unbalanced_x": 0 * force, "unbalanced_y": 0 * force}
    set_balance(h)
    voids = 1.6 * (1 - e) - 1
    h |= {"void_ratio": voids, "porosity": voids / (1 + voids)}
    h |= {"void_ratio_inside": voids - 0.1, "void_ratio_error": np.full(e.size, 0.02)}
    h["residual"] = work - sum(h[name] for name in energy_check.ENERGIES)
    return {name: np.asarray(h[name]) for name in history.COLUMNS}


def set_balance(h, others=0.0):
    """Set the unbalanced force between platens where others act on the sample by some force [N]."""
    h["unbalanced_z"] = h["force_z_min"] - h["force_z_max"] + others


def write_history(folder, h):
    with history.HistoryWriter(folder / "history.csv") as writer:
        for i in range(len(h["step"])):
            writer.append({name: str(v[i]) if name == "stage" else v[i] for name, v in h.items()})


def write_run(folder, counts=(2, 2, 3), n=3, num_states=3, finished=True):
    """A run folder as `mufe run` leaves it: lumpy balls on a lattice, squeezed."""
    rng = np.random.default_rng(4)
    radius = 1e-4
    parts, label, at = [], [], 0
    for k, place in enumerate(np.ndindex(*counts)):
        x, cells = ball(n, radius * rng.uniform(0.9, 1.06), rng)
        centre = 2 * radius * (np.array(place) + 0.5)
        parts.append((x + centre, cells + at, np.tile(centre, (len(x), 1)), x / radius))
        label += [10 + k] * len(cells)
        at += len(x)
    points, cells, centre, inner = (np.concatenate(p) for p in zip(*parts, strict=True))
    label = np.array(label)
    size = 2 * radius * np.array(counts)
    h = fake_history(area=size[0] * size[1], height=size[2])
    write_history(folder, h)
    writer = fields.FieldWriter(MPI.COMM_SELF, folder, points, cells, label)
    chain = 1 + 0.8 * np.sin(5e3 * centre[:, 0]) * np.cos(7e3 * centre[:, 1])
    poles = np.abs(inner).max(axis=1)
    for index, strain in enumerate(np.linspace(0, 0.1, num_states)):
        level = strain / 0.1
        node = level * 40e6 * chain * (0.3 + poles**4)
        mises = node[cells].mean(axis=1)
        stress = np.zeros((len(cells), 6))
        stress[:, 2] = -mises
        pressure = level * 3e8 * chain * np.maximum(poles - 0.93, 0)
        moved = -strain * points * [0, 0, 1] + 0.05 * strain * inner * radius * [1, 1, 0]
        writer.write(
            index,
            np.interp(strain, h["strain"], h["time"]),
            strain,
            "loading",
            {
                "displacement": moved,
                "velocity": 0 * moved,
                "contact_pressure": pressure,
                "contact_shear": 0.1 * pressure,
            },
            {
                "stress": stress,
                "von_mises": mises,
                "pressure": mises / 3,
                "plastic_strain": 1e-3 * np.maximum(mises / 1e7 - 1, 0),
            },
        )
    run_folder.write_run_json(
        folder,
        {
            "title": "Made-up <sand> & gravel",
            "command": "mufe run scene.toml",
            "versions": run_folder.versions(),
            "num_ranks": 2,
            "num_grains": len(parts),
            "num_cells": len(cells),
            "edges_per_diameter": 10.0,
            "num_nodes": len(points),
            "finished": finished,
            "stop_reason": "strain reached" if finished else "interrupted",
            "wall_s": 100.0,
            "num_steps": int(h["step"][-1]),
            "stages": [
                {"name": "seating", "step": 0, "time": 0.0, "strain": -0.003},
                {"name": "loading", "step": 1000, "time": 2e-5, "strain": 0.0},
            ],
            "strain_definition": "fall of the top platen since seating over the height then",
            "reference_height": size[2],
            "area": size[0] * size[1],
            "separation": {"overlap_nodes": 120, "max_depth": 1.1e-6, "volume_change": -0.004},
            "failed_grains": [],
            "peak_memory_bytes": 200_000_000,
        },
    )
    return h


def write_whole_run(folder, **options):
    """A made-up run that lacks nothing, with the contacts of a loaded lattice."""
    h = write_run(folder, **options)
    (folder / "scene.toml").write_text(SCENE)
    writer = ContactWriter(MPI.COMM_SELF, folder)
    for index in range(3):
        writer.write(index, 1e-6 * index, lattice_network(1.0 + index))
    return h
