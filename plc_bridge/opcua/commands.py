"""The methods of the unit: arguments in, the handshake's answer out; only the handshake decides on commands.

PackML's own methods are controls without a number. Only the method `Command` starts a program; its sequence number makes
sure that the program runs at most once.
"""

import asyncio
import math
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from asyncua import ua
from asyncua.common.utils import ServiceError

from plc_bridge.config import Right
from plc_bridge.opcua.packml import BASE_MACHINE, EXECUTE, MACHINE
from plc_bridge.opcua.session import SESSION, CellSession
from plc_bridge.opcua.unit import PATHS, UNIT, Unit, shown, title, variant_type
from plc_bridge.protocol.images import REPORT, CommandImage
from plc_bridge.protocol.mailbox import Mailbox
from plc_bridge.protocol.messages import REMEDIES, Control, Refusal, Result
from plc_bridge.protocol.registers import PARAMETERS, Lease, Parameter, Register

_CONTROLS = (
    (f"{PATHS[BASE_MACHINE]}.Abort", Control.ABORT),
    (f"{PATHS[BASE_MACHINE]}.Clear", Control.CLEAR),
    (f"{PATHS[MACHINE]}.Stop", Control.STOP),
    (f"{PATHS[MACHINE]}.Reset", Control.RESET),
    (f"{PATHS[EXECUTE]}.Reset", Control.RESET),
    (f"{PATHS[EXECUTE]}.Hold", Control.HOLD),
    (f"{PATHS[EXECUTE]}.Unhold", Control.UNHOLD),
)
"""Control of each method of PackML."""
_COMMAND: tuple[Right, ...] = ("command",)
_STATUS = {Refusal.NOT_HOLDER: ua.StatusCodes.BadRequestNotAllowed, Refusal.BUSY: ua.StatusCodes.BadResourceUnavailable}
"""Status code of a refused control, by refusal; all other refusals have BadInvalidState."""
_ANSWERED = ("report_answered", "report_refusal", "report_refusal_detail")

Body = Callable[..., Awaitable[list[ua.Variant]]]


class NotDoneError(Exception):
    """A method ends with a bad status; `results` are the status codes of its arguments."""

    def __init__(self, status: int, results: Sequence[int] = ()) -> None:
        super().__init__(status)
        self.result = ua.CallMethodResult(StatusCode=ua.StatusCode(status))
        self.result.InputArgumentResults = [ua.StatusCode(each) for each in results]


class Commands:
    """Binds the methods of the unit to their functions.

    Args:
        mailbox: The bridge.
        unit: The unit, whose nodes exist.
        registers: The register map.
        parameters: Meaning of the numbered parameters.
    """

    def __init__(
        self, mailbox: Mailbox, unit: Unit, registers: Sequence[Register], parameters: Sequence[Parameter]
    ) -> None:
        self._mailbox, self._unit, self._parameters = mailbox, unit, parameters
        self._registers = {each.name: each for each in registers}
        self._shown = shown(registers)

    async def bind(self, add: Callable[[ua.NodeId, Callable[..., Any]], object]) -> None:
        """Add the unit's own methods, and give every method its function by `add`."""
        for path, control in _CONTROLS:
            rights = ("stop", "command") if control in (Control.STOP, Control.ABORT) else _COMMAND
            add(self._unit.place(path), _checked(rights, [], partial(self._control, control)))
        # Methods that PackML requires and that this cell does not support.
        for name in ("SetUnitMode", "SetMachSpeed", "SetProduct", "SetParameter"):
            add(self._unit.place(f"{UNIT}.{name}"), _not_supported)
        arguments = {
            name: _argument(title(register), variant_type(register), register.meaning)
            for name, register in self._registers.items()
            if register.type != "bool"
        }
        limits = "; ".join(f"{p.name} {p.low:g} to {p.high:g} {p.unit}" for p in self._parameters)
        given = _argument("Parameters", ua.VariantType.Double, f"in this order, NaN for the default: {limits}", 1)
        asked = [arguments[f"command_{name}"] for name in ("sequence", "code", "recipe", "serial")]
        remedy = _argument("Remedy", ua.VariantType.String, "what to do about a refusal; empty without one")
        answer = [*(arguments[name] for name in _ANSWERED), remedy]
        lease = [arguments["command_lease"]], [arguments["report_lease"]]
        report = [arguments[each.name] for each in self._shown]
        await self._own(add, "Command", self._command, [*asked, given], answer)
        await self._own(add, "Acknowledge", self._acknowledge, asked[:1], [])
        await self._own(add, "Lease", self._lease, *lease)
        await self._own(add, "Answer", self._answer, [], report, ("read",))

    async def _own(
        self,
        add: Callable[[ua.NodeId, Callable[..., Any]], object],
        name: str,
        body: Body,
        inputs: Sequence[ua.Argument],
        outputs: Sequence[ua.Argument],
        rights: tuple[Right, ...] = _COMMAND,
    ) -> None:
        place = self._unit.place(f"{UNIT}.{name}")
        await self._unit.nodes.method(place, name, self._unit.place(UNIT), (inputs, outputs))
        add(place, _checked(rights, inputs, body))

    async def _control(self, control: Control, session: CellSession) -> list[ua.Variant]:
        order = self._mailbox.control(session.link, control)
        await _until(lambda: order.is_decided)
        if not order.is_decided:
            raise NotDoneError(ua.StatusCodes.BadTimeout)
        if order.result is not Result.SUCCESS:
            raise NotDoneError(_STATUS.get(order.refusal, ua.StatusCodes.BadInvalidState))
        return []

    async def _command(
        self, session: CellSession, sequence: int, code: int, recipe: int, serial: str | None, given: list[float] | None
    ) -> list[ua.Variant]:
        link, text, values = session.link, serial or "", given or []
        _require_sendable(text, values)
        scales = [each.scale for each in self._parameters] + [1.0] * PARAMETERS
        counts = tuple((n, round(value / scales[n])) for n, value in enumerate(values) if not math.isnan(value))
        session.image = CommandImage(sequence=sequence, code=code, recipe=recipe, serial=text, parameters=counts)
        session.is_numbered = True
        self._mailbox.wrote(link, session.image)
        await _until(lambda: session.link != link or self._mailbox.report_for(link).answered == sequence)
        answer = self._values(link, _ANSWERED)
        return [*answer, ua.Variant(REMEDIES[Refusal(answer[1].Value)], ua.VariantType.String)]

    async def _acknowledge(self, session: CellSession, sequence: int) -> list[ua.Variant]:
        self._mailbox.acknowledge(session.link, sequence)
        return []

    async def _lease(self, session: CellSession, wish: int) -> list[ua.Variant]:
        if not Lease.NONE <= wish <= Lease.RELEASE:
            raise NotDoneError(ua.StatusCodes.BadInvalidArgument, [ua.StatusCodes.BadOutOfRange])
        self._mailbox.wrote(session.link, replace(session.image, lease=wish), session.is_numbered)
        return self._values(session.link, ["report_lease"])

    async def _answer(self, session: CellSession) -> list[ua.Variant]:
        return self._values(session.link, [each.name for each in self._shown])

    def _values(self, link: str, names: Sequence[str]) -> list[ua.Variant]:
        if not link:
            raise NotDoneError(ua.StatusCodes.BadSessionClosed)
        values = REPORT.unpack(self._mailbox.report_words(link))
        return [ua.Variant(values[name], variant_type(self._registers[name])) for name in names]


