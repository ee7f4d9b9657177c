"""The cell of this line; without this fixture it is the shipped one."""

import pytest


@pytest.fixture
def cell_options():
    """Let the search look at a smaller area, so that runs are short."""
    return ["--set", "hole.area=[0.03,0.03]"]
