"""Meshes of the scene, held against the volumes that they stand for."""

import math
from collections import Counter

import numpy as np
import pytest

from drivers.part.rectangular import Rectangular
from drivers.part.round import Round
from sim.visual.shapes import Mesh, chamfered, perforated

OUTLINE, DEPTH, THICKNESS = (-0.05, 0.04, -0.03, 0.06), 0.02, 0.03
BLOCK = 0.09 * 0.09 * THICKNESS


def volume(mesh: Mesh) -> float:
    """Return the enclosed volume by the divergence theorem; negative where the faces look inward."""
    a, b, c = (mesh.vertices[mesh.faces[:, corner]] for corner in range(3))
    return float((a * np.cross(b, c)).sum() / 6.0)


def open_edges(mesh: Mesh) -> int:
    """Return how many edges have no face on their other side; corners at one place are one."""
    place = {}
    number = [place.setdefault(tuple(vertex.round(9)), len(place)) for vertex in mesh.vertices]
    edges = Counter()
    for face in mesh.faces:
        corners = [number[vertex] for vertex in face]
        for k in range(3):
            edge = corners[k], corners[(k + 1) % 3]
            edges[edge] += 1
            edges[edge[::-1]] -= 1
    return sum(count != 0 for count in edges.values())


@pytest.mark.parametrize(
    ("mouth", "area"),
    [(Round(0.008).outline(), 48 * 0.004**2 * math.sin(2 * math.pi / 96)), (Rectangular(0.010, 0.006).outline(), 6e-5)],
    ids=["round", "rectangular"],
)
def test_a_plate_is_the_block_without_its_hole(mouth, area):
    plate = perforated(OUTLINE, mouth, DEPTH, THICKNESS, cut=False)
    # Between two rays the round hole's edge is a chord of a chord.
    assert volume(plate) == pytest.approx(BLOCK - area * DEPTH, rel=1e-4)
    assert open_edges(plate) == 0


@pytest.mark.parametrize("cut", [False, True])
def test_a_chamfer_takes_the_ring_round_the_mouth(cut):
    mouth, share = Round(0.008).outline(), 0.5 if cut else 1.0
    outline = (-0.05, 0.04, -0.06, 0.06) if cut else OUTLINE
    sharp, blunt = (perforated(outline, mouth, DEPTH, THICKNESS, cut, chamfer) for chamfer in (0.0, 1e-3))
    taken = math.pi * ((0.005**3 - 0.004**3) / 3 - 0.004**2 * 1e-3)
    assert volume(sharp) - volume(blunt) == pytest.approx(share * taken, rel=2e-3)
    assert open_edges(blunt) == 0


@pytest.mark.parametrize("end", [2e-4, 5e-4])
def test_the_lower_end_of_a_peg_is_drawn_with_its_own_chamfer(end):
    points = chamfered(Round(0.008).outline(), -0.03, 0.03, (end, 4e-4))
    radius = np.linalg.norm(points[:, :2], axis=1)
    assert radius[np.isclose(points[:, 2], -0.03)] == pytest.approx(0.004 - end)
    assert radius[np.isclose(points[:, 2], 0.03)] == pytest.approx(0.004 - 4e-4)
    assert points[radius > 0.004 - 1e-9, 2].min() == pytest.approx(-0.03 + end)


@pytest.mark.parametrize(
    "mouth", [Round(0.008).outline(), Rectangular(0.010, 0.006).outline()], ids=["round", "rectangular"]
)
def test_a_cut_plate_is_the_part_behind_the_cut(mouth):
    plate = perforated(OUTLINE, mouth, DEPTH, THICKNESS, cut=True)
    whole = perforated((-0.05, 0.04, -0.06, 0.06), mouth, DEPTH, THICKNESS, cut=False)
    assert volume(plate) == pytest.approx(volume(whole) / 2, rel=1e-4)
    assert plate.vertices[:, 1].min() == pytest.approx(0.0, abs=1e-9)
    assert open_edges(plate) == 0
