"""Judges of a grasp: whether it shows a peg, and whether its modules are in their places."""

from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest

from drivers.errors import SkinUntrustedError
from drivers.skin.layout import LAYOUTS, module_exchanges, module_of
from skills.tactile.order import PrintOrder
from skills.tactile.steady import JUDGED, NEEDED, STEADY, GraspPrint, restless_modules
from tests.pegs import framed, pushed, readings, untaught

MOST = STEADY * LAYOUTS["parallelogram"].full_scale
WORDS = "no print of the peg since the hand closed on it"


def frames(number, count=JUDGED + 1, spoilt=None):
    """Return the readings of one grasp; `spoilt` changes those of a frame."""
    rng = np.random.default_rng(number)
    load = pushed(rng, 0.05, 0.0)
    told = [readings("parallelogram", load, rng) for _ in range(count)]
    return told if spoilt is None else [spoilt(values, rng) for values in told]


def at_random(module):
    return lambda values, rng: np.where(
        module == module_of("parallelogram"), rng.integers(-8000, 34_000, values.shape), values
    )


def restless(before, frame):
    return restless_modules(before, frame, "parallelogram")


def judged(told, prints=None):
    """Return the judge of frames after its verdict; `prints` lists the frames in which the estimator finds a peg."""
    shown = GraspPrint("parallelogram")
    for values, is_print in zip(told, prints or [True] * len(told), strict=False):
        if not shown.is_judged:
            shown.take(framed(values), is_print)
    return shown


@pytest.mark.parametrize("number", range(5))
def test_a_peg_at_rest_is_a_print_whatever_the_first_frame(number):
    shown = judged(frames(number), [number % 2 == 0, *[True] * JUDGED])
    assert shown.is_judged
    shown.require()


@pytest.mark.parametrize("module", range(4))
@pytest.mark.parametrize("number", range(3))
def test_a_module_that_reads_at_random_is_named(module, number):
    name = f"{('left', 'right')[module // 2]} finger, module {module % 2} reads at random"
    with pytest.raises(SkinUntrustedError, match=f"{WORDS}.*{name}"):
        judged(frames(number, spoilt=at_random(module))).require()


@pytest.mark.parametrize(("agreeing", "is_believed"), [(NEEDED, True), (NEEDED - 1, False)])
def test_enough_frames_have_to_show_the_peg(agreeing, is_believed):
    prints = [True, *[False] * (JUDGED - agreeing), *[True] * agreeing]
    shown, words = judged(frames(1), prints), rf"{WORDS}: {agreeing} of {JUDGED} frames show it; 3 needed; a line"
    assert shown.is_judged
    with nullcontext() if is_believed else pytest.raises(SkinUntrustedError, match=words):
        shown.require()


def test_frames_are_judged_until_the_verdict_is_certain():
    for spoilt, prints, needed in ((None, True, NEEDED), (at_random(1), True, NEEDED), (None, False, JUDGED)):
        told = frames(1, spoilt=spoilt)
        assert not judged(told[:needed], [prints] * JUDGED).is_judged
        assert judged(told[: needed + 1], [prints] * (JUDGED + 1)).is_judged


def test_without_a_frame_no_peg_is_believed():
    with pytest.raises(SkinUntrustedError, match="0 of 0 frames"):
        GraspPrint("parallelogram").require()


@pytest.mark.parametrize(("change", "is_restless"), [(MOST, False), (MOST + 1.0, True)])
def test_a_module_may_change_as_much_as_the_bound_says(change, is_restless):
    before = np.full((2, 20), 2000.0)
    after = before + np.where(module_of("parallelogram") == 3, change, 0.0)
    expected = [False, False, False, is_restless]
    assert restless(framed(before), framed(after)).tolist() == expected
    assert restless(framed(after), framed(before)).tolist() == expected


