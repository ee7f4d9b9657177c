"""A simulated run becomes pictures and films without a display."""

import json

import cv2
import numpy as np
import pytest
from PIL import Image

from cell.commands.cli import FAULT, GOOD, WRONG_USE, main
from cell.film.frames import HEIGHT, WIDTH
from cell.film.recorded import recorded
from cell.records.journal import Journal
from drivers.frames import UP, rotation_about
from drivers.quantities import Pose
from sim.visual.render import Camera
from sim.visual.scene import SEEN, Moment, Stage
from tests.fakes import Rig
from tests.filmed_runs import HOLE, ROW, record, require_rendering

SCALE = 290 / SEEN
"""Pixels a metre in a section of 290 pixels in height."""


@pytest.fixture(scope="module")
def grasped(tmp_path_factory):
    """Return the folder of a journal with a grasp of the simulated cell as its only run."""
    folder = tmp_path_factory.mktemp("journal")
    assert main(["run", "grasp_from_rack", "--set", "sim.pace=max", "--journal", str(folder)]) == GOOD
    with Journal(folder) as journal:
        require_rendering(recorded(journal, 1))
    return folder


@pytest.fixture(scope="module")
def short(loaded, tmp_path_factory):
    """Return the folder of a journal with a run of 0.3 s."""
    folder = tmp_path_factory.mktemp("short")
    with Journal(folder / "short") as journal:
        run = record(Rig(loaded, folder / "fakes"), journal, knows_truth=True, scans=30)
        require_rendering(recorded(journal, run))
    return folder / "short"


def gold(image):
    """Return which pixels have the peg's colour."""
    red, green, blue = image.astype(int).transpose(2, 0, 1)
    return (red > 90) & (red - blue > 55) & (green - blue > 35) & (red - green < 80)


def test_the_section_shows_depth_and_tilt_of_the_peg(short):
    with Journal(short, is_read_only=True) as journal:
        facts = recorded(journal, 1).facts
    stage, half = Stage(facts, HOLE), (facts.job.peg.length + facts.job.peg.overhang) / 2
    with Camera(stage) as camera:

        def section(peg):
            """Return the section, 450 x 290, with the peg somewhere."""
            stage.pose(Moment(np.array(facts.arm.home), 0.08, peg, np.zeros((2, 20))))
            return camera.section(450, 290).astype(int)

        without = section(None)
        for depth in (0.0, 0.010, 0.020):
            with_peg = section(Pose(HOLE.position + (half - depth) * UP, np.eye(3)))
            is_peg = gold(with_peg) & (np.abs(with_peg - without).sum(axis=2) > 20)
            rows = np.nonzero(is_peg[:, 215:235])[0]
            lowest = (290 / 2 - 1 - rows.max()) / SCALE + 0.0155
            assert lowest == pytest.approx(-depth, abs=0.0008)
            middle = np.nonzero(is_peg[100])[0]
            assert middle.mean() == pytest.approx(449 / 2, abs=1.0)
            assert len(middle) / SCALE == pytest.approx(facts.job.peg.diameter, abs=0.0008)
        lean = rotation_about(np.array([0.0, 1.0, 0.0]), 0.3)
        leaning = Pose(HOLE.position + np.array([0.0, 0.0, 0.004]) + half * lean[:, 2], lean)
        rows, columns = np.nonzero(gold(section(leaning))[20:150])
    assert np.polyfit(-rows, columns, 1)[0] == pytest.approx(np.tan(0.3), abs=0.03)


def test_a_run_of_the_simulated_cell_becomes_a_picture(grasped, tmp_path, capsys):
    file = tmp_path / "pictures" / "grasp.png"
    assert main(["film", "1", "--journal", str(grasped), "--at", "2.9", "--out", str(file), "--json"]) == GOOD
    printed = json.loads(capsys.readouterr().out)
    picture = cv2.imread(str(file))[..., ::-1]
    assert (printed["pictures"], picture.shape) == (1, (HEIGHT, WIDTH, 3))
    # In the picture of the cell, the arm is white before sky and bench, with the peg in its hand.
    cell = picture[54:640, 10:810]
    assert (cell.min(axis=2) > 200).mean() > 0.05
    assert gold(cell).sum() > 20


def test_a_film_has_every_picture_of_the_run(short, tmp_path):
    assert main(["film", "1", "--journal", str(short), "--out", str(tmp_path / "run.mp4")]) == GOOD
    film = cv2.VideoCapture(str(tmp_path / "run.mp4"))
    sizes = (film.get(cv2.CAP_PROP_FRAME_WIDTH), film.get(cv2.CAP_PROP_FRAME_HEIGHT), film.get(cv2.CAP_PROP_FPS))
    pictures = 0
    while film.read()[0]:
        pictures += 1
    assert (sizes, pictures) == ((WIDTH, HEIGHT, 25.0), 9)


def test_a_film_for_a_page_goes_round_for_ever_in_real_time(short, tmp_path):
    assert main(["film", "1", "--journal", str(short), "--out", str(tmp_path / "run.webp")]) == GOOD
    with Image.open(tmp_path / "run.webp") as film:
        film.seek(1)
        film.load()
        assert (film.n_frames, film.size, film.info["loop"], film.info["duration"]) == (4, (800, 450), 0, 100)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ("film 1 --out run.avi", "run.avi: *.mp4, *.webp, *.png allowed"),
        ("film 1 --out run.png --at 7", "--at 7: run 1 has 0 to 0.29 s"),
        ("film 1 --out run.mp4 --at 0.2", "--at 0.2: a film shows the whole run"),
        ("view", "needs a display"),
    ],
)
def test_wrong_use_is_answered_in_one_line(short, capsys, tmp_path, monkeypatch, wrong, said):
    monkeypatch.chdir(tmp_path)
    for display in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(display, raising=False)
    before = sorted(tmp_path.iterdir())
    assert main([*wrong.split(), "--journal", str(short)]) == WRONG_USE
    error = capsys.readouterr().err
    assert (said in error, error.count("\n")) == (True, 1)
    assert sorted(tmp_path.iterdir()) == before


def test_a_run_of_an_earlier_version_is_refused(tmp_path, capsys):
    with Journal(tmp_path) as journal:
        journal.writer.finish(journal.writer.begin(ROW))
    assert main(["film", "1", "--journal", str(tmp_path), "--out", str(tmp_path / "a.png")]) == FAULT
    assert "recorded by another version" in capsys.readouterr().err
