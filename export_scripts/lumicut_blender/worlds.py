# SPDX-License-Identifier: Apache-2.0
"""The world: what lights, its suns, and what the camera alone sees in its place."""
import numpy as np

from . import compat, sky
from .lumicut import library
from .directions import Directions
from .images import Picture
from .mappings import Mapping
from .nodes import Value
from .report import Report

BY_RAY = "Worlds that differ by ray, taken as for lighting"
WORLD_VOLUME = "World volumes left out"


class Backdrop:
    """What only the camera sees of a world: a colour, or an image turned by a rotation."""

    def __init__(self, colour, rotation):
        self.factor, self.rotation = np.maximum(colour.factor, 0), rotation
        self.texels = None if colour.picture is None else colour.picture.linear()

    def seen(self, camera, width, height, tile):
        """(h, w, 3) of a rectangle of the image; the middle of each pixel, as scene/camera.cpp has its rays."""
        x0, y0, x1, y1 = tile
        if self.texels is None:
            return np.broadcast_to(self.factor, (y1 - y0, x1 - x0, 3))
        axes = np.array(camera.to_world, np.float64).reshape(3, 4)[:, :3]
        sx = ((np.arange(x0, x1) + 0.5 - 0.5 * width) * camera.pixel_aspect / height + camera.shift[0])[None, :, None]
        sy = (0.5 - (np.arange(y0, y1) + 0.5) / height + camera.shift[1])[:, None, None]
        scale = 0 if camera.orthographic else 2 * np.tan(camera.fov_y / 2)
        directions = (axes[:, 0] * sx + axes[:, 1] * sy) * scale - axes[:, 2] if not camera.panorama else \
            panoramic(camera, axes, (np.arange(x0, x1) + 0.5) / width, 1 - (np.arange(y0, y1) + 0.5) / height)
        x, y, z = np.moveaxis(directions @ self.rotation.T, -1, 0)
        rows, columns = self.texels.shape[:2]
        u = (0.5 - np.arctan2(y, x) / (2 * np.pi)) * columns - 0.5
        v = (0.5 - np.arctan2(z, np.hypot(x, y)) / np.pi) * rows - 0.5
        left, top = np.floor(u).astype(int), np.floor(v).astype(int)
        fu, fv = (u - left)[..., None], (v - top)[..., None]
        a, b = (self.texels[np.clip(top + k, 0, rows - 1), left % columns] * (1 - fu) +
                self.texels[np.clip(top + k, 0, rows - 1), (left + 1) % columns] * fu for k in (0, 1))
        return self.factor * (a * (1 - fv) + b * fv)


def panoramic(camera, axes, u, v):
    """(h, w, 3) directions of a panorama, as scene/camera.cpp has them; beyond a fisheye's edge those of the edge."""
    u, v = u[None, :] + camera.shift[0], v[:, None] + camera.shift[1]
    if camera.panorama == library.EQUIRECTANGULAR:
        west, east = camera.longitude
        low, high = camera.latitude
        along, up = west + (east - west) * u, low + (high - low) * v
        ahead, right, up = np.cos(along) * np.cos(up), np.sin(along) * np.cos(up), np.sin(up) + 0 * u
    elif camera.panorama == library.EQUIANGULAR_CUBE:
        right, up = np.tan((u - 0.5) * np.pi / 2) + 0 * v, np.tan((v - 0.5) * np.pi / 2) + 0 * u
        length = np.sqrt(1 + right ** 2 + up ** 2)
        ahead, right, up = 1 / length, right / length, up / length
    elif camera.panorama == library.MIRROR_BALL:
        x, y = 2 * u - 1 + 0 * v, 2 * v - 1 + 0 * u
        cosine = np.sqrt(np.maximum(0, 1 - x ** 2 - y ** 2))
        ahead, right, up = 2 * cosine ** 2 - 1, 2 * cosine * x, 2 * cosine * y
    else:
        equisolid = camera.panorama == library.FISHEYE_EQUISOLID
        x, y = (u - 0.5) * (camera.sensor[0] if equisolid else 2), (v - 0.5) * (camera.sensor[1] if equisolid else 2)
        r = np.maximum(np.hypot(x, y), 1e-12)
        angle = 2 * np.arcsin(np.minimum(1, r / (2 * camera.fisheye_lens))) if equisolid else \
            np.minimum(1, r) * camera.fisheye_fov / 2
        ahead, right, up = np.cos(angle), x / r * np.sin(angle), y / r * np.sin(angle)
    return ahead[..., None] * -axes[:, 2] + right[..., None] * axes[:, 0] + up[..., None] * axes[:, 1]


