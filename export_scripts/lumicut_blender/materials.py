# SPDX-License-Identifier: Apache-2.0
"""Blender's shader trees to the renderer's material: Lambert, or GGX metal, glass and coated diffuse; emission, holes.

Closures are added up as four colours: diffuse, metal, glass, and the coat's reflectance at normal incidence. A material
of the renderer has one base colour for the first three, with shares of metal and of glass.
"""
import dataclasses
import math

import bpy
import numpy as np

from . import library
from .nodes import LUMINANCE, ONE, ZERO, Evaluator, Images, Mapping, Picture, Value, image_of, input_of

HOLE = 1e-3  # an opacity that the library takes as "not there"; 0 means 1 to it


MIRROR = 0.1  # roughness below which the library follows a reflection instead of shading it


def roughness_of(exponent):
    """At which GGX is as wide as the lobe cosⁿβ about the mirror direction. Half vectors turn half as far:
    n = (2/α² − 2)/4, α = roughness²."""
    return (0.5 / (exponent + 0.5)) ** 0.25


def normal_reflectance(ior):
    return ((ior - 1) / (ior + 1)) ** 2


def ior_of(reflectance):
    root = math.sqrt(min(0.66, reflectance))
    return (1 + root) / (1 - root)


def dimming(f0, alpha):
    """Mean share of light that the library's coat leaves to the diffuse part: twin of ggx_base in scene/material.h."""
    a2 = alpha * alpha
    left = 1 - f0 * (1 - 1.643 * a2 / (1 + 2.248 * a2))
    fade = min(1, (min(1, 50 * f0) / (1 + 8 * alpha + 5 * a2) + 0.4 * f0 * a2) / left)
    return left * (1 - fade / 15)


@dataclasses.dataclass
class Surface:
    diffuse: Value = ZERO
    metal: Value = ZERO
    glass: Value = ZERO  # of what passes two borders
    coat: Value = ZERO   # reflectance at normal incidence
    roughness: float = 0.5
    ior: float = 1.5
    emission: Value = ZERO
    opacity: Value = ONE
    clear: bool = False  # lets light pass, and does nothing else


def luminance(value):
    return value.scalar()


