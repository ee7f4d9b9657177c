"""The SDO server against canopen's client, and against requests that no client sends."""

import canopen
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from plc_bridge.canopen.objects import dictionary
from plc_bridge.canopen.sdo import SEGMENT_TIMEOUT, SdoServer
from tests.canopen_rig import NODE, PLACES, REGISTERS, Rig
from tests.inputs import inputs

SERIAL = PLACES["command_serial"].subindex
TOGGLE, COMMAND, LENGTH, TOO_LONG, TOO_SHORT = 0x05030000, 0x05040001, 0x06070010, 0x06070012, 0x06070013


class Direct(canopen.Network):
    """A network of canopen whose frames a rig's node takes and answers at once."""

    def __init__(self, rig):
        super().__init__()
        self._rig = rig

    def send_message(self, can_id, data, remote=False):
        self._rig.take()
        self._rig.give(can_id, data)
        for frame in list(self._rig.sent):
            self.notify(frame.id, bytearray(frame.data), self._rig.now)


@pytest.fixture
def rig():
    return Rig()


@pytest.fixture
def remote(rig):
    return Direct(rig).add_node(canopen.RemoteNode(NODE, dictionary(REGISTERS, NODE)))


def abort_of(answer):
    assert answer[0] == 0x80
    return int.from_bytes(answer[4:], "little")


# canopen's client.


@pytest.mark.parametrize("text", ["A", "ABCD", "ABCDEFG", "ABCDEFGH", "x" * 32])
def test_texts_of_every_length_come_back(remote, text):
    assert remote.sdo["report"]["report_holder"].raw == ""
    remote.sdo["command"]["command_serial"].raw = text
    assert remote.sdo["command"]["command_serial"].raw == text


@pytest.mark.parametrize("name", ["command_sequence", "command_code", "command_recipe", "command_version"])
@pytest.mark.parametrize("value", [0, 1, 0x1234, 0xFFFF])
def test_numbers_come_back(remote, name, value):
    remote.sdo["command"][name].raw = value
    assert remote.sdo["command"][name].raw == value


def test_every_object_can_be_read(remote):
    for index in remote.object_dictionary:
        found = remote.object_dictionary[index]
        for subindex in getattr(found, "subindices", {0: found}):
            remote.sdo.upload(index, subindex)


@pytest.mark.parametrize(
    ("index", "subindex", "data", "abort"),
    [
        (0x3000, 0, b"\0", 0x06020000),
        (0x2000, 99, b"\0\0", 0x06090011),
        (0x1017, 1, b"\0\0", 0x06090011),
        (0x1000, 0, bytes(4), 0x06010002),
        (0x2001, 3, bytes(2), 0x06010002),
        (0x1600, 1, bytes(4), 0x06010002),
        (0x2000, 2, bytes(1), TOO_SHORT),
        (0x2000, 2, bytes(4), TOO_LONG),
        (0x2000, SERIAL, bytes(33), TOO_LONG),
        (0x2000, 6, b"\x04\0", 0x06090031),
        (0x1029, 1, b"\x03", 0x06090031),
    ],
)
def test_what_may_not_be_written_is_aborted_with_the_code_of_the_standard(rig, remote, index, subindex, data, abort):
    with pytest.raises(canopen.SdoAbortedError) as caught:
        remote.sdo.download(index, subindex, data)
    assert caught.value.code == abort
    assert (rig.node.counts.requests, rig.node.counts.exceptions) == (1, 1)


# Requests that no client sends.


@pytest.mark.parametrize("specifier", [0x0D, 0x60, 0xA0, 0xC0, 0xE0])
def test_segments_not_announced_and_unknown_commands_are_refused(rig, specifier):
    answer = rig.ask(bytes([specifier, 0x00, 0x20, SERIAL, 0, 0, 0, 0]))
    assert abort_of(answer) == COMMAND
    assert specifier < 0xA0 or answer[1:4] == bytes([0x00, 0x20, SERIAL])


def start_download(rig, size=None):
    head = bytes([0x21 if size is not None else 0x20, 0x00, 0x20, SERIAL])
    return rig.ask(head + (size or 0).to_bytes(4, "little"))


