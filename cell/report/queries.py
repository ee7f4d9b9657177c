"""SQL statements of a report on the index of a journal.

The first statements make temporary tables, and the others query these tables. `cell report --sql` prints all statements.
"""

from collections.abc import Sequence

from cell.records.run_query import RunQuery
from skills.catalogue import CATALOGUE, GRASP

SHIFTS = ("06:00", "14:00", "22:00")
"""Default starts of the shifts, local time."""
LONGEST_STOP = 3600.0
"""Largest time until the next start that counts as lost by a run, s; of a longer break of the line, only this much counts."""
CYCLE = "cycle"
"""Name of the cycle time among the trends."""

ASKED = "CREATE TEMP TABLE asked (run INTEGER PRIMARY KEY, started, day, shift, outcome, is_good, stage, reason, fault, cycle_time, peak_force, lost)"
FILLED = """
INSERT INTO asked
WITH chosen AS MATERIALIZED (
    SELECT run, started, julianday(started) AS day, datetime(started, 'localtime') AS local, outcome, stage, reason, fault,
        cycle_time, peak_force FROM runs WHERE {where} AND outcome != 'running'
)
SELECT run, started, day, {shift}, outcome, outcome = 'success', stage, reason, fault, cycle_time, peak_force,
    -- time until the next start, or of the run itself if it is the last, s
    min({longest}, max(0.0, coalesce(86400.0 * (lead(day) OVER (ORDER BY started) - day), cycle_time, 0.0)))
FROM chosen
"""
TRIED = """
CREATE TEMP TABLE tried AS
SELECT run, day, shift, is_good, {times},
    sum(counted) FILTER (WHERE name IN ({marks})) AS insertion, max(residual) FILTER (WHERE name = '{grasp}') AS residual
FROM asked JOIN stages USING (run) GROUP BY run
"""
"""One row per run, over all tries of each stage: sums of times, and the largest residual of the grasp."""
TREND = f"""
CREATE TEMP TABLE trend AS
WITH means AS MATERIALIZED (SELECT shift, {{means}} FROM tried WHERE is_good GROUP BY shift)
SELECT '{CYCLE}' AS name, shift, avg(cycle_time) AS mean FROM asked WHERE is_good AND cycle_time IS NOT NULL GROUP BY shift
{{each}}
"""
OUTAGES = """
CREATE TEMP TABLE outages AS
SELECT julianday(time) AS began, julianday(coalesce((
    SELECT time FROM events AS later WHERE later.event > events.event AND +later.kind = 'state'
    AND later.name NOT IN ('ABORTING', 'ABORTED', 'CLEARING', 'STOPPING', 'STOPPED') ORDER BY event LIMIT 1), ?)) AS ended
FROM events WHERE kind = 'state' AND name = 'ABORTING' AND text NOT IN ('ABORTED', 'CLEARING', 'STOPPED', 'STOPPING')
"""
"""Times from an abort, by a fault or a person, until the cell was reset."""

