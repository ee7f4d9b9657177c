"""A cell in held time whose clients are bytes: Modbus TCP, RTU and CAN through the bridge's own servers, no sockets, no threads."""

import asyncio
import struct
from dataclasses import dataclass, replace
from typing import Any

from drivers.transport.wires import CanFrame
from plc_bridge.bridge import Bridge
from plc_bridge.canopen.node import CanopenNode
from plc_bridge.config import CanConfig, ModbusConfig, PlcConfig, RtuConfig
from plc_bridge.modbus.connection import HEADER
from plc_bridge.modbus.rtu import RtuServer
from plc_bridge.modbus.rtu_frames import with_check_sum
from plc_bridge.modbus.server import ModbusServer
from plc_bridge.protocol.images import REPORT
from plc_bridge.protocol.messages import Command, Control, Refusal, Report, Result
from plc_bridge.protocol.registers import table

PROGRAMS = {100: "insert_peg", 101: "grasp_from_rack"}
REGISTERS = table(PROGRAMS)
STOPPED, IDLE, EXECUTE, ABORTED, COMPLETE = 2, 4, 6, 9, 17
PLC_LOST = 1006
NODE, PLC = 16, 1
READ_REPORT = struct.pack(">BHH", 4, REPORT.start, REPORT.words)
READ_INPUTS = bytes.fromhex("02 0000 0005")
STOPS = (Control.STOP, Control.ABORT)


def block(life: int, number: int, code: int) -> bytes:
    """Return the request that writes the head of the command block: life counter, number and code."""
    return struct.pack(">BHHB3H", 16, 0, 3, 6, life, number, code)


def word(address: int, value: int) -> bytes:
    """Return the request that writes one register."""
    return struct.pack(">BHH", 6, address, value)


def coil(address: int, is_on: bool) -> bytes:
    """Return the request that writes one coil."""
    return struct.pack(">BHH", 5, address, 0xFF00 if is_on else 0)


@dataclass
class Run:
    """A program that the scan thread began."""

    command: Command
    number: int
    began: int
    """Step at which it began."""
    result: Result = Result.NONE


class Cell:
    """A bridge, a CAN node and a serial line, and a scan thread that obeys as a supervisor does."""

    def __init__(self, **plc: float) -> None:
        self.now, self.step, self.runs = 0.0, 0, []
        self.plc = PlcConfig(**{"life_timeout": 1.0, "lease_timeout": 5.0, **plc})  # type: ignore[arg-type]
        self.start()

    def start(self) -> None:
        """Start the cell, again if it ran: it knows no connection, no number and no run."""
        self.bridge = Bridge(self.plc, PROGRAMS, now=self.time)
        self.tcp = ModbusServer(ModbusConfig(), self.bridge)
        self.tcp.loop = self  # type: ignore[assignment]
        self.serial = SerialWire()
        self.rtu = RtuServer(RtuConfig(port="-"), self.serial, self.bridge, now=self.time)
        self.frames: list[CanFrame] = []
        can = CanConfig(interface="virtual", channel="line", node_id=NODE, plc_node=PLC)
        self.node = CanopenNode(can, REGISTERS, self.bridge, self.frames.append)
        self.node.boot()
        self.running: Run | None = None
        self.report = Report(state=IDLE)
        self.bridge.publish(self.report)

    # The loop of the server.

    def time(self) -> float:
        return self.now

    def call_later(self, delay: float, function: Any) -> None:
        """Call at once: nobody here floods the server."""
        function()

    # The scan thread.

    def scan(self, seconds: float = 0.01) -> None:
        """Let time pass, then take every command that waits."""
        self.now += seconds
        while (command := self.bridge.poll()) is not None:
            self._take(command)
            self.bridge.publish(self.report)
        self.bridge.publish(self.report)
        self.node.tick(self.now)

    def wait(self, seconds: float) -> None:
        """Scan so long, every 50 ms."""
        for _ in range(round(seconds / 0.05)):
            self.scan(0.05)

    def end(self, result: Result = Result.SUCCESS, state: int = COMPLETE, fault: int = 0) -> None:
        """End the run under way, if there is one."""
        if self.running is None:
            self._show(state=state)
            return
        self.running.result = result
        number = self.running.number
        self.report = Report(
            sequence=self.running.command.sequence, state=state, result=result, fault=fault, run=number
        )
        self.running = None
        self.bridge.publish(self.report)

    def _take(self, command: Command) -> None:
        code, state = command.code, self.report.state
        if code in PROGRAMS:
            if state not in (IDLE, COMPLETE):
                self.bridge.refuse(command, Refusal.NOT_READY)
                return
            self.bridge.accept(command)
            self.running = Run(command, len(self.runs) + 1, self.step)
            self.runs.append(self.running)
            self.report = Report(sequence=command.sequence, state=EXECUTE, run=self.running.number)
        elif code == Control.LOST:
            if self.running is not None:
                self.end(Result.FAULT, ABORTED, PLC_LOST)
        elif code == Control.ACKNOWLEDGE:
            if state == COMPLETE:
                self._show(state=IDLE)
        elif code in STOPS:
            self.bridge.accept(command)
            self.end(Result.ABORTED, ABORTED if code == Control.ABORT or state == ABORTED else STOPPED)
        elif code == Control.RESET and state in (STOPPED, ABORTED, COMPLETE):
            self.bridge.accept(command)
            self.report = Report(sequence=command.sequence, state=IDLE, result=Result.SUCCESS)
        elif code > Control.CLEAR:
            self.bridge.accept(command)
        else:
            self.bridge.refuse(command, Refusal.NOT_READY)

    def _show(self, state: int) -> None:
        self.report = replace(self.report, state=state)
        self.bridge.publish(self.report)


