"""Are the contacts of grains resolved by the facets of their surfaces?

A patch of contact of the radius a on facets with the mean edge h has n = a/h elements per contact
radius (:mod:`~mufe_fenicsx.contact.results.patches`). Patches count by their normal force, since
those that carry most decide on the stress of a sample.
"""

import itertools
from dataclasses import dataclass

import numpy as np

#: Elements per contact radius below which a contact is coarse: where all contacts are, the stress
#: of grains that yield is off by more than 15 % (`mufe verify sample-point`).
COARSE = 0.6
#: Ends of the classes that tables of contacts have, in elements per contact radius.
CLASSES = (0.0, 0.5, 1.0, 2.0, np.inf)
#: Mean pressure of a contact that flows, over the yield stress (Johnson 1985, section 6.3).
CONSTRAINT = 2.8


@dataclass(frozen=True)
class Resolution:
    """Elements per contact radius of patches, by their normal force."""

    tenth: float  #: a tenth of the force is in patches with fewer
    half: float  #: the median
    nine_tenths: float
    coarse: float  #: share of the force in patches with fewer than COARSE
    num_patches: int

    def as_dict(self):
        """All but the definition, fit for JSON."""
        return {name: getattr(self, name) for name in self.__dataclass_fields__}


def contact_resolution(elements_per_radius, force):
    """How finely patches are meshed; None without a normal force.

    Args:
        elements_per_radius: Shape (num_patches,).
        force: Normal forces [N], shape (num_patches,).
    """
    n, force = np.asarray(elements_per_radius, float), np.maximum(np.asarray(force), 0.0)
    if not force.sum() > 0:
        return None
    order = np.argsort(n)
    carried = np.cumsum(force[order]) / force.sum()
    # Rounding may leave the last sum below one.
    place = np.minimum(np.searchsorted(carried, (0.1, 0.5, 0.9)), n.size - 1)
    coarse = float(force[n < COARSE].sum() / force.sum())
    return Resolution(*n[order][place].tolist(), coarse, n.size)


def of_patches(patches):
    """:func:`contact_resolution` of patches between grains; of those with walls where none carry.

    Args:
        patches: :class:`~mufe_fenicsx.contact.results.patches.Patches`.

    Returns:
        :class:`Resolution` or None.
    """
    n, force = patches.elements_per_radius, patches.normal_force
    for some in (patches.between_grains, patches.with_walls):
        found = contact_resolution(n[some], force[some])
        if found is not None:
            return found
    return None


@dataclass(frozen=True)
class ClassOfContacts:
    """Patches whose elements per contact radius lie in one class."""

    low: float  #: elements per contact radius
    high: float
    num_patches: int
    force_share: float  #: of the force of all
    pressure: float  #: mean [Pa]: force over present area of all of them; nan: there are none
    flow: float  #: that over 2.8 times the yield stress reached; nan where nothing yields


def classes_of_contacts(elements_per_radius, force, area, yield_stress):
    """Patches by CLASSES of their elements per contact radius, a list of :class:`ClassOfContacts`.

    Args:
        elements_per_radius, force: As of :func:`contact_resolution`.
        area: Present area [m²], shape (num_patches,).
        yield_stress: Reached there [Pa], not finite or 0 where nothing yields, (num_patches,).
    """
    n, force, area, Y = (
        np.asarray(v, float) for v in (elements_per_radius, force, area, yield_stress)
    )
    found = []
    for low, high in itertools.pairwise(CLASSES):
        some = (n >= low) & (n < high)
        yields = some & np.isfinite(Y) & (Y > 0)
        pressure = force[some].sum() / area[some].sum() if some.any() else np.nan
        limit = CONSTRAINT * (Y[yields] @ area[yields])
        flow = force[yields].sum() / limit if yields.any() else np.nan
        share = force[some].sum() / (force.sum() or 1.0)
        numbers = (float(value) for value in (share, pressure, flow))
        found.append(ClassOfContacts(low, high, int(some.sum()), *numbers))
    return found
