"""From grains to a folder with their packing: meshes, table, picture, scene."""

import time

import numpy as np

from ...errors import InputError
from ...geometry.grains import Grains, save_grains
from ...geometry.image.label_files import write_labels, write_table
from ...kernels.packing.packed_surfaces import label_voxels
from ...machine.files import new_folder
from ...materials.sand import scene_table
from ...units import lengths_text, require, with_unit
from ..shapes import sizes_by_mass
from ..starter_scenes import DAMPED, HEAD, OEDOMETER, OUTPUT, write_scene
from .assembly import Assembly
from .container import BOX, CYLINDER, Container
from .measures import measured, void_ratio_inside
from .picture import draw_packing
from .settings import GRAVITY, MOST_VOXELS
from .sources import SOLID_FRACTION, draw_grains, meshes_in_place, meshes_of, shapes_of
from .start import column, fits, loose
from .stiffness import over_modulus
from .ways import PRESSURE, TOLERANCE, compress, reach_void_ratio, settle

#: File by which a folder is known as one that may be replaced.
MARKER = "packing.csv"
#: Part of a grain's volume below which what is left of it in a sample cut out is void: a cap of
#: an eighth of a sphere's diameter.
LEAST = 0.05
#: Table of the scene of a cylinder.
ROUND = """
[container]
shape = "cylinder"        # side, z_min and z_max are its walls
"""

#: The test of a packing that bears a stress.
FROM_STRESS = """
[loading]                 # a test by stages: the walls move
speed = "0.3 m/s"         # at which a length of the sample changes, at most
ramp = 0.001              # strain over which walls get to it
tolerance = 0.02          # of stresses

[[stage]]                 # the stress that it was packed at; strains count from its end
zero = true
{across} = {{ stress = "{side}" }}
z = {{ stress = "{z}" }}

[[stage]]                 # an oedometer: the sides rest, the top comes down
name = "compress"
{across} = {{ speed = 0 }}
z = {{ strain = 0.06, walls = "max" }}
"""


def pack(source, settings, output_folder, *, spheres=False, overwrite=False, progress=None):
    """Pack grains and write all that is known of the packing.

    Writes grains/ as `mufe mesh` does, packing.csv (a row a grain), packing.png, scene.toml with
    its schema, and labels.tif where a voxel size is given. Scripts that call this need
    ``if __name__ == "__main__":`` where grains have to be meshed.

    Args:
        source: As of `sources.draw_grains`.
        settings: `PackSettings`.
        output_folder: New folder.
        spheres: Pack spheres.
        overwrite: Replace a folder that was written by this before.
        progress: Called with steps of the packing, None and a text.

    Returns:
        A dictionary of numbers: void_ratio, coordination_number, …

    Raises:
        InputError: The source cannot be used, or the output cannot be written.
        SolverError: The packing did not come to rest, or not at the void ratio.
    """
    start = time.perf_counter()
    with new_folder(output_folder, overwrite=overwrite, marker=MARKER) as folder:
        rng_grains, rng_pack = np.random.default_rng(settings.seed).spawn(2)
        draw = draw_grains(source, spheres, settings, rng_grains)
        settings.check_sizes(len(draw.size), draw.unit)
        assembly = packed(draw, settings, rng_pack, progress)
        packed_at = time.perf_counter()
        numbers = measured(assembly)
        grains = _meshed(draw, assembly, settings, progress)
        save_grains(folder / "grains", grains)
        write_table(folder / MARKER, _rows(draw, assembly))
        if settings.voxel_size is not None:
            _write_labels(folder / "labels.tif", assembly, draw, settings)
        text = _scene_text(grains.num_grains, assembly.container.kind, settings)
        write_scene(text, folder, output_folder)
        draw_packing(folder / "packing.png", assembly, draw.unit)
    edges = (assembly.container.high - assembly.container.low) * draw.unit
    size_taken = settings.size_taken(edges)
    d50, uniformity = sizes_by_mass(draw.size)
    return {
        **{name: value for name, value in numbers.items() if value == value},  # without nan
        "friction_at_start": settings.first_friction,
        "mean_diameter": draw.unit,
        "d50": d50,
        "uniformity": uniformity,
        "container": assembly.container.kind,
        "container_x": float(edges[0]),
        "container_y": float(edges[1]),
        "container_z": float(edges[2]),
        **({} if size_taken is None else {"size_taken": size_taken}),
        "element_size": grains.element_size,
        "num_cells": len(grains.cells),
        "num_nodes": len(grains.points),
        "output": str(output_folder),
        "next": f"mufe run {output_folder}/scene.toml -o {output_folder}/results",
        "packing_seconds": round(packed_at - start, 2),
        "seconds": round(time.perf_counter() - start, 2),
    }


