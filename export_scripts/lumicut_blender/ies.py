# SPDX-License-Identifier: Apache-2.0
"""Photometric files (IESNA LM-63) as Cycles reads and interpolates them: intensity of a lamp by direction.

Where Cycles departs from the standard, this does too: the picture must be the same. TILT is passed over; files from 90 to
270 degrees are turned to begin at 0. What Cycles refuses is read as the command reads it (io/ies_file.cpp); both are tested
with tests/io/ies_corpus.json.
"""
import math

import numpy as np

# What Blender's node gives for a candela: 4π/177.83, so that a file's lamp of 1 W in Blender's units is about as bright
# as an incandescent one.
PER_CANDELA = 0.0706650768394
STEPS = 8  # least number of straight pieces that Cycles' cubic between two angles becomes
NOISE = 0.01  # of the largest candela value: what a photometer's negative values may be
COARSE = {"vertical": math.radians(1.0), "horizontal": math.radians(4.0)}  # no more pieces than make them this wide


class IesError(ValueError):
    """Text that is no photometric file, or one of a kind that is not read."""


def parse(text, warn=lambda remark: None):
    """(vertical degrees, horizontal degrees from 0 to 360, candela of (horizontal, vertical)), all around.

    `warn` is told what was read in place of what the file says."""
    lines = ["".join(line.split()).replace('"', "").upper() for line in text.splitlines()]
    for mark in ("\ufeff", "\u00ef\u00bb\u00bf"):  # as UTF-8, and as Latin 1
        lines[:1] = [line.removeprefix(mark.upper()) for line in lines[:1]]
    first = next((i for i, line in enumerate(lines) if line.startswith("TILT=")), None)
    if first is None:
        raise IesError("it has no line that begins with TILT=")
    tilt = lines[first][5:]
    words = " ".join(text.splitlines()[first + 1:]).replace(",", " ").split()
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

    def factor_of(what):
        value = take(what)
        if value < 0:
            raise IesError(f"{what} {value:g} is negative")
        if value == 0:
            warn(f"{what} 0 is taken as 1")
        return value or 1.0

    if tilt == "INCLUDE":
        take("lamp to luminaire geometry")
        for _ in range(2 * whole("number of tilt angles", 100000)):
            take("tilt")
    elif tilt != "NONE":
        raise IesError(f"TILT={tilt}: only NONE and INCLUDE are read")
    take("number of lamps"), take("lumens per lamp")
    factor = factor_of("candela multiplier")
    rows, columns = whole("number of vertical angles", 10000), whole("number of horizontal angles", 10000)
    kind = whole("photometric type", 3)
    take("units of the luminous opening"), take("size of the luminous opening", 3)
    factor *= factor_of("ballast factor") * factor_of("ballast-lamp photometric factor")
    take("input watts")
    vertical = np.array(take("vertical angles", rows)).reshape(-1)
    horizontal = np.array(take("horizontal angles", columns)).reshape(-1)
    candela = factor * np.array(take("candela values", rows * columns)).reshape(columns, rows)
    limits = {1: ((0, 180), (-360, 720)), 2: ((-180, 180), (-90, 90)), 3: ((-90, 90), (-180, 180))}[kind]
    for name, angles, (least, most) in (("vertical", vertical, limits[0]), ("horizontal", horizontal, limits[1])):
        if (np.diff(angles) <= 0).any() or angles[0] < least or angles[-1] > most:
            raise IesError(f"{name} angles do not rise from {least} to {most}")
    if rows < 2:
        raise IesError("it has a single vertical angle")
    if candela.max() <= 0 or candela.min() < -NOISE * candela.max():
        raise IesError("its candela values are negative or all 0")
    if candela.min() < 0:
        warn("candela values below 0 are taken as 0")
        candela = np.maximum(candela, 0)
    if kind != 1:
        return _turned(vertical, horizontal, candela, kind == 2)
    if vertical[0] not in (0, 90):
        raise IesError(f"vertical angles start at {vertical[0]:g}, but must at 0 or 90")
    if vertical[-1] not in (90, 180):
        warn(f"there is no light beyond the last vertical angle {vertical[-1]:g}")
    return (vertical, *_all_around(horizontal, candela, warn))


