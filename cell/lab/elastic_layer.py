"""Pads as an elastic layer on a rigid backing: a more detailed, independent model of the taxels' pressure.

The model shares nothing with the simulation's bed of springs or with the estimators' templates. The layer is solved
exactly for each wavenumber (Airy's stress function in plane strain, frictionless above, bonded below). Conjugate gradients
on the nonnegative pressures of the cells determine the contact area ([polonsky]). A taxel measures the stress on the backing.
"""

import math
from functools import lru_cache

import numpy as np

from drivers.part.contract import Face
from drivers.quantities import FINGERS, Vector
from drivers.skin.layout import Layout, finger_positions, pad_size

THICKNESS = 1e-3
"""Thickness of the elastomer, m; [gibbons], Sec. VI."""
MODULUS, POISSON = 1.5e5, 0.45
"""Young's modulus, Pa, and Poisson's ratio of a soft silicone; assumed, so that 30 N press an 8 mm peg in by about half
the layer's thickness."""
STIFF = 12.0
"""Wavenumber times thickness above which the layer acts as a half-space and no pressure reaches the backing."""


def layer(wave: Vector, poisson: float = POISSON) -> tuple[Vector, Vector]:
    """Return the response of a layer to a pressure of one wavenumber.

    With the stress function F(z)·cos(k x), F = (A + B z) cosh kz + (C + D z) sinh kz: sigma_zz = -k² F and sigma_xz = k
    F'; the displacements follow from Hooke's law, 2 G k u = (1 - nu) F'' + nu k² F and 2 G k² w = (1 - nu) F''' - (2 -
    nu) k² F'. Boundary conditions: sigma_xz = 0 on top, u = w = 0 below.

    Args:
        wave: Wavenumber times thickness, shape (n,), > 0 and at most `STIFF`.
        poisson: Poisson's ratio.

    Returns:
        Sinking of the surface times G / (pressure · thickness), and share of the pressure that reaches the backing,
        each shape (n,).
    """
    k = np.asarray(wave, dtype=np.float64)

    def derivatives(z: float) -> list[Vector]:
        """Return F, F', F'' and F''' at z for each of the four constants, each shape (n, 4)."""
        c, s = np.cosh(k * z), np.sinh(k * z)
        return [
            np.stack(column, axis=-1)
            for column in (
                (c, z * c, s, z * s),
                (k * s, c + z * k * s, k * c, s + z * k * c),
                (k**2 * c, 2 * k * s + z * k**2 * c, k**2 * s, 2 * k * c + z * k**2 * s),
                (k**3 * s, 3 * k**2 * c + z * k**3 * s, k**3 * c, 3 * k**2 * s + z * k**3 * c),
            )
        ]

    square = (k**2)[:, None]
    top, below = derivatives(0.0), derivatives(1.0)
    lateral = (1.0 - poisson) * below[2] + poisson * square * below[0]
    vertical = [(1.0 - poisson) * each[3] - (2.0 - poisson) * square * each[1] for each in (top, below)]
    system = np.stack([-square * top[0], top[1], lateral, vertical[1]], axis=1)
    # With z pointing down, sigma_zz = -1 on top is a unit pressure.
    constants = np.linalg.solve(system, np.broadcast_to([-1.0, 0.0, 0.0, 0.0], (k.size, 4))[..., None])[..., 0]
    sinking = (vertical[0] * constants).sum(axis=1) / (2.0 * k**2)
    return sinking, (square * below[0] * constants).sum(axis=1)


