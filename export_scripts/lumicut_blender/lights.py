# SPDX-License-Identifier: Apache-2.0
"""Lamps, in the units of the Blender that runs (docs/units.md): each type agrees with Cycles to 1 %."""
import functools
import math
import os

import bpy
import numpy as np

from . import compat, falloffs, ies, lamp_textures, sheared
from .ies import PER_CANDELA
from .lumicut import library
from .directions import Directions
from .nodes import Quiet, Value
from .programs import CannotCompile, NORMAL, vector_math
from .scene_data import Profile

MANY_BOUNCES = 32  # of lamps: fewer is a choice that shows
TYPES = {"POINT": library.POINT, "SPOT": library.SPOT, "SUN": library.SUN}
AREA_TYPES = {"SQUARE": library.RECTANGLE, "RECTANGLE": library.RECTANGLE, "DISK": library.DISK, "ELLIPSE": library.DISK}


# Measured: Cycles 3.4.1 has L = P/4A, 4.3.2 L = P/πA (P watt in all, as its name says). Versions between were not
# there to measure.
AREA_IS_LAMBERTIAN = (4, 3, 0)
# Measured against each version's Cycles: 3.x multiplies by the cosine to the axis, 4.x no longer does.
SPOT_WITHOUT_COSINE = (4, 0, 0)
# Read in the sources of both: before 4.0 lamps are disks that face each point, since then spheres, but for those of a soft
# falloff, which came with 4.1 and is what new lamps have. Measured against 3.4.1 and 4.3.2.
LAMPS_ARE_SPHERES = (4, 0, 0)
# Measured: 3.4.1 leaves a spot's scale out, 4.3.2 stretches the cone by it.
SPOTS_ARE_STRETCHED = (4, 0, 0)
# Measured: 3.4.1 interpolates IES files around the full circle, 4.3.2 takes 0 beyond 0 and 360 degrees, which makes them
# up to 1/16 brighter in their first and last interval, and files that are the same all around 1/8.
IES_WITHOUT_WRAP = (4, 3, 0)


class LampReader(Directions):
    """A lamp's own nodes. An IES texture counts as `of_ies`, and is kept beside."""

    plain = (("TEX_COORD", "Normal"),)
    base_normal, material_index = NORMAL, 0

    def __init__(self, *arguments):
        super().__init__(*arguments)
        self.of_ies, self.ies = 1.0, None  # (node, rotation)
        self.falloff = None  # of the first such node

    def _light_falloff(self, node, output, stack):
        powers = {"Quadratic": 0, "Linear": 1, "Constant": 2}
        smooth = self.number(node.inputs["Smooth"], stack, "falloff")
        self.falloff = self.falloff or falloffs.Falloff(powers[output.name], smooth)
        return Value(self.number(node.inputs["Strength"], stack, "falloff"))

    def _tex_ies(self, node, output, stack):
        if self.ies is not None and self.ies[0] != node:
            self.note(node.name, "Several IES textures in one lamp, the first taken")
            return Value(1)
        rotation = self.direction(node.inputs["Vector"], stack)
        if rotation is None:
            self.note(node.name, "IES textures on other coordinates than Normal, taken as unturned")
            rotation = np.eye(3)
        self.ies = node, rotation
        return Value(self.of_ies * self.number(node.inputs["Strength"], stack, "IES strength"))


class Notes:
    """A report that is looked at before it is told."""

    def __init__(self):
        self.found = []

    def note(self, *what):
        self.found.append(what)


def emission_of(light, images, report):
    """Colour times strength of a lamp's own nodes, 1 where it has none; its IES texture, (node, rotation) or None; what
    makes a program of the nodes, or None where they are a constant; and its Falloff, or None."""
    if not compat.has_nodes(light):
        return np.ones(3), None, None, None
    told, report = report, Notes()
    reader = LampReader(light.name, images, report)
    output = light.node_tree.get_output_node("CYCLES") or light.node_tree.get_output_node("ALL")
    if output is None:
        return np.ones(3), None, None, None
    node, _, stack = reader.source(output.inputs["Surface"], ())
    if node is None:
        return np.zeros(3), None, None, None
    if node.type != "EMISSION":
        told.note(f"{light.name} ({node.bl_label})", "Shaders of lamps taken as plain emission")
        return np.ones(3), None, None, None

    def at(of_ies):
        reader.of_ies = of_ies
        v = reader.multiply(reader.value(node.inputs["Color"], stack), reader.value(node.inputs["Strength"], stack))
        if v.picture is not None:
            reader.note("", "Textures of lamps taken as their mean")
        return v.mean()

    v = at(1.0)
    if reader.ies is not None and not (np.allclose(at(2.0), 2 * v) and np.allclose(at(0.5), 0.5 * v)):
        report.note(light.name, "IES textures that nodes bend, taken as they are")
    if report.found and reader.ies is None:
        def compiled(axes, place):
            """What the nodes say of each place or direction; None, with the notes, where that is not known."""
            reader.report = Quiet()
            compiler = lamp_textures.LampCompiler(reader, light, axes, place)
            try:
                return vector_math("MULTIPLY", compiler.socket(node.inputs["Color"], stack),
                                   compiler.socket(node.inputs["Strength"], stack))
            except CannotCompile:
                for note in report.found:
                    told.note(*note)
                return None

        return np.maximum(v, 0), None, compiled, reader.falloff
    for note in report.found:
        told.note(*note)
    return np.maximum(v, 0), reader.ies, None, reader.falloff


