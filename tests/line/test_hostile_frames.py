"""Hostile frames over every Modbus line, and requests to the page; `python -m tests.hostile` sends the full number."""

from tests import hostile

FRAMES, SEED = 1000, 1
LEAST = {"TCP": FRAMES, "TLS": FRAMES, "TLS handshake": FRAMES // 20, "RTU": FRAMES // 20, "HTTP": FRAMES}


def test_every_kind_of_answer_was_provoked():
    """Every answer is compared with an oracle; no line falls silent, and no register of a bystander changes."""
    seen = {name: seen for name, seen, _ in hostile.run(FRAMES, SEED)}
    assert {line: seen[line].total() >= frames for line, frames in LEAST.items()} == dict.fromkeys(LEAST, True)
    for line in ("TCP", "TLS"):
        assert set(seen[line]) == {"served", "closed", "exception 01", "exception 02", "exception 03"}
    assert set(seen["HTTP"]) >= {"101", "200", "400", "401", "404", "405", "421", "closed"}
