"""The PLC's side of the map over CANopen: NMT master, heartbeat, PDOs, SDO; for demos and tests of the line."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import canopen
from canopen.pdo import PdoMap

from drivers.transport.can_bus import CanBus
from drivers.transport.wires import CanFrame, CanLostError
from plc_bridge.canopen.heartbeat import HeartbeatProducer
from plc_bridge.canopen.node import NmtState
from plc_bridge.canopen.objects import RPDO_BASES, bytes_of, dictionary
from plc_bridge.config import CanConfig
from plc_bridge.peer import CellSilentError, Peer
from plc_bridge.protocol.images import REPORT, CommandImage, Value, command_words
from plc_bridge.protocol.messages import Diagnostics, Report
from plc_bridge.protocol.registers import RPDOS, Register, table

_NEWS = tuple(
    f"report_{name}" for name in ("run", "stage", "result", "total_time", "state", "sequence", "answered", "refusal")
)
"""Registers received by PDO; when one changes, the remaining registers are read again."""
_BY_SDO = tuple(
    register.name
    for register in table()
    if register.name.startswith("report_")
    and (not register.pdo or register.name == "report_total_time")
    and register.name not in ("report_holder", "report_life_tail")
)
"""Registers of the report that no PDO carries, and the time, which arrives late by its inhibit time."""
_READ_TIMEOUT, _NMT_PERIOD = 0.01, 0.2  # s


class _Wire(canopen.Network):
    """canopen's network on a bus of this project; its own reading thread also sends the heartbeat."""

    def __init__(self, bus: CanBus, node: int, heartbeat: float) -> None:
        super().__init__()
        self._line, self._node = bus, node
        self.producer = HeartbeatProducer(heartbeat)
        self._stop = threading.Event()
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self._serve, name="plc", daemon=True)

    def begin(self) -> None:
        self.send_message(0x700 + self._node, bytes([NmtState.INITIALISING]))
        self._thread.start()

    def end(self) -> None:
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        with self._lock:
            self._line.write(CanFrame(can_id, bytes(data)))

    def _serve(self) -> None:
        try:
            while not self._stop.is_set():
                frame = self._line.read(_READ_TIMEOUT)
                if frame is not None and not frame.is_extended:
                    self.notify(frame.id, bytearray(frame.data), time.time())
                if self.producer.is_due(time.monotonic()):
                    self.send_message(0x700 + self._node, bytes([NmtState.OPERATIONAL]))
        except CanLostError:
            return  # the waiting caller times out


