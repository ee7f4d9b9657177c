"""A report of the line and a run on record in words, as terminals show them; nothing is printed here."""

import json
from collections.abc import Sequence
from dataclasses import asdict

from rich.table import Table

from cell.journal_schema import RunRow, StageRow
from cell.part_state import READY, REMEDIES, in_words
from cell.states import BEFORE_RESET, State
from drivers.errors import FAULTS, FaultCode
from plc_bridge.images import Diagnostics, ReportImage
from plc_bridge.messages import LeaseState, PartEvidence, PartPlace, Refusal, Result
from skills.catalogue import CATALOGUE


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
        "stage_times": _named(image.stage_times),
        "total_time": image.total_time,
        "hole": [image.hole_x, image.hole_y],
        "peak_force": image.peak_force,
        "part": PartPlace(image.part).name.lower(),
        "part_depth": image.part_depth,
        "evidence": in_words(PartEvidence(image.part_evidence), image.part_width),
        "next": _next(image),
    }


def _next(image: ReportImage) -> str:
    """Return what to do next, in one line: about what is broken, then the reset where the state asks for one, then about the peg."""
    peg = REMEDIES[PartPlace(image.part)]
    steps = [FAULTS[FaultCode(image.fault)].remedy] if image.fault else []
    if image.state in BEFORE_RESET:
        steps.append("reset")
    return f"{', then '.join(steps)}; then {peg.removeprefix(READY)}" if steps else peg


def _named(times: Sequence[float]) -> dict[str, float]:
    """Return the times of the stages that were run, s, by their names."""
    return {CATALOGUE.stages.get(number, str(number)): time for number, time in enumerate(times, 1) if time}


def line(image: ReportImage, counts: Diagnostics) -> str:
    """Return a report and the counts as one line."""
    told = {key: value for key, value in report(image).items() if value not in ("", "none", {})}
    return " ".join(f"{key}={value}" for key, value in (*told.items(), *asdict(counts).items()))


def run(row: RunRow, stages: Sequence[StageRow] = ()) -> Table:
    """Return the whole record of one run in words, and what the skills of its stages said."""
    table = Table(show_header=False)
    for name in RunRow.__slots__:
        value = getattr(row, name)
        if name == "stage_times":
            value = ", ".join(f"{stage} {time:.2f} s" for stage, time in json.loads(value))
        elif name == "versions":
            value = ", ".join(f"{package} {version}" for package, version in json.loads(value).items())
        elif name == "part" and value:
            value = f"{value}: {REMEDIES[PartPlace[value.upper()]]}"
        table.add_row(name, str(value))
    for stage in stages:
        told = {
            name: value for name, value in json.loads(stage.facts).items() if not isinstance(value, dict | type(None))
        }
        facts = ", ".join(f"{name} {_short(value)}" for name, value in told.items())
        if facts:
            table.add_row(stage.name, facts)
    return table


def _short(value: object) -> str:
    """Return a fact of a result in few digits."""
    if isinstance(value, list):
        return f"({', '.join(_short(each) for each in value)})"
    return f"{value:.5g}" if isinstance(value, float) else str(value)
