"""Compiled comparison of a frame with templates, evaluated by `skills.tactile.likelihood` for every frame.

The module is separate so that the config and the register map, which only name the estimators, do not import the
compiler.
"""

import math

import numpy as np

from drivers.compiled import njit
from skills.tactile.templates import COARSE_OFFSET, COARSE_THETA

COARSE_PRINT = 2
"""Step between the prints of the coarse search if no print is expected."""
NEAR = 2
"""Number of coarse offsets to try on either side of the finger centre, unless all offsets are to be tried."""
FINE = 10
"""Number of templates to try on either side of a likely angle in the fine search."""
MODES = 2
"""Number of likely angles to refine; if the peg lies between two rows of taxels, two angles can give similar frames."""
MANY_MODES = 4
"""Number of likely angles to refine if no print is expected: two angles can give similar frames with different prints."""
RIVAL = 30.0
"""Largest difference of log likelihood on the coarse grid for which a second angle is refined."""
AMOUNTS = 6
"""Number of fitted quantities: four loads, angle and offset."""
HOPELESS = 20.0
"""Largest difference of log posterior from that of the best angle for which an angle is refined."""
STIFFENING = 0.4
"""Curvature of the load along a peg that is pushed across the pads: ratio c·a/b² for the load a + b·s + c·s² at s along the peg.

A pad with the pressure k·d/(1 - d/t) at depth d = d0 + p·s has a = k·d0/(1 - d0/t), b = k·p/(1 - d0/t)² and
c = b²/a·(d0/t). A grip of 30 N presses the pad to about 0.45 of the thickness t. A pressure proportional to the
depth's n-th power gives (n - 1)/(2n): 0.25 for n = 2. The simulated pad follows the first law; for a real pad it is
assumed. Source: docs/tried/angle.md.
"""
LEAST_TURN = 0.15
"""Least rise over 20 mm for which the curvature is computed, fraction of the load; below it the curvature is under 1 %."""
FAINT = 0.01
"""Reading below which a taxel is left out of the curvature, fraction of the reading directly under the peg."""
OTHER_LOAD = 0.1
"""Probability that the load is not the expected one, fraction: the hand is still closing, or the grip has changed."""
NEVER = -1e30
"""Log likelihood of an impossible template."""


