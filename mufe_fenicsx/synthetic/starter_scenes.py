"""New scenes to begin with: a commented scene file, its JSON schema, and grains."""

import functools
from pathlib import Path

import numpy as np

from ..errors import InputError, nearest_name, shown
from ..geometry.bodies.shapes import sphere, sphere_near_contact
from ..geometry.grains import Grains, save_grains
from ..geometry.measure import tet_volumes
from ..machine.files import new_folder
from ..materials.sand import scene_table
from ..scene.schema import schema_text
from .packing import pack
from .rigid_packing.assembly import Assembly
from .rigid_packing.container import CYLINDER
from .rigid_packing.shapes import ball
from .rigid_packing.start import loose
from .rigid_packing.ways import compress
from .shapes import make_grains, sizes
from .shear_box import SCENE as SHEAR
from .shear_box import write_shear_box
from .triangulated import icosphere

SCHEMA_FILE = "scene.schema.json"

#: Balls of the sample of sand: median diameter by mass [m] and d60/d10.
D50, UNIFORMITY = 300e-6, 1.3
#: Number of the balls, and the packing that is taken: of 60 tried that with most solids, half of
#: the box. Walls are near to all of so few balls, and looser packings (0.44 in the middle of the
#: 60) collapse when they are loaded.
FEW = (24, 5)
#: The same where side walls give way: of 24 balls chains of a few carry all, and the load is lost
#: where one of them buckles. Of 8 packings tried that with most solids, 0.52.
MANY = (60, 7)
#: The same in an upright cylinder, and proportions of the box around it.
ROUND, TALL = (48, 1), np.array([1.0, 1.0, 1.4])
#: Depth of contacts at which their packing is done, over D50.
DEPTH = 1e-2
#: Diameter of the mesh of a ball over its own where coarse ones are to pass the edges of tools.
LOOSE = 0.987
#: Element size over radius of these balls.
COARSE = 0.35
#: Element size and height of a ball that is crushed, over its diameter.
EDGE, BLUNT = 0.125, 0.92
#: Radius of a single ball [m]; element size at its poles and radius of contact over the radius.
RADIUS, FINE, CONTACT = 0.5e-3, 0.04, 0.1

HEAD = """\
#:schema ./scene.schema.json
# {title}. Run it, and look at it:
#
#     mufe run scene.toml -o results          (or: mpirun -n 4 mufe run ...)
#     mufe report results
#
# Numbers without a unit are in SI units; a text carries one: "20 um", "100 GPa". A key that is
# left out takes its default: `mufe scene scene.toml` lists all of them, and
# `mufe scene --explain KEY` says what one means. The first line lets an editor with a TOML
# language server (Taplo: "Even Better TOML" for VS Code) complete and check keys.

title = "{title}"

[sample]
grains = "grains"         # {grains};
                          # instead of it, the folder that `mufe mesh` wrote of your own scan

{material}
[contact]
friction = {friction:<15}# between grains
wall_friction = {wall:<10}# between grains and walls
"""

SCAN = """\
#:schema ./scene.schema.json
# {title}. In this folder, with the scan beside this file:
#
#     mufe segment --scene scene.toml -o labels.tif      then look at labels.png
#     mufe mesh labels.tif --scene scene.toml -o grains  then look at grains/quality.png
#     mufe run scene.toml -o results                     (or: mpirun -n 4 mufe run ...)
#     mufe report results
#
# Numbers without a unit are in SI units; a text carries one: "20 um", "100 GPa". A key that is
# left out takes its default: `mufe scene scene.toml` lists all of them, and
# `mufe scene --explain KEY` says what one means. `mufe synthesize` makes a scan to practise on.

title = "{title}"

[image]                   # to change: file, voxel_size, crop
file = "scan.tif"         # TIFF, folder of slices, HDF5, NRRD, MetaImage, NIfTI, NumPy; raw
                          # files need shape = [z, y, x] and dtype = "<u2"
voxel_size = "5 um"       # or three lengths, z, y, x
crop = [[0, 100], [0, 100], [0, 100]]  # voxels, z, y, x: begin with a part; all without it
# cylinder = "field"      # the sample is round: "field" of view, in a "mould", or "given"
# invert = true           # where grains are darker than voids
# relative_depth = 0.06   # lower where grains hang together, higher where they are cut

[mesh]
size = "20 um"            # to change: wanted length of edges, a tenth to a fifteenth of a grain
keep_largest_piece = true # of a grain that noise left in pieces

[sample]
grains = "grains"         # the folder that `mufe mesh` writes

{material}
[contact]
friction = 0.23           # between grains
wall_friction = 0.0       # between grains and walls
"""

