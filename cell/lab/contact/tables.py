"""Tables of the ladder of models."""

import math
from collections.abc import Sequence

from rich.table import Table

from cell.lab.contact.ladder import FINEST
from cell.lab.contact.measure import Findings, TrialsRow, verdict
from cell.lab.contact.needs import needed
from cell.records.statistics import wilson


def tables(found: Findings) -> list[Table]:
    """Return the tables: ladder, arm and grip, whole trials, and the needs of each skill."""
    ladder = Table(
        "model of the hole",
        "x real time",
        "error 1-5 deg",
        "15-45 deg",
        "penetration",
        "drag",
        "verdict",
        title="Hole: bare physics, rigid mover",
    )
    for row in sorted(found.rungs, key=lambda row: row.error):
        penetration = f"{1e6 * row.penetration:.1f} um"
        ladder.add_row(
            row.name,
            f"{row.real_time:.0f}",
            _percent(row.shallow_error),
            _percent(row.steep_error),
            penetration,
            f"{row.drag:.2g} N",
            verdict(row),
        )
    hands = Table(
        "arm and grip",
        "x real time",
        "deeper than exact",
        "penetration",
        "tip stays away",
        "turned in hand",
        title="Arm and grip: torque law included, hole in closed form",
    )
    for hand in found.hands:
        hands.add_row(
            hand.name,
            f"{hand.real_time:.0f}",
            hand.fault or f"{100 * hand.error:+.2f} %",
            f"{1e6 * hand.penetration:.1f} um",
            f"{1e3 * hand.left:.2f} mm",
            f"{math.degrees(hand.turned):.1f} deg",
        )
    trials = [
        _trials_table(rows, f"Whole trials, full arm with control and skin{where}")
        for rows, where in ((found.trials, ""), (found.tight, ", half the clearance"))
        if rows
    ]
    needs = Table(
        "skill",
        "needs",
        "hole",
        "arm and grip",
        "ships",
        title=f"What each skill needs: the fastest models that give it; steps to {1e3 * found.longest_step:.2f} ms, or the "
        "grip carries the peg past its contacts",
    )
    for need in needed(found):
        needs.add_row(need.skill, need.needs, need.hole or "none", need.arm_and_grip or "none", need.shipped)
    return [ladder, hands, *trials, needs]


def _trials_table(rows: Sequence[TrialsRow], title: str) -> Table:
    trials = Table(
        "model in whole trials",
        "success",
        "Wilson 95 %",
        "void",
        "penetration",
        "peak force",
        f"end otherwise than {FINEST}",
        "x real time",
        title=f"{title}; peak forces differ from seed to seed by {rows[0].force_spread:.1f} N",
    )
    for tried in rows:
        if tried.fault:
            trials.add_row(tried.name, tried.fault)
            continue
        low, high = wilson(tried.successes, tried.trials)
        trials.add_row(
            tried.name,
            f"{tried.successes}/{tried.trials}",
            f"{100 * low:.0f} to {100 * high:.0f} %",
            str(tried.voids),
            f"{1e6 * tried.penetration:.1f} um",
            f"{tried.force:.1f} N ({tried.force_error:+.1f})",
            f"{tried.changed}/{tried.trials}",
            f"{tried.real_time:.1f}",
        )
    return trials


def _percent(value: float) -> str:
    return f"{100 * value:.2f} %" if math.isfinite(value) else "not finite"