class Profiles:
    """Measured lamps of one scene, each table kept once."""

    def __init__(self, report):
        self.report, self.items = report, []
        self.later = {}  # by the id of a converted light: (light, meshes, check) -> [library.Light] in its place
        self._tables, self._numbers = {}, {}

    def _table(self, node):
        """(name, vertical, horizontal, candela) of an IES node's file, or None with a note."""
        internal = node.mode == "INTERNAL"
        if internal:
            source = node.ies.name if node.ies is not None else ""
        else:
            source = bpy.path.abspath(node.filepath, library=node.id_data.library)
        key = internal, source
        if key not in self._tables:
            table = None

            def remark(words):
                self.report.note(f"{source}: {words}", "IES files read with a remark")

            try:
                if not source:
                    raise ies.IesError("there is none")
                if internal:
                    text = node.ies.as_string()
                else:
                    if os.path.exists(source) and not os.path.isfile(source):  # a pipe would be waited for
                        raise ies.IesError("not a plain file")
                    with open(source, encoding="latin-1") as file:
                        text = file.read()
                table = (source if internal else bpy.path.basename(source),
                         *ies.resampled(*ies.parse(text, remark), wraps=bpy.app.version < IES_WITHOUT_WRAP))
            except (ies.IesError, OSError) as reason:
                words = reason.strerror if isinstance(reason, OSError) else str(reason)
                table = f"{source or node.name} ({words})"
            self._tables[key] = table
        return key, self._tables[key]

    def add(self, name, light, node, rotation, matrix, out):
        """Gives the point lamp `out` the node's file. False where it cannot be read."""
        key, table = self._table(node)
        if isinstance(table, str):
            self.report.note(f"{name}: {table}", "Lamps whose IES file cannot be read left out")
            return False
        return self.add_table(name, light, key, table, rotation, matrix, out, "IES files")

    def add_table(self, name, light, key, table, rotation, matrix, out, what):
        """The same of a table (name, vertical, horizontal, candela) that is told apart by its key."""
        own = np.array(matrix, np.float64)[:3, :3]
        # Looked up with -z as vertical angle 0, -y as horizontal angle 0, and on towards -x: seen from above the other
        # way round than the library's, unless the lamp is mirrored.
        axes = own / np.maximum(np.linalg.norm(own, axis=0), 1e-30) @ rotation.T
        out.direction[:], out.tangent[:] = (-axes[:, 2]).tolist(), (-axes[:, 1]).tolist()
        mirrored = np.linalg.det(axes) < 0
        source, vertical, horizontal, candela = table
        if light.type == "SPOT":
            scale = stretch_of(matrix)
            vertical, horizontal, candela = _cut_cone(vertical, horizontal, candela, rotation, light, scale)
            key += (light.spot_size, light.spot_blend, tuple((rotation @ (0, 0, -1)).round(6)), tuple(scale))
            if not candela.any():
                self.report.note(f"{name}: {source}", f"{what} that give nothing within their spot's cone")
                return False
        if out.radius > 0:
            self.report.note(name, f"Lamps with {what}, taken as points without a radius")
        out.radius, out.type, out.flags = 0.0, library.POINT, out.flags & ~library.FACING_DISK
        key += (mirrored,)
        if key not in self._numbers:
            if not mirrored and len(horizontal) > 1:
                horizontal, candela = 2 * math.pi - horizontal[::-1], candela[::-1]
            self.items.append(Profile(source, vertical.astype(np.float32), horizontal.astype(np.float32),
                                      (ies.PER_CANDELA * candela).astype(np.float32)))
            self._numbers[key] = len(self.items)
        out.profile = self._numbers[key]
        return True


