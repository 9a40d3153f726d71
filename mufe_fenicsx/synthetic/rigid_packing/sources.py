"""Where grains come from: spheres, random shapes, meshes, surfaces."""

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...errors import InputError
from ...geometry.bodies.shapes import sphere
from ...geometry.grains import load_grains
from ...geometry.measure import boundary_triangles, compact, tet_volumes
from ...geometry.settings import MeshSettings
from ...geometry.surface.given_surfaces import has_bodies, read_bodies
from ...geometry.surface.sizing import CONTACT
from ...geometry.tets.jobs import surface_jobs
from ...geometry.tets.mesher import mesh_grains
from ...scene.shipped import SHIPPED, shipped_mesh
from ...units import lengths_text, require
from ..settings import LARGEST_SIZE, SynthesisSettings
from ..shapes import make_grains, sizes, sizes_by_mass
from ..triangulated import icosphere
from .settings import FORM, MOST_GRAINS
from .shapes import ball, in_own_frame, make_shapes

#: Subdivisions of the icosahedron that surfaces of random grains and spheres are drawn with.
LEVEL = 3
#: Last degree of the spectrum of random grains.
MAX_DEGREE = 15
#: Element size over the mean diameter where none is stated.
ELEMENT = 0.1
#: The same away from contacts where these are finer.
COARSE = 0.2
#: Solid fraction by which the number of grains of a container is chosen.
SOLID_FRACTION = 0.6


@dataclass
class Supply:
    """Shapes to draw grains from, in their own frames with volume π/6."""

    source: str  #: what they are, for messages
    surfaces: list  #: (points, triangles, principal moments) of each
    size: np.ndarray  #: diameters of the spheres of equal volume [m], shape (num_shapes,)
    meshes: list | None = None  #: (points, cells) of each; None: still to be made
    element_size: float | None = None  #: of the meshes [m]
    spheres: bool = False


@dataclass
class Draw:
    """Grains to pack."""

    supply: Supply
    shape: np.ndarray  #: number of the shape of each grain
    size: np.ndarray  #: diameter of the sphere of equal volume [m]

    @property
    def unit(self):
        """Mean diameter [m]: of the sphere of the mean volume."""
        return float(np.cbrt((self.size**3).mean()))


def draw_grains(source, spheres, settings, rng):
    """:class:`Draw` of a source, as many grains as are asked for or the container holds.

    Args:
        source: Folder of grains, ``meshes:NAME``, surfaces, the ``shapes.csv`` that `mufe
            shapes` wrote or its folder, or None: random grains.
        spheres: Spheres instead of all these.
        settings: `PackSettings`.
        rng: NumPy generator.

    Raises:
        InputError: The source cannot be used.
    """
    if spheres and source is not None:
        raise InputError(f"--spheres beside {source}, expected one of them")
    table = None if source is None else _shape_table(source)
    if spheres:
        settings.refuse((*FORM, "scale"), "spheres")
        supply = _ball_supply()
    elif source is None or table is not None:
        settings.refuse(("scale",), "random grains")
        return _random_grains(table, settings, rng)
    else:
        settings.refuse(FORM, str(source))
        supply = _given_supply(source, settings)
    if spheres or settings.d50 is not None or settings.uniformity is not None:
        d50, uniformity = _distribution(settings, None)
        n = _count(settings, (_sizes(rng, 4000, d50, uniformity) ** 3).mean())
        size = _sizes(rng, n, d50, uniformity)
        shape = rng.integers(len(supply.size), size=n)
    else:
        n = _count(settings, (supply.size**3).mean())
        # Each shape as often as the others, the rest by chance.
        shape = rng.permutation(n) % len(supply.size)
        size = supply.size[shape]
    return Draw(supply, shape, size)


def _sizes(rng, n, d50, uniformity):
    return np.full(n, d50) if uniformity == 1 else sizes(rng, n, d50, uniformity)


def _distribution(settings, table):
    """d50 [m] and uniformity: as asked for, of a table of shapes, or the defaults."""
    usual = SynthesisSettings()
    d50, uniformity = usual.d50, usual.uniformity
    if table is not None:
        d50, uniformity = sizes_by_mass(table["equivalent_diameter_m"])
        uniformity = min(3.0, uniformity)
    return settings.d50 or d50, settings.uniformity or uniformity


