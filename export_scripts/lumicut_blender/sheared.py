# SPDX-License-Identifier: Apache-2.0
"""Area lamps whose axes a parent's uneven scale has made oblique, as Cycles has them.

A round one is the ellipse that its axes span, and shines by the cosine to the matrix's own z axis.

Of a rectangle Cycles takes coordinates along the oblique axes x and y (of length 1) as if they stood upright. What lies at d is
seen towards Gd, with G = xxᵀ + yyᵀ + zzᵀ and z = x × y; so the lamp is the parallelogram of the
axes dual to x and y, moved a little where the corner is what coordinates count from (compat.py); what it shines in a direction ω is
(z·ω)/(ω·Gω)^(3/2); and what it lights sees it in another direction than it is lit from. It becomes points with a table by
direction, in which the surface that is lit in each direction counts by how it faces the bent light."""
import math

import numpy as np

from . import compat, falloffs
from .ies import PER_CANDELA
from .lumicut import library

SIDE = 8  # a rectangle is SIDE x SIDE points
STRAIGHT = 1e-3  # cosine of axes that are upright
UPRIGHT = 0.98  # cosine of a rectangle's axis to its plane's normal, below which the side that it lights is told from the plane's
FLATTEST = 0.02  # cosine of light on what it lights, below which no table makes up for how it bends


def _unit(v):
    return v / max(np.linalg.norm(v), 1e-30)


def is_sheared(u, v, z, is_round):
    u, v, z = _unit(u), _unit(v), _unit(z)
    if is_round:
        return max(abs(u @ v), abs(u @ z), abs(v @ z)) > STRAIGHT
    return abs(u @ v) > STRAIGHT or abs(_unit(np.cross(u, v)) @ z) < UPRIGHT


def _frame(forward):
    """Axes of a lamp that shines along `forward`."""
    x = _unit(np.cross(forward, (0, 0, 1) if abs(forward[2]) < 0.9 else (1, 0, 0)))
    return np.column_stack([x, np.cross(-forward, x), -forward])


def without_axis(lamp):
    """Lamps that stand for one whose parent has no scale along its axis: no direction is behind such a rectangle."""
    if not compat.RECTANGLES_NEED_NO_AXIS or lamp.type == library.DISK or lamp.spread < math.pi - 1e-3:
        return []
    other = library.Light.from_buffer_copy(lamp)
    other.v[:] = [-x for x in lamp.v]
    return [lamp, other]


def apply(name, light, out, u, v, forward, report, profiles):
    """Makes `out`, the lamp made straight, what Cycles sees of whole edges u and v: at once, or when it is settled."""
    forward = _unit(forward)
    if out.type == library.DISK:
        edges = np.column_stack([u, v])
        flat = edges - np.outer(forward, forward @ edges)
        if np.linalg.norm(edges - flat) > STRAIGHT * np.linalg.norm(edges):
            report.note(name, "Sheared disks, laid across their axis")
        if compat.SHEARED_DISKS_LOSE_SPREAD and out.spread > 0 and out.spread < math.pi - 1e-3:
            report.note(name, "Sheared disks with a spread, of which Cycles shows a part alone")
        axes, lengths, _ = np.linalg.svd(flat, full_matrices=False)  # of the ellipse
        out.u[:] = (axes[:, 0] * lengths[0]).tolist()
        out.v[:] = (np.cross(forward, axes[:, 0]) * lengths[1]).tolist()
        return
    report.note(name, f"Sheared rectangles, taken as {SIDE * SIDE} points")
    profiles.later[id(out)] = lambda lamp, meshes, check: _points(name, light, lamp, u, v, forward, meshes, profiles, check)


def _spread(cosine, spread):
    """What an area lamp of that spread shines at that cosine to its axis, as a share of one that spreads light evenly."""
    narrow = 0.5 * (math.pi - spread)
    if narrow <= 1e-4:
        return 1.0
    tangent = np.sqrt(np.maximum(0, 1 - cosine * cosine)) / np.maximum(cosine, 1e-6)
    return np.maximum(0, 1 - math.tan(narrow) * tangent) / (1 - 0.5 * spread * math.tan(narrow))


def _intensity(x, y, forward, spread, ways, normals):
    """Of a power of 4, by direction; `normals`: of what lies there, which face the lamp."""
    a = np.column_stack([x, y, np.cross(x, y)])
    seen = ways @ (a @ a.T)
    seen /= np.linalg.norm(seen, axis=-1, keepdims=True)
    falls, falls_bent = -(ways * normals).sum(-1), -(seen * normals).sum(-1)
    shone = np.abs(ways @ a[:, 2]) / np.linalg.norm(ways @ a, axis=-1) ** 3
    shone = shone * _spread(seen @ forward, spread)
    return np.where(ways @ forward > 0, shone * np.maximum(0, falls_bent) / np.maximum(falls, FLATTEST), 0)


def _points(name, light, lamp, u, v, forward, meshes, profiles, check):
    frame, place = _frame(forward), np.array(lamp.position, np.float64)
    vertical, horizontal = falloffs.angles()
    s, c, h = np.sin(vertical)[None], np.cos(vertical)[None], horizontal[:, None]
    ways = np.stack(np.broadcast_arrays(-s * np.sin(h), -s * np.cos(h), -c), -1) @ frame.T  # as ies.py has it
    normals = np.broadcast_to(-forward, ways.shape)
    if meshes:
        distance, found = falloffs.surroundings(meshes, place, frame, check)
        normals = np.where(np.isfinite(falloffs.by_angles(distance))[..., None], falloffs.by_angles(found), normals)
    x, y, long_u, long_v = _unit(u), _unit(v), np.linalg.norm(u), np.linalg.norm(v)
    table = falloffs.table_of(_intensity(x, y, forward, lamp.spread, ways, normals) * math.pi / PER_CANDELA)
    lamp = library.Light.from_buffer_copy(lamp)
    lamp.u[:] = lamp.v[:] = [0.0, 0.0, 0.0]
    lamp.spread = 0.0
    if not profiles.add_table(name, light, ("sheared", name, tuple(place)), (name, *table), np.eye(3), frame, lamp, "shear"):
        return []
    at = (np.arange(SIDE) + 0.5) / SIDE - 0.5
    moved = 0.5 * (x @ y) if compat.SHEARED_FROM_CORNER else 0
    s, t = np.meshgrid(at * long_u - moved * long_v, at * long_v - moved * long_u)
    parts = []
    for offset in np.column_stack([s.ravel(), t.ravel()]) @ np.linalg.pinv(np.column_stack([x, y])):
        part = library.Light.from_buffer_copy(lamp)
        part.position[:], part.value = (place + offset).tolist(), lamp.value / SIDE ** 2
        parts.append(part)
    return parts
