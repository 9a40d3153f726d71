"""The scene file that goes with a synthetic scan."""

from ..materials.sand import scene_table

TEXT = """\
# Oedometer test on a synthetic scan. In this folder:
#
#     mufe segment --scene scene.toml -o labels.tif
#     mufe mesh labels.tif --scene scene.toml -o grains
#     mufe run scene.toml -o results
#
# Without segmentation: mufe mesh truth_labels.tif, or whole grains: mufe mesh surfaces.npz.

title = "Synthetic sand, seed {seed}"

[image]
file = "grey.tif"
voxel_size = "{voxel:.9g} m"
threshold = "middle"      # of the grey levels of both phases
min_grain_voxels = {min_voxels}

[mesh]
size = "{size:.4g} m"

[sample]
grains = "grains"

{material}
[contact]
friction = 0.23

[oedometer]
strain = 0.1
speed = "1.8 m/s"
seating_stress = "1.5 MPa"
"""


def scene_text(settings):
    """Scene (TOML) for the files of a synthetic scan; see `scene.load_scene`."""
    grain = (settings.d50 / settings.voxel_size) ** 3 / 2
    return TEXT.format(
        material=scene_table(),
        seed=settings.seed,
        voxel=settings.voxel_size,
        min_voxels=max(8, int(0.01 * grain)),
        size=settings.d50 / 8,
    )
