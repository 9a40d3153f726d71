"""What pairs of contact keep, declared once: the structs of C, views of arrays, and checkpoints."""

from dataclasses import dataclass

import numpy as np

from .rows import aligned

#: Types of the fields: of NumPy, and of C for one number and for three.
REAL, SINGLE, INTEGER = np.dtype(np.float64), np.dtype(np.float32), np.dtype(np.int32)
SHORT, FLAG, BYTE = np.dtype(np.uint16), np.dtype(np.bool_), np.dtype(np.uint8)
_OF_C = {
    REAL: "double", SINGLE: "float", INTEGER: "int32_t", SHORT: "uint16_t", FLAG: "uint8_t",
    BYTE: "uint8_t",
}  # fmt: skip
#: Whether a search hands a field on to the pair's successor, and a checkpoint keeps it.
KEPT = True
LINE = 64  # bytes of a cache line


@dataclass(frozen=True)
class Field:
    """One number of a row, or several of one type.

    Args:
        name: In C and in Python.
        type: One of the types above.
        number: How many.
        kept: Whether the history of the pair is in it.
    """

    name: str
    type: np.dtype
    number: int = 1
    kept: bool = False

    def in_c(self):
        """Its line in a struct of C."""
        if self.type == REAL and self.number == 3:
            return f"  vec3 {self.name};"
        array = f"[{self.number}]" if self.number > 1 else ""
        return f"  {_OF_C[self.type]} {self.name}{array};"


class Row:
    """A row of fields without gaps between them, filled up to whole cache lines.

    Args:
        name: Of the struct in C.
        *fields: Arguments of :class:`Field`, in their order there.
    """

    def __init__(self, name, *fields):
        self.name, self.fields = name, tuple(Field(*field) for field in fields)
        rest = -sum(f.number * f.type.itemsize for f in self.fields) % LINE
        if rest:
            self.fields += (Field("filling", BYTE, rest),)
        shapes = [((f.number,) if f.number > 1 else ()) for f in self.fields]
        self.dtype = np.dtype(
            [(f.name, f.type, shape) for f, shape in zip(self.fields, shapes, strict=True)]
        )
        #: What a checkpoint keeps of each pair, and a search hands on.
        self.kept = tuple(f.name for f in self.fields if f.kept)

    def in_c(self):
        """The struct of C."""
        lines = "\n".join(f.in_c() for f in self.fields)
        size = f"_Static_assert(sizeof({self.name}) == {self.dtype.itemsize}, "
        return f'typedef struct {{\n{lines}\n}} {self.name};\n{size}"no gaps");\n'

    def rows(self, number):
        """So many rows, all zero, the first at the start of a cache line; (number, numbers)."""
        numbers = self.dtype.itemsize // REAL.itemsize
        return aligned(number * numbers).reshape(number, numbers)

    def view(self, rows, name):
        """What the rows keep under a name, shape (number,) or (number, numbers)."""
        return rows.view(self.dtype)[name][:, 0]


