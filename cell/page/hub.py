"""The view shared by all pages: it polls the cell at a fixed rate and sends changes to every open page."""

import json
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from cell.config.load import LoadedConfig
from cell.page import telling
from cell.page.records import Records
from cell.page.scene import scene
from cell.page.traces import NAMES, POINTS, Traces, touch
from cell.records.provenance import PROGRAM, installed
from cell.run.live import CablePull, Live
from cell.run.record import scene_facts
from plc_bridge.bridge import Bridge
from plc_bridge.protocol.messages import Report
from skills.catalogue import CATALOGUE

if TYPE_CHECKING:
    from cell.page.socket import PageSocket

SPECTATOR = "page"
"""Name of the server's own link; it sends no command, so that its report shows the run of any other link."""
PERIOD = 0.1
"""Polling period, s; a change reaches a page within about this time."""
PLACES = 32
"""Largest number of open pages."""
PLACES_OF_ONE = 16
"""Largest number of open pages without the token from one address."""
AGAIN = 50
"""Number of polls between two reads of the records, because other programs write them too."""


class PageHub:
    """Sends the view to all pages; all of it runs on the page's thread."""

    def __init__(
        self,
        bridge: Bridge,
        live: Live,
        loaded: LoadedConfig,
        records: Records,
        build: str,
        cables: Sequence[str],
    ) -> None:
        """Keep the parts that the view reads.

        Args:
            bridge: The mailbox of the line.
            live: The exchange filled by the scan.
            loaded: The cell and its recipes.
            records: Records of its runs.
            build: Name of this version of the page; a page of another version reloads itself.
            cables: Names of the simulated devices whose cables can be unplugged.
        """
        self._cables = tuple(cables)
        self._bridge, self._live, self._loaded, self._records = bridge, live, loaded, records
        self._build = build
        self._scene = scene(scene_facts(loaded.cell))
        self.pages: list[PageSocket] = []
        """Admitted pages, oldest first."""
        self._lobby: deque[PageSocket] = deque()
        """Pages that found no place and can still send the token."""
        self.traces = Traces()
        self._report: Report | None = None
        self._unplugged: frozenset[str] = frozenset()
        self._state = self._summary = b""
        self._ticks = 0

    def tick(self) -> None:
        """Poll the cell once."""
        self._ticks += 1
        looks = self._live.take()
        added = self.traces.add(looks)
        # Without the life counter, reports with equal content compare equal.
        report = replace(self._bridge.report_for(SPECTATOR), life=0, life_tail=0)
        unplugged = self._live.unplugged
        if report != self._report or unplugged != self._unplugged:
            self._unplugged = unplugged
            is_news = self._report is None or _moment(report) != _moment(self._report)
            self._report = report
            self._tell_state(report)
            if is_news:
                self._tell_records()
        if self._ticks % AGAIN == 0:
            self._tell_records()
        if looks and self.pages:
            text = _text("live", {"run": self.traces.run, "points": added, "touch": touch(looks[-1])})
            for page in tuple(self.pages):
                page.show(text)
        for page in tuple(self.pages):
            page.look()

    def greet(self, page: "PageSocket") -> None:
        """Send the whole view to a page, and admit it."""
        page.tell(_text("hello", self._hello()))
        for text in (self._state, self._summary):
            if text:
                page.tell(text)
        page.tell(self.history())
        self.pages.append(page)

    def full(self, page: "PageSocket") -> str:
        """Return an empty text if there is a place for a page without the token; else put it in the lobby and return the reason."""
        alike = sum(not each.is_unlocked and each.peer == page.peer for each in self.pages)
        if len(self.pages) < PLACES and alike < PLACES_OF_ONE:
            return ""
        if len(self._lobby) >= PLACES:
            self._lobby.popleft().leave("too many pages")
        self._lobby.append(page)
        return f"{len(self.pages)} pages are open already, {alike} of them without the token at this address"

    def admit(self, page: "PageSocket") -> bool:
        """Admit a page with the token, if necessary in place of one without it; return False if there is no place."""
        self.leave(page)
        if len(self.pages) >= PLACES:
            other = next((each for each in reversed(self.pages) if not each.is_unlocked), None)
            if other is None:
                page.leave(f"{PLACES} pages with the token are open already")
                return False
            self.leave(other)
            other.leave("a page with the token needs the place")
        self.greet(page)
        return True

    def leave(self, page: "PageSocket") -> None:
        """Remove a page from the view."""
        for pages in (self.pages, self._lobby):
            if page in pages:
                pages.remove(page)

    def pull(self, pull: CablePull) -> str:
        """Forward a cable request to the scan; return the reason if there is no such cable, else an empty text."""
        if pull.cable not in self._cables:
            known = ", ".join(self._cables) or "none: its devices are real"
            return f"cable {pull.cable!r:.40}: {known} allowed on this cell"
        self._live.pull(pull)
        return ""

    def history(self) -> bytes:
        """Return the stored trace of the present run, or of the last one."""
        return _text("history", {"run": self.traces.run, "points": list(self.traces.points)})

    def _tell_state(self, report: Report) -> None:
        unplugged = tuple(name for name in self._cables if name in self._unplugged)
        told = telling.told(report, self._live.fault, self._live.evidence, unplugged)
        self._state = _text("state", told)
        self._tell(self._state)

    def _tell_records(self) -> None:
        summary = _text("records", self._records.summary())
        if summary != self._summary:
            self._summary = summary
            self._tell(summary)

    def _tell(self, text: bytes) -> None:
        for page in tuple(self.pages):
            page.tell(text)

    def _hello(self) -> Mapping[str, object]:
        cell = self._loaded.cell
        return {
            "build": self._build,
            "version": installed(PROGRAM),
            "simulated": cell.is_simulated,
            "programs": list(CATALOGUE),
            "recipes": sorted(self._loaded.recipes),
            "cables": self._cables,
            "stages": [{"number": number, "name": name} for number, name in CATALOGUE.stages.items()],
            "counted": list(CATALOGUE.counted),
            "names": NAMES,
            "points": POINTS,
            "force_limit": cell.limits.force,
            "scene": self._scene,
        }


def _moment(report: Report) -> tuple[int, ...]:
    """Return the fields of a report that change when a run starts or ends."""
    return report.run, report.result, report.fault, report.state


def _text(kind: str, data: Mapping[str, object]) -> bytes:
    return json.dumps({"kind": kind, **data}, separators=(",", ":")).encode()
