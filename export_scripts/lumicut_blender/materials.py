# SPDX-License-Identifier: Apache-2.0
"""Blender's shader trees to the renderer's material: Lambert, one glossy lobe, emission, holes.

The lobe's albedo is the reflectance at normal incidence (no Fresnel rise towards the edge), its exponent that of the
GGX distribution with the same width about the mirror direction.
"""
import dataclasses

import bpy
import numpy as np

from . import library
from .nodes import LUMINANCE, ONE, ZERO, Evaluator, Images, Mapping, Picture, Value, image_of, input_of

HOLE = 0.25  # an opacity that the library takes as "not there"


def exponent_of(roughness):
    """Of the lobe cosⁿβ about the mirror direction. Half vectors turn half as far: n = (2/α² − 2)/4, α = roughness²."""
    alpha2 = max(roughness, 1e-3) ** 4
    return max(0.0, 0.5 / alpha2 - 0.5)


@dataclasses.dataclass
class Surface:
    diffuse: Value = ZERO
    specular: Value = ZERO
    roughness: float = 0.5
    emission: Value = ZERO
    opacity: Value = ONE
    clear: bool = False  # lets light pass, and does nothing else


def luminance(value):
    return value.scalar()


class SurfaceReader(Evaluator):
    """Closures of one material's tree, added up."""

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
        specular_a, specular_b = self.multiply(f, a.specular), self.multiply(g, b.specular)
        wa, wb = luminance(specular_a), luminance(specular_b)
        if wa > 0 and wb > 0 and abs(a.roughness - b.roughness) > 0.05:
            self.note("", "Several glossy lobes in one material, taken as one")
        roughness = (wa * a.roughness + wb * b.roughness) / (wa + wb) if wa + wb > 0 else a.roughness
        return Surface(self.add(self.multiply(f, a.diffuse), self.multiply(g, b.diffuse)),
                       self.add(specular_a, specular_b), roughness,
                       self.add(self.multiply(f, a.emission), self.multiply(g, b.emission)),
                       self.add(self.multiply(f, a.opacity), self.multiply(g, b.opacity)))

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
        if socket is not None and socket.is_linked:
            source = self.source(socket, stack)[0]
            if source is not None:
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
        return Surface(specular=self.value(node.inputs["Color"], stack), roughness=rough)

    closure_bsdf_anisotropic = closure_bsdf_glossy

    def closure_bsdf_metallic(self, node, stack):
        self.bumps(node, stack)
        self.note("Metallic BSDF", "Shaders approximated by a glossy lobe of their base colour")
        return Surface(specular=self.value(input_of(node, "Base Color", "Color"), stack), roughness=self.roughness(node, stack))

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

    def clear_glass(self, node, stack):
        self.note(node.bl_label, "Glass taken as clear: light passes unchanged, nothing is reflected or refracted")
        return Surface(opacity=ZERO, clear=True)

    closure_bsdf_glass = closure_bsdf_refraction = clear_glass

    def as_diffuse(self, node, stack):
        self.bumps(node, stack)
        self.note(node.bl_label, "Shaders taken as diffuse")
        return Surface(diffuse=self.value(input_of(node, "Color"), stack))

    closure_bsdf_translucent = closure_subsurface_scattering = as_diffuse
    closure_bsdf_velvet = closure_bsdf_sheen = closure_bsdf_toon = closure_bsdf_hair = closure_bsdf_hair_principled = as_diffuse

    def closure_eevee_specular(self, node, stack):
        return Surface(self.value(node.inputs["Base Color"], stack), self.value(node.inputs["Specular"], stack),
                       self.roughness(node, stack), self.value(node.inputs["Emissive Color"], stack))

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
        if node.inputs.get("Specular IOR Level") is not None:  # 4.x
            ior = max(1.0, self.number(node.inputs["IOR"], stack, "IOR"))
            f0 = self.multiply(value("Specular IOR Level"), Value(2 * ((ior - 1) / (ior + 1)) ** 2))
        else:
            f0 = self.multiply(value("Specular"), Value(0.08))
        dielectric = self.complement(metallic)
        rough = self.roughness(node, stack)
        if bpy.app.version < (4, 0, 0) and not base.is_zero() and not dielectric.is_zero():
            # Burley's diffuse, which Blender gave up with 4.0: 0.5 to 1.1 times Lambert by direction. Its albedo under
            # even light from all sides, integrated numerically, is linear in the roughness to 0.001.
            self.note("", "Principled's diffuse part (Burley) as Lambert of the same mean albedo")
            lambert = self.multiply(base, Value(0.953 + 0.1123 * rough))
        else:
            lambert = base
        diffuse = self.multiply(self.multiply(lambert, dielectric), self.complement(transmission))
        specular = self.add(self.multiply(metallic, base), self.multiply(dielectric, f0))
        emission = self.multiply(value("Emission", "Emission Color"), value("Emission Strength"))
        opacity = value("Alpha")
        if transmission.scalar() * dielectric.scalar() > 0.5:
            self.note("Principled transmission", "Glass taken as clear: light passes unchanged, nothing is reflected or refracted")
            return Surface(emission=emission, opacity=ZERO, clear=emission.is_zero())
        if not transmission.is_zero():
            self.note("weak transmission", "Principled features left out")
        return Surface(diffuse, specular, rough, emission, opacity)


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
        surface = self._surface(material, name)
        m = library.Material(opacity=1.0)
        pictures = {}
        factors = {}
        for slot in SLOTS:
            value = getattr(surface, slot)
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
        if factors["specular"].any():
            self.report.note(name, "Gloss as a lobe about the mirror direction, without Fresnel")
            n = exponent_of(surface.roughness)
            if n > self.max_shininess:
                self.report.note(name, f"Roughness raised to the gloss limit (exponent {self.max_shininess:g})")
                n = self.max_shininess
            m.shininess = n
        opacity = float(factors["opacity"].mean())
        if "opacity" not in pictures:
            if 0.02 < opacity < 0.98:
                self.report.note(f"{name} ({opacity:.2g})", "Partial transparency rounded to a hole or a solid")
            m.opacity = HOLE if opacity < 0.5 else 1.0
        else:
            m.opacity = min(1.0, max(opacity, 0.01))
        mappings = {p.mapping for p in pictures.values()}
        mapping = next((pictures[slot].mapping for slot in SLOTS if slot in pictures), Mapping())
        if len(mappings) > 1:
            self.report.note(name, "Textures of one material on several coordinates, all laid on the first's")
        for slot, picture in pictures.items():
            if slot == "opacity":
                picture = self._mask(picture)
            setattr(m, slot + "_texture", self.picture_number(picture))
        return Converted(name, m, pictures, mapping)

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
            return Surface(diffuse=Value(0.8))
        if not material.use_nodes or material.node_tree is None:
            return Surface(diffuse=Value(list(material.diffuse_color)[:3]))
        reader = SurfaceReader(name, self.images, self.report)
        tree = material.node_tree
        output = tree.get_output_node("CYCLES") or tree.get_output_node("ALL")
        if output is None:
            return Surface()
        for socket in ("Volume", "Displacement"):
            if output.inputs[socket].is_linked:
                reader.note("", f"{socket}s left out" if socket == "Volume" else "Displacement left out")
        # Outputs inside a group cannot be: the output stands in the tree itself.
        return reader.surface(output.inputs["Surface"])