TOTALS = "SELECT outcome, count(*), min(started), max(started) FROM asked GROUP BY outcome ORDER BY count(*) DESC"
BY_SHIFT = """
WITH spans AS (
    SELECT shift, sum(is_good) AS good, count(*) AS runs, sum(lost * NOT is_good) / 60.0 AS minutes,
        max(julianday(shift, 'utc'), (SELECT min(day) FROM asked)) AS began,
        min(julianday(shift, {length}, 'utc'), julianday(?)) AS ended
    FROM asked WHERE shift IS NOT NULL GROUP BY shift
)
SELECT shift, good, runs, minutes, 1.0 - coalesce((
    SELECT sum(min(outages.ended, spans.ended) - max(outages.began, spans.began)) FROM outages
    WHERE outages.ended > spans.began AND outages.began < spans.ended), 0.0) / nullif(max(ended - began, 0.0), 0.0)
FROM spans ORDER BY shift
"""
LOSSES = """
SELECT fault, iif(fault, '', stage), iif(fault, '', coalesce(nullif(reason, ''), outcome)), count(*), sum(lost) / 60.0
FROM asked WHERE NOT is_good GROUP BY 1, 2, 3 ORDER BY 5 DESC, 1, 2, 3
"""
MEANS = "SELECT shift, name, mean FROM trend WHERE shift IS NOT NULL ORDER BY shift"
LIMITS = """
SELECT name, avg(mean) - 2.66 * avg(move), avg(mean) + 2.66 * avg(move)
FROM (SELECT name, mean, abs(mean - lag(mean) OVER (PARTITION BY name ORDER BY shift)) AS move FROM trend)
GROUP BY name HAVING count(*) >= 10
"""
"""Limits of a chart of individual values: mean and 2.66 times the mean moving range, [nist-charts]."""
CYCLES = "SELECT cycle_time FROM asked WHERE is_good AND cycle_time IS NOT NULL"
FORCES = "SELECT peak_force FROM asked WHERE peak_force IS NOT NULL"
STAGE = "SELECT {name}_counted, {name} FROM tried WHERE is_good AND {name} IS NOT NULL"
INSERTIONS = "SELECT insertion FROM tried WHERE is_good AND insertion IS NOT NULL"
RESIDUALS = """
SELECT day - (SELECT min(day) FROM asked), residual FROM tried WHERE residual IS NOT NULL AND day IS NOT NULL
"""


def prepared(query: RunQuery, shifts: Sequence[str], ends: str) -> list[tuple[str, list[object]]]:
    """Return the statements that make the temporary tables, with their values.

    Args:
        query: Selection of the runs.
        shifts: Starts of the shifts, `HH:MM`, local time, in their order.
        ends: End of an outage that still lasts, wall time, ISO 8601 UTC.
    """
    where, values = query.where()
    names = tuple(CATALOGUE.stages.values())
    every = "sum({0}) FILTER (WHERE name = '{1}') AS {1}{2}"
    spans = [(("stages.ended - stages.began", name, ""), ("counted", name, "_counted")) for name in names]
    times = ", ".join(every.format(*one) for both in spans for one in both)
    marks = ", ".join(f"'{name}'" for name in CATALOGUE.counted)
    means = ", ".join(f"avg({name}) AS {name}" for name in names)
    each = "".join(f"UNION ALL SELECT '{name}', shift, {name} FROM means WHERE {name} IS NOT NULL\n" for name in names)
    tables: list[tuple[str, list[object]]] = [
        (ASKED, []),
        (FILLED.format(shift=_shift(shifts), longest=LONGEST_STOP, where=where), values),
        (TRIED.format(times=times, marks=marks, grasp=GRASP.name), []),
        (TREND.format(means=means, each=each), []),
        (OUTAGES, [ends]),
    ]
    return [(f"DROP TABLE IF EXISTS temp.{name}", []) for name in ("asked", "tried", "trend", "outages")] + tables


def by_shift(shifts: Sequence[str]) -> str:
    """Return the query for the shifts: start, successes, runs, minutes lost, availability."""
    minutes = [60 * int(start[:2]) + int(start[3:]) for start in shifts]
    lengths = [(after - begun) % 1440 or 1440 for begun, after in zip(minutes, [*minutes[1:], minutes[0]], strict=True)]
    whens = " ".join(f"WHEN '{start}' THEN '{length} minutes'" for start, length in zip(shifts, lengths, strict=True))
    return BY_SHIFT.format(length=f"CASE substr(shift, 12) {whens} END")


def _shift(shifts: Sequence[str]) -> str:
    """Return the start of a run's shift, local time, as an SQL expression."""
    whens = " ".join(
        f"WHEN substr(local, 12) >= '{start}' THEN substr(local, 1, 11) || '{start}'" for start in reversed(shifts)
    )
    return f"CASE {whens} ELSE date(local, '-1 day') || ' {shifts[-1]}' END"
