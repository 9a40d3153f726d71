"""How deep grains lie in each other at the stored states of a run, found with the library ipctk.

    python demos/check_intrusion.py RUN

reads RUN/fields as `mufe run` wrote it and prints, for each state, the deepest point of a
grain's surface inside another grain over the mean edge of the surface facets. Nothing of the
contact operator takes part. Needs the extra ``test``.
"""

import argparse
import json
import math
import sys
from pathlib import Path

import h5py
import numpy as np

from mufe_fenicsx.errors import InputError
from mufe_fenicsx.geometry.measure import boundary_triangles
from mufe_fenicsx.verification.intrusion import find_intrusion


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("run", type=Path, help="folder that `mufe run` wrote")
    fields = parser.parse_args().run / "fields"
    try:
        print(f"{'state':>8} {'deepest over h':>15} {'at a vertex':>12}  grains")
        for path in states(fields):
            found, labels, h = intrusion_of(path)
            grains = (
                "" if found.bodies is None else " in ".join(str(labels[b]) for b in found.bodies)
            )
            print(
                f"{path.stem:>8} {found.depth / h:15.4f} {found.vertex_depth / h:12.4f}  {grains}"
            )
    except (InputError, OSError) as error:
        sys.exit(f"error: {error}")


def states(fields):
    """Files of the stored states in the order of time."""
    series = json.loads((fields / "states.vtkhdf.series").read_text())
    return [fields / item["name"] for item in series["files"]]


def intrusion_of(path):
    """What of the grains' surfaces is inside other grains; their labels; mean facet edge [m]."""
    with h5py.File(path) as file:
        data = file["VTKHDF"]
        x = data["Points"][:] + data["PointData/displacement"][:]
        cells = data["Connectivity"][:].reshape(-1, 4)
        grain = data["CellData/grain"][:]
    facets = boundary_triangles(cells)
    labels, body_of_cell = np.unique(grain, return_inverse=True)
    body = np.zeros(len(x), dtype=np.int64)
    body[cells] = body_of_cell[:, None]
    a, b, c = (x[facets[:, i]] for i in range(3))
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).mean()
    h = math.sqrt(4 / math.sqrt(3) * area)
    nodes, local = np.unique(facets, return_inverse=True)
    return find_intrusion(x[nodes], local.reshape(-1, 3), body[nodes], 0.3 * h), labels, h


if __name__ == "__main__":
    main()
