"""Status bits of the report exclude each other, and its life counter counts."""

import pytest
from pydantic import ValidationError

from plc_bridge.bridge import Bridge
from plc_bridge.config import ModbusConfig, PlcConfig
from plc_bridge.protocol.images import CommandImage
from plc_bridge.protocol.messages import Report, Result
from tests.scan_thread import take


@pytest.fixture
def bridge():
    bridge = Bridge(PlcConfig(), {100: "insert_peg"}, now=lambda: 0.0)
    bridge.opened("plc", "plc")
    return bridge


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


def test_bridge_that_never_started_can_be_closed(bridge):
    bridge.close()
    assert bridge.address == ("127.0.0.1", 5020)


@pytest.mark.parametrize(
    "wrong", [{"port": 65536}, {"port": -1}, {"hots": "0.0.0.0"}, {"allow": ["10.0.0.300"]}, {"idle_timeout": 0}]
)
def test_wrong_configuration_is_rejected(wrong):
    with pytest.raises(ValidationError):
        ModbusConfig(**wrong)
