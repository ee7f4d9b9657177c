"""The figures of speed that are stored, and the reference that trials are compared with."""

import mujoco
import pytest

from tests.bench.speed import measure, reference
from tests.bench.speed.starts import start_of


def test_every_stored_ratio_has_its_measure(loaded):
    _, ratios = measure.stored()
    assert set(ratios) == set(measure.all_ratios(loaded))


@pytest.mark.parametrize(("name", "key"), reference.STEPS)
def test_the_reference_stays_where_its_keyframe_puts_it(name, key):
    model = reference.model(name)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key(key).id)
    mujoco.mj_step(model, data, reference.FROM_EACH)
    assert data.qpos == pytest.approx(model.key(key).qpos, abs=5e-3)


def test_a_ratio_is_of_the_smallest_times():
    ours, reference = iter([3.0, 2.0, 5.0]), iter([1.0, 2.0, 4.0])
    assert measure.ratio(lambda: next(ours), lambda: next(reference), pairs=3) == 2.0


def test_a_command_that_fails_is_no_start():
    with pytest.raises(RuntimeError, match="exit status 2"):
        start_of(("show", "--no-such-option"))
