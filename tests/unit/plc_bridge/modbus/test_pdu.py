"""Requests are answered by the Modbus specification, or by an exception."""

import pytest

from plc_bridge.modbus.pdu import is_exception, respond


class FakeStation:
    """Ten words and ten bits in each table."""

    def __init__(self):
        self.words, self.inputs = list(range(10)), [100 + n for n in range(10)]
        self.bits, self.discrete = [True, False] * 5, [False, True] * 5

    def slice(self, values, address, count):
        if address + count > len(values):
            raise LookupError
        return values[address : address + count]

    def read_words(self, function, address, count):
        return self.slice({3: self.words, 4: self.inputs}[function], address, count)

    def read_bits(self, function, address, count):
        return self.slice({1: self.bits, 2: self.discrete}[function], address, count)

    def write_words(self, address, words):
        self.slice(self.words, address, len(words))
        self.words[address : address + len(words)] = words

    def write_bits(self, address, bits):
        self.slice(self.bits, address, len(bits))
        self.bits[address : address + len(bits)] = bits

    def mask_word(self, address, kept, added):
        (word,) = self.slice(self.words, address, 1)
        self.words[address] = word & kept | added & ~kept

    def is_running(self):
        return True


@pytest.fixture
def station():
    return FakeStation()


@pytest.mark.parametrize(
    ("request_", "response"),
    [
        ("01 0000 000A", "01 02 55 01"),
        ("02 0000 0003", "02 01 02"),
        ("03 0001 0002", "03 04 0001 0002"),
        ("04 0009 0001", "04 02 006D"),
        ("17 0000 0002 0001 0001 02 7777", "17 04 0000 7777"),
        ("08 0000 A537", "08 0000 A537"),
        ("08 0000 A537 0001", "08 0000 A537 0001"),
    ],
)
def test_requests_are_answered_by_the_specification(station, request_, response):
    assert respond(bytes.fromhex(request_), station) == bytes.fromhex(response)


@pytest.mark.parametrize(
    ("request_", "read", "values"),
    [
        ("05 0001 FF00", "01 0000 0003", "01 01 07"),
        ("05 0000 0000", "01 0000 0003", "01 01 04"),
        ("0F 0000 0003 01 02", "01 0000 0003", "01 01 02"),
        ("0F 0000 0008 01 FF", "01 0000 000A", "01 02 FF 01"),
        ("06 0003 1234", "03 0003 0001", "03 02 1234"),
        ("10 0000 0002 04 AAAA BBBB", "03 0000 0002", "03 04 AAAA BBBB"),
        ("16 0005 00F2 0025", "03 0005 0001", "03 02 0017"),
    ],
)
def test_writes_are_echoed_without_their_data_and_read_again(station, request_, read, values):
    station.words[5] = 0x12  # the example of the specification, 6.16
    written = bytes.fromhex(request_)
    assert respond(written, station) == (written[:5] if written[0] in (15, 16) else written)
    assert respond(bytes.fromhex(read), station) == bytes.fromhex(values)


@pytest.mark.parametrize(
    ("request_", "exception"),
    [
        ("03 0000 0000", "83 03"),
        ("03 0000 007E", "83 03"),
        ("01 0000 0000", "81 03"),
        ("01 0000 07D1", "81 03"),
        ("05 0000 1234", "85 03"),
        ("0F 0000 0000 00", "8F 03"),
        ("0F 0000 0003 02 0000", "8F 03"),
        ("0F 0000 0008 02 FF00", "8F 03"),
        ("0F 0000 0009 01 FF", "8F 03"),
        ("10 0000 0000 00", "90 03"),
        ("10 0000 0002 02 AAAA", "90 03"),
        ("10 0000 0002 04 AAAA", "90 03"),
        ("10 0000 0001 02 AAAA BBBB", "90 03"),
        ("17 0000 0000 0000 0001 02 0000", "97 03"),
        ("17 0000 0001 0000 0000 00", "97 03"),
        ("17 0000 0001 0000 0002 02 7777", "97 03"),
        ("03 0000", "83 03"),
        ("03 0000 0001 00", "83 03"),
        ("03", "83 03"),
        ("10", "90 03"),
        ("03 000A 0001", "83 02"),
        ("03 FFFF 007D", "83 02"),
        ("06 000A 0000", "86 02"),
        ("05 000A FF00", "85 02"),
        ("10 0009 0002 04 AAAA BBBB", "90 02"),
        ("17 000A 0001 0000 0001 02 7777", "97 02"),
        ("17 8000 0001 0000 0001 02 0001", "97 02"),
        ("17 0000 0001 0000 0040 80" + 64 * "0001", "97 02"),
        ("00", "80 01"),
        ("16 000A FFFF 0000", "96 02"),
        ("16 0000 FFFF", "96 03"),
        ("08 0001 0000", "88 01"),
        ("08 0000", "88 03"),
        ("11 00", "91 03"),
        ("2B 0D 01 00", "AB 01"),
        ("2B 0E 00 00", "AB 03"),
        ("2B 0E 05 00", "AB 03"),
        ("2B 0E 04 03", "AB 02"),
        ("2B 0E 01", "AB 03"),
        ("83 00", "83 01"),
    ],
)
def test_what_cannot_be_served_gets_its_exception_and_changes_nothing(station, request_, exception):
    assert respond(bytes.fromhex(request_), station) == bytes.fromhex(exception)
    assert (station.words, station.bits) == (list(range(10)), [True, False] * 5)


def test_server_id_is_the_product_and_whether_it_runs(station):
    assert respond(b"\x11", station) == b"\x11\x17tactile-insertion-cell\xff"
    station.is_running = lambda: False
    assert respond(b"\x11", station)[-1] == 0


@pytest.mark.parametrize(
    ("code", "first", "numbers"),
    [(1, 0, [0, 1, 2]), (1, 2, [2]), (1, 9, [0, 1, 2]), (2, 0, [0, 1, 2, 4, 5]), (3, 0, [0, 1, 2, 4, 5]), (4, 4, [4])],
)
def test_the_device_identifies_itself(station, code, first, numbers):
    answer = respond(bytes([43, 14, code, first]), station)
    assert answer[:7] == bytes([43, 14, code, 0x82, 0, 0, len(numbers)])
    found, rest = [], answer[7:]
    while rest:
        assert rest[2 : 2 + rest[1]].isascii()
        found.append(rest[0])
        rest = rest[2 + rest[1] :]
    assert found == numbers


@pytest.mark.parametrize(
    ("request_", "response"),
    [
        ("03 0000 007D", "03 FA" + 125 * "0000"),
        ("0F 0000 07B0 F6" + 246 * "00", "0F 0000 07B0"),
        ("10 0000 007B F6" + 246 * "00", "10 0000 007B"),
    ],
)
def test_largest_read_and_write_are_served(station, request_, response):
    station.words, station.bits = [0] * 125, [False] * 1968
    assert respond(bytes.fromhex(request_), station) == bytes.fromhex(response)


def test_without_the_right_a_function_does_not_exist(station):
    def refuse(address, words):
        raise PermissionError

    station.write_words = refuse
    assert respond(bytes.fromhex("06 0003 1234"), station) == bytes.fromhex("86 01")


def test_exceptions_have_the_highest_bit_of_their_function():
    assert is_exception(b"\x80\x01")
    assert is_exception(b"\x83\x02")
    assert not is_exception(b"\x03\x00")
