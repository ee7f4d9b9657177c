"""The part of OPC 30050 that the cell uses: a table of names and NodeIds, and the nodes made from it.

`packml.csv` holds the browse names and numeric NodeIds of the standard's namespace, version 1.01 [opc30050]: types with
their members, and states. In the row of a state, the column type holds the NodeId of StateNumber, and the column rank
holds the PackML number.
"""

import csv
from collections import defaultdict
from collections.abc import Sequence
from importlib.resources import files
from typing import Any, NamedTuple

from asyncua import Server, ua
from asyncua.common.structures104 import create_encoding, new_struct_field

MODES, FOLDER, UNIT_TYPE = 11, 72, 6
"""Numeric NodeIds of the enumeration of modes, of the folder of all units, and of the type of a unit."""
BASE_MACHINE, MACHINE, EXECUTE = 3, 2, 1
"""Numeric NodeIds of the types of the state machines, from the outermost to the innermost."""
CLEARED, RUNNING = 19, 18
"""PackML numbers of the states that only contain an inner machine."""
NOTHING = ua.NodeId()
STANDARD_NAMES = {"AvailableStates", "AvailableTransitions"}
"""Members whose names belong to OPC UA itself."""


class Row(NamedTuple):
    """One row of the table; `parent` is the numeric NodeId of the type to which the row belongs."""

    parent: int
    number: int
    kind: str
    name: str
    type: str
    rank: int
    rule: str


def _rows() -> list[Row]:
    with (files(__package__) / "packml.csv").open(encoding="utf-8") as lines:
        return [
            Row(int(parent), int(number), kind, name, type_, int(rank or -1), rule)
            for parent, number, kind, name, type_, rank, rule in list(csv.reader(lines))[1:]
        ]


ROWS = _rows()
MEMBERS: dict[int, list[Row]] = defaultdict(list)
"""Members of each type."""
STATES = {row.rank: row for row in ROWS if row.kind == "state"}
"""States by their PackML number."""
for _row in ROWS:
    if _row.rule:
        MEMBERS[_row.parent].append(_row)


def active_states(state: int) -> dict[int, int | None]:
    """Return the active state of each state machine, by the number of its type; None if the machine is inactive."""
    inner = STATES[state].parent if state in STATES else 0
    base = state if inner == BASE_MACHINE else CLEARED if inner else None
    machine = state if inner == MACHINE else RUNNING if inner == EXECUTE else None
    return {BASE_MACHINE: base, MACHINE: machine, EXECUTE: state if inner == EXECUTE else None}


def node_id(name: str) -> ua.NodeId:
    """Return the NodeId of a type of OPC UA itself."""
    return ua.NodeId(getattr(ua.ObjectIds, name))


