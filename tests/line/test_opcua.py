"""The cell as a PackML unit over OPC UA, by asyncua's client; a quick program stands in for physics."""

import asyncio
import math
import struct
from contextlib import asynccontextmanager, closing
from pathlib import Path
from typing import NamedTuple

import pytest

from drivers.errors import ArmSilentError
from plc_bridge.protocol.messages import Control, Refusal, Result
from plc_bridge.protocol.registers import Lease
from tests.certificates import Authority, utf8
from tests.plc_lines import patient
from tests.plc_wire import Wire
from tests.quick_cell import QuickCell, quick_cell
from tests.scenes import played

asyncua = pytest.importorskip("asyncua", reason="the extra opcua is not installed")
ua = asyncua.ua

from asyncua.crypto.security_policies import SecurityPolicyBasic256Sha256  # noqa: E402
from asyncua.crypto.uacrypto import CertProperties  # noqa: E402

CELL_URI = "urn:tactile-insertion-cell"
RUN = 100
PLC = "urn:test:plc"
LONGEST = 20.0  # s


class Served(NamedTuple):
    cell: QuickCell
    url: str
    keys: dict[str, tuple[Path, Path]]
    certificate: Path


@pytest.fixture(scope="module")
def opcua(loaded, tmp_path_factory):
    authority = Authority(tmp_path_factory.mktemp("certificates"))
    stranger = Authority(tmp_path_factory.mktemp("stranger"))
    keys = {
        "plc": authority.sign("plc", utf8("Operator"), uri=PLC),
        "guard": authority.sign("guard", utf8("Guard"), uri=PLC),
        "nobody": authority.sign("nobody", utf8("Nobody"), uri=PLC),
        "other uri": authority.sign("other", utf8("Operator"), uri="urn:test:other"),
        "stranger": stranger.sign("stranger", utf8("Operator"), uri=PLC),
        "former": authority.sign("former", utf8("Operator"), uri=PLC),
    }
    tls = authority.cell(
        "urn:test:cell",
        host="127.0.0.1",
        revoked=authority.revoke(keys["former"][0]),
        roles={"Operator": ("read", "command"), "Guard": ("read", "stop")},
    )
    plc = patient(tls=tls, opcua_anonymous=True)
    with quick_cell(loaded, plc, tmp_path_factory.mktemp("runs"), opcua=("127.0.0.1", 0)) as cell:
        host, port = cell.bridge.opcua_address
        yield Served(cell, f"opc.tcp://{host}:{port}/", keys, tls.certificate)


def word(number):
    return ua.Variant(number, ua.VariantType.UInt16)


class Unit:
    """The cell, as a client calls it."""

    def __init__(self, client):
        self.client = client

    async def open(self):
        index = await self.client.get_namespace_index(CELL_URI)
        self.node = lambda path: self.client.get_node(ua.NodeId(f"Cell.{path}" if path else "Cell", index))
        return self

    async def read(self, path):
        return await self.node(path).read_value()

    async def call(self, path, *values):
        return await self.node(path.rpartition(".")[0]).call_method(self.node(path).nodeid, *values)

    async def command(self, sequence, code, recipe=0, serial="", parameters=()):
        words = [word(each) for each in (sequence, code, recipe)]
        given = ua.Variant(list(parameters), ua.VariantType.Double)
        answered, refusal, _, remedy = await self.call("Command", *words, ua.Variant(serial), given)
        return answered, Refusal(refusal), remedy

    async def begin(self):
        """Let the first number be adopted, and reset the cell; return the next number."""
        assert (await self.command(1, 0))[0] == 1
        await self.until("Report.State", lambda state: state in (2, 4, 9, 17))
        if await self.read("Report.State") != 4:
            assert (await self.command(2, Control.RESET))[1] is Refusal.NONE
            await self.until("Report.State", 4)
        return 3

    async def answer(self):
        outputs = await self.call("Answer")
        names = [each.Name for each in (await self.node("Answer.OutputArguments").read_value())]
        return dict(zip(names, outputs, strict=True))

    async def result(self, sequence):
        """Wait for the result of a number."""
        async with asyncio.timeout(LONGEST):
            while (found := await self.answer())["Sequence"] != sequence or not found["Result"]:
                await asyncio.sleep(0.01)
            return found

    async def until(self, path, wanted):
        async with asyncio.timeout(LONGEST):
            while True:
                value = (await self.node(path).read_data_value(False)).Value.Value
                if wanted(value) if callable(wanted) else value == wanted:
                    return
                await asyncio.sleep(0.01)


