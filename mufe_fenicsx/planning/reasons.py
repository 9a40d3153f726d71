"""Why a plan is what it is: what costs most, what it cannot know, what is out of reach."""

import math
from dataclasses import replace

from ..materials.fracture import IN_ZONE
from ..scene import Solver
from ..units import with_unit
from .cost import LATE, SHORTER
from .course import course_of, wave_speed
from .errors import BEYOND, contact_radius, planned_time
from .sample import THROUGH


def driver(scene, sample, errors, best):
    """Which requirement costs most: what twice its error would leave of the cost."""
    n = errors.elements_for(2 * best.parts["mesh"])
    left = {"the mesh at contacts": 1.0}
    if math.isfinite(n):
        size, _, tets = sample.mesh_for(n, contact_radius(scene.material), errors)
        left["the mesh at contacts"] = min(tets / size / (best.tets / best.size), 1.0)
    if course_of(scene).presses:
        left["the time of loading"] = planned_time(2 * best.parts["loading"]) / best.time
    name = min(left, key=left.get)
    if left[name] > 0.99:
        return "none: the coarsest mesh and the fastest loading that plans have do"
    return f"{name}: twice its error would leave {left[name]:.2f} of the cost"


def too_simple(accuracy, fixed, fidelity):
    """Why no plan with simpler models of grains meets an accuracy."""
    models = ", ".join(f"{len(own)} grains {model}" for model, own in fidelity.items())
    return (
        f"accuracy = {accuracy:g}, expected more than {fixed:.2g} with {models}: "
        'material.model = "j2" would do'
    )


def stage_too_fast(scene, accuracy, time):
    """Which stage states a speed that no plan can keep an accuracy with."""
    course, wave = course_of(scene), wave_speed(scene)
    part = course.too_fast(wave, time)
    return (
        f'stage "{part.name}": speed = {part.stated:g} m/s, expected at most '
        f"{part.level * wave / time:.2g} m/s, or none, with accuracy = {accuracy:g}"
    )


def out_of_reach(scene, accuracy, fixed, errors, sample, keep_mesh):
    """Why no mesh meets an accuracy, and which would."""
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


#: What walls that load grains may meet.
SEATING_AND_SLIPS = (
    "how long the seating takes: it depends on the gaps between grains, on how they turn and slip "
    "until they carry, and on the stress and the speed of the seating; `mufe watch` tells how far "
    "it is",
    "slips between grains, which are dynamic at any speed: where grains are few, a late one moves "
    "the strain from which the report trusts the test",
)


def of_cracks(scene, sample, tets):
    """Edges that the zone of cracks wants beside those of a mesh of so many tetrahedra a grain.

    In words, "" where grains do not break.
    """
    if scene.fracture is None:
        return ""
    moduli = [m.E for m in (scene.material, *(g.material for g in scene.materials.values()))]
    law, edge = scene.fracture, sample.edge_of(tets)
    # Of a grain, or of a facet: a quarter of both its cells.
    volume = math.pi / 6 * sample.diameter**3 if law.scatter == "grain" else edge**3 / 72**0.5 / 2
    zone = law.zone(min(moduli), law.typical_strength(volume))
    enough = "" if edge <= zone / IN_ZONE else ": too coarse"
    return (
        f"their zone, E·energy/strength² = {with_unit(zone, 'm')} of strengths as drawn, wants "
        f"edges of {with_unit(zone / IN_ZONE, 'm')}; the mean one of the mesh is "
        f"{with_unit(edge, 'm')}{enough}"
    )


def unknown(scene, errors, elements, slender=0):
    """What is not known beforehand, with so many elements per radius of a contact.

    Args:
        scene: `mufe_fenicsx.scene.Scene`.
        errors: `errors.Errors`.
        elements: Per radius of a contact.
        slender: Of `sample.Sample`.
    """
    why = "follow from the modulus given" if scene.modulus else "are assumed"
    known = [
        f"the size of contacts: a radius of {contact_radius(scene.material):.2g} diameters is "
        "assumed, and grows with the load",
        "how fast waves travel through the loaded sample, which depends on its density: "
        f"{wave_speed(scene):.0f} m/s {why}; top against bottom force in the report "
        "tell how slow the loading was",
        "what other programs do to this machine meanwhile",
    ]
    if elements > errors.mesh[-1][0]:
        known.append(
            "errors of so fine a mesh: beyond the finest one measured they are taken to fall with "
            f"the power {errors.order:.2g} of the length of edges"
        )
    known += _of_bending(slender)
    if scene.fracture is not None:
        known.append(
            "when grains crack, and what a test costs from then on: steps and time above are those "
            "of grains without cracks. Cracks shorten the time step to a third, tiny pieces to a "
            "tenth, and each growth of the mesh takes as long as a hundred steps"
        )
    course = course_of(scene)
    if scene.tools:
        off = errors.of_tool(elements)
        smooth = (
            f"contacts of elastic grains with smooth tools are {100 * off:.2g} % off "
            "(`mufe verify tool-point`)"
            if math.isfinite(off)
            else "no error is known of contacts with tools on so coarse a mesh"
        )
        known.append(
            "what the inertia of grains adds to the forces on tools: another run at half of their "
            f"speed tells; {smooth}; edges and tips finer than facets of the grains add to it"
        )
    if scene.membrane is not None:
        known.append(
            "what the mesh of the membrane does to the forces: `mufe verify membrane-specimen`, "
            "and to its shape at the platens: `mufe verify membrane-point`"
        )
    if course.presses:
        known += SEATING_AND_SLIPS
    if scene.loading is not None and course.presses:
        known.append(
            "strains that stresses make, and stresses that strains make: those of a linear sample "
            f"in which waves travel at {wave_speed(scene):.0f} m/s"
        )
    if course.strain > LATE:
        known.append(
            f"how much new contacts shorten the time step beyond a strain of {LATE:g}: to "
            f"{SHORTER:g} of it is assumed"
        )
    if scene.quasi_static is not None:
        known.append("the speed that [quasi_static] will lead to: that of a linear sample is taken")
    if scene.solver != replace(Solver(), element=scene.solver.element):
        known.append("what settings in [solver] other than the default do to the error")
    return tuple(known)


def _of_bending(slender):
    """What is not known of so many slender grains, a list."""
    return [
        f"how {slender} plates and needles bend that have fewer than {THROUGH} edges through their "
        "thickness: beams bend by 0.34, 0.67, 0.81 and 0.88 of what they should with 1, 2, 3 and 4"
    ] * bool(slender)


def _um(length):
    return f'"{1e6 * length:.3g} um"'
