"""Runs of a pressed grain with its own mesh, one material after the other, until they settle.

Each round corrects the ball by all runs so far (:mod:`~.own_mesh`), fits the curves with it, and
runs the grain with what was found. The first run has the material of the scene. Runs stay in the
folder of the results; a run that is there is not made again.
"""

import math
import shutil
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..errors import InputError, SolverError
from ..geometry.grains import load_grains
from ..machine.files import write_atomically
from ..materials.elastic import Elastic
from ..materials.j2 import J2
from ..output.checkpoint import file_checksum
from ..planning.sweep.plan import Sweep
from ..planning.sweep.runs import Runner, folder_of, is_finished
from ..run.resume_check import file_of_grains
from ..scene import Scene, load_scene, scene_to_toml
from ..units import with_unit
from . import ball
from .data import TOUCHED, Size, within_table
from .fit import MATERIAL, WIDE, simplest
from .own_mesh import FAR, as_grain, linear, place, shape_of_runs
from .sentences import WORDS

#: Folder of the runs within that of the results, and the scene in it.
FOLDER, SCENE = "grain", "scene.toml"
#: Runs of a calibration at most.
MOST = 8
#: Part by which the diameter of a table may be off that of the mesh without a word.
SAME = 0.02
#: Settled is what lies off a run by this part of half its interval.
PART = 0.2
#: Way of a run over that of the curves; farthest step to a material without a run, in logarithms.
MARGIN, STEP = 1.1, 1.2
#: Yield stress and slope of hardening of a run over its modulus, at least.
LEAST = 1e-6
#: What follows where runs are interrupted.
GO_ON = "; the same command goes on with its runs"


@dataclass(frozen=True)
class Grain:
    """A scene that presses one grain between platens, and the size of its mesh."""

    scene: Scene
    diameter: float  #: of the ball of the same volume [m]
    height: float  #: [m]

    @property
    def size(self):
        """Of grains whose table has none: that of the mesh."""
        return Size(*[self.diameter] * 3)

    def sized(self, data):
        """The data with the size of this grain; notes say where a table has another one."""
        others = [curve for curve in data.curves
                  if abs(curve.size.diameter / self.diameter - 1) > SAME]  # fmt: skip
        notes = [
            f"diameter of curve {curve.name} = {with_unit(curve.size.diameter, 'm')} is not used: "
            f"a ball as large as the grain of the scene has {with_unit(self.diameter, 'm')}"
            for curve in others
        ]
        curves = [replace(curve, size=self.size) for curve in data.curves]
        return replace(data, curves=curves, notes=[*data.notes, *notes])

    def to(self, way):
        """The scene with a strain at which each contact has gone so far. Local.

        Args:
            way: Approach over the radius.
        """
        strain = MARGIN * way * self.diameter / self.height
        scene, test = self.scene, self.scene.oedometer
        E, Y, H = _values(scene.material)
        table = ((0.0, Y), (1.0, Y + H))
        scene = replace(scene, material=J2(E, scene.material.nu, scene.material.rho, table))
        if test is not None:
            return replace(scene, oedometer=replace(test, strain=max(strain, test.ramp)))
        last = _press_stage(scene.stages)
        z = replace(scene.stages[last].z, strain=strain)
        return replace(scene, stages=(*scene.stages[:last], replace(scene.stages[last], z=z)))


