"""Balls that fly against a plane or against each other, many impacts in one simulation."""

import math
from dataclasses import dataclass

import numpy as np

from ..contact.walls import Wall
from ..geometry.bodies.shapes import sphere_near_contact
from ..run.from_bodies import build


def odd_frame():
    """An orthonormal frame aligned with nothing; its rows are normal, tangent, across."""
    x, y, z = np.eye(3)
    return turn(x, 0.6) @ turn(y, 1.1) @ turn(z, 2.3)


def turn(axis, angle):
    """Matrix of the rotation about a unit vector (Rodrigues)."""
    K = np.cross(np.eye(3), -axis)
    return np.eye(3) + math.sin(angle) * K + (1 - math.cos(angle)) * K @ K


@dataclass(frozen=True)
class Impacts:
    """Impacts side by side, of a ball on the plane or of two balls on each other.

    The normal points from the plane to its balls. Of two balls each moves, opposite to the
    other, as a ball against the plane between them would.
    """

    radius: float  #: of all balls [m]
    contact_radius: float  #: largest radius of the contact [m]
    h_contact: float  #: length of edges there [m]
    speed: float  #: of the balls against the plane, along the normal [m/s]
    on_plane: tuple = ()  #: (velocity along the tangent, part of it by spin) of each ball
    on_ball: tuple = ()  #: the same of each pair of balls
    friction: float = 0.0
    growth: float = 0.3  #: of the element size with the distance
    h_max: float = 0.3  #: largest element size over the radius


@dataclass(frozen=True)
class RigidMotion:
    """Of each ball, from the momentum and angular momentum of its nodes."""

    mass: np.ndarray  #: [kg], shape (num_balls,)
    centre: np.ndarray  #: of mass [m], shape (num_balls, 3)
    velocity: np.ndarray  #: of that centre [m/s], shape (num_balls, 3)
    inertia: np.ndarray  #: about it [kg m²], shape (num_balls, 3, 3)
    spin: np.ndarray  #: rate of turning [1/s], shape (num_balls, 3)

    def kinetic(self):
        """Kinetic energy of the rigid motion [J], shape (num_balls,)."""
        turning = np.einsum("bi,bij,bj->b", self.spin, self.inertia, self.spin)
        return 0.5 * (self.mass * (self.velocity**2).sum(axis=1) + turning)


