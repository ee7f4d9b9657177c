"""The study of what touch is worth: every preset and the regime of turning pegs, with each sight of theta."""

from dataclasses import replace

import pytest

from cell.config.files import presets
from cell.config.load import load
from cell.lab.results import TrialsResult
from cell.lab.rows import write_rows
from cell.lab.touch.charts import draw
from cell.lab.touch.measure import SIGHTS, TURNING, TouchLine, hands
from cell.lab.touch.tables import touch
from drivers.errors import ConfigError

SEEN = TrialsResult("", 4, 3, 0.3, 0.95, 9.0, 12.0, 15.0, 4, 0.6, 1.1, "1 x spray_search no_hole")


def test_every_preset_and_the_turning_pegs_are_hands():
    assert {hand.name for hand in hands(None)} == {*presets(None), TURNING}
    assert [hand.name for hand in hands(None, [TURNING])] == [TURNING]


def test_a_hand_that_does_not_exist_is_told():
    with pytest.raises(ConfigError, match="--hand slow: no such hand; balanced"):
        hands(None, ["slow"])


@pytest.mark.parametrize("sight", SIGHTS)
def test_every_hand_can_be_run_with_every_sight(sight):
    for hand in hands(None):
        config = load(None, hand.preset, ["sim.pace=max", *hand.sets]).cell
        assert not SIGHTS[sight](config).follow(None, 0.0, 0.0).healthy


def test_table_file_and_chart_show_every_line(tmp_path):
    lines = [TouchLine(TURNING, sight, replace(SEEN, name=sight)) for sight in SIGHTS]
    assert touch(lines, "a title").row_count == len(lines)
    assert write_rows([line.result for line in lines], tmp_path / "touch.csv").read_text().count("\n") == 4
    assert draw(lines, "a title", tmp_path).stat().st_size > 5_000