def _count(settings, mean_cube):
    """Number of grains, by the mean cube of their diameters [m³]."""
    if settings.count is not None:
        return settings.count
    if settings.container is None:
        raise InputError(
            "--count is missing, expected a number of grains, or a --box or --cylinder to fill"
        )
    volume = np.prod(settings.edges) * (np.pi / 4 if settings.cylinder is not None else 1.0)
    solid = SOLID_FRACTION
    if settings.void_ratio is not None:
        solid = 1 / (1 + settings.void_ratio)
    n = solid * volume / (np.pi / 6 * mean_cube)
    name, lengths = settings.container
    expected = f"room for 2 to {MOST_GRAINS:.0e} grains, which is for {n:.3g}"
    require(2 <= round(n) <= MOST_GRAINS, name, lengths_text(lengths), expected)
    return round(n)


def _ball_supply():
    points, triangles = icosphere(LEVEL)
    surface = 0.5 * points, triangles, np.full(3, np.pi / 60)
    return Supply("spheres", [surface], np.ones(1), spheres=True)


def _random_grains(table, settings, rng):
    """:class:`Draw` of star-shaped grains at random, each with a shape of its own."""
    form = {name: getattr(SynthesisSettings(), name) for name in FORM}
    if table is not None:
        for name in ("elongation", "flatness"):
            form[name] = float(table[name].mean())
        form["form_spread"] = float(np.mean([table[n].std() for n in ("elongation", "flatness")]))
    form |= {name: getattr(settings, name) for name in FORM if getattr(settings, name) is not None}
    d50, uniformity = _distribution(settings, table)
    n = _count(settings, (_sizes(rng, 4000, d50, uniformity) ** 3).mean())
    size = _sizes(rng, n, d50, uniformity)
    spread = np.clip(form["form_spread"], 0.0, 0.2)
    elongation, flatness = (
        np.clip(rng.normal(form[name], spread, n), 0.3, 1.0) for name in ("elongation", "flatness")
    )
    grains = make_grains(
        rng, size, elongation, flatness, form["roughness"], form["falloff"], MAX_DEGREE
    )
    directions, triangles = icosphere(LEVEL)
    own = [in_own_frame(points, triangles) for points in grains.surface(directions)]
    surfaces = [(points, triangles, moments) for points, moments, *_ in own]
    supply = Supply("random grains", surfaces, np.array([diameter for *_, diameter in own]))
    return Draw(supply, np.arange(n), supply.size)


def _given_supply(source, settings):
    """:class:`Supply` of grains that `mufe mesh` wrote, or of surfaces."""
    path = Path(source)
    if str(source).startswith(SHIPPED):
        path = shipped_mesh(str(source), "SOURCE")
    if (path / "grains.h5").is_file() or path.suffix == ".h5":
        settings.refuse(("scale",), str(source))
        grains = load_grains(path)
        surfaces, size, meshes = [], [], []
        for g in range(grains.num_grains):
            points, cells = grains.grain(g)
            outer, triangles = compact(points, boundary_triangles(cells))
            own, moments, centroid, axes, diameter = in_own_frame(outer, triangles)
            surfaces.append((own, triangles, moments))
            size.append(diameter)
            meshes.append(((points - centroid) @ axes.T / diameter, cells))
        if settings.element_size is not None:
            meshes = None
        return Supply(str(source), surfaces, np.array(size), meshes, grains.element_size)
    if not path.exists():
        raise InputError(
            f"SOURCE {source} does not exist, expected a folder of grains, meshes:NAME, surfaces, "
            "or the shapes.csv of mufe shapes"
        )
    if not has_bodies(path):
        raise InputError(
            f"SOURCE {source}, expected a folder of grains, meshes:NAME, surfaces (STL …), or the "
            "shapes.csv of mufe shapes"
        )
    surfaces, size = [], []
    for _, x, triangles in read_bodies(path, settings.scale or 1.0):
        own, moments, *_, diameter = in_own_frame(x, triangles)
        surfaces.append((own, triangles, moments))
        size.append(diameter)
    return Supply(str(source), surfaces, np.array(size))


def _shape_table(source):
    """Columns of the table that `mufe shapes` wrote, or None where the source is none."""
    path = Path(source)
    path = path / "shapes.csv" if (path / "shapes.csv").is_file() else path
    if path.suffix != ".csv" or not path.is_file():
        return None
    columns = {
        "equivalent_diameter_m": LARGEST_SIZE, "elongation": 1.0, "flatness": 1.0,
    }  # fmt: skip
    try:
        with path.open(newline="", encoding="utf-8") as file:
            rows = csv.DictReader(file)
            absent = [name for name in columns if name not in (rows.fieldnames or ())]
            if absent:
                raise InputError(
                    f"SOURCE {source} has no column {absent[0]}, expected the shapes.csv of mufe "
                    "shapes"
                )
            table = list(rows)
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(
            f"SOURCE {source} cannot be read ({error}), expected the shapes.csv of mufe shapes"
        ) from error
    if not table:
        raise InputError(f"SOURCE {source} has no row, expected one a grain")
    return {
        name: np.array([_value(row[name], largest, f"SOURCE {source}, row {number}: {name}")
                        for number, row in enumerate(table, start=1)])
        for name, largest in columns.items()
    }  # fmt: skip


