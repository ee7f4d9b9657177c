"""What the terminal shows, as tables; nothing is printed here."""

import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import Group
from rich.table import Table
from rich.text import Text

from cell.journal import RunRow
from cell.states import State
from cell.statistics import PUBLISHED, PUBLISHED_ATTEMPTS, PUBLISHED_SUCCESSES, PUBLISHED_TOTAL, StageLine, wilson
from cell.trials import TrialRow
from drivers.errors import FAULTS
from drivers.skin.calibration import SkinCalibration
from plc_bridge.images import Diagnostics, ReportImage
from plc_bridge.messages import LeaseState, Refusal, Result
from skills.catalogue import CATALOGUE

if TYPE_CHECKING:
    from cell.lab.frontier import FrontierLine
    from cell.lab.line import Measure
    from cell.lab.speed import ProfileLine, SpeedLine
    from cell.lab.tactile_charts import TactileStudy


def stages(lines: Sequence[StageLine]) -> Table:
    """Return this cell's stage table beside [gibbons], Table I."""
    table = Table(title=Text("Stages, beside [gibbons], Table I"), caption="times are means of the successes")
    for name in ("stage", "success", "Wilson 95 %", "time (s)", "published", "time (s)"):
        table.add_column(name, justify="left" if name == "stage" else "right")
    published = [(p.label, p.successes, p.attempts, p.time) for p in PUBLISHED]
    published.append(("total", PUBLISHED_SUCCESSES, PUBLISHED_ATTEMPTS, PUBLISHED_TOTAL))
    for line, (label, successes, attempts, time) in zip(lines, published, strict=True):
        low, high = wilson(line.successes, line.attempts)
        table.add_row(
            label,
            f"{line.successes}/{line.attempts}",
            f"{100 * low:.1f} to {100 * high:.1f} %",
            "-" if line.time is None else f"{line.time:.1f}",
            f"{successes}/{attempts}",
            f"{time:.1f}",
        )
    return table


def outcomes(rows: Sequence[TrialRow]) -> Table:
    """Return how many trials ended how."""
    table = Table("outcome", "stage", "reason", "trials")
    kinds = sorted({(row.outcome, row.stage, row.reason) for row in rows})
    for kind in kinds:
        count = sum((row.outcome, row.stage, row.reason) == kind for row in rows)
        table.add_row(*kind, str(count))
    return table


def speed(lines: "Sequence[SpeedLine]") -> Table:
    """Return how fast the stand-in runs."""
    table = Table("regime", "simulated (s)", "x real time", "bare mj_step (1/s)", "(x)", "outside mj_step (us/ms)")
    for line in lines:
        table.add_row(
            line.regime,
            f"{line.simulated:.1f}",
            f"{line.real_time:.1f}",
            f"{line.bare_rate:.0f}",
            f"{line.bare_real_time:.1f}",
            f"{line.outside * 1e6:.1f}",
        )
    return table


def profile(lines: "Sequence[ProfileLine]") -> Table:
    """Return where the time of a trial goes."""
    table = Table("part", "cost (us/ms)", "share (%)")
    for line in lines:
        table.add_row(line.part, f"{line.cost * 1e6:.2f}", f"{line.share * 100:.1f}")
    return table


def line(lines: "Sequence[Measure]") -> Table:
    """Return how the line to the PLC holds."""
    table = Table("measure", "value", "beside", "unit", "target", "holds")
    for each in lines:
        beside = "" if each.beside is None else f"{each.beside:.4g}"
        holds = "" if each.holds is None else "yes" if each.holds else "no"
        table.add_row(each.name, f"{each.value:.4g}", beside, each.unit, each.target, holds)
    return table


def runs(rows: Iterable[RunRow]) -> Table:
    """Return the index of the journal, one line a run."""
    table = Table("run", "started (UTC)", "program", "recipe", "serial", "source", "seq", "outcome", "stage", "reason")
    for row in rows:
        table.add_row(
            str(row.run),
            row.started[:19],
            row.program,
            str(row.recipe),
            row.serial,
            row.source,
            str(row.sequence),
            row.outcome,
            row.stage,
            row.reason or row.message,
        )
    return table


def run(row: RunRow) -> Table:
    """Return everything that the index has of one run."""
    table = Table(show_header=False)
    for name in RunRow.__slots__:
        value = getattr(row, name)
        if name == "stage_times":
            value = ", ".join(f"{stage} {time:.2f} s" for stage, time in json.loads(value))
        elif name == "versions":
            value = ", ".join(f"{package} {version}" for package, version in json.loads(value).items())
        table.add_row(name, str(value))
    return table


