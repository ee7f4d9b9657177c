"""Rules of the method, except checks and stops for safety, and the scenes that they were made for, from rules.toml.

There are two kinds of functions here. A replacement is the simplest form of a rule's function; its first argument is the
function that it replaces. A sign takes the result and the arguments of a rule's function, and returns True if the rule
changed a decision.
"""

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from cell.lab.ablation.switch import Function, Rule


def _not_probed(real: Any, phase: Any, felt: Any, params: Any, course: Any, point: Any) -> Any:
    return real(replace(phase, was_probed=True), felt, params, course, point)


def _in_place(real: Any, felt: Any, params: Any) -> Any:
    return real(replace(felt, velocity=felt.velocity * 0.0), params)


def _same_lanes(real: Any, lanes: Any, lane: Any) -> Any:
    return (lanes.lanes - 1) / 2.0 - lane % lanes.lanes


def _along_normal(real: Any, aim: Any, in_hand: Any, tcp: Any, normal: Any) -> Any:
    return replace(aim, in_hand=in_hand, direction=normal)


def _usual(real: Any, estimator: Any, values: Any, weights: Any, silent: Any, usual: Any) -> Any:
    return usual, estimator._usual, weights


def _by_breadths(
    real: Any, prints: Any, values: Any, weights: Any, is_wide: bool = False, load: Any = (0.0, 0.0)
) -> Any:
    found = prints._breadths.compare(values, weights, is_wide, prints._believed, load)
    prints.left = prints._breadths.left
    return found


def _straight(real: Any, bank: Any, params: Any, templates: Any) -> None:
    real(bank, params, templates)
    bank._places = (templates.along, templates.borne * 0.0)


def _no_short(real: Any, estimator: Any, *args: Any) -> None:
    real(estimator, *args)
    estimator._against_short = 1e9


OFF: Mapping[str, Function] = {
    "same": lambda real, itself, *args, **kwargs: itself,
    "never": lambda real, *args, **kwargs: False,
    "nothing": lambda real, *args, **kwargs: None,
    "empty": lambda real, *args: [],
    "zero": lambda real, *args, **kwargs: 0.0,
    "one": lambda real, *args: 1.0,
    "quick": lambda real, *args: 9.9,
    "no_load": lambda real, load: (0.0, 0.0),
    "bears": lambda real, grip, tilt, dip: grip.bears,
    "best": lambda real, estimator, values, best: (best.found, best.weights),
    "not_probed": _not_probed,
    "in_place": _in_place,
    "same_lanes": _same_lanes,
    "along_normal": _along_normal,
    "usual": _usual,
    "by_breadths": _by_breadths,
    "straight": _straight,
    "no_short": _no_short,
}
"""Replacements by name."""
ACTS: Mapping[str, Function] = {
    "called": lambda *_: True,
    "unloaded": lambda result, evidence, *_: result[1] and result[0] <= evidence._params.dip_threshold,
    "near_a_place": lambda result, evidence, seen, edge, is_likely=False: (
        is_likely and result[0] > 0.5 * evidence._params.dip_threshold
    ),
    "probing": lambda phase, before, *_: type(phase).__name__ == "Probing",
    "second_cover": lambda place, lanes, lane: lane >= lanes.lanes + 1,
    "not_by_plate": lambda aim, *_: not aim.is_by_plate,
    "less_grip": lambda after, before, excess: after.grip_share < before.grip_share,
    "swinging": lambda swing, *_: swing.rate > 0.15,
    "beside_middle": lambda sweep, params, *_: params.centre != 0.0,
    "held": lambda felt, sweep, *_: sweep._lag > sweep._params.lag,
    "outside": lambda result, watch, elapsed: elapsed > watch.inside,
}
"""Signs by name."""
VALUES: Mapping[str, Any] = {"no load": property(lambda load: (0.0, 0.0))}
"""Values that TOML cannot state."""


def _value(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else VALUES.get(value, value)


def _read() -> tuple[dict[str, Rule], dict[str, Sequence[str]]]:
    data = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
    rules = {}
    for each in data["rule"]:
        scenes = [scene for name in each.pop("scenes", data["scenes"]) for scene in data["groups"].get(name, [name])]
        values = {name: _value(value) for name, value in each.pop("values", {}).items()}
        off, acts = OFF.get(each.pop("off", "")), ACTS.get(each.pop("acts", ""))
        rules[each["name"]] = Rule(**each, off=off, acts=acts, values=values, scenes=scenes)
    return rules, data["scenes"]


RULES, SCENES = _read()
"""Rules, and scenes as keys of the config, by name."""


def rules_of(scene: str) -> list[Rule]:
    """Return the rules that are judged in a scene."""
    return [rule for rule in RULES.values() if scene in rule.scenes]