def convert_world(world, materials, report, bake=None):
    """(library.Environment, or None for black; [(name, library.Light)] of suns that were in it; Backdrop or None).

    `bake(world)` renders what cannot be read, see sky.py: it gives None where that is not to be had now."""
    if world is None:
        return None, [], None
    own, backdrop = Report(), None
    colour, rotation, by_camera = _read_world(world, materials, own)
    if by_camera:
        of_camera = Report()
        found = _read_world(world, materials, of_camera, camera=True)
        if set(of_camera.texts()) <= {WORLD_VOLUME}:
            backdrop = Backdrop(*found[:2])
        else:
            own.note(f"{world.name} (Light Path)", BY_RAY)
    baked, suns = None, []
    if bake is not None and any(text not in {BY_RAY, WORLD_VOLUME} for text in own.texts()):
        try:
            baked = bake(world)
        except sky.BakeError as reason:
            report.note(f"{world.name} ({reason})", "Worlds that Cycles could not render into an image")
    if baked is None:
        report.take(own)
    else:
        height, width = baked.pixels.shape[:2]
        report.note(world.name, f"Worlds rendered by Cycles into an image of {width} x {height}")
        report.take(own, {BY_RAY, WORLD_VOLUME})
        picture = Picture(f"{world.name} sky", (world.name_full, "baked", id(baked)), Mapping(), 0, linear=baked.pixels)
        colour, rotation = Value(1, picture if baked.pixels.any() else None), np.eye(3)
        if colour.picture is None:
            colour = Value(0)
        for towards, irradiance, angle in baked.suns:
            most = float(irradiance.max())
            sun = library.Light(type=library.SUN, unit=library.WATT, value=most, radius=angle / 2)
            sun.color[:] = [float(c) / most for c in irradiance]
            sun.direction[:] = [-float(c) for c in towards]
            suns.append((f"{world.name} sun", sun))
    environment = library.Environment()
    environment.color[:] = [max(0.0, float(c)) for c in colour.factor]
    if not any(environment.color):
        return None, suns, backdrop
    if colour.picture is not None:
        environment.texture = materials.picture_number(colour.picture)
        environment.world_to_map[:] = [float(v) for v in rotation.reshape(9)]
    return environment, suns, backdrop


def _read_world(world, materials, report, camera=False):
    """(radiance, rotation of its image, whether the camera sees another) as the nodes say, where they can be followed."""
    if not compat.has_nodes(world):
        return Value([max(0.0, float(c)) for c in world.color]), np.eye(3), False
    reader = WorldReader(world.name, materials.images, report)
    reader.of_camera = camera
    output = world.node_tree.get_output_node("CYCLES") or world.node_tree.get_output_node("ALL")
    node, stack = None, ()
    if output is not None:
        if output.inputs["Volume"].is_linked:
            reader.note("", WORLD_VOLUME)
        node, stack = reader.background(output.inputs["Surface"], ())
    if node is None:
        return Value(0), np.eye(3), reader.by_camera
    if node.type != "BACKGROUND":
        reader.note(node.bl_label, "Shaders of worlds other than Background left out")
        return Value(0), np.eye(3), reader.by_camera
    colour = reader.multiply(reader.value(node.inputs["Color"], stack), reader.value(node.inputs["Strength"], stack))
    rotation = reader.rotation if colour.picture is not None and reader.rotation is not None else np.eye(3)
    return colour, rotation, reader.by_camera


class WorldReader(Directions):
    """Environment textures, and the rotation that their vector has."""

    plain = (("TEX_COORD", "Generated"), ("TEX_COORD", "Object"), ("NEW_GEOMETRY", "Position"))

    def __init__(self, *arguments):
        super().__init__(*arguments)
        self.rotation = None  # not met yet
        self.of_camera = self.by_camera = False  # whether the camera's rays are meant; whether that makes a difference

    def background(self, socket, stack):
        """(the shader's node, stack), through mixes that take one side alone."""
        node, _, stack = self.source(socket, stack)
        while node is not None and node.type == "MIX_SHADER":
            factor = self.value(node.inputs[0], stack)
            if factor.picture is not None or not (factor.factor[0] <= 0 or factor.factor[0] >= 1):
                break
            node, _, stack = self.source(node.inputs[2 if factor.factor[0] >= 1 else 1], stack)
        return node, stack

    def _tex_environment(self, node, output, stack):
        if node.image is None:
            self.note(node.name, "Image textures without an image, taken as black")
            return Value(0)
        read = self.images.pixels(node.image, node.image_user)
        if read is None:
            return Value((1, 0, 1))
        if node.projection != "EQUIRECTANGULAR":
            self.note(node.image.name, "Mirror-ball skies, taken as equirectangular")
        rotation = self.direction(node.inputs["Vector"], stack)
        if rotation is None:
            self.note(node.image.name, "Skies on unknown coordinates, taken as unturned")
        elif self.rotation is not None and not np.allclose(rotation, self.rotation):
            self.note(node.image.name, "Skies of several rotations, all turned as the first")
        else:
            self.rotation = rotation

        def stored():
            texels, srgb = read
            return texels[..., :3] if texels.dtype == np.uint8 else np.maximum(texels[..., :3], 0), srgb

        return Value(1, Picture(node.image.name, (self.images.key(node.image, node.image_user), "sky"), Mapping(), 0, stored=stored))

    def _tex_sky(self, node, output, stack):
        self.note(f"Sky Texture ({node.sky_type.lower()})", "Procedural skies taken as an even pale blue")
        return Value((0.3, 0.45, 0.7))

    def _light_path(self, node, output, stack):
        if output.name == "Is Camera Ray":
            self.by_camera = True
            return Value(float(self.of_camera))
        self.note("Light Path", BY_RAY)
        return Value(0.0)
