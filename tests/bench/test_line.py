"""Many clients at once lose no answer of a served cell; run with nothing beside."""

import asyncio
import struct

import pytest

from cell.lab.faults.program import served

CLIENTS, REQUESTS = 50, 200
TIMEOUT = 10.0  # s


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    more = ("--set", f"plc.modbus.connections={2 * CLIENTS}", "--set", f"plc.modbus.connections_per_host={2 * CLIENTS}")
    with served(tmp_path_factory.mktemp("served") / "journal", more) as program:
        yield program.address


async def answered(address):
    """Return the number of right answers to one client."""
    reader, writer = await asyncio.open_connection(*address)
    for number in range(REQUESTS):
        writer.write(struct.pack(">HHHBBHH", number, 0, 6, 1, 3, 0, 10))
        answer = await asyncio.wait_for(reader.readexactly(29), TIMEOUT)
        assert answer[:9] == struct.pack(">HHHBBB", number, 0, 23, 1, 3, 20)
    writer.close()
    return REQUESTS


async def load(address):
    return sum(await asyncio.gather(*(answered(address) for _ in range(CLIENTS))))


def test_fifty_clients_flat_out_lose_no_answer(address):
    assert asyncio.run(load(address)) == CLIENTS * REQUESTS
