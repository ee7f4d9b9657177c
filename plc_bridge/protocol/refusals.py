"""The refusals of a command block that do not need the scan thread, and its parameters in their units; pure."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from plc_bridge.protocol.images import CommandImage
from plc_bridge.protocol.messages import FIRST_PROGRAM, Control, Refusal
from plc_bridge.protocol.registers import SERIAL_NUMBER, VERSION_MAJOR, Parameter

CONTROLS = frozenset(control.value for control in Control if control < FIRST_PROGRAM) - {Control.START.value}
STOPS = frozenset({Control.STOP.value, Control.ABORT.value})
"""Controls that every link may give, and that precede all other commands."""


class BadParameterError(Exception):
    """A parameter is invalid; `detail` is its number from 1, or `SERIAL_NUMBER`."""

    def __init__(self, detail: int) -> None:
        super().__init__(detail)
        self.detail = detail


@dataclass(frozen=True, slots=True)
class Rules:
    """Rules for the commands of a cell.

    Args:
        programs: Name of each program and skill by its command code, from 100 on.
        parameters: Meaning of the numbered parameters.
    """

    programs: Mapping[int, str]
    parameters: Sequence[Parameter] = ()

    def refuse_code(self, image: CommandImage) -> Refusal:
        """Return the refusal of a command block that is independent of its sender, or NONE."""
        if image.version and image.version >> 8 != VERSION_MAJOR:
            return Refusal.VERSION
        if image.code not in CONTROLS and image.code not in self.programs:
            return Refusal.UNKNOWN_CODE
        return Refusal.NONE

    def parameters_of(self, image: CommandImage) -> tuple[tuple[str, float], ...]:
        """Return the parameters in their units.

        Raises:
            BadParameterError: A parameter is unknown or beyond its limits, or the serial number cannot be printed.
        """
        if not image.serial.isascii() or not image.serial.isprintable():
            raise BadParameterError(SERIAL_NUMBER)
        values = []
        for number, count in image.parameters:
            if number >= len(self.parameters):
                raise BadParameterError(number + 1)
            spec = self.parameters[number]
            value = count * spec.scale
            slack = spec.scale / 2  # limits need not be a multiple of the scale
            if not spec.low - slack <= value <= spec.high + slack:
                raise BadParameterError(number + 1)
            values.append((spec.name, min(max(value, spec.low), spec.high)))
        return tuple(values)
