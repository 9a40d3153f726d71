"""Contact networks of which all is known."""

import numpy as np

from mufe_fenicsx.contact.results.network import Contacts, Network
from mufe_fenicsx.contact.results.patches import Patches


def lattice_network(force, counts=(2, 2, 3), D=2e-4, n=1.5):
    """Balls on a lattice of spacing D under a vertical force on each column, at rest.

    Friction, half of what is allowed, acts in the contacts between grains and adds up to nothing.
    Each contact is one patch of ``n`` elements per radius.
    """
    places = np.array(list(np.ndindex(*counts)))
    number = {tuple(p): k for k, p in enumerate(places)}
    centre = D * (places + 0.5)
    a, b, at, f, t, branch = [], [], [], [], [], []
    up = np.array([0.0, 0.0, 1.0])
    shear = 0.25 * force * np.array([1.0, 0.0, 0.0])
    for (x, y, z), k in number.items():
        if z == 0:  # on the floor
            a, b = [*a, k], [*b, len(places) + 4]
            at, f, t = [*at, centre[k] - D / 2 * up], [*f, force * up], [*t, 0 * up]
            branch = [*branch, D / 2 * up]
        if z + 1 < counts[2]:
            a, b = [*a, k], [*b, number[x, y, z + 1]]
            sign = (-1) ** (x + y)
            at, f = [*at, centre[k] + D / 2 * up], [*f, -force * up + sign * shear]
            t, branch = [*t, sign * shear], [*branch, -D * up]
        else:
            a, b = [*a, k], [*b, len(places) + 5]
            at, f, t = [*at, centre[k] + D / 2 * up], [*f, -force * up], [*t, 0 * up]
            branch = [*branch, -D / 2 * up]
    order = np.lexsort((b, a))
    a, b, at, f, t, branch = (np.array(v)[order] for v in (a, b, at, f, t, branch))
    num = len(a)
    normal = (f - t) / force
    contacts = Contacts(
        a=a, b=b, num_points=np.full(num, 30), area=np.full(num, 1e-10),
        area_deformed=np.full(num, 1.1e-10), normal=normal, centroid=at, branch=branch, force=f,
        friction=t, torque=np.zeros((num, 3)), work=np.zeros(num),
    )  # fmt: skip
    area, between = np.full(num, 1e-10), b < len(places)
    moment = area / np.pi * (0.25 - 1.0 / (24.0 * n**2))  # 2 n elements across
    patches = Patches(
        a=a, b=b, num_points=np.full(num, 30), area=area, area_deformed=1.1 * area,
        edge=np.sqrt(area / np.pi) / n, elements_per_radius=np.full(num, n),
        moment=moment[:, None, None] * np.eye(3), normal_force=np.full(num, force),
        overlap=1e-5 * area, force_share=1 / np.where(between, between.sum(), (~between).sum()),
        yield_stress=np.full(num, 1e8), between_grains=between,
    )  # fmt: skip
    walls = ["x_min", "x_max", "y_min", "y_max", "z_min", "z_max"]
    labels = np.arange(10, 10 + len(places))
    whole = np.ones(len(places), dtype=np.int64)
    return Network(labels, walls, np.ones(len(places)), centre, contacts, patches, whole)
