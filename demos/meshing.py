"""From labels to tetrahedra: the same grains with every way to choose the length of edges.

    python demos/meshing.py FOLDER            about three minutes on one core
    python demos/meshing.py FOLDER --quick    three grains, coarser

How long edges are decides what a mesh shows of a grain and what a run costs: a step takes time
in proportion to the elements, and its length is that of the thinnest one. The page meshes
a few synthetic grains that touch with even edges, with edges that follow the curvature of the
surface, with edges that follow the distance from the next grain, and with facets that
neighbours share. For each: nodes and elements, how far the surface is from the faces of the
voxels, how thin elements are, and the longest stable time step of the worst grain, 2/ω of its
highest frequency. It ends in a check: half of each surface is within half a voxel of the voxels,
no grain's volume is off by over a thirtieth (coarse), a hundredth (with facets that neighbours
share) or a thousandth (the others), and shared facets are equal to the last digit.
"""

import argparse
import sys
import time
from pathlib import Path

import mufe_fenicsx  # noqa: F401  first: one BLAS thread

# isort: split
import matplotlib
import numpy as np
import scipy.sparse
from scipy.sparse.linalg import eigsh

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry import measure
from mufe_fenicsx.geometry.settings import MeshSettings
from mufe_fenicsx.geometry.tets.jobs import shared_jobs, voxel_jobs
from mufe_fenicsx.geometry.tets.mesher import make_thicker_together, mesh_one
from mufe_fenicsx.report import style
from mufe_fenicsx.report.page import write_page
from mufe_fenicsx.theory.elasticity import oedometric_modulus

S, NU = 5e-6, 0.15  # voxel size [m], Poisson's ratio


def packing(quick):
    """Labels of rough grains that touch: cells of points, cut apart by void, waves on top."""
    n, seeds = (40, 3) if quick else (90, 9)
    rng = np.random.default_rng(3)
    at = np.stack(np.meshgrid(*[np.arange(n) + 0.5] * 3, indexing="ij"), axis=-1)
    centres = spread(rng, seeds, n)
    radius = 0.4 * n / seeds ** (1 / 3)
    depth = np.empty((seeds, n, n, n))
    for i, centre in enumerate(centres):
        arm = at - centre
        distance = np.linalg.norm(arm, axis=-1)
        direction = arm / np.maximum(distance, 1e-9)[..., None]
        wave = sum(
            0.05 * np.cos(k * direction @ axis + phase)
            for k, axis, phase in zip(
                (4, 6, 9), rng.normal(size=(3, 3)), rng.random(3) * 6, strict=True
            )
        )
        depth[i] = radius * (1 + wave) - distance
    labels = np.where(depth.max(axis=0) > 0, 1 + depth.argmax(axis=0), 0)
    return labels.astype(np.int32)


def spread(rng, count, n):
    """Points in a cube of edge n that keep apart: the best of many tries, one after another."""
    points = [rng.uniform(0.35 * n, 0.65 * n, 3)]
    while len(points) < count:
        tries = rng.uniform(0.32 * n, 0.68 * n, (200, 3))
        apart = np.linalg.norm(tries[:, None] - np.array(points), axis=2).min(axis=1)
        points.append(tries[np.argmax(apart)])
    return np.array(points)


def ways(quick):
    """Name, settings and colour of each way to mesh."""
    h = (2.5 if quick else 3.2) * S
    return {
        "even, fine": (MeshSettings(size=h), style.BLUE),
        "even, coarse": (MeshSettings(size=2 * h), style.GREY),
        "curvature": (
            MeshSettings(size=2 * h, smallest_size=h, sizing="curvature"),
            style.RED,
        ),
        "contact": (MeshSettings(size=2 * h, smallest_size=h, sizing="contact"), style.GREEN),
        "conforming": (MeshSettings(size=1.5 * h, conforming=True), style.BLACK),
    }