OEDOMETER = """
[oedometer]               # the top platen moves, all other walls rest
strain = 0.06             # vertical, counted from the end of seating
speed = "0.5 m/s"         # of the top platen: slow enough if kinetic energy stays small
ramp = 0.002              # strain over which the platen reaches this speed
seating_stress = "2 MPa"  # the platen first closes the gaps, up to this stress
seating_speed = "0.3 m/s" # slowly, so that single impacts stay below it
seating_at_rest = true    # and holds it until all is at rest; false: the test begins at once

[mass_scaling]            # mass where it lengthens the time step most: half of the steps;
added = 0.2               # at most so much of the mass of all grains, and of one; leave the
added_to_grain = 1.0      # table out where grains are "rigid" or "auto", and in static increments
"""

DAMPED = """
[solver]
damping = "{} ms^-1"     # 1/ms: stills grains that rattle between contacts; counted as damping
"""

STAGED = """
[loading]                 # a test by stages: the six walls move
speed = "0.1 m/s"         # at which a length of the sample changes, at most
ramp = 0.001              # strain over which walls get to it
tolerance = 0.01          # of stresses
                          # `mufe plan` says which speed an accuracy asks for; a table
                          # [quasi_static] lets it follow targets after the seating

[[stage]]                 # to this stress, until all is at rest; strains count from its end
zero = true
xyz = { stress = "1 MPa", speed = "1 m/s" }
"""

ISOTROPIC = (
    STAGED
    + """
[[stage]]
name = "load"
xyz = { stress = "5 MPa" }

[[stage]]
name = "unload"
xyz = { stress = "2 MPa" }

[[stage]]
name = "reload"
xyz = { stress = "8 MPa" }
hold = "5 us"             # stresses are held so long
"""
)

TRIAXIAL = (
    STAGED
    + """
[[stage]]
name = "isotropic"
xyz = { stress = "5 MPa" }

[[stage]]                 # x and y go on at the stress that they hold; it is off by more the
name = "shear"            # faster their walls have to move
z = { strain = 0.012, speed = "0.15 m/s" }

# A true-triaxial test says what each axis does:
#
#     [[stage]]
#     name = "shear"
#     x = { stress = "3 MPa" }
#     y = { stress = "5 MPa" }
#     z = { stress = "9 MPa" }
"""
)

SOFT = """\
[material]                # soft balls: long steps, and at these stresses they hardly deform
model = "elastic"
E = "1 GPa"
nu = 0.2
rho = "2650 kg/m^3"
"""

MEMBRANE = """
[container]
shape = "cylinder"        # around the axis of the sample, along z

[membrane]                # in place of its side, glued to both platens
thickness = "50 um"       # of latex; 0.3 mm is that of samples of some centimetres
rho = "100 kg/m^3"        # a light one follows the cell sooner
# E = "1.4 MPa"
# correction = true       # its share of the axial force is left out of stress_z

[walls.side]
friction = 0.3            # between grains and membrane

[loading]                 # a test by stages: the platens move, the cell presses
speed = "0.05 m/s"        # at which a length of the sample changes, at most
ramp = 0.001              # strain over which platens get to it
tolerance = 0.02          # of stresses

[[stage]]                 # to this stress, until all is at rest; strains count from its end
zero = true
rz = { stress = "50 kPa", speed = "2 m/s" }

[[stage]]
name = "isotropic"
rz = { stress = "100 kPa" }

[[stage]]                 # the cell goes on at its pressure
name = "shear"
z = { strain = 0.01 }
"""

BALL = """
[loading]                 # a test by stages: the six walls move
speed = "0.5 m/s"         # at which a length of the sample changes, at most
ramp = 0.002              # strain over which walls get to it

[[stage]]                 # walls at the sides go out of the way, platens come; then strains count
zero = true
xy = { strain = -0.05, speed = "5 m/s" }
z = { stress = "1 MPa" }

[[stage]]
name = "press"
z = { strain = 0.01 }

[[stage]]
name = "unload"
z = { stress = "1 MPa" }
"""

BALLS = """
[loading]                 # a test by stages: the six walls move
speed = "0.2 m/s"         # at which a length of the sample changes, at most
ramp = 0.001              # strain over which walls get to it
tolerance = 0.02          # of stresses

[[stage]]                 # the walls at the sides stay near: balls on end roll away otherwise
zero = true
xy = { strain = -0.001 }
z = { stress = "0.5 MPa" }

[[stage]]                 # led by the mean stress of top and bottom: 2 MPa are 2.2 N here
name = "press"
z = { stress = "2 MPa" }

[[stage]]
name = "unload"
z = { stress = "0.5 MPa" }

[[stage]]
name = "reload"
z = { stress = "2 MPa" }
"""

