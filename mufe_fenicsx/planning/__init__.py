"""From a scene and an accuracy: how much model the test needs, and what it will cost.

The error of a plan is the sum of its parts (`errors`); the plan is the cheapest that keeps the
sum below what is wanted. Its cost goes with

    tetrahedra · steps  ~  n t / (h g),

n tetrahedra a grain, h the length of edges at contacts, t the time of loading, g the gain in time
step by added mass. What is chosen depends on the scene, the grains and the table alone, not on the
machine: a run that goes on finds the same plan again. Times and memory are those of this
machine (`cost`).
"""
