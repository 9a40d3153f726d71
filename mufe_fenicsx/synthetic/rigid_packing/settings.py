"""What a user may choose about a packing."""

from dataclasses import dataclass

from ...errors import InputError
from ...units import check_keys, lengths_text, require, setting
from ..settings import LARGEST_SIZE, LEAST_SIZE

#: Most grains of a packing.
MOST_GRAINS = 50_000
#: Element size over the mean diameter: with the largest a grain is a few tetrahedra.
LEAST_ELEMENT, LARGEST_ELEMENT = 0.005, 0.5
#: Most voxels of labels.
MOST_VOXELS = 4e9
COMPRESSION, GRAVITY = "compression", "gravity"
#: Settings of the forms of random grains, which given grains have of their own.
FORM = ("elongation", "flatness", "form_spread", "roughness", "falloff")
#: Friction where none is stated: on the way to a void ratio it falls from the second.
FRICTION, FIRST_FRICTION = 0.3, 1.0


@dataclass(frozen=True)
class PackSettings:
    """Grains, their container and the way into it."""

    count: int | None = setting(
        None, "", "number of grains; None: as many as the container holds", ge=1, le=MOST_GRAINS
    )
    box: tuple | None = setting(
        None,
        "m",
        "edges of a box; with --count compression keeps no more than its proportions",
        shape=(3,),
        form="x,y,z",
    )
    cylinder: tuple | None = setting(
        None,
        "m",
        "upright cylinder; with --count compression keeps no more than its proportions",
        shape=(2,),
        form="diameter,height",
    )
    way: str = setting(
        COMPRESSION,
        "",
        '"compression" from all sides, or "gravity"',
        allowed=(COMPRESSION, GRAVITY),
    )
    stress: float | None = setting(
        None, "Pa", "vertical stress that the sample has at the end; None: barely any", gt=0
    )
    k0: float | None = setting(None, "-", "stress of the sides over that; None: 1", ge=0.1, le=3)
    void_ratio: float | None = setting(
        None,
        "-",
        "away from walls, at which compression ends; None: where grains bear",
        ge=0.2,
        le=5,
    )
    friction: float | None = setting(
        None,
        "-",
        "coefficient between grains during packing; None: 0.3, or from 1 down to a void ratio",
        ge=0,
        le=10,
    )
    wall_friction: float = setting(
        0.0, "-", "coefficient between grains and walls during packing", ge=0, le=10
    )
    d50: float | None = setting(
        None,
        "m",
        "half of the mass is in smaller grains; None: sizes as given, or 300 um",
        ge=LEAST_SIZE,
        le=LARGEST_SIZE,
    )
    uniformity: float | None = setting(None, "-", "d60/d10 by mass; None: 1.4", ge=1, le=3)
    elongation: float | None = setting(
        None, "-", "mean of W/L of random grains; None: 0.75", ge=0.3, le=1
    )
    flatness: float | None = setting(
        None, "-", "mean of T/W of random grains; None: 0.8", ge=0.3, le=1
    )
    form_spread: float | None = setting(
        None, "-", "standard deviation of both; None: 0.08", ge=0, le=0.2
    )
    roughness: float | None = setting(
        None, "-", "root mean square of ln(radius) over degrees >= 3; None: 0.06", ge=0, le=0.2
    )
    falloff: float | None = setting(None, "-", "exponent of that spectrum; None: 1.7", ge=0.5, le=5)
    scale: float | None = setting(
        None, "m", "length of a unit of foreign surfaces; None: 1 m", gt=0
    )
    element_size: float | None = setting(
        None,
        "m",
        "wanted length of edges; None: meshes as given, or a tenth of the mean diameter",
        gt=0,
    )
    contact_size: float | None = setting(
        None, "m", "the same at contacts, coarser away from them; None: alike everywhere", gt=0
    )
    points: int = setting(
        400, "", "points of the surface of a grain that may touch others", ge=50, le=5000
    )
    voxel_size: float | None = setting(
        None, "m", "edge of the voxels of labels; None: no labels are written", gt=0
    )
    cut: float = setting(
        0.0,
        "-",
        "how far from walls labels begin, in mean diameters: a sample cut out",
        ge=0,
        le=10,
    )
    seed: int = setting(1, "", "of the random numbers", ge=0)

    def __post_init__(self):
        check_keys(self)
        for name in ("box", "cylinder"):
            lengths = getattr(self, name)
            good = lengths is None or min(lengths) > 0
            require(good, name, lengths and lengths_text(lengths), "lengths > 0")
        if self.box is not None and self.cylinder is not None:
            box, cylinder = lengths_text(self.box), lengths_text(self.cylinder)
            raise InputError(f"cylinder = {cylinder} beside box = {box}, expected one of them")
        for name, expected in (
            ("void_ratio", 'none with way = "gravity", where friction alone decides'),
            ("stress", 'none with way = "gravity", which makes a heap'),
        ):
            value = getattr(self, name)
            require(self.way != GRAVITY or value is None, name, value, expected)
        require(
            not self.cut or self.voxel_size is not None, "cut", self.cut, "voxel_size beside it"
        )
        require(self.k0 is None or self.stress is not None, "k0", self.k0, "stress beside it")

    @property
    def first_friction(self):
        """Coefficient of friction at the start."""
        if self.friction is not None:
            return self.friction
        return FRICTION if self.void_ratio is None else FIRST_FRICTION

    @property
    def stresses(self):
        """Along x, y and z at the end [Pa]; where a stress is asked for."""
        side = self.stress * (1.0 if self.k0 is None else self.k0)
        return side, side, self.stress

    @property
    def edges(self):
        """Edges of the box around the container [m], shape (3,), or None."""
        if self.cylinder is not None:
            return self.cylinder[0], self.cylinder[0], self.cylinder[1]
        return self.box

    @property
    def container(self):
        """Name and lengths [m] of the container that is asked for, or None."""
        name = "box" if self.cylinder is None else "cylinder"
        return (name, getattr(self, name)) if self.edges is not None else None

    def size_taken(self, edges):
        """What became of the container that was asked for, in words, or None without one.

        Args:
            edges: Of the box around the container of the packing [m], shape (3,).
        """
        if self.container is None:
            return None
        name, asked = self.container
        taken = lengths_text(edges if name == "box" else edges[1:])
        kept = "its base" if self.way == GRAVITY else "about its proportions"
        return f"{taken} for {name} = {lengths_text(asked)}: {self.way} keeps {kept}, no more"

    def refuse(self, names, source):
        """Raise InputError where one of some settings is given, which grains of a source lack.

        Args:
            names: Of the settings.
            source: What the grains are, for the message.
        """
        for name in names:
            value = getattr(self, name)
            if value is not None:
                raise InputError(f"{name} = {value} beside {source}, expected neither or one")

    def check_sizes(self, num_grains, diameter):
        """Raise InputError where elements or voxels do not suit grains of a mean diameter [m]."""
        size, fine, voxel = self.element_size, self.contact_size, self.voxel_size
        low, high = LEAST_ELEMENT * diameter, LARGEST_ELEMENT * diameter
        expected = f"{low:.3g} to {high:.3g} m for grains of {diameter:.3g} m"
        require(size is None or low <= size <= high, "element_size", size, expected)
        high = size or high
        expected = f"{low:.3g} to {high:.3g} m: no more than element_size"
        require(fine is None or low <= fine <= high, "contact_size", fine, expected)
        low = diameter * (num_grains / MOST_VOXELS) ** (1 / 3)
        expected = f"{low:.3g} to {high:.3g} m for grains of {diameter:.3g} m"
        require(voxel is None or low <= voxel <= high, "voxel_size", voxel, expected)
