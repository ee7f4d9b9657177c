from cell.part_watch import PartWatch
from plc_bridge.messages import Report

HOLE = (0.5, 0.01)


def test_a_run_under_way_does_not_tell_the_hole_of_the_last_one(rig, tmp_path):
    watch = PartWatch(rig.cell, rig.cell.context(0), tmp_path)
    assert watch.filled(Report(hole=HOLE)).hole == HOLE
    watch.begin(rig.loaded.cell)
    assert watch.filled(Report(hole=HOLE)).hole == (0.0, 0.0)