class Client:
    """Whoever sends request PDUs and reads the answers."""

    def ask(self, request: bytes) -> bytes:
        """Send a request and return the response."""
        raise NotImplementedError

    def write(self, *blocks: tuple[int, int, int]) -> Any:
        """Write blocks of life counter, number and code, one request each, and return the report."""
        for each in blocks:
            self.ask(block(*each))
        return self.report()

    def report(self) -> Any:
        """Return the report block as values."""
        return REPORT.read(struct.unpack(f">{REPORT.words}H", self.ask(READ_REPORT)[2:]))


class SerialWire:
    """A serial line that a client and the server share."""

    port, character_time = "/dev/ttyPLC0", 11 / 9600

    def __init__(self) -> None:
        self.pieces: list[bytes] = []
        self.sent: list[bytes] = []
        self.waits: list[float] = []
        """Longest waits of the server, s."""

    def open(self) -> None: ...

    def close(self) -> None: ...

    def read(self, timeout: float) -> bytes:
        """Return what was sent to the server, one piece for each read."""
        self.waits.append(timeout)
        return self.pieces.pop(0) if self.pieces else b""

    def write(self, data: bytes) -> None:
        """Keep what the server sends."""
        self.sent.append(data)


class Rtu(Client):
    """A client on the serial line; every program on it is the same conversation."""

    def __init__(self, cell: Cell) -> None:
        self.cell = cell

    def open(self) -> None:
        """Do nothing: the next request opens the link."""

    def close(self) -> None:
        """Be silent for longer than the idle time-out."""
        self.cell.now += 61.0
        self.cell.rtu.turn()

    def ask(self, request: bytes) -> bytes:
        """Send a frame to unit 1 and return the PDU of the answer."""
        serial = self.cell.serial
        serial.pieces.append(with_check_sum(b"\x01" + request))
        serial.sent.clear()
        self.cell.rtu.turn()
        return serial.sent[0][1:-2]


class _Socket:
    def setsockopt(self, *_: int) -> None: ...


class _Transport(asyncio.Transport):
    def __init__(self, peer: tuple[str, int]) -> None:
        super().__init__({"peername": peer, "socket": _Socket()})
        self.sent = bytearray()
        self.is_aborted = False

    def write(self, data: Any) -> None:
        self.sent += data

    def abort(self) -> None:
        self.is_aborted = True

    def is_closing(self) -> bool:
        return self.is_aborted

    def set_write_buffer_limits(self, high: int | None = None, low: int | None = None) -> None: ...

    def pause_reading(self) -> None: ...

    def resume_reading(self) -> None: ...


class Tcp(Client):
    """A client on a TCP connection."""

    ports = iter(range(40_000, 10_000_000))

    def __init__(self, cell: Cell, host: str = "10.0.0.1") -> None:
        self.cell, self.host = cell, host
        self.open()

    def open(self) -> None:
        self.transport = _Transport((self.host, next(self.ports)))
        self.connection: Any = self.cell.tcp.receive()
        self.connection.connection_made(self.transport)

    def close(self) -> None:
        self.connection.connection_lost(None)

    def ask(self, request: bytes) -> bytes:
        """Send a request in one segment and return the PDU of the answer."""
        self.transport.sent.clear()
        self.connection.data_received(HEADER.pack(1, 0, len(request) + 1, 1) + request)
        return bytes(self.transport.sent[HEADER.size :])


class Can:
    """A PLC on CAN, which is the NMT master too."""

    def __init__(self, cell: Cell) -> None:
        self.cell = cell
        self.nmt(1)

    def give(self, cob: int, data: bytes) -> None:
        self.cell.node.receive(CanFrame(cob, data), self.cell.now)

    def nmt(self, command: int) -> None:
        """Send an NMT command: 1 start, 2 stop, 128 pre-operational, 129 reset."""
        self.give(0, bytes([command, NODE]))

    def write(self, *blocks: tuple[int, int, int]) -> Any:
        """Send RPDO 1 with life counter, number and code, and return the report."""
        for each in blocks:
            self.give(0x200 + NODE, struct.pack("<4H", *each, 0))
        return self.report()

    def report(self) -> Any:
        """Return the report as the node has it for its TPDOs."""
        return REPORT.read(self.cell.bridge.report_words(self.cell.node.source))