class SurfaceReader(Evaluator):
    """Closures of one material's tree, added up."""

    normals = None  # (picture, strength)

    def surface(self, socket, stack=()):
        node, output, stack = self.source(socket, stack)
        if node is None:
            return Surface()
        handler = getattr(self, "closure_" + node.type.lower(), None)
        if handler is None:
            self.note(node.bl_label or node.type, "Shaders left out")
            return Surface()
        return handler(node, stack)

    # ---- Sums ---------------------------------------------------------------------------------------------------

    def weighted(self, f, a, g, b):
        """f·a + g·b; the rougher or brighter gloss decides the roughness by its share."""
        def gloss(s):
            return luminance(s.metal) + luminance(s.glass) + luminance(s.coat)

        wa, wb = f.scalar() * gloss(a), g.scalar() * gloss(b)
        if wa > 0 and wb > 0 and abs(a.roughness - b.roughness) > 0.05:
            self.note("", "Several glossy lobes in one material, taken as one")
        roughness = (wa * a.roughness + wb * b.roughness) / (wa + wb) if wa + wb > 0 else a.roughness
        summed = {slot: self.add(self.multiply(f, getattr(a, slot)), self.multiply(g, getattr(b, slot)))
                  for slot in ("diffuse", "metal", "glass", "coat", "emission", "opacity")}
        return Surface(roughness=roughness, ior=a.ior if luminance(a.glass) > luminance(b.glass) else b.ior, **summed)

    def closure_mix_shader(self, node, stack):
        f = self.value(node.inputs[0], stack)
        if f.picture is None:
            f = Value(np.clip(f.factor, 0, 1))
        a, b = self.surface(node.inputs[1], stack), self.surface(node.inputs[2], stack)
        rest = self.complement(f)
        if a.clear or b.clear:  # a cut-out: what is there keeps its colour
            kept, share = (b, f) if a.clear else (a, rest)
            if a.clear and b.clear:
                return a
            return dataclasses.replace(kept, opacity=self.multiply(share, kept.opacity))
        return self.weighted(rest, a, f, b)

    def closure_add_shader(self, node, stack):
        a, b = self.surface(node.inputs[0], stack), self.surface(node.inputs[1], stack)
        if a.clear:
            return dataclasses.replace(b, opacity=ONE)
        if b.clear:
            return dataclasses.replace(a, opacity=ONE)
        return dataclasses.replace(self.weighted(ONE, a, ONE, b), opacity=a.opacity)

    # ---- Closures -----------------------------------------------------------------------------------------------

    def bumps(self, node, stack):
        socket = node.inputs.get("Normal")
        if socket is None or not socket.is_linked:
            return
        source, _, stack = self.source(socket, stack)
        if source is None:
            return
        if source.type == "NORMAL_MAP" and source.space == "TANGENT":
            colour = self.value(source.inputs["Color"], stack)
            strength = self.number(source.inputs["Strength"], stack, "normal strength")
            if colour.picture is not None and (colour.factor == 1).all():
                if strength > 0 and self.normals is None:
                    self.normals = colour.picture, min(10.0, strength)
                elif strength > 0 and self.normals[0].key != colour.picture.key:
                    self.note(colour.picture.name, "Several normal maps in one material, the first taken")
                return
        self.note(source.bl_label, "Normal and bump maps left out")

    def roughness(self, node, stack):
        return min(1.0, max(0.0, self.number(node.inputs.get("Roughness"), stack, "roughness")))

    def closure_bsdf_diffuse(self, node, stack):
        self.bumps(node, stack)
        if self.number(node.inputs["Roughness"], stack, "roughness") > 0:
            self.note("", "Rough diffuse (Oren-Nayar) taken as Lambert")
        return Surface(diffuse=self.value(node.inputs["Color"], stack))

    def closure_bsdf_glossy(self, node, stack):
        self.bumps(node, stack)
        rough = 0.0 if getattr(node, "distribution", "") == "SHARP" else self.roughness(node, stack)
        return Surface(metal=self.value(node.inputs["Color"], stack), roughness=rough)

    closure_bsdf_anisotropic = closure_bsdf_glossy

    def closure_bsdf_metallic(self, node, stack):
        self.bumps(node, stack)
        self.note("Metallic BSDF", "Shaders taken as metal of their base colour")
        return Surface(metal=self.value(input_of(node, "Base Color", "Color"), stack), roughness=self.roughness(node, stack))

    def closure_emission(self, node, stack):
        colour, strength = self.value(node.inputs["Color"], stack), self.value(node.inputs["Strength"], stack)
        return Surface(emission=self.multiply(colour, strength))

    closure_background = closure_emission

    def closure_bsdf_transparent(self, node, stack):
        if (self.value(node.inputs["Color"], stack).mean() < 0.99).any():
            self.note("Transparent BSDF", "Coloured transparency, taken as clear")
        return Surface(opacity=ZERO, clear=True)

    def closure_holdout(self, node, stack):
        self.note("Holdout", "Shaders left out")
        return Surface()

    def note_glass(self, node):
        self.note(node.bl_label, "Glass: lamps do not shine straight through it, their light passes along light paths alone")

    def closure_bsdf_glass(self, node, stack):
        self.bumps(node, stack)
        self.note_glass(node)
        colour = self.value(node.inputs["Color"], stack)
        rough = 0.0 if getattr(node, "distribution", "") == "SHARP" else self.roughness(node, stack)
        ior = self.number(node.inputs["IOR"], stack, "IOR")
        return Surface(glass=self.multiply(colour, colour), roughness=rough, ior=ior)

    def closure_bsdf_refraction(self, node, stack):
        self.note(node.bl_label, "Shaders taken as glass, which reflects too")
        return self.closure_bsdf_glass(node, stack)

    def as_diffuse(self, node, stack):
        self.bumps(node, stack)
        self.note(node.bl_label, "Shaders taken as diffuse")
        return Surface(diffuse=self.value(input_of(node, "Color"), stack))

    closure_bsdf_translucent = closure_subsurface_scattering = as_diffuse
    closure_bsdf_velvet = closure_bsdf_sheen = closure_bsdf_toon = closure_bsdf_hair = closure_bsdf_hair_principled = as_diffuse

    def closure_eevee_specular(self, node, stack):
        return Surface(diffuse=self.value(node.inputs["Base Color"], stack),
                       coat=self.value(node.inputs["Specular"], stack), roughness=self.roughness(node, stack),
                       emission=self.value(node.inputs["Emissive Color"], stack))

    def closure_bsdf_principled(self, node, stack):
        self.bumps(node, stack)

        def value(*names):
            socket = input_of(node, *names)
            return self.value(socket, stack) if socket is not None else ZERO

        for names, text in ((("Clearcoat", "Coat Weight"), "clearcoat"), (("Sheen", "Sheen Weight"), "sheen"),
                            (("Anisotropic",), "anisotropy"), (("Specular Tint",), "specular tint"),
                            (("Thin Film Thickness",), "thin film")):
            socket = input_of(node, *names)
            if socket is None:
                continue
            v = self.value(socket, stack)
            white = text == "specular tint" and socket.type == "RGBA"  # 4.x: a colour, white for none
            if (v.mean() != 1).any() if white else not v.is_zero():
                self.note(text, "Principled features left out")
        base = value("Base Color")
        scattered = value("Subsurface", "Subsurface Weight")
        if not scattered.is_zero():
            self.note("subsurface", "Principled features taken as diffuse")
            if node.inputs.get("Subsurface Color") is not None:
                base = self.mix(scattered, base, value("Subsurface Color"))
        metallic, transmission = value("Metallic"), value("Transmission", "Transmission Weight")
        ior = self.number(node.inputs["IOR"], stack, "IOR")
        if node.inputs.get("Specular IOR Level") is not None:  # 4.x
            f0 = self.multiply(value("Specular IOR Level"), Value(2 * normal_reflectance(ior)))
        else:
            f0 = self.multiply(value("Specular"), Value(0.08))
        dielectric = self.complement(metallic)
        opaque = self.multiply(dielectric, self.complement(transmission))
        rough = self.roughness(node, stack)
        if bpy.app.version < (4, 0, 0) and not base.is_zero() and not dielectric.is_zero():
            # Burley's diffuse, which Blender gave up with 4.0: 0.5 to 1.1 times Lambert by direction. Its albedo under
            # even light from all sides, integrated numerically, is linear in the roughness to 0.001.
            self.note("", "Principled's diffuse part (Burley) as Lambert of the same mean albedo")
            # The coat took nothing from it either.
            lambert = self.multiply(base, Value((0.953 + 0.1123 * rough) / dimming(f0.mean().max(), rough * rough)))
        else:
            lambert = base
        glass = self.multiply(self.multiply(base, dielectric), transmission)
        if not glass.is_zero():
            self.note_glass(node)
        rough_glass = node.inputs.get("Transmission Roughness")
        if rough_glass is not None and not transmission.is_zero() and not self.value(rough_glass, stack).is_zero():
            self.note("transmission roughness", "Principled features left out")
        emission = self.multiply(value("Emission", "Emission Color"), value("Emission Strength"))
        opacity = value("Alpha")
        return Surface(diffuse=self.multiply(lambert, opaque), metal=self.multiply(base, metallic), glass=glass,
                       coat=self.multiply(f0, opaque), roughness=rough, ior=ior, emission=emission, opacity=opacity)


