"""Which computations a chart is made of: for each case lines of choices, each over mesh sizes."""

from ...analysis.evidence import command_of

#: What the parameters say when a line of the chart changes nothing: averaged pressure, layer
#: matched to the mesh, time steps from the assembled system, no mass added, loading = 1.
OURS = "averaged"
SEED = "seed's method"
#: Lines by name: what differs from that.
LINES = {
    OURS: {},
    SEED: {"element": "p1", "time_step": "element"},
    "plain P1": {"element": "p1"},
    "stiff penalty": {"law": "stiff"},
    "kinematic law": {"law": "kinematic"},
    "contact at nodes": {"law": "nodes"},
    "four points": {"law": "four"},
    "element's time step": {"time_step": "element"},
    "mass 1 %": {"added_mass": 0.01},
    "mass 5 %": {"added_mass": 0.05},
    "mass 20 %": {"added_mass": 0.2},
    "loading x 2": {"loading": 2.0},
    "loading x 4": {"loading": 4.0},
    "mass 1 %, loading x 2": {"added_mass": 0.01, "loading": 2.0},
    "mass 5 %, loading x 1.5": {"added_mass": 0.05, "loading": 1.5},
    "mass 5 %, loading x 2": {"added_mass": 0.05, "loading": 2.0},
    "kinematic law, loading x 2": {"law": "kinematic", "loading": 2.0},
    "static": {"integrator": "static"},
    "implicit": {"integrator": "implicit"},
    "rigid": {"fidelity": "rigid"},
    "elastic": {"fidelity": "elastic"},
    "auto": {"fidelity": "auto"},
    "another rounding": {"time_step_factor": 0.85},
    "one layer": {"layers": 1},
    "sample 2": {"sample": 2},
    "sample 3": {"sample": 3},
}
#: The parameter that sets the mesh.
SIZE = {
    **dict.fromkeys(
        ("hertz", "mindlin", "impact", "plastic-sphere", "cylinder-wall", "tool"),
        "elements_per_radius",
    ),
    **dict.fromkeys(("oedometer", "jammed"), "element_size"),
    "membrane": "ends_over_t",
    "sample": "elements_per_diameter",
}

#: For each case: sizes of the main lines, of the others, and of the finest ones of `--full`;
#: main lines; others.
CHARTS = {
    "hertz": (
        (0.6, 0.75, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0), (1.5, 2.5), (6.0,),
        (OURS, "four points", SEED, "plain P1", "mass 1 %", "mass 5 %", "mass 20 %", "static"),
        ("stiff penalty", "kinematic law", "contact at nodes", "element's time step", "loading x 2",
         "loading x 4", "mass 5 %, loading x 2", "implicit"),
    ),
    "mindlin": (
        (0.75, 1.0, 1.5, 1.75, 2.0, 2.25, 2.5, 3.0, 3.5), (1.5,), (5.0,),
        (OURS, "four points", SEED, "plain P1", "mass 1 %", "mass 5 %", "mass 20 %", "loading x 2",
         "mass 1 %, loading x 2", "mass 5 %, loading x 1.5", "mass 5 %, loading x 2"),
        ("stiff penalty", "contact at nodes", "element's time step", "loading x 4", "static"),
    ),
    "impact": (
        (0.5, 0.75, 1.0, 1.5, 1.75, 2.0, 2.25, 2.5, 3.0, 3.5, 4.0), (1.5, 2.5), (6.0,),
        (OURS, "four points", SEED, "plain P1", "mass 1 %", "mass 5 %", "mass 20 %"),
        ("stiff penalty", "kinematic law", "contact at nodes", "element's time step", "rigid"),
    ),
    "plastic-sphere": (
        (0.75, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0), (1.5, 2.5), (6.0,),
        (OURS, "four points", SEED, "plain P1", "mass 1 %", "mass 5 %", "mass 20 %"),
        ("stiff penalty", "contact at nodes", "element's time step", "loading x 2", "loading x 4",
         "static"),
    ),
    "oedometer": (
        (0.8, 0.5, 0.35, 0.25), (0.5,), (0.2,),
        (OURS, SEED, "plain P1", "mass 1 %", "mass 5 %", "mass 20 %"),
        ("stiff penalty", "kinematic law", "element's time step", "loading x 2", "loading x 4",
         "mass 5 %, loading x 2", "rigid", "elastic", "auto", "another rounding"),
    ),
    "jammed": (
        (1.0, 0.7, 0.5, 0.35), (0.5,), (0.25,),
        (OURS, SEED, "plain P1", "kinematic law", "mass 1 %", "mass 5 %", "mass 20 %",
         "kinematic law, loading x 2", "mass 5 %, loading x 2"),
        ("stiff penalty", "element's time step", "loading x 2", "loading x 4", "rigid",
         "elastic", "auto", "another rounding"),
    ),
    "cylinder-wall": (
        (1.0, 1.5, 2.0, 2.5, 3.5), (), (),
        (OURS, "plain P1", "mass 1 %", "mass 5 %", "mass 20 %", "static"), (),
    ),
    "tool": (
        (1.0, 1.5, 2.0, 2.5), (), (3.5,),
        (OURS, "plain P1", "mass 1 %", "mass 5 %", "mass 20 %", "static"), (),
    ),
    "membrane": (
        (2.0, 1.0, 0.5), (), (0.25,), (OURS, "plain P1", "one layer", "mass 1 %", "mass 5 %"), (),
    ),
    "sample": (
        (5.0, 7.0, 10.0), (5.0, 7.0, 10.0, 14.0), (14.0,), (SEED, "plain P1"),
        (OURS, "mass 20 %", "elastic", "sample 2", "sample 3"),
    ),
}  # fmt: skip


def grid(case, full=False):
    """(series, parameters, command) of all computations of a case, the cheapest meshes first.

    Args:
        case: One of ``CHARTS``.
        full: All lines over all sizes, and the finest ones.
    """
    main_sizes, other_sizes, finest, main, others = CHARTS[case]
    if full:
        main_sizes = other_sizes = main_sizes + finest
    rows = []
    for lines, sizes in ((main, main_sizes), (others, other_sizes)):
        for name in lines:
            for k, size in enumerate(sizes):
                parameters = {SIZE[case]: size, **LINES[name]}
                rows.append((k, name, parameters, command_of(case, parameters)))
    return [row[1:] for row in sorted(rows, key=lambda row: row[0])]