def longest_step(points, cells):
    """2/ω of a free grain's highest frequency times wave speed over h = 1 m [m].

    Linear elasticity, ν = 0.15, linear tetrahedra, lumped mass; speed of compression waves 1.
    """
    volumes, x = measure.tet_volumes(points, cells), points[cells]
    edges = x[:, 1:] - x[:, :1]
    inverse = np.linalg.inv(edges)
    g = np.concatenate([-inverse.sum(axis=2)[:, :, None], inverse], axis=2).transpose(0, 2, 1)
    E = 1 / oedometric_modulus(1.0, NU)  # of a wave speed of one
    mu, lame = E / (2 * (1 + NU)), NU * E / ((1 + NU) * (1 - 2 * NU))
    k = lame * np.einsum("nai,nbj->naibj", g, g) + mu * np.einsum("naj,nbi->naibj", g, g)
    k += mu * np.einsum("nac,nbc,ij->naibj", g, g, np.eye(3))
    dofs = (3 * cells[:, :, None] + np.arange(3)).reshape(-1, 12)
    rows, columns = np.repeat(dofs, 12, axis=1).ravel(), np.tile(dofs, (1, 12)).ravel()
    n = 3 * len(points)
    k = scipy.sparse.csr_array(((k.ravel() * np.repeat(volumes, 144)), (rows, columns)), (n, n))
    mass = np.repeat(np.bincount(cells.ravel(), np.repeat(volumes / 4, 4), len(points)), 3)
    scale = scipy.sparse.diags_array(1 / np.sqrt(mass))
    omega2 = eigsh(scale @ k @ scale, k=1, tol=1e-3, return_eigenvectors=False)[0]
    return 2 / np.sqrt(omega2)


def mesh_all(labels, settings):
    """A mesh a grain, made in this process."""
    make = shared_jobs if settings.conforming else voxel_jobs
    meshes = [mesh_one(job) for job in make(labels, S, settings)]
    if settings.conforming:
        box = np.array([[0, 0, 0], labels.shape[::-1]]) * S
        make_thicker_together(meshes, settings.size, box)
    return meshes


def facets_of(mesh):
    """Corners of the outer facets [voxels], shape (n, 3, 3)."""
    return mesh.points[measure.boundary_triangles(mesh.cells)] / S


def draw_grains(results):
    """The surfaces of the grains, each way a panel."""
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    figure = matplotlib.figure.Figure(figsize=(style.PAGE, 0.62 * style.PAGE))
    colours = matplotlib.colormaps["Pastel1"].colors
    light = np.array([0.4, -0.75, 0.53])
    for k, (name, (meshes, _)) in enumerate(results.items()):
        axis = figure.add_subplot(2, 3, k + 1, projection="3d")
        everything = []
        for m, mesh in enumerate(meshes):
            facets = facets_of(mesh)
            normal = np.cross(facets[:, 1] - facets[:, 0], facets[:, 2] - facets[:, 0])
            normal /= np.linalg.norm(normal, axis=1, keepdims=True)
            shade = 0.62 + 0.38 * np.clip(normal @ light, -0.6, 1)
            colour = np.clip(shade[:, None] * np.array(colours[m % len(colours)]), 0, 1)
            everything.append((facets, colour))
        facets, colour = (np.concatenate(part) for part in zip(*everything, strict=True))
        drawn = Poly3DCollection(facets, facecolors=colour, edgecolors="k", linewidths=0.12)
        axis.add_collection3d(drawn)
        low, high = facets.min(axis=(0, 1)), facets.max(axis=(0, 1))
        axis.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
        axis.set_box_aspect(high - low, zoom=1.15)
        axis.view_init(22, -62)
        axis.set_axis_off()
        axis.set_title(name, fontsize=8, y=0.98)
    figure.subplots_adjust(0, 0, 1, 0.95, 0, 0.08)
    return figure


def draw_quality(results):
    """How thin elements are, and how far surfaces are from the voxels."""
    figure, (thin, far) = style.new_figure(style.PAGE, 2.5, ncols=2)
    for name, (meshes, colour) in results.items():
        altitude = np.concatenate(
            [
                measure.smallest_altitudes(m.points, m.cells)
                / measure.mean_edges(m.points, m.cells)
                for m in meshes
            ]
        )
        thin.hist(altitude, np.linspace(0, 0.82, 42), density=True, histtype="step", color=colour)
        distance = np.sort(np.concatenate([away(m) for m in meshes]))
        far.plot(distance, np.linspace(0, 1, len(distance)), color=colour, label=name)
    thin.set(xlabel="smallest altitude / mean edge", ylabel="density")
    far.set(xlabel="distance from the voxels' faces (voxels)", ylabel="share", xlim=(0, 1.5))
    far.legend(loc="lower right")
    return figure


def away(mesh):
    """Distances of nodes and centres of facets from the voxels [voxels]."""
    facets = facets_of(mesh)
    at = np.concatenate([facets.reshape(-1, 3), facets.mean(axis=1)]) * S
    return mesh.voxels.distance(at) / S


