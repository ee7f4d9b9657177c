"""The servers of the page and of the metrics, with the handler of each route."""

import asyncio
import hashlib
import json
import logging
import ssl
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path

from tornado.ioloop import PeriodicCallback
from tornado.web import HTTPError, StaticFileHandler

from cell.config.cell_config import CellConfig
from cell.config.load import LoadedConfig
from cell.page.commands import MOST
from cell.page.front import Front, Guarded, HttpServer
from cell.page.hub import PERIOD, SPECTATOR, PageHub
from cell.page.metrics import KIND, CellCollector
from cell.page.records import REPORT, Records
from cell.page.socket import PageSocket
from cell.page.token import page_token
from cell.run.exposure import is_local
from cell.run.live import Live
from drivers.errors import FAULTS, ConfigError, JournalError
from plc_bridge.bridge import Bridge
from plc_bridge.modbus.tls import browser_context

logger = logging.getLogger(__name__)

STATIC = Path(__file__).parent / "static"
KINDS = {
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".svg": "image/svg+xml",
    ".mp4": "video/mp4",
}
REPORT_POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; frame-ancestors 'none'"
"""Content policy of a report, which is one file without scripts."""


class PageServer(HttpServer):
    """The page of one served cell.

    Args:
        address: Host and port; port 0 takes a free one.
        bridge: Bridge to the PLCs.
        live: Exchange that the scan thread fills with its readings.
        loaded: The cell and its recipes.
        folder: Folder of the records.
        cables: Names of the simulated devices whose cables the page can unplug.
    """

    def __init__(
        self,
        address: tuple[str, int],
        bridge: Bridge,
        live: Live,
        loaded: LoadedConfig,
        folder: Path,
        cables: Sequence[str] = (),
    ) -> None:
        super().__init__("--page", address)
        self._bridge, self._live, self._loaded, self._folder, self._cables = bridge, live, loaded, folder, cables
        self.token = ""
        """Token that a page must send before it may move the cell."""

    def start(self) -> None:
        """Listen for browsers.

        Raises:
            DeviceNotOpenedError: The port is in use, or the address is not this computer's.
            ConfigError: The file of the token cannot be read or written.
        """
        self.token = page_token(self._folder)
        self.routes = self._made()
        super().start()
        self._bridge.opened(SPECTATOR, SPECTATOR)

    def close(self) -> None:
        """Close every page and stop listening."""
        super().close()
        self._bridge.closed(SPECTATOR)

    def _made(self) -> Front:
        """Return the routes."""
        records, build = Records(self._folder), _build()
        self._hub = PageHub(self._bridge, self._live, self._loaded, records, build, self._cables)
        own, kept = {"path": str(STATIC)}, {"path": str(self._folder)}
        return Front(
            [
                ("/live", PageSocket, {"hub": self._hub, "bridge": self._bridge, "token": self.token}),
                ("/faults", FaultCatalogue),
                ("/alarms", Alarms),
                (f"/{REPORT}", ReportDocument, kept),
                (r"/runs/(\d{1,9})/(data|config)", RunData),
                (r"/runs/(\d{1,9})/replay", RunReplay),
                (r"/runs/(\d{1,9})/film\.mp4", RunFilm, kept),
                (r"/([\w-]+\.(?:html|js|css|svg))", Static, own),
                (r"/runs/\d{1,9}", Page, own),
                ("/", Page, own),
            ],
            self._loaded.cell.page.names,
            records=records,
            token=self.token,
            build=build,
            compress_response=True,
            # Three pings per link timeout; each answer is a sign of life. A late answer closes no page: ping timeout 0.
            websocket_ping_interval=self._loaded.cell.plc.life_timeout / 3,
            websocket_ping_timeout=0,
            websocket_max_message_size=MOST,
        )

    def context(self) -> ssl.SSLContext | None:
        """Return the TLS context with the cell's certificate; None on a loopback address, or if the cell has no certificate."""
        tls = self._loaded.cell.plc.tls
        return None if tls is None or is_local(self._asked[0]) else browser_context(tls)

    async def work(self, is_over: asyncio.Event) -> None:
        """Poll the cell and update the pages until `is_over` is set."""
        beat = PeriodicCallback(self._hub.tick, 1e3 * PERIOD)
        beat.start()
        try:
            await is_over.wait()
        finally:
            beat.stop()


class MetricsServer(HttpServer):
    """The metrics of one cell as Prometheus text."""

    def __init__(self, address: tuple[str, int], bridge: Bridge, config: CellConfig) -> None:
        """Keep the address, and the bridge and the config of the cell."""
        super().__init__("--metrics", address)
        self.routes = Front([("/metrics", Metrics)], config.page.names, collector=CellCollector(bridge, config.plc.tls))


class Metrics(Guarded):
    """Handler of the metrics."""

    def get(self) -> None:
        """Send the present metrics."""
        self.set_header("Content-Type", KIND)
        self.finish(self.settings["collector"].text())


class RecordsHandler(Guarded):
    """Base of the handlers that read the records."""

    @property
    def records(self) -> Records:
        """The records of the cell."""
        records: Records = self.settings["records"]
        return records


