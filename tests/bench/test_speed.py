"""The program is no slower than its stored figures say; run after all other tests, with nothing beside."""

import warnings

import pytest

from cell.config.load import load
from tests.bench.speed import measure

COUNTS, RATIOS = measure.stored()
MORE = 1.05
"""Largest count, multiple of the stored one."""
SLOWER, TOO_SLOW = 1.2, 1.5
"""Ratios from which on a test warns and fails, multiples of the stored one."""
REPEATS = 3


@pytest.fixture(scope="module")
def shipped():
    return load(sets=["sim.pace=max"])


@pytest.fixture(scope="module")
def counted(shipped):
    return measure.counts_of_a_scan(shipped.cell) | measure.counts_of_starts()


@pytest.mark.parametrize("name", COUNTS)
def test_a_count_is_not_above_the_stored_one(name, counted):
    stored = COUNTS[name]
    assert counted[name] <= MORE * stored.value, f"{stored.what}: {counted[name]:.4g}; {stored.value:g} stored"


@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize("name", RATIOS)
def test_a_ratio_is_not_above_the_stored_one(name, shipped):
    stored, take = RATIOS[name], measure.all_ratios(shipped)[name]
    found = []
    while len(found) < REPEATS and (not found or found[-1] > TOO_SLOW * stored.value):
        found.append(take())
    lowest = min(found)
    told = f"{stored.what}: {', '.join(f'{value:.3g}' for value in found)}; {stored.value:g} stored"
    if lowest > SLOWER * stored.value:
        warnings.warn(told, stacklevel=1)
    assert lowest <= TOO_SLOW * stored.value, told
