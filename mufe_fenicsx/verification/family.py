"""The benchmark scene: a sand as that of Nadimi & Fonseca (2018), and smaller parts of it.

400 × 400 × 200 voxels of 5 µm, d50 = 281 µm by mass, packed without friction, then imaged and
segmented like a scan; 617 grains, those cut by the image's border included. Meshed to about as many
nodes and tetrahedra a grain as the paper's 630, fine at the surface and coarser inside. Smaller
members are cut out of the labels and meshed to the same size of elements.
"""

import math
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import scipy.ndimage

from ..errors import InputError

#: Voxels (z, y, x) of the members, by the number of grains that they are named after.
MEMBERS = {
    8: (60, 60, 60),
    20: (90, 90, 90),
    60: (130, 130, 130),
    200: (200, 215, 215),
    630: (200, 400, 400),
}
#: d50 [m] and d60/d10 by mass: with them the sample has about as many grains as the paper's.
D50, UNIFORMITY = 281e-6, 1.97
#: What is left of a grain by the cut is kept from so many voxels on, and this thickness [voxels].
LEAST_VOXELS, LEAST_THICKNESS = 650, 4
#: Wanted length of edges at the surface [m], and of those inside over it.
SIZE, INNER = 12.8e-6, 2.0
#: For a grain [s], for busy machines too.
TIME_LIMIT = 3600.0
#: Mass that may be added for a longer step, over that of all grains, and kinetic over internal
#: energy that the speed follows. Curves of five samples of 20 grains to a strain of 0.1 are higher
#: by 0.4 % in the mean than with a tenth of the mass and a quarter of the energy, and take 0.49 of
#: the steps (records).
ADDED, KINETIC = 0.2, 0.036
#: Difference of the platens' forces over their mean that it follows, over the root of that ratio.
#: It is for a mean over part of a wave: the largest value is 1.3 times it in one sample of two.
UNBALANCED = 0.137


def member(cache, number, size=SIZE):
    """Folder of a member's grain meshes, made where absent.

    Args:
        cache: Folder where scan, labels and meshes are kept for the next time.
        number: One of ``MEMBERS``.
        size: Wanted length of edges at the surface [m].

    Raises:
        InputError: There is no such member, or a grain could not be meshed: it would be another
            sample.
    """
    from ..geometry.mesh import mesh_labels
    from ..geometry.settings import MeshSettings

    if number not in MEMBERS:
        raise InputError(f"grains = {number}, expected one of {', '.join(map(str, MEMBERS))}")
    folder = Path(cache) / f"sand-{number}-{size * 1e6:g}um"
    if not (folder / "grains").exists():
        folder.mkdir(parents=True, exist_ok=True)
        labels = _labels(Path(cache), number, folder)
        settings = MeshSettings(
            size=size, inner_size=INNER, keep_largest_piece=True, time_limit=TIME_LIMIT
        )
        made = mesh_labels(labels, settings, folder / "grains")
        if made["failed"]:
            shutil.rmtree(folder / "grains")
            raise InputError(f"grain {made['failed'][0]}: {made['reasons'][0]}, expected its mesh")
    return folder.resolve()


def scene_file(folder, number, strain=0.1, speed=2.0, added=ADDED, kinetic=KINETIC):
    """Write the test of a member into its folder; returns its path.

    Material, friction and seating are those of any synthetic scan; the speed follows targets, and
    slices of grains at the walls may double their mass for a longer step.

    Args:
        folder, number: Of the member.
        strain, speed: At the end, and of the platen where nothing leads it [m/s].
        added: Mass that may be added over that of all grains.
        kinetic: Kinetic over internal energy that the speed follows.
    """
    from ..scene import MassScaling, Output, QuasiStatic, load_scene, scene_to_toml

    of_scan = load_scene(_scan(folder.parent) / "scene.toml")
    scene = replace(
        of_scan,
        title=f"Sand of {number} grains, oedometer test as of Nadimi & Fonseca (2018)",
        image=None,
        sample=replace(of_scan.sample, grains=folder / "grains"),
        oedometer=replace(of_scan.oedometer, strain=strain, speed=speed),
        quasi_static=QuasiStatic(
            kinetic=kinetic, unbalanced=UNBALANCED * math.sqrt(kinetic), loaded=0.5 * strain
        ),
        mass_scaling=MassScaling(added=added, added_to_grain=1.0),
        output=Output(fields=5, history=500, checkpoint=600.0),
    )
    path = folder / "scene.toml"
    path.write_text(scene_to_toml(scene), encoding="utf-8")
    return path


def _scan(cache):
    return cache / f"sand-scan-{UNIFORMITY:g}"


def _labels(cache, number, folder):
    """Label image of a member: a corner of that of the largest."""
    from ..geometry.image.label_files import read_labels, write_labels
    from ..geometry.segment import segment_image
    from ..scene import load_scene
    from ..synthetic.pipeline import synthesize
    from ..synthetic.settings import SynthesisSettings

    scan = _scan(cache)
    if not scan.exists():
        synthesize(SynthesisSettings(shape=MEMBERS[630], d50=D50, uniformity=UNIFORMITY), scan)
    whole = scan / "labels.tif"
    if not whole.exists():
        settings = load_scene(scan / "scene.toml").image
        segment_image(settings.path, settings, whole)
    labels, voxel = read_labels(whole)
    part = labels[tuple(slice(n) for n in MEMBERS[number])].copy()
    # Shavings of grains that the cut leaves at its faces.
    for label, box in enumerate(scipy.ndimage.find_objects(part), 1):
        if box is not None:
            mine = part[box] == label
            if mine.sum() < LEAST_VOXELS or min(mine.shape) < LEAST_THICKNESS:
                part[box][mine] = 0
    _, numbered = np.unique(part, return_inverse=True)
    path = folder / "labels.tif"
    write_labels(path, numbered.reshape(part.shape), voxel)
    return path