def packed(draw, settings, rng, progress=None):
    """:class:`Assembly` at rest of the grains of a draw, as asked for.

    Args:
        draw: `sources.Draw`.
        settings: `PackSettings`.
        rng: NumPy generator, for places and turns at the start.
        progress: As of :func:`pack`.

    Raises:
        InputError: Grains have no room in the container.
        SolverError: As of :func:`pack`.
    """
    shapes, size = shapes_of(draw, settings), draw.size / draw.unit
    kind = BOX if settings.cylinder is None else CYLINDER
    edges = np.ones(3) if settings.edges is None else np.array(settings.edges) / draw.unit
    shown = progress and (
        lambda step, a: progress(step, None, f"void ratio {a.void_ratio + a.apart:.3f}{a.doing}")
    )
    more = {"friction": settings.first_friction, "wall_friction": settings.wall_friction}
    if settings.way == GRAVITY:
        if settings.edges is None:  # a cube of about what is needed
            edges *= max(np.cbrt(len(size) * np.pi / 6 / 0.6), 3.0)
        if not fits(shapes, draw.shape, size, edges[:2]):
            raise InputError(
                f"base of the container {edges[0] * draw.unit:.4g} m, expected more than the "
                f"largest grain, {2 * (shapes.reach[draw.shape] * size).max() * draw.unit:.4g} m "
                "and a sixth of it"
            )
        bodies, container = column(shapes, draw.shape, size, rng, kind, edges[:2])
        assembly = Assembly(bodies, container, **more, progress=shown)
        settle(assembly)
        return assembly
    if settings.container is not None:
        _require_room(shapes, draw, edges, settings)
    bodies, container = loose(shapes, draw.shape, size, rng, kind, edges)
    assembly = Assembly(bodies, container, **more, progress=shown)
    pressure = PRESSURE
    if settings.stress is not None:
        stresses = np.array(settings.stresses)
        pressure = over_modulus(stresses.mean()) * stresses / stresses.mean()
    compress(assembly, pressure)
    if settings.void_ratio is not None:
        held = settings.stress is not None
        assembly = reach_void_ratio(assembly, settings.void_ratio, pressure, _void_ratio, held)
    return assembly


def _require_room(shapes, draw, edges, settings):
    """Raise InputError where a container of these proportions ends narrower than a grain."""
    part = np.pi / 4 if settings.cylinder is not None else 1.0
    solid = np.pi / 6 * (draw.size**3).sum()
    least = (edges * np.cbrt(solid / SOLID_FRACTION / part / np.prod(edges * draw.unit))).min()
    thin = [2 * np.linalg.norm(points, axis=1).min() for points, _ in shapes.surfaces]
    thickest = float((np.array(thin)[draw.shape] * draw.size).max())
    if least * draw.unit < thickest:
        name, lengths = settings.container
        raise InputError(
            f"{name} = {lengths_text(lengths)}: {with_unit(least * draw.unit, 'm')} wide around "
            f"{len(draw.size)} grains, expected more than the thickest of them, "
            f"{with_unit(thickest, 'm')}"
        )


def _void_ratio(assembly):
    """The void ratio that is asked for, away from walls where there is such a place."""
    found, error = void_ratio_inside(assembly)
    return found or assembly.void_ratio, max(TOLERANCE, 0.5 * error)


