"""The mailbox between the scan thread and the PLC: the one place where the two threads meet.

One lock guards the handshake; every method takes it for a few microseconds and waits for nothing else.
"""

import logging
import math
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from drivers.errors import CellError
from drivers.transport.serial_line import SerialLine
from plc_bridge.answers import report_image_of
from plc_bridge.config import CanConfig, PlcConfig
from plc_bridge.handshake import Handshake
from plc_bridge.images import CommandImage, Diagnostics, ReportImage, diagnostics_words, report_words
from plc_bridge.intervals import Intervals
from plc_bridge.messages import Command, Refusal, Report
from plc_bridge.modbus import ModbusServer
from plc_bridge.modbus_tls import SecureModbusServer
from plc_bridge.peer_log import PeerLog
from plc_bridge.registers import DISCRETE_INPUTS, Parameter, Register, table
from plc_bridge.rtu import RtuServer
from plc_bridge.sight import PlcSight

if TYPE_CHECKING:
    from plc_bridge.canopen import CanopenServer

SCANNED_WITHIN = 1.0
"""Age of the last report up to which the cell counts as scanned, s; ten periods of the slowest scan."""


@dataclass(frozen=True, slots=True)
class Figures:
    """Counts and times since the start."""

    counts: Diagnostics
    state: int
    """PackML state number of the cell."""
    processed: int
    """Insertions that have ended."""
    defective: int
    """Number of insertions that did not end in success."""
    state_times: tuple[float, ...]
    """Time in each state from 1 on, s."""
    scan_counts: tuple[int, ...]
    """Numbers of intervals between two scans, in the ranges that end at `intervals.BOUNDS`."""
    scan_total: float
    """Sum of those intervals, s."""
    scan_longest: float
    """Longest of those intervals, s."""
    served: float
    """Time that the Modbus TCP servers spent on requests, s."""