QUARTZ = """\
[material]
model = "elastic"
E = "100 GPa"
nu = 0.15
rho = "2650 kg/m^3"

[fracture]                # the grain breaks along facets between its tetrahedra
strength = "60 MPa"       # tensile; edges are a fifth of the zone E·energy/strength² or less
energy = "10 J/m^2"       # of a crack, over its area
shear_ratio = 2.0         # shear strength over tensile strength
friction = 0.6            # of pressed facets: without it contacts crush before grains split
modulus = 5.0             # Weibull's, of the strengths of facets
seed = 1                  # of these: `mufe run scene.toml --set fracture.seed=2` is another grain
"""

CRUSHING = """
[loading]                 # a test by stages: the six walls move
speed = "1 m/s"           # at which a length of the sample changes, at most
ramp = 0.001              # strain over which walls get to it

[[stage]]                 # walls at the sides go out of the way, platens come; then strains count
zero = true
xy = { strain = -0.05, speed = "10 m/s" }
z = { stress = "1 MPa" }

[[stage]]                 # strength: largest force before a fragment comes loose, over the diameter
name = "crush"            # squared; from there on steps are shorter, and cost more
z = { strain = 0.009 }
"""

RIGID = """\
[material]
model = "rigid"           # or "elastic", "j2", "auto": slower by ten times and more
E = "100 GPa"             # of contacts
nu = 0.15
rho = "2650 kg/m^3"
"""

OUTPUT = """
[output]
fields = 11               # states with all fields, for ParaView and the report
history = 300             # rows of history.csv
checkpoint = "5 min"      # by the clock; `mufe run --resume` goes on from the last one
"""


def write_new_scene(kind, folder, *, overwrite=False, membrane=False):
    """Write scene.toml, its JSON schema and grains, but for a scan, into a new folder.

    Args:
        kind: One of `KINDS`.
        folder: New folder.
        overwrite: Replace a folder that was written by this before.
        membrane: Put the sample into one; of a kind "triaxial".

    Returns:
        What was written: folder, the next command, and num_grains and num_cells of grains.

    Raises:
        InputError: there is no such kind, or the folder cannot be written.
    """
    if kind not in KINDS:
        raise InputError(f"kind = {shown(kind)}, expected {nearest_name(kind, KINDS)}")
    if membrane and kind not in IN_MEMBRANE:
        raise InputError(f"kind = {shown(kind)}, expected {' or '.join(IN_MEMBRANE)} in a membrane")
    text, make = (IN_MEMBRANE if membrane else KINDS)[kind]
    with new_folder(folder, overwrite=overwrite, marker=SCHEMA_FILE) as new:
        grains = make() if make else None
        if grains is not None:
            save_grains(new / "grains", grains)
        if kind in FILES:
            FILES[kind](new, grains)
        write_scene(text, new, folder)
    if grains is None:
        return {
            "folder": str(folder),
            "next": f"edit image and mesh.size in {folder}/scene.toml, then in {folder}: "
            "mufe segment --scene scene.toml -o labels.tif",
        }
    return {
        "folder": str(folder),
        "num_grains": grains.num_grains,
        "num_cells": len(grains.cells),
        "next": f"mufe run {folder}/scene.toml -o {folder}/results",
    }


def write_scene(text, new, folder):
    """Write a scene's text and its JSON schema, where copies of the scene find it too.

    Args:
        text: Of the scene; its first line names the schema.
        new: Folder to write into, which becomes ``folder``.
        folder: Its name in the end.
    """
    place = (Path(folder).resolve() / SCHEMA_FILE).as_uri()
    (new / "scene.toml").write_text(text.replace(f"./{SCHEMA_FILE}", place), encoding="utf-8")
    (new / SCHEMA_FILE).write_text(schema_text(), encoding="utf-8")


@functools.cache
def ball_packing(number=FEW[0], seed=FEW[1], part=1.0):
    """`Grains` of balls packed at random in a box without friction.

    Args:
        number: Of balls.
        seed: Of their sizes and places.
        part: Of its diameter that each ball is meshed with.
    """
    rng = np.random.default_rng(seed)
    ones = np.ones(number)
    balls = make_grains(rng, sizes(rng, number, D50, UNIFORMITY), ones, ones, 0.0, 1.7, 3)
    packing = pack(balls, rng, np.ones(3), DEPTH * D50)
    room = packing.low, packing.high
    return _meshed(packing.centre, part * balls.diameter, lambda x: np.clip(x, *room))


