"""The values behind the object dictionary, with their access, lengths and limits."""

from collections.abc import Callable, Mapping, Sequence

from canopen import ObjectDictionary, SdoAbortedError
from canopen.objectdictionary import ODVariable, datatypes

from plc_bridge.canopen.objects import bytes_of, size_of, variables, words_of
from plc_bridge.protocol.registers import Register
from plc_bridge.protocol.station import LinkStation

_NO_OBJECT, _NO_SUBINDEX, _READ_ONLY = 0x06020000, 0x06090011, 0x06010002
_TOO_SHORT, _TOO_HIGH, _TOO_LOW = 0x06070013, 0x06090031, 0x06090032


class Values:
    """The values behind the dictionary, as a client of the SDO server may access them.

    Args:
        dictionary: Dictionary of the node.
        registers: The whole map.
        station: Returns the present station, which holds the registers of the PLC's link.
        changed: Called with index and sub-index after a client has set an object that is not a register.
    """

    def __init__(
        self,
        dictionary: ObjectDictionary,
        registers: Sequence[Register],
        station: Callable[[], LinkStation],
        changed: Callable[[int, int], None],
    ) -> None:
        self._variables = {(v.index, v.subindex): v for v in variables(dictionary)}
        self._registers: Mapping[tuple[int, int], Register] = {(r.index, r.subindex): r for r in registers if r.index}
        self._station, self._changed = station, changed
        self._own: dict[tuple[int, int], int] = {}

    def reset(self) -> None:
        """Restore the defaults."""
        self._own.clear()

    def get(self, index: int, subindex: int = 0) -> int:
        """Return the value of a numeric object that is not a register."""
        return self._own.get((index, subindex), self._find(index, subindex).default or 0)

    def put(self, index: int, subindex: int, value: int) -> None:
        """Set a numeric object that is not a register, without a call of `changed`."""
        self._own[index, subindex] = value

    def read(self, index: int, subindex: int) -> bytes:
        """Return an object's value, little-endian.

        Raises:
            SdoAbortedError: The object does not exist.
        """
        variable = self._find(index, subindex)
        register = self._registers.get((index, subindex))
        if register is not None:
            return _read(self._station(), register)
        if variable.data_type == datatypes.VISIBLE_STRING:
            return str(variable.default).encode()
        return self.get(index, subindex).to_bytes(len(variable) // 8, "little")

    def room(self, index: int, subindex: int) -> int:
        """Return the largest number of bytes for a write to an object.

        Raises:
            SdoAbortedError: The object does not exist, or it is read-only.
        """
        variable = self._find(index, subindex)
        if not variable.writable:
            raise SdoAbortedError(_READ_ONLY)
        register = self._registers.get((index, subindex))
        return len(variable) // 8 if register is None else size_of(register)

    def write(self, index: int, subindex: int, data: bytes) -> None:
        """Set an object's value; `data` must not exceed its room.

        Raises:
            SdoAbortedError: The object does not exist, it is read-only, the value is too short, or beyond its
                limits.
        """
        room, variable = self.room(index, subindex), self._find(index, subindex)
        is_text = variable.data_type == datatypes.VISIBLE_STRING
        if len(data) < room and not is_text:
            raise SdoAbortedError(_TOO_SHORT)
        value = 0
        if not is_text:
            value = int.from_bytes(data, "little", signed=variable.data_type in datatypes.SIGNED_TYPES)
            if variable.max is not None and value > variable.max:
                raise SdoAbortedError(_TOO_HIGH)
            if variable.min is not None and value < variable.min:
                raise SdoAbortedError(_TOO_LOW)
        register = self._registers.get((index, subindex))
        if register is not None:
            _write(self._station(), register, data)
        else:
            self._own[index, subindex] = value
            self._changed(index, subindex)

    def _find(self, index: int, subindex: int) -> ODVariable:
        found = self._variables.get((index, subindex))
        if found is None:
            raise SdoAbortedError(_NO_SUBINDEX if (index, 0) in self._variables else _NO_OBJECT)
        return found


def _read(station: LinkStation, register: Register) -> bytes:
    if register.table in ("coil", "discrete"):
        return bytes(station.read_bits(1 if register.table == "coil" else 2, register.address, 1))
    return bytes_of(
        register, station.read_words(3 if register.table == "holding" else 4, register.address, register.words)
    )


def _write(station: LinkStation, register: Register, data: bytes) -> None:
    if register.table == "coil":
        station.write_bits(register.address, [bool(data[0])])
    else:
        station.write_words(register.address, words_of(register, data))
