"""Every threat has a guard and a test that exist."""

import ast
from importlib import import_module
from pathlib import Path

import pytest

from tests.pages import ROOT
from tests.threats import THREATS, Threat


def found(name: str) -> object:
    """Return the module, or the attribute of a module, with a name."""
    try:
        return import_module(name)
    except ModuleNotFoundError:
        owner, _, last = name.rpartition(".")
        return getattr(found(owner), last)


@pytest.mark.parametrize("threat", THREATS, ids=lambda threat: threat.what)
def test_every_threat_has_a_guard_and_a_test(threat: Threat):
    assert found(threat.guard) is not None
    file, _, name = threat.test.partition("::")
    tree = ast.parse((ROOT / Path(file)).read_text(encoding="utf-8"))
    tests = {each.name for each in tree.body if isinstance(each, ast.FunctionDef | ast.AsyncFunctionDef)}
    assert tests
    assert not name or name in tests
