"""The ways from a PLC to the cell, one for each bus; what is written against `PlcLine` runs over all of them."""

import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from uuid import uuid4

from pymodbus import FramerType
from pymodbus.client import ModbusSerialClient, ModbusTlsClient

from plc_bridge.bridge import Bridge
from plc_bridge.config import CanConfig, ModbusConfig, PlcConfig, RtuConfig
from plc_bridge.peer import Peer
from tests.can_peer import CanPeer
from tests.certificates import Authority, utf8
from tests.hubs import Cable

ROLE = "Operator"
TIMEOUT = 60.0  # s, also of a busy computer


@dataclass(frozen=True, slots=True)
class PlcLine:
    """One way to the cell."""

    plc: PlcConfig
    """What the cell must listen on; patient, so that a busy computer loses no run."""
    connect: Callable[[Bridge], Peer]
    """Return a peer that is not connected yet."""
    source: str
    """How the run's record begins to name who asked."""


def patient(**buses: object) -> PlcConfig:
    """Return the config of a cell that loses no run on a busy computer."""
    return PlcConfig(life_timeout=60.0, lease_timeout=60.0, **{"modbus": ModbusConfig(port=0), **buses})


def at_once(seconds: float) -> None:
    """Do not wait: a PLC that reads at full speed in the same process must not slow down the cell."""


@contextmanager
def modbus_tcp() -> Iterator[PlcLine]:
    yield PlcLine(patient(), lambda bridge: Peer(*bridge.address, timeout=TIMEOUT, wait=at_once), "127.0.0.1:")


@contextmanager
def modbus_tls() -> Iterator[PlcLine]:
    with tempfile.TemporaryDirectory() as folder:
        authority = Authority(Path(folder))
        context = authority.client(*authority.sign("plc", utf8(ROLE)))
        context.check_hostname = False  # pymodbus cannot say whom it expects
        tls = authority.cell(roles={ROLE: ("read", "command")})

        def connect(bridge: Bridge) -> Peer:
            assert bridge.secure_address is not None
            host, port = bridge.secure_address
            peer = Peer(host, port, wait=at_once)
            peer._client = ModbusTlsClient(host, port=port, sslctx=context, timeout=TIMEOUT, retries=0)
            return peer

        yield PlcLine(patient(tls=tls), connect, f"{ROLE}@127.0.0.1:")


@contextmanager
def modbus_rtu() -> Iterator[PlcLine]:
    """Modbus RTU over a pair of pseudo terminals, which may refuse parity."""
    with Cable() as cable:

        def connect(bridge: Bridge) -> Peer:
            peer = Peer(cable.ends[1], 0, wait=at_once)
            peer._client = ModbusSerialClient(
                cable.ends[1], framer=FramerType.RTU, baudrate=115200, timeout=TIMEOUT, retries=0
            )
            return peer

        rtu = RtuConfig(port=cable.ends[0], baud_rate=115200, parity="none")
        yield PlcLine(patient(rtu=rtu), connect, "rtu:")


@contextmanager
def canopen() -> Iterator[PlcLine]:
    """CANopen, on a bus of its own within this process."""
    can = CanConfig(interface="virtual", channel=str(uuid4()), plc_timeout=0.0)
    yield PlcLine(patient(can=can), lambda bridge: CanPeer(can, timeout=TIMEOUT, wait=at_once), "node 1")


PLC_LINES = {"modbus_tcp": modbus_tcp, "modbus_tls": modbus_tls, "modbus_rtu": modbus_rtu, "canopen": canopen}
