# SPDX-License-Identifier: Apache-2.0
"""Values of node trees: constants, or images on which colour nodes have worked texel by texel.

Everything is linear Rec.709. A number is a grey colour. What cannot be followed becomes a constant and a note.
"""
import math

import numpy as np

from .lumicut import library
from .images import Picture
from .mappings import Mapping, aligned, sized
from .programs import CannotCompile, NeedsProgram, ProgramPicture
from . import programs

LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)


class Value:
    """`factor` (three floats) times a picture's texels, where there is one."""

    def __init__(self, factor, picture=None):
        self.factor = np.broadcast_to(np.asarray(factor, np.float32), (3,)).copy()
        self.picture = picture

    def mean(self):
        if self.picture is None:
            return self.factor
        return self.factor * self.picture.mean()

    def scalar(self):
        return float(self.mean() @ LUMINANCE)

    def is_zero(self):
        return not self.factor.any()

    def texels(self):
        return self.factor * self.picture.linear()


ZERO, ONE = Value(0), Value(1)


VIEW_TEXELS = 128  # of a picture by view: half of them for each side


def fresnel(cosine, ior):
    """Reflectance of a dielectric's border."""
    g2 = ior * ior - 1 + cosine * cosine
    g = np.sqrt(np.maximum(g2, 0))
    a = (g - cosine) / np.maximum(g + cosine, 1e-12)
    b = (cosine * (g + cosine) - 1) / (cosine * (g - cosine) + 1)
    return np.where(g2 > 0, 0.5 * a * a * (1 + b * b), 1.0)


def input_of(node, *names):
    for name in names:
        socket = node.inputs.get(name)
        if socket is not None and socket.enabled:
            return socket
    for name in names:
        if node.inputs.get(name) is not None:
            return node.inputs[name]
    return None


def _mix_blend(blend, f, a, b):
    """Blender's blend modes on arrays of colours; None: not known here."""
    g = 1 - f
    simple = {
        "MIX": lambda: g * a + f * b,
        "ADD": lambda: a + f * b,
        "SUBTRACT": lambda: a - f * b,
        "MULTIPLY": lambda: a * (g + f * b),
        "SCREEN": lambda: 1 - (g + f * (1 - b)) * (1 - a),
        "DIVIDE": lambda: np.where(b != 0, g * a + f * a / np.where(b == 0, 1, b), a),
        "DIFFERENCE": lambda: g * a + f * np.abs(a - b),
        "DARKEN": lambda: g * a + f * np.minimum(a, b),
        "LIGHTEN": lambda: np.maximum(a, f * b),
        "OVERLAY": lambda: np.where(a < 0.5, a * (g + 2 * f * b), 1 - (g + 2 * f * (1 - b)) * (1 - a)),
    }
    return simple[blend]() if blend in simple else None


def _hsv(rgb):
    high, low = rgb.max(-1), rgb.min(-1)
    d = high - low
    safe = np.where(d == 0, 1, d)
    r, g, b = rgb[..., 0], rgb[..., 1], rgb[..., 2]
    h = np.where(high == r, (g - b) / safe % 6, np.where(high == g, (b - r) / safe + 2, (r - g) / safe + 4)) / 6
    return np.where(d == 0, 0, h), np.where(high > 0, d / np.where(high > 0, high, 1), 0), high


def _rgb(h, s, v):
    k = (np.stack([5 + h * 6, 3 + h * 6, 1 + h * 6], -1)) % 6
    return v[..., None] - (v * s)[..., None] * np.clip(np.minimum(k, 4 - k), 0, 1)


