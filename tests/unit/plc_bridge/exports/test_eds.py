"""The data sheet against canopen, Lely's checker for data sheets, and the rules of CiA 306."""

import configparser

import canopen
import pytest
from dcf.device import Device
from dcf.lint import lint
from dcf.parse import parse_file

from plc_bridge.canopen.objects import dictionary, variables
from plc_bridge.exports.eds import as_eds
from plc_bridge.protocol.registers import RPDOS, TPDOS, VERSION_MAJOR, VERSION_MINOR, table
from tests.canopen_rig import NODE, REGISTERS


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("eds") / "cell.eds"
    path.write_text(as_eds(REGISTERS), encoding="ascii")
    return path


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


def test_lines_end_as_the_standard_requires():
    text = as_eds(table())
    assert text.count("\n") == text.count("\r\n") > 100


def test_no_line_is_longer_than_the_standard_allows(tmp_path):
    path = tmp_path / "many.eds"
    path.write_text(as_eds(table({code: f"program_{code}" for code in range(100, 150)})), encoding="ascii")
    assert max(map(len, path.read_text().splitlines())) <= 255
    assert lint(parse_file(str(path)))


def test_the_version_of_the_map_is_the_revision_of_the_node(path):
    sheet = configparser.RawConfigParser()
    sheet.read(path, encoding="ascii")
    assert int(sheet["DeviceInfo"]["RevisionNumber"]) == VERSION_MAJOR << 16 | VERSION_MINOR
    assert sheet["1018sub3"]["DefaultValue"] == f"0x{VERSION_MAJOR << 16 | VERSION_MINOR:08X}"