def faults() -> Table:
    """Return every fault code: meaning, cause, what to do."""
    table = Table("code", "name", "meaning", "cause", "what to do", show_lines=True)
    for code, text in FAULTS.items():
        table.add_row(str(code.value), code.name, text.meaning, text.cause, text.remedy)
    return table


def devices(found: Iterable[tuple[str, str]]) -> Table:
    """Return what a check of the devices found."""
    table = Table("device", "found")
    for name, text in found:
        table.add_row(name, text)
    return table


def watch(image: ReportImage, counts: Diagnostics) -> str:
    """Return a report and the counts as one line."""
    told = {key: value for key, value in report(image).items() if value not in ("", "none")}
    return " ".join(f"{key}={value}" for key, value in (*told.items(), *asdict(counts).items()))


def report(image: ReportImage) -> dict[str, object]:
    """Return a report in words."""
    return {
        "state": State(image.state).name if image.state else "",
        "stage": CATALOGUE.stages.get(image.stage, ""),
        "progress": image.progress,
        "sequence": image.sequence,
        "result": Result(image.result).name.lower(),
        "reason": CATALOGUE.reasons.get(image.reason, str(image.reason)).lower(),
        "refusal": Refusal(image.refusal).name.lower(),
        "fault": image.fault,
        "run": image.run,
        "lease": LeaseState(image.lease).name.lower(),
        "holder": image.holder,
        "stage_times": list(image.stage_times),
        "total_time": image.total_time,
    }


def calibration(found: SkinCalibration, path: Path) -> Table:
    """Return what calibration of the skin found, and where it is written."""
    table = Table("skin", "value", title=f"written: {path}")
    gains = np.array([found.left, found.right])
    table.add_row("gains, smallest to largest", f"{gains.min():.3f} to {gains.max():.3f}")
    table.add_row("gains, standard deviation", f"{gains.std():.3f}")
    table.add_row("taxels that could not be measured", str(sum(map(len, found.unmeasured))))
    table.add_row("point spread (mm)", f"{found.point_spread * 1e3:.2f}")
    table.add_row("not explained", f"{found.residual:.1%}")
    return table


def plain(title: str, lines: Sequence[Any]) -> Table:
    """Return lines of one dataclass as they are, SI units."""
    table = Table(title=title)
    names = [field.name for field in fields(lines[0])]
    for name in names:
        table.add_column(name, justify="right")
    for line in lines:
        values = (getattr(line, name) for name in names)
        table.add_row(*(f"{value:.4g}" if isinstance(value, float) else str(value) for value in values))
    return table


def frontier(lines: "Sequence[FrontierLine]", title: str) -> Table:
    """Return how well and how fast each variant works."""
    table = Table(title=title, caption="times are of the successes, s; forces are each trial's largest, N")
    for name in ("", "variant", "success", "Wilson 95 %", "mean", "median", "p95", "force p95", "voids", "retries"):
        table.add_column(name, justify="left" if name in ("", "variant") else "right")
    table.add_column("endings other than success")
    for before, line in zip((None, *lines), lines, strict=False):
        is_new = before is None or before.family != line.family
        table.add_row(
            line.family if is_new else "",
            line.variant,
            f"{line.successes}/{line.trials}",
            f"{100 * line.low:.1f} to {100 * line.high:.1f} %",
            *(f"{value:.1f}" for value in (line.mean, line.median, line.p95, line.force_p95)),
            str(line.voids),
            str(line.retries),
            Text(line.error or line.endings),
        )
    return table


def tactile(found: "TactileStudy") -> Group:
    """Return how well and how fast each estimator reads theta."""
    table = Table("layout", "pads", "frames", "estimator", "told", "RMSE (deg)", "p95", "worst", "in 1.96 sigma", "us")
    for line in found.lines:
        table.add_row(
            line.layout,
            line.model,
            f"{line.condition}, n = {line.frames}",
            line.estimator,
            f"{100 * line.told:.1f} %",
            *(f"{value:.2f}" for value in (line.rmse, line.p95, line.worst, line.covered)),
            f"{1e6 * line.time:.0f}",
        )
    missed = Table("layout", "what the bed of springs leaves out, beside an elastic layer", "size")
    for item in found.fidelity:
        missed.add_row(item.layout, item.what, f"{100 * item.size:.1f} %")
    return Group(table, missed, Text("written: " + " ".join(map(str, found.files))))
