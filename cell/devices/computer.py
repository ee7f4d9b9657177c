"""Verdicts on this computer as the host of the arm's 1 kHz loop."""

import resource
from collections.abc import Iterable
from pathlib import Path

from cell.devices.checks import OK
from drivers.arm.loop_figures import PRIORITY

_REALTIME = Path("/sys/kernel/realtime")
UNLIMITED = resource.RLIM_INFINITY


def computer() -> list[tuple[str, str]]:
    """Return name and verdict of each setting of this computer."""
    is_realtime = _REALTIME.is_file() and _REALTIME.read_text(encoding="ascii").strip() == "1"
    memory, priority = (resource.getrlimit(what)[0] for what in (resource.RLIMIT_MEMLOCK, resource.RLIMIT_RTPRIO))
    governors = {
        file.read_text(encoding="ascii").strip()
        for file in Path("/").glob("sys/devices/system/cpu/cpu*/cpufreq/scaling_governor")
    }
    return settings(is_realtime, memory, priority, governors)


def settings(is_realtime: bool, memory: int, priority: int, governors: Iterable[str]) -> list[tuple[str, str]]:
    """Return name and verdict of each setting.

    Args:
        is_realtime: True if the kernel is a real-time kernel.
        memory: Largest locked memory of a process, bytes; `UNLIMITED` without a limit.
        priority: Largest real-time priority of a process.
        governors: Governors of the processor's frequency in use; empty without such control.
    """
    others = sorted(set(governors) - {"performance"})
    is_locked, is_first = memory == UNLIMITED, priority == UNLIMITED or priority >= PRIORITY
    return [
        ("kernel", OK if is_realtime else "no real-time kernel: one with PREEMPT_RT needed"),
        # The loop locks all of its memory, about 500 MB with the interpreter and its libraries.
        ("memlock", OK if is_locked else f"{memory} bytes of memory may be locked: unlimited needed"),
        ("priority", OK if is_first else f"real-time priority of up to {priority}: {PRIORITY} needed"),
        ("governor", OK if not others else f"frequency governor {', '.join(others)}: performance needed"),
    ]
