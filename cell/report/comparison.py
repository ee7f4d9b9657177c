"""Two runs, or the runs of two periods, side by side; pure."""

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from cell.records.schema import RunRow, StageRow
from cell.records.wall_clock import local
from cell.report.facts import Facts
from cell.report.words import overview

ComparedLine = tuple[str, str, str]
"""Title of a compared value, and the value in each run."""
_PLAIN = (
    *("program", "recipe", "serial", "source", "outcome"),
    *("stage", "reason", "fault", "message", "seed", "retries"),
)
_SCALED = {
    "cycle_time": ("cycle: command to answer", 1.0, " s"),
    "peak_force": ("largest force", 1.0, " N"),
    "deepest": ("deepest", 1000.0, " mm"),
    "theta": ("theta at the end", math.degrees(1.0), "°"),
    "sigma": ("sigma at the end", math.degrees(1.0), "°"),
}


def compared(
    rows: Sequence[RunRow], stages: Sequence[Sequence[StageRow]], configs: Sequence[str | None]
) -> list[tuple[str, list[ComparedLine]]]:
    """Return tables of two runs: their records, their stages, and the config keys and versions that differ."""
    first, second = rows
    record = [("started", local(first.started), local(second.started))]
    record += [(name, str(getattr(first, name)), str(getattr(second, name))) for name in _PLAIN]
    for name, (title, scale, unit) in _SCALED.items():
        record.append((title, *(_figure(getattr(row, name), scale, unit) for row in rows)))  # type: ignore[arg-type]
    tables = [("record", record), ("stage, without and with transfer", _stages(stages))]
    versions = [json.loads(row.versions) for row in rows]
    tables.append(("version that differs", _differences(versions[0], versions[1])))
    tables.append(_configs(*configs))
    return [(title, lines) for title, lines in tables if lines]


def _configs(first: str | None, second: str | None) -> tuple[str, list[ComparedLine]]:
    if first is None or second is None:
        one, other = ("not kept" if text is None else "kept" for text in (first, second))
        return "config", [("config on record", one, other)]
    return "config key that differs", _differences(dict(_flat(json.loads(first))), dict(_flat(json.loads(second))))


def compared_periods(first: Facts, second: Facts) -> list[tuple[str, list[ComparedLine]]]:
    """Return tables of the runs of two periods: yield, times and losses."""
    found = []
    pairs = [{title: (head, rows) for title, head, rows in overview(facts)} for facts in (first, second)]
    for title in dict.fromkeys([*pairs[0], *pairs[1]]):
        head = (pairs[0].get(title) or pairs[1][title])[0]
        cells = [{row[0]: " / ".join(row[1:]) for row in pair[title][1]} if title in pair else {} for pair in pairs]
        names = dict.fromkeys([*cells[0], *cells[1]])
        lines = [(name, cells[0].get(name, "-"), cells[1].get(name, "-")) for name in names]
        found.append((f"{title}: {' / '.join(head[1:])}", lines))
    return found


def _stages(stages: Sequence[Sequence[StageRow]]) -> list[ComparedLine]:
    told: list[dict[str, str]] = []
    for tried in stages:
        tries: dict[str, int] = {}
        texts: dict[str, str] = {}
        for stage in tried:
            tries[stage.name] = tries.get(stage.name, 0) + 1
            number = tries[stage.name]
            name = stage.name.replace("_", " ") + (f", try {number}" if number > 1 else "")
            counted = "-" if stage.counted is None else f"{stage.counted:.2f}"
            texts[name] = f"{counted} / {stage.ended - stage.began:.2f} s {stage.reason or stage.outcome}"
        told.append(texts)
    names = list(dict.fromkeys([*told[0], *told[1]]))
    return [(name, told[0].get(name, "-"), told[1].get(name, "-")) for name in names]


def _figure(value: float | None, scale: float, unit: str) -> str:
    return "-" if value is None else f"{value * scale:.2f}{unit}"


def _flat(tree: Mapping[str, Any], place: str = "") -> Iterator[tuple[str, Any]]:
    for name, value in tree.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{place}{name}.")
        else:
            yield f"{place}{name}", value


def _differences(first: Mapping[str, Any], second: Mapping[str, Any]) -> list[ComparedLine]:
    names = list(dict.fromkeys([*first, *second]))
    pairs = [(name, first.get(name, "-"), second.get(name, "-")) for name in names]
    return [(name, str(one), str(other)) for name, one, other in pairs if one != other]
