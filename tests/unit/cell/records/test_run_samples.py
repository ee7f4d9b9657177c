"""The file of a run's samples reserves its number, and its failure is reported."""

from dataclasses import replace

import numpy as np
import pytest

from cell.records.index import samples_path
from cell.records.run_samples import RunSamples
from cell.records.sample_blocks import JOINT_COLUMNS, SampleBlock
from cell.records.schema import RunRow

ROW = RunRow(1, "2025-01-01T00:00:00.000+00:00", "insert_peg", 1, "A-17", "plc", 42)
BLOCK = SampleBlock(used=2, taxels=[np.zeros(4)] * 2, joints={name: [[0.0], [0.0]] for name in JOINT_COLUMNS})


@pytest.fixture
def samples(tmp_path):
    return RunSamples(tmp_path, least_free=0)


def test_a_number_is_claimed_by_the_file_of_its_samples(samples, tmp_path):
    samples_path(tmp_path, 1).touch()
    assert samples.claim(after=0) == 2
    assert samples_path(tmp_path, 2).exists()
    assert samples.claim(after=0) == 3


def test_a_run_whose_file_was_deleted_goes_on_without_samples(samples, tmp_path):
    samples.begin(ROW, None)
    samples_path(tmp_path, 1).unlink()
    samples.write(1, BLOCK)
    assert "it was deleted" in samples.trouble
    assert samples.finish(ROW, [], BLOCK).samples == 0


def test_trouble_is_over_once_a_run_is_whole(samples):
    samples.begin(ROW, None)
    samples.lose(1)
    samples.finish(ROW, [], BLOCK)
    assert "some are lost" in samples.trouble
    samples.begin(replace(ROW, run=2), None)
    samples.finish(replace(ROW, run=2), [], BLOCK)
    assert samples.trouble == ""
