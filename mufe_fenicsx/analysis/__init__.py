"""Numbers from meshes, states and contacts: energy, fabric, inertia, kinematics, stress."""
