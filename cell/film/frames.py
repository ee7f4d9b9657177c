"""Pictures of a recorded run: the cell, the hole cut open, touch, force and stages, side by side."""

import math
from collections.abc import Iterator
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


class Filmed:
    """Draws the picture of one run at any time."""

    def __init__(self, run: RecordedRun, camera: Camera, stage: Stage) -> None:
        """Prepare the parts of the picture that do not change."""
        self._run, self._camera, self._stage = run, camera, stage
        self._touch = TouchPanel(run.facts.layout, RIGHT, TOUCH)
        self._force = ForcePanel(run, RIGHT, FORCE)

    def frame(self, time: float) -> Image:
        """Return the picture of the run at `time` since its first scan, s, shape (720, 1280, 3), red first."""
        run, samples = self._run, self._run.samples
        scan = run.at(time)
        moment = run.moment(scan)
        self._stage.pose(moment)
        image = blank(WIDTH, HEIGHT, BEHIND)
        section = self._camera.section(RIGHT, SECTION)
        write(section, "section through the hole", (12, 20), 13, INK)
        theta = run.theta(scan)
        age = math.nan if math.isnan(theta) else float(samples["stamp"][scan] - samples["theta_stamp"][scan])
        touch = self._touch.draw(moment.taxels, theta, age)
        panels = (
            (0, 0, head_line(run, scan, WIDTH, HEAD)),
            (GAP, HEAD + GAP, self._camera.cell(LEFT, CELL, run.trail(scan))),
            (GAP, HEAD + CELL + 2 * GAP, stage_strip(run, scan, LEFT, STRIP)),
            (LEFT + 2 * GAP, HEAD + GAP, section),
            (LEFT + 2 * GAP, HEAD + SECTION + 2 * GAP, touch),
            (LEFT + 2 * GAP, HEAD + SECTION + TOUCH + 3 * GAP, self._force.draw(scan)),
        )
        for left, top, panel in panels:
            image[top : top + panel.shape[0], left : left + panel.shape[1]] = panel
        image[HEAD] = RULE
        return image


@contextmanager
def filmed(run: RecordedRun, is_fine: bool) -> Iterator[Filmed]:
    """Yield the drawer of the run's pictures; fine ones have shadows and smooth edges.

    Raises:
        ConfigError: This computer cannot render.
    """
    stage = Stage(run.facts, run.hole(), (WIDTH, HEIGHT), is_fine)
    with Camera(stage) as camera:
        yield Filmed(run, camera, stage)
