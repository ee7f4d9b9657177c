"""Replacement of functions and constants of the method in this process, and detection of the trials in which a rule acts."""

import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pkgutil import resolve_name
from typing import Any
from unittest.mock import patch

Function = Callable[..., Any]


@dataclass(frozen=True, slots=True)
class Rule:
    """One rule of the method, and its simplest replacement."""

    name: str
    target: str = ""
    """Function that implements the rule, `module.qualified.name`; empty if keys of the config implement it."""
    off: Function | None = None
    """Replacement of the target; its first argument is the original function. None does not replace the target."""
    acts: Function | None = None
    """Function of the target's result and arguments that returns True if the rule changed a decision. If None, the rule acts if its
    replacement returns another result."""
    always: bool = False
    """True if the rule acts in every trial."""
    values: Mapping[str, Any] = field(default_factory=dict)
    """Values that replace attributes without the rule, by `module.qualified.name`, alone or in addition to `off`."""
    keys: Sequence[str] = ()
    """Keys of the config, `KEY=VALUE`, that switch the rule off."""
    scenes: Sequence[str] = ()
    """Scenes in which the rule is judged."""


@dataclass(slots=True)
class Watch:
    """Rules that acted in a trial, and the computing time of each."""

    acted: set[str] = field(default_factory=set)
    spent: dict[str, float] = field(default_factory=lambda: defaultdict(float))
    """Time in each rule's target, s."""


def _wrapped(rule: Rule, make: Callable[..., Function], *given: Any) -> Any:
    """Return the attribute that replaces the rule's target: a function, or a property if the target is one."""
    real = resolve_name(rule.target)
    if isinstance(real, property):
        return property(make(*given, real.fget))
    return make(*given, real)


def _watched(rule: Rule, watch: Watch, real: Function) -> Function:
    def call(*args: Any, **kwargs: Any) -> Any:
        began = time.perf_counter()
        result = real(*args, **kwargs)
        watch.spent[rule.name] += time.perf_counter() - began
        if rule.name not in watch.acted and _acts(rule, real, result, args, kwargs):
            watch.acted.add(rule.name)
        return result

    return call


def _acts(rule: Rule, real: Function, result: Any, args: tuple[Any, ...], kwargs: dict[str, Any]) -> bool:
    if rule.always:
        return True
    if rule.acts is not None:
        return bool(rule.acts(result, *args, **kwargs))
    if rule.off is None:
        return False
    other = rule.off(real, *args, **kwargs)
    return result is not other and bool(result != other)


def _replaced(off: Function, real: Function) -> Function:
    return lambda *args, **kwargs: off(real, *args, **kwargs)


@contextmanager
def watching(rules: Sequence[Rule]) -> Iterator[Watch]:
    """Record which of the rules act while the block runs; the method stays unchanged."""
    watch = Watch({rule.name for rule in rules if rule.always})
    with ExitStack() as stack:
        for rule in rules:
            if rule.target:
                stack.enter_context(patch(rule.target, _wrapped(rule, _watched, rule, watch)))
        yield watch


@contextmanager
def without(rules: Sequence[Rule]) -> Iterator[None]:
    """Run the block without these rules."""
    with ExitStack() as stack:
        for rule in rules:
            for target, value in rule.values.items():
                stack.enter_context(patch(target, value))
            if rule.off is not None:
                stack.enter_context(patch(rule.target, _wrapped(rule, _replaced, rule.off)))
        yield