class Bridge:
    """Commands for the scan thread, reports for everybody else.

    Constructing touches nothing. `start` opens the sockets; `poll` and `publish` belong to the scan thread, which
    calls each once a scan.

    Args:
        config: Addresses to listen on, and the time-outs.
        programs: Name of each program and skill by its command code, from 100 on.
        parameters: Meaning of the numbered parameters, at most eight.
        now: Monotonic time, s.
    """

    def __init__(
        self,
        config: PlcConfig,
        programs: Mapping[int, str],
        parameters: Sequence[Parameter] = (),
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        self._now = now
        self._lock = threading.Lock()
        self._handshake = Handshake(
            dict(programs),
            tuple(parameters),
            config.life_timeout,
            config.lease_timeout,
            log=PeerLog(logging.getLogger("plc_bridge.handshake"), now),
        )
        self._life = 0
        self._published = -math.inf
        self._intervals = Intervals()
        self._server = ModbusServer(config.modbus, self)
        self._servers: list[ModbusServer | RtuServer | CanopenServer] = [self._server]
        self._secure: SecureModbusServer | None = None
        if config.tls is not None:
            self._secure = SecureModbusServer(config.tls, self)
            self._servers.append(self._secure)
        if config.rtu is not None:
            line = SerialLine(config.rtu.port, config.rtu.baud_rate, config.rtu.parity, config.rtu.stop_bits)
            self._servers.append(RtuServer(config.rtu, line, self))
        if config.can is not None:
            self._servers.append(_canopen_server(config.can, table(programs, parameters), self))

    def start(self) -> None:
        """Listen for the PLC.

        Raises:
            DeviceNotOpenedError: A port is in use or missing, or the address is not this computer's.
        """
        try:
            for server in self._servers:
                server.start()
        except CellError:
            self.close()
            raise

    def close(self) -> None:
        """Stop listening and drop every connection; may be called again."""
        for server in self._servers:
            server.close()

    @property
    def address(self) -> tuple[str, int]:
        """Host and port that the server listens on."""
        return self._server.address

    @property
    def secure_address(self) -> tuple[str, int] | None:
        """Host and port of the TLS server; None where it is off."""
        return self._secure.address if self._secure is not None else None

    def poll(self) -> Command | None:
        """Return the next thing for the scan thread to do, each once; stops and a lost PLC come first.

        Whatever it is, the scan thread tells before its next `poll` whether it accepts or refuses it.
        """
        with self._lock:
            return self._handshake.poll(self._now())

    def publish(self, report: Report) -> None:
        """Show `report` to everybody; a result in it ends the command whose sequence number it echoes."""
        with self._lock:
            self._life, self._published = (self._life + 1) % 0x10000, self._now()
            self._handshake.publish(report)
            self._intervals.note(self._published)
            self._handshake.tags.publish(report, self._published)

    def accept(self, command: Command) -> None:
        """Tell whoever sent `command` that it is done: a program begins, a control is obeyed; for the scan thread."""
        with self._lock:
            self._handshake.accept(command)

    def refuse(self, command: Command, refusal: Refusal) -> None:
        """Tell whoever sent `command` why the scan thread does not do it; it belongs to the scan thread."""
        with self._lock:
            self._handshake.refuse(command, refusal)

    @property
    def is_scanned(self) -> bool:
        """Whether a report was published within the last moment."""
        with self._lock:
            return self._now() - self._published < SCANNED_WITHIN

    @property
    def holder(self) -> str:
        """Name of the link that holds the lease; empty when it is free."""
        with self._lock:
            return self._handshake.holder

    @property
    def kept(self) -> frozenset[str]:
        """The links that hold the lease or have a run under way: nobody takes their places."""
        with self._lock:
            return self._handshake.kept

    @property
    def run(self) -> int:
        """Number in the journal of the run under way or last, whoever started it."""
        return self._handshake.run

    @property
    def figures(self) -> Figures:
        """Counts and times since the start, as they stand now."""
        counts = self.diagnostics
        served = self._server.worked + (self._secure.worked if self._secure is not None else 0.0)
        with self._lock:
            intervals, tags = self._intervals, self._handshake.tags
            return Figures(
                counts,
                tags.state,
                tags.processed,
                tags.defective,
                tags.times,
                tuple(intervals.counts),
                intervals.total,
                intervals.longest,
                served,
            )

    @property
    def diagnostics(self) -> Diagnostics:
        """Counts since the start."""
        with self._lock:
            counts, stops_held = self._handshake.counts, self._handshake.stops_held
        total = Diagnostics(refusals=counts.refusals, torn=counts.torn, lost=counts.lost, stops_held=stops_held)
        for server in self._servers:
            total = total + server.counts
        return total

    def sight(self, host: str) -> PlcSight | None:
        """Return what is seen of the PLC at `host`, an address, node or line; None while it is not there."""
        with self._lock:
            return self._handshake.sight(host, self._now())

    def take(self, source: str) -> bool:
        """Give the lease to a user of this process, as "terminal"; return whether it was free."""
        with self._lock:
            self._handshake.opened(source, source, self._now(), is_local=True)
            is_taken = self._handshake.take(source)
            if not is_taken:
                self._handshake.closed(source)
            return is_taken

    def submit(self, source: str, image: CommandImage) -> Refusal:
        """Pass on a command of the local user `source` that holds the lease; return why it was refused, or NONE."""
        with self._lock:
            return self._handshake.submit(source, image, self._now())

    def release(self, source: str) -> None:
        """Give back the lease of a local user."""
        with self._lock:
            self._handshake.release(source)
            self._handshake.closed(source)

    def opened(self, source: str, host: str) -> None:
        """Begin a link, for a server."""
        with self._lock:
            self._handshake.opened(source, host, self._now())

    def closed(self, source: str) -> None:
        """End a link, for a server."""
        with self._lock:
            self._handshake.closed(source)

    def lost(self, source: str) -> None:
        """Take a link for lost, for a server: its heartbeat has ended."""
        with self._lock:
            self._handshake.lost(source)

    def wrote(self, source: str, image: CommandImage, is_numbered: bool = True) -> None:
        """Take the command block after a write, for a server; numbered once its sequence register was written."""
        with self._lock:
            self._handshake.wrote(source, image, self._now(), is_numbered)

    def switched(self, source: str, coils: Mapping[str, bool]) -> None:
        """Take the coils just written, for a server."""
        with self._lock:
            self._handshake.switched(source, coils, self._now())

    def heard(self, source: str) -> None:
        """Note that a request came, for a server."""
        with self._lock:
            self._handshake.heard(source, self._now())

    def report_for(self, source: str) -> ReportImage:
        """Return the report as the link `source` shall read it, for a server."""
        with self._lock:
            answer, life = self._handshake.answer(source), self._life
        return report_image_of(answer, life)

    def report_words(self, source: str) -> list[int]:
        """Return the report block as the link `source` shall read it, for a server."""
        return report_words(self.report_for(source))

    def diagnostics_words(self) -> list[int]:
        """Return the diagnostics block, for a server."""
        return diagnostics_words(self.diagnostics)

    def packml_words(self) -> list[int]:
        """Return the block of PackTags, for a server."""
        with self._lock:
            return self._handshake.tags.words()

    def discrete_inputs(self, source: str) -> list[bool]:
        """Return the discrete inputs, for a server."""
        with self._lock:
            inputs = self._handshake.inputs(source)
        return [getattr(inputs, name) for name in DISCRETE_INPUTS]


def _canopen_server(config: CanConfig, registers: Sequence[Register], bridge: Bridge) -> "CanopenServer":
    # Imported here: the libraries of CAN take 0.1 s, which only a cell with CANopen spends.
    from drivers.transport.can_bus import CanBus
    from plc_bridge.canopen import CanopenServer

    return CanopenServer(config, registers, CanBus(config.interface, config.channel, config.bitrate), bridge)
