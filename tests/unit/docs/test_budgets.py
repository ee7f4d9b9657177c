"""No room grows without a reason: each stays within the lines of its budget."""

import tomllib

from tests.pages import ROOT
from tests.sizes import rooms

BUDGETS = tomllib.loads((ROOT / "tests" / "budgets.toml").read_text(encoding="utf-8"))


def test_every_room_stays_within_its_budget_of_lines():
    grown = {room: (count, BUDGETS.get(room, 0)) for room, count in rooms(ROOT).items() if count > BUDGETS.get(room, 0)}
    assert grown == {}, "remove lines, or raise the budget in a commit that states what a user gets for them"


def test_no_budget_is_left_of_a_room_that_is_gone():
    assert set(BUDGETS) <= set(rooms(ROOT))
