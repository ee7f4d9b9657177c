"""Past and active alarms, computed from the events that begin and end them."""

from dataclasses import dataclass

ALARMS = """
WITH begun AS (
    SELECT *, CASE kind
        WHEN 'fault' THEN (
            SELECT event FROM events AS later WHERE later.event > alarm.event AND +later.kind = 'state'
            AND later.name NOT IN ('ABORTING', 'ABORTED', 'CLEARING', 'STOPPING', 'STOPPED') ORDER BY event LIMIT 1)
        ELSE (
            SELECT min(event) FROM events AS later WHERE later.event > alarm.event AND (
                later.kind = 'warning' AND later.name IN (alarm.name, alarm.name || ' is over')
                OR later.kind = 'state' AND later.text = ''))
        END AS last
    FROM (
        SELECT * FROM events
        WHERE kind IN ('fault', 'warning') AND name NOT LIKE '% is over' AND time >= :since AND time < :until
        AND (:code IS NULL OR code = :code)
        ORDER BY event DESC LIMIT :last
    ) AS alarm
)
SELECT begun.time, begun.kind, begun.code, begun.name, begun.text, begun.run,
    CASE
        WHEN ended.event IS NOT NULL THEN 'over'
        WHEN EXISTS (SELECT 1 FROM events WHERE event > begun.event AND kind = 'state' AND name = 'CLEARING')
            AND begun.kind = 'fault' THEN 'acknowledged'
        ELSE 'active'
    END,
    max(86400.0 * (julianday(ended.time) - julianday(begun.time)), 0.0)
FROM begun LEFT JOIN events AS ended ON ended.event = begun.last
ORDER BY begun.event DESC
"""
"""Query for the alarms of a period. A fault is over when the cell leaves the states that need a reset. A warning is over when
it clears or comes again. Both are over when the cell starts again."""


@dataclass(frozen=True, slots=True)
class Alarm:
    """One fault or warning."""

    time: str
    """Wall time of its beginning, ISO 8601, UTC."""
    kind: str
    """`fault` or `warning`."""
    code: int
    """Number of the fault; 0 for a warning."""
    name: str
    text: str
    run: int
    """Number of the run under way; 0 for none."""
    state: str
    """`active`; `acknowledged`: cleared, not reset; or `over`."""
    duration: float | None
    """Time from the beginning to the end, s; None while the alarm is not over."""