class CanPeer(Peer):
    """A PLC on CAN, which is also the NMT master: a peer that connects, reads and writes in another way.

    Args:
        config: Config of the cell: the bus, the cell's node-ID and the PLC's, which this node uses.
        period: Time between two cycles while waiting, s.
        timeout: Longest wait for one answer, s.
        wait: Waits this number of seconds.
    """

    def __init__(
        self,
        config: CanConfig,
        *,
        period: float = 0.02,
        timeout: float = 3.0,
        wait: Callable[[float], None] = time.sleep,
    ) -> None:
        super().__init__(config.channel, 0, wait=wait)
        self._where, self._period = f"CANopen node {config.node_id} on {config.interface} {config.channel}", period
        self._config, self._timeout = config, timeout
        self._places = {register.name: register for register in table()}
        self._bus = CanBus(config.interface, config.channel, config.bitrate)
        self._wire: _Wire | None = None
        self._node: canopen.RemoteNode | None = None
        self._sent = CommandImage()
        self._values: dict[str, int] = {}
        self._heard: set[str] = set()
        self._has_report = threading.Event()
        self._rest: tuple[tuple[Value, ...], dict[str, Value]] = ((), {})

    def close(self) -> None:
        """Stop sending and leave the bus; may be called again."""
        if self._wire is not None:
            self._wire.end()
            self._wire = self._node = None
        self._bus.close()

    def read_report(self) -> Report:
        """Return the report; writes nothing.

        Raises:
            CellSilentError: The cell does not answer, or its node is not operational and therefore sends no report.
        """
        # The cell sends its pending PDOs before it answers this request.
        holder = self._read("report_holder")
        if self._node is not None and self._node.nmt.state != "OPERATIONAL":
            raise CellSilentError(f"{self._where}: it is {self._node.nmt.state}")
        values: dict[str, Value] = dict(self._values)
        state = tuple(values[name] for name in _NEWS)
        if self._rest[0] != state:
            self._rest = state, {name: self._number(name) for name in _BY_SDO}
        values |= self._rest[1]
        values |= {"report_holder": holder.decode("ascii"), "report_life_tail": values["report_life"]}
        return REPORT.value_of(values)

    def read_diagnostics(self) -> Diagnostics:
        names = [name for name in self._places if name.startswith("diagnostics_")]
        return Diagnostics(**{name.removeprefix("diagnostics_"): int(self._number(name)) for name in names})

    def stop(self) -> None:
        with self._asking() as node:
            node.network.send_message(RPDO_BASES[len(RPDOS) - 1] + self._config.node_id, b"\x01")
        self._read("report_holder")

    def _open(self) -> None:
        config = self._config
        self._bus.open()
        self._sent = CommandImage()
        self._heard.clear()
        self._has_report.clear()
        self._wire = _Wire(self._bus, config.plc_node, config.heartbeat)
        self._node = canopen.RemoteNode(config.node_id, dictionary(table(), config.node_id))
        self._node.sdo.RESPONSE_TIMEOUT = self._timeout
        self._wire.add_node(self._node)
        for pdo in self._node.tpdo.values():
            pdo.read(from_od=True)
            pdo.add_callback(self._take)
        self._wire.begin()
        deadline = self._now() + self._timeout
        while not (self._has_report.is_set() and self._is_operational()):
            if self._now() > deadline:
                self.close()
                raise CellSilentError(f"{self._where}: no report: is `cell serve` running there?")
            self._node.nmt.state = "OPERATIONAL"  # repeated until it takes effect: the cell may boot later
            self._has_report.wait(min(_NMT_PERIOD, self._timeout))

    def _is_operational(self) -> bool:
        """Read the state from the node's next heartbeat; canopen's stored state may be a sent command instead of a received state."""
        assert self._node is not None
        try:
            return bool(self._node.nmt.wait_for_heartbeat(self._timeout) == "OPERATIONAL")
        except canopen.nmt.NmtError:
            return False

    def _take(self, pdo: PdoMap) -> None:
        for variable in pdo:
            self._values[self._name(variable.index, variable.subindex)] = int(variable.raw)
        self._heard.add(pdo.name)
        if self._node is None or len(self._heard) == len(self._node.tpdo):
            self._has_report.set()

    def _write(self, image: CommandImage) -> None:
        sent, self._sent = self._sent, image
        with self._asking() as node:
            for register, data in _by_sdo(image, sent, self._places):
                node.sdo.download(register.index, register.subindex, data)
            if (image.acknowledge, image.lease) != (sent.acknowledge, sent.lease):
                self._send_pdo(node, 1, image)
            self._send_pdo(node, 0, image)

    def _send_pdo(self, node: canopen.RemoteNode, number: int, image: CommandImage) -> None:
        values = (getattr(image, name.removeprefix("command_")) for name in RPDOS[number])
        data = b"".join(value.to_bytes(2, "little") for value in values)
        node.network.send_message(RPDO_BASES[number] + self._config.node_id, data)

    def _read(self, name: str) -> bytes:
        with self._asking() as node:
            return bytes(node.sdo.upload(self._places[name].index, self._places[name].subindex))

    def _number(self, name: str) -> int | float:
        place = self._places[name]
        count = int.from_bytes(self._read(name), "little", signed=place.type.startswith("i"))
        return count if place.scale == 1.0 else place.scale * count

    def _name(self, index: int, subindex: int) -> str:
        return next(r.name for r in self._places.values() if (r.index, r.subindex) == (index, subindex))

    @contextmanager
    def _asking(self) -> Iterator[canopen.RemoteNode]:
        if self._node is None:
            raise CellSilentError(f"{self._where}: not connected")
        try:
            yield self._node
        except (canopen.SdoAbortedError, canopen.SdoCommunicationError, CanLostError) as error:
            raise CellSilentError(f"{self._where}: {error}") from error


def _by_sdo(image: CommandImage, sent: CommandImage, places: dict[str, Register]) -> Iterator[tuple[Register, bytes]]:
    """Yield the changed registers that no PDO carries, as register and bytes."""
    new, old = command_words(image), command_words(sent)
    for register in places.values():
        if register.table != "holding" or register.pdo or not register.index:
            continue
        words = new[register.address : register.address + register.words]
        if words == old[register.address : register.address + register.words]:
            continue
        yield register, bytes_of(register, words) or b"\0"
