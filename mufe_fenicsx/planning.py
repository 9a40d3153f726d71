"""From a scene and an accuracy: how much model the test needs, and what it will cost.

The error of a plan is the sum of its parts (plan_errors); the plan is the cheapest that keeps the
sum below what is wanted. Its cost goes with

    tetrahedra · steps  ~  n t / (h g),

n tetrahedra a grain, h the length of edges at contacts, t the time of loading, g the gain in time
step by added mass. What is chosen depends on the scene, the grains and the table alone, not on the
machine: a run that goes on finds the same plan again. Times and memory are those of this
machine (plan_cost).
"""

import math
from dataclasses import dataclass, field, replace

from .errors import InputError
from .evidence import SUFFIX, read_elsewhere, read_points, usable
from .geometry.grains import load_grains, read_grain_table
from .materials.auto import Auto
from .materials.elastic import Elastic
from .materials.rigid import Rigid
from .plan_cost import packing_wave_speed
from .plan_errors import (
    BEYOND,
    CONTACTS,
    FASTEST,
    best_law,
    contact_radius,
    of_loading,
    sample_errors,
    time_for,
)
from .scene import Contact, MassScaling, Output, Solver

#: What the table calls a law of contact, by what a scene says.
LAWS = {"matched": {"law": "matched"}, "kinematic": {"law": "kinematic"},
        "stiff": {"law": "matched", "compliance": 0.02},
        "nodes": {"law": "matched", "points": "nodes"}}  # fmt: skip
#: Parts into which the allowed error is cut in the search for the cheapest plan.
CUTS = 40
#: Grains that are meshed finer than they need be are kept up to this cost over the least.
WORTH_MESHING = 1.5
#: Error of a measured point over what it may be at another Poisson's ratio, size of contact or
#: speed, for points that nobody has computed there.
MARGIN = 0.75
#: Strain between two stored states.
STATE_STRAIN = 0.01


@dataclass(frozen=True)
class Sample:
    """What a plan needs to know of the grains."""

    folder: str
    labels: tuple
    num_cells: int
    size: float  #: wanted length of edges [m]
    diameter: float  #: of a ball of the grains' mean volume [m]

    @property
    def tets(self):
        """Tetrahedra a grain."""
        return self.num_cells / len(self.labels)

    def mesh_for(self, n, radius, errors):
        """A mesh of n elements per contact radius.

        Finer than it is the sample gets either even edges or fine patches at its contacts.

        Args:
            n: Elements per contact radius.
            radius: Of a typical contact over the diameter.
            errors: :class:`~.plan_errors.Errors`, which know the tetrahedra of a patch.

        Returns:
            Length of edges at contacts and inside [m], and tetrahedra a grain.
        """
        h = radius * self.diameter / n
        even = self.tets * (self.size / h) ** 3
        patches = self.tets + CONTACTS * errors.cells_of_contact(n)
        if h < self.size and patches < even:
            return h, self.size, patches
        return h, h, even


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
    driver: str  #: which requirement the cost comes from
    path: float  #: by how much two such tests part that differ in rounding alone [-]
    unknown: tuple = field(default=())  #: what the plan cannot know, sentences


def read_sample(folder):
    """The :class:`Sample` in a folder that `mufe mesh` wrote.

    Raises:
        InputError: There is none.
    """
    if folder is None:
        raise InputError(
            "sample.grains is missing, expected the folder that `mufe mesh` wrote: a plan needs "
            "the grains, meshed with edges of any length"
        )
    labels, num_cells, _, _ = read_grain_table(folder)
    grains = load_grains(folder)
    diameter = (6 / math.pi * float(grains.volumes.mean())) ** (1 / 3)
    return Sample(
        str(folder), tuple(labels.tolist()), int(num_cells.sum()), grains.element_size, diameter
    )


