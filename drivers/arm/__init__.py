"""Arms: the figures of each type, kinematics, dynamics, and the driver of a Franka arm."""
