"""RTU frames are found in noise and pieces, and bounded in length."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from plc_bridge.modbus.rtu_frames import LONGEST, Receiver, is_intact, with_check_sum
from tests.damage import each_bit_flipped, pieces

UNIT = 1
READ = bytes.fromhex("01 03 0000 000A")
WRITE = bytes.fromhex("01 10 0001 0002 04 0001 0002")
FOREIGN = bytes.fromhex("07 03 0000 0001")
FOREIGN_RESPONSE = bytes.fromhex("07 03 02 1234")


def received(*pieces):
    receiver = Receiver(UNIT)
    for piece in pieces:
        receiver.feed(piece)
    return receiver.take(), receiver


def test_check_sum_is_that_of_the_standard():
    # Modbus over Serial Line V1.02, appendix B: 02 07 has CRC 1241 hex, sent as 41 12
    assert with_check_sum(bytes.fromhex("02 07")) == bytes.fromhex("02 07 41 12")


def test_every_flipped_bit_is_noticed():
    assert not any(map(is_intact, each_bit_flipped(with_check_sum(READ))))


@pytest.mark.parametrize("noise", [b"\x00", b"\xff\xff", b"\x01\x03", with_check_sum(READ)[:5]])
def test_noise_before_and_after_a_frame_is_skipped_and_counted(noise):
    frames, receiver = received(noise, with_check_sum(READ), noise)
    receiver.give_up()
    assert (frames, receiver.bad) == ([READ], 2)


def test_broken_frame_does_not_hide_the_next():
    broken = with_check_sum(READ)[:-1] + b"\x00"
    frames, receiver = received(broken, with_check_sum(WRITE))
    assert (frames, receiver.bad) == ([WRITE], 1)


@pytest.mark.parametrize("request_", ["01 2B 0E 01 00", "01 03 0000 00", "01 07", "01 10 0001 0002 04 0001"])
def test_an_unknown_request_alone_is_handed_on(request_):
    request = bytes.fromhex(request_)
    assert received(with_check_sum(request))[0] == [request]


def test_what_never_ends_is_dropped():
    receiver = Receiver(UNIT)
    receiver.feed(b"\x01\x10" * LONGEST * 2)
    assert (receiver.take(), receiver.bad, receiver.is_full) == ([], 1, False)


def test_everything_is_bounded_by_the_longest_frame():
    longest = bytes([UNIT, 16, 0, 0, 0, 123, 246]) + bytes(246)
    assert len(with_check_sum(longest)) == LONGEST - 1
    assert received(with_check_sum(longest))[0] == [longest]


@given(st.lists(st.sampled_from([READ, WRITE, FOREIGN, FOREIGN_RESPONSE]), max_size=6), st.data())
def test_frames_come_out_whole_however_they_are_cut(frames, data):
    receiver, out = Receiver(UNIT), []
    for piece in pieces(b"".join(map(with_check_sum, frames)), data):
        receiver.feed(piece)
        out += receiver.take()
    assert (out, receiver.bad) == (frames, 0)
