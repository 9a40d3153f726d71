"""What each choice adds to the error of a test, from the table of measured points.

The forces in a packing are off by what its mesh does at the contacts, by the inertia of fast
loading, by added mass, and by grains that do not deform. The error of a plan is their sum: signs
are not known beforehand.

- Mesh: that of the stress of twenty interlocked grains of known shape (`sample` in the table), the
  mean over several such samples, over the elements per contact radius. Laws of contact and elements
  that are not there have that of the default times the ratio of their errors at single contacts.
- Inertia: kinetic over internal energy of a linear sample is k = (T/s)²/3 at the time s since its
  first load, T the time of a wave through it; its platens differ by 3k/2 of the force, their
  mean by half of that (speed_control). The mean over a course of the time t = r T, weighted by
  the force, is ln(r)/(2 r²).
- Added mass, and models of grains: distances of measured points that differ in that alone.

Where grains rearrange, another rounding leads another way: that is not an error of the model, and
is told apart from it (``path``).
"""

import math
from dataclasses import dataclass

from ..analysis import quasi_static
from ..analysis.checks import UNTRUSTED
from ..analysis.evidence import distance, read_points, usable
from ..analysis.evidence.mesh_errors import (
    between,
    error_at,
    falling,
    known_samples,
    order_of,
    select,
    size,
)
from ..analysis.rows import LOADED
from ..errors import InputError
from ..materials.sand import SAND

OEDOMETER, TOOL, SAMPLE = "oedometer", "tool", "sample"
#: Grains of its sample.
GRAINS = 20
#: Beyond the finest mesh of the table errors are taken to fall with the order of the two finest, up
#: to so many times as many elements per radius.
BEYOND = 2.0
#: Speed of waves through a loaded packing over that of its rock: measured 0.07 to 0.09 in tests of
#: sand between strains of 0.01 and 0.1 (travel_time of [quasi_static] in run.json).
PACKING = 0.08
#: Least time of loading over that of a wave: before, the sum above says nothing.
FASTEST = 3.0
#: Contact radius over the diameter of grains: mean weighted by force in the sand of the
#: demonstration, which yields, 0.08 to 0.12 between strains of 0.01 and 0.1; of elastic grains
#: that of balls under this mean stress [Pa].
PLASTIC_RADIUS, STRESS = 0.1, 10e6
#: Mean stress of the elastic grains of known shape [Pa], which are of the sand's E and ν.
KNOWN_STRESS = 250e6
#: Mean pressure of a contact that flows over the yield stress (K. L. Johnson, Contact Mechanics,
#: 1985, section 6.3).
PLATEAU = 2.8
#: Solids of a packing over its volume; contacts of a ball in it.
SOLID, COORDINATION = 0.6, 6.0
#: Large contact force over the mean: where forces fall exponentially, one in 150 is larger.
LARGE_FORCE = 5.0
#: Contacts of a grain, each with its own patch of fine elements.
CONTACTS = 7


def checked_accuracy(accuracy):
    """An accuracy, if it is one.

    Raises:
        InputError: It is not between 0 and 1.
    """
    if accuracy is None:
        raise InputError("accuracy is missing, expected one in the scene or --accuracy")
    if not 0 < accuracy < 1:
        raise InputError(f"accuracy = {accuracy}, expected 0 < accuracy < 1")
    return float(accuracy)


@dataclass(frozen=True)
class Errors:
    """Error laws of one element and law of contact."""

    mesh: tuple  #: (elements per contact radius, error) from coarse to fine, errors falling
    cells: tuple  #: (elements per contact radius, tetrahedra of a body with one contact)
    masses: dict  #: added mass -> (error, time steps without over those with it)
    fidelities: dict  #: model of the grains -> error against j2
    path: float  #: distance of two tests of ``GRAINS`` that differ in rounding
    tools: tuple = ()  #: as ``mesh``, of an elastic grain under a smooth tool; () where not known
    order: float = 1.0  #: of ``mesh`` beyond the finest

    def of_mesh(self, n):
        """Error at n elements per contact radius; inf where that is coarser than any known."""
        return error_at(self.mesh, n, self.order)

    def of_tool(self, n):
        """Error of the force on a smooth tool at n elements per contact radius; inf: not known."""
        return error_at(self.tools, n) if self.tools else math.inf

    def elements_for(self, error):
        """Fewest elements per contact radius for an error; inf where none are known."""
        low, high = self.mesh[0][0], BEYOND * self.mesh[-1][0]
        if error < self.of_mesh(high):
            return math.inf
        if self.of_mesh(low) <= error:
            return low
        for _ in range(60):
            middle = math.sqrt(low * high)
            low, high = (low, middle) if self.of_mesh(middle) <= error else (middle, high)
        return high

    def cells_of_contact(self, n):
        """Tetrahedra of a body that is fine at one contact and coarse elsewhere."""
        fine, most = self.cells[-1]
        return most * (n / fine) ** 2 if n >= fine else between(self.cells, n)

    def of_path(self, num_grains):
        """By how much two tests part that differ in rounding: a larger sample averages."""
        return self.path * math.sqrt(GRAINS / max(num_grains, 1))


