# SPDX-License-Identifier: Apache-2.0
"""Node trees of lamps that vary over the lamp or by direction: compiled to a program, which the library evaluates once, into
an image over an area lamp, a table by direction of point and spot lamps, the mean over the disc of a sun.

What coordinates are to a lamp was measured in Cycles 3.4.1 and 4.3.2: Generated, Object and Position are the place on the
lamp in the world, Parametric of area lamps goes from 0 to 1 along both sides, and so does UV in 4.3.2, which is 0 in 3.4.1; Normal is the way the light goes,
Texture Coordinate's in the lamp's own space, Geometry's in the world. To suns the place is that way, too."""
import math

import bpy
import numpy as np

from . import programs
from .images import Picture
from .lumicut import library
from .mappings import Mapping
from .program_values import evaluated
from .programs import POSITION, TO_VIEWER, ZERO, Compiler, Expr, attribute, const, vector_math

TEXELS = 256  # along the longer side of an area lamp, and from below to above a point
UV = attribute(("uv", ""), mean=(0.5, 0.5, 0))
UV_IS_PARAMETRIC = bpy.app.version >= (4, 0, 0)  # measured in 3.4.1 and 4.3.2; versions between were not there


class LampCompiler(Compiler):
    """`place`, `normal`, `world_normal`, `parametric`: what those coordinates are; None: not known."""

    def __init__(self, reader, light, axes, place):
        super().__init__(reader)
        turn = tuple(np.column_stack([axes, np.zeros(3)]).ravel().tolist())
        if light.type == "AREA":
            self.place, self.parametric = POSITION, UV
            self.normal, self.world_normal, self.incoming = const((0, 0, -1)), const(-axes[:, 2]), None
        elif light.type == "SUN":
            self.place = self.world_normal = self.incoming = vector_math("NORMALIZE", POSITION)
            self.parametric, self.normal = const((0.5, 0.5, 0) if UV_IS_PARAMETRIC else (0, 0.5, 0)), const((0, 0, -1))
        else:
            self.place, self.parametric = const(place), None
            self.normal = vector_math("SCALE", TO_VIEWER, const(-1))
            self.world_normal = self.incoming = Expr("transform", 1, (self.normal,), turn, mean=0)

    def vector(self, node, stack, otherwise=None):
        socket = node.inputs.get("Vector")
        if socket is not None and socket.is_linked and self.reader.source(socket, stack)[0] is not None:
            return self.socket(socket, stack)
        return self.place if otherwise is None else self.uv()

    def _light_falloff(self, node, output, stack):
        return self.socket(node.inputs["Strength"], stack)  # the rest is falloffs.py's

    def uv(self):
        return self.known_or_not("UV of lamps", self.parametric) if UV_IS_PARAMETRIC else ZERO

    def known_or_not(self, what, value):
        if value is None:
            raise programs.CannotCompile(what)
        return value

    def _tex_coord(self, node, output, stack):
        if output.name == "Object" and node.object is not None:
            return self.to_object(node.object, 0, self.place)
        known = {"Generated": self.place, "Object": self.place, "Normal": self.normal}
        if output.name == "UV":
            return self.uv()
        return self.known_or_not(f"Texture Coordinate of lamps: {output.name}", known.get(output.name))

    def _new_geometry(self, node, output, stack):
        known = {"Position": self.place, "Normal": self.world_normal, "True Normal": self.world_normal,
                 "Parametric": self.parametric, "Incoming": self.incoming, "Backfacing": ZERO}
        return self.known_or_not(f"Geometry of lamps: {output.name}", known.get(output.name))

    def _uvmap(self, node, output, stack):
        return self.uv()

    def _camera(self, node, output, stack):
        raise programs.CannotCompile("Camera Data of lamps")

    def _object_info(self, node, output, stack):
        raise programs.CannotCompile("Object Info of lamps")

    _vertex_color = _attribute = _particle_info = _fresnel = _layer_weight = _object_info