def stretch_of(matrix):
    """Scale of a spot's cone along its own axes, the last 1."""
    if bpy.app.version < SPOTS_ARE_STRETCHED:
        return np.ones(3)
    scale = np.linalg.norm(np.array(matrix, np.float64)[:3, :3], axis=0)
    return np.ones(3) if np.ptp(scale) <= 1e-4 * scale.max() or not scale[2] > 0 else (scale / scale[2]).round(5)


def _cut_cone(vertical, horizontal, candela, rotation, light, scale):
    """A table times the falloff of a spot that `rotation` takes to where the table is looked up, stretched by `scale`."""
    axis = rotation @ (0, 0, -1)
    half = light.spot_size / 2
    outer = math.cos(half)
    width = (1 - outer) * light.spot_blend
    along = axis[2] < -1 + 1e-6 and (scale == 1).all()  # both axes are one: the edge lies at one vertical angle
    if along:
        soft = math.acos(min(1.0, outer + width))
        finer = np.concatenate([np.linspace(soft, half, 65), np.arange(0, half, math.radians(1)), [half - 2e-5, half + 2e-5]])
    else:
        finer = np.linspace(0, math.pi, 361)
        if (scale != 1).any():  # sharp where the cone ends
            finer = np.concatenate([finer, np.linspace(0, min(math.pi, 1.02 * math.atan(math.tan(min(half, 1.55)) * scale.max())), 721)])
        if len(horizontal) < 181:
            values = candela if len(horizontal) > 1 else np.repeat(candela, 2, 0)
            old, horizontal = np.linspace(0, 2 * math.pi, 2) if len(horizontal) == 1 else horizontal, np.linspace(0, 2 * math.pi, 361)
            candela = np.stack([np.interp(horizontal, old, values[:, i]) for i in range(len(vertical))], 1)
    angles = np.unique(np.concatenate([vertical, finer]).round(6))
    angles = angles[(angles >= vertical[0]) & (angles <= vertical[-1]) & (angles <= half + 2e-5 if along else True)]
    values = np.stack([np.interp(angles, vertical, row) for row in candela])
    # As ies.py has it: -z at vertical angle 0, -y at horizontal angle 0, -x at 90 degrees.
    s, c = np.sin(angles)[None], np.cos(angles)[None]
    h = horizontal[:, None]
    own = np.stack(np.broadcast_arrays(-s * np.sin(h), -s * np.cos(h), -c), -1) @ rotation / scale
    cosine = -own[..., 2] / np.linalg.norm(own, axis=-1)
    x = np.clip((cosine - outer) / width, 0, 1) if width > 0 else (cosine > outer) * 1.0
    falloff = x * x * (3 - 2 * x)
    if bpy.app.version < SPOT_WITHOUT_COSINE:
        falloff = falloff * np.maximum(0, cosine)
    return angles, horizontal, values * falloff


def convert_light(name, light, matrix, images, report, profiles, picture_number):
    """[library.Light]: none for one that gives nothing, one of each primary colour for one that throws an image.
    `picture_number`: of a Picture among the scene's."""
    emission, of_ies, compiled, falloff = emission_of(light, images, report)
    made = _converted(name, light, matrix, images, report, profiles, picture_number, emission, of_ies, compiled)
    if falloff is not None and not falloff.plain():
        def fallen(part, meshes, check, before):
            parts = [part] if before is None else before(part, meshes, check)
            return [p for part in parts for p in falloffs.applied(name, part, light, matrix, falloff, meshes, profiles, report, check)]

        matrix = matrix.copy()
        for part in made:
            profiles.later[id(part)] = functools.partial(fallen, before=profiles.later.get(id(part)))
    return made


def settled(lamps, profiles, meshes, check):
    """[(name, library.Light)] of such, where what the lamp lights, `meshes`, decides what it is."""
    made = []
    for name, lamp in lamps:
        later = profiles.later.get(id(lamp))
        made += [(name, lamp)] if later is None else [(name, part) for part in later(lamp, meshes, check)]
    return made


def edges_of(light, m):
    """Whole edges of an area lamp, which may be oblique."""
    return m[:, 0] * light.size, m[:, 1] * (light.size_y if light.shape in {"RECTANGLE", "ELLIPSE"} else light.size)


