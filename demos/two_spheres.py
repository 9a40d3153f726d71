"""Do two elastic balls push each other apart as Hertz says?

By symmetry each ball is cut at its equator and glued to a platen there. For the approach δ of
the platens, F = 4/3 E* √(R* δ³) with 1/R* = 2/R and 1/E* = 2 (1 - ν²)/E.
"""

import argparse

import mufe_fenicsx as mufe  # first: one BLAS thread, the wheel's MPI

# isort: split
import matplotlib.pyplot as plt
import numpy as np
from mpi4py import MPI

from mufe_fenicsx.theory.hertz import effective_modulus, hertz_force

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--figure", help="file that a figure is saved to")
figure = parser.parse_args().figure

glass = mufe.Elastic(E=70e9, nu=0.22, rho=2500.0)
R, a = 1e-3, 0.02e-3  # radius of the balls, and of their contact at the end [m]
up, approach = np.array([0.0, 0.0, 1.0]), 2 * a**2 / R

# Four edges of the mesh over the contact radius. The poles are at the origin.
points, cells = mufe.half_ball(R, h_contact=a / 4, growth=0.25, direction=up, contact_radius=a)
points = points - points[:, 2].max() * up
lower, upper = (points, cells), (points * [1, -1, -1], cells)  # half a turn about x

low, high = lower[0].min(axis=0), upper[0].max(axis=0)
bottom = mufe.Wall("bottom", low, up, bonded=True)
top = mufe.Wall("top", high, -up, velocity=-approach * up, bonded=True)  # there after 1 s
bodies, walls = [lower, upper], [bottom, top]
test = mufe.build(MPI.COMM_SELF, bodies, glass, low, high, axes="", walls=walls, increment=0.1)

print("approach [nm]  force [N]  Hertz [N]")
for _ in range(10):
    test.step()  # a static increment of 0.1 s
    delta, force = high[2] - test.walls.point[1, 2], test.wall_forces()[1]
    hertz = hertz_force(delta, R / 2, effective_modulus(*[(glass.E, glass.nu)] * 2))
    print(f"{1e9 * delta:13.0f}  {force:9.4f}  {hertz:9.4f}")
    plt.plot(1e9 * delta, force, "ko", 1e9 * delta, hertz, "r+")
    # 1 % because a ball is no half-space; 2 % for the mesh, at three edges a radius or more.
    assert delta < 0.5 * approach or abs(force / hertz - 1) < 0.03

if figure:
    plt.gca().set(xlabel="approach [nm]", ylabel="force [N], computed (o) and by Hertz (+)")
    plt.savefig(figure)