def curve_tables(mapping, count):
    """The first curves of a mapping as functions of arrays, from 256 values as Cycles has them."""
    mapping.initialize()
    curves = [mapping.curves[k] for k in range(count)]
    places = [point.location[0] for curve in curves for point in curve.points]
    low, high = min(places), max(places)
    if not high > low:
        low, high = 0.0, 1.0
    at = np.linspace(low, high, 256)

    def function(curve):
        values = np.array([mapping.evaluate(curve, x) for x in at])

        def looked_up(x):
            y = np.interp(x, at, values)
            if mapping.extend == "EXTRAPOLATED":
                y = y + np.minimum(0, x - low) * (values[1] - values[0]) / (at[1] - at[0])
                y = y + np.maximum(0, x - high) * (values[-1] - values[-2]) / (at[-1] - at[-2])
            return y

        return looked_up

    return [function(curve) for curve in curves]


def blackbody(kelvin):
    """Linear Rec.709 of a black body, luminance about 1: Kang et al. 2002's chromaticity. A few per cent from Blender's."""
    t = min(max(kelvin, 1667.0), 25000.0)
    if t < 4000:
        x = -0.2661239e9 / t**3 - 0.2343589e6 / t**2 + 0.8776956e3 / t + 0.179910
    else:
        x = -3.0258469e9 / t**3 + 2.1070379e6 / t**2 + 0.2226347e3 / t + 0.240390
    if t < 2222:
        y = -1.1063814 * x**3 - 1.34811020 * x**2 + 2.18555832 * x - 0.20219683
    elif t < 4000:
        y = -0.9549476 * x**3 - 1.37418593 * x**2 + 2.09137015 * x - 0.16748867
    else:
        y = 3.0817580 * x**3 - 5.87338670 * x**2 + 3.75112997 * x - 0.37001483
    big_x, big_z = x / y, (1 - x - y) / y
    return np.maximum(0, np.array([3.2404542 * big_x - 1.5371385 - 0.4985314 * big_z,
                                   -0.9692660 * big_x + 1.8760108 + 0.0415560 * big_z,
                                   0.0556434 * big_x - 0.2040259 + 1.0572252 * big_z]))


def wavelength(nanometres):
    """Linear Rec.709 of monochromatic light: the CIE 1931 observer by Wyman et al. 2013, a few per cent from Blender's."""
    def lobe(mean, below, above):
        d = (nanometres - mean) * (below if nanometres < mean else above)
        return math.exp(-0.5 * d * d)

    x = 0.362 * lobe(442.0, 0.0624, 0.0374) + 1.056 * lobe(599.8, 0.0264, 0.0323) - 0.065 * lobe(501.1, 0.0490, 0.0382)
    y = 0.821 * lobe(568.8, 0.0213, 0.0247) + 0.286 * lobe(530.9, 0.0613, 0.0322)
    z = 1.217 * lobe(437.0, 0.0845, 0.0278) + 0.681 * lobe(459.0, 0.0385, 0.0725)
    rgb = np.array([[3.2404542, -1.5371385, -0.4985314], [-0.9692660, 1.8760108, 0.0415560], [0.0556434, -0.2040259, 1.0572252]]) @ (x, y, z)
    return np.maximum(0, rgb / 2.52)


# Outputs of Light Path that are 1. Depths are those of the first ray of a kind.
LIGHT_PATH = {
    "camera": {"Is Camera Ray"},
    "diffuse": {"Is Diffuse Ray", "Is Reflection Ray", "Ray Depth", "Diffuse Depth"},
    "glossy": {"Is Glossy Ray", "Is Reflection Ray", "Ray Depth", "Glossy Depth"},
    "transmission": {"Is Transmission Ray", "Ray Depth", "Transmission Depth"},
    "shadow": {"Is Shadow Ray", "Ray Depth"},
}
PATH_OUTPUTS = {"Transparent Depth"}.union(*LIGHT_PATH.values())  # that a kind of ray tells


