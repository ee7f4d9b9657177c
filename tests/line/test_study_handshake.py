"""The timing diagrams of the guide: a conversation is recorded as it goes over the wire, and drawn."""

from cell.lab.handshake import charts
from cell.lab.handshake.recording import Conversation, transitions


def trace():
    made = Conversation("A conversation")
    made.note("begins")
    made.take(command_sequence=1, report_result=0, execute=0, busy=0)
    made.take(command_sequence=2, report_result=0, execute=1, busy=1)
    made.take(command_sequence=2, report_result=1, execute=1, busy=0)
    return made


def test_only_changes_are_kept_in_order():
    found = [(name, value) for _, name, value in transitions(trace())]
    assert found[4:] == [("command_sequence", 2), ("execute", 1), ("busy", 1), ("report_result", 1), ("busy", 0)]


def test_a_diagram_is_drawn(tmp_path):
    path = tmp_path / "trace.png"
    charts.draw(trace(), path)
    assert path.stat().st_size > 5_000
