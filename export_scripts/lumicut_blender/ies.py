# SPDX-License-Identifier: Apache-2.0
"""Photometric files (IESNA LM-63) as Cycles reads and interpolates them: intensity of a lamp by direction.

Where Cycles departs from the standard, this does too: the picture must be the same. TILT is passed over; files from 90 to
270 degrees are turned to begin at 0.
"""
import math

import numpy as np

# What Blender's node gives for a candela: 4π/177.83, so that a file's lamp of 1 W in Blender's units is about as bright
# as an incandescent one.
PER_CANDELA = 0.0706650768394
STEPS = 8  # least number of straight pieces that Cycles' cubic between two angles becomes
COARSE = {"vertical": math.radians(1.0), "horizontal": math.radians(4.0)}  # no more pieces than make them this wide


class IesError(ValueError):
    """Text that is no photometric file, or one of a kind that is not read."""


def parse(text):
    """(vertical degrees, horizontal degrees from 0 to 360, candela of (horizontal, vertical)), all around."""
    lines = text.splitlines()
    first = next((i for i, line in enumerate(lines) if line.strip().upper().startswith("TILT=")), None)
    if first is None:
        raise IesError("it has no line that begins with TILT=")
    tilt = lines[first].strip().upper()[5:]
    words = " ".join(lines[first + 1:]).replace(",", " ").split()
    at = 0

    def take(what, count=1):
        nonlocal at
        if at + count > len(words):
            raise IesError(f"it ends where {what} should stand")
        try:
            values = [float(word) for word in words[at:at + count]]
        except ValueError:
            raise IesError(f"{what}: {' '.join(words[at:at + count])[:40]} is not a number") from None
        if not np.isfinite(values).all():
            raise IesError(f"{what} is not finite")
        at += count
        return values if count > 1 else values[0]

    def whole(what, most):
        value = take(what)
        if value != int(value) or not 1 <= value <= most:
            raise IesError(f"{what} {value:g} is not one of 1 to {most}")
        return int(value)

    if tilt == "INCLUDE":
        take("lamp to luminaire geometry")
        for _ in range(2 * whole("number of tilt angles", 100000)):
            take("tilt")
    elif tilt != "NONE":
        raise IesError(f"TILT={tilt}: only NONE and INCLUDE are read")
    take("number of lamps"), take("lumens per lamp")
    factor = take("candela multiplier")
    rows, columns = whole("number of vertical angles", 10000), whole("number of horizontal angles", 10000)
    kind = whole("photometric type", 3)
    if kind != 1:
        raise IesError(f"type {'?CBA'[kind]} photometry is not read, only type C")
    take("units of the luminous opening"), take("size of the luminous opening", 3)
    factor *= take("ballast factor") * take("ballast-lamp photometric factor")
    take("input watts")
    vertical = np.array(take("vertical angles", rows)).reshape(-1)
    horizontal = np.array(take("horizontal angles", columns)).reshape(-1)
    candela = factor * np.array(take("candela values", rows * columns)).reshape(columns, rows)
    for name, angles, most in (("vertical", vertical, 180), ("horizontal", horizontal, 360)):
        if (np.diff(angles) <= 0).any() or angles[0] < 0 or angles[-1] > most:
            raise IesError(f"{name} angles do not rise from 0 to {most}")
    if rows < 2:
        raise IesError("it has a single vertical angle")
    if (candela < 0).any() or not candela.any():
        raise IesError("its candela values are negative or all 0")
    return (vertical, *_all_around(horizontal, candela))


def _all_around(horizontal, candela):
    """What the file's symmetry leaves out."""
    if len(horizontal) == 1:
        return np.array([0.0, 360.0]), np.repeat(candela, 2, 0)
    horizontal = horizontal - horizontal[0] if horizontal[0] == 90 else horizontal
    for half in (90, 180):
        if horizontal[-1] == half:
            horizontal = np.concatenate([horizontal, 2 * half - horizontal[-2::-1]])
            candela = np.concatenate([candela, candela[-2::-1]])
    if horizontal[-1] != 360:  # some writers leave the last out, which is the first again
        step = horizontal[-1] - horizontal[-2]
        if abs(360 - horizontal[-1] - step) > 1e-6 or horizontal[0] != 0:
            raise IesError(f"horizontal angles end at {horizontal[-1]:g}, but must at 0, 90, 180 or 360")
        horizontal, candela = np.append(horizontal, 360.0), np.concatenate([candela, candela[:1]])
    if horizontal[0] != 0:
        raise IesError(f"horizontal angles start at {horizontal[0]:g}, but must at 0 or 90")
    return horizontal, candela


def _finer(angles, widest):
    """Angles between: (all of them, interval and place in it of each)."""
    out, interval, place = [], [], []
    for i, (a, b) in enumerate(zip(angles[:-1], angles[1:])):
        pieces = min(STEPS, max(1, math.ceil((b - a) / widest)))
        t = np.arange(pieces) / pieces
        out.append(a + (b - a) * t), interval.append(np.full(pieces, i)), place.append(t)
    out.append(angles[-1:]), interval.append([len(angles) - 2]), place.append([1.0])
    return np.concatenate(out), np.concatenate(interval), np.concatenate(place)


def _cubic(a, b, c, d, t):
    """Cycles' cubic_interp: Catmull and Rom's."""
    return 0.5 * (((d + 3 * (b - c) - a) * t + (2 * a - 5 * b + 4 * c - d)) * t + (c - a)) * t + b


def resampled(vertical, horizontal, candela, wraps=True):
    """The same in radians, fine enough for straight lines between its angles to follow Cycles' cubic ones.

    `wraps`: what Cycles' cubic takes beyond the ends, see lights.IES_WITHOUT_WRAP."""
    v, i, t = _finer(np.radians(vertical), COARSE["vertical"])
    # Below the first angle Cycles takes the second, beyond the last the last.
    last = len(vertical) - 1
    column = [candela[:, k] for k in (np.where(i == 0, 1, i - 1), i, i + 1, np.minimum(i + 2, last))]
    if not wraps:
        column[3] = np.where(i + 2 > last, 0, column[3])
    values = _cubic(*column, t)
    if wraps and len(horizontal) == 2:  # the same all around
        return v, np.zeros(1), np.maximum(0, values[:1])
    h, j, t = _finer(np.radians(horizontal), COARSE["horizontal"])
    count = len(horizontal)
    row = [values[k] for k in (np.where(j == 0, count - 2, j - 1), j, j + 1, np.where(j + 2 == count, 1, j + 2))]
    if not wraps:
        row[0], row[3] = np.where((j == 0)[:, None], 0, row[0]), np.where((j + 2 == count)[:, None], 0, row[3])
    return v, h, np.maximum(0, _cubic(*row, t[:, None]))
