"""Requests of a page: from their text to the command block of the line; pure."""

from dataclasses import dataclass

from pydantic_core import from_json

from cell.run.line import CONTROLS
from plc_bridge.protocol.images import SERIAL, CommandImage, is_serial
from plc_bridge.protocol.messages import Control
from plc_bridge.protocol.registers import Lease
from skills.catalogue import CATALOGUE

MOST = 2048
"""Longest text of a page, bytes."""
_RECIPES = 0xFFFF


class BadAskError(Exception):
    """The request of a page is invalid; the message is one line for its sender."""


@dataclass(frozen=True, slots=True)
class Ask:
    """One request of a page: a token, the lease, a command, or a cable fault."""

    token: str | None = None
    lease: int = Lease.NONE
    command: CommandImage | None = None
    cable: str | None = None
    """Name of the simulated device at the cable."""
    is_out: bool = False
    """True to unplug the cable, False to plug it in."""


def parse(text: str | bytes) -> Ask:
    """Return the request in a text.

    Raises:
        BadAskError: The text is not a valid request.
    """
    try:
        data = from_json(text, allow_inf_nan=False)  # this parser limits the depth and refuses incomplete characters
    except ValueError:
        raise BadAskError("not JSON") from None
    if not isinstance(data, dict):
        raise BadAskError("an object with `ask` allowed")
    ask = data.pop("ask", None)
    if ask == "unlock":
        return Ask(token=_text(data, "token"))
    if ask in ("take", "release"):
        return Ask(lease=Lease.TAKE if ask == "take" else Lease.RELEASE)
    if ask in ("unplug", "plug"):
        return Ask(cable=_text(data, "cable"), is_out=ask == "unplug")
    if ask == "start":
        return Ask(command=_start(data))
    if isinstance(ask, str) and ask in CONTROLS:
        return Ask(command=CommandImage(code=int(Control(CONTROLS[ask]))))
    raise BadAskError(f"ask {ask!r:.40}: unlock, take, release, start, unplug, plug, {', '.join(CONTROLS)} allowed")


def _start(data: dict[str, object]) -> CommandImage:
    name, recipe, serial = _text(data, "program"), data.get("recipe", 0), _text(data, "serial")
    if name not in CATALOGUE:
        raise BadAskError(f"program {name!r:.40}: {', '.join(CATALOGUE)} allowed")
    if not isinstance(recipe, int) or isinstance(recipe, bool) or not 0 <= recipe <= _RECIPES:
        raise BadAskError(f"recipe {recipe!r:.40}: a whole number from 0 to {_RECIPES} allowed")
    if not is_serial(serial):
        raise BadAskError(f"serial number: at most {SERIAL} printable ASCII characters allowed")
    return CommandImage(code=CATALOGUE[name].code, recipe=recipe, serial=serial)


def _text(data: dict[str, object], key: str) -> str:
    value = data.get(key, "")
    if not isinstance(value, str):
        raise BadAskError(f"{key}: a text allowed")
    return value
