from functools import lru_cache

import numpy as np
import pytest

from drivers.errors import SkinUntrustedError
from drivers.skin.layout import LAYOUTS, module_exchanges
from skills.tactile.order import LEAST_FRAMES, PrintOrder
from skills.tactile.robust import RobustEstimator, RobustParams
from tests.pegs import framed, pushed, readings, shipped


@lru_cache
def estimator(layout):
    return RobustEstimator(RobustParams(), layout, shipped().peg)


def frames(layout, number, theta=0.05, offset=1e-3):
    """Return the frames of one grasp."""
    rng = np.random.default_rng(number)
    load = pushed(rng, theta, offset)
    return [readings(layout, load, rng) for _ in range(LEAST_FRAMES)]


def order_of(layout, values):
    order = PrintOrder(estimator(layout), layout)
    for each in values:
        order.take(framed(each))
    return order


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("exchange", module_exchanges("parallelogram"))
def test_modules_that_have_each_others_places_are_found_by_the_print_of_the_grasp(layout, exchange):
    told = [each.ravel()[module_exchanges("parallelogram")[exchange]].reshape(2, 20) for each in frames(layout, 1)]
    with pytest.raises(SkinUntrustedError, match=f"as with {exchange} exchanged"):
        order_of(layout, told).require()


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("number", range(5))
def test_modules_in_their_places_are_believed(layout, number):
    rng = np.random.default_rng(number)
    order_of(layout, frames(layout, number, rng.uniform(-0.1, 0.1), rng.normal(0.0, 1e-3))).require()


def test_fingers_that_have_each_others_places_show_the_print_of_a_peg_that_leans_the_other_way():
    (values,) = frames("parallelogram", 2)[:1]
    as_held, mirrored = (estimator("parallelogram").estimate(framed(each)) for each in (values, values[::-1]))
    assert mirrored.theta == pytest.approx(-as_held.theta, abs=np.radians(1.0))
    order_of("parallelogram", [values[::-1]] * LEAST_FRAMES).require()


def test_fewer_frames_say_nothing():
    told = [
        each.ravel()[module_exchanges("parallelogram")["the two modules of each finger"]].reshape(2, 20)
        for each in frames("parallelogram", 1)
    ]
    order_of("parallelogram", told[1:]).require()


def test_a_skin_that_shows_no_print_says_nothing_of_its_order():
    rng = np.random.default_rng(5)
    order_of("parallelogram", [rng.normal(0.0, 300.0, (2, 20)) for _ in range(LEAST_FRAMES)]).require()


def test_an_estimator_without_templates_says_nothing_of_the_order():
    order = PrintOrder(object(), "parallelogram")
    for each in frames("parallelogram", 1):
        order.take(framed(each))
    order.require()
