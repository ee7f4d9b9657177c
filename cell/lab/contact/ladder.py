"""Rungs of the ladder of models, and the extent of their measurement."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from drivers.part.contract import Part
from sim.config import ModelConfig

SHIPPED, FINEST = "closed form, 0.5 ms", "closed form, 0.25 ms"
COARSER = "closed form, 1 ms"
PADS = "closed form, 0.5 ms, pads in contact"
NOT_RUN = {"rigid mover": "not run: it does not give way, and the method pushes by a setpoint below the surface"}
"""Models without whole trials, and the reason."""
TIGHT = (FINEST, SHIPPED, COARSER)
"""Rungs also tested with half the clearance, where the cost of a longer step appears first."""


@dataclass(frozen=True, slots=True)
class Rung:
    """One model of contact on the ladder."""

    name: str
    family: str
    model: ModelConfig
    timestep: float
    """Time step of the physics, s."""


@dataclass(frozen=True, slots=True)
class Plan:
    """Extent of the study."""

    rungs: tuple[Rung, ...]
    azimuths: tuple[float, ...]
    """Tilt azimuths, rad."""
    timesteps: tuple[float, ...]
    """Time steps of the map's columns, s."""
    stiffnesses: tuple[float, ...]
    """Stiffnesses of the map's rows, 1/s²."""
    trials: int
    """Number of whole trials on each rung with trials."""
    tight: int
    """Number of whole trials with half the clearance, on the rungs of `TIGHT`."""
    workers: int


def model(**changes: Any) -> ModelConfig:
    """Return a model other than the default, with contacts as stiff as its time step allows."""
    return ModelConfig(contact_time=0.0, **changes)


def ladder(timesteps: Sequence[float], facets: Sequence[int]) -> tuple[Rung, ...]:
    """Return the rungs of the ladder: every model of the hole at every time step, and softer contacts at one."""
    kinds = [
        ("closed form", "closed form", model()),
        ("unpredicted", "closed form, touching only", model(hole="unpredicted")),
    ]
    for path, is_native in (("legacy", False), ("native", True)):
        kinds.append(
            (f"turning flats, {path}", f"turning flats, {path} CCD", model(hole="flats", native_ccd=is_native))
        )
        kinds += [
            (f"{n} boxes, {path}", f"ring of boxes, {path} CCD", model(hole="boxes", facets=n, native_ccd=is_native))
            for n in facets
        ]
    rungs = [Rung(f"{name}, {1e3 * dt:g} ms", family, how, dt) for name, family, how in kinds for dt in timesteps]
    softer = [("closed form", 8.0, model(time_constant=8.0)), ("closed form", 40.0, model(time_constant=40.0))]
    softer += [("64 boxes, legacy", 40.0, model(hole="boxes", facets=64, time_constant=40.0))]
    return tuple(rungs) + tuple(
        Rung(f"{name}, 0.5 ms, soft {constant:g} steps", "softer contacts", how, 5e-4) for name, constant, how in softer
    )


def plan(is_quick: bool, workers: int, part: Part) -> Plan:
    """Return the extent of the study of a part, with the models of the hole that support it."""
    whole = _plan(is_quick, workers)
    return replace(whole, rungs=tuple(rung for rung in whole.rungs if rung.model.has_hole_for(part)))


def _plan(is_quick: bool, workers: int) -> Plan:
    if is_quick:
        rungs = ladder((5e-4, 1e-3), (16, 32, 64)) + tuple(
            r for r in ladder((2.5e-4, 2e-3), ()) if "closed" in r.family
        )
        steps, stiffnesses = np.geomspace(1e-4, 4e-3, 12), np.geomspace(1e4, 1e8, 17)
        return Plan(rungs, (0.3,), tuple(steps), tuple(stiffnesses), 15, 20, workers)
    rungs = ladder((2.5e-4, 5e-4, 1e-3, 2e-3), (16, 32, 48, 64, 96))
    steps, stiffnesses = np.geomspace(1e-4, 4e-3, 17), np.geomspace(1e4, 1e8, 33)
    return Plan(rungs, (0.0, 0.5, 1.7, 3.0), tuple(steps), tuple(stiffnesses), 40, 60, workers)


def on_trial(part: Part) -> tuple[Rung, ...]:
    """Return the rungs for whole trials of a part, the finest first."""
    rungs = (
        Rung(FINEST, "", model(long_steps=False), 2.5e-4),
        Rung("closed form, 0.5 ms, no long steps", "", model(long_steps=False), 5e-4),
        Rung(SHIPPED, "", model(), 5e-4),
        Rung(COARSER, "", model(), 1e-3),
        Rung("unpredicted, 0.5 ms", "", model(hole="unpredicted"), 5e-4),
        Rung("closed form, 0.5 ms, soft 8 steps", "", model(time_constant=8.0), 5e-4),
        Rung("closed form, 0.5 ms, soft 40 steps", "", model(time_constant=40.0), 5e-4),
        Rung("turning flats, legacy, 0.5 ms", "", model(hole="flats"), 5e-4),
        Rung("64 boxes, legacy, 0.5 ms", "", model(hole="boxes", facets=64), 5e-4),
        Rung("64 boxes, native, 0.5 ms", "", model(hole="boxes", facets=64, native_ccd=True), 5e-4),
        Rung("16 boxes, legacy, 0.5 ms", "", model(hole="boxes", facets=16), 5e-4),
        Rung("closed form, 0.5 ms, arm as its inertia", "", model(arm="inertia"), 5e-4),
        Rung(PADS, "", model(grip="pads"), 5e-4),
    )
    return tuple(rung for rung in rungs if rung.model.has_hole_for(part))
