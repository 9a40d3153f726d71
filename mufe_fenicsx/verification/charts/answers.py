"""What the points of charts share: options of a simulation, an error and what it cost."""

import math
from typing import Literal

import numpy as np

from ...scene import MassScaling
from ..case import compare

#: Laws of contact by name: layer matched to the mesh, a stiff penalty, kinematic; at nodes, or at
#: four points a facet.
LAWS = {
    "matched": {},
    "stiff": {"compliance": 0.02},
    "kinematic": {"law": "kinematic"},
    "nodes": {"points": "nodes"},
    "four": {"points": "facets4"},
}
Law = Literal[*LAWS]
TimeStep = Literal["assembled", "element"]
#: From this part of the approach on, where the contact has half of its elements, errors count.
FROM = 0.25


def options_of(law, time_step, added_mass):
    """Options of a simulation."""
    scaling = MassScaling(added=added_mass) if added_mass else None
    return {**LAWS.get(law, {}), "assembled": time_step == "assembled", "mass_scaling": scaling}


def lines_of(error, accuracy, processor_s, element_steps):
    """Answer of a case: the error against what is wanted, and what it cost."""
    return {
        "error": compare(error, 0.0, accuracy, scale=1.0),
        "time of the processor [s]": compare(processor_s, 0.0, math.inf, scale=1.0),
        "element-steps": compare(element_steps, 0.0, math.inf, scale=1.0),
    }


def work_of(simulation, integrator="explicit"):
    """Tetrahedra times steps; nan for increments and where nothing deforms."""
    cells = np.diff(simulation.mesh.cell_offset)[simulation.solid.grains].sum()
    steps = float(cells) * simulation.state.num_steps
    return steps if steps > 0 and integrator == "explicit" else math.nan


def course_error(approach, force, theory):
    """Mean distance of a force over approach from theory, over the mean of theory."""
    on = approach >= FROM * approach[-1]
    way = approach[on]
    return float(np.trapezoid(np.abs(force - theory)[on], way) / np.trapezoid(theory[on], way))
