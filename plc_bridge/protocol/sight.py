"""The cell's view of the PLC, for commissioning of both; pure."""

from collections.abc import Iterable
from dataclasses import dataclass

from plc_bridge.protocol.links import Link


@dataclass(frozen=True, slots=True)
class PlcSight:
    """View of one PLC from the cell."""

    source: str
    version: int
    """Version of the map that the PLC writes; 0 for none."""
    life_changes: int
    """Number of changes of its life counter on this connection."""
    longest_gap: float
    """Longest time between two changes, s."""
    silence: float
    """Time since its last sign of life, s."""
    uses_tail: bool
    """True if the PLC writes the copy of the life counter at the tail."""


def sight_of(links: Iterable[Link], host: str, now: float) -> PlcSight | None:
    """Return the view of the PLC at `host`, an address, node or line, at the time `now`, s; None if it is not connected.

    If one host has several links, the view is of the link whose life counter changed most often.
    """
    spoken = [link for link in links if link.host.rpartition("@")[2] == host and link.has_spoken]
    if not spoken:
        return None
    link = max(spoken, key=lambda each: each.watchdog.changes)
    watchdog = link.watchdog
    return PlcSight(
        source=link.source,
        version=link.image.version if link.image is not None else 0,
        life_changes=watchdog.changes,
        longest_gap=watchdog.longest_gap,
        silence=now - (watchdog.life_stamp if watchdog.uses_life else watchdog.heard),
        uses_tail=watchdog.uses_tail,
    )
