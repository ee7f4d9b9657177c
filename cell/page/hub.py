"""The view that all pages share: it looks at the cell at a fixed rate, and tells every open page what has changed."""

import json
from collections import deque
from collections.abc import Mapping, Sequence
from typing import Protocol

from cell.config import LoadedConfig
from cell.live import Live, Look, Pull
from cell.page import telling
from cell.page.records import Records
from cell.page.traces import NAMES, POINTS, Traces, touch
from cell.versions import PROGRAM, installed
from drivers.quantities import FINGER_NAMES
from drivers.skin.layout import finger_positions, triangles
from plc_bridge.bridge import Bridge
from plc_bridge.images import ReportImage
from skills.catalogue import CATALOGUE

SPECTATOR = "page"
"""Name of the page's own link, which sends no command and therefore sees the run of any other link."""
PERIOD = 0.05
"""Time between two looks at the cell, s; what happens reaches a page in about this time."""
EVERY = 2
"""Number of looks after which touch and traces are sent once."""
PLACES = 32
"""Number of pages that may be open at once."""
PLACES_OF_ONE = 16
"""Number of pages without the token that may be open at once from one address."""
AGAIN = 100
"""Number of looks after which the records are read again, because other programs write them too."""


class Page(Protocol):
    """One open page."""

    def tell(self, text: bytes) -> None:
        """Send a text that later ones do not replace."""

    def show(self, text: bytes) -> None:
        """Send a text that a slow page may miss."""

    def look(self) -> None:
        """Tell this page what has changed for it alone."""

    @property
    def is_unlocked(self) -> bool:
        """True if the page has shown the token."""

    @property
    def peer(self) -> str:
        """Address of the page's computer."""

    def leave(self, why: str) -> None:
        """Close this page."""


class PageHub:
    """Tells pages; all of it runs on the page's thread."""

    def __init__(
        self,
        bridge: Bridge,
        live: Live,
        loaded: LoadedConfig,
        records: Records,
        build: str,
        cables: Sequence[str] = (),
    ) -> None:
        """Take the parts that are looked at.

        Args:
            bridge: The mailbox of the line.
            live: The slot that the scan fills.
            loaded: The cell and its recipes.
            records: Records of its runs.
            build: Name of this version of the page, so that an old page loads itself anew.
            cables: Names of the simulated devices whose cables may be pulled out.
        """
        self._cables = tuple(cables)
        self._bridge, self._live, self._loaded, self._records = bridge, live, loaded, records
        self._build = build
        self.pages: list[Page] = []
        """Pages that are shown everything, oldest first."""
        self._lobby: deque[Page] = deque()
        """Pages that came when there was no place, and may still show the token."""
        self.traces = Traces()
        self._report: ReportImage | None = None
        self._unplugged: frozenset[str] = frozenset()
        self._look: Look | None = None
        self._state = self._summary = b""
        self._new: list[list[float | None]] = []
        self._ticks = 0

    def tick(self) -> None:
        """Look once."""
        self._ticks += 1
        before = self.traces.run
        looks = self._live.take()
        added = self.traces.add(looks)
        self._new = added if self.traces.run != before else self._new + added
        self._look = looks[-1] if looks else self._look
        report = telling.still(self._bridge.report_for(SPECTATOR))
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
        if self._ticks % EVERY == 0:
            self._show_live()
        for page in tuple(self.pages):
            page.look()

    def greet(self, page: Page) -> None:
        """Tell a page that has just opened everything that it shows."""
        page.tell(_text("hello", self._hello()))
        for text in (self._state, self._summary):
            if text:
                page.tell(text)
        page.tell(self.history())
        self.pages.append(page)

    def full(self, page: Page) -> str:
        """Return why there is no place for a page without the token; empty if there is one."""
        alike = sum(not each.is_unlocked and each.peer == page.peer for each in self.pages)
        if len(self.pages) < PLACES and alike < PLACES_OF_ONE:
            return ""
        if len(self._lobby) >= PLACES:
            self._lobby.popleft().leave("too many pages")
        self._lobby.append(page)
        return f"{len(self.pages)} pages are open already, {alike} of them without the token at this address"

    def admit(self, page: Page) -> bool:
        """Greet a page that has the token, for which one without it leaves if need be; return False if there is none."""
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

    def leave(self, page: Page) -> None:
        """Show a page nothing more."""
        for pages in (self.pages, self._lobby):
            if page in pages:
                pages.remove(page)

    def pull(self, pull: Pull) -> str:
        """Pass on the wish to pull or plug a cable; return why not, where there is no such cable."""
        if pull.cable not in self._cables:
            known = ", ".join(self._cables) or "none: its devices are real"
            return f"cable {pull.cable!r:.40}: {known} allowed on this cell"
        self._live.pull(pull)
        return ""

    def history(self) -> bytes:
        """Return what is kept of the run under way, or of the last one."""
        return _text("history", {"run": self.traces.run, "points": list(self.traces.points)})

    def _tell_state(self, report: ReportImage) -> None:
        unplugged = tuple(name for name in self._cables if name in self._unplugged)
        told = telling.told(report, self._live.fault, self._live.evidence, unplugged)
        self._state = _text("state", told)
        self._tell(self._state)

    def _tell_records(self) -> None:
        summary = _text("records", self._records.summary())
        if summary != self._summary:
            self._summary = summary
            self._tell(summary)

    def _show_live(self) -> None:
        new, self._new = self._new, []
        if self._look is None or not self.pages:
            return
        text = _text("live", {"run": self.traces.run, "points": new, "touch": touch(self._look)})
        self._look = None
        for page in tuple(self.pages):
            page.show(text)

    def _tell(self, text: bytes) -> None:
        for page in tuple(self.pages):
            page.tell(text)

    def _hello(self) -> Mapping[str, object]:
        cell = self._loaded.cell
        hole = cell.hole
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
            "hole": {"centre": hole.centre, "area": hole.area, "depth": hole.depth},
            "fingers": FINGER_NAMES,
            "taxels": finger_positions(cell.skin.layout).round(6).tolist(),
            "triangles": triangles(cell.skin.layout).tolist(),
        }


def _moment(report: ReportImage) -> tuple[int, ...]:
    """Return that of a report which a new or ended run changes."""
    return report.run, report.result, report.fault, report.state


def _text(kind: str, data: Mapping[str, object]) -> bytes:
    return json.dumps({"kind": kind, **data}, separators=(",", ":")).encode()
