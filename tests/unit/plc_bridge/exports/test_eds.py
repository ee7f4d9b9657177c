"""The data sheet against canopen, Lely's checker for data sheets, and the rules of CiA 306."""

import configparser

import canopen
import pytest
from canopen.objectdictionary import ODVariable
from dcf.device import Device
from dcf.lint import lint
from dcf.parse import parse_file

from plc_bridge.canopen.objects import dictionary
from plc_bridge.exports.eds import as_eds
from plc_bridge.protocol.registers import RPDOS, TPDOS, VERSION_MAJOR, VERSION_MINOR, table
from tests.canopen_rig import NODE, REGISTERS


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("eds") / "cell.eds"
    path.write_text(as_eds(REGISTERS), encoding="ascii")
    return path


@pytest.fixture(scope="module")
def sheet(path):
    sheet = configparser.RawConfigParser()
    sheet.optionxform = str
    sheet.read(path, encoding="ascii")
    return sheet


def variables(objects):
    for index in objects:
        found = objects[index]
        yield from [found] if isinstance(found, ODVariable) else found.subindices.values()


def test_canopen_loads_the_very_dictionary_of_the_node(path):
    columns = ("index", "subindex", "name", "data_type", "access_type", "min", "max", "default", "pdo_mappable")
    loaded, own = canopen.import_od(str(path), NODE), dictionary(REGISTERS, NODE)
    rows = [[tuple(getattr(v, c) for c in columns) for v in variables(objects)] for objects in (loaded, own)]
    assert sorted(rows[0]) == sorted(rows[1])
    assert loaded.device_information.nr_of_RXPDO == len(RPDOS)


def test_the_checker_finds_nothing_wrong(path):
    assert lint(parse_file(str(path)))  # its warnings are errors here


def test_the_checker_reads_the_same_mapping(path):
    device = Device(parse_file(str(path)), {"NODEID": NODE})
    for pdos, names, bases in (
        (device.rpdo, RPDOS, (0x200, 0x300, 0x400)),
        (device.tpdo, TPDOS, (0x40000180, 0x40000280, 0x40000380, 0x40000480)),
    ):
        assert [[entry.name for entry in pdo.mapping.values()] for pdo in pdos.values()] == [list(n) for n in names]
        assert [pdo.cob_id for pdo in pdos.values()] == [base + NODE for base in bases]


@pytest.mark.parametrize(
    ("right", "wrong"),
    [
        ("[2000sub3]", "[3000sub3]"),
        ("[2000sub3]\nParameterName", "[2000sub3]\nName"),
        ("SubNumber=4", "SubNumber=5"),
        ("AccessType=rww", "AccessType=often"),
        ("HighLimit=5000", "HighLimit=x"),
        ("1=0x1000", "1=0x1fff"),
    ],
)
def test_the_checker_would_find_a_mistake(path, tmp_path, right, wrong):
    text = path.read_text()
    assert right in text
    other = tmp_path / "wrong.eds"
    other.write_text(text.replace(right, wrong, 1))
    with pytest.raises(UserWarning):
        lint(parse_file(str(other)))


def test_lines_end_as_the_standard_asks():
    text = as_eds(table())
    assert text.count("\n") == text.count("\r\n") > 100


def test_no_line_is_longer_than_the_standard_allows(tmp_path):
    path = tmp_path / "many.eds"
    path.write_text(as_eds(table({code: f"program_{code}" for code in range(100, 150)})), encoding="ascii")
    assert max(map(len, path.read_text().splitlines())) <= 255
    assert lint(parse_file(str(path)))


@pytest.mark.parametrize(("first", "pdos"), [(0x1400, RPDOS), (0x1800, TPDOS)])
def test_each_pdo_has_parameters_and_a_mapping_to_mappable_objects(sheet, first, pdos):
    for number in range(len(pdos)):
        assert sheet[f"{first + number:04X}sub1"]["DefaultValue"].startswith("$NODEID+0x")
        bits = 0
        for place in range(len(pdos[number])):
            entry = int(sheet[f"{first + 0x200 + number:04X}sub{place + 1:X}"]["DefaultValue"], 16)
            bits += entry & 0xFF
            target = sheet[f"{entry >> 16:04X}sub{entry >> 8 & 0xFF:X}"]
            assert target["PDOMapping"] == "1"
            assert target["AccessType"] == ("rww" if first == 0x1400 else "ro")
        assert bits <= 64


def test_the_version_of_the_map_is_the_revision_of_the_node(sheet):
    assert int(sheet["DeviceInfo"]["RevisionNumber"]) == VERSION_MAJOR << 16 | VERSION_MINOR
    assert sheet["1018sub3"]["DefaultValue"] == f"0x{VERSION_MAJOR << 16 | VERSION_MINOR:08X}"
