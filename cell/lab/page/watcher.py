"""Several pages without a screen: each reads what the cell tells and throws it away, until the process is ended."""

import asyncio
import sys

from tornado.websocket import websocket_connect

from cell.terminal import say


async def watch(url: str, pages: int) -> None:
    """Open so many pages at `url`, say so, and read."""
    opened = [await websocket_connect(url) for _ in range(pages)]
    say("open")

    async def read(number: int) -> None:
        while await opened[number].read_message() is not None:
            pass

    await asyncio.gather(*map(read, range(pages)))


if __name__ == "__main__":
    asyncio.run(watch(sys.argv[1], int(sys.argv[2])))
