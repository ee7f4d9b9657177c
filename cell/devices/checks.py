"""Verdicts on the devices' readings and on the computer's timing, for a technician."""

from drivers.arm.loop_figures import LoopFigures
from drivers.arm.model import Hand
from drivers.errors import FAULTS, CellError, FaultCode, SkinUntrustedError
from drivers.protocols import Clock
from drivers.quantities import SwitchState, TaxelFrame
from drivers.skin.health import dead_groups, require_trust
from drivers.skin.layout import Layout, module_of
from skills.contract import is_trusted

OK = "ok"
"""First word of the verdict on a usable device."""
LOOP_TIME = 0.5
"""Duration of the measurement of the arm's torque loop, s."""
LEAST_IN_TIME = 0.95
"""Least share of torques sent in time, fraction."""
_ARM_FAULTS = (FaultCode.ARM_STOPPED, FaultCode.ARM_REFLEX)
SCANS = 50
"""Number of scans in the timing measurement."""


def skin_verdict(frame: TaxelFrame, layout: Layout) -> str:
    """Return "ok", followed by single untrusted taxels if the skin works without them.

    Raises:
        SkinUntrustedError: A whole module is dead, or too few taxels are trusted for any skill.
    """
    try:
        require_trust(frame, layout)
    except SkinUntrustedError as error:
        if not is_trusted(frame) or dead_groups(~frame.trusted, module_of(layout)):
            raise
        return f"{OK}, but {error}"
    return OK


def verdict(reading: object, layout: Layout) -> str:
    """Return "ok", or the fault in one device's reading while the cell is idle and empty; `layout` is that of the skin."""
    if isinstance(reading, TaxelFrame):
        return skin_verdict(reading, layout)
    if reading is SwitchState.CLOSED:
        return "closed: take the part out of the hole; if there is none, the lever is stuck or its wires are swapped"
    if reading is SwitchState.UNKNOWN:
        return "state unknown: see the log, then check cable, supply and firmware of the switch board"
    return OK


def loop_verdict(figures: LoopFigures) -> str:
    """Return "ok", or the missed states and the share of torques in time of the arm's torque loop."""
    # Largest permitted share of missed arm states, fraction; after twenty in a row the arm stops.
    if figures.missed <= 0.01 * figures.cycles and figures.success_rate >= LEAST_IN_TIME:
        return OK
    return (
        f"the torque loop missed {figures.missed} of {figures.cycles} states, {figures.success_rate:.1%} of its torques "
        f"came in time; {LEAST_IN_TIME:.0%} needed: a kernel with PREEMPT_RT, a network card for the arm alone, no other programs"
    )


def hand_verdicts(figures: LoopFigures, hand: Hand, force: float, most: float) -> list[tuple[str, str]]:
    """Return name and verdict of end effector and load, as they are set in the arm's controller.

    Args:
        figures: Figures of the arm's loop.
        hand: The hand of the arm's file.
        force: Force that the arm reports in free air, N.
        most: Largest permitted force in free air, N.
    """
    # Largest permitted difference between the masses in Desk and in the arm's file, kg, a weight of 1 N; chosen, not measured.
    most_weight_off = 0.1
    weight = hand.body.mass + 2.0 * hand.finger.mass
    off = figures.end_effector + figures.load - weight
    said = f"Desk has {figures.end_effector:.2f} kg and a load of {figures.load:.2f} kg, the arm's file {weight:.2f} kg"
    end_effector = load = OK
    if figures.end_effector < 0.5 * hand.body.mass or figures.end_effector > weight + most_weight_off:
        end_effector = f"{said}: select the hand in Desk, or mend [hand] of the arm's file"
    if abs(off) > most_weight_off:
        load = f"{said}: {abs(off):.2f} kg apart, {most_weight_off:g} kg allowed: state the load in Desk"
    elif force > most:
        load = f"{force:.0f} N reported in free air; wrench.offset = {most:g} N allowed: check what touches the hand, and the load in Desk"
    return [("end effector", end_effector), ("load", load)]


def remedy(error: CellError) -> str:
    """Return a fault as text for a technician; add the remedy if the message lacks it."""
    told = f"fault {error.code.value}: {error}"
    return f"{told}: {FAULTS[error.code].remedy}" if error.code in _ARM_FAULTS else told


def check_clock(clock: Clock, period: float) -> str:
    """Wait for `SCANS` scans as the cell does; return OK, or their delay if it is too large.

    Args:
        clock: The cell's clock.
        period: Period of the scan, s.
    """
    late_share = 0.5  # Largest permitted delay of a scan, fraction of its period.
    start, late = clock.now(), []
    for scan in range(1, SCANS + 1):
        clock.wait_until(start + scan * period)
        late.append(clock.now() - (start + scan * period))
    # The three largest delays are left out, because every computer is late at times.
    usual = sorted(late)[-4]
    if usual <= late_share * period:
        return OK
    return (
        f"scans of {period * 1e3:g} ms start {usual * 1e3:.1f} ms late, at worst {max(late) * 1e3:.1f} ms; "
        f"{late_share * period * 1e3:g} ms allowed: stop other programs, or lower scan_rate"
    )
