"""The object dictionary of the CANopen node, generated from the one table of `registers`.

Every application object is a register; the dictionary adds the objects that CiA 301 requires of every node.
"""

from collections.abc import Iterable, Iterator, Sequence

from canopen import ObjectDictionary
from canopen.objectdictionary import ODArray, ODRecord, ODVariable, datatypes

from plc_bridge.protocol.registers import DEVICE_NAME, RPDOS, TPDOS, VERSION_MAJOR, VERSION_MINOR, Register

ERROR_REGISTER, CONSUMER, PRODUCER, ON_ERROR = 0x1001, 0x1016, 0x1017, 0x1029
TPDO_PARAMETER, INHIBIT, EVENT_TIMER = 0x1800, 3, 5
"""Object of the first TPDO's parameters; its sub-indices of inhibit time, 0.1 ms a count, and event timer, 1 ms a count."""
RPDO_BASES, TPDO_BASES = (0x200, 0x300, 0x400, 0x500), (0x180, 0x280, 0x380, 0x480)
"""COB-IDs of the predefined connection set, without the node-ID."""

_BLOCKS = {
    0x2000: "command",
    0x2001: "report",
    0x2002: "diagnostics",
    0x2003: "coils",
    0x2004: "discrete inputs",
    0x2005: "PackTags",
}
_U8, _U16, _U32, _TEXT = datatypes.UNSIGNED8, datatypes.UNSIGNED16, datatypes.UNSIGNED32, datatypes.VISIBLE_STRING
_TYPES = {
    "u16": _U16,
    "u32": _U32,
    "i32": datatypes.INTEGER32,
    "string": _TEXT,
    "bool": _U8,
}


def size_of(register: Register) -> int:
    """Return the number of bytes of a register on CAN."""
    return 1 if register.type == "bool" else 2 * register.words


def words_of(register: Register, data: bytes) -> list[int]:
    """Return the words of a value in a frame."""
    data = data.ljust(2 * register.words, b"\0") if register.type == "string" else data[::-1]
    return [int.from_bytes(data[place : place + 2]) for place in range(0, len(data), 2)]


def bytes_of(register: Register, words: Sequence[int]) -> bytes:
    """Return a value as bytes of a frame; the padding of a text is removed."""
    data = b"".join(word.to_bytes(2) for word in words)
    return data.rstrip(b"\0") if register.type == "string" else data[::-1]


def dictionary(registers: Sequence[Register], node_id: int = 0) -> ObjectDictionary:
    """Return the dictionary; with node-ID 0 the COB-IDs are relative to the node-ID, as in an EDS.

    Args:
        registers: The whole map.
        node_id: 1 to 127, or 0.
    """
    made: ObjectDictionary = ObjectDictionary()  # type: ignore[no-untyped-call]
    made.node_id = node_id or None
    revision = VERSION_MAJOR << 16 | VERSION_MINOR
    for found in (
        _variable("device type", 0x1000, 0, _U32, "const", 0),
        _variable("error register", ERROR_REGISTER, 0, _U8, "ro", 0),
        _variable("manufacturer device name", 0x1008, 0, _TEXT, "const", DEVICE_NAME),
        _cob("COB-ID EMCY", 0x1014, 0, 0x80, node_id),
        _group(
            ODArray("consumer heartbeat time", CONSUMER),
            [_variable("PLC", CONSUMER, 1, _U32, "rw", 0)],
        ),
        # Period of the node's heartbeat, ms, unless configured otherwise.
        _variable("producer heartbeat time", PRODUCER, 0, _U16, "rw", 100),
        _group(
            ODRecord("identity", 0x1018),
            [
                _variable("vendor-ID", 0x1018, 1, _U32, "ro", 0),
                _variable("product code", 0x1018, 2, _U32, "ro", 1),
                _variable("revision number", 0x1018, 3, _U32, "ro", revision),
            ],
        ),
        _group(
            ODArray("error behaviour", ON_ERROR),
            [_variable("communication error", ON_ERROR, 1, _U8, "rw", 0, high=2)],
        ),
        _group(
            ODRecord("SDO server parameter", 0x1200),
            [
                _cob("COB-ID client to server", 0x1200, 1, 0x600, node_id),
                _cob("COB-ID server to client", 0x1200, 2, 0x580, node_id),
            ],
        ),
        *_pdos(registers, "RPDO", 0x1400, RPDO_BASES, RPDOS, node_id),
        *_pdos(registers, "TPDO", TPDO_PARAMETER, TPDO_BASES, TPDOS, node_id),
        *(
            _group(ODRecord(name, index), [_application(r) for r in registers if r.index == index])
            for index, name in _BLOCKS.items()
        ),
    ):
        made.add_object(found)
    return made