def over(expr, place, u, v, y):
    """An image over the parallelogram of whole edges u and v, as a Picture; a colour where it is even. `y`: the lamp's own
    axis, which v may go against."""
    longest = max(np.linalg.norm(u), np.linalg.norm(v))
    width, height = (max(16, round(TEXELS * float(np.linalg.norm(edge)) / longest)) for edge in (u, v))
    corners = np.array([place + (s - 0.5) * u + (t - 0.5) * v for s, t in ((0, 0), (1, 0), (1, 1), (0, 1))], np.float32)
    uvs = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], np.float32)
    if v @ y < 0:
        uvs[:, 1] = 1 - uvs[:, 1]
    right, up = u / np.linalg.norm(u), v / np.linalg.norm(v)
    back = np.cross(right, up)
    camera = library.Camera(orthographic=1, height=float(np.linalg.norm(v)))
    camera.to_world[:] = [float(x) for x in np.column_stack([right, up, back, place + back * longest]).ravel()]
    camera.pixel_aspect = float(np.linalg.norm(u) / width / (np.linalg.norm(v) / height))
    pixels = evaluated(expr, corners, {("uv", ""): uvs}, camera, width, height)
    if np.ptp(pixels, axis=(0, 1)).max() <= 1e-5 * pixels.max():
        return pixels.mean((0, 1)), None
    key = "lamp", expr.key, tuple(float(x) for x in (*place, *u, *v))
    return np.ones(3), Picture("lamp", key, Mapping(), library.CLAMP, linear=np.ascontiguousarray(pixels, np.float32))


def of_disc(expr, way, radius, side=24):
    """Mean of what a sun's disc, of that angular radius, shines that way."""
    right = np.cross(way, (0, 0, 1) if abs(way[2]) < 0.9 else (1, 0, 0))
    right /= np.linalg.norm(right)
    up, half = np.cross(way, right), max(1e-4, math.tan(min(radius, 1.4)))
    edges = 2 * half * right, 2 * half * up
    corners = np.array([way + (s - 0.5) * edges[0] + (t - 0.5) * edges[1] for s, t in ((0, 0), (1, 0), (1, 1), (0, 1))], np.float32)
    camera = library.Camera(orthographic=1, height=2 * half, pixel_aspect=1.0)
    back = np.cross(right, up)
    camera.to_world[:] = [float(x) for x in np.column_stack([right, up, back, way + 2 * half * back]).ravel()]
    pixels = evaluated(expr, corners, {}, camera, side, side)
    y, x = (np.mgrid[0:side, 0:side] + 0.5) * 2 / side - 1
    return pixels[x * x + y * y <= 1].mean(0)


def around(expr):
    """(vertical angles, horizontal angles, values of (horizontal, vertical, 3)) as ies.py has them: vertical from -z,
    horizontal from -y towards -x. A colour where it is the same all around."""
    camera = library.Camera(panorama=library.EQUIRECTANGULAR)
    camera.to_world[:] = [-1.0, 0, 0, 0, 0, 0, 1.0, 0, 0, -1.0, 0, 0]  # right -x, up -z, back +y
    places = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float32)
    faces = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    corners = np.concatenate([places[list(face)] for face in faces])
    height, width = TEXELS, 2 * TEXELS
    pixels = evaluated(expr, corners, {}, camera, width, height)
    if np.ptp(pixels, axis=(0, 1)).max() <= 1e-5 * pixels.max():
        return None, None, pixels.mean((0, 1))
    pixels = np.roll(pixels, -width // 2, 1).transpose(1, 0, 2)  # from 0 on
    seam = 0.5 * (pixels[:1] + pixels[-1:])
    values = np.concatenate([seam, pixels, seam])
    poles = [np.broadcast_to(values[:, k:k + 1].mean(0, keepdims=True), (len(values), 1, 3)) for k in (0, height - 1)]
    values = np.concatenate([poles[0], values, poles[1]], 1)
    vertical = np.concatenate([[0], (np.arange(height) + 0.5) * math.pi / height, [math.pi]])
    horizontal = np.concatenate([[0], (np.arange(width) + 0.5) * 2 * math.pi / width, [2 * math.pi]])
    return vertical, horizontal, values