def _converted(name, light, matrix, images, report, profiles, picture_number, emission, of_ies, compiled):
    out = _plain_light(name, light, matrix, emission if compiled is None else np.ones(3), of_ies, report, profiles)
    if out is None:
        return []
    if out.type == library.SPOT and (stretch_of(matrix) != 1).any():
        radius = out.radius
        out.radius = 0.0
        even = name, np.array([0, math.pi]), np.zeros(1), np.ones((1, 2)) / PER_CANDELA
        if compiled is None and profiles.add_table(name, light, ("stretched",), even, np.eye(3), matrix, out, "a stretched cone"):
            out.angle, out.blend, out.spot_cosine = 0.0, 0.0, 0
            if radius > 0:
                report.note(name, "Stretched spots of a radius, taken as 32 points")
            return falloffs.spread(out, radius)
        out.radius = radius
    m = np.array(matrix)[:3]
    if light.type == "AREA" and compiled is None and not m[:, 2].any():
        return sheared.without_axis(out)
    if light.type == "AREA" and sheared.is_sheared(*edges_of(light, m), m[:, 2], out.type == library.DISK):
        if compiled is None:
            sheared.apply(name, light, out, *edges_of(light, m), -m[:, 2], report, profiles)
        else:
            report.note(name, "Sheared area lamps with textures, made straight")
    if compiled is None:
        return [out]
    expr = compiled(m[:, :3] / np.maximum(np.linalg.norm(m[:, :3], axis=0), 1e-30), m[:, 3])
    own = np.array(out.color)

    def coloured(colour):
        out.color[:] = [float(c) for c in own * np.maximum(colour, 0)]
        return [out] if any(out.color) else []

    if expr is None or expr.constant():
        return coloured(emission if expr is None else expr.mean)
    if light.type == "SUN":
        return coloured(lamp_textures.of_disc(expr, np.array(out.direction), out.radius))
    if light.type == "AREA":
        colour, picture = lamp_textures.over(expr, m[:, 3], np.array(out.u), np.array(out.v), m[:, 1])
        if picture is not None:
            out.texture = picture_number(picture)
        return coloured(colour)
    vertical, horizontal, values = lamp_textures.around(expr)
    if vertical is None:
        return coloured(values)
    lights = []
    grey = np.ptp(values, axis=2).max() <= 1e-4 * values.max()
    for channel in range(1 if grey else 3):
        part = library.Light.from_buffer_copy(out)
        part.color[:] = [float(c) if grey or k == channel else 0.0 for k, c in enumerate(own)]
        table = values[..., channel]
        key = "nodes", expr.key, channel
        if not (table > 0).any() or not any(part.color):
            continue
        if profiles.add_table(name, light, key, (name, vertical, horizontal, table / PER_CANDELA), np.eye(3), matrix, part,
                              "textures by direction"):
            part.angle, part.blend, part.spot_cosine = 0.0, 0.0, 0
            lights.append(part)
    return lights


def _plain_light(name, light, matrix, emission, of_ies, report, profiles):
    """A library.Light, or None."""
    colour = np.array(light.color, np.float64) * emission
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
    if getattr(getattr(light, "cycles", None), "max_bounces", MANY_BOUNCES) < MANY_BOUNCES:
        report.note(name, "Max Bounces of lamps left out")
    m = np.array(matrix)[:3]
    # The lamp's own axes; scale is kept for areas alone.
    z = m[:, 2]
    out = library.Light(unit=library.WATT, value=value)
    out.color[:] = [float(c) for c in colour]
    if not getattr(getattr(light, "cycles", None), "cast_shadow", light.use_shadow):
        out.flags |= library.NO_SHADOWS
    out.position[:] = m[:, 3].tolist()
    forward = -z / (np.linalg.norm(z) or 1.0)
    out.direction[:] = forward.tolist()
    if of_ies is not None and light.type not in {"POINT", "SPOT"}:
        report.note(name, "IES textures of lamps other than point and spot, taken as even")
        of_ies = None
    if light.type == "AREA":
        out.type = AREA_TYPES[light.shape]
        u, v = edges_of(light, m)
        if not (np.linalg.norm(u) > 0 and np.linalg.norm(v) > 0):
            return None
        v = v - u * ((v @ u) / (u @ u))
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
    if out.radius > 0 and (bpy.app.version < LAMPS_ARE_SPHERES or getattr(light, "use_soft_falloff", False)):
        out.flags |= library.FACING_DISK
    if light.type == "SPOT":
        out.angle = min(light.spot_size, math.pi)
        out.blend = light.spot_blend
        out.spot_cosine = 1 if bpy.app.version < SPOT_WITHOUT_COSINE else 0
    if of_ies is not None:
        if not profiles.add(name, light, *of_ies, matrix, out):
            return None
        out.angle, out.blend, out.spot_cosine = 0.0, 0.0, 0
    return out
