# SPDX-License-Identifier: Apache-2.0
"""Lamps and the world, in the units of the Blender that runs (docs/units.md): each type agrees with Cycles to 1 %."""
import math

import bpy
import numpy as np
from mathutils import Euler

from . import library
from .nodes import Evaluator, Mapping, Picture, Value

TYPES = {"POINT": library.POINT, "SPOT": library.SPOT, "SUN": library.SUN}
AREA_TYPES = {"SQUARE": library.RECTANGLE, "RECTANGLE": library.RECTANGLE, "DISK": library.DISK, "ELLIPSE": library.DISK}


# Measured: Cycles 3.4.1 has L = P/4A, 4.3.2 L = P/πA (P watt in all, as its name says). Versions between were not
# there to measure.
AREA_IS_LAMBERTIAN = (4, 3, 0)


def emission_of(light, images, report):
    """Colour times strength of a lamp's own nodes; 1 where it has none."""
    if not light.use_nodes or light.node_tree is None:
        return np.ones(3)
    evaluator = Evaluator(light.name, images, report)
    output = light.node_tree.get_output_node("CYCLES") or light.node_tree.get_output_node("ALL")
    if output is None:
        return np.ones(3)
    node, _, stack = evaluator.source(output.inputs["Surface"], ())
    if node is None:
        return np.zeros(3)
    if node.type != "EMISSION":
        report.note(f"{light.name} ({node.bl_label})", "Shaders of lamps taken as plain emission")
        return np.ones(3)
    v = evaluator.multiply(evaluator.value(node.inputs["Color"], stack), evaluator.value(node.inputs["Strength"], stack))
    if v.picture is not None:
        report.note(light.name, "Textures of lamps taken as their mean")
    return np.maximum(v.mean(), 0)


def convert_light(name, light, matrix, images, report):
    """A library.Light, or None for one that gives nothing."""
    colour = np.array(light.color, np.float64) * emission_of(light, images, report)
    # 4.5 and later: exposure in stops, and a temperature that colours.
    value = light.energy * 2.0 ** getattr(light, "exposure", 0.0)
    if getattr(light, "use_temperature", False):
        colour = colour * np.array(light.temperature_color)
    if value < 0 or (colour < 0).any():
        report.note(name, "Lamps of negative power left out")
        return None
    if not value > 0 or not colour.any():
        return None
    if getattr(light, "cycles", None) is not None and getattr(light.cycles, "is_portal", False):
        return None
    if not getattr(light, "use_shadow", True):
        report.note(name, "Lamps without shadows, which cast them here")
    m = np.array(matrix)[:3]
    # The lamp's own axes; scale is kept for areas alone.
    x, y, z = m[:, 0], m[:, 1], m[:, 2]
    out = library.Light(unit=library.WATT, value=value)
    out.color[:] = [float(c) for c in colour]
    out.position[:] = m[:, 3].tolist()
    forward = -z / (np.linalg.norm(z) or 1.0)
    out.direction[:] = forward.tolist()
    if light.type == "AREA":
        out.type = AREA_TYPES[light.shape]
        height = light.size_y if light.shape in {"RECTANGLE", "ELLIPSE"} else light.size
        u, v = x * light.size, y * height
        lu = np.linalg.norm(u)
        if not (lu > 0 and np.linalg.norm(v) > 0):
            return None
        straight = v - u * (v @ u) / (lu * lu)
        if np.linalg.norm(v - straight) > 1e-3 * np.linalg.norm(v):
            report.note(name, "Sheared area lamps made straight")
        v = straight
        if np.cross(u, v) @ forward < 0:
            v = -v
        out.u[:], out.v[:] = u.tolist(), v.tolist()
        out.spread = light.spread if hasattr(light, "spread") else math.pi
        out.direction[:] = [0.0, 0.0, 0.0]
        if bpy.app.version >= AREA_IS_LAMBERTIAN:
            out.value = value * 4 / math.pi
        return out
    out.type = TYPES[light.type]
    if light.type == "SUN":
        out.radius = min(light.angle / 2, math.pi / 2)
        return out
    out.radius = light.shadow_soft_size
    if light.type == "SPOT":
        out.angle = min(light.spot_size, math.pi)
        out.blend = light.spot_blend
        # Measured against each version's Cycles: 3.x multiplies by the cosine to the axis, 4.x no longer does.
        out.spot_cosine = 1 if bpy.app.version < (4, 0, 0) else 0
    return out


