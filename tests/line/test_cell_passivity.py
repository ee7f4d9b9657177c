"""Gains beyond the boundary pump energy into the arm: the guard ends that, in most runs before the force limit is reached."""

import numpy as np
import pytest

from cell.config.files import arm_file
from cell.config.load import load
from cell.devices.assembly import assemble, opened
from cell.lab.trials import run_trial
from drivers.quantities import ImpedanceSetpoint
from skills.catalogue import INSERT
from skills.guards.passivity import SOFTENED, PassivityGuard, PassivityVerdict
from skills.motion import VALIDITY, Gains, stay
from skills.search.sweep import SearchSweep

PUMPING = {
    "stiff_search": ("search", Gains(translation=100e3, rotation=40.0)),
    "twisting_search": ("search", Gains(translation=1500.0, rotation=1000.0)),
    "twisting_insertion": ("insert", Gains(translation=1500.0, rotation=1500.0)),
}
"""Gains far beyond the bounds of a config, set after its check on an arm that permits such stiffness.

Rotational gains pump if the hand follows a rotation of the peg at once, as before docs/tried/search.md. An insertion with
100 kN/m is left out: an error of 0.6 mm in one frame reaches the force limit.
"""


GUARDS = ("not_passive", "setpoint", "tracking")
"""Endings before the peg is pressed: the energy guard, or the gate if an error of 1.5 mm reaches the force limit."""


@pytest.fixture
def stiff_arm(tmp_path):
    """Return the key of an arm that permits these gains."""
    text = arm_file("panda").read_text(encoding="utf-8")
    for figure in ("stiffness = 3000.0", "turn_stiffness = 300.0"):
        assert f"\n{figure}\n" in text
        text = text.replace(f"\n{figure}\n", f"\n{figure.split(' ')[0]} = {'1e5' if figure[0] == 's' else '1e4'}\n")
    file = tmp_path / "stiff.toml"
    file.write_text(text, encoding="utf-8")
    return f"arm.model={file}"


def with_gains(config, section, gains):
    skill = getattr(config, section).model_copy(update={"gains": gains})
    return config.model_copy(update={section: skill})


@pytest.mark.parametrize("name", PUMPING)
def test_the_guard_ends_most_runs_with_gains_beyond_the_boundary(name, stiff_arm, monkeypatch):
    monkeypatch.setattr(SearchSweep, "_turned", lambda self, seen, axis: axis)  # the hand turns after the peg at once
    config = load(sets=["reality.scale=0.0", stiff_arm]).cell.with_params(INSERT, follow_rate=100.0)
    reasons = [run_trial(with_gains(config, *PUMPING[name]), seed).reason for seed in range(9001, 9004)]
    ended = [reason for reason in reasons if reason]
    assert len(ended) >= 2
    guarded = [reason for reason in ended if reason in GUARDS]
    assert set(ended) <= {*GUARDS, "force_limit"}
    assert len(guarded) >= 0.75 * len(ended)


def test_a_softened_motion_stays_as_soft_while_its_setpoint_is_repeated(monkeypatch):
    """Waiting repeats the held setpoint; the verdict of the guard is scripted."""
    monkeypatch.setattr(PassivityGuard, "update", lambda self, setpoint, tcp, stamp: PassivityVerdict.SOFTEN)
    config = load(sets=["sim.pace=max"]).cell
    cell = assemble(config)
    with opened(cell):
        ctx = cell.context(1)
        here, gains = cell.arm.read().tcp, config.search.gains
        ctx.follow(
            ImpedanceSetpoint(
                id=ctx.new_id(),
                tip=here.position,
                axis=-here.rotation[:, 0],
                stiffness=gains.stiffness(),
                damping_ratio=gains.damping_ratios(),
                valid_until=ctx.devices.clock.now() + VALIDITY,
            )
        )
        for seen in ctx.scan(0.2):
            stay(ctx, seen.stamp)
        np.testing.assert_allclose(ctx.lead.held.stiffness, SOFTENED * gains.stiffness())
