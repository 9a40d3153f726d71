"""All cases by name, and a function that runs some of them."""

import functools
import gc
import inspect
import typing

from petsc4py import PETSc

from ..errors import InputError, SolverError, nearest_name
from .again import closed_loop, pressed_again
from .ball_crushing import ball_crushing
from .bar_impact import bar_impact
from .bar_in_tension import bar_in_tension
from .brazilian_disc import brazilian_disc
from .calibrate import calibrate
from .calibrate_stone import calibrate_stone
from .case import by_name
from .cohesive_facet import cohesive_facet
from .column import column
from .cracked_strip import cracked_strip
from .crush import crush
from .crushing_strengths import crushing_strengths
from .curved_walls import confined_cylinder, curved_walls
from .damaged_block import damaged_block
from .energy import energy
from .expanding_ring import expanding_ring
from .feature_pairs import feature_pairs
from .fidelity import fidelity
from .free_sphere import free_sphere
from .hertz import hertz
from .hertz_stress import hertz_stress
from .impact import impact
from .integrators import integrators
from .known_stress import known_stress
from .material_point import material_point
from .membrane import balloon, membrane_correction, membrane_specimen, membrane_tube
from .mindlin import mindlin
from .notched_plates import branching_plate, kalthoff_winkler
from .oblique_impact import oblique_impact
from .overlap import overlap
from .packed_spheres import packed_spheres
from .packing import packing
from .paper_sphere import paper_sphere
from .patch import patch
from .plastic_sphere import plastic_sphere
from .rigid import rigid_impact, rigid_mix, rigid_rolling, rigid_top
from .rolling import rolling
from .segmentation import segmentation
from .sheared import sheared_box, tube_in_torsion
from .sliding import sliding_block
from .sliding_normal import sliding_graded, sliding_normal, sliding_ridges
from .soak import soak
from .spin import spin
from .splitting import disc, hiramatsu_oka
from .stability import STABILITY
from .strain_cycle import strain_cycle
from .tool_indentation import tool_indentation
from .torsion import torsion
from .tracking import tracking
from .undrained import undrained_elastic

CASES = (
    by_name(
        column,
        patch,
        spin,
        sliding_block,
        sliding_normal,
        sliding_graded,
        sliding_ridges,
        closed_loop,
        pressed_again,
        energy,
        hertz,
        hertz_stress,
        curved_walls,
        confined_cylinder,
        tool_indentation,
        undrained_elastic,
        tube_in_torsion,
        sheared_box,
        balloon,
        membrane_tube,
        membrane_specimen,
        membrane_correction,
        disc,
        hiramatsu_oka,
        overlap,
        packing,
        packed_spheres,
        known_stress,
        impact,
        oblique_impact,
        mindlin,
        torsion,
        integrators,
        rolling,
        rigid_top,
        rigid_rolling,
        rigid_impact,
        rigid_mix,
        fidelity,
        feature_pairs,
        free_sphere,
        bar_impact,
        material_point,
        plastic_sphere,
        paper_sphere,
        calibrate,
        calibrate_stone,
        strain_cycle,
        crush,
        cohesive_facet,
        damaged_block,
        bar_in_tension,
        cracked_strip,
        expanding_ring,
        brazilian_disc,
        ball_crushing,
        crushing_strengths,
        kalthoff_winkler,
        branching_plate,
        segmentation,
        tracking,
        soak,
    )
    | STABILITY
)


def known_cases():
    """All cases that can be named: ``CASES``, and the single points of charts."""
    from .charts.points import POINTS  # which are made of these

    return CASES | POINTS


def run_cases(names, parameters, comm):
    """Answers of cases, a dict each, as `mufe verify --json` writes it. Collective.

    Args:
        names: Names of cases; none stands for all.
        parameters: Values by name, numbers or text.
        comm: MPI communicator.

    Raises:
        InputError: As :func:`chosen_cases`.
    """
    return [run(comm) for _, run in chosen_cases(names, parameters)]


def answer_of(name, run, comm):
    """The answer of one of many cases; where it stops, without results, and why. Collective.

    Each case leaves room for the next: MPI has 2000 communicators, and a simulation takes several.
    """
    try:
        return run(comm)
    except (InputError, SolverError) as error:
        return {"case": name, "results": {}, "stopped": str(error), "passed": False}
    finally:
        gc.collect()
        PETSc.garbage_cleanup(comm)  # objects of several ranks are freed on all together


def chosen_cases(names, parameters):
    """(name, function of a communicator) of cases, with those of the parameters that each knows.

    Args:
        names: Names of cases; none stands for all.
        parameters: Values by name, numbers or text.

    Raises:
        InputError: A case that does not exist, a parameter that no chosen case has, or a
            value that is not a number of the right kind or not one of the choices.
    """
    names = list(names) or list(CASES)
    for name in names:
        if name not in known_cases():
            raise InputError(f"case = {name}, expected {_nearest(name, known_cases())}")
    cases = known_cases()
    known = {name: _defaults(cases[name]) for name in names}
    everything = {key: value for case in known.values() for key, value in case.items()}
    values = {}
    for key, value in parameters.items():
        if key not in everything:
            raise InputError(f"parameter {key} = {value}, expected {_nearest(key, everything)}")
        default, choices = everything[key]
        if choices and value not in choices:
            raise InputError(f"parameter {key} = {value}, expected {_nearest(str(value), choices)}")
        text = choices or isinstance(default, str)
        values[key] = value if text else _number(key, value, type(default))
    return [
        (name, functools.partial(
            cases[name], **{key: value for key, value in values.items() if key in known[name]}
        ))
        for name in names
    ]  # fmt: skip


def _defaults(function):
    """Default and choices, where there are any, of each parameter; choices are a ``Literal``."""
    parameters = inspect.signature(function).parameters
    return {
        name: (p.default, typing.get_args(p.annotation))
        for name, p in parameters.items()
        if name != "comm"
    }


def _number(key, value, kind):
    what = "a whole number > 0" if kind is int else "a number >= 0"
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise InputError(f"parameter {key} = {value}, expected {what}") from None
    if not 0 <= number < float("inf") or (kind is int and (number != int(number) or number < 1)):
        raise InputError(f"parameter {key} = {value}, expected {what}")
    return kind(number)


def _nearest(word, words):
    return nearest_name(word, words) if words else "no parameter: the chosen cases have none"