def convert_world(world, materials, report):
    """A library.Environment, or None for black."""
    if world is None:
        return None
    environment = library.Environment()
    if not world.use_nodes or world.node_tree is None:
        environment.color[:] = [max(0.0, float(c)) for c in world.color]
        return environment if any(environment.color) else None
    evaluator = Evaluator(world.name, materials.images, report)
    output = world.node_tree.get_output_node("CYCLES") or world.node_tree.get_output_node("ALL")
    node, stack = None, ()
    if output is not None:
        if output.inputs["Volume"].is_linked:
            evaluator.note("world volume", "Volumes left out")
        node, _, stack = evaluator.source(output.inputs["Surface"], ())
    if node is None:
        return None
    if node.type != "BACKGROUND":
        evaluator.note(node.bl_label, "Shaders of worlds other than Background left out")
        return None
    reader = WorldReader(world.name, materials.images, report)
    colour = reader.multiply(reader.value(node.inputs["Color"], stack), reader.value(node.inputs["Strength"], stack))
    environment.color[:] = [max(0.0, float(c)) for c in colour.factor]
    if not any(environment.color):
        return None
    if colour.picture is not None:
        environment.texture = materials.picture_number(colour.picture)
        environment.world_to_map[:] = [float(v) for v in reader.rotation.reshape(9)]
    return environment


class WorldReader(Evaluator):
    """Environment textures, and the rotation that their vector has."""

    def __init__(self, *arguments):
        super().__init__(*arguments)
        self.rotation = np.eye(3)

    def direction(self, socket, stack):
        """world_to_map of a vector input; None: not followed."""
        node, output, stack = self.source(socket, stack)
        if node is None or (node.type == "TEX_COORD" and output.name in {"Generated", "Object"}):
            return np.eye(3)
        if node.type == "NEW_GEOMETRY" and output.name == "Position":
            return np.eye(3)
        if node.type == "MAPPING":
            inner = self.direction(node.inputs["Vector"], stack)
            own_values = {n: node.inputs[n] for n in ("Location", "Rotation", "Scale") if n in node.inputs}
            if inner is None or any(s.is_linked for s in own_values.values()):
                return None
            if "Location" in own_values and any(abs(c) > 1e-6 for c in own_values["Location"].default_value):
                self.note("location", "Moves and scales of the sky left out")
            if any(abs(c - 1) > 1e-6 for c in own_values["Scale"].default_value):
                self.note("scale", "Moves and scales of the sky left out")
            turn = np.array(Euler(own_values["Rotation"].default_value, "XYZ").to_matrix())
            return (turn.T if node.vector_type == "TEXTURE" else turn) @ inner
        return None

    def _tex_environment(self, node, output, stack):
        if node.image is None:
            self.note(node.name, "Image textures without an image, taken as black")
            return Value(0)
        read = self.images.pixels(node.image)
        if read is None:
            return Value((1, 0, 1))
        if node.projection != "EQUIRECTANGULAR":
            self.note(node.image.name, "Mirror-ball skies, taken as equirectangular")
        rotation = self.direction(node.inputs["Vector"], stack)
        if rotation is None:
            self.note(node.image.name, "Skies on unknown coordinates, taken as unturned")
        else:
            self.rotation = rotation

        def stored():
            texels, srgb = read
            return texels[..., :3] if texels.dtype == np.uint8 else np.maximum(texels[..., :3], 0), srgb

        return Value(1, Picture(node.image.name, (node.image.name_full, "sky"), Mapping(), 0, stored=stored))

    def _tex_sky(self, node, output, stack):
        self.note(f"Sky Texture ({node.sky_type.lower()})", "Procedural skies taken as an even pale blue")
        return Value((0.3, 0.45, 0.7))

    def _light_path(self, node, output, stack):
        self.note("Light Path", "Worlds that differ by ray, taken as for lighting")
        return Value(0.0)
