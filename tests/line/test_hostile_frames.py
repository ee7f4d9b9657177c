"""Hostile frames over every Modbus line, and requests to the page; `python -m tests.hostile` sends the full number."""

import pytest

from tests import hostile

FRAMES, SEED = 4000, 1


@pytest.fixture(scope="module")
def seen():
    """Every answer has been compared with the specification, and the bystander with what it had."""
    return {name: seen for name, seen, _ in hostile.run(FRAMES, SEED)}


@pytest.mark.parametrize(
    ("line", "frames"),
    [("TCP", FRAMES), ("TLS", FRAMES), ("TLS handshake", FRAMES // 20), ("RTU", FRAMES // 20), ("HTTP", FRAMES)],
)
def test_no_crash_no_deaf_line_no_register_changed_that_should_not(seen, line, frames):
    assert seen[line].total() >= frames


def test_every_kind_of_answer_was_provoked(seen):
    for line in ("TCP", "TLS"):
        assert set(seen[line]) == {"served", "closed", "exception 01", "exception 02", "exception 03"}
    assert set(seen["HTTP"]) >= {"101", "200", "400", "401", "404", "405", "421", "closed"}
