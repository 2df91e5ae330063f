# SPDX-License-Identifier: Apache-2.0
"""Light Falloff of lamps, whose strength may depend on the distance to what they light. A virtual light's cannot; but what a
lamp lights directly is the first surface in each direction, and so its distance is known there: it becomes a table of
intensities by direction. Area lamps take the mean of it."""
import math

import numpy as np

from . import runtime
from .ies import PER_CANDELA
from .lumicut import library

ROWS = 256  # of the table, from below to above
POINTS = 32  # in place of a lamp with a radius, as a table by direction has a place of its own


class Falloff:
    """`power`: of the distance, 0 to 2; `smooth`: the node's."""

    def __init__(self, power, smooth):
        self.power, self.smooth = power, smooth

    def plain(self):
        return self.power == 0 and self.smooth <= 0

    def at(self, distance):
        factor = distance ** self.power
        return factor * distance ** 2 / (self.smooth + distance ** 2) if self.smooth > 0 else factor


def surroundings(meshes, place, axes, check):
    """Distances (ROWS, 2 ROWS) to what casts shadows, NaN where there is nothing, and its normals, which face the lamp:
    equirectangular images whose right is -x, up -z, back +y of the lamp's `axes`."""
    with library.Scene(library.Device(runtime.require(), 1)) as scene, library.Integrator(scene.device, "exhaustive") as integrator:
        scene.set_materials([library.Material(opacity=1.0)])
        for mesh in meshes:
            if not (mesh.mask or library.ALL_RAYS) & library.SHADOW_RAYS:
                continue
            check()
            scene.add_mesh(mesh.positions, mesh.indices, transforms=np.array(mesh.transforms, np.float32))
        camera = library.Camera(panorama=library.EQUIRECTANGULAR, far_clip=1e30)
        camera.to_world[:] = [float(x) for x in np.column_stack([-axes[:, 0], -axes[:, 2], axes[:, 1], place]).ravel()]
        scene.set_camera(camera)
        scene.commit()
        integrator.set("vpls", "1")
        with library.Render(integrator, scene, 2 * ROWS, ROWS) as render:
            while render.wait(1000).state == library.RUNNING:
                check()
            return np.where(render.read("alpha")[..., 0] > 0, render.read("depth")[..., 0], np.nan), render.read("normal")


def by_angles(image):
    """(2 ROWS, ROWS, ...): by horizontal angle, 0 first, and vertical angle, as lamp_textures.around has them."""
    return np.roll(image, -ROWS, 1).swapaxes(0, 1)


def angles():
    """(vertical, horizontal) of what by_angles gives."""
    return (np.arange(ROWS) + 0.5) * math.pi / ROWS, (np.arange(2 * ROWS) + 0.5) * math.pi / ROWS


def table_of(values):
    """(vertical, horizontal, values) of all angles, to the poles and all around, from what by_angles gives."""
    seam = 0.5 * (values[:1] + values[-1:])
    values = np.concatenate([seam, values, seam])
    values = np.concatenate([np.full((len(values), 1), values[:, 0].mean()), values, np.full((len(values), 1), values[:, -1].mean())], 1)
    vertical, horizontal = angles()
    return np.concatenate([[0], vertical, [math.pi]]), np.concatenate([[0], horizontal, [2 * math.pi]]), values


def applied(name, lamp, data, matrix, falloff, meshes, profiles, report, check):
    """[library.Light] in place of one that was converted as if its light fell as light does."""
    m = np.array(matrix, np.float64)[:3]
    axes = m[:, :3] / np.maximum(np.linalg.norm(m[:, :3], axis=0), 1e-30)
    if lamp.type == library.SUN or not meshes:
        return [lamp]
    distance = surroundings(meshes, m[:, 3], axes, check)[0]
    factors = falloff.at(np.where(np.isfinite(distance), distance, np.nanmedian(distance) if np.isfinite(distance).any() else 1.0))
    report.note(name, "Light Falloff, by how far away things are around the lamp")
    if lamp.profile or lamp.type not in {library.POINT, library.SPOT}:
        # Towards -z, which is up in the image; of area lamps by the cosine.
        down = np.cos((np.arange(ROWS) + 0.5) * math.pi / ROWS)[:, None]
        weights = np.sin((np.arange(ROWS) + 0.5) * math.pi / ROWS)[:, None] * np.maximum(0, down) * np.isfinite(distance)
        lamp.value *= float((factors * weights).sum() / weights.sum()) if weights.any() else 1.0
        return [lamp]
    vertical, horizontal, values = table_of(by_angles(factors))
    radius, lamp.radius = lamp.radius, 0.0
    key = "falloff", tuple(m.ravel().round(6).tolist()), falloff.power, falloff.smooth
    if not profiles.add_table(name, data, key, (name, vertical, horizontal, values / PER_CANDELA), np.eye(3), matrix, lamp,
                              "Light Falloff"):
        return []
    lamp.angle, lamp.blend, lamp.spot_cosine = 0.0, 0.0, 0
    return spread(lamp, radius, data.type == "POINT")


def spread(lamp, radius, ball=False):
    """Lights in place of one of a radius, over the disk across its direction or over a ball."""
    if not radius > 0:
        return [lamp]
    axis, right = np.array(lamp.direction), np.array(lamp.tangent)
    up, lights = np.cross(axis, right), []
    for i in range(POINTS):  # Vogel's spiral, and Fibonacci's
        height = (2 * i + 1) / POINTS - 1 if ball else 0.0
        r, turn = math.sqrt(1 - height * height if ball else (i + 0.5) / POINTS), i * math.pi * (3 - math.sqrt(5))
        part = library.Light.from_buffer_copy(lamp)
        part.position[:] = (np.array(lamp.position) + radius * (r * math.cos(turn) * right + r * math.sin(turn) * up + height * axis)).tolist()
        part.value = lamp.value / POINTS
        lights.append(part)
    return lights
