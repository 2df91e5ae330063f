# SPDX-License-Identifier: Apache-2.0
"""Spots of a radius, as many spots without: the library takes a spot as a point.

Cycles gives a spot's light from a disk, with the cone about each of its points. [Measured against 3.4.1.]"""
import math

import numpy as np

from .lumicut import library

MOST, BUDGET = 64, 1024  # spots in place of one, of all in a scene


def spread_out(lights):
    """[(name, library.Light)] with each spot of a radius parted, and the others as they are."""
    soft = sum(is_soft(light) for _, light in lights)
    count = min(MOST, BUDGET // soft) if soft else 0
    if count < 4:
        return lights
    return [(name, part) for name, light in lights for part in (parts(light, count) if is_soft(light) else (light,))]


def is_soft(light):
    return light.type == library.SPOT and light.radius > 0


def parts(light, count):
    """Spots of equal power, evenly over the disk: a spiral by the golden angle."""
    axis = np.array(light.direction, np.float64)
    across = np.cross(axis, np.eye(3)[np.argmin(abs(axis))])
    across /= np.linalg.norm(across)
    up = np.cross(axis, across)
    for k in range(count):
        out = library.Light.from_buffer_copy(light)
        r, turn = light.radius * math.sqrt((k + 0.5) / count), k * math.pi * (3 - math.sqrt(5))
        out.position[:] = (np.array(light.position) + r * (math.cos(turn) * across + math.sin(turn) * up)).tolist()
        out.value, out.radius = light.value / count, 0.0
        yield out