@asynccontextmanager
async def connected(served, name="plc"):
    client = asyncua.Client(served.url)
    client.application_uri = PLC
    if name:
        certificate, key, cell = (CertProperties(path, "pem") for path in (*served.keys[name], served.certificate))
        await client.set_security(SecurityPolicyBasic256Sha256, certificate, key, server_certificate=cell)
    async with client:
        yield await Unit(client).open()


@played
async def test_first_number_of_a_session_is_never_run_and_the_next_once(opcua):
    async with connected(opcua) as unit:
        before = len(opcua.cell.program.runs)
        answered, refusal, remedy = await unit.command(1, RUN)
        assert (answered, refusal, len(opcua.cell.program.runs)) == (1, Refusal.ADOPTED, before)
        assert "next number" in remedy
        sequence = await unit.begin()
        answers = [await unit.command(sequence, RUN, serial="A-7") for _ in range(3)]
        assert answers == [(sequence, Refusal.NONE, "")] * 3
        found = await unit.result(sequence)
        assert (found["Result"], len(opcua.cell.program.runs)) == (Result.SUCCESS, before + 1)
        record = opcua.cell.record(found["Run"])
        assert record.serial == "A-7"
        assert record.source.startswith("Operator@127.0.0.1:")
        await unit.call("Acknowledge", word(sequence))
        assert (await unit.answer())["Result"] == Result.NONE
        await unit.until("Report.State", 4)


@played
async def test_result_is_held_for_the_next_session(opcua):
    async with connected(opcua) as unit:
        sequence = await unit.begin()
        opcua.cell.program.may_end.clear()
        assert (await unit.command(sequence, RUN))[1] is Refusal.NONE
    opcua.cell.program.may_end.set()
    async with connected(opcua) as unit:
        assert (await unit.command(sequence, RUN))[1] is Refusal.NONE
        assert (await unit.result(sequence))["Result"] == Result.SUCCESS


@played
async def test_lease_of_modbus_is_obeyed(opcua):
    async with connected(opcua) as unit:
        await unit.call("Lease", word(Lease.RELEASE))
    with closing(Wire(opcua.cell.bridge.address)) as wire:
        wire.ask(struct.pack(">BHH", 6, 5, Lease.TAKE))
        async with connected(opcua) as unit:
            with pytest.raises(ua.UaStatusCodeError):
                await unit.call("BaseStateMachine.MachineState.Reset")
            await unit.command(1, 0)
            assert (await unit.command(2, RUN))[1] is Refusal.NOT_HOLDER
            assert (await unit.answer())["Holder"].startswith("127.0.0.1:")
        wire.ask(struct.pack(">BHH", 6, 5, Lease.RELEASE))


@played
async def test_a_guard_stops_and_an_operator_resets_by_methods_of_packml(opcua):
    async with connected(opcua) as unit, connected(opcua, "guard") as guard:
        await unit.begin()
        await guard.call("BaseStateMachine.MachineState.Stop")
        state = "BaseStateMachine.MachineState.CurrentState"
        await unit.until("Report.State", 2)
        await unit.until(state, lambda text: text.Text == "Stopped")
        await unit.until(f"{state}.Id", lambda node: node.Identifier == 53)
        inner = await unit.node("BaseStateMachine.MachineState.ExecuteState.CurrentState").read_data_value(False)
        assert inner.StatusCode.name == "BadStateNotActive"
        with pytest.raises(ua.uaerrors.BadInvalidState):
            await unit.call("BaseStateMachine.MachineState.ExecuteState.Hold")
        await unit.call("BaseStateMachine.MachineState.Reset")
        await unit.until("BaseStateMachine.MachineState.ExecuteState.CurrentState", lambda t: t and t.Text == "Idle")


@played
async def test_counters_and_times_are_packml_tags(opcua):
    async with connected(opcua, "") as unit:
        (processed,) = await unit.read("Admin.ProdProcessedCount")
        assert processed.Count == opcua.cell.bridge.figures.tags.processed
        assert len((await unit.read("Admin.StateCumulativeTime"))[1]) == 18
        assert await unit.read("Status.UnitModeCurrent") == 1


class Events(asyncio.Queue):
    """Events of a subscription."""

    def event_notification(self, event):
        self.put_nowait(event)

    async def next(self):
        async with asyncio.timeout(LONGEST):
            return await self.get()


