"""The cell as a CANopen node (CiA 301): pure, frames in and out, time passed in; no bus, no threads.

    | NMT state       | SDO | RPDO 1, 2 | stop object | TPDO | EMCY | heartbeat |
    | --------------- | --- | --------- | ----------- | ---- | ---- | --------- |
    | pre-operational | yes |           | yes         |      | yes  | yes       |
    | operational     | yes | yes       | yes         | yes  | yes  | yes       |
    | stopped         |     |           | yes         |      |      | yes       |

A stop needs no permission: the node obeys the stop object, its last RPDO, in every state and from every sender. This
goes beyond CiA 301. All senders use the same single byte 1, so that simultaneous frames do not collide in their data.

The PLC is one node with one link. If the PLC's heartbeat is lost, or if the cell's node leaves the state operational, the
PLC's run stops. At the PLC's boot-up the link begins again, so that its next sequence number is adopted and not run.
"""

import logging
from collections.abc import Callable, Sequence
from enum import IntEnum

from canopen import SdoAbortedError

from drivers.transport.wires import CanFrame
from plc_bridge.canopen.emcy import BUS_RECOVERED, HEARTBEAT_LOST, NO_ERROR, PDO_NOT_PROCESSED, PDO_TOO_SHORT, Emergency
from plc_bridge.canopen.heartbeat import HeartbeatConsumer, HeartbeatProducer
from plc_bridge.canopen.object_values import Values
from plc_bridge.canopen.objects import (
    CONSUMER,
    ERROR_REGISTER,
    ON_ERROR,
    PRODUCER,
    RPDO_BASES,
    dictionary,
    size_of,
    words_of,
)
from plc_bridge.canopen.pdo import Reports
from plc_bridge.canopen.sdo import ABORT, SdoServer
from plc_bridge.config import CanConfig
from plc_bridge.protocol.mailbox import Mailbox
from plc_bridge.protocol.messages import Diagnostics
from plc_bridge.protocol.peer_log import PeerLog
from plc_bridge.protocol.registers import RPDOS, Register
from plc_bridge.protocol.station import LinkStation, LinkWords

logger = logging.getLogger(__name__)

ANYBODY = "CAN stop object"
"""Source name of a stop with an unknown sender."""
_EMCY, _SDO_ANSWER, _SDO_REQUEST, _HEARTBEAT = 0x080, 0x580, 0x600, 0x700


class NmtState(IntEnum):
    """States of a node, as in its heartbeat."""

    INITIALISING = 0
    STOPPED = 4
    OPERATIONAL = 5
    PRE_OPERATIONAL = 127


_STATE_BY_COMMAND = {1: NmtState.OPERATIONAL, 2: NmtState.STOPPED, 128: NmtState.PRE_OPERATIONAL}
_STATE_ON_ERROR = {0: NmtState.PRE_OPERATIONAL, 2: NmtState.STOPPED}
"""State after an error, by the value of object 0x1029; value 1 keeps the state. No error changes the state stopped."""


