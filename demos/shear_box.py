"""Draw a direct shear test, a run of the scene of `mufe new shear-box`.

On the left the middle of the box is cut at the
last stored state: grains by how far they went along x, and the three tools. On the right are the
friction on the plane between the halves and the rise of the lid, over the way of the upper half:

    τ/σ = F_x/F_z of the lower half,  the lid's displacement along z.
"""

import argparse
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import pyvista

import mufe_fenicsx as mufe

MM = 1e3


def cut(run):
    """Outlines of grains and tools in the plane y = middle, and displacement along x [mm]."""
    number = int(run.stored_states[-1]["index"])
    grid = pyvista.read(run.path / "fields" / f"{number:04d}.vtkhdf")
    grid = grid.warp_by_vector("displacement")
    tools = pyvista.read(run.path / "tools" / f"{number:04d}.vtkhdf")
    middle = tools.center
    return grid.slice("y", origin=middle), tools.slice("y", origin=middle)


def draw(run, path):
    """The figure; returns the largest friction."""
    history = run.history
    shearing = history["stage"] == "shear"
    shear, normal = history["force_lower_x"][shearing], -history["force_lower_z"][shearing]
    way = MM * history["displacement_upper_x"][shearing]
    rise = MM * history["displacement_lid_z"][shearing]
    figure, (left, right) = plt.subplots(
        1, 2, figsize=(9, 3.6), width_ratios=(1.25, 1), layout="constrained"
    )
    grains, tools = cut(run)
    points, moved = MM * grains.points, MM * grains["displacement"][:, 0]
    cells = grains.triangulate().faces.reshape(-1, 4)[:, 1:]
    shades = left.tripcolor(
        points[:, 0], points[:, 2], cells, moved, shading="gouraud", cmap="viridis"
    )
    for a, b in tools.lines.reshape(-1, 3)[:, 1:]:
        left.plot(*(MM * tools.points[[a, b]][:, [0, 2]].T), color="black", lw=1.2)
    left.set(aspect="equal", xlabel="x [mm]", ylabel="z [mm]")
    figure.colorbar(shades, ax=left, label="displacement along x [mm]", shrink=0.85)
    right.plot(way, shear / normal, color="C0")
    right.set(xlabel="way of the upper half [mm]", ylabel="shear over normal force")
    right.yaxis.label.set_color("C0")
    other = right.twinx()
    other.plot(way, 1e3 * (rise - rise.iloc[0]) if len(rise) else rise, color="C1")
    other.set_ylabel("rise of the lid [µm]", color="C1")
    figure.savefig(path, dpi=130)
    return float(np.max(shear / normal)) if len(way) else np.nan


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("run", type=Path, help="folder of the run")
    parser.add_argument("figure", type=Path, help="PNG to write")
    given = parser.parse_args()
    largest = draw(mufe.open_run(given.run), given.figure)
    print(f"largest shear over normal force {largest:.2f}")
