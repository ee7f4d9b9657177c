"""Several pages without a screen: each reads the cell's data and discards it.

The lines `open` and `close` on standard input open and close them; the answer to a line follows its completion.
"""

import asyncio
import sys

from tornado.websocket import WebSocketClientConnection, websocket_connect

from cell.commands.terminal import say


async def watch(url: str, pages: int) -> None:
    """Open this number of pages at `url` and read them, or close them, as the input lines request, until the input ends."""
    loop, opened, reading = asyncio.get_running_loop(), list[WebSocketClientConnection](), list[asyncio.Task[None]]()
    while line := await loop.run_in_executor(None, sys.stdin.readline):
        if line.strip() == "open":
            opened = [await websocket_connect(url) for _ in range(pages)]
            reading = [asyncio.create_task(read(page)) for page in opened]
        else:
            for page in opened:
                page.close()
            await asyncio.gather(*reading)
            opened, reading = [], []
        say("done")


async def read(page: WebSocketClientConnection) -> None:
    """Read one page to its end."""
    while await page.read_message() is not None:
        pass


if __name__ == "__main__":
    asyncio.run(watch(sys.argv[1], int(sys.argv[2])))