@njit(cache=True, forceinline=True)
def _sums(weights, weighed, even, rising, first):  # type: ignore[no-untyped-def]
    """Return the weighted sums of even², even·rising, rising², values·even and values·rising of one finger."""
    ee = er = rr = ye = yr = np.float32(0.0)
    for k in range(first, first + weights.size // 2):
        we = weights[k] * even[k]
        ee += we * even[k]
        er += we * rising[k]
        rr += weights[k] * rising[k] * rising[k]
        ye += weighed[k] * even[k]
        yr += weighed[k] * rising[k]
    return ee, er, rr, ye, yr


@njit(cache=True, forceinline=True)
def _solve(left, right, tightness, solution):  # type: ignore[no-untyped-def]
    """Return the log likelihood with the loads integrated out, from both fingers' `_sums`; write the loads to `solution`.

    The loads are the mean load, half the difference (left minus right), the common rise and the opposite rise.
    """
    lee, ler, lrr, lye, lyr = left
    ree, rer, rrr, rye, ryr = right
    ee, er, rr, dee, der, drr = lee + ree, ler + rer, lrr + rrr, lee - ree, ler - rer, lrr - rrr
    y0, y1, y2, y3 = lye + rye, lye - rye, lyr + ryr, lyr - ryr
    if ee <= 0.0 or y0 <= 0.0:
        return NEVER
    # Prior precisions: spreads are fractions of the mean load y0 / ee, so p_i = tightness_i (ee / y0)².
    share = ee / y0
    p1, p2, p3 = tightness[0] * share * share, tightness[1] * share * share, tightness[2] * share * share
    # A = L D L^T = [[ee, dee, er, der], [., ee+p1, der, er], [., ., rr+p2, drr], [., ., ., rr+p3]], r = 1 / diag(D)
    r0 = 1.0 / ee
    l10, l20, l30 = dee * r0, er * r0, der * r0
    u21, u31 = der - l20 * dee, er - l30 * dee
    r1 = 1.0 / (ee + p1 - l10 * dee)
    l21, l31 = u21 * r1, u31 * r1
    u32 = drr - l30 * er - l31 * u21
    r2 = 1.0 / (rr + p2 - l20 * er - l21 * u21)
    l32 = u32 * r2
    r3 = 1.0 / (rr + p3 - l30 * der - l31 * u31 - l32 * u32)
    # L z = y, then L^T solution = D^-1 z
    z1 = y1 - l10 * y0
    z2 = y2 - l20 * y0 - l21 * z1
    z3 = y3 - l30 * y0 - l31 * z1 - l32 * z2
    solution[3] = z3 * r3
    solution[2] = z2 * r2 - l32 * solution[3]
    solution[1] = z1 * r1 - l21 * solution[2] - l31 * solution[3]
    solution[0] = y0 * r0 - l10 * solution[1] - l20 * solution[2] - l30 * solution[3]
    # ln L = 1/2 (z^T D^-1 z + ln(p1 p2 p3 / (D1 D2 D3))); the mean load has a flat prior, so there is no p0 / D0
    shrunk = p1 * r1 * p2 * r2 * p3 * r3
    return 0.5 * (y0 * y0 * r0 + z1 * z1 * r1 + z2 * z2 * r2 + z3 * z3 * r3 + math.log(shrunk))


@njit(cache=True)
def _bend(mean, rise, along):  # type: ignore[no-untyped-def]
    """Return the load of a stiffening pad minus the linear load, counts; see `STIFFENING`.

    Args:
        mean: Load at the middle of the contact, counts.
        rise: Rise of the load over 20 mm, counts.
        along: Distance from the middle of the contact, in units of 20 mm.
    """
    if mean <= 0.0:
        return 0.0
    turn, lowest = rise * along / mean, -0.5 / STIFFENING
    if turn < lowest:
        # Beyond its minimum the parabola would rise again, but the peg lifts off the pad there: the load stays constant.
        return mean * (STIFFENING * lowest * lowest + lowest - turn)
    return mean * STIFFENING * turn * turn


@njit(cache=True)
def _bent(weights, weighed, even, rising, along, first, middle, mean, rise):  # type: ignore[no-untyped-def]
    """Return the weighted sums bend·even and bend·rising of one finger, and the log likelihood gained by subtracting bend."""
    by_even = by_rising = gain = 0.0
    at_middle = mean + rise * middle
    for k in range(first, first + weights.size // 2):
        if even[k] > FAINT:
            more = even[k] * _bend(at_middle, rise, along[k] - middle)
            weighted = weights[k] * more
            by_even += weighted * even[k]
            by_rising += weighted * rising[k]
            gain += weighed[k] * more - 0.5 * weighted * more
    return by_even, by_rising, gain


@njit(cache=True)
def _evidence(weights, weighed, even, rising, along, middle, tightness, solution):  # type: ignore[no-untyped-def]
    """Return the log likelihood of one template with the loads integrated out; write the loads of `_solve` to `solution`.

    The curvature of the loads follows from their rise. `middle` is the middle of the contact, in units of 20 mm; NaN
    selects linear loads.
    """
    lee, ler, lrr, lye, lyr = _sums(weights, weighed, even, rising, 0)
    ree, rer, rrr, rye, ryr = _sums(weights, weighed, even, rising, weights.size // 2)
    # The following differences of nearly equal sums need double precision.
    left = (float(lee), float(ler), float(lrr), float(lye), float(lyr))
    right = (float(ree), float(rer), float(rrr), float(rye), float(ryr))
    found = _solve(left, right, tightness, solution)
    if math.isnan(middle) or found == NEVER or not _is_tilted(solution):
        return found
    a, b, c, d = solution[0], solution[1], solution[2], solution[3]
    le, lr, lgain = _bent(weights, weighed, even, rising, along, 0, middle, a + b, c + d)
    re, rr, rgain = _bent(weights, weighed, even, rising, along, weights.size // 2, middle, a - b, c - d)
    left = (left[0], left[1], left[2], left[3] - le, left[4] - lr)
    right = (right[0], right[1], right[2], right[3] - re, right[4] - rr)
    return _solve(left, right, tightness, solution) + lgain + rgain


@njit(cache=True)
def _is_tilted(solution):  # type: ignore[no-untyped-def]
    """Return True if the loads rise enough along the peg for their curvature to matter."""
    return abs(solution[2]) + abs(solution[3]) > LEAST_TURN * solution[0]


@njit(cache=True)
def _middle(borne):  # type: ignore[no-untyped-def]
    """Return the middle of the contact, in units of 20 mm from the finger centre towards the tip."""
    return borne[1] / borne[0] if borne[0] > 0.0 else math.nan


@njit(cache=True)
def _whole(borne, solution):  # type: ignore[no-untyped-def]
    """Return the logarithm of the load of one pad, mean of both fingers, counts·m, for the loads of `_evidence`."""
    return math.log(max(solution[0] * borne[0] + solution[2] * borne[1], 1e-9))


@njit(cache=True, forceinline=True)
def _of_load(borne, load, solution):  # type: ignore[no-untyped-def]
    """Return the log likelihood of the loads of `_evidence`, given the expected load."""
    # ln(q + (1 - q) exp(-(whole - expected)² precision / 2)), q = OTHER_LOAD
    away = _whole(borne, solution) - load[0]
    return math.log(OTHER_LOAD + (1.0 - OTHER_LOAD) * math.exp(-0.5 * load[1] * away * away))


@njit(cache=True, forceinline=True)
def _roughly_at(a, c, w, weights, weighed, against, tables, load, tightness, solution):  # type: ignore[no-untyped-def]
    """Return the log posterior at coarse angle a, offset c and print w, as `_at` does, for linear loads.

    `against` is the negative log prior. The function is inlined, because a call with so many arrays costs as much time
    as the sums.
    """
    even, rising, borne = tables
    left = _sums(weights, weighed, even[w, a, c], rising[w, a, c], 0)
    right = _sums(weights, weighed, even[w, a, c], rising[w, a, c], weights.size // 2)
    found = _solve(left, right, tightness, solution) - against
    if load[1] > 0.0 and found > NEVER:
        found += _of_load(borne[w, a, c], load, solution)
    return found


@njit(cache=True)
def _at(i, j, w, weights, weighed, prior, even, rising, along, borne, load, tightness, solution):  # type: ignore[no-untyped-def]
    """Return the log posterior at angle i, offset j and print w; i can exceed either end of the grid."""
    n, m = even.shape[1], even.shape[2]
    if i < 0 or i >= n:
        # The grid of angles is periodic with half a turn; the offset then changes its sign.
        i, j = i % n, m - 1 - j
    middle = _middle(borne[w, i, j])
    found = (
        _evidence(weights, weighed, even[w, i, j], rising[w, i, j], along[i], middle, tightness, solution) - prior[w, j]
    )
    if load[1] > 0.0 and found > NEVER:
        found += _of_load(borne[w, i, j], load, solution)
    return found


@njit(cache=True)
def _row(i, j, w, weights, weighed, prior, even, rising, along, borne, load, tightness, solution):  # type: ignore[no-untyped-def]
    """Find the maximum over prints and offsets at angle i by hill climbing from j and w.

    Returns the log posterior with the offset integrated out at the best print; the mean index and the best index of the
    offset; the best index of the print, its index interpolated between two prints, and the precision of the latter.
    """
    last, m = even.shape[0] - 1, even.shape[2]
    j = min(max(j, 1), m - 2)
    if last > 0:
        w = min(max(w, 1), last - 1)
    here = _at(i, j, w, weights, weighed, prior, even, rising, along, borne, load, tightness, solution)
    more = between = surety = 0.0
    if last > 0:
        low = _at(i, j, w - 1, weights, weighed, prior, even, rising, along, borne, load, tightness, solution)
        high = _at(i, j, w + 1, weights, weighed, prior, even, rising, along, borne, load, tightness, solution)
        while low > here and w > 1:
            w, high, here = w - 1, here, low
            low = _at(i, j, w - 1, weights, weighed, prior, even, rising, along, borne, load, tightness, solution)
        while high > here and w < last - 1:
            w, low, here = w + 1, here, high
            high = _at(i, j, w + 1, weights, weighed, prior, even, rising, along, borne, load, tightness, solution)
        bend, lean = 2.0 * here - low - high, 0.5 * (high - low)
        if here > 0.5 * NEVER and bend < -0.5 * NEVER:
            # All three prints are possible: the vertex of the parabola through them interpolates the print.
            surety = max(bend, 0.0)
            between = lean / max(surety, abs(lean), 1e-9)
            more = lean * between - 0.5 * surety * between * between
    low = _at(i, j - 1, w, weights, weighed, prior, even, rising, along, borne, load, tightness, solution)
    high = _at(i, j + 1, w, weights, weighed, prior, even, rising, along, borne, load, tightness, solution)
    while low > here and j > 1:
        j, high, here = j - 1, here, low
        low = _at(i, j - 1, w, weights, weighed, prior, even, rising, along, borne, load, tightness, solution)
    while high > here and j < m - 2:
        j, low, here = j + 1, here, high
        high = _at(i, j + 1, w, weights, weighed, prior, even, rising, along, borne, load, tightness, solution)
    bend, lean, middle = 2.0 * here - low - high, 0.5 * (high - low), float(j)
    if 0.0 < bend < -NEVER and low <= here and high <= here:
        # Gaussian through the three log posteriors: ln(area) = here + lean² / (2 bend) - ln(bend) / 2,
        # mean = j + lean / bend.
        more += 0.5 * lean * lean / bend - 0.5 * math.log(bend)
        middle += lean / bend
    return here + more, middle, j, w, w + between, surety


@njit(cache=True)
def posterior(  # type: ignore[no-untyped-def] # noqa: C901, PLR0915  compiled loops that share one scratch in registers
    is_wide,
    place,
    surety,
    values,
    weights,
    beside,
    tightness,
    theta,
    offset,
    even,
    rising,
    along,
    borne,
    tables,
    load,
    left,
):
    """Compare one frame with the templates; return the fields of `Found` and fill the residuals."""
    n, m = theta.size, offset.size
    narrow = weights.astype(np.float32)
    weighed = (weights * values).astype(np.float32)
    solution = np.zeros(4)
    step, across = theta[1] - theta[0], offset[1] - offset[0]
    middle, usual = m // 2, round(place)
    # An assignment of a row, or its largest element by numpy, would take the compiler several seconds.
    prior = np.empty((even.shape[0], m))
    for w in range(even.shape[0]):
        for j in range(m):
            prior[w, j] = beside[j] + 0.5 * surety * (w - place) ** 2
    coarse, nearest = np.full(n // COARSE_THETA, NEVER), np.zeros(n // COARSE_THETA, np.int64)
    likeliest = np.full(n // COARSE_THETA, usual)
    # If no print is expected, the search covers all prints.
    first_print, last_print = (usual, usual) if surety > 0.0 else (0, even.shape[0] - 1)
    reach = middle // COARSE_OFFSET if is_wide else NEAR
    for a in range(coarse.size):
        for w in range(first_print, last_print + 1, COARSE_PRINT):
            highest = NEVER
            for way in (1, -1):
                for k in range(int(way < 0), reach + 1):
                    j = middle + way * k * COARSE_OFFSET
                    value = _roughly_at(
                        a, j // COARSE_OFFSET, w, narrow, weighed, prior[w, j], tables, load, tightness, solution
                    )
                    if value > coarse[a]:
                        coarse[a], nearest[a], likeliest[a] = value, j, w
                    if value > highest:
                        highest = value
                    elif not is_wide and k > 0:
                        break
    modes = MODES if surety > 0.0 else MANY_MODES
    rows, about = np.empty(modes * (2 * FINE + 1)), np.empty(modes * (2 * FINE + 1))
    breadths, sureties = np.empty(rows.size), np.empty(rows.size)
    turns, places, prints = np.empty(rows.size, np.int64), np.empty(rows.size, np.int64), np.empty(rows.size, np.int64)
    count, top = 0, -math.inf
    for _ in range(modes):
        a = int(np.argmax(coarse))
        if coarse[a] <= NEVER or coarse[a] < top - RIVAL:
            break
        for way in (1, -1):
            j, w = nearest[a], likeliest[a]
            for b in range(int(way < 0), FINE + 1):
                i = a * COARSE_THETA + way * b
                rows[count], about[count], j, w, breadths[count], sureties[count] = _row(
                    i, j, w, narrow, weighed, prior, even, rising, along, borne, load, tightness, solution
                )
                turns[count], places[count], prints[count] = i, j, w
                top = max(top, rows[count])
                count += 1
                if rows[count - 1] < top - HOPELESS:
                    break
        for b in range(-(FINE // COARSE_THETA), FINE // COARSE_THETA + 1):
            coarse[(a + b) % coarse.size] = NEVER
    if count == 0:
        left[:] = 0.0
        return 0.0, 0.0, math.pi / 2, 0.0, -NEVER, 1.0, NEVER, place, 0.0, 0.0
    best = np.argmax(rows[:count])
    i, j, w = turns[best], places[best], prints[best]
    if not 0 <= i < n:
        i, j = i % n, m - 1 - j
    centre = _middle(borne[w, i, j])
    _evidence(narrow, weighed, even[w, i, j], rising[w, i, j], along[i], centre, tightness, solution)
    whole = _whole(borne[w, i, j], solution)
    is_bent = _is_tilted(solution) and not math.isnan(centre)
    misfit = missed = power = seen = 0.0
    for k in range(values.size):
        side = 1.0 if k < values.size // 2 else -1.0
        mean, rise = solution[0] + side * solution[1], solution[2] + side * solution[3]
        bend = _bend(mean + rise * centre, rise, along[i, k] - centre) if is_bent else 0.0
        fit = (mean + bend) * even[w, i, j, k] + rise * rising[w, i, j, k]
        left[k] = (values[k] - fit) * math.sqrt(weights[k])
        if weights[k] > 0.0:
            misfit += left[k] ** 2
            missed += (values[k] - fit) ** 2
            power += values[k] ** 2
            seen += 1.0
    misfit /= max(seen - AMOUNTS, 1.0)
    # A misfit above 1 reduces the information in every reading: chance_k = exp((ln p_k - ln p_best) / misfit)
    worth = 1.0 / max(misfit, 1.0)
    mass = first = second = aside = 0.0
    for k in range(count):
        chance = math.exp((rows[k] - rows[best]) * worth)
        away = (turns[k] - turns[best]) * step
        away -= math.pi * round(away / math.pi)
        mass += chance
        first += chance * away
        second += chance * away * away
        aside += chance * (about[k] - middle) * (1.0 if 0 <= turns[k] < n else -1.0)
    # theta = theta_i + E[away]; sigma² = Var[away] + step² / 12, the second term from the grid's step
    first /= mass
    angle = (theta[i] + first + math.pi / 2) % math.pi - math.pi / 2
    sigma = math.sqrt(second / mass - first * first + step * step / 12.0)
    residual = min(missed / (power + 1e-9), 1.0)
    return (
        angle,
        aside / mass * across,
        sigma,
        solution[0],
        misfit,
        residual,
        rows[best],
        breadths[best],
        sureties[best],
        whole,
    )
