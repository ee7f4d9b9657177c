"""The smallest tuning: three presets, one insertion each, and a recipe that names its criteria."""

import json

from cell.commands.cli import main

SMALL = ["--set", "hole.area=[0.01, 0.01]", "--candidates", "3", "--trials", "1", "--judge", "1", "--workers", "1"]


def test_a_wish_ends_in_a_recipe_with_its_evidence_and_is_taken_up_again(tmp_path, capsys):
    command = ["tune", "--want", "p95<=30 s, force<=60 N", "--seed", "5", "--out", str(tmp_path), "--json", *SMALL]
    assert main(command) == 0
    told = json.loads(capsys.readouterr().out)
    recipe = (tmp_path / "recipe.toml").read_text()
    assert [line["holds"] for line in told["judged"]] == [True, True]
    assert len(told["tried"]) == 3
    assert "seeds 1000005 to 1000005" in recipe
    assert recipe.startswith("# Wished: p95<=30 s, force<=60 N.")
    assert main(["tune", "--want", "p95<=0.1 s", "--seed", "5", "--out", str(tmp_path), *SMALL]) == 1
    assert "not fulfilled by any of 3 settings; nearest: p95<=0.1 s: " in capsys.readouterr().err
