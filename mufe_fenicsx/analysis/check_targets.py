"""What the checks of a run allow, and their words."""

from mufe_fenicsx.analysis import quasi_static

#: Largest values allowed.
TARGETS = {
    "kinetic": quasi_static.KINETIC,
    "platens": quasi_static.UNBALANCED,
    "tool": quasi_static.UNBALANCED,
    "residual": 0.001,
    "switching": 0.01,
    "opening": quasi_static.KINETIC,  # what nothing gave, as much as may be in motion
    "overlap": 0.01,
    "load": 0.5,
    "held": 0.05,
}

#: Each check in a word or two.
NAMES = {
    "all": "all",
    "trusted": "inertia",
    "kinetic": "kinetic energy",
    "platens": "unbalanced force",
    "tool": "unbalanced force",
    "residual": "energy residual",
    "switching": "facet switching",
    "opening": "opened facets",
    "overlap": "overlap",
    "load": "lost load",
    "held": "held stresses",
    "contacts": "mesh of contacts",
    "carriers": "grains that carry",
    "bridges": "grains from wall to wall",
    "height": "height",
    "doubtful": "doubtful contacts",
}

#: What each target is about, and what follows where it is met and where it is not.
WORDS = {
    "kinetic": (
        "Kinetic over internal (elastic + plastic) energy",
        "the inertia of the grains is negligible: the test is quasi-static",
        "inertia adds to the forces: lower the speed of the platen",
    ),
    "platens": (
        "Unbalanced force: top against bottom platen, less what side walls and others carry",
        "the sample is in equilibrium",
        "the sample is not in equilibrium: lower the speed of the platen",
    ),
    "tool": (
        "Unbalanced force: the tool against all walls, along the force of the tool",
        "the sample is in equilibrium",
        "the sample is not in equilibrium: lower the speed of the tool",
    ),
    "residual": (
        "Energy residual over the work of the walls",
        "the energy balance closes",
        "energy is created or lost: lower the time step, and look at the contacts",
    ),
    "switching": (
        "Energy gained or lost where contacts switch facets, over the work of the walls",
        "the facets of the mesh have no effect",
        "contacts slide over sharp edges or very uneven facets: mesh them finer or more evenly",
    ),
    "opening": (
        "Energy that first springs of cracks gave, which they no longer store, and nodes that "
        "parted, over the work of the walls",
        "cracks take the energy of the loading alone",
        "cracks run on energy that nothing gave: mesh finer, or raise fracture.energy",
    ),
    "overlap": (
        "Volume where grains overlap each other or walls, over that of the grains",
        "the void ratio is that of their outlines",
        "pores stay open that grains should fill, which softens the sample: mesh the grains finer",
    ),
    "held": (
        "Stress of walls that a servo leads, off what it is to be, over that",
        "stresses are those asked for",
        "the servo lags, and the path of stress is another one: lower the speed of loading",
    ),
    "load": (
        "Vertical stress lost while the sample was compressed, over what the stage had added",
        "the sample carries its load",
        "the packing collapsed: too few grains, a loose packing, or a failure surface",
    ),
}
