"""Margins of errors: levels by bisection, and distributions as wide as `reality.scale` makes them."""

import numpy as np
import pytest

from cell.config.files import ERRORS_FILE, SHIPPED
from cell.config.load import load
from cell.lab.margins.study import SWEPT, boundary, size_of, wider
from sim.config import RealityConfig
from sim.world.reality import read

REALITY = read(SHIPPED / ERRORS_FILE)
ERRORS = REALITY.errors


def found(first_failing, count):
    """Return the boundary that bisection finds, and the number of levels it tests."""
    tested = []

    def holds(number):
        tested.append(number)
        return number < first_failing

    return boundary(holds, count), len(tested)


@pytest.mark.parametrize("first_failing", range(10))
def test_bisection_finds_the_last_level_that_holds(first_failing):
    (last, first), number = found(first_failing, 9)
    assert (last, first) == (first_failing - 1, first_failing)
    assert number <= 5


def test_a_range_that_holds_to_its_end_costs_one_level():
    assert found(9, 9) == ((8, 9), 1)


@pytest.mark.parametrize("name", [name for name, error in ERRORS.items() if error.distribution != "range"])
def test_a_wider_distribution_draws_what_the_scale_draws(name):
    scaled = REALITY.draw(3, RealityConfig(scale=2.8))[name]
    group, own = name.split(".")
    changed = REALITY.changed({group: {own: wider(ERRORS[name], 2.8)}})
    np.testing.assert_allclose(changed.draw(3, RealityConfig())[name], scaled, rtol=1e-12)


@pytest.mark.parametrize("swept", SWEPT.values(), ids=lambda swept: swept.name)
def test_each_level_of_an_error_is_a_config_of_its_own(swept):
    assert not (swept.error and swept.program)
    ends = [load(sets=swept.sets(level, ERRORS)).cell for level in swept.levels[:2]]
    assert (ends[0] != ends[1]) == (not swept.program)


def test_sizes_have_the_unit_of_the_error():
    assert size_of(ERRORS["place.plate_height"], 2.0) == "±0.0018 m"
    assert size_of(ERRORS["grip.force"], 2.0) == "x 1/1.32 to 1.32"
    assert size_of(ERRORS["arm.transport"], 1.0) == "0.001 to 0.002 s"
    assert size_of(ERRORS["skin.dead_taxel"], 4.0) == "2.24 %"