def of_loading(time):
    """Error of inertia at a time of loading over that of a wave; inf below ``FASTEST``."""
    return 0.5 * math.log(time) / time**2 if time >= FASTEST * (1 - 1e-9) else math.inf


def quasi_static_from(scene, presses, time):
    """Part of the course from which on inertia meets the report's checks; 1 or above: nowhere.

    Kinetic over internal energy is k = (T/s)²/3, the platens' difference 3k/2 of the load. Not
    known, nan, where tools load the sample, or targets lead the speed.

    Args:
        scene: :class:`~mufe_fenicsx.scene.Scene`.
        presses: Whether walls load the sample.
        time: Of loading over that of a wave, T.
    """
    if scene.quasi_static is not None or not presses:
        return math.nan
    return _quasi_static_after() / time


def untrusted_start(part, key, speed):
    """Lines about a speed at which the report will not trust much of a test, a list.

    Args:
        part: As of :func:`quasi_static_from`.
        key: Of the speed in the scene.
        speed: That speed [m/s].
    """
    if not part > UNTRUSTED:  # or not known
        return []
    first = f"the first {100 * part:.0f} % of the test" if part < 1 else "any part of the test"
    return [
        f"at {key} = {speed:.3g} m/s the report will not trust {first}; at "
        f"{speed * UNTRUSTED / part:.2g} m/s it is the first {100 * UNTRUSTED:.0f} %, in "
        f"{part / UNTRUSTED:.2g} times as many steps"
    ]


def _quasi_static_after():
    """Time since the first load, over that of a wave, from which inertia meets the checks."""
    k = min(quasi_static.KINETIC, quasi_static.UNBALANCED / 1.5)
    return 1 / math.sqrt(3 * k)


def time_for(error):
    """Shortest time of loading, over that of a wave, for an error; inf for none."""
    if error <= 0:
        return math.inf
    low, high = FASTEST, 1e6
    if of_loading(low) <= error:
        return low
    for _ in range(80):
        middle = math.sqrt(low * high)
        low, high = (low, middle) if of_loading(middle) <= error else (middle, high)
    return high


def planned_time(error):
    """Time of loading that a plan takes for an error: inertia meets the checks where loaded."""
    return max(time_for(error), _quasi_static_after() / LOADED)


def contact_radius(material):
    """Radius of a typical contact over the diameter of its grain, a guess."""
    return PLASTIC_RADIUS if flows(material) else elastic_radius(material)


def flow_pressure(material):
    """Pressure at which contacts of a material flow [Pa]; inf where it does not yield."""
    stress = getattr(material, "yield_stress", None)
    return math.inf if stress is None else PLATEAU * stress[0][1]


def flows(material, stress=STRESS):
    """Whether large contacts of a packing flow under a mean stress p [Pa].

    Balls of the radius R, n contacts each, the part φ of the volume, have the mean contact force
    F = 4π R² p/(φ n). By Hertz's law its mean pressure is

        pm = 2/3 (24 p E*²/(π² φ n))^(1/3),

    and grows with F^(1/3); that of ``LARGE_FORCE`` F is judged. Below the flow pressure,
    ``PLATEAU`` times the first yield stress, contacts are as stiff as elastic ones, nearly.
    """
    E = material.contact_modulus
    mean = 2 / 3 * (24.0 * stress * E**2 / (math.pi**2 * SOLID * COORDINATION)) ** (1 / 3)
    return LARGE_FORCE ** (1 / 3) * mean > flow_pressure(material)


def elastic_radius(material, stress=STRESS):
    """The same of elastic balls of the diameter d under the stress σ.

    a = (3 F R/4E*)^(1/3) with F = σ d², R = d/4 and E* of two like bodies.
    """
    return (3 * stress / (8 * material.contact_modulus)) ** (1 / 3)


