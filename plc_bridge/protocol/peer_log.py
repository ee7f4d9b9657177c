"""Log lines about peers, bounded in number for each host: a faulty peer cannot fill the disk or hide other peers' lines."""

import logging
import time
from collections import OrderedDict
from collections.abc import Callable

LINES, PERIOD = 10, 60.0
"""Largest number of lines about one host, and the period of the count, s."""
HOSTS = 256
"""Largest number of hosts that are counted separately."""


class PeerLog:
    """Writes lines about peers to a logger.

    Args:
        logger: Logger of the lines.
        now: Function that returns the monotonic time, s.
    """

    def __init__(self, logger: logging.Logger, now: Callable[[], float] = time.monotonic) -> None:
        self._logger, self._now = logger, now
        self._hosts: OrderedDict[str, tuple[float, int]] = OrderedDict()

    def info(self, host: str, message: str, *args: object) -> None:
        """Log information about a host."""
        self._log(logging.INFO, host, message, args)

    def warning(self, host: str, message: str, *args: object) -> None:
        """Log a problem of a host."""
        self._log(logging.WARNING, host, message, args)

    def _log(self, level: int, host: str, message: str, args: tuple[object, ...]) -> None:
        now = self._now()
        since, lines = self._hosts.pop(host, (now, 0))
        if now - since > PERIOD:
            if lines > LINES:
                self._logger.warning("%s: %d more lines about it were left out", host, lines - LINES)
            since, lines = now, 0
        self._hosts[host] = since, lines + 1
        if len(self._hosts) > HOSTS:
            self._hosts.popitem(last=False)
        if lines < LINES:
            self._logger.log(level, message, *args)
            if lines == LINES - 1:
                self._logger.warning("%s: no more lines about it for %g s", host, PERIOD)