@played
async def test_end_of_a_run_and_a_fault_with_its_remedy_are_events(opcua):
    async with connected(opcua) as unit:
        sequence, events = await unit.begin(), Events()
        index = unit.node("").nodeid.NamespaceIndex
        subscription = await unit.client.create_subscription(50, events)
        ended = await unit.client.nodes.base_event_type.get_child(f"{index}:RunEnded")
        await subscription.subscribe_events(evtypes=[ended, ua.ObjectIds.AlarmConditionType])
        opcua.cell.program.fault = ArmSilentError("quiet")
        try:
            await unit.command(sequence, RUN, serial="B-1")
            seen = [await events.next(), await events.next()]
        finally:
            opcua.cell.program.fault = None
        run, alarm = sorted(seen, key=lambda each: each.ConditionName is not None)
        assert (run.Serial, run.Result, run.Fault) == ("B-1", Result.FAULT, 1004)
        assert (alarm.ConditionName, alarm.Retain) == ("ARM_SILENT", True)
        assert alarm.Message.Text.startswith("1004 ARM_SILENT: ")
        await unit.result(sequence)
        await unit.command(sequence + 1, Control.RESET)
        assert (await events.next()).Retain is False


@pytest.mark.parametrize("name", ["stranger", "nobody", "other uri", "former"])
@played
async def test_client_with_a_wrong_certificate_is_refused(opcua, name):
    before = opcua.cell.bridge.diagnostics.forbidden
    with pytest.raises(ua.UaStatusCodeError):
        async with connected(opcua, name):
            pass
    assert opcua.cell.bridge.diagnostics.forbidden == before + 1


@pytest.mark.parametrize("name", ["guard", ""])
@played
async def test_client_without_the_right_may_not_command(opcua, name):
    async with connected(opcua, name) as unit:
        before = len(opcua.cell.program.runs)
        with pytest.raises(ua.uaerrors.BadUserAccessDenied):
            await unit.command(1, RUN)
        with pytest.raises(ua.uaerrors.BadUserAccessDenied):
            await unit.call("BaseStateMachine.MachineState.Reset")
        with pytest.raises(ua.UaStatusCodeError):
            await unit.node("Report.State").write_value(word(4))
        assert len(opcua.cell.program.runs) == before


WHOLE = [word(2), word(RUN), word(0), ua.Variant(""), ua.Variant([], ua.VariantType.Double)]


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        WHOLE[:4],
        [*WHOLE, word(1)],
        [ua.Variant(2, ua.VariantType.Int64), *WHOLE[1:]],
        [ua.Variant([2], ua.VariantType.UInt16), *WHOLE[1:]],
        [*WHOLE[:3], ua.Variant("x" * 33), WHOLE[4]],
        [*WHOLE[:4], ua.Variant([math.inf], ua.VariantType.Double)],
        [*WHOLE[:4], ua.Variant([0.0] * 9, ua.VariantType.Double)],
    ],
)
@played
async def test_malformed_arguments_are_refused_and_nothing_moves(opcua, arguments):
    async with connected(opcua) as unit:
        await unit.command(1, 0)
        before = len(opcua.cell.program.runs)
        with pytest.raises(ua.UaStatusCodeError):
            await unit.call("Command", *arguments)
        assert len(opcua.cell.program.runs) == before
        assert (await unit.answer())["Answered"] == 1


@played
async def test_parameter_beyond_its_limits_is_refused_by_its_number(opcua):
    async with connected(opcua) as unit:
        sequence = await unit.begin()
        assert (await unit.command(sequence, RUN, parameters=[math.nan, 9.0]))[1] is Refusal.PARAMETER
        assert (await unit.answer())["RefusalDetail"] == 2


@played
async def test_client_that_dies_in_a_method_leaves_its_answer(opcua):
    async with connected(opcua) as unit:
        sequence = await unit.begin()
        before = len(opcua.cell.program.runs)
        call = asyncio.ensure_future(unit.command(sequence, RUN))
        await asyncio.sleep(0)
        unit.client.uaclient.protocol.transport.abort()
        with pytest.raises((ConnectionError, ua.UaError, asyncio.CancelledError)):
            await call
    async with connected(opcua) as unit:
        answered, refusal, _ = await unit.command(sequence, RUN)
        assert answered == sequence
        if refusal is Refusal.NONE:
            await unit.result(sequence)
        ran = len(opcua.cell.program.runs) - before
        assert (ran, refusal) in ((0, Refusal.ADOPTED), (1, Refusal.NONE))


@played
async def test_request_without_a_channel_reads_nothing(opcua):
    client = asyncua.Client(opcua.url)
    await client.connect_socket()
    try:
        await client.send_hello()
        await client.open_secure_channel()
        client.uaclient.protocol.authentication_token = ua.NodeId(1)
        with pytest.raises(ua.uaerrors.BadUserAccessDenied):
            await client.nodes.server.read_browse_name()
    finally:
        client.disconnect_socket()