class FileHandler(RecordsHandler, StaticFileHandler):
    """Base of the handlers that send a file, or only its requested range, for example if a browser seeks in a film."""

    SUPPORTED_METHODS = ("GET", "POST")

    def get_content_type(self) -> str:
        """Return the media type of the file."""
        return KINDS[Path(self.path).suffix]

    def compute_etag(self) -> str | None:
        """Return None instead of a version, because the file can change."""
        return None


class Static(FileHandler):
    """Handler of the page's own files; a browser caches them, and the server confirms their version at each use."""

    def compute_etag(self) -> str | None:
        """Return the version of the page's files; None for HTML, because a page from the cache has lost its socket."""
        return None if self.path.endswith(".html") else f'"{self.settings["build"]}"'

    def set_extra_headers(self, path: str) -> None:
        """Let a browser cache a file if it checks the version at each use; HTML is not cached."""
        if not path.endswith(".html"):
            self.set_header("Cache-Control", "no-cache")


class Page(Static):
    """Handler of the pages; a page's route does not contain the name of its file."""

    async def get(self, path: str = "", include_body: bool = True) -> None:
        """Send the page of a run, or of the cell."""
        await super().get("run.html" if self.request.path.startswith("/runs/") else "index.html", include_body)


class FaultCatalogue(Guarded):
    """Handler of the catalogue of faults."""

    def get(self) -> None:
        """Send code, meaning, cause and remedy of every fault as JSON."""
        self.set_header("Content-Type", "application/json")
        self.finish(json.dumps([{"code": code, **asdict(text)} for code, text in FAULTS.items() if code]))


class Alarms(RecordsHandler):
    """Handler of the alarms on record."""

    def get(self) -> None:
        """Send the newest alarms since the argument `since` as JSON."""
        try:
            found = self.records.alarms(self.get_argument("since", ""))
        except ConfigError as error:
            logger.info("page: %s", error)
            raise HTTPError(400, reason="since: 30m, 12h, 7d, 4w or a date allowed") from None
        except JournalError as error:
            logger.info("page: %s", error)
            raise HTTPError(404, reason="the records cannot be read") from None
        self.set_header("Content-Type", "application/json")
        self.finish(json.dumps(found))


class RunData(RecordsHandler):
    """Handler of the record of one run; its config is sent only with the token."""

    def get(self, number: str, what: str) -> None:
        """Send the run as JSON."""
        run = int(number)
        if what == "config":
            self.require_token()
        with _found(run):
            text = json.dumps(self.records.whole(run)) if what == "data" else self.records.config(run)
        if text is None:
            raise HTTPError(404, reason=f"run {run}: its config was not kept")
        self.set_header("Content-Type", "application/json")
        self.finish(text if what == "data" else json.dumps(json.loads(text), indent=2))  # indented for reading


class RunReplay(RecordsHandler):
    """Handler of the samples of one run, which the browser draws."""

    async def get(self, number: str) -> None:
        """Send the samples."""
        with _found(int(number)):
            samples = await self.records.replay(int(number))
        self.set_header("Content-Type", "application/octet-stream")
        self.finish(samples)


class RunFilm(FileHandler):
    """Handler of the film of a run: drawing the film needs the token, reading it does not."""

    async def get(self, path: str, include_body: bool = True) -> None:
        """Send the film of the run with this number."""
        film = self.records.film_path(int(path))
        if not film.is_file():
            raise HTTPError(404, reason=f"run {path}: not drawn yet")
        await super().get(film.name, include_body)

    async def post(self, number: str) -> None:
        """Start to draw the film if it is missing; the answer does not wait, because drawing takes minutes."""
        self.require_token()
        with _found(int(number)):
            path = self.records.film(int(number))
        self.set_status(202 if path is None else 200)
        self.finish("being drawn\n" if path is None else "there\n")


class ReportDocument(FileHandler):
    """Handler of the report of a period: making a report needs the token, reading the last one does not."""

    async def get(self, path: str = "", include_body: bool = True) -> None:
        """Send the report; its style is inside it."""
        if not self.records.path_of_report.is_file():
            raise HTTPError(404, reason="no report was made yet")
        self.set_header("Content-Security-Policy", REPORT_POLICY)
        await super().get(REPORT, include_body)

    async def post(self) -> None:
        """Make the report since the argument `since`."""
        self.require_token()
        if await self.records.report(self.get_argument("since", "")) is None:
            raise HTTPError(404, reason="the report cannot be made here; run cell report for the reason")
        self.finish("there\n")


@contextmanager
def _found(run: int) -> Iterator[None]:
    """Turn errors of a run's record into one line without a path on the disk.

    Raises:
        HTTPError: The run is not on record, or its record is damaged.
    """
    try:
        yield
    except JournalError as error:
        logger.info("page: %s", error)
        raise HTTPError(404, reason=f"run {run}: not on record, or without samples") from None
    except (TypeError, ValueError) as error:
        logger.warning("page: record of a run is damaged: %s", error)
        raise HTTPError(404, reason=f"run {run}: its record is damaged") from None


def _build() -> str:
    """Return a fingerprint of the page's own files."""
    digest = hashlib.sha256()
    for file in sorted(STATIC.iterdir()):
        digest.update(file.read_bytes())
    return digest.hexdigest()[:16]
