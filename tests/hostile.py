"""Hostile and malformed bytes with a fixed seed, against the bridge and the page on a real socket or a serial line.

    python -m tests.hostile [--frames 100000] [--seed 1]

sends that many Modbus frames over TCP, as many over TLS, a twentieth of that where a TLS handshake should be, a
twentieth over RTU, where every second one is noise, and that many requests to the page, each on its own connection.
Every Modbus answer is compared with what `tests.modbus_oracle` says. A bystander holds the lease and must keep it, its
registers and its peace.
"""

import argparse
import logging
import random
import socket
import ssl
import struct
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from pathlib import Path

from cell.config.load import load
from cell.page.server import PageServer
from cell.run.live import Live
from drivers.transport.serial_line import SerialLine
from plc_bridge.bridge import Bridge
from plc_bridge.config import ModbusConfig, PlcConfig, RtuConfig
from plc_bridge.modbus.rtu_frames import with_check_sum
from plc_bridge.protocol.messages import Control
from tests.certificates import Authority, utf8
from tests.hubs import Cable
from tests.modbus_oracle import Oracle
from tests.sockets import PATIENCE, answer, frame
from tests.unit.cell.page.test_outside import changed

BATCH = 40
"""Well-framed requests that are sent before the first answer is read."""
EDGES = (0, 1, 2, 3, 4, 39, 40, 41, 42, 45, 46, 47, 99, 100, 125, 126, 999, 1000, 1045, 1046, 1125, 1126, 32768, 65535)
COUNTS = (*range(6), 24, 25, 40, 41, 42, 46, 47, *range(120, 127), 1968, 1969, 2000, 2001, 65535)
SERVED = (1, 2, 3, 4, 5, 6, 8, 15, 16, 17, 22, 23, 43)
UNIT = 1
LEASE = 5
BYSTANDER = [1, 2, 0, 7, 0, 1]
"""Life, sequence, code, recipe, acknowledge, and the wish for the lease."""
HEAD = b" HTTP/1.1\r\nHost: localhost\r\n"
END = b"Connection: close\r\n\r\n"
UPGRADE = (
    b"GET /live" + HEAD + b"Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
    b"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"
)
PAGE = b"GET /" + HEAD + END
FORM = b"Content-Type: multipart/form-data; boundary=x\r\n"
REQUESTS = (
    PAGE,
    b"GET /runs/1/data" + HEAD + b"Range: bytes=0-9\r\nOrigin: http://localhost\r\n" + END,
    b"GET /runs/1/config" + HEAD + b"Authorization: Bearer x\r\nCookie: a=b\r\n" + END,
    b"POST /runs/1/film.mp4" + HEAD + b"Content-Length: 5\r\n" + END + b"a=b&c",
    b"POST /faults" + HEAD + b"Transfer-Encoding: chunked\r\n" + END + b"5\r\nhello\r\n0\r\n\r\n",
    b"POST /faults" + HEAD + FORM + b"Content-Length: 57\r\n" + END
    + b'--x\r\nContent-Disposition: form-data; name="a"\r\n\r\nb\r\n--x--',
    UPGRADE,
)  # fmt: skip
"""Right requests to the page, which `http` changes."""


