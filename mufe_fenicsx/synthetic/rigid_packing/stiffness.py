"""How deep contacts of rigid grains have to be where the true ones carry a stress.

A mean stress p in equal spheres of diameter D, with Z contacts each and the solid fraction φ, makes
the mean force

    F = π D² p/(φ Z)

(H. Rumpf, Chemie Ingenieur Technik 42, 1970, 538-540). A true contact under it is as deep as
Hertz's, or as one that flows at the pressure 2.8 Y where that is deeper,

    δ/D = max( (9/4 (F/(E* D²))²)^(1/3),  2 F/(2.8 π Y D²) ),

Y at the plastic strain 0.2 a/R of its radius a = √(D δ/2), R = D/2 (D. Tabor, The Hardness of
Metals, 1951), and a spring of the packing by F/(E D) with the modulus E of its contacts.
"""

import math

import numpy as np

from ...materials.sand import SAND

#: Solid fraction and contacts of a sphere.
SOLID, COORDINATION = 0.6, 6.0
#: Mean pressure of a contact that flows over the yield stress (K. L. Johnson, Contact Mechanics,
#: 1985, section 6.3).
PLATEAU = 2.8
#: Plastic strain of a contact over a/R, and rounds in which that is found.
TABOR, ROUNDS = 0.2, 30


def contact_depth(stress, material=SAND):
    """δ/D of contacts under a mean stress [Pa]."""
    force = math.pi * stress / (SOLID * COORDINATION)
    elastic = (2.25 * (2.0 * force / material.contact_modulus) ** 2) ** (1 / 3)
    strains, stresses = np.transpose(material.yield_stress)
    depth = elastic
    for _ in range(ROUNDS):
        flow = np.interp(TABOR * math.sqrt(2.0 * depth), strains, stresses)
        depth = max(elastic, 2.0 * force / (math.pi * PLATEAU * flow))
    return float(depth)


def over_modulus(stress, material=SAND):
    """A mean stress [Pa] over the modulus of the springs that are as deep as true contacts."""
    return contact_depth(stress, material) * SOLID * COORDINATION / math.pi
