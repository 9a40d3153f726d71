"""A synthetic scan in a folder: image, truth, surfaces, and a scene to go on with."""

import time

import numpy as np
import tifffile

from ..errors import SolverError
from ..geometry.image.compare_labels import touching_labels
from ..geometry.image.label_files import write_labels, write_table
from ..machine.files import new_folder
from .imaging import grey_image, voxelise
from .packing import pack
from .picture import draw_scan
from .scene_text import scene_text
from .shapes import make_grains, sizes, sizes_by_mass
from .triangulated import icosphere
from .truth import CONTACTS, contact_rows, grain_rows

#: Solid fraction of the whole box by which the number of grains is chosen: rather too many.
SOLID_FRACTION = 0.68


def synthesize(settings, output_folder, *, overwrite=False, progress=None):
    """Make grains, pack them, image the middle of the packing and write all that is known.

    Writes grey.tif, truth_labels.tif, truth_grains.csv, truth_contacts.csv, surfaces.npz (whole
    grains, for `mufe mesh`), scene.toml and synthetic.png.

    Args:
        settings: `SynthesisSettings`.
        output_folder: New folder.
        overwrite: Replace a folder that was written by this before.
        progress: Called with steps of the packing, None and a text.

    Returns:
        A dictionary of numbers of the image: num_grains, porosity_of_labels, …; what `mufe segment
        --truth` compares with are its true labels.

    Raises:
        InputError: the output cannot be written.
        SolverError: the packing failed.
    """
    start = time.perf_counter()
    with new_folder(output_folder, overwrite=overwrite, marker="truth_labels.tif") as folder:
        rng_grains, rng_pack, rng_image = np.random.default_rng(settings.seed).spawn(3)
        grains = sample_grains(settings, rng_grains)
        edges = _box_edges(settings)
        shown = progress and (
            lambda step, p: progress(step, None, f"solid fraction {p.solid_fraction:.3f}")
        )
        packing = pack(
            grains,
            rng_pack,
            edges,
            settings.overlap * settings.voxel_size,
            progress=shown,
        )
        packed = time.perf_counter()
        voxel, shape = settings.voxel_size, settings.shape
        if (packing.high - packing.low < np.array(shape[::-1]) * voxel).any():
            raise SolverError(
                f"packing of {grains.num_grains} grains became smaller than the image, "
                "expected a larger margin"
            )
        voxels = voxelise(packing, shape, voxel, settings.supersampling)
        present, numbered = np.unique(voxels.labels, return_inverse=True)
        labels = numbered.reshape(shape).astype(np.int32)
        if present[0] != 0:
            labels += 1
        grey = grey_image(voxels.solid, rng_image, settings)
        rows = grain_rows(packing, voxels, labels, voxel)
        contacts = contact_rows(packing, voxels, labels, voxel)

        tifffile.imwrite(folder / "grey.tif", grey, photometric="minisblack")
        write_labels(folder / "truth_labels.tif", labels, voxel)
        write_table(folder / "truth_grains.csv", rows)
        write_table(folder / "truth_contacts.csv", contacts, CONTACTS)
        shown_grains = present[present > 0] - 1
        _write_surfaces(folder / "surfaces.npz", packing, shown_grains, voxels.low)
        (folder / "scene.toml").write_text(scene_text(settings), encoding="utf-8")
        draw_scan(folder / "synthetic.png", grey, labels, packing, shown_grains, voxel)
    return _numbers(
        settings, packing, labels, rows, contacts,
        output=str(output_folder),
        packing_seconds=round(packed - start, 2),
        seconds=round(time.perf_counter() - start, 2),
    )  # fmt: skip


def sample_grains(settings, rng):
    """As many random grains as the box of the packing holds."""
    trial = sizes(rng, 4000, settings.d50, settings.uniformity)
    volume = np.prod(_box_edges(settings))
    n = max(2, round(SOLID_FRACTION * volume / (np.pi / 6 * (trial**3).mean())))
    form = [
        np.clip(rng.normal(mean, settings.form_spread, n), 0.3, 1.0)
        for mean in (settings.elongation, settings.flatness)
    ]
    return make_grains(
        rng, sizes(rng, n, settings.d50, settings.uniformity), *form, settings.roughness,
        settings.falloff, settings.max_degree,
    )  # fmt: skip


def _box_edges(settings):
    image = np.array(settings.shape[::-1]) * settings.voxel_size
    return image + 2 * settings.margin * settings.d50


def _write_surfaces(path, packing, which, corner):
    """Whole grains that the image shows, in its coordinates and with its labels."""
    directions, triangles = icosphere(4)
    grains = packing.grains.part(which)
    place = grains.surface(directions)
    x = packing.centre[which, None] + np.einsum("gij,gkj->gki", packing.axes[which], place) - corner
    m = len(directions)
    faces = triangles[None] + m * np.arange(len(which))[:, None, None]
    np.savez_compressed(
        path,
        vertices=x.reshape(-1, 3).astype(np.float32),
        faces=faces.reshape(-1, 3).astype(np.int32),
        grain_of_face=np.repeat(np.arange(1, len(which) + 1), len(triangles)).astype(np.int32),
    )


def _numbers(settings, packing, labels, rows, contacts, **more):
    """What the command prints and writes as JSON: each quantity once, of what is written."""
    n = len(rows)
    inside = [row for row in rows if not row["touches_border"]]
    own = {row["label"] for row in inside}

    def coordination(pairs):
        """Mean number of contacts of the grains that the border does not cut."""
        ends = [label for pair in pairs for label in pair if label in own]
        return len(ends) / max(len(own), 1)

    touching = touching_labels(labels)
    overlaps = np.array([max(-row["gap_m"], 0.0) for row in contacts])
    d50, uniformity = sizes_by_mass(packing.grains.diameter)
    whole = np.array([row["whole_volume_m3"] for row in rows])
    return {
        "shape": list(labels.shape),
        "voxel_size": settings.voxel_size,
        "num_packed_grains": packing.grains.num_grains,
        "num_grains": n,
        "num_border_grains": n - len(inside),
        "packed_d50": d50,
        "packed_uniformity": uniformity,
        "mean_elongation": float(np.mean([row["elongation"] for row in rows])),
        "mean_flatness": float(np.mean([row["flatness"] for row in rows])),
        "mean_whole_diameter": float(np.cbrt(6 / np.pi * whole).mean()),
        "porosity_of_labels": float(1 - np.count_nonzero(labels) / labels.size),
        "coordination_number_of_labels": coordination(touching),
        "num_label_contacts": len(touching),
        "mean_overlap_voxels": float(overlaps[overlaps > 0].mean() / settings.voxel_size)
        if (overlaps > 0).any()
        else 0.0,
        "largest_overlap_voxels": float(overlaps.max(initial=0) / settings.voxel_size),
        "packing_steps": packing.num_steps,
        **more,
    }
