"""The cell as one PackML unit: its nodes, the values that they show, and the events."""

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

from asyncua import Server, ua
from asyncua.server.event_generator import EventGenerator

from drivers.errors import FAULTS, FaultCode
from plc_bridge.opcua.packml import (
    BASE_MACHINE,
    EXECUTE,
    FOLDER,
    MACHINE,
    MEMBERS,
    MODES,
    STATES,
    UNIT_TYPE,
    Nodes,
    active_states,
    add_types,
    node_id,
)
from plc_bridge.protocol.images import Value
from plc_bridge.protocol.links import Order
from plc_bridge.protocol.messages import Control, Refusal, Result
from plc_bridge.protocol.registers import DEVICE_NAME, Register

UNIT = "Cell"
PATHS = {BASE_MACHINE: f"{UNIT}.BaseStateMachine"}
PATHS[MACHINE] = f"{PATHS[BASE_MACHINE]}.MachineState"
PATHS[EXECUTE] = f"{PATHS[MACHINE]}.ExecuteState"
"""Path of each state machine."""
_VARIANTS = {"u16": ua.VariantType.UInt16, "u32": ua.VariantType.UInt32, "i32": ua.VariantType.Int32}
_RUN_FIELDS = {
    "Run": ua.VariantType.UInt32,
    "Sequence": ua.VariantType.Int32,
    "Code": ua.VariantType.UInt16,
    "Recipe": ua.VariantType.UInt16,
    "Serial": ua.VariantType.String,
    "Client": ua.VariantType.String,
    "Result": ua.VariantType.UInt16,
    "Reason": ua.VariantType.UInt16,
    "Fault": ua.VariantType.UInt16,
    "TotalTime": ua.VariantType.Double,
}
"""Fields of the event of a run's end."""


def variant_type(register: Register) -> ua.VariantType:
    """Return the type of a register's value in its unit."""
    if register.type == "string":
        return ua.VariantType.String
    return _VARIANTS[register.type] if register.scale == 1.0 else ua.VariantType.Double


def title(register: Register) -> str:
    """Return the browse name of a register, as in "TotalTime" for `report_total_time`."""
    return "".join(part.capitalize() for part in register.name.split("_")[1:])


def shown(registers: Sequence[Register]) -> list[Register]:
    """Return the registers of the report without its life counters and its version."""
    framing = {"report_life", "report_life_tail", "report_version"}
    return [each for each in registers if each.name.startswith("report_") and each.name not in framing]


