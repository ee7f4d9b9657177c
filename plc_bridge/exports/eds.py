"""The electronic data sheet of the CANopen node (CiA 306) for a PLC's configuration tool."""

import textwrap
from collections.abc import Iterator, Mapping, Sequence

from canopen import ObjectDictionary
from canopen.objectdictionary import ODArray, ODVariable, datatypes

from plc_bridge.canopen.objects import dictionary
from plc_bridge.config import BITRATES
from plc_bridge.protocol.registers import (
    DEVICE_NAME,
    RPDOS,
    TPDOS,
    VERSION_DATE,
    VERSION_MAJOR,
    VERSION_MINOR,
    Register,
)

_VAR, _ARRAY, _RECORD = 7, 8, 9


def as_eds(registers: Sequence[Register]) -> str:
    """Return the data sheet of a node with this map, the same for every node-ID."""
    objects = dictionary(registers)
    by_place = {(register.index, register.subindex): register for register in registers}
    year, month, day = VERSION_DATE.split("-")
    time, date = "12:00AM", f"{month}-{day}-{year}"
    lines = [
        *_section(
            "FileInfo",
            {
                "FileName": "tactile_insertion_cell.eds",
                "FileVersion": VERSION_MAJOR,
                "FileRevision": VERSION_MINOR,
                "EDSVersion": "4.0",
                "Description": f"{DEVICE_NAME}, register map {VERSION_MAJOR}.{VERSION_MINOR}",
                "CreationTime": time,
                "CreationDate": date,
                "CreatedBy": "cell map",
                "ModificationTime": time,
                "ModificationDate": date,
                "ModifiedBy": "cell map",
            },
        ),
        *_section("DeviceInfo", _device(objects)),
        # 1 would permit a data type as filler of gaps in a PDO; the mapping is fixed, so no type is permitted.
        *_section("DummyUsage", {f"Dummy{number:04d}": 0 for number in range(1, 8)}),
        *_section("Comments", {"Lines": 1, "Line1": "made by `cell map --format eds`"}),
    ]
    for name in ("MandatoryObjects", "OptionalObjects", "ManufacturerObjects"):
        indices = [index for index in objects if _list_of(index) == name]
        numbered = {str(n): f"0x{index:04X}" for n, index in enumerate(indices, 1)}
        lines += _section(name, {"SupportedObjects": len(indices), **numbered})
        for index in indices:
            lines += _object(objects, index, by_place)
    return "\r\n".join(lines)  # CiA 306 requires lines that end with CR LF


def _list_of(index: int) -> str:
    if index in range(0x2000, 0x6000):
        return "ManufacturerObjects"
    return "MandatoryObjects" if index in (0x1000, 0x1001, 0x1018) else "OptionalObjects"


def _section(name: str, entries: Mapping[str, object], comment: str = "") -> Iterator[str]:
    # Longest comment line, characters; CiA 306 allows 255.
    for line in textwrap.wrap(comment, 200):
        yield f"; {line}"
    yield f"[{name}]"
    for key, value in entries.items():
        yield f"{key}={value}"
    yield ""


def _device(objects: ObjectDictionary) -> dict[str, object]:
    identity = objects[0x1018]
    assert not isinstance(identity, ODVariable)
    return {
        "VendorName": "none",
        "VendorNumber": identity[1].default,
        "ProductName": DEVICE_NAME,
        "ProductNumber": identity[2].default,
        "RevisionNumber": identity[3].default,
        "OrderCode": "none",
        **{f"BaudRate_{rate // 1000}": 1 for rate in BITRATES},
        "SimpleBootUpMaster": 0,
        "SimpleBootUpSlave": 1,
        "Granularity": 0,
        "DynamicChannelsSupported": 0,
        "GroupMessaging": 0,
        "NrOfRXPDO": len(RPDOS),
        "NrOfTXPDO": len(TPDOS),
        "LSS_Supported": 0,
    }


def _object(objects: ObjectDictionary, index: int, by_place: Mapping[tuple[int, int], Register]) -> Iterator[str]:
    found = objects[index]
    if isinstance(found, ODVariable):
        yield from _section(f"{index:04X}", _entries(found))
        return
    kind = _ARRAY if isinstance(found, ODArray) else _RECORD
    head = {"ParameterName": found.name, "ObjectType": f"0x{kind:X}", "SubNumber": len(found.subindices)}
    yield from _section(f"{index:04X}", head)
    for subindex in sorted(found.subindices):
        register = by_place.get((index, subindex))
        entries = _entries(found.subindices[subindex])
        yield from _section(f"{index:04X}sub{subindex:X}", entries, register.told if register else "")


def _entries(variable: ODVariable) -> dict[str, object]:
    entries: dict[str, object] = {
        "ParameterName": variable.name,
        "ObjectType": f"0x{_VAR:X}",
        "DataType": f"0x{variable.data_type:04X}",
        "AccessType": variable.access_type,
    }
    if variable.min is not None:
        entries["LowLimit"] = variable.min
    if variable.max is not None:
        entries["HighLimit"] = variable.max
    if variable.default is not None:
        entries["DefaultValue"] = _default(variable)
    entries["PDOMapping"] = int(variable.pdo_mappable)
    return entries


def _default(variable: ODVariable) -> str:
    if variable.relative:
        return f"$NODEID+0x{variable.default:X}"
    is_hexadecimal = variable.data_type == datatypes.UNSIGNED32
    return f"0x{variable.default:08X}" if is_hexadecimal else str(variable.default)
