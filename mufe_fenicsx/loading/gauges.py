"""What the walls of a container tell of the sample: stresses, strains and the pressure of pores.

Stresses are forces over the present areas of the walls; strains are 1 - L/L0, L0 the length at the
end of the last stage with ``zero``, or at the start. Compression is positive. The stresses are
those of the grains: in saturated sand the effective ones.

In undrained stages water would carry what the grains lack of a total side stress that is constant,

    u = σside(start) - σside,

the side being the axes that keep the volume. It goes on through undrained stages one after another.
"""

import math

import numpy as np

from ..state import Stateful


class WallMeans(Stateful):
    """Mean stress of each wall over the time that a wave travels, exponentially weighted.

    Args:
        stress: At the start, of each wall [Pa].
        at: Time of that [s].
    """

    STATE = {"common": ("stress", "at")}

    def __init__(self, stress, at):
        self.stress, self.at = stress, at

    def add(self, stress, t, travel_time):
        """Take the stresses at the time ``t`` [s] into the means. Twice gives the same as once."""
        elapsed, self.at = t - self.at, t
        if elapsed > 0.0:  # not twice in the same state
            weight = 1.0 - math.exp(-elapsed / travel_time) if travel_time > 0.0 else 1.0
            mean = np.asarray(self.stress)
            self.stress = (mean + weight * (stress - mean)).tolist()


class Gauges(Stateful):
    """Lengths, stresses and strains along the axes of a container. Collective, the same on all.

    Args:
        measures: :class:`~.measures.WallMeasures` of what surrounds the sample.
        shearing: What moves walls along themselves, :class:`~.shearing.Unsheared`.
    """

    STATE = {"common": ("reference", "total", "sides")}

    def __init__(self, measures, shearing):
        self.measures, self.container, self.shearing = measures, measures.container, shearing
        self._read = -1, None  # number of steps, and the lengths then
        self.reference = self.lengths.tolist()  #: lengths at strain 0 [m]
        self.means = WallMeans([0.0] * len(self.container.walls), measures.simulation.state.t)
        self.total = None  #: total side stress of undrained stages [Pa]; None: drained
        self.sides = []  #: axes that are the side then
        self.supported = measures.has_support()  #: walls that may differ from those across

    @property
    def columns(self):
        """Of history.csv beyond the usual ones."""
        others = *self.shearing.columns, *self.measures.columns
        return (*self._of_axes, "pore_pressure", *others)

    @property
    def _of_axes(self):
        letters = (*self.container.axes, *self.container.across)
        return (*(f"stress_{a}" for a in letters), *(f"strain_{a}" for a in letters))

    @property
    def lengths(self):
        """Lengths between the walls along the axes [m], shape (num_axes,): read once a step."""
        now = self.measures.simulation.state.num_steps
        if self._read[0] != now:
            self._read = now, self.measures.lengths()
        return self._read[1]

    @property
    def places(self):
        """How far in planes stand, from the origin [m], shape (num_walls,)."""
        return self.measures.places()

    @property
    def strains(self):
        """Along the axes, shape (num_axes,)."""
        return 1.0 - self.lengths / self.reference

    def load_state_dict(self, kept):
        """Become what :meth:`state_dict` told; walls may stand elsewhere now."""
        super().load_state_dict(kept)
        self._read = -1, None

    def set_zero(self):
        """Count strains from here."""
        self.reference = self.lengths.tolist()

    def axis_stress(self, forces):
        """Mean stress of the walls of each axis [Pa], shape (num_axes,), of forces on walls [N]."""
        return self.container.stresses(self.shearing.across(forces), self.lengths)

    def wall_stress(self, forces):
        """Stress of each wall [Pa], shape (num_walls,), of forces on walls [N]."""
        across = np.asarray(self.shearing.across(forces))
        return across / self.container.areas_of_walls(self.lengths)

    def mean_stress(self):
        """That of the axes, mean over the time that a wave travels [Pa], shape (num_axes,)."""
        return self.container.of_axes(self.means.stress)

    def led(self, stress):
        """What servos take to its target, and ends of stages judge [Pa], shape (num_walls,).

        Where friction, a sleeve, weight or a tool carries what opposite walls differ by, that
        difference is left out, in its mean over the time that a wave travels: σ - (σ̄ - σ̄axis).

        Args:
            stress: Of each wall [Pa], such as the present one or its mean.
        """
        if not self.supported.any():
            return stress
        means = np.asarray(self.means.stress)
        apart = means - self.container.to_walls(self.mean_stress())
        return stress - np.where(self.supported, apart, 0.0)

    def pore_pressure(self, stress):
        """u [Pa] at stresses along the axes; 0 in drained stages."""
        return 0.0 if self.total is None else self.total - self._side(stress)

    def shut(self, sides, stress):
        """Let no water out from here on.

        Args:
            sides: Axes whose walls keep the volume; none: drained.
            stress: Along the axes [Pa].
        """
        pressure = self.pore_pressure(stress)
        self.sides, self.total = list(sides), None
        if self.sides:
            self.total = self._side(stress) + pressure

    def _side(self, stress):
        return float(np.mean([stress[a] for a in self.sides]))

    def values(self, stress, begun):
        """All that `until` can name, at stresses along the axes.

        Args:
            stress: [Pa], shape (num_axes,).
            begun: Time of the start of the stage [s].
        """
        container, lengths = self.container, self.lengths
        x, y, z = (float(value) for value in container.three_stresses(stress, lengths))
        volumes = container.volume([lengths, self.reference])
        square = 0.5 * ((x - y) ** 2 + (y - z) ** 2 + (z - x) ** 2)
        return {
            **dict(zip(self._of_axes, self._along_all(stress), strict=True)),
            **self.shearing.values(),
            "mean_stress": (x + y + z) / 3.0,
            "deviator": math.sqrt(square + 3.0 * self.shearing.stress**2),
            "q": z - 0.5 * (x + y),
            "pore_pressure": self.pore_pressure(stress),
            "strain_volume": float(1.0 - volumes[0] / volumes[1]),
            "time": self.measures.simulation.state.t - begun,
        }

    def row(self, forces):
        """Columns of history.csv, of forces on the walls [N]."""
        stress = self.axis_stress(forces)
        others = *self.shearing.row(), *self.measures.row()
        values = [*self._along_all(stress), self.pore_pressure(stress), *others]
        return dict(zip(self.columns, values, strict=True)) | {"stress": stress[-1]}

    def _along_all(self, stress):
        """Stresses, then strains, along the axes and the directions across the vertical one."""
        container, lengths, strains, found = self.container, self.lengths, self.strains, []
        num = len(container.across)
        for values, three in ((stress, container.three_stresses(stress, lengths)),
                              (strains, container.three_strains(strains, lengths))):  # fmt: skip
            found += [*values, *three[:num]]
        return [float(value) for value in found]
