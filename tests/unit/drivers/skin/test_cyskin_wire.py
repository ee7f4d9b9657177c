"""Messages of a CySkin hub are decoded exactly, or refused."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from drivers.skin.board_config import HubConfig
from drivers.skin.cyskin_wire import (
    LONGEST,
    CanAssembler,
    Channels,
    Message,
    Module,
    ScanAssembler,
    SkinWireConfig,
    WireError,
    decode,
    decode_module,
    encode,
    sender,
    to_can,
)
from drivers.transport.crc import Crc8
from drivers.transport.wires import CanFrame
from sim.boards.cyskin_board import EmulatedHub
from tests.damage import each_bit_flipped

WIRE = SkinWireConfig()
HUB = WIRE.hub
crcs = st.builds(Crc8, polynomial=st.integers(0, 127).map(lambda n: 2 * n + 1), initial=st.integers(0, 255))
wires = st.builds(SkinWireConfig, crc=crcs, byte_order=st.sampled_from(["little", "big"]))
messages = st.builds(Message, st.integers(0x10, 0xFF), st.binary(max_size=255))
MODULES = [Module(number, 3535 + number, 12) for number in range(4)]
RECORD = bytes.fromhex("02112233440C500FFEF002")
"""Record of a module that the makers' library reads as below; see `tests.cyskin_makers`."""


def heard(frames):
    """Return the messages that a listener takes from the bus."""
    assembler, taken = CanAssembler(), []
    for frame in frames:
        data = assembler.feed(frame) if sender(frame) == HUB else None
        if data is not None:
            try:
                taken.append(decode(data, WIRE))
            except WireError:
                assembler.broken += 1
    return taken, assembler


@pytest.mark.parametrize(
    ("keys", "check"),
    [
        ({"initial": 0x00}, 0xF4),
        ({"initial": 0x00, "final": 0x55}, 0xA1),
        ({"initial": 0x00, "polynomial": 0x31, "reflected": True}, 0xA1),
        ({"polynomial": 0x2F, "initial": 0xFF, "final": 0xFF}, 0xDF),
        ({"reflected": True, "initial": 0xFF}, 0xD0),
    ],
)
def test_crc_is_that_of_the_catalogue(keys, check):
    assert Crc8(**keys).of(b"123456789") == check


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Crc8(polynomial=6), "0x06 makes the lowest bit of every check sum 0"),
        (lambda: SkinWireConfig(start_up=("declare",)), 'ends with "declare"; "start" needed as the last step'),
    ],
)
def test_a_dialect_that_cannot_work_is_refused(make, words):
    with pytest.raises(ValidationError, match=words):
        make()


@given(messages, wires)
def test_message_comes_back_as_it_went(message, wire):
    assert decode(encode(message, wire), wire) == message


@given(messages, wires)
def test_every_truncation_of_a_message_is_refused(message, wire):
    data = encode(message, wire)
    for length in range(len(data)):
        with pytest.raises(WireError):
            decode(data[:length], wire)


@settings(max_examples=60)
@given(messages, wires)
def test_every_flipped_bit_of_a_message_is_refused(message, wire):
    for spoilt in each_bit_flipped(encode(message, wire)):
        with pytest.raises(WireError):
            decode(spoilt, wire)


@given(st.binary(max_size=LONGEST + 10), wires)
def test_noise_is_refused_or_is_a_message_to_the_last_byte(noise, wire):
    try:
        message = decode(noise, wire)
    except WireError:
        return
    assert encode(message, wire) == noise


@pytest.mark.parametrize("message", [Message(0x0F), Message(0x100), Message(0x43, bytes(256))])
def test_what_does_not_fit_a_message_is_not_sent(message):
    with pytest.raises(WireError):
        encode(message, WIRE)


@given(messages, messages, st.data())
def test_lost_frame_costs_its_own_message_only(message, following, data):
    frames = to_can(encode(message, WIRE), HUB)
    lost = data.draw(st.integers(0, len(frames) - 1))
    taken, _ = heard(frames[:lost] + frames[lost + 1 :] + to_can(encode(following, WIRE), HUB))
    assert taken == [following]