def _value(text, largest, name):
    """A number > 0 of a table."""
    try:
        value = float(text)
    except (TypeError, ValueError):
        value = np.nan
    if not 0 < value <= largest:
        raise InputError(f"{name} = {text}, expected a number > 0 and at most {largest:g}")
    return value


def shapes_of(draw, settings):
    """`shapes.Shapes` of the supply of a draw."""
    if draw.supply.spheres:
        return ball(draw.supply.surfaces[0][:2])
    return make_shapes(draw.supply.surfaces, settings.points)


def meshes_of(draw, settings, progress=None):
    """Tetrahedra of each shape in its own frame, and the length of their edges [m].

    Args:
        draw: :class:`Draw`.
        settings: `PackSettings`.
        progress: Called with the number of shapes that are meshed and of all.

    Returns:
        List of (points, cells); element size [m].

    Raises:
        InputError: A shape could not be meshed.
    """
    supply = draw.supply
    if supply.meshes is not None:
        ratio = draw.size.mean() / supply.size[draw.shape].mean()
        return supply.meshes, supply.element_size * float(ratio)
    size = settings.element_size or ELEMENT * draw.unit
    if supply.spheres:
        points, cells = sphere(0.5, size / draw.unit)
        meshes = [(points, cells)]
    else:
        meshes = _mesh_surfaces(draw, size, progress)
    # Facets cut off what is round: each mesh has the volume of its grain again.
    return [
        (x * np.cbrt(np.pi / 6 / tet_volumes(x, cells).sum()), cells) for x, cells in meshes
    ], size


def meshes_in_place(draw, settings, place, from_walls, progress=None):
    """Tetrahedra of each grain where it stands, fine at contacts.

    Args:
        draw: :class:`Draw`.
        settings: `PackSettings` with a contact_size.
        place: Gives the points [m] of a body, by its number and points in its own frame.
        from_walls: Gives distances of points from the nearest wall [m].
        progress: As of :func:`meshes_of`.

    Returns:
        List of (points [m], cells); largest length of edges [m].

    Raises:
        InputError: A grain could not be meshed.
    """
    supply, size = draw.supply, settings.element_size or COARSE * draw.unit
    surfaces = [surface[:2] for surface in supply.surfaces]
    if supply.spheres:
        points, triangles = icosphere(LEVEL + 1)
        surfaces = [(0.5 * points, triangles)]
    bodies = [(b + 1, place(b, surfaces[t][0]), surfaces[t][1]) for b, t in enumerate(draw.shape)]
    lengths = MeshSettings(
        size=max(size, settings.contact_size), smallest_size=settings.contact_size, sizing=CONTACT
    )
    return _made(bodies, lengths, supply.source, progress, from_walls), size


def _made(bodies, lengths, source, progress, from_walls=None):
    """(points, cells) of each of some bodies (label, points, triangles)."""
    made = mesh_grains(
        surface_jobs(bodies, lengths, from_walls),
        progress=progress and (lambda finished: progress(finished, len(bodies))),
    )
    for mesh in made:
        if not mesh.ok:
            raise InputError(
                f"element_size = {lengths.size:g} m: shape {mesh.label} of {source} could not be "
                f"meshed: {mesh.quality['reason']}"
            )
    of_label = {mesh.label: (mesh.points, mesh.cells) for mesh in made}
    return [of_label[label] for label, *_ in bodies]


def _mesh_surfaces(draw, size, progress):
    supply = draw.supply
    used = np.unique(draw.shape)
    scale = {int(t): float(draw.size[draw.shape == t].mean()) for t in used}
    bodies = [
        (int(t) + 1, supply.surfaces[t][0] * scale[int(t)], supply.surfaces[t][1]) for t in used
    ]
    made = _made(bodies, MeshSettings(size=size), supply.source, progress)
    empty = (np.zeros((0, 3)), np.zeros((0, 4), dtype=np.int64))
    meshes = [empty] * len(supply.surfaces)
    for t, (points, cells) in zip(used, made, strict=True):
        meshes[t] = points / scale[int(t)], cells
    return meshes
