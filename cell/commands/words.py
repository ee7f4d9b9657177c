"""Reports and recorded runs as text for terminals; nothing is printed here."""

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.table import Table

from cell.peg.ending import explained
from cell.peg.part_state import (
    LOST_WITH_WORLD,
    READY,
    REMEDIES,
    Action,
    ActionWords,
    PartState,
    described,
    in_words,
    told,
)
from cell.records.schema import EventKind, EventRow, RunRow, StageRow
from cell.records.wall_clock import headed, local
from cell.run.states import BEFORE_RESET, State
from drivers.errors import FAULTS, FaultCode
from plc_bridge.protocol.messages import Diagnostics, LeaseState, PartEvidence, PartPlace, Refusal, Report, Result
from skills.catalogue import CATALOGUE

TYPED: ActionWords = {Action.RECOVER: "`cell run recover`", Action.CLEARED: "`cell run cleared`"}
"""Commands of a terminal for the actions at the peg."""


def report(image: Report) -> dict[str, object]:
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
        "hole": list(image.hole),
        "peak_force": image.peak_force,
        "part": PartPlace(image.part).name.lower(),
        "part_depth": image.part_depth,
        "evidence": in_words(PartEvidence(image.part_evidence), image.part_width),
        "next": _next(image),
    }


def _next(image: Report) -> str:
    """Return the next step as one line: the remedy of a fault, then the reset if the state needs one, then the peg's remedy."""
    peg = REMEDIES[PartPlace(image.part)].told(TYPED)
    steps = [FAULTS[FaultCode(image.fault)].remedy] if image.fault else []
    if image.state in BEFORE_RESET:
        steps.append("reset")
    return f"{', then '.join(steps)}; then {peg.removeprefix(READY)}" if steps else peg


def peg(part: PartState, is_simulated: bool) -> str:
    """Return the place of the peg, its evidence and the next step; a peg in a simulated cell is lost when the process ends."""
    if is_simulated and part.place in LOST_WITH_WORLD:
        return f"{described(part)}: the simulated world ends with this command: {TYPED[Action.CLEARED]} before the next"
    return told(part, TYPED)


def _named(times: Sequence[float]) -> dict[str, float]:
    """Return the times of the executed stages, s, by name."""
    return {CATALOGUE.stages.get(number, str(number)): time for number, time in enumerate(times, 1) if time}


def line(image: Report, counts: Diagnostics) -> str:
    """Return a report and the counts as one line."""
    told = {key: value for key, value in report(image).items() if value not in ("", "none", {})}
    return " ".join(f"{key}={value}" for key, value in (*told.items(), *asdict(counts).items()))


LABELS: Mapping[str, tuple[str, str, float]] = {
    "cycle_time": ("cycle time", "s", 1.0),
    "peak_force": ("largest force", "N", 1.0),
    "deepest": ("largest depth", "mm", 1e3),
    "theta": ("theta", "degrees", math.degrees(1.0)),
    "sigma": ("standard deviation", "degrees", math.degrees(1.0)),
    "length": ("peg beyond the fingers", "mm", 1e3),
    "is_simulated": ("simulated", "", 1.0),
    "config_hash": ("config", "", 1.0),
    "source": ("requested by", "", 1.0),
    "samples": ("scans recorded", "", 1.0),
    "part": ("peg", "", 1.0),
    "part_evidence": ("evidence", "", 1.0),
}
"""Label, unit and factor of the record's fields that are not shown under their own names."""


def run(row: RunRow, stages: Sequence[StageRow] = ()) -> Table:
    """Return the record of one run in words, with units and the results of its stages; missing values are left out."""
    table = Table(show_header=False)
    for name in RunRow.__slots__:
        if text := _shown(name, getattr(row, name)):
            label, unit, _ = LABELS.get(name, (name.replace("_", " "), "", 1.0))
            table.add_row(label, f"{text} {unit}".rstrip())
    why = explained(row.fault, row.reason)
    for name, text in asdict(why).items() if why else ():
        table.add_row(name, text)
    for stage in stages:
        found = {name: value for name, value in json.loads(stage.facts).items() if not isinstance(value, dict | None)}
        if found:
            table.add_row(stage.name, ", ".join(f"{name} {_short(value)}" for name, value in found.items()))
    return table


def events(rows: Sequence[EventRow]) -> Table:
    """Return the events of a run in words."""
    table = Table(headed("time", (row.time for row in rows)), "event", "by", "details", box=SIMPLE_HEAD, pad_edge=False)
    for row in rows:
        name = row.name.lower().replace("_", " ")
        code = f" {row.code}" if row.kind == EventKind.FAULT else ""
        before = f"from {row.text.lower()}" if row.kind == EventKind.STATE else row.text
        table.add_row(local(row.time)[11:19], f"{row.kind}{code}: {name}", row.source, before)
    return table


def _shown(name: str, value: object) -> str:
    """Return a field of a run in words; empty if it is missing or has no content."""
    if value in (None, "", "{}", "[]") or (name in ("fault", "recipe", "sequence") and value == 0):
        return ""
    if name in _TEXTS:
        return _TEXTS[name](value)
    return _short(value * LABELS[name][2]) if isinstance(value, float) and name in LABELS else str(value)


def _times(value: str) -> str:
    return ", ".join(f"{stage} {time:.3g} s" for stage, time in json.loads(value))


def _pairs(value: str) -> str:
    return ", ".join(f"{key} {_short(each)}" for key, each in json.loads(value).items())


def _part(value: str) -> str:
    return f"{value.replace('_', ' ')}: {REMEDIES[PartPlace[value.upper()]].told(TYPED)}"


_TEXTS: dict[str, Callable[[Any], str]] = {
    "started": local,
    "ended": local,
    "stage_times": _times,
    "versions": _pairs,
    "parameters": _pairs,
    "part": _part,
    "is_simulated": lambda value: "yes" if value else "no",
}
"""Function that returns the words of a field of a run."""


def _short(value: object) -> str:
    """Return a value with three significant digits."""
    if isinstance(value, list):
        return f"({', '.join(_short(each) for each in value)})"
    return f"{value:.3g}" if isinstance(value, float) else str(value)
