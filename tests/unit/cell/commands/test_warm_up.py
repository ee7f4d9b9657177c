"""A cell compiles its functions before it serves."""

import logging
from pathlib import Path

import pytest

from cell.commands import warm_up
from cell.config.load import LoadedConfig, load
from cell.devices.assembly import assemble, opened
from drivers import compiled
from drivers.errors import CellError
from sim.world import engine


@pytest.fixture
def noted(tmp_path, monkeypatch):
    """Return the configs that were inserted, with a cache that has no notes."""
    inserted = []

    def assemble(config):
        inserted.append(config)
        raise CellError("not in this test")

    monkeypatch.setattr(compiled, "folder", lambda: tmp_path)
    monkeypatch.setattr(warm_up, "compile_ahead", lambda: None)
    monkeypatch.setattr(warm_up, "assemble", assemble)
    return inserted


def test_one_part_of_a_kind_is_inserted_once_at_full_pace(noted):
    for _ in range(2):
        warm_up.warm_up(load(sets=["reality.scale=2.0"]))
    (config,) = [each for each in noted if each.peg == load().cell.peg]
    assert (config.sim.pace, config.reality.scale) == ("max", 2.0)


@pytest.mark.parametrize("is_another_part", [True, False])
def test_another_part_and_changed_sources_are_compiled_anew(noted, monkeypatch, is_another_part):
    warm_up.warm_up(load())
    before = len(noted)
    if not is_another_part:
        monkeypatch.setattr(compiled, "_digest_of_all", lambda: "other sources")
    warm_up.warm_up(load(sets=["peg.diameter=0.0079"] if is_another_part else []))
    assert len(noted) > before


def test_a_simulation_without_timing_inserts_nothing_before(noted):
    warm_up.warm_up(load(sets=["sim.pace=max"]))
    assert noted == []


def test_the_engine_is_compiled_ahead_for_the_types_that_step_it():
    with opened(assemble(load(sets=["sim.pace=max"]).cell)) as cell:
        cell.clock.wait_until(0.01)
    engine.compile_ahead()
    assert len(engine.advance.signatures) == 1


def test_parts_of_a_physical_cell_are_inserted_in_simulation(monkeypatch):
    ended = []
    for name in ("is_kept", "is_noted"):
        monkeypatch.setattr(warm_up, name, lambda what: False)
    serve = warm_up.Supervisor.serve

    def served(supervisor):
        serve(supervisor)
        ended.append((supervisor.last.program, supervisor.last.is_simulated, supervisor.last.outcome))

    monkeypatch.setattr(warm_up.Supervisor, "serve", served)
    real = load(Path("config/cell_01.toml"))
    assert not real.cell.is_simulated
    warm_up.warm_up(LoadedConfig({0: real.cell}))
    assert ended == [("insert_peg", True, "success")]
    assert logging.root.manager.disable == logging.NOTSET
