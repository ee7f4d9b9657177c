"""The object dictionary has each register, with the limits of its parameter."""

import itertools

import pytest
from canopen.objectdictionary import datatypes

from plc_bridge.canopen.objects import dictionary
from plc_bridge.protocol.registers import RPDOS
from tests.canopen_rig import NODE, PLACES, REGISTERS

OBJECTS = dictionary(REGISTERS, NODE)


@pytest.mark.parametrize("names", RPDOS)
def test_what_one_pdo_writes_lies_side_by_side(names):
    registers = [PLACES[name] for name in names]
    assert all(b.address == a.address + a.words for a, b in itertools.pairwise(registers))


def test_every_register_but_the_tails_is_an_object_of_its_own():
    places = [(r.index, r.subindex) for r in REGISTERS if not r.name.endswith("life_tail")]
    assert len(set(places)) == len(places)
    for register in REGISTERS:
        if register.index:
            assert OBJECTS[register.index][register.subindex].name == register.name
        else:
            assert register.name.endswith("life_tail")


def test_limits_of_a_parameter_are_those_of_the_command():
    found = OBJECTS[0x2000]["command_parameter_1"]
    assert (found.min, found.max, found.factor, found.unit) == (10, 5000, 1e-4, "m/s")
    assert found.data_type == datatypes.INTEGER32
    reserved = OBJECTS[0x2000]["command_parameter_2"]
    assert (reserved.min, reserved.max) == (0, 0)
