"""Reports of the switch board are decoded exactly, or refused."""

import random
from itertools import combinations

from hypothesis import given
from hypothesis import strategies as st

from drivers.switch.wire import LENGTH, TIME_RANGE, Contacts, Decoder, SwitchReport, decode, encode
from tests.damage import each_bit_flipped, flipped, pieces

reports = st.builds(
    SwitchReport,
    firmware=st.integers(0, 127),
    contacts=st.sampled_from(Contacts),
    time=st.integers(0, TIME_RANGE - 1),
    normally_open=st.booleans(),
    normally_closed=st.booleans(),
    is_memory_broken=st.booleans(),
    is_program_broken=st.booleans(),
    was_hung=st.booleans(),
    was_starved=st.booleans(),
)
CLOSED = encode(SwitchReport(1, Contacts.CLOSED, 1234, normally_open=True))


@given(reports)
def test_what_is_written_is_read(report):
    assert decode(encode(report)) == report


@given(reports)
def test_every_truncation_is_refused(report):
    packet = encode(report)
    assert [decode(packet[:n]) for n in range(LENGTH)] == [None] * LENGTH
    assert [decode(packet[n:]) for n in range(1, LENGTH)] == [None] * (LENGTH - 1)


@given(reports)
def test_every_flipped_bit_is_refused(report):
    assert all(decode(packet) is None for packet in each_bit_flipped(encode(report)))


def test_any_two_or_three_flipped_bits_are_refused():
    for count in (2, 3):
        assert all(decode(flipped(CLOSED, *bits)) is None for bits in combinations(range(8 * LENGTH), count))


@given(st.lists(reports, min_size=1, max_size=5), st.data())
def test_pieces_of_any_size_give_the_same_reports(sent, data):
    decoder = Decoder()
    found = [report for piece in pieces(b"".join(map(encode, sent)), data) for report in decoder.feed(piece)]
    assert (found, decoder.refused) == (sent, 0)


@given(reports, reports, st.sets(st.integers(0, LENGTH - 1), min_size=1))
def test_lost_bytes_cost_their_packet_and_no_other(first, second, lost):
    damaged = bytes(byte for place, byte in enumerate(encode(first)) if place not in lost)
    assert Decoder().feed(damaged + encode(second)) == [second]


def test_noise_is_no_report():
    noise, decoder = random.Random(1).randbytes(200_000), Decoder()
    assert decoder.feed(noise) == []
    assert decoder.refused > 198_000


@given(st.lists(reports, max_size=6), st.randoms(use_true_random=False))
def test_a_bad_line_gives_no_report_that_was_not_sent(sent, chance):
    stream = bytearray(b"".join(map(encode, sent)))
    received = bytes(
        byte ^ (1 << chance.randrange(8) if chance.random() < 0.03 else 0) for byte in stream if chance.random() > 0.03
    )
    assert all(report in sent for report in Decoder().feed(received))
