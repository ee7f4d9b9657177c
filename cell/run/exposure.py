"""Ports of a cell that are open to other computers, and validity of its keys, for `serve`, `check` and the metrics."""

import ipaddress
from collections.abc import Mapping

from cell.devices.checks import OK
from cell.records import wall_clock
from plc_bridge.config import PlcConfig, TlsConfig

Address = tuple[str, int]
SOON = 30.0
"""Remaining validity of a key below which it must be renewed, days."""


def is_local(host: str) -> bool:
    """Return True if only this computer can connect to `host`."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def exposures(
    plc: PlcConfig, page: Address | None = None, metrics: Address | None = None, opcua: Address | None = None
) -> list[str]:
    """Return one line for each port that other computers can reach, with what any of them can do there."""
    modbus = None if plc.modbus.allow else (plc.modbus.host, plc.modbus.port)
    token = "everybody who has the token may move the cell"
    if plc.tls is None:
        token = "the cell refuses the token, because [plc.tls] is missing"
    served = (
        ("plc.modbus", modbus, "read, command and stop; plc.modbus.allow names those that may"),
        ("--opcua", opcua if plc.opcua_anonymous else None, "read"),
        ("--page", page, f"watch; {token}"),
        ("--metrics", metrics, "read the figures"),
    )
    return [
        f"{name} {at[0]}:{at[1]}: open to every computer that reaches it, to {what}"
        for name, at, what in served
        if at is not None and not is_local(at[0])
    ]


def key_days(tls: TlsConfig | None) -> Mapping[str, float]:
    """Return the remaining validity of each key file, days; negative if the key has expired.

    Raises:
        DeviceNotOpenedError: A file cannot be read.
    """
    if tls is None:
        return {}
    from plc_bridge.modbus.tls import valid_until

    now = wall_clock.now()
    return {f"plc.tls.{name}": (end - now).total_seconds() / 86400.0 for name, end in valid_until(tls).items()}


def key_verdict(days: float) -> str:
    """Return "ok" and the days left, or the fault of an expired or expiring key."""
    if days < 0.0:
        return f"expired {-days:.0f} days ago: renew it, then start the cell again"
    return (
        f"{OK}, {days:.0f} days left"
        if days > SOON
        else f"expires in {days:.0f} days; more than {SOON:g} needed: renew it"
    )