LEFT = np.arange(40).reshape(2, 20)
"""Numbers of the taxels; those of module 0 are 0 to 9, those of module 3 are 30 to 39."""
WILD = {
    "few taxels": (LEFT < 4, LEFT >= 0, []),
    "more than half": (LEFT < 6, LEFT >= 0, [0]),
    "untrusted ones": ((LEFT < 5) | (LEFT >= 30), (LEFT >= 5) & (LEFT < 30), []),
    "none trusted": (LEFT < 6, LEFT < 0, []),
    "a single trusted one": (LEFT >= 0, (module_of("parallelogram") != 1) | (LEFT == 10), [0, 1, 2, 3]),
}


@pytest.mark.parametrize(("wild", "trusted", "restless_ones"), WILD.values(), ids=WILD)
def test_a_module_is_restless_by_more_than_half_of_its_trusted_taxels(wild, trusted, restless_ones):
    after = np.where(wild, 30_000.0, 0.0)
    assert np.flatnonzero(restless(framed(np.zeros((2, 20))), framed(after, trusted))).tolist() == restless_ones


@pytest.mark.parametrize("is_first", [True, False])
def test_a_taxel_that_is_not_trusted_in_both_frames_does_not_count(is_first):
    calm, wild = (framed(np.full((2, 20), value)) for value in (0.0, 30_000.0))
    untrusted = replace(calm if is_first else wild, trusted=module_of("parallelogram") != 1)
    pair = (untrusted, wild) if is_first else (calm, untrusted)
    assert restless(*pair).tolist() == [True, False, True, True]


@pytest.mark.parametrize("places", [(2,), (3, 6)])
def test_a_module_restless_in_few_frames_is_not_named(places):
    told = frames(1)
    for place in places:
        told[place] = at_random(0)(told[place], np.random.default_rng(place))
    with pytest.raises(SkinUntrustedError, match=r"0 of [68] frames .*; a line across both pads"):
        judged(told, [False] * (JUDGED + 1)).require()


def grasp_of(layout, number, theta=0.05, offset=1e-3, exchange=None):
    """Return the readings of one grasp, with these modules exchanged."""
    rng = np.random.default_rng(number)
    load = pushed(rng, theta, offset)
    order = module_exchanges("parallelogram")[exchange] if exchange else slice(None)
    return [readings(layout, load, rng).ravel()[order].reshape(2, 20) for _ in range(NEEDED)]


def require_order(layout, values, judge=None):
    """Judge the order of the modules by these frames."""
    order = PrintOrder(judge or untaught(layout), layout)
    for each in values:
        order.take(framed(each))
    order.require()


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("exchange", module_exchanges("parallelogram"))
def test_exchanged_modules_are_found_by_the_print_of_the_grasp(layout, exchange):
    with pytest.raises(SkinUntrustedError, match=f"as with {exchange} exchanged"):
        require_order(layout, grasp_of(layout, 1, exchange=exchange))


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("number", range(5))
def test_modules_in_their_places_are_believed(layout, number):
    rng = np.random.default_rng(number)
    require_order(layout, grasp_of(layout, number, rng.uniform(-0.1, 0.1), rng.normal(0.0, 1e-3)))


def test_exchanged_fingers_show_a_peg_that_leans_the_other_way():
    values, *_ = grasp_of("parallelogram", 2)
    as_held, mirrored = (untaught("parallelogram").estimate(framed(each)) for each in (values, values[::-1]))
    assert mirrored.theta == pytest.approx(-as_held.theta, abs=np.radians(1.0))
    require_order("parallelogram", [values[::-1]] * NEEDED)


EXCHANGED = grasp_of("parallelogram", 1, exchange="the two modules of each finger")


@pytest.mark.parametrize(
    ("values", "judge"),
    [
        (EXCHANGED[1:], None),
        (np.random.default_rng(5).normal(0.0, 300.0, (NEEDED, 2, 20)), None),
        (EXCHANGED, object()),
    ],
    ids=["too few frames", "no print", "estimator without templates"],
)
def test_without_evidence_no_order_is_refused(values, judge):
    require_order("parallelogram", values, judge)
