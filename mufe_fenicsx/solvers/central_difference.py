"""Central differences with a lumped mass (eqs 1-4 of Nadimi & Fonseca 2018)."""


def central_difference(state, dt, drift, forces, kick):
    """Advance ``state`` by one step.

    v at the half step, u and x at the end, forces there, then v at the end.
    The length of the step may change from one step to the next.

    Args:
        state: :class:`~mufe_fenicsx.state.State`, changed in place.
        dt: Length of the step [s].
        drift: ``drift(dt)``: half a kick with the known acceleration, then the motion.
        forces: ``forces(dt)``: evaluates the forces at the new positions.
        kick: ``kick(dt)``: acceleration from those forces, and half a kick.
    """
    drift(dt)
    state.t += dt
    state.dt = dt
    forces(dt)
    kick(dt)
    state.num_steps += 1
