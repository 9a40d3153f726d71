"""Two balls head on in YADE, the rigid limit: Hertz's spring between balls that do not deform.

    yade -n -x yade_impact.py SCENE.json

prints one line of JSON behind `RESULT `: times [s], force [N] and approach of the two centres [m]
at each step, speed after over speed before, and time of the processor [s].
"""

import json
import sys
import time

from yade import (
    Bo1_Sphere_Aabb,
    ForceResetter,
    FrictMat,
    Ig2_Sphere_Sphere_ScGeom,
    InsertionSortCollider,
    InteractionLoop,
    Ip2_FrictMat_FrictMat_MindlinPhys,
    Law2_ScGeom_MindlinPhys_Mindlin,
    NewtonIntegrator,
    O,
    utils,
)

with open(sys.argv[-1], encoding="utf-8") as file:
    scene = json.load(file)
R, v, duration = scene["radius"], scene["speed"], scene["duration"]
material = O.materials.append(
    FrictMat(young=scene["E"], poisson=scene["nu"], density=scene["rho"], frictionAngle=0.0)
)
gap = scene["gap"]
for z, sign in ((0.0, 1.0), (2 * R + gap, -1.0)):
    number = O.bodies.append(utils.sphere((0, 0, z), R, material=material))
    O.bodies[number].state.vel = (0, 0, sign * v)
O.engines = [
    ForceResetter(),
    InsertionSortCollider([Bo1_Sphere_Aabb()], verletDist=0.1 * R),
    InteractionLoop(
        [Ig2_Sphere_Sphere_ScGeom()],
        [Ip2_FrictMat_FrictMat_MindlinPhys()],
        [Law2_ScGeom_MindlinPhys_Mindlin()],
    ),
    NewtonIntegrator(damping=0.0),
]
O.dt = scene["time_step"]
times, force, approach = [], [], []
begin = time.process_time()
while O.time < duration:
    O.step()
    times.append(O.time)
    force.append(abs(O.forces.f(1)[2]))
    approach.append(2 * R - (O.bodies[1].state.pos[2] - O.bodies[0].state.pos[2]))
seconds = time.process_time() - begin
result = {"time": times, "force": force, "approach": approach,
          "restitution": O.bodies[1].state.vel[2] / v, "seconds": seconds}  # fmt: skip
print("RESULT " + json.dumps(result), flush=True)