def plan_scene(scene, sample, accuracy=None, points=None, keep_mesh=False):
    """The cheapest plan that meets an accuracy.

    What the scene states other than its default is kept; the speed of loading is planned, unless
    the scene has [quasi_static].

    Args:
        scene: :class:`~mufe_fenicsx.scene.Scene`.
        sample: :class:`Sample`.
        accuracy: Wanted error of the forces; None: the scene's.
        points: Of the table; None: the stored one.
        keep_mesh: The grains have to do as they are.

    Raises:
        InputError: No plan meets it; the message says what would.
    """
    accuracy = checked(scene.accuracy if accuracy is None else accuracy)
    points = read_points() if points is None else points
    yields = hasattr(scene.material, "yield_stress")
    element, law = scene.solver.element, _law(scene.contact, points, yields)
    if scene.solver.integrator != "explicit":
        raise InputError(
            f'solver.integrator = "{scene.solver.integrator}", expected "explicit" with an '
            "accuracy: nothing is known of others for packings"
        )
    errors = sample_errors(points, element, law, yields)
    fidelity = _fidelity(scene, sample.labels)
    # Rock that never yields is what the scene is about; grains that do not deform are a shortcut.
    simpler = sum(
        len(own) * errors.fidelities.get(model, math.inf) for model, own in fidelity.items()
    )
    fixed = simpler / len(sample.labels)
    if fixed >= accuracy:
        raise InputError(_too_simple(accuracy, fixed, fidelity))
    plans = list(_plans(scene, sample, errors, accuracy - fixed, keep_mesh))
    if not plans:
        raise InputError(_out_of_reach(scene, accuracy, fixed, errors, sample, keep_mesh))
    best = min(plans, key=lambda plan: plan.cost)
    as_they_are = [plan for plan in plans if plan.size == sample.size]
    if as_they_are:
        own = min(as_they_are, key=lambda plan: plan.cost)
        best = own if own.cost <= WORTH_MESHING * best.cost else best
    parts = best.parts | {"fidelity": fixed}
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
        driver=_driver(scene, sample, errors, best),
        path=errors.of_path(len(sample.labels)),
        unknown=_unknown(scene, errors, best),
    )


def checked(accuracy):
    """An accuracy, if it is one.

    Raises:
        InputError: It is not between 0 and 1.
    """
    if accuracy is None:
        raise InputError("accuracy is missing, expected one in the scene or --accuracy")
    if not 0 < accuracy < 1:
        raise InputError(f"accuracy = {accuracy}, expected 0 < accuracy < 1")
    return float(accuracy)


def _law(contact, points, yields):
    """Law of contact by its name in the table: what the scene states, else the best."""
    default = Contact(contact.friction)
    stated = {k: getattr(contact, k) for k in ("law", "compliance", "points")
              if getattr(contact, k) != getattr(default, k)}  # fmt: skip
    if not stated:
        return best_law(points, yields)
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


def _fidelity(scene, labels):
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
    if not allowed or groups or scene.solver.time_step != "assembled":
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
    speed: float  #: of the platen [m/s]
    mass: float  #: added


def _plans(scene, sample, errors, left, keep_mesh):
    """Every :class:`_Choice` whose parts keep within ``left``."""
    wave, radius = packing_wave_speed(scene), contact_radius(scene.material)
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
                time = time_for(rest - of_mesh)
            else:
                # The speed follows what it does to the sample: k = (T/t)²/3.
                time = max(1 / math.sqrt(3 * scene.quasi_static.kinetic), FASTEST)
            inertia = of_loading(time)
            if of_mesh + inertia > rest * (1 + 1e-9):
                continue
            parts = {"mesh": of_mesh, "loading": inertia, "mass": of_mass}
            speed = scene.oedometer.strain * wave / time
            cost = tets / size * time / gain
            yield _Choice(cost, parts, n, size, inner, tets, time, speed, mass)


def _settings(scene, law, speed, mass):
    """What the plan changes: {"table.key": value}."""
    wanted = {f"contact.{key}": value for key, value in LAWS[law].items()}
    if scene.quasi_static is None:
        wanted["oedometer.speed"] = float(f"{speed:.3g}")
    if mass and scene.mass_scaling is None:
        wanted["mass_scaling.added"] = mass
    default = Output()
    if scene.output.fields == default.fields:
        wanted["output.fields"] = min(max(round(scene.oedometer.strain / STATE_STRAIN) + 1, 5), 51)
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


def _driver(scene, sample, errors, best):
    """Which requirement costs most: what twice its error would leave of the cost."""
    n = errors.elements_for(2 * best.parts["mesh"])
    size, _, tets = sample.mesh_for(n, contact_radius(scene.material), errors)
    left = {
        "the mesh at contacts": min(tets / size / (best.tets / best.size), 1.0),
        "the time of loading": time_for(2 * best.parts["loading"]) / best.time,
    }
    name = min(left, key=left.get)
    if left[name] > 0.99:
        return "none: the coarsest mesh and the fastest loading that are known do"
    return f"{name}: twice its error would leave {left[name]:.2f} of the cost"


