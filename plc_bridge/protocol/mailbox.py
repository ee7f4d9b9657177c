"""The mailbox between the scan thread and the servers: the only connection of the threads."""

import threading
from collections.abc import Callable
from functools import wraps
from typing import Any

from plc_bridge.protocol.handshake import Handshake
from plc_bridge.protocol.images import DIAGNOSTICS, PACKML, REPORT
from plc_bridge.protocol.registers import DISCRETE_INPUTS


class Mailbox(Handshake):
    """The handshake behind one lock, and its blocks as words.

    Every public method and property of the handshake holds the lock for a few microseconds and waits for nothing else.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        self._lock = threading.RLock()

    def report_words(self, source: str) -> list[int]:
        """Return the report block for the link `source`."""
        return REPORT.words_of(self.report_for(source))

    def diagnostics_words(self) -> list[int]:
        """Return the diagnostics block."""
        return DIAGNOSTICS.words_of(self.diagnostics)

    def packml_words(self) -> list[int]:
        """Return the block of PackTags."""
        with self._lock:
            return PACKML.words_of(self._orders.tags)

    def discrete_inputs(self, source: str) -> list[bool]:
        """Return the discrete inputs for the link `source`."""
        inputs = self.inputs(source)
        return [getattr(inputs, name) for name in DISCRETE_INPUTS]


def _locked(call: Callable[..., Any]) -> Callable[..., Any]:
    """Return a method that holds the lock."""

    @wraps(call)
    def locked(mailbox: Mailbox, *args: Any, **kwargs: Any) -> Any:
        with mailbox._lock:
            return call(mailbox, *args, **kwargs)

    return locked


for _name, _member in vars(Handshake).items():
    if isinstance(_member, property) and _member.fget is not None:
        setattr(Mailbox, _name, property(_locked(_member.fget)))
    elif callable(_member) and not _name.startswith("_"):
        setattr(Mailbox, _name, _locked(_member))
