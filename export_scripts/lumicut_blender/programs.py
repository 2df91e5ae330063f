# SPDX-License-Identifier: Apache-2.0
"""Node trees to the library's texture programs: whatever is neither constant nor an image worked on texel by texel.

An Expr is a node of an expression without loops; equal ones are one. It becomes a flat list of instructions at last.
Numbers, vectors and colours are all three numbers; a single one stands in all three.
"""
import math

import numpy as np

from .lumicut import library
from .compat import NORMAL_MAPS_BY_SLOPE, NORMALS_BY_COFACTORS
from .images import Picture
from .mappings import Mapping
from .scene_data import Program

OP = {name: number for number, name in enumerate(library.PROGRAM_OPS)}
MATH = {name: number for number, name in enumerate((
    "ADD SUBTRACT MULTIPLY DIVIDE MULTIPLY_ADD POWER LOGARITHM SQRT INVERSE_SQRT ABSOLUTE EXPONENT MINIMUM MAXIMUM LESS_THAN "
    "GREATER_THAN SIGN COMPARE SMOOTH_MIN SMOOTH_MAX ROUND FLOOR CEIL TRUNC FRACT MODULO FLOORED_MODULO WRAP SNAP PINGPONG SINE "
    "COSINE TANGENT ARCSINE ARCCOSINE ARCTANGENT ARCTAN2 SINH COSH TANH RADIANS DEGREES").split())}
VECTOR = {name: number for number, name in enumerate((
    "ADD SUBTRACT MULTIPLY DIVIDE MULTIPLY_ADD CROSS_PRODUCT PROJECT REFLECT REFRACT FACEFORWARD DOT_PRODUCT DISTANCE LENGTH SCALE "
    "NORMALIZE ABSOLUTE MINIMUM MAXIMUM FLOOR CEIL FRACTION MODULO WRAP SNAP SINE COSINE TANGENT").split())}
BLEND = {name: number for number, name in enumerate((
    "MIX DARKEN MULTIPLY BURN LIGHTEN SCREEN DODGE ADD OVERLAY SOFT_LIGHT LINEAR_LIGHT DIFFERENCE EXCLUSION SUBTRACT DIVIDE HUE "
    "SATURATION COLOR VALUE").split())}
METRICS = ("EUCLIDEAN", "MANHATTAN", "CHEBYCHEV", "MINKOWSKI")
FEATURES = ("F1", "F2", "SMOOTH_F1", "DISTANCE_TO_EDGE", "N_SPHERE_RADIUS")
GRADIENTS = ("LINEAR", "QUADRATIC", "EASING", "DIAGONAL", "RADIAL", "QUADRATIC_SPHERE", "SPHERICAL")
FRACTALS = {"FBM": 0, "MULTIFRACTAL": 1, "HYBRID_MULTIFRACTAL": 2, "RIDGED_MULTIFRACTAL": 3, "HETERO_TERRAIN": 4}
TABLE = 256  # steps of curves and ramps, as Cycles has them
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])

MOST_INSTRUCTIONS = 1024  # of the library
DEEPEST = 150  # nodes in a row: Python's own stack ends some way beyond


class NeedsProgram(Exception):
    """Neither a constant nor an image."""


class CannotCompile(Exception):
    """No program can compute it; the text names what."""


def whole(x):
    return np.broadcast_to(np.asarray(x, float), (3,))


_keys = {}  # numbers of what expressions are, so that telling two apart takes no walk through them


class Expr:
    """`data`: what an operation reads: an attribute (a tuple that names it), a Picture or table numbers.
    `mean`: about its mean, for decisions that need one number."""
    __slots__ = ("op", "mode", "inputs", "data", "mean", "key")

    def __init__(self, op, mode=0, inputs=(), data=None, mean=0.5, value=None):
        self.op, self.mode, self.inputs, self.data = op, mode, tuple(inputs), data
        self.mean = np.nan_to_num(np.array(whole(mean if value is None else value), float))
        kept = data if not isinstance(data, Picture) else ("picture", data.key)
        what = (op, mode, tuple(i.key for i in self.inputs), kept) if op else ("constant", tuple(self.mean.tolist()))
        self.key = _keys.setdefault(what, len(_keys))

    def constant(self):
        return self.op is None

    def is_number(self, x):
        return self.op is None and (self.mean == x).all()


def const(x):
    return Expr(None, value=np.asarray(x, np.float32).astype(float))


ZERO, ONE, HALF = const(0), const(1), const(0.5)


def number_math(mode, a, b=ZERO, c=ZERO):
    """The operation of that name on numbers; of constants their result, where it is simple."""
    x, y, z = (float(v.mean[0]) for v in (a, b, c))
    simple = {"ADD": x + y, "SUBTRACT": x - y, "MULTIPLY": x * y, "DIVIDE": x / y if y else 0.0, "MULTIPLY_ADD": x * y + z,
              "MINIMUM": min(x, y), "MAXIMUM": max(x, y), "ABSOLUTE": abs(x), "LESS_THAN": float(x < y), "GREATER_THAN": float(x > y)}
    if mode in simple and all(v.constant() for v in (a, b, c)):
        return const(simple[mode])
    if mode == "POWER" and 0 <= x <= 1 and 0 <= y < 100:
        simple["POWER"] = x ** y
    return Expr("math", MATH[mode], (a, b, c), mean=simple.get(mode, 0.5))


