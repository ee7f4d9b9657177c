"""An installation without the pins takes no release that was not tested."""

import tomllib

import pytest
from packaging.requirements import Requirement

from tests.pages import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
PINS = dict(
    line.lower().replace("_", "-").split("==")
    for line in (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    if "==" in line
)


@pytest.mark.parametrize(
    "requirement", [Requirement(each) for each in PROJECT["dependencies"]], ids=lambda each: each.name
)
def test_every_dependency_has_an_upper_bound_and_its_pin_is_within(requirement):
    assert any(bound.operator in ("<", "==") for bound in requirement.specifier)
    assert requirement.specifier.contains(PINS[requirement.name])
