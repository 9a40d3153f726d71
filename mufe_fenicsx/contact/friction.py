"""Coefficients of friction between grains: one for all, or by the materials of both."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..arguments import finite_number
from ..errors import InputError
from .laws import kinetic_of


@dataclass(frozen=True)
class FrictionTable:
    """Coefficients of friction between grains, as the kernels read them."""

    coefficients: np.ndarray  #: static and kinetic, of no pair of materials and of each, (n, 2)
    rows: Callable  #: rows there of pairs of grains, as :meth:`PairFriction.rows`


class PairFriction:
    """Coefficients of friction by the materials of both grains.

    Args:
        friction: Coefficient between materials that no pair names [-].
        materials: Name of the material of each grain, of all ranks, in the order of the mesh's
            labels, shape (num_grains,).
        pairs: (name, name), in either order -> coefficient, or (static, kinetic) ones [-].

    Raises:
        InputError: A pair of a material that no grain has, or that is there twice; a coefficient
            that cannot be.
    """

    def __init__(self, friction, materials=(), pairs=None):
        self.friction, pairs = finite_number("friction", friction, ge=0), pairs or {}
        names = list(dict.fromkeys(materials))
        number = {name: n for n, name in enumerate(names)}
        self._material = np.array([number[name] for name in materials], dtype=np.int32)
        self._row = np.zeros((len(names), len(names)), dtype=np.int32)
        self._others = []
        for pair, given in pairs.items():
            for name in pair:
                if name not in number:
                    raise InputError(
                        f"friction of {'-'.join(map(str, pair))} = {given}, expected materials of "
                        f"grains: {', '.join(map(str, names))}"
                    )
            a, b = (number[name] for name in pair)
            where = f"of {names[a]}-{names[b]}"
            static, kinetic = given if isinstance(given, tuple) else (given, None)
            if self._row[a, b]:
                raise InputError(f"friction {where} = {static}, expected one entry for a pair")
            self._others.append((static, kinetic_of(static, kinetic, where)))
            self._row[a, b] = self._row[b, a] = len(self._others)

    def with_others(self, num_grains, own):
        """The same with further bodies after the grains, whose friction is their own with all.

        Args:
            num_grains: Number of grains of all ranks.
            own: Static and kinetic coefficient of each of these bodies, None: as the static one.
        """
        whole, n = PairFriction(self.friction), max(len(self._row), 1)
        material = self._material if self._others else np.zeros(num_grains, dtype=np.int32)
        rows = np.zeros((n + len(own), n + len(own)), dtype=np.int32)
        rows[: len(self._row), : len(self._row)] = self._row
        whole._others = list(self._others)
        for k, (static, kinetic) in enumerate(own, start=n):
            whole._others.append((static, kinetic_of(static, kinetic, "of a tool")))
            rows[k, :n] = rows[:n, k] = len(whole._others)
        whole._row = rows
        whole._material = np.append(material, np.arange(n, n + len(own), dtype=np.int32))
        return whole

    def table(self, friction_kinetic, num_grains):
        """:class:`FrictionTable` with 1 + num_pairs rows, first those of no pair.

        Args:
            friction_kinetic: Coefficient while a contact of no pair slips; ``friction`` if None.
            num_grains: Number of grains of all ranks.

        Raises:
            InputError: There are materials of other grains.
        """
        if self._others and self._material.size != num_grains:
            raise InputError(
                f"materials = {self._material.size}, expected one a grain, {num_grains}"
            )
        kinetic = kinetic_of(self.friction, friction_kinetic, "between grains")
        return FrictionTable(np.array([(self.friction, kinetic), *self._others]), self.rows)

    def static(self, grain, partner):
        """Coefficient that a contact of two grains has to overcome to slip [-]."""
        row = self._row[self._material[grain], self._material[partner]] if self._others else 0
        return (self.friction, *(static for static, _ in self._others))[row]

    def rows(self, grain, partner):
        """Rows of the table of pairs of grains, int32; of size 0 where all have the first one.

        Args:
            grain, partner: Global indices of the grains, shape (num_contacts,).
        """
        if not self._others:
            return np.empty(0, dtype=np.int32)
        return self._row[self._material[grain], self._material[partner]]
