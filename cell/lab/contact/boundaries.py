"""Stiffness limits above which the integration of a contact fails in theory; [todorov] for the contact's law."""

import math


def boundary_bound(timestep: float) -> float:
    """Return the stiffness, 1/s², at which a bound contact becomes unstable, with critical damping b = 2 sqrt(k).

    MuJoCo's contact requires the acceleration -b v - k r; semi-implicit Euler gives v' = v - (b v + k r) dt and r' = r
    + v' dt. The eigenvalues leave the unit circle if k dt² + 2 b dt = 4: sqrt(k) dt = 2 (sqrt(2) - 1).
    """
    return (2.0 * (math.sqrt(2.0) - 1.0) / timestep) ** 2


def boundary_bouncing(timestep: float) -> float:
    """Return the stiffness, 1/s², at which a contact that begins only at touch adds energy, b = 2 sqrt(k).

    A body that arrives with the speed v is at most v dt deep at the first contact, and leaves with (k dt² + b dt - 1)
    v. Both speeds are equal if k dt² + b dt = 2, sqrt(k) dt = sqrt(3) - 1.
    """
    return ((math.sqrt(3.0) - 1.0) / timestep) ** 2
