import pytest

from cell.config.load import load
from cell.run.learning import digest
from drivers.errors import ConfigError
from drivers.part.round import Round

SQUARE = ("peg.shape=square",)


def refused(*sets: str) -> str:
    with pytest.raises(ConfigError) as error:
        load(sets=sets)
    assert "\n" not in str(error.value)
    return str(error.value)


def test_chamfers_are_part_of_peg_and_hole_and_none_is_the_default():
    job = load(sets=("peg.chamfer=0.0005", "hole.chamfer=0.001")).cell.job()
    assert (job.peg.part, job.hole.part) == (Round(0.008, 5e-4), Round(0.0081, 1e-3))
    plain = load().cell.job()
    assert (plain.peg.part, plain.hole.part) == (Round(0.008), Round(0.0081))


def test_a_part_with_corners_has_no_chamfer():
    assert "peg.chamfer = 0.0005: not for a part with corners; 0, or a round part, allowed" in refused(
        *SQUARE, "peg.chamfer=0.0005"
    )
    assert "hole.chamfer = 0.0005: not for a part with corners" in refused(*SQUARE, "hole.chamfer=0.0005")


def test_a_chamfer_leaves_a_millimetre_of_the_radius_of_the_end():
    thin = ("peg.diameter=0.004", "hole.diameter=0.0041")
    assert "peg.chamfer = 0.001: leaves too little of the end; less than 0.001" in refused(*thin, "peg.chamfer=0.001")
    assert load(sets=(*thin, "peg.chamfer=0.00099")).cell.peg.chamfer == 0.00099


def test_a_peg_of_two_millimetres_needs_no_chamfer():
    assert load(sets=("peg.diameter=0.002", "hole.diameter=0.0021")).cell.peg.chamfer == 0.0


def test_a_chamfer_leaves_some_of_the_bore():
    assert "hole.chamfer = 0.002: no bore is left; less than hole.depth = 0.002 allowed" in refused(
        "hole.depth=0.002", "hole.chamfer=0.002"
    )


def test_a_chamfer_typed_in_millimetres_is_refused():
    assert "hole.chamfer" in refused("hole.chamfer=0.5")


def test_what_was_learnt_holds_for_the_same_chamfers():
    plain, chamfered = load().cell.job(), load(sets=("hole.chamfer=0.0005",)).cell.job()
    assert digest(chamfered) != digest(plain)
    assert digest(chamfered) == digest(load(sets=("hole.chamfer=0.0005",)).cell.job())
