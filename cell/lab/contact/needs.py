"""What each skill needs of the models: the fastest that give it, from what was measured."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from cell.lab.contact.ladder import PADS, SHIPPED
from cell.lab.contact.measure import EXACT_ENOUGH, SMOOTH, Findings, RungRow, TrialsRow

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
"""What a skill needs of the hole's model."""


HELD = "full arm, hinge"
ALIKE = 0.1
"""The tip stays off its setpoint as with the full arm, to this share: joint friction is what a skill must bear."""


@dataclass(frozen=True, slots=True)
class NeedRow:
    """What a skill needs."""

    skill: str
    needs: str
    hole: str
    """The fastest model of the hole that gives it, steps so that the grip cannot carry the peg past its contacts, and ends
    whole trials as the finest does; empty when none does."""
    arm_and_grip: str
    shipped: str
    """Whether that is what ships."""


def needed(found: Findings) -> list[NeedRow]:
    """Return for every skill the fastest models that give what it needs; `shipped` says whether they are those that ship."""
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
    lines = []
    for skill, (needs, gives) in NEEDS.items():
        good = [
            row
            for row in found.rungs
            if gives(row) and row.timestep <= found.longest_step and all(end_alike(row.name, rows) for rows in asked)
        ]
        hole = max(good, key=lambda row: row.real_time).name if good else ""
        is_shipped = hole == SHIPPED and hand == HELD
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
    """Return whether trials on a rung end as on the finest.

    Each of them with the same outcome, none void, and peak forces that differ on average by less than one trial's differs
    from the next one's anyway: what a limit or a technician makes of one trial's force is then the same.
    """
    row = next((row for row in rows if row.name == name), None)
    if row is None or row.fault or row.changed or row.voids:
        return False
    return not abs(row.force_error) > row.force_spread
