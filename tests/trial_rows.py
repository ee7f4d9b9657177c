"""A row of a trial, for tests of what is made of rows."""

from cell.lab.trials import TrialRow

SEATED = TrialRow(
    seed=1,
    outcome="success",
    reason="",
    stage="release_and_retract",
    grasp_time=4.0,
    search_time=4.0,
    insert_time=2.0,
    adjust_time=2.0,
    total_time=8.0,
    retries=0,
    peak_contact_force=15.0,
    max_penetration=0.0,
    max_in_hand_rotation=0.1,
    theta_rmse=0.01,
    tip_rmse=1e-3,
    hole_x=0.5,
    hole_y=0.0,
    start_x=0.5,
    start_y=0.0,
    switch_closed=True,
    depth=0.02,
    sim_time=15.0,
    wall_time=1.0,
    time_over_20N=0.0,
    jerk_free=40.0,
    jerk_contact=300.0,
)
"""A peg that was seated in 8 s, with a largest force of 15 N."""
