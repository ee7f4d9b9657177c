"""The scan thread's side of a bridge or a handshake, where no supervisor is at work."""

from plc_bridge.bridge import Bridge
from plc_bridge.protocol.messages import Command, Report


def take(bridge: Bridge) -> Command | None:
    """Take the next command and accept it."""
    command = bridge.poll()
    if command is not None:
        bridge.accept(command)
    return command


def end(bridge: Bridge, **facts: object) -> Command:
    """Take the next command, a program, and end it with these facts in the report."""
    command = take(bridge)
    assert command is not None
    bridge.publish(Report(sequence=command.sequence, **facts))
    return command
