"""What the node sends by itself, and when: pure."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from drivers.can_bus import CanFrame
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


class Reports:
    """The TPDOs: each goes out when it changes, no sooner than its inhibit time, and at least with its event timer.

    Args:
        registers: The whole map.
        node_id: Of the node.
        values: Its objects, for the timers.
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
        """Yield what is due; the one that answers a command goes last, when the rest is told.

        Args:
            words: The report block.
            now: Monotonic time, s.
        """
        for tpdo in reversed(self._tpdos):
            data = b"".join(number_in(words, r).to_bytes(size_of(r), "little") for r in tpdo.registers)
            if self._is_due(tpdo, data, now - tpdo.stamp):
                tpdo.sent, tpdo.stamp = data, now
                yield CanFrame(TPDO_BASES[tpdo.number] + self._node, data)

    def _is_due(self, tpdo: _Tpdo, data: bytes, age: float) -> bool:
        if tpdo.sent is None:
            return True
        parameters = TPDO_PARAMETER + tpdo.number
        if data != tpdo.sent and age >= self._values.get(parameters, INHIBIT) / 10_000:
            return True
        event = self._values.get(parameters, EVENT_TIMER) / 1000
        return event > 0.0 and age >= event
