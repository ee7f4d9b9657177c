"""A wish is read as it is meant, the dearer of two trials is the one further from it, and every setting lies between shipped ones."""

import re
import shutil
from dataclasses import replace

import pytest

from cell.config.files import DEFAULT
from cell.config.load import load
from cell.lab.tune.measure import SECTIONS, Space, toml
from cell.lab.tune.wish import LOST, cost, wishes_of
from drivers.errors import ConfigError
from tests.trial_rows import SEATED

WISHES = wishes_of("p95<=8 s, force<=20 N")


def test_a_wish_is_read_with_and_without_units():
    found = wishes_of("p95 <= 8, force<=20N,success>=98 %")
    assert [wish.text for wish in found] == ["p95<=8 s", "force<=20 N", "success>=98 %"]


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ("p95<=8 N", "p95<=s"),
        ("p95>=8", "'p95>=8'"),
        ("speed<=8", "mean<=s, p95<=s, force<=N, success>=%"),
        ("p95<=8, p95<=9", "p95 twice"),
        ("success>=101 %", "at most 100 %"),
        ("force<=0 N", "more than 0"),
        ("p95<=1.2.3", "not a number"),
        ("", "p95<=8 s, force<=20 N"),
    ],
)
def test_an_invalid_wish_is_refused_with_what_is_allowed(wrong, told):
    with pytest.raises(ConfigError, match=re.escape(told)):
        wishes_of(wrong)


def test_a_trial_that_just_fulfils_the_wish_costs_one():
    assert cost(replace(SEATED, total_time=8.0, peak_contact_force=20.0), WISHES) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("dearer", "cheaper"),
    [
        ({"total_time": 9.0}, {"total_time": 7.0}),
        ({"peak_contact_force": 25.0}, {"peak_contact_force": 19.0}),
        ({"outcome": "failure"}, {"total_time": 11.0}),
        ({"total_time": 10.0}, {"total_time": 6.0, "peak_contact_force": 25.0}),
    ],
)
def test_trials_further_from_the_wish_cost_more(dearer, cheaper):
    assert cost(replace(SEATED, **dearer), WISHES) > cost(replace(SEATED, **cheaper), WISHES)
    assert cost(replace(SEATED, total_time=1000.0), WISHES) == LOST


def test_a_wish_holds_of_what_trials_reached():
    rows = [replace(SEATED, total_time=6.0 + 0.1 * n, peak_contact_force=float(n)) for n in range(20)]
    p95, force = WISHES
    assert p95.holds(rows)
    assert force.found(rows) == "18.1 N"
    (success,) = wishes_of("success>=98")
    assert not success.holds([*rows, replace(SEATED, outcome="failure")])
    assert success.found(rows) == "100 % of 20, 95 % interval 83.9 to 100.0 %"


@pytest.mark.parametrize(("place", "style"), [(0.0, "careful"), (1.0, None)])
def test_the_ends_are_shipped_settings(place, style):
    space = Space(None, [])
    found = space.config(space.sets(dict.fromkeys(SECTIONS, place)))
    preset = load(None, style, ["sim.pace=max"]).cell
    assert (found.search, found.insert, found.adjust) == (preset.search, preset.insert, preset.adjust)


def test_between_two_settings_every_figure_lies_between_theirs():
    sets = Space(None, []).sets({"search": 0.5, "insert": 1.0})
    shipped, careful = (load(None, style).cell.search.rest for style in (None, "careful"))
    assert f"search.rest={(shipped + careful) / 2:g}" in sets
    assert not any(text.startswith("insert.") for text in sets)


def test_a_written_recipe_is_read_as_its_setting(tmp_path):
    space = Space(None, [])
    sets = space.sets({"search": 0.3, "insert": 0.7})
    (tmp_path / "recipes").mkdir()
    (tmp_path / "recipes" / "7.toml").write_text(toml(sets))
    shutil.copy(DEFAULT, tmp_path / "cell.toml")
    recipe = load(tmp_path / "cell.toml").recipes[7]
    found = space.config(sets)
    assert (recipe.search, recipe.insert, recipe.adjust) == (found.search, found.insert, found.adjust)
