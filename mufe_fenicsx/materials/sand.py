"""The sand of Nadimi & Fonseca (2018), which most tests and examples are made of.

Source: S. Nadimi, J. Fonseca, A micro finite-element model for soil behaviour, Géotechnique
68(4), 2018, 290-302, doi 10.1680/jgeot.16.p.147. They report no density: that of quartz is taken.
"""

from .j2 import J2

SAND = J2(E=100e9, nu=0.15, rho=2650.0, yield_stress=((0.0, 10e6), (0.05, 110e6)))

_TABLE = """\
[material]                # {what} Nadimi & Fonseca (2018), doi 10.1680/jgeot.16.p.147
model = "j2"              # elasto-plastic; or "elastic", "rigid", "auto"
E = "100 GPa"
nu = 0.15
rho = "2650 kg/m^3"
yield_stress = [[0.0, "{first}"], [0.05, "{last}"]]   # of J σ, at plastic strain; flat beyond
"""


def scene_table(first: str = "10 MPa", last: str = "110 MPa") -> str:
    """Its table in a scene file.

    Args:
        first, last: Yield stresses at plastic strains of 0 and 0.05, which may be others than its.
    """
    what = "as in" if (first, last) == ("10 MPa", "110 MPa") else "elasticity as in"
    return _TABLE.format(what=what, first=first, last=last)
