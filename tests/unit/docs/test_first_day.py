"""The page of the first day has every step that `cell check` names."""

import re

from cell.commands.check import LAST_STEP, STEPS
from tests.pages import ROOT

PAGE = (ROOT / "docs/first-day.md").read_text(encoding="utf-8")


def test_every_step_of_the_check_is_on_the_page():
    steps = [int(number) for number in re.findall(r"^## (\d+)\. ", PAGE, re.M)]
    assert steps == list(range(1, LAST_STEP + 1))
    for name, step in STEPS.items():
        section = PAGE.split(f"## {step}. ")[1].split("\n## ")[0]
        assert f"`{name}`" in section or name in ("arm", "system", "thresholds"), name
