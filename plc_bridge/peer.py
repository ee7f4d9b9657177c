"""The PLC's side of the map over Modbus TCP: for demos, the terminal and tests of the line."""

import logging
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from pymodbus.client import ModbusTcpClient
from pymodbus.exceptions import ModbusException
from pymodbus.pdu import ModbusPDU

from drivers.errors import CellError, FaultCode
from plc_bridge.protocol.images import COMMAND, DIAGNOSTICS, REPORT, CommandImage, command_words
from plc_bridge.protocol.messages import Diagnostics, LeaseState, Report, Result
from plc_bridge.protocol.registers import COILS, VERSION, Lease

logging.getLogger("pymodbus.logging").setLevel(logging.CRITICAL)  # its errors are raised here


class CellSilentError(CellError, code=FaultCode.PLC_LOST):
    """The cell cannot be reached, or does not answer in time."""


class Peer:
    """A PLC that commands the cell, on Modbus TCP; not for use by several threads.

    Every method that waits also advances the life counter, so that the cell does not count the run as lost. Between calls
    the caller must keep the connection alive with `cycle`.

    Args:
        host: Address of the cell.
        port: Port of the cell.
        timeout: Longest wait for one answer, s.
        wait: Waits this number of seconds.
        now: Monotonic time, s.
    """

    def __init__(
        self,
        host: str,
        port: int,
        *,
        timeout: float = 3.0,
        wait: Callable[[float], None] = time.sleep,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        self._where = f"{host}:{port}"
        # Time between two cycles while waiting, s.
        self._period, self._wait, self._now = 0.02, wait, now
        self._image = CommandImage(version=VERSION)
        self._client: Any = ModbusTcpClient(  # some of its methods carry no types
            host, port=port, timeout=timeout, retries=0
        )

    def connect(self) -> Report:
        """Connect as a new client and return the report; the client's first number is far from that of the last run.

        Raises:
            CellSilentError: The cell does not answer.
        """
        self._open()
        # Distance of a new client's first number from the number of the run in the cell's report.
        sequence = (self.read_report().sequence + 0x8000) % 0x10000
        self._image = CommandImage(sequence=sequence, version=VERSION)
        return self.cycle()

    def look(self) -> Report:
        """Connect as a spectator, which writes nothing and sees the run of any link, and return the report.

        Raises:
            CellSilentError: The cell does not answer.
        """
        self._open()
        return self.read_report()

    def cycle(self) -> Report:
        """Advance the life counter, write the command block in one request, return the report."""
        life = self._image.life % 0xFFFF + 1
        self._image = replace(self._image, life=life, life_tail=life)
        self._write(self._image)
        return self.read_report()

    def take(self) -> bool:
        """Request the lease and return True if the cell has given it; it lasts until `release` or until a silence."""
        self._image = replace(self._image, lease=Lease.TAKE)
        return self.cycle().lease == LeaseState.YOURS

    def release(self) -> None:
        """Release the lease."""
        self._image = replace(self._image, lease=Lease.RELEASE)
        self.cycle()
        self._image = replace(self._image, lease=Lease.NONE)

    def trigger(
        self, code: int, recipe: int = 0, serial: str = "", parameters: Sequence[tuple[int, int]] = ()
    ) -> Report:
        """Send one command under the next sequence number; return the next report, which can still lack the answer.

        Args:
            code: A program, a skill or a `Control`.
            recipe: Number of the recipe.
            serial: Serial number of the part.
            parameters: Number from 0 and raw count of each parameter given.
        """
        self._image = replace(
            self._image,
            sequence=(self._image.sequence + 1) % 0x10000,
            code=code,
            recipe=recipe,
            serial=serial,
            parameters=tuple(parameters),
        )
        return self.cycle()

    def wait_for_result(self, timeout: float, watch: Callable[[Report], None] | None = None) -> Report:
        """Wait until the last command ends or is refused, and return the report with its result or refusal.

        Args:
            timeout: Longest wait, s.
            watch: Called with every report during the wait.

        Raises:
            CellSilentError: There is no result in time, or the connection is lost.
        """
        number, deadline = self._image.sequence, self._now() + timeout
        while True:
            report = self.cycle()
            if watch is not None:
                watch(report)
            is_answered = report.answered == number
            if (report.sequence == number and report.result != Result.NONE) or (is_answered and report.refusal):
                return report
            if is_answered and report.answered_result != Result.NONE:
                # If a control was sent during a run, the run's own result stays in view.
                return replace(report, sequence=report.answered, result=report.answered_result)
            self._wait_before(deadline, "result", timeout)

    def wait_for_answer(self, timeout: float) -> Report:
        """Wait until the last command is accepted or refused, and return the report with the answer.

        Args:
            timeout: Longest wait, s.

        Raises:
            CellSilentError: There is no answer in time, or the connection is lost.
        """
        deadline = self._now() + timeout
        while (report := self.cycle()).answered != self._image.sequence:
            self._wait_before(deadline, "answer", timeout)
        return report

    def _wait_before(self, deadline: float, what: str, timeout: float) -> None:
        """Wait one period; raise a CellSilentError after the deadline."""
        if self._now() > deadline:
            raise CellSilentError(f"{self._where}: no {what} of command {self._image.sequence} in {timeout:g} s")
        self._wait(self._period)

    def acknowledge(self) -> Report:
        """Acknowledge the result of the last command."""
        self._image = replace(self._image, acknowledge=self._image.sequence)
        return self.cycle()

    def run(
        self,
        code: int,
        recipe: int = 0,
        serial: str = "",
        parameters: Sequence[tuple[int, int]] = (),
        *,
        timeout: float,
        watch: Callable[[Report], None] | None = None,
    ) -> Report:
        """Trigger, wait for the result, acknowledge it; return the report with the result or the refusal."""
        self.trigger(code, recipe, serial, parameters)
        report = self.wait_for_result(timeout, watch)
        self.acknowledge()
        return report

    # Calls whose implementation depends on the bus.

    def close(self) -> None:
        """Disconnect; may be called again."""
        self._client.close()

    def read_report(self) -> Report:
        """Return the report; writes nothing."""
        return REPORT.read(self._read(REPORT.start, REPORT.words))

    def read_diagnostics(self) -> Diagnostics:
        """Return the cell's counts; writes nothing."""
        return DIAGNOSTICS.read(self._read(DIAGNOSTICS.start, DIAGNOSTICS.words))

    def stop(self) -> None:
        """Stop the cell, independent of the lease."""
        self._ask(lambda: self._client.write_coil(COILS["stop"], True))
        self._ask(lambda: self._client.write_coil(COILS["stop"], False))

    def _open(self) -> None:
        if not self._client.connect():
            raise CellSilentError(f"no cell answers at {self._where}: is `cell serve` running there?")

    def _write(self, image: CommandImage) -> None:
        words = command_words(image)
        self._ask(lambda: self._client.write_registers(COMMAND.start, words))

    def _read(self, address: int, count: int) -> list[int]:
        answer = self._ask(lambda: self._client.read_input_registers(address, count=count))
        return list(answer.registers)

    def _ask(self, request: Callable[[], ModbusPDU]) -> ModbusPDU:
        if not self._client.connected:
            raise CellSilentError(f"{self._where}: the connection is lost")
        try:
            answer = request()
        except (ModbusException, OSError) as error:
            self._client.close()
            raise CellSilentError(f"{self._where}: {error}".replace("\n", " ")) from error
        if answer.isError():
            raise CellSilentError(
                f"{self._where}: exception {answer.exception_code}; is this a cell of the same version?"
            )
        return answer
