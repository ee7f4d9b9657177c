"""Modules that exchange their places are named; motion of the peg is no exchange."""

from dataclasses import replace

import numpy as np
import pytest

from drivers.errors import SkinUntrustedError
from drivers.skin.layout import exchanges
from drivers.skin.order import TOLD, TaxelOrder
from tests.pegs import LOAD, SKIN, pushed, readings

NOISE = np.full((2, 20), SKIN.noise * SKIN.full_scale)
REST = 5000.0 + np.random.default_rng(0).normal(0.0, 250.0, (2, 20))
TRUSTED = np.ones((2, 20), dtype=bool)


def frames(load, count, seed=1):
    """Return raw frames of a held peg."""
    rng = np.random.default_rng(seed)
    return [REST + readings("parallelogram", load, rng) for _ in range(count)]


def taken(order, raws):
    """Pass raw frames to the order and return it."""
    for raw in raws:
        order.take(raw, raw - REST, TRUSTED)
    return order


def as_told(raw, exchange):
    return raw.ravel()[exchanges("parallelogram")[exchange]].reshape(raw.shape)


ASLANT = pushed(np.random.default_rng(4), np.radians(6.0), 1e-3, LOAD)


@pytest.mark.parametrize("exchange", exchanges("parallelogram"))
def test_taxels_that_change_places_between_two_frames_are_named(exchange):
    order = TaxelOrder("parallelogram", NOISE)
    raws = frames(ASLANT, 4)
    taken(order, [*raws[:2], *(as_told(raw, exchange) for raw in raws[2:])])
    with pytest.raises(SkinUntrustedError, match=f"skin: {exchange} exchanged while the skin ran"):
        order.require()


def test_an_exchange_is_reported_for_some_frames_and_then_accepted():
    raws = [as_told(raw, "the two fingers") for raw in frames(ASLANT, TOLD + 6)]
    unasked, order = (taken(TaxelOrder("parallelogram", NOISE), [*frames(ASLANT, 2, 2), *raws[:2]]) for _ in range(2))
    for raw in raws[2 : TOLD + 3]:
        with pytest.raises(SkinUntrustedError, match="the two fingers"):
            order.require()
        taken(order, [raw])
    order.require()
    with pytest.raises(SkinUntrustedError, match="the two fingers"):
        taken(unasked, raws[2:]).require()


def test_a_single_frame_and_a_print_that_was_not_steady_change_no_order():
    raws, turned = frames(ASLANT, 2), [as_told(raw, "the two fingers") for raw in frames(ASLANT, 2, 2)]
    taken(TaxelOrder("parallelogram", NOISE), [*raws, turned[0], *raws]).require()
    taken(TaxelOrder("parallelogram", NOISE), [REST, raws[0], *turned]).require()


def test_a_hand_that_closes_and_a_peg_that_turns_change_no_order():
    rng = np.random.default_rng(3)
    angles = np.radians([0.0, 2.0, 6.0, 5.0, -3.0, -8.0, 1.0, 9.0])
    held = [REST + readings("parallelogram", pushed(rng, angle, 5e-4, LOAD), rng) for angle in angles]
    empty = [REST + rng.normal(0.0, 300.0, REST.shape) for _ in range(3)]
    taken(TaxelOrder("parallelogram", NOISE), [*empty, *held, *empty]).require()


def test_untrusted_taxels_show_no_exchange():
    raws, order = frames(ASLANT, 4), TaxelOrder("parallelogram", NOISE)
    for raw in (*raws[:2], *(as_told(raw, "the two fingers") for raw in raws[2:])):
        order.take(raw, raw - REST, ~TRUSTED)
    order.require()


def test_a_peg_that_slips_to_about_the_mirrored_angle_changes_no_order():
    """An exchange of the fingers explains the step far better than none does, but not to within the noise of the taxels."""
    rng = np.random.default_rng(7)
    leaning = replace(LOAD, theta=np.radians(6.0), offset=1e-3, across=2.0, tilting=0.09)
    slipped = replace(LOAD, theta=np.radians(-10.0), offset=-1e-3, across=-2.0, tilting=-0.09)
    raws = [REST + readings("parallelogram", load, rng) for load in (*[leaning] * 3, *[slipped] * 3)]
    taken(TaxelOrder("parallelogram", NOISE), raws).require()
