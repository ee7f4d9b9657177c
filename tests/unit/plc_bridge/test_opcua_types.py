"""The table of PackML's types agrees with the published nodeset; states nest as PackML nests them."""

import subprocess
import sys
import xml.etree.ElementTree as ET

import pytest

from tests.foreign import NODE_CLIENT

NODESET = NODE_CLIENT / "node_modules" / "node-opcua-nodesets" / "nodesets" / "Opc.Ua.PackML.NodeSet2.xml"
NAMESPACE = "{http://opcfoundation.org/UA/2011/03/UANodeSet.xsd}"
HAS_RULE = {"mandatory": "i=78", "optional": "i=80"}


@pytest.fixture(scope="module")
def packml():
    pytest.importorskip("asyncua", reason="the extra opcua is not installed")
    from plc_bridge.opcua import packml

    return packml


@pytest.fixture(scope="module")
def published():
    if not NODESET.is_file():
        pytest.skip("the published nodeset is not installed: `npm ci` in tests/clients/node")
    return {each.get("NodeId"): each for each in ET.parse(NODESET).getroot() if each.get("NodeId")}


def references(node):
    return {(each.get("ReferenceType"), each.text) for each in node.iter(f"{NAMESPACE}Reference")}


def test_names_numbers_parents_and_rules_are_those_of_the_nodeset(packml, published):
    for row in packml.ROWS:
        if row.kind in ("field", "mode"):
            continue
        node = published[f"ns=1;i={row.number}"]
        assert node.get("BrowseName").rpartition(":")[2] == row.name
        owners = {target for _, target in references(node) if target.startswith("ns=1")} | {node.get("ParentNodeId")}
        assert not row.parent or f"ns=1;i={row.parent}" in owners
        assert not row.rule or ("HasModellingRule", HAS_RULE[row.rule]) in references(node)


def test_fields_of_structures_are_those_of_the_nodeset(packml, published):
    for structure in (row for row in packml.ROWS if row.kind == "structure"):
        fields = [row.name for row in packml.ROWS if (row.parent, row.kind) == (structure.number, "field")]
        node = published[f"ns=1;i={structure.number}"]
        assert fields == [each.get("Name") for each in node.iter(f"{NAMESPACE}Field")]
        assert ("HasEncoding", f"ns=1;i={structure.type}") in references(node)


def test_numbers_of_states_are_those_of_the_nodeset(packml, published):
    for number, row in packml.STATES.items():
        value = published[f"ns=1;i={row.type}"].find(f"{NAMESPACE}Value")
        assert "".join(value.itertext()).strip() == str(number)


@pytest.mark.parametrize(
    ("state", "active"), [(9, (9, None, None)), (2, (19, 2, None)), (6, (19, 18, 6)), (0, (None, None, None))]
)
def test_states_nest(packml, state, active):
    assert tuple(packml.active_states(state).values()) == active


def test_library_is_not_imported_while_opc_ua_is_off():
    program = """
import sys
import cell.commands.serve
from plc_bridge.bridge import Bridge
from plc_bridge.config import PlcConfig
Bridge(PlcConfig(), {})
print([name for name in sys.modules if name.startswith(("asyncua", "plc_bridge.opcua"))])
"""
    assert subprocess.check_output([sys.executable, "-c", program], text=True).strip() == "[]"
