"""Proofs with a person at the cell, who pushes the hand for the sign of the wrench, and presses the lever of the switch."""

import math
from collections.abc import Callable

import numpy as np

from cell.devices.assembly import Cell
from drivers.errors import NotCalibratedError, WrenchReversedError
from drivers.quantities import SwitchState, Vector

PATIENCE = 60.0
"""Longest wait for the person, s."""
LEAST_FORCE = 5.0
"""Least change of the force that counts as a push, N; chosen, not measured."""
LEAST_WAY = 1e-3
"""Least displacement of the hand that counts as a push, m; chosen, not measured."""
ALONG = 0.5
"""Least cosine of the angle between force and displacement in a clear push."""


def sense(force: Vector, way: Vector) -> int:
    """Return 1 if a force on the hand points along the hand's displacement, -1 if against it, 0 if the push is too small or skew.

    Args:
        force: Change of the reported force on the hand, shape (3,), N, base frame.
        way: Displacement of the hand by the push, shape (3,), m, base frame.
    """
    size, length = float(np.linalg.norm(force)), float(np.linalg.norm(way))
    if size < LEAST_FORCE or length < LEAST_WAY:
        return 0
    cosine = float(force @ way) / (size * length)
    return 0 if abs(cosine) < ALONG else int(math.copysign(1.0, cosine))


def prove_wrench(cell: Cell, ask: Callable[[str], None]) -> str:
    """Compare the reported force with the displacement of the pushed hand; return the measurement in words.

    Raises:
        WrenchReversedError: The force points against the push.
        NotCalibratedError: Nobody pushed, or the force is not along the line of the displacement.
        CellError: The arm times out or is stopped.
    """
    ask("The arm holds still. Press Enter, wait a second, then push the hand sideways with a finger: ")
    clock, period = cell.clock, 1.0 / cell.config.scan_rate
    forces: list[Vector] = []
    end = clock.now() + PATIENCE
    start = cell.arm.read()
    while clock.now() < end:
        state = cell.arm.read()
        # The mean force of the first scans is the force without a push.
        if len(forces) < 20:
            forces.append(state.wrench.force)
            start = state
        force, way = state.wrench.force - np.mean(forces, axis=0), state.tcp.position - start.tcp.position
        found = sense(force, way)
        size = float(np.linalg.norm(force))
        if found > 0:
            return f"{size:.0f} N along a push of {1e3 * float(np.linalg.norm(way)):.1f} mm"
        if found < 0:
            raise WrenchReversedError(
                f"arm: reports {size:.0f} N against the push; a force along it expected: the sign of its external wrench is reversed"
            )
        clock.wait_until(clock.now() + period)
    raise NotCalibratedError(
        f"wrench: no push of {LEAST_FORCE:g} N over {1e3 * LEAST_WAY:g} mm within {PATIENCE:g} s in which force and displacement are parallel"
    )


def prove_switch(cell: Cell, ask: Callable[[str], None]) -> str:
    """Read the switch while a person presses its lever, until it has reported open, closed and open; return the measurement in words.

    Raises:
        NotCalibratedError: The switch did not report the states in this order in time.
        CellError: The switch times out.
    """
    if cell.config.switch.kind == "none":
        return "no switch: the force curve shows whether the peg is seated (hole.evidence)"
    ask("Press Enter, then press the lever under the hole and let it go: ")
    clock, period = cell.clock, 1.0 / cell.config.scan_rate
    wanted = [SwitchState.OPEN, SwitchState.CLOSED, SwitchState.OPEN]
    end = clock.now() + PATIENCE
    while clock.now() < end:
        if cell.switch.read() is wanted[0]:
            wanted.pop(0)
        if not wanted:
            return "open, closed and open again"
        clock.wait_until(clock.now() + period)
    raise NotCalibratedError(f"switch: not seen {wanted[0].name.lower()} within {PATIENCE:g} s")