def vector_math(mode, a, b=ZERO, c=ZERO):
    x, y, z = a.mean, b.mean, c.mean
    simple = {"ADD": lambda: x + y, "SUBTRACT": lambda: x - y, "MULTIPLY": lambda: x * y, "SCALE": lambda: x * y[0],
              "MULTIPLY_ADD": lambda: x * y + z, "MINIMUM": lambda: np.minimum(x, y), "MAXIMUM": lambda: np.maximum(x, y)}
    mean = simple[mode]() if mode in simple else 0.5
    if mode in simple and all(v.constant() for v in (a, b, c)):
        return const(mean)
    if mode == "MULTIPLY" and (a.is_number(1) or b.is_number(1)):
        return b if a.is_number(1) else a
    if mode == "SCALE" and b.is_number(1):
        return a
    if mode == "ADD" and (a.is_number(0) or b.is_number(0)):
        return b if a.is_number(0) else a
    return Expr("vector", VECTOR[mode], (a, b, c), mean=mean)


def grey(a, mode=0):
    mean = float(a.mean @ LUMINANCE) if mode == 0 else float(a.mean.mean())
    return const(mean) if a.constant() else Expr("grey", mode, (a,), mean=mean)


def separate(a, k):
    if a.op == "combine":
        return a.inputs[k]
    return const(a.mean[k]) if a.constant() else Expr("separate", k, (a,), mean=a.mean[k])


def combine(x, y, z):
    parts = (x, y, z)
    mean = [p.mean[0] for p in parts]
    return const(mean) if all(p.constant() for p in parts) else Expr("combine", 0, parts, mean=mean)


def clamp(a, low=ZERO, high=ONE, mode=0):
    parts = (a, low, high)
    mean = np.clip(a.mean, np.minimum(low.mean, high.mean), np.maximum(low.mean, high.mean))
    return const(mean) if all(p.constant() for p in parts) else Expr("clamp", mode, parts, mean=mean)


def mix(f, a, b, blend="MIX"):
    if blend == "MIX" and f.constant() and (f.is_number(0) or f.is_number(1)):
        return b if f.is_number(1) else a
    share = float(f.mean[0])
    means = {"MULTIPLY": a.mean * b.mean, "ADD": a.mean + b.mean, "SUBTRACT": a.mean - b.mean}
    mean = a.mean * (1 - share) + share * means.get(blend, b.mean)
    if blend == "MIX" and all(p.constant() for p in (f, a, b)):
        return const(mean)
    return Expr("mix", BLEND[blend], (f, a, b), mean=mean)


def complement(a):
    return vector_math("SUBTRACT", ONE, a)


def normalize(a):
    return vector_math("NORMALIZE", a)


UV_ACTIVE = ("uv", "")
OWNERS = {"GEOMETRY": "layer", "OBJECT": "property", "INSTANCER": "instancer"}  # of attributes, by the node's type
POSITION, NORMAL, TRUE_NORMAL = Expr("position", mean=0), Expr("normal", 0, mean=0), Expr("normal", 1, mean=0)
TO_VIEWER, BEHIND = Expr("to_viewer", mean=0), Expr("behind", mean=0)


def attribute(name, mode=0, mean=0.5):
    return Expr("attribute", mode, data=name, mean=mean)


def ramp_of(x, table, steps=False):
    """`table`: (n, 3)."""
    table = np.asarray(table, np.float32)
    return Expr("ramp", int(steps), (x,), tuple(table.ravel().tolist()), mean=table.mean(0))


def channelwise(a, fn, low=0.0, high=1.0):
    """fn over each channel, from a table."""
    values = np.array(fn(np.repeat(np.linspace(low, high, TABLE + 1)[:, None], 3, 1)), np.float32)
    values = np.broadcast_to(values, (TABLE + 1, 3))
    return Expr("curves", 0, (ONE, a), (low, high, *values.ravel().tolist()), mean=fn(np.clip(a.mean, low, high)))


def image(picture, at, mode=0, blend=ZERO, normal=ZERO):
    return Expr("image", mode, (at, blend, normal), picture, mean=picture.mean())


def of_picture(picture):
    """A picture as a value of its place."""
    if isinstance(picture, ProgramPicture):
        return picture.expr
    if picture.is_by_view():
        linear = picture.linear()[0]
        half = len(linear) // 2
        cosine = number_math("ABSOLUTE", vector_math("DOT_PRODUCT", NORMAL, TO_VIEWER))
        return mix(BEHIND, ramp_of(cosine, linear[half:]), ramp_of(cosine, linear[:half][::-1]))
    m = picture.mapping
    base = attribute(("generated",)) if m.source == "GENERATED" else attribute(("uv", m.uv_map))
    (a, b, c), (d, e, f) = m.matrix
    if m.matrix != ((1, 0, 0), (0, 1, 0)):
        base = Expr("transform", 0, (base,), (a, b, 0, c, d, e, 0, f, 0, 0, 1, 0))
    return image(picture, base)


