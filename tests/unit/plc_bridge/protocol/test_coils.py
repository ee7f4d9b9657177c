import pytest

from plc_bridge.protocol.coils import Coils, Edge


@pytest.mark.parametrize(
    ("written", "edges"),
    [
        ([False, True, True, False], [Edge.LOW, Edge.ROSE, Edge.NONE, Edge.LOW]),
        ([True, True, False, True], [Edge.UNSEEN, Edge.NONE, Edge.LOW, Edge.ROSE]),
        ([False, None, True], [Edge.LOW, Edge.NONE, Edge.ROSE]),
    ],
)
def test_what_the_writes_of_a_coil_mean(written, edges):
    for name in ("execute", "reset"):
        coils = Coils()
        assert [coils.take(name, {} if value is None else {name: value}) for value in written] == edges
