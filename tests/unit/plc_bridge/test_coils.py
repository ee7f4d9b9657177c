import pytest

from plc_bridge.coils import Coils, Edge


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
        take = getattr(coils, f"take_{name}")
        assert [take({} if value is None else {name: value}) for value in written] == edges


def test_a_coil_that_is_1_after_a_loss_has_no_edge():
    coils = Coils()
    coils.take_execute({"execute": False})
    coils.forget()
    assert coils.take_execute({"execute": True}) is Edge.UNSEEN
