from dataclasses import replace

import numpy as np
import pytest

from drivers.errors import SkinUntrustedError
from drivers.quantities import TaxelFrame
from drivers.skin.layout import LAYOUTS, module_of
from skills.tactile.steady import JUDGED, NEEDED, STEADY, GraspPrint, restless_modules
from tests.pegs import framed, pushed, readings

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
def test_a_peg_at_rest_in_the_hand_is_a_print_in_every_frame(number):
    shown = judged(frames(number))
    assert shown.is_judged
    shown.require()


@pytest.mark.parametrize("module", range(4))
@pytest.mark.parametrize("number", range(6))
def test_a_module_that_reads_at_random_is_told_although_every_frame_looks_like_a_print(module, number):
    name = f"{('left', 'right')[module // 2]} finger, module {module % 2} reads at random"
    with pytest.raises(SkinUntrustedError, match=f"{WORDS}.*{name}"):
        judged(frames(number, spoilt=at_random(module))).require()


@pytest.mark.parametrize(("agreeing", "is_believed"), [(NEEDED, True), (NEEDED - 1, False)])
def test_enough_frames_have_to_show_the_peg(agreeing, is_believed):
    prints = [True, *[False] * (JUDGED - agreeing), *[True] * agreeing]
    shown = judged(frames(1), prints)
    assert shown.is_judged
    if is_believed:
        shown.require()
        return
    with pytest.raises(SkinUntrustedError, match=rf"{WORDS}: {agreeing} of {JUDGED} frames show it; 3 needed; a line"):
        shown.require()


def test_frames_are_judged_no_longer_than_it_takes_to_tell():
    for spoilt, prints, needed in ((None, True, NEEDED), (at_random(1), True, NEEDED), (None, False, JUDGED)):
        told = frames(1, spoilt=spoilt)
        assert not judged(told[:needed], [prints] * JUDGED).is_judged
        assert judged(told[: needed + 1], [prints] * (JUDGED + 1)).is_judged


def test_a_module_that_reads_at_random_now_and_then_is_not_named():
    told = frames(1)
    told[2] = at_random(0)(told[2], np.random.default_rng(1))
    with pytest.raises(SkinUntrustedError, match="a line across both pads"):
        judged(told, [False] * (JUDGED + 1)).require()


def test_the_first_frame_after_the_hand_has_closed_may_be_anything():
    told = frames(1)
    shown = GraspPrint("parallelogram")
    shown.take(framed(told[0]), False)
    for values in told[1 : NEEDED + 1]:
        shown.take(framed(values), True)
    shown.require()


def test_without_a_frame_nothing_is_believed():
    with pytest.raises(SkinUntrustedError, match="0 of 0 frames"):
        GraspPrint("parallelogram").require()


@pytest.mark.parametrize(("change", "is_restless"), [(MOST, False), (MOST + 1.0, True)])
def test_a_module_may_change_as_much_as_the_bound_says(change, is_restless):
    before = np.full((2, 20), 2000.0)
    after = before + np.where(module_of("parallelogram") == 3, change, 0.0)
    expected = [False, False, False, is_restless]
    assert restless(framed(before), framed(after)).tolist() == expected
    assert restless(framed(after), framed(before)).tolist() == expected


def test_single_taxels_that_read_at_random_make_no_restless_module():
    before, after = np.zeros((2, 20)), np.zeros((2, 20))
    after[0, :4] = 30_000.0
    assert not restless(framed(before), framed(after)).any()
    after[0, :6] = 30_000.0
    assert restless(framed(before), framed(after)).tolist() == [True, False, False, False]


def test_taxels_that_are_not_trusted_and_modules_without_any_do_not_count():
    before, after = np.zeros((2, 20)), np.zeros((2, 20))
    after[0, :5], after[1, 10:] = 30_000.0, 30_000.0
    trusted = after == 0.0
    assert not restless(framed(before), framed(after, trusted)).any()
    assert not restless(framed(before), framed(after, np.zeros_like(trusted))).any()


@pytest.mark.parametrize("is_first", [True, False])
def test_a_taxel_that_is_not_trusted_in_both_frames_does_not_count(is_first):
    calm, wild = (
        TaxelFrame(np.full((2, 20), value), np.ones((2, 20), dtype=bool), 0.0, 1) for value in (0.0, 30_000.0)
    )
    untrusted = replace(calm if is_first else wild, trusted=module_of("parallelogram") != 1)
    pair = (untrusted, wild) if is_first else (calm, untrusted)
    assert restless(*pair).tolist() == [True, False, True, True]


def test_a_single_trusted_taxel_speaks_for_its_module():
    trusted = (module_of("parallelogram") != 1) | (np.arange(20) == 10)
    assert restless(framed(np.zeros((2, 20))), framed(np.full((2, 20), 30_000.0), trusted))[1]


def test_a_module_is_named_that_was_restless_in_more_than_half_of_the_frames():
    told = frames(1)
    for place in (3, 6):
        told[place] = at_random(0)(told[place], np.random.default_rng(place))
    with pytest.raises(SkinUntrustedError, match=r"0 of 6 frames .*; a line across both pads"):
        judged(told, [False] * (JUDGED + 1)).require()
