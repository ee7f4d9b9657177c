"""Traffic of any wire captured to a file, and played back to the same driver, bit for bit.

A file is text with a head line. Every poll of the wire adds "@" and the cell's time in s, then received ("<") and sent
(">") data in hexadecimal digits. The identifier precedes the data of a CAN frame; the time that the frame has waited, s,
follows them. "!" marks a failure of the wire. During playback, time passes as recorded: every wait of the driver ends at
the next poll.
"""

import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Generic, Literal, TextIO

from drivers.errors import CellError, ConfigError, FaultCode
from drivers.protocols import Clock
from drivers.transport.wires import CanFrame, LineLostError, Link, Received, Sent

logger = logging.getLogger(__name__)

HEAD = "# cell traffic 1 "
EXTENDED_DIGITS = 8
"""Number of digits of an identifier of 29 bits; one of 11 bits has three."""
Wire = Literal["can", "serial"]


class TrafficEndedError(CellError, code=FaultCode.SKIN_SILENT):
    """The recording has ended."""


class Recorder:
    """Records the traffic of a wire; it is also the driver's clock, so that every byte has the time of its poll.

    Args:
        path: File; the first opening overwrites it.
        wire: Kind of the wire.
        clock: The cell's clock.
    """

    def __init__(self, path: Path, wire: Wire, clock: Clock) -> None:
        self._path, self._wire, self._clock = path, wire, clock
        self._file: TextIO | None = None
        self._has_begun = False
        self._now = 0.0
        self._written: float | None = None

    def open(self) -> None:
        """Open the file: begin it at the first opening, continue it later; no effect if it is open.

        Raises:
            ConfigError: The file cannot be written.
        """
        if self._file is not None:
            return
        try:
            self._file = self._path.open("a" if self._has_begun else "w", encoding="utf-8")
        except OSError as error:
            raise ConfigError(f"{self._path}: traffic cannot be written: {error.strerror}") from None
        if not self._has_begun:
            self._file.write(f"{HEAD}{self._wire}\n")
        self._has_begun, self._written, self._now = True, None, self._clock.now()

    def close(self) -> None:
        """End the file; may be called again."""
        file, self._file = self._file, None
        if file is not None:
            with suppress(OSError):  # closing writes the rest, and the disk may be full
                file.close()

    def now(self) -> float:
        """Return the time, s."""
        self._now = self._clock.now()
        return self._now

    def wait_until(self, stamp: float) -> None:
        """Return when the clock shows `stamp`."""
        self._clock.wait_until(stamp)

    @contextmanager
    def watching(self) -> Iterator[None]:
        """Record a poll of the wire, and a failure of the wire during it."""
        if self._written != self._now:
            self._write(f"@ {self._now!r}\n")
            self._written = self._now
        try:
            yield
        except CellError as error:
            self.note("!", str(error))
            raise

    def note(self, what: str, text: str) -> None:
        """Record received or sent data, or a failure."""
        with self.watching():
            self._write(f"{what} {text}\n")

    def _write(self, line: str) -> None:
        """Append a line; if the disk is full, the recording ends and the driver goes on."""
        try:
            if self._file is not None:
                self._file.write(line)
        except OSError as error:
            logger.warning("%s: the recording of the traffic has ended: %s", self._path, error.strerror)
            self.close()


class RecordedWire(Generic[Received, Sent]):
    """A CAN bus or a serial line with its traffic written to a file."""

    def __init__(self, link: Link[Received, Sent], recorder: Recorder) -> None:
        self._link, self._recorder = link, recorder
        self.character_time: float = getattr(link, "character_time", 0.0)
        """Transfer time of one character on a serial line, s."""

    def open(self) -> None:
        """Open the file and the wire."""
        self._recorder.open()
        with self._recorder.watching():
            self._link.open()

    def close(self) -> None:
        """Close the wire and the file."""
        self._link.close()
        self._recorder.close()

    def read(self, timeout: float) -> Received:
        """Return the data that the wire returns, and record them."""
        with self._recorder.watching():
            data = self._link.read(timeout)
        if data:
            self._recorder.note("<", _text(data))
        return data

    def write(self, data: Sent) -> None:
        """Send a frame or bytes."""
        self._recorder.note(">", _text(data))
        with self._recorder.watching():
            self._link.write(data)


