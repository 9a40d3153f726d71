"""The ball of hertz-point and plastic-sphere-point, and the impact, in other programs.

`ball` makes the scene, `calculix` writes and reads a deck. `akantu_ball`, `kratos_ball` and
`yade_impact` are scripts that an interpreter with that program runs: a scene file in, one line of
JSON out, nothing of this package needed.
"""
