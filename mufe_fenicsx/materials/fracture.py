"""How grains break: strength and fracture energy of facets between their cells."""

from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..units import REQUIRED, check_keys, setting

#: Edges that a cohesive zone wants: with 5 and 3 the energy of a crack in a strip of 40 is 7 and
#: above 74 % too high (`mufe verify cracked-strip --set zone=…`).
IN_ZONE = 5.0


@dataclass(frozen=True)
class Fracture:
    """[fracture]: grains break along facets between their cells."""

    strength: float = setting(
        REQUIRED, "Pa", "tensile strength of a facet", gt=0, plausible=(1e3, 1e12)
    )
    energy: float = setting(
        REQUIRED, "J/m^2", "to open a crack, over its area", gt=0, plausible=(1e-6, 1e8)
    )
    shear_ratio: float = setting(
        2.0, "-", "shear strength over tensile strength", gt=0, plausible=(0.1, 100.0)
    )
    friction: float | None = setting(
        None, "-", "of a facet that is pressed, before and after it breaks; None: that of contact",
        ge=0, plausible=(0, 2),
    )  # fmt: skip
    modulus: float | None = setting(
        None, "-", "Weibull modulus of the strengths of facets or grains; None: all alike", gt=1
    )
    reference_volume: float | None = setting(
        None, "m^3", "that has the strength with modulus; None: of each facet or grain", gt=0
    )
    scatter: str = setting(
        "facet", "", "what has a strength of its own with modulus", allowed=("facet", "grain")
    )
    seed: int = setting(0, "", "of the random strengths", ge=0, plausible=(0, 2**63 - 1))
    lower_strength: bool = setting(
        False, "", "where the mesh is too coarse for the energy, lower the strength to keep it"
    )
    damping: float = setting(
        0.07, "-", "of what softens, over the critical one; less than 0.05 can gain energy",
        ge=0, lt=0.15,
    )  # fmt: skip
    dust: int = setting(
        0, "tetrahedra", "fragments of so many at most go on as rigid bodies; 0: none do", ge=0
    )

    def __post_init__(self):
        check_keys(self)
        if self.reference_volume is not None and self.modulus is None:
            raise InputError(
                f"reference_volume = {self.reference_volume:g}, expected none without modulus"
            )

    def zone(self, E, strength=None):
        """Length of the cohesive zone in a material of Young's modulus E [m]: E G_c/σ².

        ``strength``: σ [Pa]; None: that of the table.
        """
        return E * self.energy / (self.strength if strength is None else strength) ** 2

    def typical_strength(self, volume: float) -> float:
        """Geometric mean of strengths drawn for a volume V [Pa]: σ (V₀/V)^(1/m) e^(-γ/m)."""
        if self.modulus is None:
            return self.strength
        share = volume / (self.reference_volume or volume)
        return self.strength * (share * np.exp(np.euler_gamma)) ** (-1.0 / self.modulus)

    def strengths(self, names: np.ndarray, volume: np.ndarray, edge, E) -> np.ndarray:
        """Strengths of facets [Pa], shape (num_facets,).

        By Weibull's law what has the volume V fails below s with the probability
        1 - exp(-V/V₀ (s/σ)^m). They hang on the seed and the names alone. Where the mesh is
        lowered for, none exceeds √(E G_c/(5 h)) (Z. P. Bažant, B. H. Oh, Mater. Struct. 16, 1983).

        Args:
            names: Whole numbers that name the facets, or their grains alike, (num_facets, n).
            volume: V, of these [m³], shape (num_facets,).
            edge: Of facets [m], shape (num_facets,).
            E: Young's moduli [Pa], shape (num_facets,).
        """
        found = np.full(len(names), self.strength)
        if self.modulus is not None:
            share = 1.0
            if self.reference_volume is not None:
                share = volume / self.reference_volume
            found *= (-np.log(uniform(self.seed, names)) / share) ** (1.0 / self.modulus)
        if self.lower_strength:
            np.minimum(found, np.sqrt(E * self.energy / (IN_ZONE * edge)), out=found)
        return found


def uniform(seed: int, names: np.ndarray) -> np.ndarray:
    """A random number in (0, 1) of each row of whole numbers, by itself alone, shape (n,).

    Source: G. L. Steele, D. Lea, C. H. Flood, OOPSLA 2014 (SplitMix64), a round for the seed and
    for each column.
    """
    with np.errstate(over="ignore"):
        z = np.zeros(len(names), np.uint64)
        for column in (np.full(len(names), seed, np.uint64), *np.asarray(names, np.uint64).T):
            z = (z ^ column) + np.uint64(0x9E3779B97F4A7C15)
            z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
            z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
            z = z ^ (z >> np.uint64(31))
    return ((z >> np.uint64(11)).astype(float) + 0.5) * 2.0**-53