@dataclasses.dataclass
class Converted:
    """A material with the pictures of its four slots and where they lie on a mesh."""
    name: str
    values: library.Material
    pictures: dict
    mapping: Mapping


SLOTS = ("diffuse", "specular", "emission", "opacity")


class Materials:
    """Numbers materials and images of one scene, converting each once."""

    def __init__(self, report, max_shininess=1000.0, images=None, check=lambda: None):
        self.report, self.max_shininess = report, max_shininess
        self.images = images or Images(report, check)
        self.converted, self.pictures = [], []
        self._numbers, self._picture_numbers = {}, {}

    def number(self, material):
        """Index of a Blender material (None: the default grey)."""
        key = None if material is None else material.name_full
        if key not in self._numbers:
            self._numbers[key] = len(self.converted)
            self.converted.append(self._convert(material))
        return self._numbers[key]

    def picture_number(self, picture):
        """1 + index among the scene's images."""
        if picture.key not in self._picture_numbers:
            self.pictures.append(picture)
            self._picture_numbers[picture.key] = len(self.pictures)
        return self._picture_numbers[picture.key]

    def items(self):
        return [(c.name, c.values) for c in self.converted]

    def image_items(self):
        return [image_of(picture) for picture in self.pictures]

    def _convert(self, material):
        name = "default" if material is None else material.name
        surface, normals = self._surface(material, name)
        m = library.Material(opacity=1.0)
        pictures = {}
        factors = {}
        values = self._gloss(surface, name, m)
        for slot in SLOTS:
            value = values.get(slot) or getattr(surface, slot)
            if value.picture is not None and value.is_zero():
                value = ZERO
            factors[slot] = np.maximum(np.nan_to_num(value.factor), 0)
            if value.picture is not None:
                pictures[slot] = value.picture
        for slot in ("diffuse", "specular"):
            if (factors[slot] > 1.07).any():  # white by Burley's albedo goes without saying
                self.report.note(name, "Colours above 1 cut to 1")
            if (factors[slot] > 1).any():
                factors[slot] = np.minimum(factors[slot], 1)
            getattr(m, slot)[:] = factors[slot].tolist()
        m.emission[:] = factors["emission"].tolist()
        if factors["emission"].any():
            m.flags |= library.EMIT_BOTH_SIDES
        opacity = float(factors["opacity"].mean())
        m.opacity = min(1.0, max(opacity, HOLE))
        if normals is not None:
            pictures["normal"], m.normal_strength = normals
        mappings = {p.mapping for p in pictures.values()}
        mapping = next((pictures[slot].mapping for slot in SLOTS + ("normal",) if slot in pictures), Mapping())
        if len(mappings) > 1:
            self.report.note(name, "Textures of one material on several coordinates, all laid on the first's")
        for slot, picture in pictures.items():
            if slot == "opacity":
                picture = self._mask(picture)
            setattr(m, slot + "_texture", self.picture_number(picture))
        return Converted(name, m, pictures, mapping)

    def _gloss(self, surface, name, m):
        """Values of the slots diffuse and specular; flags and numbers into `m`."""
        d, metal, glass = luminance(surface.diffuse), luminance(surface.metal), luminance(surface.glass)
        coat, diffuse = surface.coat, surface.diffuse
        if metal + glass + luminance(coat) <= 0:
            return {"diffuse": diffuse, "specular": ZERO}
        m.flags |= library.GGX
        add = Evaluator(name, self.images, self.report).add
        parts = [value for value in (diffuse, surface.metal, surface.glass) if luminance(value) > 0]
        hues = [value.mean() / luminance(value) for value in parts]
        if len(parts) > 1 and any(abs(hue - hues[0]).max() > 0.05 for hue in hues):
            # One base colour must do.
            if glass >= 0.5 * (d + metal + glass):
                self.report.note(name, "Glass mixed with shaders of other colours, taken as glass alone")
                parts, d, metal, coat = [surface.glass], 0, 0, ZERO
            else:
                self.report.note(name, "Gloss mixed with shaders of other colours, taken as a coat")
                coat, metal = add(coat, surface.metal), 0
                parts = [diffuse] if luminance(diffuse) > 0 else [surface.glass]
                glass = 0 if luminance(diffuse) > 0 else glass
        base = ZERO
        for value in parts:
            base = add(base, value)
        whole = d + metal + glass
        m.metallic = metal / whole if whole > 0 else 0.0
        m.transmission = glass / (d + glass) if d + glass > 0 else 0.0
        m.roughness, m.ior = surface.roughness, min(10.0, max(0.1, surface.ior))
        least = roughness_of(self.max_shininess)
        if MIRROR <= m.roughness < least:
            self.report.note(name, f"Roughness raised to the gloss limit (exponent {self.max_shininess:g})")
            m.roughness = least
        opaque = (1 - m.metallic) * (1 - m.transmission)
        f0 = Value(coat.factor / opaque, coat.picture) if opaque > 1e-3 else ZERO
        most = float(f0.factor.max())
        if most <= 0:
            return {"diffuse": base, "specular": ZERO}
        if most > 0.66:
            self.report.note(name, "Coats that reflect more than 66 % straight on, cut to that")
        if glass <= 0 or normal_reflectance(m.ior) < most:
            m.ior = ior_of(most)
        return {"diffuse": base, "specular": Value(np.minimum(1, f0.factor / normal_reflectance(m.ior)), f0.picture)}

    @staticmethod
    def _mask(picture):
        """The same picture in one channel, as masks are."""
        texels, flags = picture.stored()
        if texels.shape[2] == 1:
            return picture
        grey = (picture.linear() @ LUMINANCE)[..., None]
        return Picture(picture.name + " mask", (picture.key, "mask"), picture.mapping, picture.flags, linear=grey)

    def _surface(self, material, name):
        if material is None:
            return Surface(diffuse=Value(0.8)), None
        if not material.use_nodes or material.node_tree is None:
            return Surface(diffuse=Value(list(material.diffuse_color)[:3])), None
        reader = SurfaceReader(name, self.images, self.report)
        tree = material.node_tree
        output = tree.get_output_node("CYCLES") or tree.get_output_node("ALL")
        if output is None:
            return Surface(), None
        for socket in ("Volume", "Displacement"):
            if output.inputs[socket].is_linked:
                reader.note("", f"{socket}s left out" if socket == "Volume" else "Displacement left out")
        # Outputs inside a group cannot be: the output stands in the tree itself.
        return reader.surface(output.inputs["Surface"]), reader.normals
