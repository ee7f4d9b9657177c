"""The PDOs that the node sends by itself, and their times; pure."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from drivers.transport.wires import CanFrame
from plc_bridge.object_values import Values
from plc_bridge.objects import EVENT_TIMER, INHIBIT, TPDO_BASES, TPDO_PARAMETER, number_in, size_of
from plc_bridge.registers import TPDOS, Register


@dataclass(slots=True)
class _Tpdo:
    """One PDO that the node sends."""

    number: int
    registers: Sequence[Register]
    sent: bytes | None = None
    stamp: float = 0.0

    def data(self, words: Sequence[int]) -> bytes:
        """Return the PDO's data in a report block."""
        return b"".join(number_in(words, r).to_bytes(size_of(r), "little") for r in self.registers)


class Reports:
    """The TPDOs: each goes out when it changes, no sooner than its inhibit time but with an answer, and at least with its event timer.

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
        """Let every report go out again, changed or not."""
        for tpdo in self._tpdos:
            tpdo.sent = None

    def due(self, words: Sequence[int], now: float) -> Iterator[CanFrame]:
        """Yield the PDOs that are due; the one that answers a command goes last, after the rest.

        Args:
            words: The report block.
            now: Monotonic time, s.
        """
        is_answering = self._is_free(self._tpdos[0], words, now)
        for tpdo in reversed(self._tpdos):
            data = tpdo.data(words)
            event = self._values.get(TPDO_PARAMETER + tpdo.number, EVENT_TIMER) / 1000
            # the parts of an answer go with it, although they were sent a moment ago
            is_due = self._is_free(tpdo, words, now) or (is_answering and data != tpdo.sent)
            if is_due or (event > 0.0 and now - tpdo.stamp >= event):
                tpdo.sent, tpdo.stamp = data, now
                yield CanFrame(TPDO_BASES[tpdo.number] + self._node, data)

    def _is_free(self, tpdo: _Tpdo, words: Sequence[int], now: float) -> bool:
        """Return whether it has something new to send, and its inhibit time is over."""
        inhibit = self._values.get(TPDO_PARAMETER + tpdo.number, INHIBIT) / 10_000
        return tpdo.sent is None or (tpdo.data(words) != tpdo.sent and now - tpdo.stamp >= inhibit)