#: A pair of a point and another grain. The nodes around a point in a facet, or thrice the node, are
#: its ``corner``, with the weights number ``rule``; ``vertices``, ``bulge``, ``sharp`` are those of
#: the facet that was closest last, where that is ``known``.
PAIR = Row(
    "pair_row",
    ("other_next_check", REAL, 1, KEPT),  # least ``candidate_next_check`` of the other candidates
    ("node", INTEGER),
    ("closed", FLAG, 1, KEPT),
    ("sliding", FLAG, 1, KEPT),
    ("sharp", FLAG),
    ("known", FLAG, 1, KEPT),
    ("vertices", INTEGER, 3),
    ("corner", INTEGER, 3),
    ("bound_row", INTEGER),  # which one of ``bounds`` is that of both grains
    ("friction", INTEGER),  # of the pair of materials, where there are some
    ("offset", REAL, 1, KEPT),
    ("recess", REAL, 1, KEPT),  # of a vertex, less the height at a tool, and the dent
    ("stiffness", REAL, 1, KEPT),
    ("largest_depth", REAL, 1, KEPT),
    ("ratio", REAL),
    ("area", SINGLE),
    ("stands", SINGLE),  # of the point over its facet
    ("bulge", SINGLE, 6),  # q_ab q_bc q_ca, o_a o_b o_c of surface/bulges.py
    ("softer", SINGLE, 1, KEPT),  # m of the law
    ("yield_depth", SINGLE, 1, KEPT),  # from which on a dent deepens, none: infinity
    ("gap", REAL, 1, KEPT),
    ("normal_force", REAL, 1, KEPT),
    ("slip", REAL, 1, KEPT),
    ("work", REAL, 1, KEPT),
    ("stick_point", REAL, 3, KEPT),
    ("height", REAL, 1, KEPT),  # of the point over the facet, along ``facing``
    ("shear", REAL, 3, KEPT),
    ("rule", BYTE),
    ("within", FLAG),  # of two pieces of one grain
    ("num_around", SHORT),  # nodes around a point that is a node, listed from ``around`` on
    ("around", INTEGER),
    ("facing", REAL, 3, KEPT),  # normal from facet to point; ``normal`` is of the smooth surface
    ("unused_1", REAL),  # vectors of three are written as four
    ("weights", REAL, 3, KEPT),
    ("unused_2", REAL),
    ("normal", REAL, 3, KEPT),
    ("unused_3", REAL),
)
#: A pair of a point and a wall; the stick point is relative to ``point`` of the wall. The first
#: corner has a weight of its own, the others share the rest.
WALL_PAIR = Row(
    "wall_pair_row",
    ("corner", INTEGER, 3),
    ("closed", FLAG, 1, KEPT),
    ("sliding", FLAG, 1, KEPT),
    ("wall", SHORT),  # and above it the weight's place in LEAD
    ("recess", REAL, 1, KEPT),  # of the point, and the dent
    ("ratio", REAL),
    ("offset", REAL, 1, KEPT),
    ("stiffness", REAL),
    ("gap", REAL, 1, KEPT),
    ("softer", SINGLE),  # m of the law
    ("yield_depth", SINGLE, 1, KEPT),
    ("stick_point", REAL, 3, KEPT),
    ("slip", REAL, 1, KEPT),
    ("shear", REAL, 3, KEPT),
    ("work", REAL, 1, KEPT),
)
#: A pair of sharp edges; of its two numbers each the first is of the first edge.
EDGE_PAIR = Row(
    "edge_pair_row",
    ("first", INTEGER),
    ("second", INTEGER),
    ("friction", INTEGER),  # of the pair of materials, 0 where all have the first one
    ("closed", FLAG, 1, KEPT),
    ("sliding", FLAG, 1, KEPT),  # it slipped in the last step
    ("unused_1", SHORT),
    ("outside", REAL, 1, KEPT),  # of both edges or their facets' normals; 2: edges end before
    ("gap", REAL, 1, KEPT),
    ("offset", REAL, 1, KEPT),  # <= 0
    ("recess", REAL, 1, KEPT),  # depth at which the contact of edges begins
    ("size", REAL),  # mean edge of both sides
    ("largest_depth", REAL),  # beyond which the force does not grow
    ("place", REAL, 2, KEPT),  # s and t of the crossing
    ("stick_point", REAL, 2, KEPT),
    ("normal", REAL, 3, KEPT),  # from the second to the first edge
    ("stiffness", REAL, 1, KEPT),
    ("shear", REAL, 3, KEPT),  # friction on the first edge
    ("slip", REAL, 1, KEPT),  # since the last search, as the work
    ("work", REAL, 1, KEPT),
    ("ratio", REAL),
    ("stored", REAL, 1, KEPT),  # energy at the end of the last step
    ("unused_2", REAL),
)
#: What a pair needs where a body yields beneath it.
DENT = Row(
    "dent_row",
    ("dent", REAL, 1, KEPT),  # its depth, which adds to the recess
    ("edge", REAL, 1, KEPT),  # mean one of both sides
    ("layers", REAL, 1, KEPT),  # compliance of both
    ("bend", REAL, 1, KEPT),  # mean curvature of the gap
    ("reference", REAL, 1, KEPT),  # area around the point that the stiffness is of; 0: of a vertex
    ("own", INTEGER),  # where the tables of both bodies begin, -1 without one
    ("other", INTEGER),
    ("cell", INTEGER),  # beneath the point
    ("point", INTEGER),
    ("partner", INTEGER),  # the other grain, -1 a wall
    ("slope_left", SINGLE, 1, KEPT),  # part of the law's slope while the dent deepens, for tangents
)
#: What points keep of dents when their pairs go, for whoever comes next: a type of NumPy and of C.
POINT_DENT = np.dtype([("dent", REAL), ("beyond", REAL), ("met", INTEGER), ("unused", INTEGER)])

#: Structs of C, which pairs, walls and edges include.
HEADER = "#include <stdint.h>\n\n" + "\n".join(
    (
        *(row.in_c() for row in (PAIR, WALL_PAIR, EDGE_PAIR, DENT)),
        "typedef struct {\n  double dent, beyond;\n  int32_t met, unused;\n} point_dent_row;\n",
    )
)
