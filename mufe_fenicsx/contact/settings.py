"""What a user can choose of contact, and what it knows of the grains."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ..arguments import check_fields
from ..errors import InputError
from ..units import setting
from .friction import PairFriction
from .laws import COMPLIANCE, KINEMATIC, law_names
from .start.checks import check_law

#: Coefficients of friction that a scene file may state.
PLAUSIBLE_FRICTION = (0.0, 1e3)


@dataclass(frozen=True)
class ContactSettings:
    """Law and place of contact between grains; what has a meaning is a key of a scene, too.

    Raises:
        InputError: There are no such points, or no such law; a coefficient cannot be;
            self-contact at other points than nodes.
    """

    #: Coefficient between grains [-], or by pair of materials.
    friction: float | PairFriction = 0.0
    points: str = setting(
        "facets",
        "",
        'where it acts: centroids of "facets", "facets4" (four) or "nodes"',
        allowed=("facets", "facets4", "nodes"),
    )
    law: str = setting(
        "matched",
        "",
        'normal law: stiffness "matched" to the mesh, or "kinematic"',
        allowed=law_names,
    )
    compliance: float = setting(
        COMPLIANCE,
        "-",
        "layer of compliance·h/E* on each side, h the mesh size",
        gt=0,
        plausible=(1e-3, 1e3),
    )
    friction_kinetic: float | None = setting(
        None, "-", "between grains while they slip; None: friction", plausible=PLAUSIBLE_FRICTION
    )
    self_contact: bool = setting(False, "", "concave grains meet themselves too")

    def __post_init__(self):
        check_fields(self)
        check_law(self.pair_friction.friction, self.compliance)
        if self.self_contact and self.points != "nodes":
            raise InputError(
                f'self-contact with points of contact = {self.points}, expected "nodes"'
            )
        if self.law not in law_names():
            names = ", ".join(law_names())
            raise InputError(f"normal law of contact = {self.law}, expected one of {names}")

    @property
    def pair_friction(self):
        """:class:`~.PairFriction`."""
        by_pair = isinstance(self.friction, PairFriction)
        return self.friction if by_pair else PairFriction(self.friction)

    def with_tools(self, num_grains, tools):
        """The same with the friction of tools, bodies after ``num_grains`` grains, against all."""
        if not tools:
            return self
        own = [(tool.friction, tool.friction_kinetic) for tool in tools]
        return replace(self, friction=self.pair_friction.with_others(num_grains, own))

    @property
    def kinematic(self):
        """Whether contact corrects a step that was predicted without it."""
        return self.law == KINEMATIC


@dataclass(frozen=True)
class ContactGrains:
    """What contact knows of this rank's grains."""

    modulus: np.ndarray  #: E/(1 - nu²) [Pa], shape (num_grains,)
    tangential_ratio: np.ndarray  #: 2(1 - nu)/(2 - nu), shape (num_grains,)
    mass: np.ndarray | None = None  #: of nodes [kg], shape (num_nodes,), for the kinematic law
    #: Compliance of the layer of grains that do not deform [m/Pa], nan for others, shape
    #: (num_grains,); None: all deform.
    rigid_layer: np.ndarray | None = None
    #: Gives what a mesh lacks of compliance between the ends of its sharp edges, called as
    #: :meth:`~mufe_fenicsx.bulk.solid.Solid.edge_compliance`; None: nothing.
    edge_compliance: Callable | None = None
    #: Plastic strains and yield stresses [Pa] of grains, shape (2, num_points) each, None for those
    #: that do not yield, shape (num_grains,); empty: none does.
    yield_tables: tuple = ()
    #: Plastic strain of the cells, whose array stays, shape (num_cells,); None: no grain yields.
    plastic_strain: np.ndarray | None = None