def mapped_normal(colour, strength, uv_map):
    """The normal that a tangent-space colour gives."""
    if NORMAL_MAPS_BY_SLOPE and not strength.is_number(1):
        share = clamp(strength)
        n = vector_math("MULTIPLY", vector_math("MULTIPLY_ADD", colour, const(2), const(-1)), combine(strength, strength, share))
        n = vector_math("ADD", n, combine(ZERO, ZERO, complement(share)))
        colour, strength = vector_math("MULTIPLY_ADD", n, HALF, HALF), ONE
    return Expr("normal_map", 1, (colour, strength), ("tangent", uv_map), mean=0)


def bump_of(height, moved, width):
    """The normal that a displacement by height gives. `moved`: of vertices too, from where the height is looked up."""
    if moved:
        before = Expr("transform", 0, (attribute(("undisplaced",)),), ("object_to_world",), mean=0)
        height = replaced(height, {POSITION.key: before}, {})
    return Expr("bump", 0, (height, ONE, ONE, NORMAL, const(width)), mean=0)


def replaced(expr, table, data):
    """The same expression with others for some of those that it is made of, and other data for some of its operations'."""
    done = {}
    for part in in_order(expr):
        inputs = [done.get(i.key, i) for i in part.inputs]
        read = data.get(part.data, part.data) if isinstance(part.data, tuple) else part.data
        done[part.key] = table.get(part.key) or Expr(part.op, part.mode, inputs, read, part.mean)
    return done.get(expr.key, expr)


def in_order(expr):
    """Each that it is made of but the constants, once, after its inputs."""
    found, entered, stack = {}, set(), [expr]
    while stack:
        top = stack[-1]
        if top.constant() or top.key in found:
            stack.pop()
        elif top.key in entered:
            found[top.key] = top
            stack.pop()
        else:
            entered.add(top.key)
            stack.extend(reversed(top.inputs))
    return list(found.values())


def program_of(name, expr):
    """Raises CannotCompile for one that is too long."""
    if len(in_order(expr)) > MOST_INSTRUCTIONS:
        raise CannotCompile(f"Trees of more than {MOST_INSTRUCTIONS} operations")
    return ProgramPicture(name, expr)


class ProgramPicture:
    """A program where a Picture may stand: its texels are not known."""
    flags = 0
    mapping = Mapping()

    def __init__(self, name, expr):
        self.name, self.expr, self.key = name, expr, ("program", expr.key)

    def mean(self):
        return self.expr.mean

    def is_by_view(self):
        return False

    def is_byte(self):
        return False

    def is_grey(self):
        return False

    def attributes(self):
        """What its meshes must bring."""
        return [e.data for e in in_order(self.expr) if isinstance(e.data, tuple) and e.data and isinstance(e.data[0], str)]

    def compiled(self, picture_number, attribute_number):
        """scene_data.Program: numbers of images and attributes come from the functions."""
        rows, constants, table = [], {}, []
        places, tables = {}, {}

        def operand(expr):
            if expr.constant():
                return -1 - constants.setdefault(tuple(expr.mean.tolist()), len(constants))
            return places[expr.key]

        def emit(expr):
            row = np.zeros(12, np.int32)
            row[0], row[1] = OP[expr.op], expr.mode
            for k, i in enumerate(expr.inputs):
                row[2 + k] = operand(i)
            if isinstance(expr.data, Picture):
                row[10] = picture_number(expr.data)
            elif expr.data and isinstance(expr.data[0], str):
                row[10] = attribute_number(expr.data)
            elif expr.data:
                if expr.data not in tables:
                    tables[expr.data] = len(table)
                    table.extend(expr.data)
                row[10], row[11] = tables[expr.data], len(expr.data)
            rows.append(row)
            places[expr.key] = len(rows) - 1

        for expr in in_order(self.expr):
            emit(expr)
        if not rows:
            emit(Expr("vector", VECTOR["ADD"], (self.expr, ZERO, ZERO)))
        values = np.array(list(constants), np.float32).reshape(-1, 3)
        return Program(self.name, np.array(rows, np.int32), values, np.array(table, np.float32))


def input_named(node, *names):
    for name in names:
        found = next((s for s in node.inputs if s.name == name and s.enabled), None)
        if found is not None:
            return found
    return None


