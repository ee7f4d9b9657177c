"""Needs of each skill, and the fastest models that meet them according to the measurements."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from cell.lab.contact.ladder import PADS, SHIPPED
from cell.lab.contact.measure import EXACT_ENOUGH, SMOOTH, Findings, RungRow, TrialsRow
from sim.hand_rig import NOT_ROUND

NEEDS: dict[str, tuple[str, Callable[[RungRow], bool]]] = {
    "spray_search": (
        f"falls right at 15 and 45 degrees, no seams over {SMOOTH:g} N",
        lambda row: row.steep_error <= EXACT_ENOUGH and row.drag <= SMOOTH and row.rests and not row.is_void,
    ),
    "tactile_insert": (
        "right depth at all tilts, not void",
        lambda row: row.error <= EXACT_ENOUGH and row.rests and not row.is_void,
    ),
    "spiral_adjust": (
        "the same, and a peg too thick stays out",
        lambda row: row.error <= EXACT_ENOUGH and row.rests and not row.is_void and row.keeps_out,
    ),
}
"""Requirements of each skill on the hole's model."""


HELD = "full arm, hinge"
NOT_MEASURED = "not measured"
"""Label of arm and grip for a peg that the arm's rigs cannot push."""
ALIKE = 0.1
"""Largest relative difference of the tip's distance from its setpoint to that with the full arm; a skill must tolerate
joint friction."""


@dataclass(frozen=True, slots=True)
class NeedRow:
    """Needs of one skill, and the models that meet them."""

    skill: str
    needs: str
    hole: str
    """Fastest model of the hole that meets them; empty if there is none. Its steps are short enough that the grip
    cannot carry the peg past its contacts, and its trials end as on the finest rung."""
    arm_and_grip: str
    shipped: str
    """Result of the comparison with the default models."""


def needed(found: Findings) -> list[NeedRow]:
    """Return for every skill the fastest models that meet its needs, and whether they are the default."""
    whole = {row.name: row for row in found.trials}
    asked = [rows for rows in (found.trials, found.tight) if rows]
    hands = {row.name: row for row in found.hands}
    like = [
        row
        for row in found.hands
        if not row.fault and HELD in hands and abs(row.left - hands[HELD].left) <= ALIKE * hands[HELD].left
    ]
    hinged = [row for row in like if PADS not in whole or "pads" not in row.name or not whole[PADS].changed]
    hand = max(hinged, key=lambda row: row.real_time).name if hinged else ""
    if all(row.fault == NOT_ROUND for row in found.hands[1:]):
        hand = NOT_MEASURED
    lines = []
    for skill, (needs, gives) in NEEDS.items():
        good = [
            row
            for row in found.rungs
            if gives(row) and row.timestep <= found.longest_step and all(end_alike(row.name, rows) for rows in asked)
        ]
        hole = max(good, key=lambda row: row.real_time).name if good else ""
        is_shipped = hole == SHIPPED and hand in (HELD, NOT_MEASURED)
        lines.append(NeedRow(skill, needs, hole, hand, "yes" if is_shipped else "no"))
    pads = next((row.name for row in found.hands if "pads" in row.name and not row.fault), "")
    lines.append(
        NeedRow(
            "grasp_from_rack, release_and_retract",
            "a peg that pads take and leave",
            SHIPPED,
            pads,
            "yes" if pads else "no",
        )
    )
    return lines


def end_alike(name: str, rows: Sequence[TrialsRow]) -> bool:
    """Return True if trials on a rung end as on the finest.

    The outcomes must be the same and none void. The peak forces must differ on average by less than those of two seeds;
    then a limit, or a technician, draws the same conclusion from one trial's force.
    """
    row = next((row for row in rows if row.name == name), None)
    if row is None or row.fault or row.changed or row.voids:
        return False
    return not abs(row.force_error) > row.force_spread