def _all_around(horizontal, candela, warn):
    """What the file's symmetry leaves out."""
    if len(horizontal) == 1:
        if horizontal[0] != 0:
            warn(f"the only horizontal angle is {horizontal[0]:g}: the lamp is the same all around")
        return np.array([0.0, 360.0]), np.repeat(candela, 2, 0)
    horizontal = horizontal - horizontal[0] if horizontal[0] == 90 else horizontal
    first, span = horizontal[0], horizontal[-1] - horizontal[0]
    if first % 90 != 0 and span != 360:
        raise IesError(f"horizontal angles start at {first:g}, but must at a multiple of 90")
    for half in (90, 180):
        if horizontal[-1] - first == half:
            horizontal = np.concatenate([horizontal, 2 * horizontal[-1] - horizontal[-2::-1]])
            candela = np.concatenate([candela, candela[-2::-1]])
    if horizontal[-1] - first != 360:  # some writers leave the last out, which is the first again
        step = horizontal[-1] - horizontal[-2]
        if abs(360 + first - horizontal[-1] - step) > 1e-6:
            raise IesError(f"horizontal angles end at {horizontal[-1]:g}, but must at 0, 90, 180 or 360")
        horizontal, candela = np.append(horizontal, first + 360.0), np.concatenate([candela, candela[:1]])
    if first == 0:
        return horizontal, candela
    # Turned to begin at 0.
    order = np.argsort(horizontal[:-1] % 360)
    angles, values = (horizontal[:-1] % 360)[order], candela[:-1][order]
    before, after = angles[-1] - 360, angles[0]
    end = values[:1] + (values[-1:] - values[:1]) * (after / (after - before))
    if after > 0:
        angles, values = np.append(0.0, angles), np.concatenate([end, values])
    return np.append(angles, 360.0), np.concatenate([values, end])


def _turned(vertical, horizontal, candela, type_b):
    """Types A and B in the angles of type C, as io/ies_file.cpp turns them (CIE 121-1996): latitude and longitude about an
    axis across the beam, vertical angles rising towards C = 0, horizontal ones towards C = 90."""
    def place(angles, at):
        if angles[0] >= 0:  # symmetry leaves one side in the file
            at = np.abs(at)
        if len(angles) == 1:
            return np.zeros(at.shape, int), np.zeros(at.shape), np.ones(at.shape, bool)
        i = np.clip(np.searchsorted(angles, at, side="right") - 1, 0, len(angles) - 2)
        t = np.clip((at - angles[i]) / (angles[i + 1] - angles[i]), 0, 1)
        return i, t, (at >= angles[0] - 1e-6) & (at <= angles[-1] + 1e-6)

    finest = min([1.0, *np.diff(vertical), *np.diff(horizontal)])
    end = 180 if max(np.abs(vertical).max(), np.abs(horizontal).max()) > 90 else 90
    v = np.linspace(0.0, end, math.ceil(end / max(finest, 0.25)) + 1)
    c = np.arange(0.0, 361.0, 2.0)
    sine = np.sin(np.radians(v))
    up, across = np.cos(np.radians(c))[:, None] * sine, np.sin(np.radians(c))[:, None] * sine
    z = np.broadcast_to(np.cos(np.radians(v)), up.shape)

    def latitude(x):
        return np.degrees(np.arcsin(np.clip(x, -1, 1)))

    def longitude(x):
        return np.where(np.hypot(x, z) > 1e-9, np.degrees(np.arctan2(x, z)), 0.0)

    i, s, inside = place(vertical, longitude(up) if type_b else latitude(up))
    j, t, also = place(horizontal, latitude(across) if type_b else longitude(across))
    other = np.minimum(j + 1, len(horizontal) - 1)
    row = [candela[k, i] + (candela[k, i + 1] - candela[k, i]) * s for k in (j, other)]
    return v, c, np.where(inside & also, row[0] + (row[1] - row[0]) * t, 0.0)


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