@settings(max_examples=60)
@given(messages, messages)
def test_flipped_bit_in_a_can_frame_is_never_another_message(message, following):
    frames, more = to_can(encode(message, WIRE), HUB), to_can(encode(following, WIRE), HUB)
    for number, frame in enumerate(frames):
        spoilt = [CanFrame(frame.id, data) for data in each_bit_flipped(frame.data)]
        spoilt += [CanFrame(frame.id ^ 1 << bit, frame.data) for bit in range(11)]
        for wrong in spoilt:
            taken, assembler = heard([*frames[:number], wrong, *frames[number + 1 :], *more])
            assert taken == [following]
            assert assembler.broken or wrong.id & 0xFF != HUB


def test_record_of_a_module_is_read_as_the_makers_library_reads_it():
    assert decode_module(RECORD, WIRE) == Module(2, 0x11223344, 12, 0x0FFE)
    assert decode_module(RECORD[:5], WIRE) == Module(2, 0x11223344)


@pytest.mark.parametrize(
    ("record", "said"),
    [
        (b"", "0 bytes, 5 or 11 allowed"),
        (RECORD[:10], "10 bytes"),
        (RECORD + b"\0", "12 bytes"),
        (RECORD[:7] + bytes(4), "12 channels, mask 0x0000; 1 to 12 channels allowed"),
        (RECORD[:5] + b"\x0d" + RECORD[6:], "13 channels"),
        (RECORD[:7] + b"\xfe\x0f" + RECORD[9:], "see board.wire.byte_order"),
    ],
)
def test_record_that_no_module_sends_is_refused(record, said):
    with pytest.raises(WireError, match=said):
        decode_module(record, WIRE)


def test_channel_is_named_by_its_place_among_those_that_are_sent():
    channels = Channels([Module(1, 9, 12, uncut=0b101), Module(0, 7, 12, uncut=0b110)])
    assert channels.uid == (7 << 4 | 1, 7 << 4 | 2, 9 << 4, 9 << 4 | 2)
    start, readings = channels.decode(bytes([1, 1]) + b"\x12\x34", WIRE)
    assert (channels.uid[start], readings.tolist()) == (9 << 4 | 2, [0x1234])


def parts_of(values):
    """Return the parts, first channel and readings, in which an emulated hub with four modules sends a scan."""
    hub = EmulatedHub(HubConfig(channels=tuple(range(1, 11))), lambda: np.reshape(values, (2, 20)))
    hub.are_modules_in_boot_loaders = False
    channels = Channels([Module(number, sui, 12, uncut=0x07FF) for number, sui in enumerate(hub.suis)])
    return channels, [channels.decode(decode(data, WIRE).payload, WIRE) for data in hub.scan()]


@given(st.lists(st.integers(0, 65535), min_size=40, max_size=40))
def test_scan_comes_back_from_its_messages(values):
    channels, (first, second) = parts_of(values)
    assembler = ScanAssembler(len(channels), 0.05)
    assert assembler.add(first, 1.0) is None
    counts, stamp = assembler.add(second, 1.01)
    is_taxel = np.array([uid & 15 > 0 for uid in channels.uid])
    assert (counts[is_taxel].tolist(), stamp) == (values, 1.0)


@given(st.binary(max_size=255))
def test_sensor_data_that_do_not_fit_the_modules_are_refused(payload):
    channels = Channels(MODULES[:2])
    try:
        start, readings = channels.decode(payload, WIRE)
    except WireError:
        return
    assert 0 <= start < start + len(readings) <= len(channels)


@given(st.data())
def test_parts_of_two_scans_are_never_mixed(data):
    """Scan n reads n everywhere; parts get lost at random."""
    halves = ScanAssembler(2, 0.05)
    for stamp in (0.0, 0.1, 0.2):
        halves.add((0, np.zeros(1, dtype=np.uint16)), stamp)
    assert halves.incomplete == 2
    assembler = ScanAssembler(44, 0.05)
    for number in range(8):
        _, parts = parts_of([number] * 40)
        for start, readings in parts:
            if data.draw(st.booleans()):
                scan = assembler.add((start, np.full_like(readings, number)), 0.1 * number)
                assert scan is None or set(scan[0].tolist()) == {number}
