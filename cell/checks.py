"""What a technician is told of what a device reads, and of the computer's own pace."""

from drivers.arm.loop_figures import LoopFigures
from drivers.errors import FAULTS, CellError, FaultCode
from drivers.protocols import Clock
from drivers.quantities import SwitchState

LOOP_TIME = 0.5
"""How long the arm's torque loop is watched, s."""
MOST_MISSED = 0.01
"""Share of the arm's states that may be missed: the arm stops at twenty in a row."""
LEAST_IN_TIME = 0.95
"""Share of the torques that must come in time."""
_ARM_FAULTS = (FaultCode.ARM_STOPPED, FaultCode.ARM_REFLEX)
SCANS = 50
"""How many scans the pace is measured over."""
WORST = 3
"""The latest of them are left out: everybody is late once."""
LATE_SHARE = 0.5
"""A scan may start late by this share of its period."""


def verdict(reading: object) -> str:
    """Return "ok", or what is wrong with what a device read while the cell stood idle and empty."""
    if reading is SwitchState.CLOSED:
        return "closed: take the part out of the hole; if there is none, the lever is stuck or its wires are swapped"
    if reading is SwitchState.UNKNOWN:
        return "state unknown: see the log, then check cable, supply and firmware of the switch board"
    return "ok"


def loop_verdict(figures: LoopFigures) -> str:
    """Return "ok", or how the arm's torque loop fails to keep its time."""
    if figures.missed <= MOST_MISSED * figures.cycles and figures.success_rate >= LEAST_IN_TIME:
        return "ok"
    return (
        f"the torque loop missed {figures.missed} of {figures.cycles} states, {figures.success_rate:.1%} of its torques "
        f"came in time; {LEAST_IN_TIME:.0%} needed: a kernel with PREEMPT_RT, a network card for the arm alone, no other programs"
    )


def remedy(error: CellError) -> str:
    """Return a fault as a technician reads it, with what to do where the message itself does not say it."""
    told = f"fault {error.code.value}: {error}"
    return f"{told}: {FAULTS[error.code].remedy}" if error.code in _ARM_FAULTS else told


def check_clock(clock: Clock, period: float) -> str:
    """Wait for some scans as the cell does; return "ok", or how late they start when that is too late.

    Args:
        clock: The cell's.
        period: Of the scan, s.
    """
    start, late = clock.now(), []
    for scan in range(1, SCANS + 1):
        clock.wait_until(start + scan * period)
        late.append(clock.now() - (start + scan * period))
    usual = sorted(late)[-1 - WORST]
    if usual <= LATE_SHARE * period:
        return "ok"
    return (
        f"scans of {period * 1e3:g} ms start {usual * 1e3:.1f} ms late, at worst {max(late) * 1e3:.1f} ms; "
        f"{LATE_SHARE * period * 1e3:g} ms allowed: stop other programs, or lower scan_rate"
    )
