"""A latch resists with the force and energy of its kind."""

import math

import numpy as np
import pytest

from drivers.parts import Latch
from sim.config import PlateConfig
from sim.contact import latch
from sim.contact.peg_distances import PegView
from sim.contact.plate import Plate
from sim.world.physics import World
from skills.seating.latch_likelihood import resistance

BOTTOM = 0.02
DETENT = Latch(kind="detent", force=6.0, height=0.003)
PRESS = Latch(kind="press", force=6.0, height=0.003)
PLATE = Plate(np.zeros(3), np.eye(3), (0.004, 0.004), BOTTOM)
MASS = 0.1
felt = latch.resistance


def words(of: Latch | None, force: float = 1.0, place: float = 0.0):
    return latch.words_of(of, PLATE, BOTTOM, force, place)


def driven(of: Latch, step: float, push: float = 9.0, damping: float = 60.0):
    """Return depth, speed and the energy that the latch took where a steady push drives a mass into it from rest, 4 mm above the bottom."""
    state, depth, speed = words(of), BOTTOM - 0.004, 0.0
    view = PegView(np.array([0.004, 0.025]), np.array([0.0, 0.0, 0.025 - depth]), np.eye(3))
    load, centre, path = np.zeros(6), np.zeros(3), []
    for _ in range(round(0.25 / step)):
        latch.act(state, view, centre, load)
        speed += step * (push - damping * speed - load[2]) / MASS
        depth += step * speed
        view.middle[2] = 0.025 - depth
        path.append((depth, speed, load[2]))
        if depth >= BOTTOM:
            break
    depths, _, forces = np.array(path).T
    # The force is that of the depth at the beginning of each step.
    return path, float(forces[1:] @ np.diff(depths) + (np.diff(forces, append=forces[-1])[1:] / 2) @ np.diff(depths))


def test_a_detent_resists_most_at_its_crest_and_draws_in_behind_it():
    state = words(DETENT)
    crest = BOTTOM - 0.75 * DETENT.height
    assert felt(state, BOTTOM - DETENT.height) == 0.0
    assert felt(state, crest) == pytest.approx(DETENT.force)
    assert felt(state, BOTTOM - 0.25 * DETENT.height) == pytest.approx(-DETENT.force)
    assert felt(state, crest) == pytest.approx(float(resistance(np.array(BOTTOM - crest), DETENT)))


def test_a_press_fit_resists_by_its_length_in_both_directions():
    state = words(PRESS)
    depths = np.linspace(BOTTOM - 0.004, BOTTOM, 4001)
    pushed = [felt(state, depth) for depth in depths]
    assert pushed[0] == 0.0
    assert pushed[-1] == pytest.approx(PRESS.force, rel=0.02)
    assert pushed[2500] == pytest.approx(float(resistance(np.array(BOTTOM - depths[2500]), PRESS)), rel=0.02)
    assert felt(state, BOTTOM - 0.0006) == pytest.approx(-0.8 * PRESS.force)


def test_a_detent_stores_energy_and_a_press_fit_keeps_it():
    _, stored = driven(DETENT, 1e-5)
    _, kept = driven(PRESS, 1e-5)
    assert stored == pytest.approx(0.0, abs=1e-4 * DETENT.force * DETENT.height)
    assert kept == pytest.approx(PRESS.force * PRESS.height / 2, rel=0.05)


@pytest.mark.parametrize("of", [DETENT, PRESS])
def test_half_the_step_changes_neither_time_nor_speed_of_arrival(of):
    whole, half = (driven(of, step)[0] for step in (5e-4, 2.5e-4))
    assert len(whole) * 5e-4 == pytest.approx(len(half) * 2.5e-4, rel=0.03)
    assert whole[-1][1] == pytest.approx(half[-1][1], rel=0.05)


def test_a_push_below_the_force_of_a_detent_rests_on_it():
    path, _ = driven(DETENT, 5e-4, push=4.0)
    x = (path[-1][0] - (BOTTOM - DETENT.height)) / DETENT.height
    assert DETENT.force * math.sin(2 * math.pi * x) == pytest.approx(4.0, rel=0.02)
    assert x < 0.25


def test_a_latch_resists_as_drawn_and_worn(loaded):
    cell = loaded.cell
    hole, plate = cell.hole.model_copy(update={"latch": DETENT}), PlateConfig(latch_wear=0.75)
    job = cell.job().model_copy(update={"hole": hole})
    sim = cell.sim.model_copy(update={"plate": plate})
    crest = BOTTOM - 0.75 * DETENT.height - 1e-4
    assert felt(words(DETENT, force=1.2, place=1e-4), crest) == pytest.approx(1.2 * DETENT.force)
    world = World(cell.arm_model(), sim, cell.contact, cell.grip, "parallelogram", job)
    assert world.scene.latch[latch.FORCE] == pytest.approx(0.25 * DETENT.force)


def test_nothing_is_felt_beside_the_hole_or_without_a_latch():
    assert not words(None).any()
    state, load = words(DETENT), np.zeros(6)
    beside = PegView(np.array([0.004, 0.025]), np.array([0.01, 0.0, 0.025 - BOTTOM + 0.002]), np.eye(3))
    latch.act(state, beside, np.zeros(3), load)
    assert not load.any()


def test_force_and_torque_are_those_of_the_end_about_mass_and_pivot():
    state, load = words(DETENT), np.zeros(6)
    end = np.array([0.001, 0.0, -(BOTTOM - 0.75 * DETENT.height)])
    view = PegView(np.array([0.004, 0.025]), end + np.array([0.0, 0.0, 0.025]), np.eye(3))
    latch.act(state, view, view.middle, load)
    force, torque = np.zeros(3), np.zeros(3)
    latch.add_felt(state, view, np.zeros(3), force, torque)
    assert load == pytest.approx([0.0, 0.0, 6.0, 0.0, 0.0, 0.0])
    assert force == pytest.approx([0.0, 0.0, 6.0])
    assert torque == pytest.approx([0.0, -0.006, 0.0])