class LayerPads:
    """Two pads of elastic layer, divided into square cells."""

    def __init__(self, layout: Layout, poisson: float = POISSON, cell: float = 0.5e-3) -> None:
        """Divide pads of the size of `layout` into square cells of side `cell`, m, and solve the layer."""
        length, width = pad_size(layout)
        rows, columns = round(width / cell), round(length / cell)
        self._area = cell * cell
        self._shape = (2 * rows, 2 * columns)
        self._x = (np.arange(columns) + 0.5) * cell - columns * cell / 2
        self._y = (np.arange(rows) + 0.5) * cell - rows * cell / 2
        kx = 2 * math.pi * np.fft.rfftfreq(self._shape[1], cell)
        ky = 2 * math.pi * np.fft.fftfreq(self._shape[0], cell)
        wave = np.maximum(np.hypot(kx, ky[:, None]) * THICKNESS, 1e-2)
        nodes = np.geomspace(1e-2, STIFF, 400)
        sinking, reaching = layer(nodes, poisson)
        shear = MODULUS / (2.0 * (1.0 + poisson))
        answer = np.interp(wave, nodes, sinking)
        answer = np.where(wave > STIFF, (1.0 - poisson) / wave, answer)
        self._answer = answer * THICKNESS / shear
        self._reach = np.where(wave > STIFF, 0.0, np.interp(wave, nodes, reaching))
        number = np.arange(400) + 0.5
        # Diameter of a taxel's averaging area, m; assumed, about half the pitch.
        radius, turn = 4e-3 / 2 * np.sqrt(number / number.size), np.pi * (1 + 5**0.5) * number
        disc = np.column_stack([radius * np.cos(turn), radius * np.sin(turn)])
        points = finger_positions(layout)[:, :, None, :] + disc
        self._column = np.rint((points[..., 0] - self._x[0]) / cell).astype(int)
        self._row = np.rint((points[..., 1] - self._y[0]) / cell).astype(int)

    def readings(
        self,
        theta: float,
        offset: float,
        depths: tuple[tuple[float, float], tuple[float, float]],
        reach: tuple[float, float],
        face: Face,
    ) -> tuple[Vector, Vector]:
        """Return the stress on each taxel, shape (2, n), left finger first, Pa, and each pad's load, shape (2,), N.

        Args:
            theta: In-hand angle, rad.
            offset: Distance of the peg's axis from the finger centre, m.
            depths: Depth of the peg's lowest line below the surface at rest, for each finger its value at the finger
                centre, m, and its rise towards the tip, m/m.
            reach: Lengths of the peg from the finger centre towards the tip and back, m.
            face: Surface of the peg at the pads.
        """
        c, s = math.cos(theta), math.sin(theta)
        along = c * self._x + s * self._y[:, None]
        beside = c * self._y[:, None] - s * self._x - offset
        profile = face.profile(beside)
        under = (along <= reach[0]) & (along >= -reach[1]) & np.isfinite(profile)
        taxels, loads = np.zeros(self._row.shape[:2]), np.zeros(FINGERS)
        for finger, (depth, rise) in enumerate(depths):
            pressure = self.pressed(np.where(under, depth + rise * along - profile, -1.0))
            taxels[finger] = self._at_taxels(pressure, finger)
            loads[finger] = pressure.sum() * self._area
        return taxels, loads

    def pressed(self, sunk: Vector) -> Vector:
        """Return the nonnegative pressure on each cell, Pa, that sinks the surface by `sunk`, m, in the contact area."""
        may = sunk > 0.0
        pressure = np.where(may, 1.0, 0.0)
        if not may.any():
            return pressure
        pressure *= float(sunk[may].mean() / self._sinking(pressure)[may].mean())
        direction, size, restart = np.zeros_like(sunk), 1.0, 0.0
        for _ in range(200):
            missing = self._sinking(pressure) - sunk
            touching = pressure > 0.0
            square = float((missing[touching] ** 2).sum())
            # Relative tolerance of the depth in the contact solution.
            if math.sqrt(square / max(int(touching.sum()), 1)) < 1e-3 * sunk.max():
                break
            direction = np.where(touching, missing + restart * square / size * direction, 0.0)
            size, answer = square, self._sinking(direction)
            step = float((missing * direction)[touching].sum() / (answer * direction)[touching].sum())
            pressure = np.maximum(pressure - step * direction, 0.0)
            wrong = (pressure == 0.0) & (missing < 0.0) & (sunk > -1.0)
            restart = 0.0 if wrong.any() else 1.0
            pressure[wrong] -= step * missing[wrong]
        return pressure

    def _sinking(self, pressure: Vector) -> Vector:
        rows, columns = pressure.shape
        moved: Vector = np.fft.irfft2(np.fft.rfft2(pressure, self._shape) * self._answer, self._shape)[:rows, :columns]
        return moved

    def _at_taxels(self, pressure: Vector, finger: int) -> Vector:
        felt = np.fft.irfft2(np.fft.rfft2(pressure, self._shape) * self._reach, self._shape)
        rows, columns = self._shape
        averaged: Vector = felt[self._row[finger] % rows, self._column[finger] % columns].mean(axis=1)
        return averaged


@lru_cache
def layer_pads(layout: Layout) -> LayerPads:
    """Return the pads of a layout, created once."""
    return LayerPads(layout)