def _too_simple(accuracy, fixed, fidelity):
    models = ", ".join(f"{len(own)} grains {model}" for model, own in fidelity.items())
    return (
        f"accuracy = {accuracy:g}, expected more than {fixed:.2g} with {models}: "
        'material.model = "j2" would do'
    )


def _out_of_reach(scene, accuracy, fixed, errors, sample, keep_mesh):
    radius, left = contact_radius(scene.material), accuracy - fixed
    n = errors.elements_for(0.7 * left)
    if math.isfinite(n):
        here = radius * sample.diameter / sample.size
        size, inner, tets = sample.mesh_for(n, radius, errors)
        sizing = "" if size == inner else f', mesh.sizing = "contact", mesh.size = {_um(inner)}'
        key = "mesh.size" if size == inner else "mesh.smallest_size"
        off = errors.of_mesh(here)
        known = f"about {off:.2g}" if math.isfinite(off) else "more than any in the table"
        return (
            f"accuracy = {accuracy:g} is out of reach of the grains in {sample.folder}, expected "
            f"{n:.2g} elements per contact radius and not {here:.2g} (error {known}): mesh them "
            f"with {key} = {_um(size)}{sizing}, about {tets:.0f} tetrahedra a grain"
        )
    best = fixed + errors.of_mesh(BEYOND * errors.mesh[-1][0])
    better = ', or solver.element = "averaged"' if scene.solver.element != "averaged" else ""
    return (
        f"accuracy = {accuracy:g}, expected more than {best / 0.7:.2g}, the least that is known of "
        f"any mesh: `mufe chart --full` on finer ones would tell more{better}"
    )


def _um(length):
    return f'"{1e6 * length:.3g} um"'


def _unknown(scene, errors, best):
    """What the plan cannot know."""
    known = [
        f"the size of contacts: a radius of {contact_radius(scene.material):.2g} diameters is "
        "assumed, and grows with the load",
        "how far the platen travels until the sample is seated: what closes a chain of grains, and "
        "0.3 % of the height for grains that rearrange, of which nothing tells beforehand",
        "how fast waves travel through the loaded sample, which depends on its density: "
        f"{packing_wave_speed(scene):.0f} m/s are assumed; top against bottom force in the report "
        "tell how slow the loading was",
        "what other programs do to this machine meanwhile",
    ]
    if best.elements > errors.mesh[-1][0]:
        known.append(
            "errors of so fine a mesh: beyond the finest one measured they are taken to fall with "
            "the length of edges"
        )
    if scene.quasi_static is not None:
        known.append("the speed that [quasi_static] will lead to: that of a linear sample is taken")
    if scene.solver != replace(Solver(), element=scene.solver.element):
        known.append("what settings in [solver] other than the default do to the error")
    return tuple(known)


def expected_error(point, elsewhere):
    """What the error of a point may be at parameters other than its own.

    Args:
        point: :class:`~mufe_fenicsx.evidence.Point`.
        elsewhere: {command: largest error elsewhere} of those that were computed there.
    """
    largest = elsewhere.get(point.command)
    return point.error / MARGIN if largest is None else max(point.error, largest)


def plan_case(case, accuracy, points=None):
    """The cheapest measured point of a case of charts that keeps an accuracy elsewhere too.

    Returns:
        :class:`~mufe_fenicsx.evidence.Point`.

    Raises:
        InputError: The table has none; the message says how near the nearest is.
    """
    accuracy = checked(accuracy)
    own = usable(read_points() if points is None else points, case)
    if not own:
        raise InputError(f"case {case}, expected one of which the table of points has some")
    elsewhere = read_elsewhere()
    good = [p for p in own if expected_error(p, elsewhere) <= accuracy]
    if not good:
        best = min(own, key=lambda p: expected_error(p, elsewhere))
        least = expected_error(best, elsewhere)
        raise InputError(
            f"accuracy = {accuracy:g}, expected at least {least:.2g}: the nearest that was "
            f"measured of {case}{SUFFIX} is `{best.command}` in {best.seconds:.3g} s"
        )
    return min(good, key=lambda p: (p.seconds, p.error))