def variables(objects: ObjectDictionary) -> Iterator[ODVariable]:
    """Yield every object or sub-object that has a value."""
    for found in objects.values():
        yield from [found] if isinstance(found, ODVariable) else found.subindices.values()


def _variable(
    name: str, index: int, subindex: int, kind: int, access: str, default: int | str | None, high: int | None = None
) -> ODVariable:
    made = ODVariable(name, index, subindex)
    made.data_type, made.access_type, made.max = kind, access, high
    made.default = default  # type: ignore[assignment]  # a default can also be a text
    return made


def _cob(name: str, index: int, subindex: int, base: int, node_id: int) -> ODVariable:
    made = _variable(name, index, subindex, _U32, "ro", base + node_id)
    made.relative = True
    return made


def _group(group: ODRecord | ODArray, members: Iterable[ODVariable]) -> ODRecord | ODArray:
    """Return a record or array with its members, and their highest sub-index as sub-index 0."""
    for member in members:
        group.add_member(member)
    group.add_member(_variable("highest sub-index", group.index, 0, _U8, "const", max(group.subindices)))
    return group


def _application(register: Register) -> ODVariable:
    access = "ro" if register.access == "r" else "rww" if register.pdo else "rw"
    high = 1 if register.type == "bool" else register.high
    made = _variable(register.name, register.index, register.subindex, _TYPES[register.type], access, None, high)
    made.min, made.pdo_mappable = register.low, bool(register.pdo)
    made.factor, made.unit = register.scale, register.unit
    return made


def _pdos(
    registers: Sequence[Register],
    kind: str,
    first: int,
    bases: Sequence[int],
    pdos: Sequence[Sequence[str]],
    node_id: int,
) -> list[ODRecord | ODArray]:
    """Return parameters and mapping of every PDO of a kind."""
    by_name = {register.name: register for register in registers}
    made = []
    for number, names in enumerate(pdos):
        place, base = first + number, bases[number]
        # Bit 30 of a COB-ID: remote requests are not permitted.
        parameters = [
            _cob("COB-ID", place, 1, base + (0x40000000 if kind == "TPDO" else 0), node_id),
            _variable("transmission type", place, 2, _U8, "ro", 254),  # event-driven
        ]
        if kind == "TPDO":
            # Inhibit time and event timer of each TPDO, in counts. The third TPDO carries the life counter, which
            # changes with every scan: its inhibit time limits its rate.
            inhibit, event = ((0, 500), (0, 500), (1000, 100), (0, 500))[number]
            parameters.append(_variable("inhibit time", place, INHIBIT, _U16, "rw", inhibit))
            parameters.append(_variable("event timer", place, EVENT_TIMER, _U16, "rw", event))
        made.append(_group(ODRecord(f"{kind}{number + 1} parameter", place), parameters))
        mapped = [
            _variable(name, place + 0x200, n, _U32, "const", r.index << 16 | r.subindex << 8 | 8 * size_of(r))
            for n, (name, r) in enumerate(((name, by_name[name]) for name in names), 1)
        ]
        made.append(_group(ODRecord(f"{kind}{number + 1} mapping", place + 0x200), mapped))
    return made