def draw_cost(results):
    """Cost of a run over the error of the surface."""
    figure, axis = style.new_figure(style.COLUMN, 2.6)
    reference = None
    for name, (meshes, colour) in results.items():
        work = cost(meshes)
        reference = reference or work
        worst = np.mean([m.quality["distance_95_m"] for m in meshes]) / S
        axis.plot(work / reference, worst, "o", color=colour, label=name)
    axis.set(
        xscale="log", xlabel="elements / time step, even and fine = 1",
        ylabel="95 % of the distance (voxels)",
    )  # fmt: skip
    axis.legend(loc="upper right")
    return figure


def cost(meshes):
    """Elements over the time step of the worst grain [1/m]."""
    step = min(longest_step(m.points, m.cells) for m in meshes)
    return sum(len(m.cells) for m in meshes) / step


def num_shared(meshes):
    """Facets that occur in two grains, exactly."""
    seen = [{frozenset(map(tuple, f)) for f in facets_of(m).tolist()} for m in meshes]
    return sum(map(len, seen)) - len(set().union(*seen))


def table(results):
    rows = [
        ("edges", "nodes", "tets", "surface nodes", "volume / voxels", "distance, median and 95 % "
         "(voxels)", "smallest altitude (voxels)", "Δt · c (voxels)", "Δt without worst 0.1 % / Δt "
         "by elements", "shared facets")
    ]  # fmt: skip
    for name, (meshes, _) in results.items():
        q = [m.quality for m in meshes]
        altitudes = np.concatenate([measure.smallest_altitudes(m.points, m.cells) for m in meshes])
        ratio = [row["volume_ratio"] for row in q]
        rows.append((
            name, *(str(sum(row[key] for row in q)) for key in ("nodes", "tets", "surface_nodes")),
            f"{min(ratio):.4f} to {max(ratio):.4f}",
            f"{np.mean([row['distance_median_m'] for row in q]) / S:.2f}, "
            f"{np.mean([row['distance_95_m'] for row in q]) / S:.2f}",
            f"{altitudes.min() / S:.2f}",
            f"{min(longest_step(m.points, m.cells) for m in meshes) / S:.2f}",
            f"{measure.worst_share_costs(altitudes):.2f}", str(num_shared(meshes)),
        ))  # fmt: skip
    return rows


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="where the page and its figures go")
    parser.add_argument("--quick", action="store_true", help="three grains, coarser")
    options = parser.parse_args()
    start = time.perf_counter()
    try:
        options.folder.mkdir(parents=True, exist_ok=True)
        labels, results = packing(options.quick), {}
        for name, (settings, colour) in ways(options.quick).items():
            print(f"{name} ...", flush=True)
            meshes = mesh_all(labels, settings)
            for mesh, job in zip(meshes, voxel_jobs(labels, S, settings), strict=True):
                if not mesh.ok:
                    raise InputError(f"{name}: grain {mesh.label}: {mesh.quality['reason']}")
                mesh.voxels = job.grain
            results[name] = (meshes, colour)
        figures = []
        with matplotlib.rc_context(style.RC):
            for name, draw, caption, how in FIGURES:
                path = options.folder / f"{name}.png"
                draw(results).savefig(path)
                figures.append((path, caption, how, "narrow" if name == "cost" else "wide"))
        page = options.folder / "meshing.html"
        write_page(
            page, "From labels to tetrahedra", "The same grains with every way to choose the "
            "length of edges, and what each costs.", [], [], figures,
            [("The same grains, all together", table(results))],
            f"Written by demos/meshing.py in {time.perf_counter() - start:.0f} s"
            f"{', with --quick' if options.quick else ''}.",
        )  # fmt: skip
    except (InputError, OSError) as error:
        sys.exit(f"error: {error}")
    for name, (meshes, _) in results.items():
        # Voxels know a surface to half of one.
        assert np.mean([np.median(away(mesh)) for mesh in meshes]) < 0.5, name
        # A grain between others has little free surface that could make up for its volume.
        allowed = {"even, coarse": 0.03, "conforming": 0.01}.get(name, 1e-3)
        assert all(abs(mesh.quality["volume_ratio"] - 1) < allowed for mesh in meshes), name
        assert (num_shared(meshes) > 0) == (name == "conforming"), name
    print(page)


FIGURES = (
    ("grains", draw_grains, "The grains as they are meshed.",
     "Fine edges sit where the surface bends, or where the next grain is close. Conforming grains "
     "have the same facets where they touch."),
    ("quality", draw_quality, "Thickness of elements; distance of the surface from the voxels.",
     "A regular tetrahedron has 0.82. Even a perfect surface is up to half a voxel from the steps "
     "of its voxels."),
    ("cost", draw_cost, "What a run costs against how far the surface is off.",
     "Below and to the left is better. The time step is that of the worst grain, without contact."),
)  # fmt: skip


if __name__ == "__main__":
    main()
