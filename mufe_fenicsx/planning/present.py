"""What error a test has as it stands: with the present mesh, speed and models of grains."""

import math
from dataclasses import dataclass, field

from ..analysis.evidence import read_points
from .choice import fidelity_of, law_of
from .course import course_of, wave_speed
from .errors import (
    FASTEST,
    contact_radius,
    flows,
    of_loading,
    quasi_static_from,
    sample_errors,
    untrusted_start,
)
from .reasons import of_cracks, unknown
from .servo import lagging_servos


@dataclass(frozen=True)
class Present:
    """How far off the forces of a test are expected to be."""

    error: float  #: the sum of its parts [-]; inf: one of them is worse than any that is known
    parts: dict  #: name -> error
    elements: float  #: per radius of a typical contact
    tets: float  #: tetrahedra a grain
    size: float  #: length of edges at contacts [m]
    element: str  #: one of solid.ELEMENTS
    law: str  #: of contact, as the table of points names it
    fidelity: dict  #: model -> labels of grains
    speed: float  #: of loading [m/s]
    time: float  #: of loading over that of a wave through the sample
    quasi_static_from: float  #: part of the strain, as of :func:`~.errors.quasi_static_from`
    path: float  #: by how much two such tests part that differ in rounding alone [-]
    cracks: str = ""  #: edges that they want beside those of the mesh, in words
    beyond: tuple = field(default=())  #: why parts are infinite, in words
    unknown: tuple = field(default=())  #: what is not known beforehand, sentences
    warnings: tuple = field(default=())  #: what the report will not accept, lines


def present_state(scene, sample, points=None):
    """The :class:`Present` of a scene and its grains.

    Args:
        scene: :class:`~mufe_fenicsx.scene.Scene`.
        sample: :class:`~.sample.Sample`.
        points: Of the table; None: the stored one.

    Raises:
        InputError: Nothing is known of its element, integrator or law of contact.
    """
    points = read_points() if points is None else points
    law = law_of(scene) or "matched"
    yields = flows(scene.material)
    errors = sample_errors(points, scene.solver.element, law, yields)
    fidelity, course = fidelity_of(scene, sample.labels), course_of(scene)
    elements = contact_radius(scene.material) * sample.diameter / sample.size
    wave = wave_speed(scene)
    if scene.quasi_static is None:
        time, key, speed = min(
            (part.level * wave / part.stated, f'stage "{part.name}": speed', part.stated)
            if part.stated
            else (part.level * wave / course.speed, course.key, course.speed)
            for part in course.parts
        )
    else:
        time, key, speed = max(1 / math.sqrt(3 * scene.quasi_static.kinetic), FASTEST), "", 0.0
    added = 0.0 if scene.mass_scaling is None else scene.mass_scaling.added
    masses = [mass for mass in errors.masses if mass >= added * (1 - 1e-9)]
    parts = {
        "mesh": errors.of_mesh(elements),
        "loading": of_loading(time) if course.presses else 0.0,
        "mass": errors.masses[min(masses)][0] if masses else math.inf,
        "fidelity": sum(
            len(own) * errors.fidelities.get(model, math.inf) for model, own in fidelity.items()
        )
        / len(sample.labels),
    }
    start = quasi_static_from(scene, course.presses, time)
    return Present(
        error=sum(parts.values()),
        parts=parts,
        elements=elements,
        tets=sample.tets,
        size=sample.size,
        element=scene.solver.element,
        law=law,
        fidelity=fidelity,
        speed=speed or course.speed,
        time=time,
        quasi_static_from=start,
        path=errors.of_path(len(sample.labels)),
        cracks=of_cracks(scene, sample, sample.tets),
        beyond=_beyond(parts, errors, elements, time, added),
        unknown=unknown(scene, errors, elements, sample.slender),
        warnings=(
            *sample.warnings,
            *lagging_servos(scene),
            *untrusted_start(start, key, speed),
        ),
    )


def _beyond(parts, errors, elements, time, added):
    """Why parts of the error are infinite: what the test has, and what is measured."""
    coarsest, error = errors.mesh[0]
    reasons = {
        "mesh": f"the mesh has {elements:.2g} elements per contact radius, and with "
        f"{coarsest:.2g}, the coarsest measured, forces are {100 * error:.2g} % off: here by more",
        "loading": f"loading takes {time:.2g} times as long as a wave takes through the sample, "
        f"and errors are known from {FASTEST:g} times on",
        "mass": f"{added:.2g} of the mass is added, and errors are measured up to "
        f"{max(errors.masses):.2g}",
        "fidelity": "a model of grains is not among those measured: "
        + ", ".join(errors.fidelities),
    }
    return tuple(reasons[name] for name, part in parts.items() if math.isinf(part))
