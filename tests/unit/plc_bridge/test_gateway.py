"""The exported function block behind a Modbus gateway, which passes on the newest blocks once in its update time."""

import pytest

from plc_bridge.protocol.messages import Control, Report, Result
from tests.scan_thread import take
from tests.unit.plc_bridge.exports.test_structured_text import CYCLE, INSERT, Plc

LIFE_TIMEOUT = 1.0  # s, as shipped
LONGEST = 20_000  # cycles


class GatewayPlc(Plc):
    """A PLC with a gateway to the cell, which writes cyclically, or only what has changed."""

    def __init__(self, update, repeats):
        self.update, self.repeats, self.passed, self.written = update, repeats, 0.0, None
        super().__init__()
        self.v["SilentTime"] = 10 * LIFE_TIMEOUT

    def cycle(self, count=1, **inputs):
        self.v.update(inputs)
        for _ in range(count):
            self.block()
            self.now += CYCLE
            if self.now - self.passed >= self.update:
                self.passed = self.now
                self.pass_on()
            self.publish(self.report)
        return self

    def pass_on(self):
        command = self.command()
        for _ in range(self.repeats if command != self.written else self.repeats - 1):
            self.bridge.wrote(self.source, command)
        self.written = command
        self.take_report()

    def until(self, look, **inputs):
        """Return the first true value of `look`, which is called once a cycle."""
        self.v.update(inputs)
        for _ in range(LONGEST):
            if found := look():
                return found
            self.cycle()
        raise AssertionError(self.shown)

    def run(self):
        """Insert one peg and return the outputs of the block."""
        self.until(lambda: self.v["Busy"], Execute=True)
        command = self.until(lambda: take(self.bridge))
        self.publish(Report(sequence=command.sequence, state=17, result=Result.SUCCESS))
        shown = self.until(lambda: not self.v["Busy"] and self.shown)
        self.until(lambda: (told := self.bridge.poll()) and told.code == Control.ACKNOWLEDGE, Execute=False)
        return shown


@pytest.mark.parametrize("repeats", [1, 3])
@pytest.mark.parametrize("update", [0.01, LIFE_TIMEOUT / 10])
def test_twenty_pegs_through_a_gateway(update, repeats):
    plc = GatewayPlc(update, repeats)
    plc.until(lambda: plc.v["IsReady"], Code=INSERT)
    assert [plc.run() for _ in range(20)] == [["Done"]] * 20


def test_a_gateway_that_is_slower_than_the_life_timeout_ends_the_run():
    plc = GatewayPlc(1.4 * LIFE_TIMEOUT, 1)
    plc.until(lambda: plc.v["IsReady"], Code=INSERT)
    plc.until(lambda: plc.v["Busy"], Execute=True)
    command = plc.until(lambda: take(plc.bridge))
    plc.publish(Report(sequence=command.sequence, state=6))
    plc.until(lambda: (told := plc.bridge.poll()) and told.code == Control.LOST)
    plc.publish(Report(sequence=command.sequence, state=9, result=Result.FAULT, fault=1006))
    plc.until(lambda: not plc.v["Busy"])
    assert (plc.shown, plc.v["ErrorID"]) == (["Error"], 1006)
