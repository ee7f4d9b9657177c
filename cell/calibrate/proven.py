"""Proven steps of a physical cell's commissioning, kept beside its calibration; the cell is in commissioning until all facts are proven."""

import hashlib
import json
import logging
from collections.abc import Mapping
from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import Annotated

from pydantic import Field, ValidationError

from cell.calibrate.hand_motion import MOST_FORCE
from cell.config.cell_config import CellConfig
from cell.config.load import LoadedConfig
from drivers.config_model import ConfigModel
from drivers.figures_file import write_whole

logger = logging.getLogger(__name__)

FACTS = {
    "wrench": ("arm",),
    "end effector": ("arm", "gripper"),
    "load": ("arm", "gripper", "skin"),
    "switch": ("switch",),
    "places": ("arm", "gripper", "skin", "hole", "rack"),
}
"""Sections of the cell's file on which each fact depends; a change of one of them requires a new proof."""
FILE = "proven.json"
SLOW = 0.25
"""Largest `speed_scale` in commissioning, ratio; chosen, not measured."""

Text = Annotated[str, Field(max_length=1000)]


class Fact(ConfigModel):
    """One proven fact."""

    date: date
    measured: Text
    """Measurement in words."""
    devices: Text
    """Devices with their addresses and serial numbers."""
    of: Text
    """Digest of the figures and sections on which the fact depends."""


class Proven(ConfigModel):
    """Proven facts of a cell, by name."""

    facts: Mapping[str, Fact] = {}


def missing(config: CellConfig, proven: Proven) -> list[str]:
    """Return the names of the facts that are not proven for this config; empty for a simulated cell, which is never in commissioning."""
    if config.is_simulated:
        return []
    return [name for name in FACTS if name not in proven.facts or proven.facts[name].of != _digest(config, name)]


def commissioning(config: CellConfig, proven: Proven) -> str:
    """Return why a cell is in commissioning, one line; empty if it is not."""
    names = missing(config, proven)
    return f"in commissioning: {', '.join(names)} not proven: docs/first-day.md, steps 8 to 10" if names else ""


def in_force(loaded: LoadedConfig, path: Path) -> tuple[LoadedConfig, str]:
    """Return the config that may run now, and the reason why the cell is in commissioning; the reason is empty if it is not.

    Args:
        loaded: The cell and its recipes.
        path: File of the proven facts.
    """
    why = "" if loaded.cell.is_simulated else commissioning(loaded.cell, read(path))
    if not why:
        return loaded, ""
    logger.warning("%s", why)
    recipes = {number: _gentle(config) for number, config in loaded.recipes.items()}
    return replace(loaded, recipes=recipes), why


def _gentle(config: CellConfig) -> CellConfig:
    """Return a config with low speed and low force."""
    limits = config.limits.model_copy(update={"force": min(config.limits.force, MOST_FORCE)})
    return config.model_copy(update={"limits": limits, "speed_scale": min(config.speed_scale, SLOW)})


def read(path: Path) -> Proven:
    """Return the proven facts in a file; none if it is missing or damaged."""
    try:
        return Proven.model_validate_json(path.read_bytes())
    except FileNotFoundError:
        return Proven()
    except (OSError, ValidationError):
        logger.warning("%s: cannot be read: prove every fact again", path)
        return Proven()


def keep(path: Path, config: CellConfig, measured: Mapping[str, str], today: date) -> Proven:
    """Add facts to a file, each with its measurement in words, and return all facts of the file.

    Raises:
        ConfigError: The file cannot be written.
    """
    devices = f"{config.arm_model().name} {config.arm_unit()}, skin {_wire(config.skin)}, switch {_wire(config.switch)}"
    new = {
        name: Fact(date=today, measured=text, devices=devices, of=_digest(config, name))
        for name, text in measured.items()
    }
    proven = Proven(facts={**read(path).facts, **new})
    write_whole(path, proven.model_dump_json(indent=2), "what is proven")
    return proven


def _wire(section: ConfigModel) -> str:
    """Return the name of a device's wire; for a serial board it contains the serial number."""
    stated = section.model_dump()
    return str(next((stated[key] for key in ("port", "channel", "file") if key in stated), stated["kind"]))


def _digest(config: CellConfig, fact: str) -> str:
    """Return the digest of the sections on which a fact depends, and of the arm's figures if the arm is one of them."""
    parts = {name: getattr(config, name).model_dump(mode="json") for name in FACTS[fact]}
    if "arm" in parts:
        parts["figures"] = config.arm_model().model_dump(mode="json")
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:16]