def _argument(name: str, kind: ua.VariantType, meaning: str, rank: int = -1) -> ua.Argument:
    argument = ua.Argument(Name=name, DataType=ua.NodeId(int(kind)), ValueRank=rank)
    argument.Description = ua.LocalizedText(meaning)
    return argument


def _checked(rights: tuple[Right, ...], inputs: Sequence[ua.Argument], body: Body) -> Callable[..., Any]:
    """Return the function of a method, which checks rights and arguments before `body`; asyncua checks neither."""

    async def call(_: ua.NodeId, *arguments: ua.Variant) -> Any:
        session = SESSION.get()
        try:
            session.demand(*rights)
            _require_fits(arguments, inputs)
            return await body(session, *(each.Value for each in arguments))
        except ServiceError as error:
            return ua.StatusCode(error.code)
        except NotDoneError as error:
            return error.result

    return call


def _require_fits(arguments: Sequence[ua.Variant], inputs: Sequence[ua.Argument]) -> None:
    """Require the declared number and types of arguments.

    Raises:
        NotDoneError: The number of arguments, or the type of one of them, is wrong.
    """
    codes = ua.StatusCodes
    if len(arguments) != len(inputs):
        is_short = len(arguments) < len(inputs)
        raise NotDoneError(codes.BadArgumentsMissing if is_short else codes.BadTooManyArguments)
    results = [codes.Good if _fits(*pair) else codes.BadTypeMismatch for pair in zip(arguments, inputs, strict=True)]
    if any(results):
        raise NotDoneError(codes.BadInvalidArgument, results)


def _fits(given: ua.Variant, argument: ua.Argument) -> bool:
    is_array = argument.ValueRank > 0
    if is_array and given.Value is None:
        return True
    kind = ua.VariantType(argument.DataType.Identifier)
    return bool(given.VariantType == kind) and isinstance(given.Value, list) == is_array


def _require_sendable(serial: str, parameters: Sequence[float]) -> None:
    """Require arguments of `Command` that fit into a command block.

    Raises:
        NotDoneError: The serial number is too long, or there are too many parameters, or an infinite one.
    """
    is_bad = (len(serial) > 2 * 16, len(parameters) > PARAMETERS or any(map(math.isinf, parameters)))
    if any(is_bad):
        results = [ua.StatusCodes.BadOutOfRange if each else ua.StatusCodes.Good for each in (False,) * 3 + is_bad]
        raise NotDoneError(ua.StatusCodes.BadInvalidArgument, results)


async def _not_supported(_: ua.NodeId, *__: ua.Variant) -> ua.StatusCode:
    return ua.StatusCode(ua.StatusCodes.BadNotSupported)


async def _until(is_done: Callable[[], bool]) -> None:
    """Wait until `is_done` returns True, for a bounded time."""
    loop = asyncio.get_running_loop()
    # Longest wait of a method for the scan thread, s; a later answer is read by `Answer`.
    end = loop.time() + 0.5
    while not is_done() and loop.time() < end:
        # Time between two checks for the answer, s.
        await asyncio.sleep(0.005)
