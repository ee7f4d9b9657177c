"""COBS frames come back whole, and a damaged frame is never taken for another one."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.transport.cobs import Deframer, frame, unframe
from drivers.transport.crc import crc16
from tests.damage import each_bit_flipped, pieces

contents = st.one_of(
    st.binary(max_size=300), st.integers(0, 600).map(bytes), st.integers(0, 600).map(lambda n: b"x" * n)
)


@given(contents)
def test_content_comes_back_and_only_the_end_is_zero(content):
    line = frame(content)
    assert line.index(0) == len(line) - 1
    assert unframe(line[:-1]) == content


@pytest.mark.parametrize("length", [252, 253, 508, 509])
def test_a_frame_is_at_most_one_byte_in_254_longer(length):
    assert len(frame(b"x" * length)) <= length + 2 + 3 + 1
    assert crc16(b"123456789") == 0xD64E


@given(st.lists(contents, max_size=5), st.data())
def test_frames_come_whole_however_the_bytes_are_cut(sent, data):
    deframer = Deframer(600)
    got = [content for piece in pieces(b"".join(map(frame, sent)), data) for content in deframer.feed(piece)]
    assert (got, deframer.broken) == (sent, 0)


@given(st.binary(min_size=1, max_size=60))
def test_truncated_frame_is_counted_and_the_next_one_read(content):
    line = frame(content)
    for length in range(1, len(line) - 1):
        deframer = Deframer(300)
        assert deframer.feed(line[:length] + b"\0" + frame(b"next")) == [b"next"]
        assert deframer.broken == 1


@settings(max_examples=60)
@given(st.binary(max_size=60), st.binary(max_size=20))
def test_flipped_bit_never_gives_another_frame(content, following):
    """A flipped bit in the delimiter joins two frames; the third must still arrive."""
    for spoilt in each_bit_flipped(frame(content)):
        deframer = Deframer(300)
        got = deframer.feed(spoilt + frame(following) + frame(b"third"))
        assert got in ([following, b"third"], [b"third"])
        assert deframer.broken >= 1


@given(st.binary(max_size=2000))
def test_noise_is_bounded_and_the_reader_is_in_step_after_a_delimiter(noise):
    deframer = Deframer(100)
    deframer.feed(noise)
    assert deframer.feed(b"\0" + frame(b"good"))[-1:] == [b"good"]
    assert len(deframer._pending) <= 110


def test_endless_frame_is_counted_once():
    deframer = Deframer(10)
    for _ in range(50):
        assert deframer.feed(b"\x01" * 100) == []
    assert deframer.feed(b"\0" + frame(b"good")) == [b"good"]
    assert deframer.broken == 1
