"""The cheapest plan that meets an accuracy, among those that the table of points knows."""

import math
from dataclasses import dataclass, field, replace

from ..analysis.evidence import read_points
from ..errors import InputError
from ..materials.auto import Auto
from ..materials.elastic import Elastic
from ..materials.rigid import Rigid
from ..scene import Contact, MassScaling, Output
from .course import course_of, wave_speed
from .errors import (
    FASTEST,
    best_law,
    checked_accuracy,
    contact_radius,
    flows,
    of_loading,
    planned_time,
    quasi_static_from,
    sample_errors,
    time_for,
    untrusted_start,
)
from .reasons import driver, of_cracks, out_of_reach, stage_too_fast, too_simple, unknown
from .servo import lagging_servos

#: What the table calls a law of contact, by what a scene says.
LAWS = {"matched": {"law": "matched"}, "kinematic": {"law": "kinematic"},
        "stiff": {"law": "matched", "compliance": 0.02},
        "nodes": {"law": "matched", "points": "nodes"},
        "four": {"law": "matched", "points": "facets4"}}  # fmt: skip
#: Parts into which the allowed error is cut in the search for the cheapest plan.
CUTS = 40
#: Grains that are meshed finer than they need be are kept up to this cost over the least.
WORTH_MESHING = 1.5
#: Strain between two stored states.
STATE_STRAIN = 0.01


@dataclass(frozen=True)
class Plan:
    """How much model a test needs."""

    accuracy: float  #: wanted error of the stress [-]
    error: float  #: expected one, the sum of its parts
    parts: dict  #: name -> error
    elements_per_radius: float  #: of a typical contact
    tets: float  #: tetrahedra a grain
    size: float  #: length of edges near contacts [m]
    inner_size: float  #: the same inside grains [m]
    mesh_again: bool  #: the grains have to be meshed anew, with ``size``
    element: str  #: one of solid.ELEMENTS
    fidelity: dict  #: model -> labels of grains
    settings: dict  #: "table.key" -> value, where it is another than the scene's
    quasi_static_from: float  #: part of the strain, as of :func:`~.errors.quasi_static_from`
    driver: str  #: which requirement the cost comes from
    path: float  #: by how much two such tests part that differ in rounding alone [-]
    cracks: str = ""  #: edges that they want beside those of the mesh, in words
    unknown: tuple = field(default=())  #: what the plan cannot know, sentences
    warnings: tuple = field(default=())  #: what the report will not accept, lines


def plan_scene(scene, sample, accuracy=None, points=None, keep_mesh=False):
    """The cheapest plan that meets an accuracy.

    What the scene states other than its default is kept; the speed of loading is planned, unless
    the scene has [quasi_static].

    Args:
        scene: :class:`~mufe_fenicsx.scene.Scene`.
        sample: :class:`~.sample.Sample`.
        accuracy: Wanted error of the forces; None: the scene's.
        points: Of the table; None: the stored one.
        keep_mesh: The grains have to do as they are.

    Raises:
        InputError: No plan meets it; the message says what would.
    """
    accuracy = checked_accuracy(scene.accuracy if accuracy is None else accuracy)
    points = read_points() if points is None else points
    yields = flows(scene.material)
    element, law = scene.solver.element, law_of(scene) or best_law(points, yields)
    errors = sample_errors(points, element, law, yields)
    fidelity = fidelity_of(scene, sample.labels)
    # Rock that never yields is what the scene is about; grains that do not deform are a shortcut.
    simpler = sum(
        len(own) * errors.fidelities.get(model, math.inf) for model, own in fidelity.items()
    )
    fixed = simpler / len(sample.labels)
    if fixed >= accuracy:
        raise InputError(too_simple(accuracy, fixed, fidelity))
    plans = list(_plans(scene, sample, errors, accuracy - fixed, keep_mesh))
    if not plans:
        raise InputError(out_of_reach(scene, accuracy, fixed, errors, sample, keep_mesh))
    # What a stage states itself is kept, and has to do.
    slow = [plan for plan in plans if not course_of(scene).too_fast(wave_speed(scene), plan.least)]
    if not slow:
        raise InputError(stage_too_fast(scene, accuracy, min(plan.least for plan in plans)))
    plans = slow
    best = min(plans, key=lambda plan: plan.cost)
    as_they_are = [plan for plan in plans if plan.size == sample.size]
    if as_they_are:
        own = min(as_they_are, key=lambda plan: plan.cost)
        best = own if own.cost <= WORTH_MESHING * best.cost else best
    parts, course = best.parts | {"fidelity": fixed}, course_of(scene)
    start = quasi_static_from(scene, course.presses, best.time)
    return Plan(
        accuracy=accuracy,
        error=sum(parts.values()),
        parts=parts,
        elements_per_radius=best.elements,
        tets=best.tets,
        size=best.size,
        inner_size=best.inner_size,
        mesh_again=best.size != sample.size,
        element=element,
        fidelity=fidelity,
        settings=_settings(scene, law, best.speed, best.mass),
        quasi_static_from=start,
        driver=driver(scene, sample, errors, best),
        path=errors.of_path(len(sample.labels)),
        cracks=of_cracks(scene, sample, best.tets),
        unknown=unknown(scene, errors, best.elements, sample.slender),
        warnings=(
            *sample.warnings,
            *lagging_servos(scene),
            *untrusted_start(start, course.key, best.speed),
        ),
    )


