from plc_bridge.links import Order
from plc_bridge.messages import Command, Control
from plc_bridge.orders import Orders

RUN, HOLD = Order(Command(1, 100)), Order(Command(2, Control.HOLD))


def queue(*orders):
    made = Orders()
    for order in orders:
        made.add(order)
    return made


def test_first_come_first_served():
    orders = queue(RUN, HOLD)
    assert [*orders.next(), *orders.next(), *orders.next()] == [RUN, HOLD]


def test_a_stop_goes_ahead_and_drops_what_waits():
    orders, stop = queue(RUN, HOLD), Order(Command(3, Control.STOP))
    assert orders.stop(stop) == (RUN, HOLD)
    assert [*orders.next(), *orders.next()] == [stop]


def test_what_comes_behind_a_stop_waits_for_it():
    orders, stop = Orders(), Order(Command(3, Control.STOP))
    orders.stop(stop)
    orders.add(RUN)
    assert [*orders.next(), *orders.next()] == [stop, RUN]


def test_two_stops_of_the_same_kind_are_decided_together():
    one, other = Order(Command(1, Control.STOP)), Order(Command(7, Control.STOP))
    orders = Orders()
    orders.stop(one)
    orders.stop(other)
    assert list(orders.next()) == [one, other]