def request(rng: random.Random) -> bytes:
    """Return a PDU: right, wrong by a little, or anything at all."""
    kind = rng.randrange(8)
    function = rng.choice(SERVED)
    start, count = rng.choice(EDGES), rng.choice(COUNTS)
    if rng.random() < 0.4:
        start, count = rng.randrange(42), rng.randrange(1, 6)
    if kind == 0:
        return bytes([rng.randrange(256)]) + rng.randbytes(rng.choice([0, 1, 3, 4, 5, 8, rng.randrange(253)]))
    if kind == 1:
        value = rng.choice([0, 0xFF00, 0x00FF, 1, 0x1234, 0xFF01])
        return struct.pack(">BHH", 5, rng.choice([0, 1, 2, 3, 65535]), value)
    if function in (15, 16):
        size = (count + 7) // 8 if function == 15 else 2 * count
        size = size if kind < 6 and size < 247 else rng.randrange(247)
        said = size if kind < 7 else rng.randrange(256)
        return struct.pack(">BHHB", function, start, count, said) + rng.randbytes(size)
    if function == 23:
        written = rng.choice([0, 1, 2, 41, 119, 120])
        said = 2 * written if kind < 6 else rng.randrange(256)
        return struct.pack(">BHHHHB", 23, start, count, rng.choice(EDGES), written, said) + rng.randbytes(2 * written)
    if function == 43:
        pdu = bytes([43, rng.choice([14, 14, 14, 13]), rng.randrange(6), rng.choice([0, 1, 2, 3, 4, 5, 6, 128])])
    elif function == 17:
        pdu = b"\x11"
    elif function == 8:
        pdu = struct.pack(">BH", 8, rng.choice([0, 0, 1, 10])) + rng.randbytes(2 * rng.randrange(4))
    elif function == 22:
        pdu = struct.pack(">BHHH", 22, start, rng.randrange(65536), rng.randrange(65536))
    else:
        pdu = struct.pack(">BHH", function, start, count)
    return pdu + rng.randbytes(rng.randrange(1, 5)) if kind == 7 else pdu


def is_harmless(pdu: bytes) -> bool:
    """Return True if a PDU does not request to share the block of its host."""
    oracle = Oracle()
    oracle.answer(pdu)
    return oracle.words[LEASE] != 2


def broken_frame(rng: random.Random, pdu: bytes) -> bytes:
    """Return a frame after which nothing can be trusted."""
    protocol, length = 0, len(pdu) + 1
    if rng.random() < 0.5:
        protocol = rng.randrange(1, 65536)
    else:
        length = rng.choice([0, 1, 255, 256, 60000, 65535, rng.randrange(255, 65536)])
    return frame(pdu, rng.randrange(65536), protocol, length)


def exchange(client: socket.socket, pdus: list[bytes]) -> list[bytes]:
    """Send requests, cut anywhere, and return what was answered, in order and under their own numbers."""
    frames = b"".join(frame(pdu, n) for n, pdu in enumerate(pdus))
    cut = len(frames) // 3
    client.sendall(frames[:cut])
    client.sendall(frames[cut:])
    answers = [answer(client) for _ in pdus]
    assert [head[:2] for head in answers] == [(n, UNIT) for n in range(len(pdus))]
    return [pdu for _, _, pdu in answers]


def check(pdu: bytes, oracle: Oracle, answer: bytes) -> str:
    """Compare an answer with the oracle's; return what kind it was."""
    head, size = oracle.answer(pdu)
    assert answer.startswith(head), f"{pdu.hex(' ')}: {answer.hex(' ')} instead of {head.hex(' ')}"
    assert len(answer) == size, f"{pdu.hex(' ')}: {len(answer)} bytes instead of {size}"
    return f"exception {answer[1]:02d}" if answer[0] & 0x80 else "served"


def attack_socket(connect: Callable[[], socket.socket], frames: int, seed: int, broken: float) -> Counter[str]:
    """Send `frames`, a part `broken` of them with a header that ends the connection; return what became of them."""
    rng, seen = random.Random(seed), Counter[str]()
    client, oracle = connect(), Oracle()
    sent = 0
    while sent < frames:
        pdus = [pdu for pdu in (request(rng) for _ in range(BATCH)) if is_harmless(pdu)][: frames - sent]
        for pdu, told in zip(pdus, exchange(client, pdus), strict=True):
            seen[check(pdu, oracle, told)] += 1
        sent += len(pdus)
        if rng.random() < broken * BATCH:
            client.sendall(broken_frame(rng, request(rng)))
            with suppress(ConnectionResetError, ssl.SSLError):
                assert client.recv(1) == b"", "answered a frame that has no end"
            client.close()
            seen["closed"] += 1
            sent += 1
            client, oracle = connect(), Oracle()
    client.close()
    return seen