class Evaluator:
    """Follows the sockets of one material, light or world. `owner` is the name that notes carry."""

    ray = "camera"      # the kind of ray, of library.RAYS, that Light Path tells
    by_ray = False      # whether it was asked
    all_rays = False    # whether the owner asks for all kinds
    programs = False    # whether what is neither a constant nor an image may become a program
    aspect = 1.0        # of the picture, for Window coordinates
    _pending = None     # notes of an attempt to do without a program

    def __init__(self, owner, images, report):
        self.owner, self.images, self.report = owner, images, report

    def note(self, what, text):
        if self._pending is not None:
            self._pending.append((what, text))
        else:
            self.report.note(f"{self.owner} ({what})" if what else self.owner, text)

    # ---- Links --------------------------------------------------------------------------------------------------

    def source(self, socket, stack):
        """(node, its output socket, stack of groups) that feeds an input, through reroutes, groups and muted nodes.
        (None, the socket whose own value counts, stack) where nothing does."""
        for _ in range(1000):
            link = next((l for l in socket.links if l.is_valid and not getattr(l, "is_muted", False)), None) \
                if socket.is_linked else None
            if link is None:
                return None, socket, stack
            node, output = link.from_node, link.from_socket
            if node.mute and node.type not in {"GROUP_INPUT", "REROUTE"}:
                inner = next((l for l in node.internal_links if l.to_socket == output), None)
                if inner is None:
                    return None, socket, stack
                socket = inner.from_socket
            elif node.type == "REROUTE":
                socket = node.inputs[0]
            elif node.type == "GROUP":
                if node.node_tree is None:
                    return None, socket, stack
                outputs = [n for n in node.node_tree.nodes if n.type == "GROUP_OUTPUT"]
                chosen = next((n for n in outputs if n.is_active_output), outputs[0] if outputs else None)
                inner = chosen and next((s for s in chosen.inputs if s.identifier == output.identifier), None)
                if inner is None:
                    return None, socket, stack
                socket, stack = inner, stack + (node,)
            elif node.type == "GROUP_INPUT" and stack:
                outer = next((s for s in stack[-1].inputs if s.identifier == output.identifier), None)
                if outer is None:
                    return None, socket, stack
                socket, stack = outer, stack[:-1]
            else:
                return node, output, stack
        return None, socket, stack

    def value(self, socket, stack=()):
        if socket is None:
            return ZERO
        if not self.programs or self._pending is not None:
            return self._plain_value(socket, stack)
        self._pending = []
        try:
            value = self._plain_value(socket, stack)
        except NeedsProgram:
            value = None
        finally:
            notes, self._pending = self._pending, None
        if value is None:
            return self.programmed(socket, stack)
        for note in notes:
            self.note(*note)
        return value

    def programmed(self, socket, stack):
        """A program; where there is none, as if there were no programs."""
        try:
            expr = self.compiler.socket(socket, stack)
            picture = None if expr.constant() else programs.program_of(self.owner, expr)
        except CannotCompile as what:
            self.note(str(what), "Nodes taken as a constant colour")
            self.programs = False
            try:
                self.report, before = Quiet(), self.report
                try:
                    return self._plain_value(socket, stack)
                finally:
                    self.report = before
            finally:
                self.programs = True
        return Value(expr.mean) if picture is None else Value(1, picture)

    def plain_or_program(self):
        """Called where an approximation follows: leaves it to a program where there may be one."""
        if self._pending is not None:
            raise NeedsProgram

    def _plain_value(self, socket, stack):
        node, output, stack = self.source(socket, stack)
        if node is None:
            return self.constant(output)
        self.images.check()
        return self.node_value(node, output, stack)

    @staticmethod
    def constant(socket):
        default = getattr(socket, "default_value", 0.0)
        if isinstance(default, (int, float, bool)):
            return Value(float(default))
        try:
            return Value([float(x) for x in default][:3])
        except (TypeError, ValueError):
            return ZERO

    def number(self, socket, stack, what):
        """A value that must be one number: the mean of a picture, with a note."""
        v = self.value(socket, stack)
        if v.picture is not None:
            self.plain_or_program()
            self.note(what, "Textures taken as their mean")
        return v.scalar()

    # ---- Arithmetic ---------------------------------------------------------------------------------------------

    def apply(self, name, fn, *values):
        """fn over colours (..., 3), texel by texel where there are pictures."""
        pictures = [v.picture for v in values if v.picture is not None]
        if not pictures:
            return Value(fn(*(v.factor for v in values)))
        if any(isinstance(p, ProgramPicture) for p in pictures) or self.programs and self._pending is None and aligned(pictures) is None:
            return self.apply_program(name, fn, values)
        together = aligned(pictures)
        if together is not None:
            pictures = together
            laid = iter(together)
            values = [v if v.picture is None else Value(v.factor, next(laid)) for v in values]
        first = max(pictures, key=lambda p: p.linear().size)
        height, width = first.linear().shape[:2]
        arrays = []
        for v in values:
            if v.picture is None:
                arrays.append(v.factor)
            elif v.picture.mapping != first.mapping:
                self.plain_or_program()
                self.note(v.picture.name, "Textures on other coordinates than their partner's, taken as their mean")
                arrays.append(v.mean())
            else:
                arrays.append(sized(v.texels(), width, height, v.picture.ends()))
        linear = np.maximum(np.broadcast_to(fn(*arrays), (height, width, 3)), 0).astype(np.float32)
        key = (name, self.owner, id(linear))
        return Value(1, Picture(f"{self.owner} {name}", key, first.mapping, first.flags, linear=linear))

    def apply_program(self, name, fn, values):
        """The same where programs are among the values: by name, or channel by channel from a table."""
        exprs = [self.expr_of(v) for v in values]
        open_ones = [k for k, v in enumerate(values) if v.picture is not None]
        if name == "product":
            expr = programs.vector_math("MULTIPLY", *exprs)
        elif name == "sum":
            expr = programs.vector_math("ADD", *exprs)
        elif name == "grey":
            expr = programs.grey(exprs[0])
        elif name == "clip":
            expr = programs.clamp(exprs[0])
        elif name == "complement":
            expr = programs.complement(exprs[0])
        elif len(open_ones) == 1:
            at = open_ones[0]
            expr = programs.channelwise(exprs[at], lambda x: fn(*(x if k == at else v.factor for k, v in enumerate(values))))
        else:
            self.note(name, "Textures taken as their mean")
            return Value(fn(*(v.mean() for v in values)))
        if expr.constant():
            return Value(expr.mean)
        try:
            return Value(1, programs.program_of(self.owner, expr))
        except CannotCompile as what:
            self.note(str(what), "Textures taken as their mean")
            return Value(expr.mean)

    @staticmethod
    def expr_of(value):
        if value.picture is None:
            return programs.const(value.factor)
        return programs.vector_math("MULTIPLY", programs.of_picture(value.picture), programs.const(value.factor))

    def multiply(self, a, b):
        if a.picture is None:
            return Value(a.factor * b.factor, b.picture)
        if b.picture is None:
            return Value(a.factor * b.factor, a.picture)
        return self.apply("product", lambda x, y: x * y, a, b)

    def add(self, a, b):
        if a.is_zero():
            return b
        if b.is_zero():
            return a
        return self.apply("sum", lambda x, y: x + y, a, b)

    def grey(self, a):
        """As colours become numbers: by their luminance."""
        if a.picture is None:
            return Value(float(a.factor @ LUMINANCE))
        if (a.factor == a.factor[0]).all() and a.picture.is_grey():
            return a
        return self.apply("grey", lambda c: np.repeat((c @ LUMINANCE)[..., None], 3, -1), a)

    def clipped(self, a):
        """Within 0..1, with a factor that is."""
        if a.picture is not None and 0 <= a.factor.min() and a.factor.max() <= 1 and a.picture.is_byte():
            return a
        return self.apply("clip", lambda x: np.clip(x, 0, 1), a)

    def complement(self, a):
        return self.apply("complement", lambda x: 1 - x, a)

    def mix(self, f, a, b):
        if f.picture is None and not f.factor.any():
            return a
        if f.picture is None and (f.factor == 1).all():
            return b
        return self.add(self.multiply(self.complement(f), a), self.multiply(f, b))

    # ---- Nodes --------------------------------------------------------------------------------------------------

    def node_value(self, node, output, stack):
        handler = getattr(self, "_" + node.type.lower(), None)
        if handler is None:
            return self._unknown(node, output, stack)
        return handler(node, output, stack)

    def _unknown(self, node, output, stack):
        self.plain_or_program()
        kind = node.bl_label or node.type
        if node.type == "TEX_CHECKER":
            v = self.mix(Value(0.5), Value(self.value(node.inputs["Color1"], stack).mean()),
                         Value(self.value(node.inputs["Color2"], stack).mean()))
        else:
            v = Value(0.5)
        self.note(kind, "Nodes taken as a constant colour")
        return v

    def _rgb(self, node, output, stack):
        return Value(list(node.outputs[0].default_value)[:3])

    def _value(self, node, output, stack):
        return Value(float(node.outputs[0].default_value))

    def _blackbody(self, node, output, stack):
        return Value(blackbody(self.number(node.inputs[0], stack, "Blackbody temperature")))

    def by_view(self, key, fn):
        """A picture of fn(cosine to the viewer, whether seen from behind), of arrays."""
        half = VIEW_TEXELS // 2
        cosine = np.arange(half, dtype=np.float64) / (half - 1)
        grey = np.concatenate([fn(cosine, True)[::-1], fn(cosine, False)]).astype(np.float32)
        linear = np.repeat(grey[None, :, None], 3, 2)
        return Value(1, Picture(key[0], ("view", *key), Mapping("VIEW"), library.CLAMP | library.BY_VIEW, linear=linear))

    def _fresnel(self, node, output, stack):
        if node.inputs["Normal"].is_linked:
            self.plain_or_program()
        ior = max(1e-5, self.number(input_of(node, "IOR"), stack, "Fresnel"))
        return self.by_view(("Fresnel", ior), lambda c, behind: fresnel(c, 1 / ior if behind else ior))

    def _layer_weight(self, node, output, stack):
        if node.inputs["Normal"].is_linked:
            self.plain_or_program()
        blend = self.number(node.inputs["Blend"], stack, "Layer Weight")
        if output.name == "Fresnel":
            ior = 1 / max(1 - blend, 1e-5)
            return self.by_view(("Layer Weight", ior), lambda c, behind: fresnel(c, 1 / ior if behind else ior))
        blend = min(max(blend, 0.0), 1 - 1e-5)
        power = 2 * blend if blend < 0.5 else 0.5 / (1 - blend)
        return self.by_view(("Facing", power), lambda c, behind: 1 - c ** power)

    def _new_geometry(self, node, output, stack):
        if output.name == "Backfacing":
            return self.by_view(("Backfacing",), lambda c, behind: np.full_like(c, float(behind)))
        return self._unknown(node, output, stack)

    def value_for(self, ray, socket, stack):
        """As one kind of ray has it."""
        self.ray, before = ray, self.ray
        try:
            return self.value(socket, stack)
        finally:
            self.ray = before

    def _light_path(self, node, output, stack):
        self.by_ray = True
        if not self.all_rays:
            self.note("Light Path", "Nodes that depend on the ray, taken as for the camera's")
        elif output.name not in PATH_OUTPUTS:
            if output.name == "Ray Length" and self.ray == "camera":
                self.plain_or_program()  # which knows how far away the camera is
            self.note(f"Light Path: {output.name}", "Numbers of a ray's path taken as 0")
        return Value(1.0 if output.name in LIGHT_PATH[self.ray] else 0.0)

    def _gamma(self, node, output, stack):
        colour, gamma = self.value(node.inputs[0], stack), self.value(node.inputs[1], stack)
        return self.apply("gamma", lambda c, g: np.maximum(c, 0) ** g, colour, gamma)

    def _brightcontrast(self, node, output, stack):
        colour, bright, contrast = (self.value(node.inputs[i], stack) for i in range(3))
        return self.apply("contrast", lambda c, b, k: np.maximum((1 + k) * c + b - 0.5 * k, 0), colour, bright, contrast)

    def _invert(self, node, output, stack):
        f, colour = self.value(node.inputs[0], stack), self.value(node.inputs[1], stack)
        return self.apply("invert", lambda f, c: c + f * (1 - 2 * c), f, colour)

    def _hue_sat(self, node, output, stack):
        h, s, v, f = (self.number(input_of(node, n), stack, n) for n in ("Hue", "Saturation", "Value", "Fac"))

        def shift(c):
            hue, saturation, value = _hsv(np.asarray(c))
            return (1 - f) * c + f * _rgb((hue + h + 0.5) % 1, np.clip(saturation * s, 0, 1), value * v)

        return self.apply("hue", shift, self.value(input_of(node, "Color"), stack))

    def _rgbtobw(self, node, output, stack):
        return self.apply("grey", lambda c: np.repeat((c @ LUMINANCE)[..., None], 3, -1), self.value(node.inputs[0], stack))

    def _valtorgb(self, node, output, stack):
        ramp = node.color_ramp
        alpha = output.name == "Alpha"
        table = np.array([ramp.evaluate(i / 1023) for i in range(1024)], np.float32)
        table = np.repeat(table[:, 3:], 3, 1) if alpha else table[:, :3]

        def lookup(c):
            return table[np.rint(np.clip(c @ LUMINANCE, 0, 1) * 1023).astype(int)]

        return self.apply("ramp", lookup, self.value(node.inputs[0], stack))

    def _curve_rgb(self, node, output, stack):
        tables = curve_tables(node.mapping, 4)

        def curved(f, c):
            whole = np.stack([tables[k](tables[3](c[..., k])) for k in range(3)], -1)
            return c + f * (whole - c)

        return self.apply("curves", curved, *(self.value(node.inputs[i], stack) for i in range(2)))

    def _curve_float(self, node, output, stack):
        table, = curve_tables(node.mapping, 1)
        return self.apply("curve", lambda f, c: c + f * (table(c) - c), self.value(node.inputs[0], stack),
                          self.grey(self.value(node.inputs[1], stack)))

    def _clamp(self, node, output, stack):
        values = [self.value(node.inputs[i], stack) for i in range(3)]
        return self.apply("clamp", lambda v, lo, hi: np.clip(v, lo, hi), *values)

    def _map_range(self, node, output, stack):
        if node.data_type != "FLOAT" or node.interpolation_type != "LINEAR":
            return self._unknown(node, output, stack)
        values = [self.value(node.inputs[i], stack) for i in range(5)]

        def remap(v, a, b, c, d):
            t = (v - a) / np.where(b == a, 1, b - a)
            t = np.clip(t, 0, 1) if node.clamp else t
            return c + t * (d - c)

        return self.apply("range", remap, *values)

    def _math(self, node, output, stack):
        a, b, c = ((self.value(node.inputs[i], stack) if i < len(node.inputs) else ZERO) for i in range(3))
        functions = {
            "ADD": lambda x, y, z: x + y, "SUBTRACT": lambda x, y, z: x - y, "MULTIPLY": lambda x, y, z: x * y,
            "DIVIDE": lambda x, y, z: np.where(y == 0, 0, x / np.where(y == 0, 1, y)),
            "MULTIPLY_ADD": lambda x, y, z: x * y + z, "POWER": lambda x, y, z: np.maximum(x, 0) ** y,
            "MINIMUM": lambda x, y, z: np.minimum(x, y), "MAXIMUM": lambda x, y, z: np.maximum(x, y),
            "SQRT": lambda x, y, z: np.sqrt(np.maximum(x, 0)), "ABSOLUTE": lambda x, y, z: np.abs(x),
            "LESS_THAN": lambda x, y, z: (x < y) * 1.0, "GREATER_THAN": lambda x, y, z: (x > y) * 1.0,
            "SINE": lambda x, y, z: np.sin(x), "COSINE": lambda x, y, z: np.cos(x),
            "EXPONENT": lambda x, y, z: np.exp(x), "FLOOR": lambda x, y, z: np.floor(x),
            "FRACT": lambda x, y, z: x - np.floor(x), "ROUND": lambda x, y, z: np.floor(x + 0.5),
        }
        if node.operation not in functions:
            return self._unknown(node, output, stack)
        result = self.apply("math", functions[node.operation], a, b, c)
        return self.apply("clamp", lambda x: np.clip(x, 0, 1), result) if node.use_clamp else result

    def _blend(self, node, blend, f, a, b, clamp_result, clamp_factor=True):
        if f.picture is None and clamp_factor:
            f = Value(np.clip(f.factor, 0, 1))
        if blend == "MIX":
            result = self.mix(f, a, b)
        elif blend == "MULTIPLY" and f.picture is None and (f.factor == 1).all():
            result = self.multiply(a, b)
        elif _mix_blend(blend, f.factor, a.factor, b.factor) is None:
            self.plain_or_program()
            self.note(f"mix: {blend.replace('_', ' ').lower()}", "Blend modes taken as plain mixing")
            result = self.mix(f, a, b)
        else:
            result = self.apply("mix", lambda t, x, y: _mix_blend(blend, t, x, y), f, a, b)
        return self.apply("clamp", lambda x: np.clip(x, 0, 1), result) if clamp_result else result

    def _mix_rgb(self, node, output, stack):
        f, a, b = (self.value(node.inputs[i], stack) for i in range(3))
        return self._blend(node, node.blend_type, f, a, b, node.use_clamp)

    def _mix(self, node, output, stack):  # the node of 3.4 and later: float, vector and colour in one
        def enabled(name):
            return next((s for s in node.inputs if s.name == name and s.enabled), None)

        f, a, b = (self.value(enabled(name), stack) for name in ("Factor", "A", "B"))
        blend = node.blend_type if node.data_type == "RGBA" else "MIX"
        return self._blend(node, blend, f, a, b, node.data_type == "RGBA" and node.clamp_result, node.clamp_factor)

    def _separate(self, node, output, stack):
        colour = self.value(node.inputs[0], stack)
        if getattr(node, "mode", "RGB") != "RGB":
            return self._unknown(node, output, stack)
        k = list(node.outputs).index(output)
        return self.apply("channel", lambda c: np.repeat(np.asarray(c)[..., k:k + 1], 3, -1), colour)

    _separate_color = _seprgb = _sepxyz = _separate

    def _combine(self, node, output, stack):
        if getattr(node, "mode", "RGB") != "RGB":
            return self._unknown(node, output, stack)
        parts = [self.value(node.inputs[i], stack) for i in range(3)]
        return self.apply("combined", lambda r, g, b: np.stack(np.broadcast_arrays(r[..., 0], g[..., 0], b[..., 0]), -1),
                          *parts)

    _combine_color = _combrgb = _combxyz = _combine

    # ---- Images -------------------------------------------------------------------------------------------------

    def mapping(self, socket, stack):
        """Of an image's vector input. None: coordinates that are not followed."""
        node, output, stack = self.source(socket, stack)
        if node is None:
            return Mapping()
        if node.type == "UVMAP":
            return Mapping("UV", node.uv_map)
        if node.type == "TEX_COORD" and output.name in {"UV", "Generated"}:
            return Mapping("UV" if output.name == "UV" else "GENERATED")
        if node.type == "MAPPING":
            inner = self.mapping(node.inputs["Vector"], stack)
            values = {n: node.inputs[n] for n in ("Location", "Rotation", "Scale") if n in node.inputs}
            if inner is None or any(s.is_linked for s in values.values()):
                return None
            place = values["Location"].default_value if "Location" in values else (0, 0, 0)
            turn, scale = values["Rotation"].default_value, values["Scale"].default_value
            if abs(turn[0]) > 1e-6 or abs(turn[1]) > 1e-6:
                return None
            c, s = math.cos(turn[2]), math.sin(turn[2])
            own = np.array([[c * scale[0], -s * scale[1], place[0]], [s * scale[0], c * scale[1], place[1]], [0, 0, 1]])
            if node.vector_type == "TEXTURE":
                if abs(np.linalg.det(own)) < 1e-12:
                    return None
                own = np.linalg.inv(own)
            elif node.vector_type != "POINT":
                own[:2, 2] = 0
            whole = own @ np.vstack([inner.matrix, [0, 0, 1]])
            return Mapping(inner.source, inner.uv_map, whole[:2])
        return None

    def _tex_image(self, node, output, stack):
        image = node.image
        if image is None:
            self.note(node.name, "Image textures without an image, taken as black")
            return ZERO
        alpha = output.name == "Alpha"
        user = getattr(node, "image_user", None)
        read = self.images.pixels(image, user)
        if read is None:
            return Value(1) if alpha else Value((1, 0, 1))
        if alpha and (image.alpha_mode == "NONE" or (read[0][..., 3] == (255 if read[0].dtype == np.uint8 else 1.0)).all()):
            return ONE
        mapping = self.mapping(node.inputs["Vector"], stack)
        if mapping is None or node.projection != "FLAT":
            self.plain_or_program()
            self.note(image.name, "Textures on coordinates other than UV and Generated, taken as their mean")
        flags = {"EXTEND": library.CLAMP, "CLIP": library.CLAMP}.get(node.extension, 0)
        columns, rows = self.images.grid(image)
        if columns * rows > 1:
            flags = library.CLAMP
            if mapping is not None:
                mapping = Mapping(mapping.source, mapping.uv_map, np.array([[1 / columns], [1 / rows]]) * mapping.matrix)
        elif node.extension in {"CLIP", "MIRROR"}:
            self.plain_or_program()
            self.note(f"{image.name}: {node.extension.lower()}", "Extensions of images taken as repeat or extend")
        if node.interpolation == "Closest":
            flags |= library.NEAREST
        picture = self.picture(node, alpha, flags, mapping)
        if mapping is None or node.projection != "FLAT":
            return Value(picture.linear().mean((0, 1)))
        return Value(1, picture)

    def picture(self, node, alpha, flags, mapping=None):
        """Of an image that images.pixels() has read."""
        image, user = node.image, getattr(node, "image_user", None)
        read = self.images.pixels(image, user)
        divided = node.outputs["Alpha"].is_linked if "Alpha" in node.outputs else False
        texels = read[0][..., 3:4] if alpha else self.images.colours(image, user, divided)
        key = (self.images.key(image, user), "alpha" if alpha else divided, flags)
        return Picture(image.name, key, mapping or Mapping(), flags, stored=lambda: (texels, read[1] and not alpha))

    def texels(self, node, alpha):
        """A program's image, wherever it is looked up: a Picture, or a Value where there is none."""
        image = node.image
        if image is None:
            self.note(node.name, "Image textures without an image, taken as black")
            return ZERO
        if self.images.pixels(image, getattr(node, "image_user", None)) is None:
            return ONE if alpha else Value((1, 0, 1))
        flags = library.CLAMP if getattr(node, "extension", "REPEAT") in {"EXTEND", "CLIP"} or self.images.grid(image) != (1, 1) else 0
        return self.picture(node, alpha, flags | (library.NEAREST if node.interpolation == "Closest" else 0))


class Quiet:
    """A report that says nothing."""

    def note(self, *_):
        pass
