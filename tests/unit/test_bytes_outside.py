"""Random bytes at each wire and in each file: none ends the program, and what is right after them is understood."""

import random
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path

import pytest

from cell.calibrate import proven
from cell.config.load import load
from cell.page.token import page_token
from cell.peg.custody import Custody
from cell.run.learning import FILE, read_learned
from drivers.arm.calibration import read_arm_calibration
from drivers.errors import ConfigError
from drivers.skin.calibration import read_calibration
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
    to_can,
)
from drivers.skin.icub_wire import TriangleAssembler, TriangleReading, encode_triangle
from drivers.skin.layout import shape_of
from drivers.switch.wire import Contacts, Decoder, SwitchReport
from drivers.switch.wire import encode as switch_packet
from drivers.transport.cobs import Deframer, frame
from drivers.transport.wires import CanFrame
from plc_bridge.modbus.pdu import respond
from plc_bridge.modbus.rtu_frames import Receiver, with_check_sum
from plc_bridge.protocol.messages import PartPlace
from tests.hostile import request
from tests.inputs import KEPT, inputs
from tests.pages import ROOT
from tests.unit.cell.page.test_outside import changed
from tests.unit.plc_bridge.modbus.test_pdu import FakeStation

INPUTS, FILES = inputs(20_000), inputs(100)
pytestmark = pytest.mark.timeout(max(600, FILES // 25))
READ = bytes.fromhex("01 03 0000 000A")
WIRE = SkinWireConfig()
SCAN = Message(0xF1, bytes([0, 0, *range(24)]))
Wire = tuple[Callable[[random.Random], object], Callable[[], bool]]
"""Function that takes one random input, and one that returns True if a right one is understood."""


def spoiled(data: bytes, rng: random.Random) -> bytes:
    """Return random bytes, or these with a few of them changed."""
    if rng.random() < 0.3:
        return rng.randbytes(rng.randrange(12))
    wrong = bytearray(data)
    for _ in range(rng.randrange(3)):
        wrong[rng.randrange(len(wrong))] = rng.randrange(256)
    return bytes(wrong[rng.randrange(3) :][: rng.choice([3, 8, 40])])


def modbus() -> Wire:
    station = FakeStation()

    def take(rng: random.Random) -> None:
        assert 1 <= len(respond(request(rng), station)) <= 253

    return take, lambda: respond(READ[1:], station)[:2] == b"\x03\x14"


def modbus_serial() -> Wire:
    receiver, whole = Receiver(1), with_check_sum(READ)

    def take(rng: random.Random) -> None:
        receiver.feed(spoiled(whole, rng))
        receiver.take()
        if rng.random() < 0.3:
            receiver.give_up()

    def is_understood() -> bool:
        receiver.give_up()
        receiver.feed(whole)
        return receiver.take() == [READ]

    return take, is_understood


def cyskin_messages(data: bytes | None, channels: Channels, scans: ScanAssembler) -> bool:
    """Decode a message in every way that its reader has; return True if it completes a scan."""
    if data is None:
        return False
    message = decode(data, WIRE)
    for read in (decode_module, channels.decode):
        try:
            part = read(message.payload, WIRE)
        except WireError:
            continue
        if isinstance(part, tuple):
            return scans.add(part, 0.0) is not None
    return False


def cyskin_can() -> Wire:
    assembler, channels, whole = CanAssembler(), Channels([Module(0, 1, channels=12)]), to_can(encode(SCAN, WIRE), 1)
    scans = ScanAssembler(12, 0.01)

    def feed(frames: list[CanFrame]) -> bool:
        messages = [assembler.feed(each) for each in frames]
        assert all(data is None or len(data) <= LONGEST for data in messages)
        return sum(cyskin_messages(data, channels, scans) for data in messages) > 0

    def take(rng: random.Random) -> None:
        original = rng.choice(whole)
        number = original.id if rng.random() < 0.7 else rng.randrange(0x800)
        with suppress(WireError):
            feed([CanFrame(number, spoiled(original.data, rng)[:8])])

    return take, lambda: feed(whole) or feed(whole)


def cyskin_serial() -> Wire:
    deframer, channels, scans = Deframer(60), Channels([Module(0, 1, channels=12)]), ScanAssembler(12, 0.01)
    whole = frame(encode(SCAN, WIRE))

    def feed(data: bytes) -> bool:
        return sum(cyskin_messages(each, channels, scans) for each in deframer.feed(data)) > 0

    def take(rng: random.Random) -> None:
        with suppress(WireError):
            feed(spoiled(whole, rng))

    def is_understood() -> bool:
        deframer.reset()
        return feed(whole) or feed(whole)

    return take, is_understood


def icub_can() -> Wire:
    assembler, reading = TriangleAssembler(3), TriangleReading(tuple(range(12)))
    whole = encode_triangle(3, 5, reading)

    def take(rng: random.Random) -> None:
        original = rng.choice(whole)
        number = original.id if rng.random() < 0.5 else 0x430 | rng.randrange(16)
        assembler.feed(CanFrame(number, spoiled(original.data, rng)[:8]))

    return take, lambda: [assembler.feed(each) for each in whole][-1] == (5, reading)


def switch_serial() -> Wire:
    decoder, report = Decoder(), SwitchReport(1, Contacts.CLOSED, 1234, normally_open=True)
    whole = switch_packet(report)
    return lambda rng: decoder.feed(spoiled(whole, rng)), lambda: decoder.feed(whole) == [report]


@pytest.mark.parametrize("wire", [modbus, modbus_serial, cyskin_can, cyskin_serial, icub_can, switch_serial])
def test_random_bytes_on_a_wire_do_no_harm(wire):
    rng = random.Random(20261126)
    take, is_understood = wire()
    for _ in range(INPUTS):
        take(rng)
    assert is_understood()


SEVEN = f"[{', '.join(7 * ['0.1'])}]"
FIGURE = f"value = {SEVEN}\ninterval = {SEVEN}\n"
ARM = (
    f'date = 2026-01-01\narm = "Franka Emika Panda"\nunit = "1"\nspeeds = [0.1, 0.2]\nunexplained = {SEVEN}\n'
    + "".join(f"[{name}]\n{FIGURE}" for name in ("offset", "dry", "smooth", "[friction]", "[friction]"))
)  # fmt: skip
GAINS = shape_of("parallelogram")[1] * [1.0]
SKIN = (
    'date = 2026-01-01\nlayout = "parallelogram"\npoint_spread = 1e-3\nresidual = 0.1\nunmeasured = [[], []]\n'
    f"left = {GAINS}\nright = {GAINS}\n"
)


def put(path: Path, data: bytes) -> None:
    """Write a new file: one that is cut and written again waits for the disk."""
    path.unlink(missing_ok=True)
    path.touch(mode=0o600)
    path.write_bytes(data)


@cache
def arm_model():
    return load().cell.arm_model()


def peg_kept_in(path):
    """Read a file of the peg: its place is unknown, or every number is plausible."""
    kept = Custody(path.parent, "sim")._kept
    assert kept is not None
    assert kept.place is PartPlace.UNKNOWN or all(abs(value) <= 2.0 for value in (kept.depth, *kept.tip))


NEVER = ()
"""Errors by which a file that is kept beside the journal stops a start: it is named in the log instead."""


@pytest.mark.parametrize(
    ("name", "whole", "read", "refused"),
    [
        ("sim.toml", (ROOT / "config/sim.toml").read_bytes(), load, ConfigError),
        ("cell_01.toml", (ROOT / "config/cell_01.toml").read_bytes(), load, ConfigError),
        (FILE, KEPT[FILE], lambda path: read_learned(path.parent), ConfigError),
        ("arm.toml", ARM.encode(), lambda path: read_arm_calibration(path, arm_model(), "1"), ConfigError),
        ("skin.toml", SKIN.encode(), lambda path: read_calibration(path, "parallelogram"), ConfigError),
        ("part-sim.json", KEPT["part-sim.json"], peg_kept_in, NEVER),
        ("proven.json", KEPT["proven.json"], proven.read, NEVER),
        ("page-token", KEPT["page-token"], lambda path: page_token(path.parent), NEVER),
    ],
)
def test_a_damaged_file_is_read_or_refused_in_one_line(tmp_path: Path, caplog, name, whole, read, refused):
    rng, path, told = random.Random(7), tmp_path / name, list[str]()
    put(path, whole)
    read(path)
    assert not caplog.messages
    for _ in range(FILES):
        put(path, changed(whole, rng))
        try:
            read(path)
        except refused as error:
            told.append(str(error))
    assert bool(caplog.messages) == (refused is NEVER)
    told += caplog.messages
    assert len(told) > FILES // 2
    assert all(name in text and len(text.splitlines()) == 1 for text in told)