class Compiler:
    """Follows the sockets of one material by its reader (materials.SurfaceReader), which knows links, images and notes."""

    def __init__(self, reader):
        self.reader = reader
        self.known = {}
        self.depth = 0

    def socket(self, socket, stack):
        """Value of an input as its own kind: number, vector or colour."""
        node, output, inner = self.reader.source(socket, stack)
        if node is None:
            return self.default(output)
        self.reader.images.check()
        return self.as_kind(self.node(node, output, inner), output.type, socket.type)

    @staticmethod
    def default(socket):
        value = getattr(socket, "default_value", 0.0)
        if isinstance(value, (int, float, bool)):
            return const(float(value))
        try:
            return const([float(x) for x in value][:3])
        except (TypeError, ValueError):
            return ZERO

    @staticmethod
    def as_kind(expr, kind, wanted):
        if wanted in ("VALUE", "INT", "BOOLEAN"):
            return grey(expr) if kind == "RGBA" else grey(expr, 1) if kind == "VECTOR" else expr
        return expr

    def node(self, node, output, stack):
        key = (node.as_pointer(), output.identifier, tuple(g.as_pointer() for g in stack), self.reader.ray)
        if key not in self.known:
            handler = getattr(self, "_" + node.type.lower(), None)
            if handler is None:
                raise CannotCompile(node.bl_label or node.type)
            self.depth += 1
            try:
                if self.depth > DEEPEST:
                    raise CannotCompile(f"Trees deeper than {DEEPEST} nodes")
                self.known[key] = handler(node, output, stack)
            finally:
                self.depth -= 1
        return self.known[key]

    def get(self, node, stack, *names):
        """An input's value by its name, or by its number."""
        socket = node.inputs[names[0]] if isinstance(names[0], int) else input_named(node, *names)
        return ZERO if socket is None else self.socket(socket, stack)

    def note(self, what, text):
        self.reader.note(what, text)

    # ---- Coordinates --------------------------------------------------------------------------------------------

    def vector(self, node, stack, otherwise=None):
        socket = node.inputs.get("Vector")
        if socket is not None and socket.enabled and socket.is_linked:
            source, _, _ = self.reader.source(socket, stack)
            if source is not None:
                return self.socket(socket, stack)
        return attribute(("generated",)) if otherwise is None else otherwise

    def to_object(self, ob, mode, value):
        if ob is None:
            return Expr("transform", mode, (value,), ("world_to_object",), mean=0)
        m = np.array(ob.matrix_world.inverted_safe(), np.float32)[:3]
        return Expr("transform", mode, (value,), tuple(m.ravel().tolist()), mean=0)

    def _tex_coord(self, node, output, stack):
        name = output.name
        if getattr(node, "from_instancer", False) and name in ("Generated", "UV"):
            raise CannotCompile("Texture Coordinate of instancers")
        if name == "Generated":
            return attribute(("generated",))
        if name == "UV":
            return attribute(UV_ACTIVE)
        if name == "Object":
            return self.to_object(node.object, 0, POSITION)
        if name == "Normal":
            return normalize(self.to_object(None, 2, NORMAL))
        if name == "Camera":
            return vector_math("SCALE", Expr("camera", 1, mean=0), Expr("camera", 3, mean=1))
        if name == "Window":
            return self.window()
        if name == "Reflection":
            return vector_math("SCALE", vector_math("REFLECT", TO_VIEWER, NORMAL), const(-1))
        raise CannotCompile(f"Texture Coordinate: {name}")

    def window(self):
        return vector_math("MULTIPLY_ADD", Expr("camera", 0, mean=0), const((1 / self.reader.aspect, 1, 0)), const((0.5, 0.5, 0)))

    def _uvmap(self, node, output, stack):
        if getattr(node, "from_instancer", False):
            raise CannotCompile("UV maps of instancers")
        return attribute(("uv", node.uv_map))

    def _new_geometry(self, node, output, stack):
        name = output.name
        known = {"Position": POSITION, "Normal": NORMAL, "True Normal": TRUE_NORMAL, "Incoming": TO_VIEWER, "Backfacing": BEHIND}
        if name in known:
            return known[name]
        if name == "Random Per Island":
            return attribute(("island",))
        raise CannotCompile(f"Geometry: {name}")

    def _object_info(self, node, output, stack):
        kinds = {"Location": 0.0, "Color": 0.5, "Alpha": 1.0, "Object Index": 0.0, "Random": 0.5}
        if output.name == "Material Index":
            return const(float(self.reader.material_index))
        if output.name == "Alpha":
            return attribute(("object", "Color"), 1, 1.0)
        if output.name not in kinds:
            raise CannotCompile(f"Object Info: {output.name}")
        return attribute(("object", output.name), 0, kinds[output.name])

    def _particle_info(self, node, output, stack):
        if output.name != "Random":
            raise CannotCompile(f"Particle Info: {output.name}")
        return attribute(("object", "Random"))

    def _hair_info(self, node, output, stack):
        if output.name == "Tangent Normal":
            raise CannotCompile("Curves Info: Tangent Normal")
        return attribute(("strand", output.name), 0, {"Is Strand": 1.0, "Length": 0.0, "Thickness": 0.0}.get(output.name, 0.5))

    def _vertex_color(self, node, output, stack):
        return attribute(("layer", node.layer_name), int(output.name == "Alpha"), 1.0 if output.name == "Alpha" else 0.5)

    def _attribute(self, node, output, stack):
        kind = getattr(node, "attribute_type", "GEOMETRY")
        if kind not in OWNERS:
            raise CannotCompile(f"Attribute of the {kind.lower().replace('_', ' ')}")
        name = OWNERS[kind], node.attribute_name
        if output.name == "Alpha":
            return attribute(name, 1, 1.0)
        return grey(attribute(name), 1) if output.name == "Fac" else attribute(name)

    def _camera(self, node, output, stack):
        modes = {"View Vector": 1, "View Z Depth": 2, "View Distance": 3}
        return Expr("camera", modes[output.name], mean=1)

    def _light_path(self, node, output, stack):
        if output.name == "Ray Length" and self.reader.ray == "camera":
            self.reader.by_ray = True
            return Expr("camera", 3, mean=1)
        return const(self.reader._light_path(node, output, stack).factor)

    def _value(self, node, output, stack):
        return const(float(node.outputs[0].default_value))

    def _rgb(self, node, output, stack):
        return const(list(node.outputs[0].default_value)[:3])

    def _normal(self, node, output, stack):
        n = normalize(const(list(node.outputs[0].default_value)))
        return n if output.name == "Normal" else vector_math("DOT_PRODUCT", normalize(self.get(node, stack, "Normal")), n)

    # ---- By the view --------------------------------------------------------------------------------------------

    def normal_input(self, node, stack, name="Normal"):
        socket = node.inputs.get(name)
        if socket is None or not socket.is_linked or self.reader.source(socket, stack)[0] is None:
            return self.reader.base_normal
        return self.socket(socket, stack)

    def _fresnel(self, node, output, stack):
        return Expr("fresnel", 0, (self.get(node, stack, "IOR"), self.normal_input(node, stack)), mean=0.1)

    def _layer_weight(self, node, output, stack):
        mode = 1 if output.name == "Fresnel" else 2
        return Expr("fresnel", mode, (self.get(node, stack, "Blend"), self.normal_input(node, stack)), mean=0.2)

    def _bump(self, node, output, stack):
        distance = self.get(node, stack, "Distance")
        if node.invert:
            distance = number_math("MULTIPLY", distance, const(-1))
        # Of newer Blender: a share of a pixel.
        width = number_math("MULTIPLY", self.get(node, stack, "Filter Width"), const(self.reader.pixel)) if "Filter Width" in node.inputs \
            else const(self.reader.pixel)
        return Expr("bump", 0, (self.get(node, stack, "Height"), self.get(node, stack, "Strength"), distance,
                                self.normal_input(node, stack), width), mean=0)

    def _normal_map(self, node, output, stack):
        colour, strength = self.get(node, stack, "Color"), self.get(node, stack, "Strength")
        if node.space == "TANGENT":
            return mapped_normal(colour, strength, node.uv_map)
        n = vector_math("MULTIPLY_ADD", colour, const(2), const(-1))
        if node.space.startswith("BLENDER"):
            n = vector_math("MULTIPLY", n, const((1, -1, -1)))
        if node.space.endswith("OBJECT"):
            n = Expr("transform", 2, (n,), ("object_to_world",), mean=0)
        n = mix(BEHIND, normalize(n), vector_math("SCALE", normalize(n), const(-1)))
        return normalize(mix(number_math("MAXIMUM", strength, ZERO), NORMAL, n))

    def height(self, socket, stack=()):
        """(height, whether it is in the world's units) of a displacement; None: none."""
        node, _, stack = self.reader.source(socket, stack)
        if node is None:
            return None
        if node.type != "DISPLACEMENT":
            raise CannotCompile(node.bl_label)
        if node.inputs["Normal"].is_linked:
            self.note("Displacement", "Normals of displacements left out")
        height = number_math("MULTIPLY", number_math("SUBTRACT", self.get(node, stack, "Height"), self.get(node, stack, "Midlevel")),
                             self.get(node, stack, "Scale"))
        return height, node.space == "WORLD"

    # ---- Textures -----------------------------------------------------------------------------------------------

    def scaled(self, node, stack, dimensions=3):
        scale = self.get(node, stack, "Scale")
        w = number_math("MULTIPLY", self.get(node, stack, "W"), scale) if dimensions in (1, 4) else ZERO
        return vector_math("SCALE", self.vector(node, stack), scale) if dimensions > 1 else ZERO, w, scale

    def _tex_noise(self, node, output, stack):
        dimensions = int(node.noise_dimensions[0])
        at, w, _ = self.scaled(node, stack, dimensions)
        newer = hasattr(node, "noise_type")
        kind = FRACTALS[node.noise_type] if newer else 0
        lacunarity = self.get(node, stack, "Lacunarity") if newer else const(2)
        normalized = not newer or node.normalize or kind != 0
        mode = dimensions - 1 + 4 * kind + 20 * (output.name == "Color") + 40 * normalized
        return Expr("noise", mode, (at, w, self.get(node, stack, "Detail"), self.get(node, stack, "Roughness"), lacunarity,
                                    self.get(node, stack, "Offset"), self.get(node, stack, "Gain"), self.get(node, stack, "Distortion")))

    def _tex_musgrave(self, node, output, stack):
        dimensions = int(node.musgrave_dimensions[0])
        at, w, _ = self.scaled(node, stack, dimensions)
        names = ("Detail", "Dimension", "Lacunarity", "Offset", "Gain")
        return Expr("musgrave", dimensions - 1 + 4 * FRACTALS[node.musgrave_type],
                    (at, w, *(self.get(node, stack, n) for n in names)), mean=0.3)

    def _tex_voronoi(self, node, output, stack):
        dimensions = int(node.voronoi_dimensions[0])
        at, w, scale = self.scaled(node, stack, dimensions)
        what = {"Distance": 0, "Radius": 0, "Color": 1, "Position": 2, "W": 3}[output.name]
        mode = dimensions - 1 + 4 * FEATURES.index(node.feature) + 20 * METRICS.index(node.distance) + 80 * what
        settings = [self.get(node, stack, n) for n in ("Smoothness", "Exponent", "Randomness")]

        def octave(larger):
            places = (vector_math("SCALE", at, larger), number_math("MULTIPLY", w, larger))
            return Expr("voronoi", mode, (*places, *settings), mean=0.4)

        detail, normalized = input_named(node, "Detail"), getattr(node, "normalize", False)
        if detail is None or node.feature == "N_SPHERE_RADIUS":
            value = octave(ONE)
        else:
            value = self.octaves(node, stack, octave, what, self.farthest(node, dimensions, *settings[1:]) if normalized else None)
        return vector_math("DIVIDE", value, scale) if what > 1 else value

    def farthest(self, node, dimensions, exponent, randomness):
        """By which distances of a Voronoi Texture are normalized."""
        reach = number_math("MULTIPLY_ADD", clamp(randomness), const(0.5), const(0.5))
        if node.feature == "DISTANCE_TO_EDGE":
            return reach
        of_metric = {"MANHATTAN": const(dimensions), "CHEBYCHEV": ONE, "EUCLIDEAN": const(math.sqrt(dimensions)),
                     "MINKOWSKI": number_math("POWER", const(dimensions), number_math("DIVIDE", ONE, exponent))}
        if dimensions > 1:
            reach = number_math("MULTIPLY", reach, of_metric[node.distance])
        return number_math("MULTIPLY", reach, const(2)) if node.feature == "F2" else reach

    def octaves(self, node, stack, octave, what, farthest):
        """Sum of a Voronoi Texture's octaves as Blender has it since 4.0: of places and distances to edges rather a mean.
        `farthest`: what distances of one octave are divided by; None: they are not."""
        detail = self.get(node, stack, "Detail")
        if not detail.constant():
            self.note("Voronoi Texture", "Voronoi textures whose Detail is linked, with its mean")
        detail = min(15.0, max(0.0, float(detail.mean[0])))
        roughness, lacunarity = clamp(self.get(node, stack, "Roughness")), self.get(node, stack, "Lacunarity")
        edges = node.feature == "DISTANCE_TO_EDGE"
        total = const(8) if edges else ZERO
        whole, amplitude, larger = farthest if edges and farthest is not None else ZERO, ONE, ONE
        for i in range(math.ceil(detail) + 1):
            share = const(min(1.0, detail - i + 1))  # of the last one a part
            found = octave(larger)
            if edges:
                nearer = mix(amplitude, total, number_math("MINIMUM", total, number_math("DIVIDE", found, larger)))
                total = mix(share, total, nearer)
                if farthest is not None:
                    whole = mix(share, whole, mix(amplitude, whole, number_math("DIVIDE", farthest, larger)))
            else:
                if what > 1:
                    more = mix(amplitude, total, vector_math("DIVIDE", found, larger))
                else:
                    more = vector_math("ADD", total, vector_math("SCALE", found, amplitude))
                total = mix(share, total, more)
                whole = mix(share, whole, number_math("ADD", whole, amplitude))
            if detail == 0 or roughness.is_number(0):
                if edges:
                    total, whole = found, farthest
                break
            larger, amplitude = number_math("MULTIPLY", larger, lacunarity), number_math("MULTIPLY", amplitude, roughness)
        if farthest is None or what > 1:
            return total
        if not edges and what == 0:
            whole = number_math("MULTIPLY", whole, farthest)
        return vector_math("DIVIDE", total, whole)

    def _tex_wave(self, node, output, stack):
        rings = node.wave_type == "RINGS"
        direction = node.rings_direction if rings else node.bands_direction
        mode = (int(rings) + 2 * {"X": 0, "Y": 1, "Z": 2}.get(direction, 3) + 8 * {"SIN": 0, "SAW": 1, "TRI": 2}[node.wave_profile])
        names = ("Distortion", "Detail", "Detail Scale", "Detail Roughness", "Phase Offset")
        return Expr("wave", mode, (self.scaled(node, stack)[0], *(self.get(node, stack, n) for n in names)))

    def _tex_magic(self, node, output, stack):
        value = Expr("magic", node.turbulence_depth, (self.scaled(node, stack)[0], self.get(node, stack, "Distortion")))
        return value if output.name == "Color" else grey(value, 1)

    def _tex_brick(self, node, output, stack):
        names = ("Mortar Size", "Mortar Smooth", "Bias", "Brick Width", "Row Height")
        value = Expr("brick", 0, (self.scaled(node, stack)[0], *(self.get(node, stack, n) for n in names)),
                     (float(node.offset), float(node.squash), float(node.offset_frequency), float(node.squash_frequency)), mean=(0.1, 0.5, 0))
        mortar = separate(value, 0)
        if output.name == "Fac":
            return mortar
        a, b, between = (self.get(node, stack, n) for n in ("Color1", "Color2", "Mortar"))
        return mix(mortar, mix(separate(value, 1), a, b), between)

    def _tex_checker(self, node, output, stack):
        value = Expr("checker", 0, (self.scaled(node, stack)[0],))
        if output.name == "Fac":
            return value
        return mix(value, self.get(node, stack, "Color2"), self.get(node, stack, "Color1"))

    def _tex_gradient(self, node, output, stack):
        return Expr("gradient", GRADIENTS.index(node.gradient_type), (self.vector(node, stack),))

    def _tex_white_noise(self, node, output, stack):
        dimensions = int(node.noise_dimensions[0])
        at = self.get(node, stack, "Vector") if dimensions > 1 else ZERO
        w = self.get(node, stack, "W") if dimensions in (1, 4) else ZERO
        return Expr("white_noise", dimensions - 1 + 4 * (output.name == "Color"), (at, w))

    def _tex_image(self, node, output, stack):
        alpha = output.name == "Alpha"
        read = self.reader.texels(node, alpha)
        if not isinstance(read, Picture):
            return const(read.factor)
        at = self.vector(node, stack, attribute(UV_ACTIVE))
        mode = {"CLIP": 1, "MIRROR": 2}.get(node.extension, 0)
        columns, rows = self.reader.images.grid(node.image)
        if columns * rows > 1:
            mode = 1
            at = vector_math("MULTIPLY", at, const((1 / columns, 1 / rows, 0)))
        if node.projection == "BOX":
            n = normalize(self.to_object(None, 2, NORMAL))
            return image(read, at, mode + 4, const(node.projection_blend), n)
        if node.projection != "FLAT":
            at = Expr("project", 0 if node.projection == "SPHERE" else 1, (at,))
        return image(read, at, mode)

    def _tex_environment(self, node, output, stack):
        read = self.reader.texels(node, output.name == "Alpha")
        if not isinstance(read, Picture):
            return const(read.factor)
        at = self.vector(node, stack, vector_math("SCALE", POSITION, ONE))
        return image(read, Expr("project", 2 if node.projection == "EQUIRECTANGULAR" else 3, (at,)))

    # ---- Converters ---------------------------------------------------------------------------------------------

    def _math(self, node, output, stack):
        names = [self.get(node, stack, k) for k in range(min(3, len(node.inputs)))]
        if node.operation not in MATH:
            raise CannotCompile(f"Math: {node.operation}")
        value = number_math(node.operation, *names)
        return clamp(value) if node.use_clamp else value

    def _vect_math(self, node, output, stack):
        vectors = [self.socket(s, stack) for s in node.inputs if s.type == "VECTOR" and s.enabled]
        operation = node.operation
        if operation not in VECTOR:
            raise CannotCompile(f"Vector Math: {operation}")
        if operation in ("SCALE", "REFRACT"):
            scale = self.socket(node.inputs["Scale"], stack)
            return vector_math(operation, *((vectors[0], scale) if operation == "SCALE" else (*vectors[:2], scale)))
        return vector_math(operation, *vectors[:3])

    def blend(self, mode, f, a, b, clamp_factor, clamp_result):
        if mode not in BLEND:
            raise CannotCompile(f"Mix: {mode}")
        value = mix(clamp(f) if clamp_factor else f, a, b, mode)
        return clamp(value) if clamp_result else value

    def _mix_rgb(self, node, output, stack):
        return self.blend(node.blend_type, *(self.get(node, stack, k) for k in range(3)), True, node.use_clamp)

    def _mix(self, node, output, stack):
        f, a, b = (self.get(node, stack, n) for n in ("Factor", "A", "B"))
        if node.data_type == "RGBA":
            return self.blend(node.blend_type, f, a, b, node.clamp_factor, node.clamp_result)
        if node.data_type == "VECTOR" and node.factor_mode == "NON_UNIFORM":
            f = clamp(f) if node.clamp_factor else f
            return vector_math("ADD", vector_math("MULTIPLY", complement(f), a), vector_math("MULTIPLY", f, b))
        return self.blend("MIX", f, a, b, node.clamp_factor, False)

    def _clamp(self, node, output, stack):
        return clamp(*(self.get(node, stack, k) for k in range(3)), int(node.clamp_type == "RANGE"))

    def _map_range(self, node, output, stack):
        kinds = {"LINEAR": 0, "STEPPED": 1, "SMOOTHSTEP": 2, "SMOOTHERSTEP": 3}
        vector = node.data_type == "FLOAT_VECTOR"
        sockets = [s for s in node.inputs if s.enabled] if hasattr(node.inputs[0], "enabled") else list(node.inputs)
        wanted = "VECTOR" if vector else "VALUE"
        values = [self.socket(s, stack) for s in sockets if s.type == wanted]
        while len(values) < 6:
            values.append(const(4))
        return Expr("map_range", kinds[node.interpolation_type] + 4 * node.clamp + 8 * (not vector), values[:6], mean=0.5)

    def _mapping(self, node, output, stack):
        place = self.get(node, stack, "Location") if node.vector_type in ("POINT", "TEXTURE") else ZERO
        mode = {"POINT": 0, "TEXTURE": 1, "VECTOR": 2, "NORMAL": 3}[node.vector_type]
        values = [self.get(node, stack, "Vector"), place, self.get(node, stack, "Rotation"), self.get(node, stack, "Scale")]
        if mode in (0, 2) and all(v.constant() for v in values[1:]):
            if values[2].is_number(0):
                return vector_math("MULTIPLY_ADD", values[0], values[3], values[1]) if not values[1].is_number(0) \
                    else vector_math("MULTIPLY", values[0], values[3])
        return Expr("mapping", mode, values)

    def _vector_rotate(self, node, output, stack):
        kinds = {"AXIS_ANGLE": 0, "X_AXIS": 1, "Y_AXIS": 2, "Z_AXIS": 3, "EULER_XYZ": 4}
        kind = kinds[node.rotation_type]
        by = self.get(node, stack, "Rotation") if kind == 4 else self.get(node, stack, "Axis") if kind == 0 else ZERO
        return Expr("rotate", kind + 5 * node.invert, (self.get(node, stack, "Vector"), self.get(node, stack, "Center"), by,
                                                       self.get(node, stack, "Angle")))

    def _separate(self, node, output, stack):
        value = self.get(node, stack, 0)
        mode = getattr(node, "mode", "RGB")
        if mode != "RGB":
            value = Expr("color", {"HSV": 0, "HSL": 2}[mode], (value, ZERO, ZERO, ZERO))
        return separate(value, list(node.outputs).index(output))

    _separate_color = _seprgb = _sepxyz = _separate

    def _combine(self, node, output, stack):
        value = combine(*(self.get(node, stack, k) for k in range(3)))
        mode = getattr(node, "mode", "RGB")
        return value if mode == "RGB" else Expr("color", {"HSV": 1, "HSL": 3}[mode], (value, ZERO, ZERO, ZERO))

    _combine_color = _combrgb = _combxyz = _combine

    def _sephsv(self, node, output, stack):
        return separate(Expr("color", 0, (self.get(node, stack, 0), ZERO, ZERO, ZERO)), list(node.outputs).index(output))

    def _combhsv(self, node, output, stack):
        return Expr("color", 1, (combine(*(self.get(node, stack, k) for k in range(3))), ZERO, ZERO, ZERO))

    def _rgbtobw(self, node, output, stack):
        return grey(self.get(node, stack, 0))

    def _hue_sat(self, node, output, stack):
        h, s, v, f, colour = (self.get(node, stack, *n) for n in (("Hue",), ("Saturation",), ("Value",), ("Fac", "Factor"), ("Color",)))
        moved = Expr("color", 6, (colour, h, s, v), mean=colour.mean)
        return vector_math("MAXIMUM", mix(f, colour, moved), ZERO)

    def _gamma(self, node, output, stack):
        colour = self.get(node, stack, 0)
        return Expr("color", 4, (colour, self.get(node, stack, 1), ZERO, ZERO), mean=colour.mean)

    def _brightcontrast(self, node, output, stack):
        colour = self.get(node, stack, 0)
        return Expr("color", 5, (colour, self.get(node, stack, 1), self.get(node, stack, 2), ZERO), mean=colour.mean)

    def _invert(self, node, output, stack):
        f, colour = self.get(node, stack, 0), self.get(node, stack, 1)
        return mix(f, colour, complement(colour))

    def _valtorgb(self, node, output, stack):
        ramp = node.color_ramp
        table = np.array([ramp.evaluate(i / TABLE) for i in range(TABLE + 1)], np.float32)
        table = np.repeat(table[:, 3:], 3, 1) if output.name == "Alpha" else table[:, :3]
        return ramp_of(self.get(node, stack, 0), table, ramp.interpolation == "CONSTANT")

    def curves(self, node, stack, count, f, value):
        mapping = node.mapping
        mapping.initialize()
        of = [mapping.curves[k] for k in range(count)]
        places = [point.location[0] for curve in of for point in curve.points]
        low, high = min(places), max(places)
        if not high > low:
            low, high = 0.0, 1.0
        at = low + np.arange(TABLE + 1) / TABLE * (high - low)
        first = [mapping.evaluate(of[3], x) for x in at] if count == 4 else at
        columns = [[mapping.evaluate(of[min(k, count - 1)], x) for x in first] for k in range(3)]
        table = np.array(columns, np.float32).T
        return Expr("curves", int(mapping.extend == "EXTRAPOLATED"), (f, value), (low, high, *table.ravel().tolist()),
                    mean=value.mean)

    def _curve_rgb(self, node, output, stack):
        return self.curves(node, stack, 4, self.get(node, stack, 0), self.get(node, stack, 1))

    def _curve_vec(self, node, output, stack):
        return self.curves(node, stack, 3, self.get(node, stack, 0), self.get(node, stack, 1))

    def _curve_float(self, node, output, stack):
        return self.curves(node, stack, 1, self.get(node, stack, 0), self.get(node, stack, 1))

    def _blackbody(self, node, output, stack):
        from .nodes import blackbody
        kelvin = self.get(node, stack, 0)
        if kelvin.constant():
            return const(blackbody(float(kelvin.mean[0])))
        at = np.linspace(800, 12000, TABLE + 1)
        x = number_math("DIVIDE", number_math("SUBTRACT", kelvin, const(800)), const(11200))
        return ramp_of(x, [blackbody(t) for t in at])

    def _wavelength(self, node, output, stack):
        from .nodes import wavelength
        nanometres = self.get(node, stack, 0)
        if nanometres.constant():
            return const(wavelength(float(nanometres.mean[0])))
        x = number_math("DIVIDE", number_math("SUBTRACT", nanometres, const(380)), const(400))
        return ramp_of(x, [wavelength(l) for l in np.linspace(380, 780, TABLE + 1)])

    def _vect_transform(self, node, output, stack):
        value = self.get(node, stack, "Vector")
        mode = {"POINT": 0, "VECTOR": 1, "NORMAL": 2 if NORMALS_BY_COFACTORS else 1}[node.vector_type]
        spaces = node.convert_from, node.convert_to
        if "CAMERA" in spaces:
            raise CannotCompile("Vector Transform of the camera")
        if spaces[0] == spaces[1]:
            return value
        name = "world_to_object" if spaces[0] == "WORLD" else "object_to_world"
        moved = Expr("transform", mode, (value,), (name,), mean=0)
        return normalize(moved) if node.vector_type == "NORMAL" else moved