def sample_errors(points=None, element="averaged", law="matched", yields=True):
    """The :class:`Errors` of an element and a law of contact, for rock that yields or does not.

    Raises:
        InputError: The table does not have the computations that are needed.
    """
    points = read_points() if points is None else points
    case = "plastic-sphere" if yields else "hertz"
    own = usable(points, case)
    base, mesh = select(own), _of_samples(points, element, yields)
    if len(mesh) < 2 or not base:
        raise InputError(
            f'solver.element = "{element}", expected one of which the table of points has {case} '
            f"and {SAMPLE}: run `mufe chart {case} {SAMPLE}`"
        )
    if law != "matched":
        factor = _ratio(own, law=law)
        if factor is None:
            raise InputError(f'law of contact "{law}", expected one of which the table has {case}')
        mesh = tuple((n, factor * error) for n, error in mesh)
    masses = {0.0: (0.0, 1.0)}
    known = {p.parameters["added_mass"] for p in own if "added_mass" in p.parameters}
    for added in sorted(known, key=float):
        pairs = list(_beside(select(own, added_mass=added), base))
        if pairs:
            masses[float(added)] = (
                min(abs(p.error - q.error) for p, q in pairs),
                min(q.num_steps / p.num_steps for p, q in pairs),
            )
    grains = [p for p in usable(points, OEDOMETER) if p.curve]
    fidelities = {"j2": 0.0, "elastic": 0.0}
    for name in ("rigid", "auto"):
        pairs = list(_beside(select(grains, fidelity=name), select(grains)))
        if pairs:
            fidelities[name] = max(distance(p.curve, q.curve) for p, q in pairs)
    others = [p for p in grains if "time_step_factor" in p.parameters]
    return Errors(
        mesh=mesh,
        cells=_rising((size(p), p.num_cells) for p in base),
        masses=masses,
        fidelities=fidelities,
        path=max(
            (distance(p.curve, q.curve) for p, q in _beside(others, select(grains))), default=0.0
        ),
        tools=falling((size(p), p.error) for p in select(usable(points, TOOL), element=element)),
        order=order_of(mesh),
    )


def _of_samples(points, element, yields):
    """(elements per contact radius, error) of grains of known shape, means over their samples."""
    case, fidelity = ("plastic-sphere", "j2") if yields else ("hertz", "elastic")
    radius = PLASTIC_RADIUS if yields else elastic_radius(SAND, KNOWN_STRESS)
    own, factor = known_samples(points, element, fidelity), 1.0
    if not own:
        own = known_samples(points, fidelity=fidelity)
        factor = _ratio(usable(points, case), element=element)
    if factor is None:
        return ()
    return tuple((radius * n, factor * error) for n, error in own)


def _ratio(points, **choice):
    """Largest error of a choice over that of the default on the same mesh; None: not known."""
    pairs = _beside(select(points, **choice), select(points))
    return max((p.error / q.error for p, q in pairs), default=None)


def _rising(pairs):
    """(size, number) pairs from coarse to fine, each number at most that of all finer ones.

    Nearly uniform meshes of coarse contacts have more tetrahedra than patches need.
    """
    least, found = math.inf, []
    for n, number in sorted(pairs, reverse=True):
        least = min(least, number)
        found.append((n, least))
    return tuple(reversed(found))


def _beside(points, others):
    """Pairs of points on the same mesh."""
    return ((p, q) for p in points for q in others if size(p) == size(q))


def best_law(points=None, yields=True):
    """Law of contact whose error on the meshes they share is least, the cheapest within 10 %."""
    points = read_points() if points is None else points
    own = usable(points, "plastic-sphere" if yields else "hertz")
    laws = {law: select(own, law=law) for law in ("matched", "stiff", "kinematic", "nodes")}
    laws = {law: some for law, some in laws.items() if some}
    sizes = [{size(p) for p in some} for some in laws.values()]
    shared = set.intersection(*sizes) if sizes else set()
    if not shared:
        return "matched"
    laws = {law: [p for p in some if size(p) in shared] for law, some in laws.items()}
    worst = {
        law: (max(p.error for p in some), sum(p.seconds for p in some))
        for law, some in laws.items()
    }
    least = min(error for error, _ in worst.values())
    good = {law: cost for law, (error, cost) in worst.items() if error <= 1.1 * least}
    return min(good, key=good.get)