def read_grain(path):
    """:class:`Grain` of a scene file. Local.

    Raises:
        InputError: It presses no single grain between two platens, or the grain cannot be of any
            modulus and yield stress.
    """
    path = Path(path)
    scene = load_scene(path)
    if not isinstance(scene.material, J2 | Elastic):
        model = type(scene.material).__name__.lower()
        raise InputError(f'{path}: material.model = "{model}", expected "elastic" or "j2"')
    for name, given in (
        ("[materials]", scene.materials), ("[material.scatter]", scene.scatter),
        ("[fracture]", scene.fracture), ("[membrane]", scene.membrane), ("[[tool]]", scene.tools),
    ):  # fmt: skip
        if given:
            raise InputError(f"{path}: {name} is given, expected one material between platens")
    for name in ("z_min", "z_max"):
        if scene.walls[name].mirror:
            raise InputError(f"{path}: walls.{name}.mirror = true, expected a platen")
    if scene.oedometer is None and _press_stage(scene.stages) is None:
        raise InputError(f"{path}: no stage leads z to a strain > 0, expected one that presses")
    if scene.sample.grains is None:
        raise InputError(f"{path}: sample.grains is missing, expected the folder of one grain")
    grains = load_grains(scene.sample.grains)
    if len(grains.labels) != 1:
        raise InputError(f"{path}: {len(grains.labels)} grains, expected one between platens")
    diameter = float(np.cbrt(6 / np.pi * grains.volumes.sum()))
    return Grain(scene, diameter, float(np.ptp(grains.points[:, 2])))


def _press_stage(stages):
    """Number of the first stage that presses after strains begin to count; None without one."""
    first = max((i + 1 for i, stage in enumerate(stages) if stage.zero), default=0)
    pressing = (i for i, stage in enumerate(stages[first:], first)
                if stage.z is not None and (stage.z.strain or 0.0) > 0.0)  # fmt: skip
    return next(pressing, None)


def begun(folder):
    """Whether a folder of runs is there, with nothing beside it. Local."""
    folder = Path(folder)
    return (folder / SCENE).is_file() and len(list(folder.parent.iterdir())) == 1


class Rounds:
    """The rounds of a calibration.

    Args:
        data: :class:`~.data.Data`.
        options: :class:`~.calibrate.Options` with a grain.
        folder: Of the runs.
        say: Called with a line.

    Raises:
        InputError: There is no curve of a pressed grain.
    """

    def __init__(self, data, options, folder, say):
        if not data.curves:
            raise InputError("no curve of a pressed grain, expected one with --scene")
        self.data, self.options, self.folder = data, options, Path(folder)
        self.scene, self.say = options.grain.to(self._way()), say
        mesh = file_checksum(file_of_grains(self.scene.sample.grains))
        self.text = f"# grains: {mesh}\n{scene_to_toml(self.scene)}"

    def _way(self):
        """Approach of each contact over the radius that the curves reach."""
        setup, given = self.options.setup, self.options.given
        machine, most = given.known_compliance, 0.0
        for curve in self._known(setup).curves:
            x, force = curve.displacement, curve.force
            touched = given.offset
            if touched is None:
                touched = x[force > TOUCHED * force.max()].min()
            way = x.max() - touched - machine * force.max()
            most = max(most, 2 * way / (setup.contacts * curve.size.diameter))
        return min(most, float(ball.load().delta[-1]) / MARGIN)

    def _known(self, setup):
        """Curves without what the model does not know."""
        data, given = replace(self.data, notes=[]), self.options.given
        if setup.shape is not None:
            data = as_grain(data, setup.shape)
        return within_table(data, setup, given.offset, given.known_compliance)

    def check(self, overwrite):
        """See that runs in the folder, if any, are of this scene; else remove them.

        Raises:
            InputError: They are of another one, and ``overwrite`` is false.
        """
        if not self.folder.exists():
            return
        kept = self.folder / SCENE
        if kept.is_file() and kept.read_text(encoding="utf-8") == self.text:
            return
        if not overwrite:
            raise InputError(
                f"{self.folder} has runs of another scene or to another strain, expected those of "
                "this one; --overwrite makes them again"
            )
        shutil.rmtree(self.folder)

    def settle(self):
        """Run and fit until the material is that of a run; setup and a sentence, or None.

        Raises:
            SolverError: A run failed.
            Interrupted: A signal came.
        """
        self.folder.mkdir(parents=True, exist_ok=True)
        write_atomically(self.folder / SCENE, self.text)
        found = self._finished() or self._run([], _values(self.scene.material))
        while True:
            shape = shape_of_runs([folder_of(self.folder, name) for name in self._names(found)])
            setup = replace(self.options.setup, shape=shape)
            fit, given = simplest(self._known(setup).curves, setup, self.options.given)
            told = "E, yield stress, hardening " + ", ".join(
                with_unit(fit.material[name], "Pa") for name in MATERIAL
            )
            if given.elastic:
                told = f"elastic, E {with_unit(fit.material['E'], 'Pa')}"
            material = to_run(fit.material, given.elastic, setup)
            name, off = _farthest(fit, material, found)
            # Where intervals are wide: a run has to have nearly this material, too.
            apart = min(_apart(material, found, setup.nu))
            off = max(off, PART * apart / FAR)
            self.say(f"round {len(found)}: {told}; "
                     f"{off:.2g} of half an interval from a run")  # fmt: skip
            if off < PART:
                return setup, None
            if len(found) >= MOST:
                return setup, (
                    f"{MOST} runs, and {WORDS[name]} is still {off:.2g} of half its interval from "
                    f"that of any: expected {PART:g}."
                )
            found = self._run(found, _nearer(material, found, setup.nu))

    def _names(self, found):
        return Sweep(self.folder / SCENE, [{}] * len(found), None, None).names

    def _finished(self):
        """Materials of the runs that are finished, in their order."""
        found = []
        while is_finished(folder := folder_of(self.folder, self._names([*found, None])[-1])):
            found.append(_values(load_scene(folder / SCENE).material))
        return found

    def _run(self, found, material):
        """Run one more material; all materials of runs."""
        found = [*found, tuple(float(f"{value:.5g}") for value in material)]
        rows = [
            {"material.E": repr(E), "material.yield_stress": f"[[0.0, {Y!r}], [1.0, {Y + H!r}]]"}
            for E, Y, H in found
        ]
        sweep = Sweep(self.folder / SCENE, rows, None, None)
        runner = Runner(sweep, self.folder, [None] * len(rows), 1, self.say, GO_ON)  # one grain
        runner.run_all(1)
        for why in runner.failed.values():
            raise SolverError(f"run {sweep.names[-1]} in {self.folder / 'runs'} failed: {why}")
        return found