def attack_handshake(
    address: tuple[str, int], connect: Callable[[], socket.socket], knocks: int, seed: int
) -> Counter[str]:
    """Send bytes that are no TLS handshake, and leave; afterwards the next client is served."""
    rng, seen = random.Random(seed), Counter[str]()
    beginnings = [
        bytes.fromhex(text) for text in ("", "16", "16 0301 0005 010000", "17 0303 4000", "15 0303 0002 0228")
    ]
    for _ in range(knocks):
        with socket.create_connection(address, timeout=PATIENCE) as client, suppress(OSError):
            client.sendall(rng.choice(beginnings) + rng.randbytes(rng.randrange(300)))
        seen["knocked"] += 1
    with connect() as client:
        pdu = b"\x03\x00\x00\x00\x01"
        check(pdu, Oracle(), exchange(client, [pdu])[0])
    return seen


def attack_serial(port: str, frames: int, seed: int) -> Counter[str]:
    """Send `frames` down a serial line: requests to this unit, to others, to all, broken ones and noise."""
    rng, oracle, seen = random.Random(seed), Oracle(), Counter[str]()
    line = SerialLine(port, 115200)
    line.open()
    for _ in range(frames // 2):
        whole = with_check_sum(bytes([UNIT]) + request(rng))
        place = rng.randrange(len(whole))
        noise = rng.choice(
            [
                whole[:place] + bytes([whole[place] ^ 1 << rng.randrange(8)]) + whole[place + 1 :],
                with_check_sum(bytes([rng.randrange(2, 248)]) + request(rng))[: rng.choice([place + 1, 300])],
                rng.randbytes(rng.randrange(1, 300)),
            ]
        )
        line.write(noise)
        seen["noise"] += 1
        pdu = b"\x03" + struct.pack(">HH", rng.choice(EDGES), rng.choice(COUNTS))
        _head, size = oracle.answer(pdu)
        line.write(with_check_sum(bytes([UNIT]) + pdu))
        answer = b""
        while len(answer) < size + 3:
            more = line.read(PATIENCE)
            assert more, f"deaf after {noise.hex(' ')}"
            answer += more
        assert answer == with_check_sum(answer[:-2])
        seen[check(pdu, oracle, answer[1:-2])] += 1
    line.close()
    return seen


def http(rng: random.Random) -> bytes:
    """Return a request to the page, or frames on its websocket: right, wrong by a little, or anything at all."""
    kind = rng.randrange(8)
    if kind == 0:
        return rng.randbytes(rng.randrange(300))
    if kind < 5:
        return changed(rng.choice(REQUESTS), rng)
    if kind == 5:
        return rng.choice(REQUESTS)
    return UPGRADE + b"".join(websocket_frame(rng) for _ in range(rng.randrange(1, 5)))


def websocket_frame(rng: random.Random) -> bytes:
    """Return a frame whose opcode, mask or length can be wrong."""
    data = changed(b'{"ask":"start","program":"insert_peg"}', rng)[:120]
    first = rng.choice([0x81, 0x81, 0x82, 0x01, 0x80, 0x88, 0x89, 0x8A, rng.randrange(256)])
    size = rng.choice([len(data), len(data), 126, 127, rng.randrange(128)]) | 0x80 * (rng.random() < 0.9)
    return bytes([first, size]) + bytes(4) + data


class Tracebacks(logging.Handler):
    """Keeps every line of the log that comes with a traceback."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.lines: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        if record.exc_info:
            self.lines.append(self.format(record))


def attack_page(address: tuple[str, int], inputs: int, seed: int) -> Counter[str]:
    """Send `inputs` requests, each on a connection that then ends; afterwards the next one is served."""
    rng, seen, log = random.Random(seed), Counter[str](), Tracebacks()
    logging.getLogger().addHandler(log)

    def send(data: bytes, is_last: bool = True) -> bytes:
        answer = b""
        with socket.create_connection(address, timeout=PATIENCE) as client, suppress(ConnectionError):
            client.sendall(data)
            if is_last:
                client.shutdown(socket.SHUT_WR)
            while more := client.recv(65536):
                answer += more
        return answer

    for _ in range(inputs):
        data = http(rng)
        answer = send(data)
        status = answer[9:12].decode() if answer else "closed"
        assert not status.startswith("5"), f"{data!r}: {answer[:80]!r}"
        seen[status] += 1
    assert b"<main>" in send(PAGE, is_last=False)
    logging.getLogger().removeHandler(log)
    assert not log.lines, log.lines[0]
    return seen


@contextmanager
def bystander(bridge: Bridge) -> Iterator[None]:
    """Hold the lease meanwhile; afterwards it must still be held, with the same registers, and nothing was started."""
    with socket.create_connection(bridge.address, timeout=PATIENCE) as client:
        block = struct.pack(f">BHHB{len(BYSTANDER)}H", 16, 0, len(BYSTANDER), 2 * len(BYSTANDER), *BYSTANDER)
        read = struct.pack(">BHH", 3, 0, 41)
        before, holder = exchange(client, [block, read])[1], bridge.holder
        assert holder.startswith("127.0.0.1:")
        yield
        assert exchange(client, [read])[0] == before, "another's registers were changed"
        assert bridge.holder == holder, "the lease was lost"
        while (command := bridge.poll()) is not None:
            assert command.code in (Control.STOP, Control.ABORT), f"without the lease: {command}"


@contextmanager
def attacked(folder: Path, cable: Cable) -> Iterator[tuple[Bridge, Callable[[], socket.socket]]]:
    """Yield a bridge that listens on TCP, TLS and the cable's first end, and how to connect over TLS."""
    authority = Authority(folder)
    context = authority.client(*authority.sign("client", utf8("Operator")))
    tls = authority.cell(roles={"Operator": ("read", "command")})
    rtu = RtuConfig(port=cable.ends[0], unit=UNIT, baud_rate=115200, parity="none")
    bridge = Bridge(
        PlcConfig(
            life_timeout=3600.0,
            lease_timeout=3600.0,
            modbus=ModbusConfig(port=0, idle_timeout=3600.0),
            tls=tls,
            rtu=rtu,
        ),
        {100: "insert_peg"},
    )
    bridge.start()

    def connect() -> socket.socket:
        assert bridge.secure_address is not None
        plain = socket.create_connection(bridge.secure_address, timeout=PATIENCE)
        return context.wrap_socket(plain, server_hostname="127.0.0.1")

    try:
        yield bridge, connect
    finally:
        bridge.close()


def run(frames: int, seed: int) -> Iterator[tuple[str, Counter[str], float]]:
    """Yield each line's name, what became of its frames, and the time that took, s."""
    with ExitStack() as stack:
        folder, cable = Path(stack.enter_context(tempfile.TemporaryDirectory())), stack.enter_context(Cable())
        bridge, secure = stack.enter_context(attacked(folder, cable))
        page = stack.enter_context(PageServer(("127.0.0.1", 0), bridge, Live(), load(), folder))
        plain = partial(socket.create_connection, bridge.address, PATIENCE)
        attacks: list[tuple[str, Callable[[], Counter[str]]]] = [
            ("TCP", lambda: attack_socket(plain, frames, seed, 0.02)),
            ("TLS", lambda: attack_socket(secure, frames, seed + 1, 0.002)),
            ("TLS handshake", lambda: attack_handshake(bridge.secure_address, secure, frames // 20, seed + 3)),
            ("RTU", lambda: attack_serial(cable.ends[1], frames // 20, seed + 2)),
            ("HTTP", lambda: attack_page(page.address, frames, seed + 4)),
        ]
        for name, attack in attacks:
            with bystander(bridge):
                started = time.monotonic()
                seen = attack()
                yield name, seen, time.monotonic() - started


def main() -> None:
    parser = argparse.ArgumentParser(description="Hostile bytes; ends with status 0 where all went as it should.")
    parser.add_argument("--frames", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    logging.basicConfig(level=logging.ERROR)
    for name, seen, seconds in run(args.frames, args.seed):
        facts = ", ".join(f"{count} {kind}" for kind, count in sorted(seen.items()))
        sys.stdout.write(f"{name}: {seen.total()} frames in {seconds:.0f} s: {facts}\n")


if __name__ == "__main__":
    main()
