"""Actions of an operator after any ending of a run, from the PLC's readings alone."""

from collections.abc import Callable

from cell.lab.faults.bench import LONGEST
from cell.lab.faults.cases import word
from cell.run.states import State
from plc_bridge.messages import Control, PartEvidence, Report, Result
from plc_bridge.peer import Peer
from skills.catalogue import CATALOGUE

MOST_ACTIONS = 2
"""Number of actions after the reset before the operator gives up."""
_INSERT, _RECOVER = CATALOGUE["insert_peg"].code, CATALOGUE["recover"].code


def brought_back(peer: Peer, wait: Callable[[], None] = lambda: None) -> tuple[str, int, str]:
    """Bring a cell back into production; return the reset's result, the number of further actions and the next result.

    Args:
        peer: The PLC, which holds the lease.
        wait: Function that waits some time after the reset.

    Raises:
        CellError: The cell does not answer.
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
    """Reset a cell if it requires it; return the result, or an empty text if no reset was needed."""
    if peer.look().state not in (State.ABORTED, State.STOPPED):
        return ""
    return word(peer.run(Control.RESET, timeout=LONGEST))


def _remedy(report: Report) -> int:
    """Return the command required by the report of a refused start: release of the held peg, or action of a person."""
    return _RECOVER if report.part_evidence & PartEvidence.HAND_HOLDS else Control.CLEARED
