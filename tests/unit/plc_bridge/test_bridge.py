import pytest
from pydantic import ValidationError

from plc_bridge.bridge import Bridge
from plc_bridge.config import ModbusConfig, PlcConfig
from plc_bridge.protocol.images import CommandImage, report_image
from plc_bridge.protocol.messages import Command, Refusal, Report, Result
from plc_bridge.protocol.registers import STAGES
from tests.scan_thread import take


@pytest.fixture
def bridge():
    bridge = Bridge(PlcConfig(), {100: "insert_peg"}, now=lambda: 0.0)
    bridge.opened("plc", "plc")
    return bridge


def test_command_and_report_go_through(bridge):
    bridge.wrote("plc", CommandImage(sequence=1))
    bridge.wrote("plc", CommandImage(sequence=2, code=100, recipe=4))
    assert take(bridge) == Command(2, 100, 4, source="plc")
    bridge.publish(Report(sequence=2, state=17, result=Result.SUCCESS, run=9, stage_times=(1.0, 2.5), total_time=3.5))
    image = report_image(bridge.report_words("plc"))
    assert (image.sequence, image.result, image.run, image.holder) == (2, Result.SUCCESS, 9, "plc")
    assert image.stage_times == (1.0, 2.5, *[0.0] * (STAGES - 2))


def test_report_life_counts_with_every_report(bridge):
    bridge.publish(Report())
    bridge.publish(Report())
    image = bridge.report_for("plc")
    assert (image.life, image.life_tail) == (2, 2)


@pytest.mark.parametrize(
    ("result", "bits"),
    [
        (Result.NONE, [True, False, False, False]),
        (Result.SUCCESS, [False, True, False, False]),
        (Result.FAILURE, [False, False, True, False]),
        (Result.FAULT, [False, False, True, False]),
        (Result.REFUSED, [False, False, True, False]),
        (Result.ABORTED, [False, False, False, True]),
    ],
)
def test_busy_done_error_and_aborted_exclude_each_other(bridge, result, bits):
    bridge.wrote("plc", CommandImage(sequence=1))
    bridge.wrote("plc", CommandImage(sequence=2, code=100))
    take(bridge)
    bridge.publish(Report(sequence=2, result=result))
    assert bridge.discrete_inputs("plc")[:4] == bits


def test_local_user_holds_the_same_lease_and_starts_like_a_plc(bridge):
    assert bridge.take("terminal")
    bridge.wrote("plc", CommandImage(sequence=1))
    bridge.wrote("plc", CommandImage(sequence=2, code=100))
    assert bridge.report_for("plc").refusal == Refusal.NOT_HOLDER
    assert bridge.submit("terminal", CommandImage(code=100, serial="A")) is Refusal.NONE
    assert bridge.submit("terminal", CommandImage(code=100)) is Refusal.BUSY
    assert take(bridge) == Command(1, 100, serial="A", source="terminal")
    bridge.publish(Report(sequence=1, result=Result.SUCCESS))
    bridge.release("terminal")
    bridge.wrote("plc", CommandImage(sequence=3, code=100))
    assert bridge.poll() == Command(3, 100, source="plc")
    assert not bridge.take("terminal")


def test_bridge_that_never_started_can_be_closed(bridge):
    bridge.close()
    assert bridge.address == ("127.0.0.1", 5020)


@pytest.mark.parametrize(
    "wrong", [{"port": 65536}, {"port": -1}, {"hots": "0.0.0.0"}, {"allow": ["10.0.0.300"]}, {"idle_timeout": 0}]
)
def test_wrong_configuration_is_rejected(wrong):
    with pytest.raises(ValidationError):
        ModbusConfig(**wrong)
