"""The function block as PLCopen XML, TC6 version 2.01, adopted by IEC 61131-10, for import into programming systems.

Source of elements and their order: the published schema tc6_xml_v201.xsd.
"""

import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence

from plc_bridge.exports.function_block import NAME, NAMES, FunctionBlock, Variable, function_block
from plc_bridge.exports.structured_text import body_of
from plc_bridge.protocol.registers import DEVICE_NAME, VERSION_DATE, VERSION_MAJOR, VERSION_MINOR, Register

NAMESPACE, XHTML = "http://www.plcopen.org/xml/tc6_0201", "http://www.w3.org/1999/xhtml"
_STAMP = f"{VERSION_DATE}T00:00:00"


def as_plcopen_xml(registers: Sequence[Register], names: Mapping[str, int]) -> str:
    """Return a project with the named types and the function block, and no configuration."""
    block = function_block(registers, names)
    project = ET.Element("project", {"xmlns": NAMESPACE})
    _headers(project)
    types = ET.SubElement(project, "types")
    _data_types(ET.SubElement(types, "dataTypes"), block)
    _pou(ET.SubElement(types, "pous"), block)
    ET.SubElement(ET.SubElement(project, "instances"), "configurations")
    ET.indent(project)
    return ET.tostring(project, encoding="unicode", xml_declaration=False).join(
        ['<?xml version="1.0" encoding="utf-8"?>\n', "\n"]
    )


def _headers(project: ET.Element) -> None:
    made = {"productName": DEVICE_NAME, "productVersion": f"{VERSION_MAJOR}.{VERSION_MINOR}"}
    ET.SubElement(project, "fileHeader", {"companyName": DEVICE_NAME, **made, "creationDateTime": _STAMP})
    content = ET.SubElement(project, "contentHeader", {"name": NAME, "modificationDateTime": _STAMP})
    info = ET.SubElement(content, "coordinateInfo")
    for kind in ("fbd", "ld", "sfc"):
        ET.SubElement(ET.SubElement(info, kind), "scaling", {"x": "1", "y": "1"})


def _data_types(parent: ET.Element, block: FunctionBlock) -> None:
    for array in block.arrays:
        base = ET.SubElement(ET.SubElement(parent, "dataType", {"name": array.name}), "baseType")
        each = ET.SubElement(base, "array")
        ET.SubElement(each, "dimension", {"lower": str(array.low), "upper": str(array.high)})
        ET.SubElement(ET.SubElement(each, "baseType"), array.of)
    names = ET.SubElement(ET.SubElement(parent, "dataType", {"name": NAMES}), "baseType")
    struct = ET.SubElement(names, "struct")
    for name, number in block.names.items():
        _variable(struct, Variable(name, "UINT", initial=str(number)), block)


def _pou(parent: ET.Element, block: FunctionBlock) -> None:
    pou = ET.SubElement(parent, "pou", {"name": NAME, "pouType": "functionBlock"})
    interface = ET.SubElement(pou, "interface")
    for kind, variables in zip(("inputVars", "outputVars", "localVars"), block.variables.values(), strict=True):
        section = ET.SubElement(interface, kind)
        for variable in variables:
            _variable(section, variable, block)
    _text(ET.SubElement(ET.SubElement(pou, "body"), "ST"), body_of(block))
    _text(ET.SubElement(pou, "documentation"), block.about)


def _variable(parent: ET.Element, variable: Variable, block: FunctionBlock) -> None:
    each = ET.SubElement(parent, "variable", {"name": variable.name})
    kind = ET.SubElement(each, "type")
    named = {array.name for array in block.arrays} | {NAMES, "TON"}
    if variable.type in named:
        ET.SubElement(kind, "derived", {"name": variable.type})
    else:
        ET.SubElement(kind, variable.type)
    if variable.initial:
        ET.SubElement(ET.SubElement(each, "initialValue"), "simpleValue", {"value": variable.initial})
    if variable.meaning:
        _text(ET.SubElement(each, "documentation"), variable.meaning)


def _text(parent: ET.Element, text: str) -> None:
    ET.SubElement(parent, "p", {"xmlns": XHTML}).text = text
