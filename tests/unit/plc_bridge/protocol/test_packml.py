"""PackML times and counts are those of the states passed."""

import pytest

from plc_bridge.protocol.images import PACKML
from plc_bridge.protocol.messages import Control, Report, Result
from plc_bridge.protocol.packml import PackTags


def values(tags):
    return {name.removeprefix("packml_"): value for name, value in PACKML.unpack(PACKML.words_of(tags)).items()}


def test_time_is_counted_for_the_state_that_was():
    tags = PackTags()
    for now, state in ((0.0, 4), (10.0, 6), (12.6, 17), (20.0, 17)):
        tags.record(Report(state=state), now)
    told = values(tags)
    assert [told[f"state_time_{state}"] for state in (4, 6, 17, 2)] == [10, 3, 7, 0]
    assert (told["state"], told["unit_mode"]) == (17, 1)


@pytest.mark.parametrize(
    ("report", "reason"),
    [
        (Report(state=2, transition=Control.STOP), Control.STOP),
        (Report(state=9, transition=Control.ABORT), Control.ABORT),
        (Report(state=9, transition=Control.ABORT, fault=2001), 2001),
        (Report(state=4, transition=Control.RESET), 0),
    ],
)
def test_the_reason_of_a_stop_is_shown_until_the_restart(report, reason):
    tags = PackTags()
    tags.record(report, 0.0)
    assert values(tags)["stop_reason"] == reason
    tags.record(Report(state=6), 1.0)
    assert values(tags)["stop_reason"] == 0


def test_products_and_those_that_failed_are_counted():
    tags = PackTags()
    for result in (Result.SUCCESS, Result.FAILURE, Result.ABORTED, Result.SUCCESS):
        tags.count(result)
    told = values(tags)
    assert (told["processed"], told["defective"]) == (4, 2)
