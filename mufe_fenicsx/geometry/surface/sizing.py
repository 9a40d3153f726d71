"""What is wanted of the length of edges: even, or from neighbours."""

from dataclasses import dataclass, replace

#: Nodes that the surface of a grain takes at least.
FEWEST_NODES = 20

UNIFORM, CONTACT = "uniform", "contact"


@dataclass(frozen=True)
class Sizing:
    """How long edges are to be; lengths in metres."""

    mode: str
    largest: float
    smallest: float
    reach: float  #: gaps up to this get the smallest size
    growth: float  #: of the size over distance along the surface, or over the gap
    nodes: int | None = None  #: that the surface of each grain takes

    def times(self, factor):
        """The same with all sizes multiplied by a factor."""
        return replace(self, largest=self.largest * factor, smallest=self.smallest * factor)

    def scaled(self, factor):
        """The same in another unit of length."""
        return replace(self.times(factor), reach=self.reach * factor)
