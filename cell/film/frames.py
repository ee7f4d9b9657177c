"""Pictures of a recorded run: the cell, the hole cut open, touch, force and stages, side by side."""

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from cell.film.drawing import BEHIND, INK, RULE, Image, blank, write
from cell.film.panels import ForcePanel, TouchPanel, head_line, stage_strip
from cell.film.recorded import RecordedRun
from sim.visual.render import Camera
from sim.visual.scene import Stage

WIDTH, HEIGHT = 1280, 720
HEAD, STRIP, GAP = 44, 60, 10
LEFT = 800
RIGHT = WIDTH - LEFT - 3 * GAP
SECTION, TOUCH = 290, 182
FORCE = HEIGHT - HEAD - SECTION - TOUCH - 4 * GAP
CELL = HEIGHT - HEAD - STRIP - 3 * GAP


@contextmanager
def filmed(run: RecordedRun, is_fine: bool) -> Iterator[Callable[[float], Image]]:
    """Yield a function that draws the run at a time since its first scan, s; fine pictures have shadows and smooth edges.

    A picture has the shape (720, 1280, 3), red first.

    Raises:
        ConfigError: This computer cannot render.
    """
    stage, samples = Stage(run.facts, run.hole(), (WIDTH, HEIGHT), is_fine), run.samples
    touch, force = TouchPanel(run.facts.layout, RIGHT, TOUCH), ForcePanel(run, RIGHT, FORCE)

    def picture(time: float) -> Image:
        scan = run.at(time)
        moment = run.moment(scan)
        stage.pose(moment)
        image = blank(WIDTH, HEIGHT, BEHIND)
        section = camera.section(RIGHT, SECTION)
        write(section, "section through the hole", (12, 20), 13, INK)
        theta = run.theta(scan)
        age = math.nan if math.isnan(theta) else float(samples["stamp"][scan] - samples["theta_stamp"][scan])
        panels = (
            (0, 0, head_line(run, scan, WIDTH, HEAD)),
            (GAP, HEAD + GAP, camera.cell(LEFT, CELL, run.trail(scan))),
            (GAP, HEAD + CELL + 2 * GAP, stage_strip(run, scan, LEFT, STRIP)),
            (LEFT + 2 * GAP, HEAD + GAP, section),
            (LEFT + 2 * GAP, HEAD + SECTION + 2 * GAP, touch.draw(moment.taxels, theta, age)),
            (LEFT + 2 * GAP, HEAD + SECTION + TOUCH + 3 * GAP, force.draw(scan)),
        )
        for left, top, panel in panels:
            image[top : top + panel.shape[0], left : left + panel.shape[1]] = panel
        image[HEAD] = RULE
        return image

    with Camera(stage) as camera:
        yield picture