class Nodes:
    """Adds nodes with given NodeIds to the address space of a server; `packml` is the index of the standard's namespace."""

    def __init__(self, server: Server, packml: int) -> None:
        self._session, self.packml = server.iserver.isession, packml

    def standard(self, number: int) -> ua.NodeId:
        """Return a NodeId of the standard's namespace."""
        return ua.NodeId(number, self.packml)

    def type_of(self, row: Row) -> ua.NodeId:
        """Return the type of a member."""
        return self.standard(int(row.type)) if row.type.isdigit() else node_id(row.type)

    async def add(
        self,
        node: ua.NodeId,
        name: str | ua.QualifiedName,
        parent: ua.NodeId,
        attributes: Any,
        type_definition: ua.NodeId = NOTHING,
        reference: str = "HasComponent",
    ) -> ua.NodeId:
        """Add one node; a name given as a string gets the namespace of the node's NodeId."""
        item = ua.AddNodesItem()
        item.BrowseName = ua.QualifiedName(name, node.NamespaceIndex) if isinstance(name, str) else name
        item.RequestedNewNodeId, item.ParentNodeId, item.TypeDefinition = node, parent, type_definition
        item.ReferenceTypeId, item.NodeAttributes = node_id(reference), attributes
        item.NodeClass = ua.NodeClass[type(attributes).__name__.removesuffix("Attributes")]
        attributes.DisplayName = ua.LocalizedText(item.BrowseName.Name)
        (added,) = await self._session.add_nodes([item])
        added.StatusCode.check()
        return node

    async def variable(
        self,
        node: ua.NodeId,
        name: str | ua.QualifiedName,
        parent: ua.NodeId,
        data_type: ua.NodeId,
        rank: int = -1,
        value: Any = None,
        meaning: str = "",
        is_property: bool = False,
    ) -> None:
        """Add a variable or a property that clients may read."""
        attributes = ua.VariableAttributes(Value=value or ua.Variant(), DataType=data_type, ValueRank=rank)
        attributes.Description = ua.LocalizedText(meaning)
        kind, reference = ("PropertyType", "HasProperty") if is_property else ("BaseDataVariableType", "HasComponent")
        await self.add(node, name, parent, attributes, node_id(kind), reference)

    async def method(
        self, node: ua.NodeId, name: str, parent: ua.NodeId, arguments: Sequence[Sequence[ua.Argument]]
    ) -> None:
        """Add a method; `arguments` are the input arguments and the output arguments."""
        await self.add(node, name, parent, ua.MethodAttributes(UserExecutable=True))
        for which, each in zip(("InputArguments", "OutputArguments"), arguments, strict=True):
            if each:
                place, value = ua.NodeId(f"{node.Identifier}.{which}", node.NamespaceIndex), ua.Variant(list(each))
                await self.variable(
                    place, ua.QualifiedName(which), node, node_id("Argument"), 1, value, is_property=True
                )

    async def member(self, row: Row, node: ua.NodeId, parent: ua.NodeId) -> None:
        """Add a member of a type, or of an instance of the type, without its own members."""
        name = ua.QualifiedName(row.name, 0 if row.name in STANDARD_NAMES else self.packml)
        if row.kind == "method":
            await self.add(node, name, parent, ua.MethodAttributes(UserExecutable=True))
        elif row.kind == "object":
            await self.add(node, name, parent, ua.ObjectAttributes(), self.type_of(row))
        else:
            await self.variable(node, name, parent, self.type_of(row), row.rank, is_property=row.kind == "property")


async def add_types(server: Server) -> Nodes:
    """Add the types of PackML and the folder of its units; return the `Nodes`, for adding further nodes."""
    nodes = Nodes(server, await server.register_namespace("http://opcfoundation.org/UA/PackML/"))
    for row in ROWS:
        node, parent = nodes.standard(row.number), nodes.standard(row.parent)
        if row.kind in ("modes", "structure"):
            await _add_data_type(server, nodes, row)
        elif row.kind == "object type":
            await nodes.add(node, row.name, node_id(row.type), ua.ObjectTypeAttributes(), reference="HasSubtype")
        elif row.kind == "state":
            await nodes.add(node, row.name, parent, ua.ObjectAttributes(), node_id("StateType"))
            place, value = nodes.standard(int(row.type)), ua.Variant(row.rank, ua.VariantType.UInt32)
            name = ua.QualifiedName("StateNumber")
            await nodes.variable(place, name, node, node_id("UInt32"), value=value, is_property=True)
        elif row.rule:
            await nodes.member(row, node, parent)
            await server.get_node(node).set_modelling_rule(row.rule == "mandatory")
    await server.load_data_type_definitions()
    folder, objects = ua.ObjectAttributes(), node_id("ObjectsFolder")
    await nodes.add(nodes.standard(FOLDER), "PackMLObjects", objects, folder, node_id("FolderType"), "Organizes")
    return nodes


async def _add_data_type(server: Server, nodes: Nodes, row: Row) -> None:
    parts = [each for each in ROWS if each.parent == row.number and each.kind in ("mode", "field")]
    is_structure = row.kind == "structure"
    base = node_id("Structure" if is_structure else "Enumeration")
    node = server.get_node(nodes.standard(row.number))
    await nodes.add(node.nodeid, row.name, base, ua.DataTypeAttributes(), reference="HasSubtype")
    if is_structure:
        encoding = nodes.standard(int(row.type))
        await create_encoding(node, encoding, ua.QualifiedName("Default Binary"))
        fields = [new_struct_field(each.name, node_id(each.type)) for each in parts]
        definition = ua.StructureDefinition(BaseDataType=base, DefaultEncodingId=encoding, Fields=fields)
    else:
        definition = ua.EnumDefinition(Fields=[ua.EnumField(Name=each.name, Value=each.number) for each in parts])
    await node.write_data_type_definition(definition)
