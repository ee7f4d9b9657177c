"""What a technician is told of what a device reads, and of the computer's own pace."""

from drivers.protocols import Clock
from drivers.quantities import SwitchState

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