class Balls:
    """The simulation of :class:`Impacts` and the motion of its balls. Collective.

    Balls on the plane come first, then the pairs, ball after ball.

    Args:
        comm: MPI communicator with at most as many ranks as balls.
        impacts: :class:`Impacts`.
        material: Material of all balls.
        options: Of :class:`~mufe_fenicsx.explicit.simulation.Simulation`.
    """

    def __init__(self, comm, impacts, material, **options):
        self.comm, self.impacts = comm, impacts
        self.frame = odd_frame()
        normal, tangent, across = self.frame
        R = impacts.radius
        #: Distance of each ball from its plane at the start [m], as that of true spheres.
        self.gap = 1e-4 * impacts.contact_radius**2 / R

        upper, lower = self._mesh(1), self._mesh(-1) if impacts.on_ball else None
        bodies, centres, throw, rate = [], [], [], []
        starts = [(False, start) for start in impacts.on_plane]
        starts += [(True, start) for start in impacts.on_ball]
        for k, (pair, (velocity, spun)) in enumerate(starts):
            # Side by side; pairs far enough from the plane that theirs can be any.
            place = 2.7 * R * k * across + (3.5 * R * normal if pair else 0.0)
            for side in (1, -1)[: 1 + pair]:
                points, cells = upper if side > 0 else lower
                centre = place + side * (R + self.gap) * normal
                bodies.append((points + centre, cells))
                centres.append(centre)
                throw.append(side * ((1 - spun) * velocity * tangent - impacts.speed * normal))
                # The contact, at -side R normal, moves by spin with side * velocity * tangent.
                rate.append(-spun * velocity / R * np.cross(normal, tangent))
        centres, throw, rate = np.array(centres), np.array(throw), np.array(rate)

        def velocity(x, grain):
            return throw[grain] + np.cross(rate[grain], x - centres[grain])

        walls = []
        if impacts.on_plane:
            walls = [Wall("plane", np.zeros(3), normal, friction=impacts.friction)]
        self.simulation = build(
            comm, bodies, material, np.zeros(3), np.zeros(3), axes="", walls=walls,
            velocity=velocity, friction=impacts.friction, **options,
        )  # fmt: skip
        self.num_balls = len(bodies)
        mesh = self.simulation.mesh
        self._nodes, self._first, self._grains = mesh.nodes, mesh.node_offset[:-1], mesh.grains
        self._mass = self.simulation.solid.mass[self._nodes, None]
        # The centre of mass of the mesh is nearer to the fine side than that of the sphere.
        first = self.rigid_motion()
        off = (first.centre[0] - centres[0]) @ normal
        #: Distance of the contact from the centre of mass [m]; I over mass and its square.
        self.arm = R + off
        self.gyration = across @ first.inertia[0] @ across / (first.mass[0] * self.arm**2)

    def _mesh(self, side):
        """A ball around the origin whose fine pole is near the contact, aligned with nothing."""
        i = self.impacts
        pole = -side * self.frame[0]
        points, cells = sphere_near_contact(
            i.radius, float(i.h_contact), i.growth, pole, float(i.contact_radius),
            h_max=i.h_max * i.radius,
        )  # fmt: skip
        # The pole is a node: it comes to lie beside the contact by a third of an edge.
        beside = turn(self.frame[2 if side > 0 else 1], 0.37 * i.h_contact / i.radius)
        return points @ (beside @ turn(pole, 0.7 + side)).T, cells

    def of_balls(self, values):
        """Sums of nodal values, shape (num_nodes, k), over each ball. Collective."""
        out = np.zeros((self.num_balls, values.shape[1]))
        out[self._grains] = np.add.reduceat(values[self._nodes], self._first, axis=0)
        return self.comm.allreduce(out)

    def rigid_motion(self):
        """:class:`RigidMotion` now. Collective."""
        s = self.simulation
        m, x, v = s.solid.mass[:, None], s.state.x, s.state.v
        mass = self.of_balls(m)
        centre, velocity = self.of_balls(m * x) / mass, self.of_balls(m * v) / mass
        r = x - centre[s.mesh.grains[s.mesh.grain_of_node]]
        angular = self.of_balls(m * np.cross(r, v))
        second = self.of_balls((m * r)[:, [0, 0, 0, 1, 1, 1, 2, 2, 2]] * np.tile(r, 3))
        second = second.reshape(-1, 3, 3)
        inertia = np.einsum("bii->b", second)[:, None, None] * np.eye(3) - second
        spin = np.linalg.solve(inertia, angular[..., None])[..., 0]
        return RigidMotion(mass[:, 0], centre, velocity, inertia, spin)

    def contact_velocity(self, motion):
        """Velocity along the tangent at which each ball's surface moves at the contact [m/s].

        Against the plane, for pairs against the plane between them: half of the relative one.

        Returns:
            Shape (number of impacts,), on planes first.
        """
        normal, _, across = self.frame
        num_plane = len(self.impacts.on_plane)
        side = np.ones(self.num_balls)
        side[num_plane + 1 :: 2] = -1
        # Two balls that pass each other turn their line of centres.
        line = motion.centre[num_plane::2] - motion.centre[num_plane + 1 :: 2]
        line = line / np.linalg.norm(line, axis=1)[:, None]
        line = np.concatenate([np.tile(normal, (num_plane, 1)), np.repeat(line, 2, axis=0)])
        arm = -side[:, None] * self.arm * line
        v = motion.velocity + np.cross(motion.spin, arm)
        v = side * np.einsum("bi,bi->b", v, np.cross(across, line))
        return self.of_impacts(v)

    def of_impacts(self, values):
        """Of values of the balls: those on the plane, and means of the pairs."""
        n = len(self.impacts.on_plane)
        return np.concatenate([values[:n], 0.5 * (values[n::2] + values[n + 1 :: 2])])

    def run(self, duration, every=4, check=40):
        """Step for ``duration`` [s]. Collective.

        Args:
            duration: Time to go [s].
            every: Steps between two records of the motion.
            check: Steps between two sums of the energies.

        Returns:
            time [s], shape (num_samples,); velocities of the centres of mass [m/s], shape
            (num_samples, num_balls, 3); energies over the first kinetic one, shape (num_checks,
            2): the kinetic, and the sum of all, which a gain lifts above 1.
        """
        s = self.simulation
        times, momenta, energies = [], [], []
        end = s.state.t + duration
        while True:
            num_steps, done = s.state.num_steps, s.state.t >= end
            if num_steps % every == 0 or done:
                times.append(s.state.t)
                mv = self._mass * s.state.v[self._nodes]
                momenta.append(np.add.reduceat(mv, self._first, axis=0))
            if num_steps % check == 0 or done:
                e = s.energies()
                energies.append([e["kinetic"], s.initial_kinetic + e["work"] - e["residual"]])
            if done:
                break
            s.step()
        velocity = np.zeros((len(times), self.num_balls, 3))
        velocity[:, self._grains] = np.array(momenta)
        velocity = self.comm.allreduce(velocity) / self.rigid_motion().mass[:, None]
        return np.array(times), velocity, np.array(energies) / s.initial_kinetic
