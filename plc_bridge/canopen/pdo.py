"""The PDOs that the node sends without a request, and their times; pure."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from drivers.transport.wires import CanFrame
from plc_bridge.canopen.object_values import Values
from plc_bridge.canopen.objects import EVENT_TIMER, INHIBIT, TPDO_BASES, TPDO_PARAMETER, bytes_of
from plc_bridge.protocol.registers import TPDOS, Register


@dataclass(slots=True)
class _Tpdo:
    """One PDO of the node."""

    number: int
    registers: Sequence[Register]
    sent: bytes | None = None
    stamp: float = 0.0

    def data(self, words: Sequence[int]) -> bytes:
        """Return the PDO's data from a report block."""
        return b"".join(bytes_of(r, words[r.address : r.address + r.words]) for r in self.registers)


class Reports:
    """The TPDOs, each due when its data change, and at least once per event timer.

    The inhibit time delays a TPDO, unless it is part of the answer to a command.

    Args:
        registers: The whole map.
        node_id: Node-ID of the cell.
        values: Objects of the node, for the timers.
    """

    def __init__(self, registers: Sequence[Register], node_id: int, values: Values) -> None:
        by_name = {register.name: register for register in registers}
        self._node, self._values = node_id, values
        self._tpdos = [_Tpdo(n, [by_name[name] for name in names]) for n, names in enumerate(TPDOS)]

    def repeat(self) -> None:
        """Send every report again, changed or not."""
        for tpdo in self._tpdos:
            tpdo.sent = None

    def due(self, words: Sequence[int], now: float) -> Iterator[CanFrame]:
        """Yield the PDOs that are due; the one with the answer to a command goes last.

        Args:
            words: The report block.
            now: Monotonic time, s.
        """
        is_answering = self._is_free(self._tpdos[0], words, now)
        for tpdo in reversed(self._tpdos):
            data = tpdo.data(words)
            event = self._values.get(TPDO_PARAMETER + tpdo.number, EVENT_TIMER) / 1000
            # the TPDOs with the other parts of an answer go with it, even within their inhibit time
            is_due = self._is_free(tpdo, words, now) or (is_answering and data != tpdo.sent)
            if is_due or (event > 0.0 and now - tpdo.stamp >= event):
                tpdo.sent, tpdo.stamp = data, now
                yield CanFrame(TPDO_BASES[tpdo.number] + self._node, data)

    def _is_free(self, tpdo: _Tpdo, words: Sequence[int], now: float) -> bool:
        """Return True if a TPDO must be sent again, or if its data have changed and its inhibit time is over."""
        inhibit = self._values.get(TPDO_PARAMETER + tpdo.number, INHIBIT) / 10_000
        return tpdo.sent is None or (tpdo.data(words) != tpdo.sent and now - tpdo.stamp >= inhibit)