def law_of(scene):
    """Law of contact that a scene states, by its name in the table; None: it states none.

    Raises:
        InputError: Nothing is known of it in packings, or of the integrator.
    """
    if scene.solver.integrator != "explicit":
        raise InputError(
            f'solver.integrator = "{scene.solver.integrator}", expected "explicit" in a plan: '
            "nothing is known of others for packings"
        )
    contact, default = scene.contact, Contact(scene.contact.friction)
    stated = {k: getattr(contact, k) for k in ("law", "compliance", "points")
              if getattr(contact, k) != getattr(default, k)}  # fmt: skip
    if not stated:
        return None
    for name, keys in LAWS.items():
        if stated == {k: v for k, v in keys.items() if v != getattr(default, k)}:
            return name
    shown = ", ".join(f"contact.{k} = {v}" for k, v in stated.items())
    raise InputError(f"{shown}, expected a law of contact of which the table knows the error")


def _model(material):
    """Name of a model of grains."""
    for kind, name in ((Rigid, "rigid"), (Auto, "auto"), (Elastic, "elastic")):
        if isinstance(material, kind):
            return name
    return "j2"


def fidelity_of(scene, labels):
    """{model: labels of its grains}."""
    group_of = {label: group for group in scene.materials.values() for label in group.labels}
    found = {}
    for label in labels:
        group = group_of.get(label)
        found.setdefault(_model(scene.material if group is None else group.material), []).append(
            label
        )
    return found


def _masses(scene, errors):
    """Added masses that may be chosen, with their errors and gains in time step."""
    none = {0.0: errors.masses[0.0]}
    if scene.mass_scaling is not None:
        added = scene.mass_scaling.added
        known = [m for m in errors.masses if m >= added * (1 - 1e-9)]
        if not known:
            raise InputError(
                f"mass_scaling.added = {added:g}, expected at most {max(errors.masses):g} with an "
                "accuracy"
            )
        return {added: errors.masses[min(known)]}
    allowed = not isinstance(scene.material, Rigid | Auto) and scene.contact.law != "kinematic"
    groups = any(isinstance(g.material, Rigid | Auto) for g in scene.materials.values())
    if not allowed or groups or scene.tools or scene.solver.time_step != "assembled":
        return none
    return errors.masses


@dataclass(frozen=True)
class _Choice:
    """One way to meet an accuracy."""

    cost: float  #: in units of its own
    parts: dict
    elements: float  #: per contact radius
    size: float
    inner_size: float
    tets: float
    time: float  #: of loading over that of a wave
    least: float  #: that time for the error alone
    speed: float  #: of the platen [m/s]
    mass: float  #: added


def _plans(scene, sample, errors, left, keep_mesh):
    """Every :class:`_Choice` whose parts keep within ``left``."""
    wave, radius = wave_speed(scene), contact_radius(scene.material)
    course = course_of(scene)
    here = radius * sample.diameter / sample.size
    for mass, (of_mass, gain) in _masses(scene, errors).items():
        rest = left - of_mass
        meshes = [(here, sample.size, sample.size, sample.tets)]
        for cut in range(1, 0 if keep_mesh else CUTS):
            n = errors.elements_for(rest * cut / CUTS)
            if math.isfinite(n):
                meshes.append((n, *sample.mesh_for(n, radius, errors)))
        for n, size, inner, tets in meshes:
            of_mesh = errors.of_mesh(n)
            if of_mesh >= rest:
                continue
            if scene.quasi_static is None:
                least = time_for(rest - of_mesh)
                time = planned_time(rest - of_mesh)
            else:
                # The speed follows what it does to the sample: k = (T/t)²/3.
                least = time = max(1 / math.sqrt(3 * scene.quasi_static.kinetic), FASTEST)
            inertia = of_loading(time) if course.presses else 0.0
            if of_mesh + inertia > rest * (1 + 1e-9):
                continue
            parts = {"mesh": of_mesh, "loading": inertia, "mass": of_mass}
            speed = course.level * wave / time
            cost = tets / size * time / gain
            yield _Choice(cost, parts, n, size, inner, tets, time, least, speed, mass)


def _settings(scene, law, speed, mass):
    """What the plan changes: {"table.key": value}."""
    wanted = {f"contact.{key}": value for key, value in LAWS[law].items()}
    course = course_of(scene)
    if scene.quasi_static is None and course.presses:
        wanted[course.key] = float(f"{speed:.3g}")
    if mass and scene.mass_scaling is None:
        wanted["mass_scaling.added"] = mass
    default = Output()
    if scene.output.fields == default.fields:
        least = 5 if scene.loading is None else 2 * len(course.parts) + 1
        wanted["output.fields"] = min(max(round(course.strain / STATE_STRAIN) + 1, least), 51)
    return {key: value for key, value in wanted.items() if _value(scene, key) != value}


def _value(scene, dotted):
    table, key = dotted.split(".")
    return getattr(getattr(scene, table), key, None)


def follow(scene, plan):
    """The scene with the plan's settings."""
    for dotted, value in plan.settings.items():
        table, key = dotted.split(".")
        if table == "mass_scaling":
            scene = replace(scene, mass_scaling=MassScaling(added=value))
        else:
            scene = replace(scene, **{table: replace(getattr(scene, table), **{key: value})})
    return scene
