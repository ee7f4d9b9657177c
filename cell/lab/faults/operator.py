"""What an operator does after a run that ended anyhow, who knows no more of the cell than what the PLC reads."""

from collections.abc import Callable

from cell.lab.faults.bench import LONGEST
from cell.lab.faults.cases import word
from cell.states import State
from plc_bridge.images import ReportImage
from plc_bridge.messages import Control, PartEvidence, Result
from plc_bridge.peer import Peer
from skills.catalogue import CATALOGUE

MOST_ACTIONS = 2
"""Number of actions beside the reset after which the operator gives up."""
_INSERT, _RECOVER = CATALOGUE["insert_peg"].code, CATALOGUE["recover"].code


def brought_back(peer: Peer, wait: Callable[[], None] = lambda: None) -> tuple[str, int, str]:
    """Bring a cell back into production; return the result of the reset, the number of further actions, and the next insertion's result.

    Args:
        peer: The PLC, which holds the lease.
        wait: Function that lets some time pass after the reset.

    Raises:
        CellError: The cell falls silent.
    """
    reset, actions = _reset(peer), 0
    wait()
    following = peer.run(_INSERT, timeout=LONGEST)
    while (following.refusal or following.result in (Result.FAULT, Result.ABORTED)) and actions < MOST_ACTIONS:
        actions += 1
        _reset(peer)
        peer.run(_remedy(following), timeout=LONGEST)
        following = peer.run(_INSERT, timeout=LONGEST)
    return reset, actions, word(following)


def _reset(peer: Peer) -> str:
    """Reset a cell that asks for it; return the result, or nothing where none was needed."""
    if peer.look().state not in (State.ABORTED, State.STOPPED):
        return ""
    return word(peer.run(Control.RESET, timeout=LONGEST))


def _remedy(report: ReportImage) -> int:
    """Return the command that the report of a refused start asks for: the hand lets go of what it holds, or a person acts."""
    return _RECOVER if report.part_evidence & PartEvidence.HAND_HOLDS else Control.CLEARED
