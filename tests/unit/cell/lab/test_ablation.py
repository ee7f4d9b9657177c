"""The study of rules replaces what it names, notices the trials in which a rule acts, and pairs them."""

from dataclasses import replace

import pytest

from cell.config.load import load
from cell.lab.ablation.rules import RULES, SCENES
from cell.lab.ablation.study import ACTED, effect, watched
from cell.lab.ablation.switch import watching, without
from cell.lab.trials import TrialRow
from skills.catalogue import SEARCH
from skills.search.feel import Push
from tests.trial_rows import SEATED

PUSH = RULES["push-back"]
PARAMS = load().cell.skill_set()[SEARCH]
BEFORE = Push(PARAMS.push_stiffness, 0.0)


@pytest.mark.parametrize("name", RULES)
def test_a_rule_names_what_exists(name):
    with watching([RULES[name]]), without([RULES[name]]):
        load(sets=RULES[name].keys)


@pytest.mark.parametrize("scene", ["corners", "latch", "decoys"])
def test_a_whole_trial_is_watched_by_every_rule_of_its_scene(scene):
    config = load(sets=[*SCENES[scene], "sim.pace=max"]).cell
    assert watched(scene, config, 1).more[ACTED]


@pytest.mark.parametrize("name", SCENES)
def test_a_scene_is_a_config(name):
    assert load(sets=SCENES[name]).cell.is_simulated


def test_a_rule_is_off_only_within_the_block():
    with without([PUSH]):
        assert BEFORE.after(0.5, PARAMS) is BEFORE
    assert BEFORE.after(0.5, PARAMS).stiffness < BEFORE.stiffness


@pytest.mark.parametrize(("turn", "acted"), [(0.05, set()), (0.5, {"push-back"})])
def test_a_rule_acts_if_its_replacement_decides_otherwise(turn, acted):
    with watching([PUSH]) as watch:
        BEFORE.after(turn, PARAMS)
    assert watch.acted == acted


def trial(time: float, acted: str = "", outcome: str = "success") -> TrialRow:
    """Return a trial."""
    return replace(SEATED, total_time=time, outcome=outcome, more={ACTED: acted})


WHOLE = {1: trial(4.0), 2: trial(6.0, "probe; push-back")}


def test_a_seed_without_action_is_a_pair_without_difference():
    [found] = effect("push-back", "honest", WHOLE, {2: trial(7.0)})
    assert (found.trials, found.acted, found.lost) == (2, 1, 0)
    assert found.time == pytest.approx(0.1)


def test_a_seed_that_fails_without_the_rule_is_lost():
    [found] = effect("push-back", "honest", WHOLE, {2: trial(7.0, outcome="failure")})
    assert (found.lost, found.gained) == (1, 0)
    assert found.most_lost > 0.5
