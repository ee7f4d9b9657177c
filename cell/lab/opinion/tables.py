"""The tables of the study of a second opinion."""

import math
from collections.abc import Sequence

from rich.table import Table
from rich.text import Text

from cell.lab.opinion.figures import Comparison
from cell.lab.opinion.measure import OURS, OpinionLine
from drivers.arm.model import JOINTS
from sim.described_arm import DescribedArm


def agreement(compared: Comparison, described: DescribedArm, postures: int, arm: str) -> Table:
    """Return the agreement of the description with the cell's assumptions over the postures."""
    turned = f", turned back by {math.degrees(described.turn):.0f} degrees" if described.turn else ""
    table = Table(
        title=f"{described.name} against {arm}: differences at {postures} postures",
        caption=f"MuJoCo's figures of the file against the cell's own, without a hand; flange: {described.flange}{turned}",
    )
    for name in ("quantity", "unit", "median", "worst"):
        table.add_column(name, justify="left" if name == "quantity" else "right")
    for each in compared.agreements:
        table.add_row(each.quantity, each.unit, f"{each.median:.3g}", f"{each.worst:.3g}")
    return table


def joints(compared: Comparison) -> Table:
    """Return the figures of the joints in both."""
    table = Table(
        title="Joints",
        caption="a rotor inertia or a largest torque of 0 is not described, and the cell's own then counts",
    )
    table.add_column("figure")
    table.add_column("whose")
    for number in range(1, JOINTS + 1):
        table.add_column(str(number), justify="right")
    for each in compared.joints:
        table.add_row(each.name, "the cell's", *(f"{value:.4g}" for value in each.ours))
        table.add_row("", "described", *(f"{value:.4g}" for value in each.theirs))
    return table


def trials(lines: Sequence[OpinionLine], title: str) -> Table:
    """Return success, time, force and depth on every arm, and the differences from the cell's own on the same seeds."""
    table = Table(
        title=title,
        caption="times s, means of the successes; forces each trial's largest, N; more: on the seeds that succeed on both arms, with "
        "95 % interval; force: median difference of all seeds; won, lost: seeds",
    )
    names = (
        "arm",
        "success",
        "Wilson 95 %",
        "time",
        "p95",
        "force",
        "<= 20 N",
        "depth, mm",
        "more time",
        "more force",
        "won, lost",
    )
    for name in names:
        table.add_column(name, justify="left" if name == "arm" else "right")
    table.add_column("endings other than success")
    for line in lines:
        of, is_own = line.result, line.result.name == OURS
        table.add_row(
            of.name,
            f"{of.successes}/{of.trials}",
            f"{100 * of.low:.1f} to {100 * of.high:.1f} %",
            *(f"{value:.1f}" for value in (of.mean, of.p95, of.force_median)),
            f"{of.within}/{of.trials}",
            f"{1000 * line.depth:.2f}",
            "" if is_own else f"{line.slower:+.1f} ± {line.slower_error:.1f}",
            "" if is_own else f"{line.harder:+.1f}",
            "" if is_own else f"{line.won}, {line.lost}",
            Text(of.endings),
        )
    return table
