"""The table of a scene that notebooks show."""

import pytest

from mufe_fenicsx.materials.elastic import Elastic
from mufe_fenicsx.materials.sand import SAND
from mufe_fenicsx.scene import Axis, Contact, Loading, Oedometer, Scene, Stage, Wall
from mufe_fenicsx.units import with_unit

OEDOMETER = Oedometer(strain=0.06, speed=0.5, seating_stress=1e6)


def test_the_table_says_what_is_decided_and_escapes_texts():
    walls = {"x_min": Wall(velocity=-1e-3), "x_max": Wall(stress=1e5, speed=0.1, friction=0.3)}
    scene = Scene(SAND, Contact(0.23), OEDOMETER, title="<i>a & b</i>", walls=walls, accuracy=0.05)
    html = scene._repr_html_()
    assert "&lt;i&gt;a &amp; b&lt;/i&gt;" in html and "<i>" not in html
    for words in (
        "oedometer to strain 0.06 at 0.5 m/s, seated at 1 MPa",
        "J2: E = 100 GPa, nu = 0.15, rho = 2650 kg/m³, yields at 10 MPa",
        "x_min moving at -0.001 m/s, x_max held at 100 kPa, z_max the platen, others at rest",
        "friction 0 to 0.3",
        ">5 %<",
    ):
        assert words in html, words


def test_the_table_of_a_test_by_stages():
    stages = (Stage(zero=True, xyz=Axis(stress=1e5)), Stage(name="shear", z=Axis(strain=0.05)))
    scene = Scene(Elastic(70e9, 0.2, 2500.0), Contact(0.5), loading=Loading(0.5), stages=stages)
    html = scene._repr_html_()
    assert "stages: seating, shear" in html and "Elastic: E = 70 GPa" in html
    assert "led by the stages" in html and "accuracy" not in html


@pytest.mark.parametrize(
    "value, unit, text",
    [
        (1e11, "Pa", "100 GPa"),
        (999.6e3, "Pa", "999.6 kPa"),
        (999.97e3, "Pa", "1 MPa"),
        (0.0, "Pa", "0 Pa"),
        (5e-6, "m", "5 µm"),
        (2650.0, "kg/m^3", "2650 kg/m³"),
        (0.15, "-", "0.15"),
    ],
)
def test_numbers_with_units(value, unit, text):
    assert with_unit(value, unit) == text