def test_a_wrong_toggle_bit_ends_the_transfer(rig):
    start_download(rig, 14)
    assert abort_of(rig.ask(b"\x10" + b"A" * 7)) == TOGGLE
    assert abort_of(rig.ask(b"\x00" + b"A" * 7)) == COMMAND


def test_an_abort_of_the_client_ends_the_transfer_unanswered(rig):
    start_download(rig, 7)
    assert rig.ask(bytes.fromhex("8000200900000405")) is None
    assert abort_of(rig.ask(b"\x01" + b"A" * 7)) == COMMAND


@pytest.mark.parametrize("announced", [3, 14])
def test_a_text_of_another_length_than_announced_is_not_stored(rig, announced):
    start_download(rig, announced)
    assert abort_of(rig.ask(b"\x01" + b"A" * 7)) == LENGTH
    assert rig.read(0x2000, SERIAL) == 0


def test_a_transfer_without_end_is_cut_at_the_object_s_size(rig):
    start_download(rig)
    answers = [rig.ask(bytes([0x10 * (n % 2)]) + b"A" * 7) for n in range(5)]
    assert [answer[0] for answer in answers] == [0x20, 0x30, 0x20, 0x30, 0x80]
    assert abort_of(answers[-1]) == TOO_LONG


@pytest.mark.parametrize(("pause", "is_forgotten"), [(SEGMENT_TIMEOUT, False), (SEGMENT_TIMEOUT + 0.01, True)])
def test_a_transfer_that_rests_too_long_is_forgotten(rig, pause, is_forgotten):
    start_download(rig, 14)
    rig.now += pause
    assert (rig.ask(b"\x00" + b"A" * 7)[0] == 0x80) is is_forgotten


class Memory:
    """Objects of any kind: each sub-index has as many bytes as its number."""

    def __init__(self):
        self.values = {}

    def room(self, index, subindex):
        return subindex

    def read(self, index, subindex):
        return self.values.get(subindex, b"")

    def write(self, index, subindex, data):
        assert len(data) <= subindex
        self.values[subindex] = bytes(data)


@given(st.lists(st.binary(min_size=8, max_size=8), max_size=30))
@settings(max_examples=inputs(300))
def test_any_requests_get_answers_of_8_bytes_and_never_overrun_an_object(requests):
    objects = Memory()
    server = SdoServer(objects)
    for request in requests:
        answer = server.answer(request, 0.0)
        assert answer is None if request[0] >> 5 == 4 else len(answer) == 8


@given(st.binary(max_size=255))
@settings(max_examples=100)
def test_what_is_written_in_segments_is_read_in_segments(data):
    objects = Memory()
    server = SdoServer(objects)
    server.answer(b"\x21\0\0\xff" + len(data).to_bytes(4, "little"), 0.0)
    pieces = [data[place : place + 7] for place in range(0, max(len(data), 1), 7)]
    for n, piece in enumerate(pieces):
        is_last = n == len(pieces) - 1
        server.answer(bytes([0x10 * (n % 2) | 7 - len(piece) << 1 | is_last]) + piece.ljust(7, b"\0"), 0.0)
    answer = server.answer(b"\x40\0\0\xff\0\0\0\0", 0.0)
    if answer[0] & 2:
        got = answer[4 : 8 - (answer[0] >> 2 & 3)]
    else:
        got, n = b"", 0
        while True:
            part = server.answer(bytes([0x60 | 0x10 * (n % 2)]) + bytes(7), 0.0)
            got += part[1 : 8 - (part[0] >> 1 & 7)]
            n += 1
            if part[0] & 1:
                break
    assert got == data


@pytest.mark.parametrize(
    "requests",
    [
        (b"\x22\x00\x20\x02\x34\x12\xff\xff",),
        (b"\x20\x00\x20\x02\xff\xff\xff\xff", b"\x0b\x34\x12\x00\x00\x00\x00\x00"),
    ],
)
def test_a_value_of_unstated_length_fills_its_object(requests):
    objects = Memory()
    server = SdoServer(objects)
    answers = [server.answer(request, 0.0) for request in requests]
    assert (objects.values, answers[0]) == ({2: b"\x34\x12"}, b"\x60\x00\x20\x02\x00\x00\x00\x00")
