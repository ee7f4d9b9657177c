"""pymodbus's own Modbus TCP server without changes, the reference for the cell's server.

    python -m tests.bench.speed.bare

serves 100 holding registers on a free port of this computer, prints that port, and ends when its standard input closes.
"""

import asyncio
import sys
from typing import Any

from pymodbus.server import ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice


async def _serve() -> None:
    device = SimDevice(id=0, simdata=SimData(0, count=100, datatype=DataType.REGISTERS))
    server: Any = ModbusTcpServer(device, address=("127.0.0.1", 0))
    await server.serve_forever(background=True)
    sys.stdout.write(f"{server.transport.sockets[0].getsockname()[1]}\n")
    sys.stdout.flush()
    await asyncio.get_running_loop().run_in_executor(None, sys.stdin.read)
    await server.shutdown()


if __name__ == "__main__":
    asyncio.run(_serve())