def _text(data: object) -> str:
    """Return a frame or bytes in hexadecimal digits."""
    if not isinstance(data, CanFrame):
        assert isinstance(data, bytes)
        return data.hex()
    waited = f" {data.waited!r}" if data.waited else ""
    return f"{data.id:0{EXTENDED_DIGITS if data.is_extended else 3}X} {data.data.hex()}{waited}"


def _parsed(wire: str, text: str) -> Any:
    """Return a frame of a CAN bus, or bytes of a serial line, from its text."""
    if wire == "serial":
        return bytes.fromhex(text)
    number, data, waited, *_ = [*text.split(" "), "", ""]
    return CanFrame(int(number, 16), bytes.fromhex(data), len(number) == EXTENDED_DIGITS, float(waited or 0.0))


@dataclass(slots=True)
class _Look:
    time: float
    failed: str = ""
    came: list[Any] = field(default_factory=list)
    sent: list[Any] = field(default_factory=list)


class TrafficPlayback:
    """Plays a recording as clock and wire of a driver.

    Args:
        path: File of the recording.
        character_time: Time of one character on the recorded line, s; 0 for a CAN bus.

    Raises:
        ConfigError: The file is missing, or holds no recorded traffic.
    """

    def __init__(self, path: Path, character_time: float = 0.0) -> None:
        self.wire, self._looks = _read(path)
        self.character_time = character_time
        self.differing = 0
        """Number of messages that the driver sent and that the recording lacks."""
        self._begin(0)

    def open(self) -> None:
        """Raise the failure recorded in this poll, if there is one."""
        self._fail()

    def close(self) -> None:
        """Do nothing: there is no connection to end."""

    def now(self) -> float:
        """Return the time of the played poll, s."""
        return self._looks[self._place].time

    def wait_until(self, stamp: float) -> None:
        """Advance to the next poll.

        Raises:
            TrafficEndedError: There is no next poll.
        """
        if self._place + 1 >= len(self._looks):
            raise TrafficEndedError("the recording is over")
        self._begin(self._place + 1)

    def write(self, data: CanFrame | bytes) -> None:
        """Compare a sent frame, or sent bytes, with the data recorded in this poll."""
        self._fail()
        if data in self._sent:
            self._sent.remove(data)
        else:
            self.differing += 1

    def _begin(self, place: int) -> None:
        self._place = place
        self._came, self._sent = iter(self._looks[place].came), list(self._looks[place].sent)

    def _fail(self) -> None:
        if self._looks[self._place].failed:
            raise LineLostError(self._looks[self._place].failed)


class PlaybackCan(TrafficPlayback):
    """A recording of a CAN bus."""

    def read(self, timeout: float) -> CanFrame | None:
        """Return the next frame received in this poll."""
        self._fail()
        return next(self._came, None)


class PlaybackLine(TrafficPlayback):
    """A recording of a serial line."""

    def read(self, timeout: float) -> bytes:
        """Return the bytes received in this poll."""
        self._fail()
        return b"".join(self._came)


def is_traffic(path: Path) -> bool:
    """Return True if a file holds recorded traffic."""
    try:
        with path.open("rb") as file:
            return file.read(len(HEAD)) == HEAD.encode()
    except OSError:
        return False


def _read(path: Path) -> tuple[str, list[_Look]]:
    wire, lines = _lines(path)
    looks: list[_Look] = []
    parse: dict[str, Callable[[str], object]] = {
        "@": lambda text: looks.append(_Look(float(text))),
        "<": lambda text: looks[-1].came.append(_parsed(wire, text)),
        ">": lambda text: looks[-1].sent.append(_parsed(wire, text)),
        "!": lambda text: setattr(looks[-1], "failed", text),
    }
    for number, line in enumerate(lines, 2):
        try:
            parse[line[:1]](line[2:])
        except (KeyError, ValueError, IndexError):
            if number == len(lines) + 1 and looks:
                break  # the recording was cut off in the middle of a line
            raise ConfigError(f"{path}: line {number}: {line[:40]!r}: no traffic") from None
    if not looks:
        raise ConfigError(f"{path}: no traffic in it")
    return wire, looks


def _lines(path: Path) -> tuple[str, list[str]]:
    """Return the kind of wire of a recording and its lines below the first."""
    try:
        first, *lines = path.read_text(encoding="utf-8").splitlines() or [""]
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or 'not text'}") from None
    if first not in (f"{HEAD}can", f"{HEAD}serial"):
        raise ConfigError(f'{path}: no recorded traffic; a first line "{HEAD}can" or "{HEAD}serial" needed')
    return first.removeprefix(HEAD), lines