def to_run(material, elastic, setup):
    """E, yield stress and slope of hardening of a run for what was found [Pa].

    Walls of a run are rigid: its grain gives way as grain and platen do together. Of an elastic one
    Y = H = E; no other may yield beyond E.

    Args:
        material: Of a fit, by name [Pa].
        elastic: Whether it does not yield.
        setup: :class:`~.model.Setup`.
    """
    E, Y, H = (material[name] for name in MATERIAL)
    E = setup.modulus(E) * (1 - setup.nu**2)
    return (E, E, E) if elastic else (E, min(Y, E), H)


def _values(material):
    """E, yield stress and slope of hardening [Pa]; of elastic grains Y = H = E."""
    return (material.E, *(max(float(value), LEAST * material.E) for value in linear(material)))


def _farthest(fit, material, found):
    """The parameter that lies farthest from the nearest run, over half its interval."""
    half = np.array([
        fit.half_width(name) if name in fit.names and name not in fit.held else WIDE
        for name in MATERIAL
    ])  # fmt: skip
    off = np.abs(np.log(found) - np.log(material)) / half
    nearest = off[np.argmin(off.max(axis=1))]
    return MATERIAL[int(np.argmax(nearest))], float(nearest.max())


def _apart(material, found, nu):
    """How far a material is from that of each run, as of :func:`~.own_mesh.place`."""

    def at(values):
        E, Y, H = values
        return place(Y * (1 - nu**2) / E, H / Y)

    return [float(np.linalg.norm(at(material) - at(run))) for run in found]


def _nearer(material, found, nu):
    """The material, or one on the way to it from the nearest run where that is far."""
    apart = _apart(material, found, nu)
    nearest = int(np.argmin(apart))
    part = min(1.0, STEP / max(apart[nearest], 1e-9))
    start, end = np.log(found[nearest]), np.log(material)
    return tuple(math.exp(value) for value in start + part * (end - start))
