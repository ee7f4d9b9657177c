"""Frames of an iCub board are joined to triangles, and broken ones are counted."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.skin.health import ERROR_COUNT
from drivers.skin.icub_wire import TAXELS, TriangleAssembler, TriangleReading, encode_triangle, setup
from drivers.transport.wires import CanFrame

readings = st.builds(
    TriangleReading,
    st.lists(st.integers(0, 255), min_size=TAXELS, max_size=TAXELS).map(tuple),
    st.integers(0, 0xFFF),
    st.integers(0, 15),
)


@given(readings, st.integers(0, 15), st.integers(0, 15))
def test_triangle_comes_back_from_its_two_frames(reading, board, triangle):
    assembler = TriangleAssembler(board)
    head, tail = encode_triangle(board, triangle, reading)
    assert assembler.feed(head) is None
    assert assembler.feed(tail) == (triangle, reading)


def test_frames_are_those_of_the_protocol():
    head, tail = encode_triangle(3, 5, TriangleReading(tuple(range(12)), 0x801, 2))
    assert head == CanFrame(0x435, bytes([0x40, 0, 1, 2, 3, 4, 5, 6]))
    assert tail == CanFrame(0x435, bytes([0xC0, 7, 8, 9, 10, 11, 0x80, 0x12]))
    assert setup(3).id == 0x203


@given(readings)
def test_truncated_frames_are_counted_and_give_nothing(reading):
    for number, whole in enumerate(encode_triangle(1, 0, reading)):
        for length in range(8):
            assembler, frames = TriangleAssembler(1), list(encode_triangle(1, 0, reading))
            frames[number] = CanFrame(whole.id, whole.data[:length])
            assert [assembler.feed(frame) for frame in frames] == [None, None]
            assert assembler.broken >= number or assembler.broken == 1


def test_two_heads_in_a_row_are_counted():
    assembler, (head, tail) = TriangleAssembler(0), encode_triangle(0, 0, TriangleReading((0,) * 12))
    for frame in (head, head, tail, tail):
        assembler.feed(frame)
    assert assembler.broken == 2


@pytest.mark.parametrize(("value", "counts"), [(0xFF, 0), (0xF0, 15 * 128), (0, 255 * 128)])
def test_counts_rise_with_pressure(value, counts):
    assert TriangleReading((value,) * 12).counts().tolist() == [counts] * 12


@pytest.mark.parametrize(("faults", "marked"), [({"out_of_range": 1 << 4}, [4]), ({"error": 1}, list(range(12)))])
def test_taxels_out_of_range_or_in_error_are_marked(faults, marked):
    counts = TriangleReading((0xF0,) * 12, **faults).counts()
    assert np.flatnonzero(counts >= ERROR_COUNT).tolist() == marked
