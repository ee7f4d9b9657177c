"""Bytes from outside, changed at random with a fixed seed: every one is understood or refused in one line."""

import random

from cell.page.commands import BadAskError, parse
from cell.page.guard import refusal
from cell.page.token import is_token
from tests.inputs import inputs

ASKS = [b'{"ask":"start","program":"insert_peg","recipe":1,"serial":"A"}', b'{"ask":"unlock","token":"abc"}', b"[]"]
HOSTS = [b"127.0.0.1:80", b"localhost", b"evil.example", b"[::1]:1"]
PIECES = [b"[", b"{", b'"', b"\\ud800", b"1e999", b"NaN", b"-", b"9" * 30, b"\x00", b"null", b"://", b"@"]
INPUTS = inputs(20_000)


def changed(data: bytes, rng: random.Random) -> bytes:
    """Return bytes with a few of them changed, added, left out or cut off."""
    wrong = bytearray(data)
    for _ in range(rng.randrange(1, 6)):
        kind, place = rng.randrange(4), rng.randrange(len(wrong) + 1)
        if kind == 0 and wrong:
            wrong[place % len(wrong)] = rng.randrange(256)
        elif kind == 1:
            wrong[place:place] = rng.choice(PIECES) * rng.choice([1, 1, 50, 400])
        elif kind == 2:
            del wrong[place : place + rng.randrange(10)]
        else:
            del wrong[place:]
    return bytes(wrong)


def test_a_message_of_a_page_is_understood_or_refused():
    rng, understood, lines = random.Random(1), 0, set[int]()
    for _ in range(INPUTS):
        text = changed(rng.choice(ASKS), rng)
        try:
            ask = parse(text if rng.random() < 0.5 else text.decode(errors="replace"))
        except BadAskError as error:
            lines.add(len(str(error).splitlines()))
            continue
        understood += 1
        assert ask.token is None or not is_token(ask.token, "x" * 24)
    assert lines == {1}
    assert 0.003 < understood / INPUTS < 0.3


def test_the_names_of_a_request_are_the_cells_or_refused():
    rng, own = random.Random(2), 0
    for _ in range(INPUTS):
        host, origin = (changed(rng.choice(HOSTS), rng).decode(errors="replace") for _ in range(2))
        own += refusal(host, None) == ""
        for name in (host, "127.0.0.1:80"):
            assert refusal(name, f"http://{origin}") or origin.lower() == name.lower()
    assert 0.005 < own / INPUTS < 0.5
