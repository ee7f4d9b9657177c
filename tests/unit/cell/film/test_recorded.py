"""Values that a picture takes from a run on record."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from cell.film.playback import RunPlayback
from cell.film.recorded import recorded
from cell.records.journal import Journal
from cell.records.sample_blocks import SampleStream
from cell.run.record import scene_facts
from drivers.errors import JournalError
from tests.filmed_runs import HOLE, PERIOD, ROW, held_peg, record, scan


@pytest.fixture
def journal(tmp_path):
    with Journal(tmp_path / "films") as journal:
        yield journal


@pytest.fixture
def simulated(rig, journal):
    return recorded(journal, record(rig, journal, knows_truth=True))


@pytest.fixture
def physical(rig, journal):
    return recorded(journal, record(rig, journal, knows_truth=False))


def test_a_simulated_run_shows_the_truth(simulated):
    assert simulated.is_simulated
    np.testing.assert_allclose(simulated.hole().position, HOLE.position)
    np.testing.assert_allclose(simulated.moment(0).peg.position[2], HOLE.position[2] + 0.065 / 2 - 0.012)


def test_a_physical_run_shows_the_held_peg_as_measured(rig, physical):
    peg, held = physical.moment(59).peg, held_peg(rig, 0.2)
    assert not physical.is_simulated
    assert physical.moment(0).peg is None
    np.testing.assert_allclose(peg.position, held.position, atol=1e-12)
    np.testing.assert_allclose(peg.rotation, held.rotation, atol=1e-12)


def test_an_open_hand_has_no_in_hand_angle(simulated):
    stale = replace(simulated, samples=simulated.samples | {"theta": np.full(60, 0.2)})
    assert np.isnan(stale.theta(0))
    assert stale.theta(59) == 0.2


def test_a_physical_run_has_its_hole_where_the_switch_closed(rig, physical):
    x, y, z = physical.hole().position
    assert (x, y) == (physical.samples["tip_x"][-1], physical.samples["tip_y"][-1])
    assert z == rig.loaded.cell.hole.centre[2]


def test_a_physical_run_whose_switch_never_closed_has_no_hole(rig, journal):
    row = journal.writer.begin(ROW, scene_facts(rig.loaded.cell))
    stream = SampleStream(partial(journal.writer.write, row.run))
    stream.add(scan(rig, 0, 0.04, 0.0, is_closed=False), None, 1)
    journal.writer.finish(row, (), stream.rest())
    assert recorded(journal, row.run).hole() is None


def test_the_scan_of_a_time_is_the_last_one_before_it(simulated):
    assert [simulated.at(time) for time in (0.0, 2.5 * PERIOD, 1e3)] == [0, 2, 59]


def test_the_tips_line_has_no_part_above_the_plate(simulated):
    height = np.full(60, HOLE.position[2] + 0.05)
    height[20:40] = HOLE.position[2] + 0.001
    run = replace(simulated, samples=simulated.samples | {"tip_z": height})
    drawn = np.isfinite(run.trail(59)).all(axis=1)
    assert drawn.tolist() == [4 <= k < 8 for k in range(12)]


def test_a_run_without_samples_is_refused(rig, journal):
    row = journal.writer.begin(ROW, scene_facts(rig.loaded.cell))
    journal.writer.finish(row)
    with pytest.raises(JournalError, match="no samples on record"):
        recorded(journal, row.run)


def test_a_run_in_progress_is_read_on_as_it_grows(rig, journal):
    number = journal.writer.begin(ROW, scene_facts(rig.loaded.cell)).run
    stream = SampleStream(partial(journal.writer.write, number))
    for k in range(100):
        stream.add(scan(rig, k, 0.04, 0.0, is_closed=False), None, 1)
    playback = RunPlayback(journal, number)
    assert playback.scan_at(1.5) == 99
    for k in range(100, 200):
        stream.add(scan(rig, k, 0.04, 0.0, is_closed=False), None, 1)
    assert playback.scan_at(1.6) == 99  # looked for a moment ago
    assert playback.scan_at(2.1) == 199
