"""Nothing that only the simulation knows can be reached from a skill, by whatever types its context leads to."""

import dataclasses
import inspect
import typing

from pydantic import BaseModel

from drivers.parts import Job
from sim.config import PlateConfig
from skills.contract import SkillContext

OURS = ("drivers", "skills", "sim")


def is_ours(thing):
    return thing.__module__.split(".")[0] in OURS


def declared(cls):
    """Return the types that a class declares: of its fields, its properties and what its methods take and return."""
    if issubclass(cls, BaseModel):
        told = [field.annotation for field in cls.model_fields.values()]
    else:
        told = list(typing.get_type_hints(cls).values())
    for _, member in inspect.getmembers(cls):
        function = member.fget if isinstance(member, property) else member
        if inspect.isfunction(function) and is_ours(function) and not function.__name__.startswith("__"):
            told += typing.get_type_hints(function).values()
    return told


def reached(start):
    """Return every class of this project that types lead to from a class."""
    found, waiting = set(), [start]
    while waiting:
        told = waiting.pop()
        waiting += typing.get_args(told)
        if inspect.isclass(told) and told not in found and is_ours(told):
            found.add(told)
            waiting += declared(told)
    return found


def fields(cls):
    """Return the names of the fields of a model or a dataclass."""
    if issubclass(cls, BaseModel):
        return set(cls.model_fields)
    return {field.name for field in dataclasses.fields(cls)} if dataclasses.is_dataclass(cls) else set()


def test_no_type_of_the_simulation_is_reached_from_a_skill():
    found = reached(SkillContext)
    assert Job in found
    assert not [cls for cls in found if cls.__module__.startswith("sim")]


def test_the_job_of_a_skill_states_nothing_of_the_true_plate():
    stated = {name for cls in reached(Job) for name in fields(cls)}
    assert "latch" in stated
    assert not stated & set(PlateConfig.model_fields)
