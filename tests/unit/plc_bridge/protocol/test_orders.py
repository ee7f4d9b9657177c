import logging

from plc_bridge.protocol.lease import CellLease
from plc_bridge.protocol.links import Order
from plc_bridge.protocol.messages import Command, Control, Result
from plc_bridge.protocol.orders import Orders
from plc_bridge.protocol.peer_log import PeerLog

LOG = PeerLog(logging.getLogger("test"))


def order(sequence, code):
    return Order(Command(sequence, code))


def queue(*waiting):
    made = Orders(CellLease(5.0, LOG), LOG)
    for each in waiting:
        made.add(each)
    return made


def given(orders):
    """Return the commands that the scan thread gets, each accepted."""
    commands = []
    while (command := orders.next()) is not None:
        orders.accept(command)
        commands.append((command.sequence, command.code))
    return commands


def test_first_come_first_served():
    assert given(queue(order(1, 100), order(2, Control.HOLD))) == [(1, 100), (2, Control.HOLD)]


def test_what_comes_behind_a_stop_waits_for_it():
    orders = queue()
    orders.stop(order(3, Control.STOP))
    orders.add(order(1, 100))
    assert given(orders) == [(3, Control.STOP), (1, 100)]


def test_two_stops_of_the_same_kind_are_decided_together():
    one, other = order(1, Control.STOP), order(7, Control.STOP)
    orders = queue()
    orders.stop(one)
    orders.stop(other)
    assert given(orders) == [(1, Control.STOP)]
    assert (one.result, other.result) == (Result.SUCCESS, Result.SUCCESS)
