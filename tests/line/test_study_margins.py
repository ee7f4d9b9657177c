"""The study of margins, with one short trial a level."""

from tests.studies import is_chart, rows_of, studied


def test_a_method_that_fails_at_the_honest_level_has_no_margin(tmp_path):
    words = ("--trials", "1", "--method", "shipped", "--error", "all errors together", "--set", "search.timeout=0.1")
    at_90, at_50 = studied(tmp_path, "margins", *words)["margins"]
    for margin in (at_90, at_50):
        assert (margin["holds"], margin["fails"], margin["margin"]) == (None, 1.0, 0.0)
        assert margin["seen"] == "0/1 at 1"
    assert len(rows_of(tmp_path / "margins.csv")) == 2
    assert is_chart(tmp_path / "margins.png")


def test_a_method_that_holds_at_the_hardest_level_has_the_whole_range(tmp_path):
    words = ("--trials", "1", "--seed", "5", "--method", "shipped", "--error", "torque path: transport")
    at_90, at_50 = studied(tmp_path, "margins", *words, "--set", "reality.scale=0")["margins"]
    assert (at_90["holds"], at_90["fails"], at_90["size"]) == (16.0, None, "0.016 to 0.032 s")
    assert at_50["margin"] == 16.0