def _meshed(draw, assembly, settings, progress):
    """`Grains` of the packing [m]."""
    shown = progress and (lambda done, total: progress(done, total, "meshing"))
    container, wider = assembly.container, 1.0
    if settings.stress is not None:
        # Without their load contacts just touch: it brings grains to where they are packed.
        wider += assembly.contacts.sums.depth
        container = Container(container.kind, wider * container.low, wider * container.high)

    def place(b, points):
        at = assembly.bodies.centre[b] - assembly.container.low
        return (wider * at + assembly.turned(b, points)) * draw.unit

    def from_walls(points):
        return container.from_walls(points / draw.unit + container.low) * draw.unit

    if settings.contact_size is not None:
        placed, element_size = meshes_in_place(draw, settings, place, from_walls, shown)
    else:
        meshes, element_size = meshes_of(draw, settings, shown)
        placed = [(place(b, meshes[t][0]), meshes[t][1]) for b, t in enumerate(draw.shape)]
    # What stands out of a wall, by a contact or as a corner of a round grain, becomes flat.
    placed = [
        ((container.pulled_in(x / draw.unit + container.low) - container.low) * draw.unit, cells)
        for x, cells in placed
    ]
    box = np.array([np.zeros(3), container.high - container.low]) * draw.unit
    return Grains.from_list(np.arange(1, len(placed) + 1), placed, element_size, box)


def _rows(draw, assembly):
    """A row a grain of packing.csv."""
    bodies = assembly.bodies
    centre = (bodies.centre - assembly.container.low) * draw.unit
    pairs, _ = assembly.contacts.touching()
    count = np.bincount(pairs.ravel(), minlength=bodies.num_bodies)
    walls = (assembly.contacts.wall_push > 0).sum(axis=1)
    return [
        {
            "label": b + 1,
            "shape": int(draw.shape[b]) + 1,
            "equivalent_diameter_m": float(draw.size[b]),
            **{f"centroid_{axis}_m": float(x) for axis, x in zip("xyz", centre[b], strict=True)},
            "contacts": int(count[b]),
            "wall_contacts": int(walls[b]),
        }
        for b in range(bodies.num_bodies)
    ]


def _write_labels(path, assembly, draw, settings):
    """Voxels of the container, each with the grain in which its middle lies deepest.

    Of a sample cut out, what is left of a grain is void where that is less than :data:`LEAST` of
    it: too thin for a mesh.
    """
    bodies, container, s = assembly.bodies, assembly.container, assembly.bodies.shapes
    voxel_size, cut = settings.voxel_size, settings.cut
    low, high, voxel = container.low + cut, container.high - cut, voxel_size / draw.unit
    largest = 0.5 * float((container.high - container.low).min()) - voxel
    require(cut < largest, "cut", cut, f"less than half of the container, {largest:.3g}")
    shape = np.ceil((high - low) / voxel - 1e-6).astype(int)
    expected = f"{MOST_VOXELS:g} voxels at most, which are {' x '.join(map(str, shape))}"
    require(np.prod(shape.astype(float)) <= MOST_VOXELS, "voxel_size", voxel_size, expected)
    labels = np.zeros(shape[::-1], dtype=np.int32)
    depth = np.zeros(labels.shape, dtype=np.float32)
    label_voxels(
        labels, depth, low, voxel, s.spheres, bodies.centre, bodies.axes, bodies.size,
        bodies.reach, bodies.shape, s.grid, s.low, s.step,
    )  # fmt: skip
    if cut and container.kind == CYLINDER:
        z, y, x = np.nonzero(labels)
        middles = low + (np.column_stack([x, y, z]) + 0.5) * voxel
        labels[z, y, x] *= container.inside(middles, cut)
    if cut:
        whole = np.pi / 6 * (draw.size / voxel_size) ** 3
        left = np.bincount(labels.ravel(), minlength=len(whole) + 1)
        labels[np.insert(left[1:] < LEAST * whole, 0, False)[labels]] = 0
    write_labels(path, labels, voxel_size)


def _scene_text(num_grains, kind, settings):
    """Oedometer test (TOML) of a packing in a box or cylinder; see `scene.load_scene`."""
    head = HEAD.format(
        title=f"Oedometer test on a packing of {num_grains} grains",
        grains="what `mufe pack` packed",
        friction=0.23,
        wall=0.0,
        material=scene_table(),
    )
    container, test = ROUND if kind == CYLINDER else "", OEDOMETER
    if settings.stress is not None:
        side, _, vertical = (f"{stress:.9g} Pa" for stress in settings.stresses)
        test = FROM_STRESS.format(across="r" if kind == CYLINDER else "xy", side=side, z=vertical)
    return head + container + DAMPED.format(100) + test + OUTPUT
