import pytest

from plc_bridge.canopen.heartbeat import HeartbeatConsumer, HeartbeatProducer


def test_a_late_look_does_not_bring_a_burst():
    producer = HeartbeatProducer(0.1)
    producer.is_due(10.0)
    assert [producer.is_due(11.0), producer.is_due(11.0)] == [True, False]


def test_beats_keep_their_rate_although_looks_are_coarse():
    producer = HeartbeatProducer(0.1)
    assert sum(producer.is_due(10.0 + tick * 0.015) for tick in range(1000)) == pytest.approx(150, abs=1)


@pytest.mark.parametrize(("age", "is_lost"), [(0.5, False), (0.51, True)])
def test_a_node_is_lost_after_its_time(age, is_lost):
    consumer = HeartbeatConsumer(1, 0.5)
    consumer.hear(100.0)
    assert consumer.has_lost(100.0 + age) is is_lost


def test_without_a_time_nothing_is_sent_or_watched():
    assert not HeartbeatProducer(0.0).is_due(10.0)
    consumer = HeartbeatConsumer(1, 0.0)
    assert not consumer.hear(100.0)
    assert not consumer.has_lost(200.0)