@functools.cache
def round_packing(number=ROUND[0], seed=ROUND[1]):
    """The same in an upright cylinder."""
    rng = np.random.default_rng(seed)
    diameter = sizes(rng, number, D50, UNIFORMITY)
    points, triangles = icosphere(3)
    shapes = ball((0.5 * points, triangles))
    bodies, container = loose(shapes, np.zeros(number, int), diameter / D50, rng, CYLINDER, TALL)
    compress(Assembly(bodies, container, 0.0, 0.0), DEPTH)
    return _meshed(bodies.centre * D50, diameter, lambda x: D50 * container.pulled_in(x / D50))


def _meshed(centres, diameters, pulled_in):
    """`Grains` of balls of the volume of their spheres, flat where a wall cuts them off."""
    points, cells = sphere(1.0, COARSE)
    points *= np.cbrt(4.0 / 3.0 * np.pi / tet_volumes(points, cells).sum())
    meshes = [
        (pulled_in(x + 0.5 * d * points), cells) for x, d in zip(centres, diameters, strict=True)
    ]
    return Grains.from_list(np.arange(1, len(meshes) + 1), meshes, 0.5 * COARSE * D50)


@functools.cache
def blunt_ball():
    """`Grains` of one ball whose poles are cut flat, so that platens touch several facets."""
    points, cells = sphere(0.5 * D50, EDGE * D50)
    points[:, 2] = np.clip(points[:, 2], -0.5 * BLUNT * D50, 0.5 * BLUNT * D50)
    return Grains.from_list([1], [(points, cells)], EDGE * D50)


def column_of_balls(number):
    """`Grains` of equal balls on top of each other."""
    points, cells = sphere_near_contact(
        RADIUS, FINE * RADIUS, 0.3, (0.0, 0.0, 1.0), CONTACT * RADIUS, both_poles=True
    )
    height = np.ptp(points[:, 2])
    meshes = [(points + np.array([0.0, 0.0, k * height]), cells) for k in range(number)]
    return Grains.from_list(np.arange(1, number + 1), meshes, FINE * RADIUS)


def _text(title, test, grains, friction=0.23, wall=0.0, material=None, **yields):
    head = HEAD.format(
        title=title, grains=grains, friction=friction, wall=wall,
        material=material or scene_table(**yields),
    )  # fmt: skip
    return head + test + OUTPUT


_SAND, _MORE = (f"{number} balls in a random packing, meshed coarsely" for number, _ in (FEW, MANY))
_ROUND = f"{ROUND[0]} balls in a round sample, packed at random, meshed coarsely"
_HARD = {"first": "1 GPa", "last": "2 GPa"}

_TITLE = "Oedometer test on a scan"

#: Scenes with further files, and what writes them.
FILES = {"shear-box": write_shear_box}

#: Scenes by name: text of the file and the function that makes the grains, or None.
KINDS = {
    "scan": (
        SCAN.format(title=_TITLE, material=scene_table()) + OEDOMETER + OUTPUT,
        None,
    ),
    "oedometer": (
        _text("Oedometer test on balls", DAMPED.format(100) + OEDOMETER, _MORE, **_HARD),
        functools.partial(ball_packing, *MANY),
    ),
    "isotropic": (
        _text("Isotropic compression of balls", DAMPED.format(100) + ISOTROPIC, _SAND, **_HARD),
        ball_packing,
    ),
    "triaxial": (
        _text("Triaxial test on balls", DAMPED.format(200) + TRIAXIAL, _MORE, 0.5, **_HARD),
        functools.partial(ball_packing, *MANY),
    ),
    "shear-box": (
        _text("Direct shear test on balls", SHEAR, _MORE, 0.5, material=RIGID),
        functools.partial(ball_packing, *MANY, LOOSE),
    ),
    "single-grain": (
        _text("A ball between two platens", BALL, "one ball of 1 mm", wall=0.2),
        functools.partial(column_of_balls, 1),
    ),
    "crushing": (
        _text("A grain crushed between two platens", CRUSHING, "one ball of 0.3 mm, its poles flat",
              0.4, 0.4, QUARTZ),
        blunt_ball,
    ),
    "two-spheres": (
        _text("Two balls pressed together", BALLS, "two balls of 1 mm", wall=0.2, **_HARD),
        functools.partial(column_of_balls, 2),
    ),
}  # fmt: skip

#: The same of samples in a membrane.
IN_MEMBRANE = {
    "triaxial": (
        _text(
            "Triaxial test on balls in a membrane", DAMPED.format(20) + MEMBRANE, _ROUND, 0.5,
            material=SOFT,
        ),
        round_packing,
    ),
}  # fmt: skip
