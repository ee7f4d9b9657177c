import pytest

from cell.config.load import load
from cell.run.learning import digest
from drivers.errors import ConfigError
from drivers.part.round import Round


def test_chamfers_are_part_of_peg_and_hole_and_none_is_the_default():
    job = load(sets=("peg.chamfer=0.0005", "hole.chamfer=0.001")).cell.job()
    assert (job.peg.part, job.hole.part) == (Round(0.008, 5e-4), Round(0.0081, 1e-3))
    plain = load().cell.job()
    assert (plain.peg.part, plain.hole.part) == (Round(0.008), Round(0.0081))


THIN = ("peg.diameter=0.004", "hole.diameter=0.0041")


@pytest.mark.parametrize(
    ("sets", "wrong", "told"),
    [
        (
            ("peg.shape=square",),
            "peg.chamfer=0.0005",
            "peg.chamfer = 0.0005: not for a part with corners; 0, or a round",
        ),
        (("peg.shape=square",), "hole.chamfer=0.0005", "hole.chamfer = 0.0005: not for a part with corners"),
        (THIN, "peg.chamfer=0.001", "peg.chamfer = 0.001: leaves too little of the end; less than 0.001"),
        (("hole.depth=0.002",), "hole.chamfer=0.002", "no bore is left; less than hole.depth = 0.002 allowed"),
        ((), "hole.chamfer=0.5", "hole.chamfer"),
    ],
)
def test_a_chamfer_leaves_some_of_end_and_bore_of_a_round_part(sets, wrong, told):
    with pytest.raises(ConfigError) as error:
        load(sets=(*sets, wrong))
    assert told in str(error.value)
    assert "\n" not in str(error.value)


def test_the_largest_chamfer_of_a_thin_peg_and_none_of_the_thinnest_are_taken():
    assert load(sets=(*THIN, "peg.chamfer=0.00099")).cell.peg.chamfer == 0.00099
    assert load(sets=("peg.diameter=0.002", "hole.diameter=0.0021")).cell.peg.chamfer == 0.0


def test_what_was_learnt_holds_for_the_same_chamfers():
    plain, chamfered = load().cell.job(), load(sets=("hole.chamfer=0.0005",)).cell.job()
    assert digest(chamfered) != digest(plain)
    assert digest(chamfered) == digest(load(sets=("hole.chamfer=0.0005",)).cell.job())