class CanopenNode:
    """The cell as one CANopen node.

    Args:
        config: Node-IDs and heartbeat times.
        registers: The whole map.
        mailbox: The bridge.
        send: Sends a frame, or drops it if there is no bus.
    """

    def __init__(
        self,
        config: CanConfig,
        registers: Sequence[Register],
        mailbox: Mailbox,
        send: Callable[[CanFrame], None],
    ) -> None:
        self._config, self._id, self._mailbox, self._send = config, config.node_id, mailbox, send
        self.counts = Diagnostics()
        self.state = NmtState.INITIALISING
        self.source = f"node {config.plc_node}"
        by_name = {register.name: register for register in registers}
        self._rpdos = {
            base + self._id: [by_name[name] for name in names] for base, names in zip(RPDO_BASES, RPDOS, strict=False)
        }
        self._stop_id = RPDO_BASES[len(RPDOS) - 1] + self._id
        self._fault = by_name["report_fault"]
        self._station = LinkStation(mailbox, LinkWords(self.source), self.counts)
        self._anybody = LinkStation(mailbox, LinkWords(ANYBODY), self.counts)
        self._values = Values(dictionary(registers, self._id), registers, lambda: self._station, self._changed)
        self._reports = Reports(registers, self._id, self._values)
        self._sdo = SdoServer(self._values)
        self._producer = HeartbeatProducer(config.heartbeat)
        self._consumer = HeartbeatConsumer(config.plc_node, config.plc_timeout)
        self._emergency = Emergency()
        self._told: set[int] = set()
        self._log = PeerLog(logger)

    # Calls from outside.

    def boot(self) -> None:
        """Start the node: open the links, send the boot-up message, and wait in pre-operational for the NMT master."""
        self._mailbox.opened(ANYBODY, ANYBODY)
        self._reset()

    def shut(self) -> None:
        """End the links."""
        self._mailbox.closed(ANYBODY)
        self._mailbox.closed(self.source)

    def recover(self) -> None:
        """Continue after a loss of the bus: send every report again, and an emergency message."""
        self._sdo.reset()
        self._reports.repeat()
        self._shout(self._emergency.message(BUS_RECOVERED))

    def receive(self, frame: CanFrame, now: float) -> None:
        """Process one frame of the bus; frames with identifiers of 29 bits are ignored."""
        cob, data = frame.id, frame.data
        if frame.is_extended:
            return
        if cob == 0:
            self._command(data)
        elif cob == _SDO_REQUEST + self._id:
            self._take_request(data, now)
        elif cob == _HEARTBEAT + self._consumer.node:
            self._hear(data, now)
        elif cob in self._rpdos:
            self._take_rpdo(cob, data, now)

    def tick(self, now: float, has_read_all: bool = True) -> None:
        """Do what is due: heartbeat, watch of the PLC if all its frames have been read, emergency, reports."""
        if has_read_all and self._consumer.has_lost(now):
            self._lose_plc()
        if self.state is NmtState.INITIALISING:
            return
        if self._producer.is_due(now):
            self._send(CanFrame(_HEARTBEAT + self._id, bytes([self.state])))
        self._publish(now)

    # NMT and error control.

    def _command(self, data: bytes) -> None:
        if len(data) != 2:
            self._reject(0, data)
            return
        command, node = data
        if node not in (0, self._id):
            return
        if command in (129, 130):  # reset of the node, of its communication
            self._enter(NmtState.INITIALISING)
            self._reset()
        elif command in _STATE_BY_COMMAND:
            self._enter(_STATE_BY_COMMAND[command])

    def _reset(self) -> None:
        config = self._config
        self._values.reset()
        self._values.put(PRODUCER, 0, round(1000 * config.heartbeat))
        self._values.put(CONSUMER, 1, config.plc_node << 16 | round(1000 * config.plc_timeout))
        self._sdo.reset()
        self._consumer = HeartbeatConsumer(config.plc_node, config.plc_timeout)
        self._emergency = Emergency()
        self._begin_link(config.plc_node)
        self._send(CanFrame(_HEARTBEAT + self._id, bytes([NmtState.INITIALISING])))
        self.state = NmtState.PRE_OPERATIONAL
        self._producer = HeartbeatProducer(config.heartbeat)

    def _enter(self, state: NmtState) -> None:
        if state is self.state:
            return
        self._log.info(self.source, "CANopen node %d: %s", self._id, state.name)
        if self.state is NmtState.OPERATIONAL:
            self._mailbox.lost(self.source)
        self.state = state
        self._reports.repeat()
        if state is NmtState.STOPPED:
            self._sdo.reset()
        self._producer = HeartbeatProducer(self._producer.period)

    def _hear(self, data: bytes, now: float) -> None:
        if len(data) != 1:
            self._reject(_HEARTBEAT + self._consumer.node, data)
            return
        if data[0] == NmtState.INITIALISING:
            self._begin_link(self._consumer.node)
        if self._consumer.hear(now):
            self.counts.accepted += 1
            self.counts.connections = 1
            self._log.info(self.source, "%s is there", self.source)
            if self._emergency.is_plc_lost:
                self._emergency.is_plc_lost = False
                self._shout(self._emergency.message(NO_ERROR))
        self._mailbox.heard(self.source)

    def _lose_plc(self) -> None:
        self._log.warning(self.source, "%s: no heartbeat for %g s", self.source, self._consumer.timeout)
        self.counts.dropped += 1
        self.counts.connections = 0
        self._mailbox.lost(self.source)
        self._emergency.is_plc_lost = True
        self._shout(self._emergency.message(HEARTBEAT_LOST))
        state = _STATE_ON_ERROR.get(self._values.get(ON_ERROR, 1))
        if state is not None and self.state in (NmtState.OPERATIONAL, NmtState.PRE_OPERATIONAL):
            self._enter(state)

    # SDO.

    def _take_request(self, data: bytes, now: float) -> None:
        if self.state not in (NmtState.PRE_OPERATIONAL, NmtState.OPERATIONAL):
            return
        if len(data) != 8:
            self._reject(_SDO_REQUEST + self._id, data)
            return
        self._mailbox.heard(self.source)
        self.counts.requests += 1
        response = self._sdo.answer(data, now)
        if response is not None and response[0] == ABORT:
            self._tell_abort(response)
        self._publish(now)
        if response is not None:
            self._send(CanFrame(_SDO_ANSWER + self._id, response))

    def _tell_abort(self, response: bytes) -> None:
        self.counts.exceptions += 1
        code = int.from_bytes(response[4:], "little")
        if code not in self._told:
            self._told.add(code)
            index, why = int.from_bytes(response[1:3], "little"), SdoAbortedError(code)
            logger.warning("%s: SDO %04Xsub%X refused: %s", self.source, index, response[3], why)

    def _reject(self, cob: int, data: bytes) -> bool:
        """Count a frame of a wrong length; return True if it is the first such frame with this COB-ID."""
        self.counts.malformed += 1
        is_first = cob not in self._told
        if is_first:
            self._told.add(cob)
            logger.warning("CANopen node %d: frame 0x%03X left: %d bytes", self._id, cob, len(data))
        return is_first

    def _changed(self, index: int, subindex: int) -> None:
        value = self._values.get(index, subindex)
        if index == PRODUCER:
            self._producer = HeartbeatProducer(value / 1000)
        elif index == CONSUMER:
            node = value >> 16
            if node and node != self._consumer.node:
                self._begin_link(node)
            self._consumer = HeartbeatConsumer(node, (value & 0xFFFF) / 1000)

    # PDO and EMCY.

    def _take_rpdo(self, cob: int, data: bytes, now: float) -> None:
        registers, is_stop = self._rpdos[cob], cob == self._stop_id
        if self.state is not NmtState.OPERATIONAL and not is_stop:
            return
        if len(data) < sum(map(size_of, registers)):
            if self._reject(cob, data):
                self._shout(self._emergency.message(PDO_TOO_SHORT))
            return
        self.counts.requests += 1
        if is_stop:
            self._anybody.write_bits(registers[0].address, [bool(data[0])])
            self._anybody.write_bits(registers[0].address, [False])  # no sender has to release the stop with a 0
            return
        words = []
        for register in registers:
            words += words_of(register, data[: size_of(register)])
            data = data[size_of(register) :]
        self._mailbox.heard(self.source)
        try:
            self._station.write_words(registers[0].address, words)
        except ValueError:  # the station has logged the reason
            self.counts.exceptions += 1
            self._shout(self._emergency.message(PDO_NOT_PROCESSED))
        self._publish(now)

    def _publish(self, now: float) -> None:
        """Send the emergency and the reports that are due; the report with the answer to a command goes last."""
        if self.state not in (NmtState.PRE_OPERATIONAL, NmtState.OPERATIONAL):
            return
        words = self._mailbox.report_words(self.source)
        message = self._emergency.update(words[self._fault.address], self._mailbox.run)
        if message is not None:
            self._shout(message)
        if self.state is not NmtState.OPERATIONAL:
            return
        for frame in self._reports.due(words, now):
            self._send(frame)

    def _shout(self, message: bytes) -> None:
        self._values.put(ERROR_REGISTER, 0, self._emergency.register)
        if self.state in (NmtState.PRE_OPERATIONAL, NmtState.OPERATIONAL):
            self._send(CanFrame(_EMCY + self._id, message))

    # The PLC's link.

    def _begin_link(self, node: int) -> None:
        self._mailbox.closed(self.source)
        self._told.clear()
        self.source = f"node {node}"
        self._mailbox.opened(self.source, self.source)
        self._station = LinkStation(self._mailbox, LinkWords(self.source), self.counts)
        self._reports.repeat()