class Unit:
    """Nodes and events of the cell.

    Args:
        server: The server, whose standard nodes exist.
        registers: The register map, from which the report's variables are made.
    """

    def __init__(self, server: Server, registers: Sequence[Register]) -> None:
        self._server, self._report = server, shown(registers)
        self.nodes: Nodes
        self._index = 0
        self._values: dict[str, object] = {}
        self._fault = 0
        self._alarms: dict[int, EventGenerator] = {}
        self._run_ended: EventGenerator

    def place(self, path: str) -> ua.NodeId:
        """Return the NodeId of a path."""
        return ua.NodeId(path, self._index)

    async def build(self) -> None:
        """Add the types, the unit and the event of a run's end."""
        self.nodes = await add_types(self._server)
        # Namespace of the unit's own nodes; their NodeIds are paths, as in "Cell.Report.TotalTime".
        self._index = await self._server.register_namespace("urn:tactile-insertion-cell")
        unit, parent = self.place(UNIT), self.nodes.standard(FOLDER)
        await self.nodes.add(unit, UNIT, parent, ua.ObjectAttributes(), self.nodes.standard(UNIT_TYPE))
        await self._add_members(UNIT_TYPE, UNIT)
        report = self.place(f"{UNIT}.Report")
        await self.nodes.add(report, "Report", unit, ua.ObjectAttributes(), node_id("BaseObjectType"))
        for register in self._report:
            name, kind = title(register), ua.NodeId(int(variant_type(register)))
            meaning = f"{register.meaning}; {register.unit}" if register.unit else register.meaning
            await self.nodes.variable(self.place(f"{UNIT}.Report.{name}"), name, report, kind, meaning=meaning)
        await self._set(f"{UNIT}.TagID", DEVICE_NAME)
        await self._set(f"{UNIT}.PackMLVersion", "V2022")
        await self._set(f"{UNIT}.Status.UnitSupportedModes", self.nodes.standard(MODES))
        for speed in ("MachSpeed", "CurMachSpeed"):
            await self._set(f"{UNIT}.Status.{speed}", 0.0, ua.VariantType.Float)
        for machine, path in PATHS.items():
            states = [self.nodes.standard(each.number) for each in STATES.values() if each.parent == machine]
            await self._set(f"{path}.AvailableStates", states, ua.VariantType.NodeId)
            await self._set(f"{path}.AvailableTransitions", [], ua.VariantType.NodeId)
            state = self.place(f"{path}.CurrentState")
            name = ua.QualifiedName("CurrentState")
            await self.nodes.variable(state, name, self.place(path), node_id("LocalizedText"))
            for each, kind in (("Id", node_id("NodeId")), ("Number", node_id("UInt32"))):
                place, name = self.place(f"{path}.CurrentState.{each}"), ua.QualifiedName(each)
                await self.nodes.variable(place, name, state, kind, is_property=True)
        fields = list(_RUN_FIELDS.items())
        ended = await self._server.create_custom_event_type(self._index, "RunEnded", properties=fields)
        self._run_ended = await self._server.get_event_generator(ended)

    async def _add_members(self, type_number: int, path: str) -> None:
        for row in MEMBERS[type_number]:
            inner = f"{path}.{row.name}"
            await self.nodes.member(row, self.place(inner), self.place(path))
            if row.kind == "object":
                await self._add_members(int(row.type), inner)

    async def update(self, report: Mapping[str, Value], tags: Mapping[str, Value], obstacle: Refusal) -> None:
        """Show the present values.

        Args:
            report: Value of each register of the report.
            tags: Value of each register of the PackTags.
            obstacle: Refusal that a program with a fresh peg would get now.
        """
        for register in self._report:
            await self._set(f"{UNIT}.Report.{title(register)}", report[register.name], variant_type(register))
        await self._show_states(int(tags["packml_state"]))
        status, admin = f"{UNIT}.Status", f"{UNIT}.Admin"
        await self._set(f"{status}.UnitModeCurrent", int(tags["packml_unit_mode"]), ua.VariantType.Int32)
        await self._set(f"{status}.EquipmentBlocked", obstacle is Refusal.HOLE_OCCUPIED)
        await self._set(f"{status}.EquipmentStarved", obstacle is Refusal.RACK_EMPTY)
        for name in ("Processed", "Defective"):
            await self._set(f"{admin}.Prod{name}Count", [_count(int(tags[f"packml_{name.lower()}"]))])
        times = [0, *(int(value) for name, value in tags.items() if name.startswith("packml_state_time_"))]
        await self._set(f"{admin}.StateCumulativeTime", [[0] * len(times), times], ua.VariantType.Int32)
        fault, reason = int(report["report_fault"]), int(tags["packml_stop_reason"])
        if reason != self._values.get("reason"):
            self._values["reason"] = reason
            await self._set(f"{admin}.StopReason", _alarm(reason))
        if fault != self._fault:
            await self._raise(self._fault, is_active=False)
            self._fault = fault
            await self._raise(fault, is_active=True)
            await self._set(f"{admin}.Alarm", [_alarm(fault)] if fault else [], ua.VariantType.ExtensionObject)

    async def end(self, order: Order) -> None:
        """Send the event of a run's end."""
        command, report, event = order.command, order.report, self._run_ended.event
        event.SourceNode, event.SourceName = self.place(UNIT), UNIT
        event.Run, event.Sequence, event.Code, event.Recipe = report.run, command.sequence, command.code, command.recipe
        event.Serial, event.Client, event.Result = command.serial, command.source, int(order.result)
        event.Reason, event.Fault, event.TotalTime = report.reason, report.fault, report.total_time
        await self._run_ended.trigger(message=f"run {report.run}: {Result(order.result).name}")

    async def _show_states(self, state: int) -> None:
        for machine, active in active_states(state).items():
            path, named = f"{PATHS[machine]}.CurrentState", STATES.get(active or 0)
            await self._set(path, ua.LocalizedText(named.name) if named else None)
            await self._set(f"{path}.Id", self.nodes.standard(named.number) if named else None)
            await self._set(f"{path}.Number", active, ua.VariantType.UInt32)

    async def _raise(self, fault: int, is_active: bool) -> None:
        """Send the alarm condition of a fault; when the fault is reset, the condition is acknowledged and inactive."""
        if not fault:
            return
        if fault not in self._alarms:
            self._alarms[fault] = await self._server.get_event_generator(ua.ObjectIds.AlarmConditionType)
        alarm, event = self._alarms[fault], self._alarms[fault].event
        event.NodeId = self.place(f"{UNIT}.Fault.{fault}")
        event.SourceNode, event.SourceName, event.ConditionName = self.place(UNIT), UNIT, FaultCode(fault).name
        # Severity of a fault, 1 to 1000: the cell stands still until a person has acted.
        event.Severity, event.Retain, event.BranchId = 800, is_active, ua.NodeId()
        states = {"EnabledState": (True, "Enabled"), "ActiveState": (is_active, "Active" if is_active else "Inactive")}
        states["AckedState"] = (not is_active, "Unacknowledged" if is_active else "Acknowledged")
        for name, (value, text) in states.items():
            setattr(event, f"{name}/Id", value)
            setattr(event, name, ua.LocalizedText(text))
        await alarm.trigger(message=_text(fault))

    async def _set(self, path: str, value: Any, kind: ua.VariantType | None = None) -> None:
        """Write a value if it has changed; None writes an empty value with the status BadStateNotActive."""
        if path in self._values and self._values[path] == value:
            return
        self._values[path] = value
        is_there = value is not None
        variant = ua.Variant(value, kind) if is_there else ua.Variant()
        status = ua.StatusCodes.Good if is_there else ua.StatusCodes.BadStateNotActive
        data = ua.DataValue(variant, ua.StatusCode(status), datetime.now(UTC))
        await self._server.iserver.write_attribute_value(self.place(path), data)


def _count(number: int) -> Any:
    return ua.PackMLCountDataType(ID=1, Name="insertions", Count=number, AccCount=number)


def _text(code: int) -> str:
    """Return the name of a fault or a control, and the remedy of a fault."""
    if code < FaultCode.SKIN_SILENT:
        return Control(code).name
    text = FAULTS[FaultCode(code)]
    return f"{code} {FaultCode(code).name}: {text.meaning}; {text.remedy}"


def _alarm(code: int) -> Any:
    when = datetime.now(UTC)
    return ua.PackMLAlarmDataType(
        ID=code,
        Value=code,
        Message=_text(code),
        Category=code // 1000,
        DateTime=when,
        AckDateTime=when,
        Trigger=code != 0,
    )
