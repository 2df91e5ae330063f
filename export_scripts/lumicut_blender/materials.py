# SPDX-License-Identifier: Apache-2.0
"""Blender's shader trees to the renderer's material: Lambert, or GGX metal, glass and coated diffuse; emission, holes.

Closures are added up as four colours: diffuse, metal, glass, and the coat's reflectance at normal incidence. A material
of the renderer has one base colour for the first three, with shares of metal and of glass.
"""
import dataclasses
import math

import bpy
import numpy as np

from . import compat, view_albedos, volumes
from .lumicut import library
from .images import Images, Picture, image_of
from .mappings import Mapping, aligned
from .nodes import LUMINANCE, ONE, ZERO, Evaluator, Value, fresnel, input_of
from .programs import NORMAL, CannotCompile, Compiler, ProgramPicture, bump_of, const, mapped_normal, of_picture, program_of

HOLE = 1e-3  # an opacity that the library takes as "not there"; 0 means 1 to it
LARGEST_FACTOR = 1e6  # of a texture, in the library
SHEEN_BY_VIEW = "Sheen by the angle of view alone, and even over directions of light"
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


# Mean share of even light that single reflection at GGX facets loses, by α: twin of mean_facet_loss in bsdf/facet_albedo.h.
ALPHAS = (0, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1)
LOSSES = (0, 0.006, 0.0318, 0.0842, 0.1532, 0.2269, 0.3, 0.3697, 0.4341, 0.4925, 0.5449, 0.5913)


def scatters_again(node):
    """Whether what metal's facets lose in one reflection is reflected again, to other facets."""
    return getattr(node, "distribution", "MULTI_GGX") == "MULTI_GGX"


def facets(node):
    """How: since 4.0 that makes the lobe brighter."""
    return library.FACETS_ONCE if not scatters_again(node) else library.BRIGHT_LOBE if bpy.app.version >= (4, 0, 0) else 0


@dataclasses.dataclass
class ClearCoat:
    share: float
    roughness: float
    ior: float


@dataclasses.dataclass
class ByPlace:
    """A surface whose share of metal a picture gives."""
    metallic: Value
    base: Value  # of metal and diffuse part alike
    f0: Value    # of the dielectric's share


REFLECTED = ("diffuse", "metal", "glass", "coat", "gloss", "translucency")  # fields of Surface: closures' colours


@dataclasses.dataclass
class Surface:
    diffuse: Value = ZERO
    metal: Value = ZERO
    glass: Value = ZERO  # of what passes two borders
    coat: Value = ZERO   # reflectance at normal incidence
    gloss: Value = ZERO  # reflectance at every angle
    translucency: Value = ZERO  # what leaves evenly on the other side
    roughness: float = 0.5
    ior: float = 1.5
    emission: Value = ZERO
    opacity: Value = ONE
    clear: bool = False  # lets light pass, and does nothing else
    filter: Value = ONE  # colour of what passes where it is clear
    holdout: bool = False  # the camera sees a hole
    shadows_pass: bool = False  # glass that does not stop shadow rays
    rough_picture: Value = None  # `roughness` is its mean then
    by_place: ByPlace = None
    clearcoat: ClearCoat = None
    slope: Value = ZERO   # of the diffuse part's facets (Oren-Nayar)
    facets: int = 0       # flags of what metal's facets reflect again
    burley: bool = False  # the diffuse part, of which coats take nothing
    tint: tuple = None    # of metal's edge, of what glass reflects
    absorption: tuple = None  # inside glass, 1/length
    by_ray: bool = False      # other kinds of rays may see another


def cut_of(factor, picture):
    """The share of a colour, of a picture's in the mean, that lies above 1."""
    if not (factor > 1).any() and (picture is None or picture.is_byte()) or isinstance(picture, ProgramPicture):
        return 0.0
    colours = factor if picture is None else factor * picture.linear()
    return float(np.maximum(colours - 1, 0).mean() / max(colours.mean(), 1e-9))


def is_tinted(surface):
    return surface.clear and bool((surface.filter.mean() < 0.99).any())


def filtering(surface, reader):
    """A Transparent BSDF: glass that bends and reflects nothing, straight through which light shines."""
    if is_tinted(surface):
        reader.note("", "Coloured transparency, whose shadows are grey")
    return Surface(glass=reader.multiply(surface.filter, surface.filter), ior=1.0, roughness=0.0, shadows_pass=True,
                   tint=tuple(surface.filter.mean()), by_ray=surface.by_ray)


def only_gloss(surface):
    """Whether a surface reflects as a mirror or a gloss does, and does nothing else."""
    others = ("diffuse", "glass", "coat", "translucency", "emission")
    return luminance(surface.gloss) + luminance(surface.metal) > 0 and all(luminance(getattr(surface, slot)) <= 0 for slot in others)


def only_shines(surface):
    return luminance(surface.emission) > 0 and surface.opacity.picture is None and (surface.opacity.factor == 1).all() and \
        all(luminance(getattr(surface, slot)) <= 0 for slot in REFLECTED)


def index_like(share):
    """Index of refraction whose reflectance, of light from all sides, is that of a picture by view, seen from the front."""
    seen = share.factor.mean() * share.picture.linear()[0, share.picture.linear().shape[1] // 2:].mean(-1)
    cosine = np.linspace(0, 1, len(seen))
    indices = np.linspace(1.02, 6, 250)
    means = [(fresnel(cosine, index) * cosine).mean() for index in indices]
    return float(indices[np.abs(np.array(means) - (seen * cosine).mean()).argmin()])


def luminance(value):
    return value.scalar()


def same_hue(a, b):
    return abs(a.mean() / max(luminance(a), 1e-9) - b.mean() / max(luminance(b), 1e-9)).max() <= 0.05


class SurfaceReader(Evaluator):
    """Closures of one material's tree, added up."""

    all_rays = True
    programs = True
    material_index = 0
    pixel = 0.0  # over which slopes of bumps are taken, as a share of the distance; 0: the library's own
    base_normal = NORMAL  # of sockets that nothing feeds
    normals = None  # (picture, strength)
    heights = None  # (picture, distance, strength)

    def __init__(self, *words):
        super().__init__(*words)
        self.compiler = Compiler(self)

    def surface(self, socket, stack=()):
        node, output, stack = self.source(socket, stack)
        if node is None:
            return Surface()
        if output.type != "SHADER":  # a colour where a shader should be: Cycles lets it shine
            return Surface(emission=self.value(socket, stack))
        handler = getattr(self, "closure_" + node.type.lower(), None)
        if handler is None:
            self.note(node.bl_label or node.type, "Shaders left out")
            return Surface()
        return handler(node, stack)

    # ---- Sums ---------------------------------------------------------------------------------------------------

    def weighted(self, f, a, g, b):
        """f·a + g·b; the rougher or brighter gloss decides the roughness by its share."""
        def gloss(s):
            return luminance(s.metal) + luminance(s.glass) + luminance(s.coat) + luminance(s.gloss)

        wa, wb = f.scalar() * gloss(a), g.scalar() * gloss(b)
        if wa > 0 and wb > 0 and abs(a.roughness - b.roughness) > 0.05:
            self.note("", "Several glossy lobes in one material, taken as one")
        da, db = f.scalar() * luminance(a.diffuse), g.scalar() * luminance(b.diffuse)
        if wa + wb > 0:
            roughness = (wa * a.roughness + wb * b.roughness) / (wa + wb)
            picture = a.rough_picture if wb <= 0 else b.rough_picture if wa <= 0 else None
        else:
            roughness, picture = (a.roughness, a.rough_picture) if da >= db else (b.roughness, b.rough_picture)
        if picture is None and (wa > 0 and a.rough_picture or wb > 0 and b.rough_picture):
            self.note("roughness", "Textures taken as their mean")

        def weight(h, s):
            return h.scalar() * sum(luminance(getattr(s, slot)) for slot in REFLECTED)

        by_place = None
        if a.by_place or b.by_place:
            of, plain, other = (a, f, weight(g, b)) if a.by_place else (b, g, weight(f, a))
            if other <= 0 and plain.picture is None and (plain.factor == 1).all():  # such as emission added
                by_place = of.by_place
            else:
                self.note("metallic", "Textures taken as their mean")
        if da > 0 and db > 0 and a.burley != b.burley:
            self.note("", "Diffuse parts of two models in one material, taken as the stronger one's")
        slope = self.add(*(self.multiply(Value(d / (da + db)), s.slope) for d, s in ((da, a), (db, b)))) if da + db > 0 else ZERO
        coats = [(h.scalar(), s.clearcoat) for h, s in ((f, a), (g, b)) if s.clearcoat and h.scalar() > 0]
        clearcoat = None
        if coats:
            whole = sum(h * c.share for h, c in coats)
            clearcoat = ClearCoat(min(1.0, whole), sum(h * c.share * c.roughness for h, c in coats) / whole,
                                  max(coats, key=lambda x: x[0] * x[1].share)[1].ior)
        if a.holdout != b.holdout and (g if a.holdout else f).scalar() > 0.01:
            self.note("Holdout", "Holdouts mixed with other shaders, taken as whole where they are half or more")
        summed = {slot: self.add(self.multiply(f, getattr(a, slot)), self.multiply(g, getattr(b, slot)))
                  for slot in (*REFLECTED, "emission", "opacity")}
        return Surface(roughness=roughness, ior=a.ior if luminance(a.glass) > luminance(b.glass) else b.ior,
                       rough_picture=picture, by_place=by_place, clearcoat=clearcoat, slope=slope, burley=a.burley if da >= db else b.burley,
                       tint=a.tint if wa >= wb else b.tint, facets=a.facets if wa >= wb else b.facets, shadows_pass=a.shadows_pass or b.shadows_pass,
                       holdout=(f.scalar() if a.holdout else 0) + (g.scalar() if b.holdout else 0) >= 0.5, **summed)

    def closure_mix_shader(self, node, stack):
        a, b = self.surface(node.inputs[1], stack), self.surface(node.inputs[2], stack)
        shadows_pass = a.clear != b.clear and luminance((b if a.clear else a).glass) > 0 and self.clear_to_shadows(node, stack, a.clear)
        f = self.value_for("camera", node.inputs[0], stack) if shadows_pass else self.value(node.inputs[0], stack)
        if f.picture is None:
            f = Value(np.clip(f.factor, 0, 1))
        rest = self.complement(f)
        if a.clear or b.clear:  # a cut-out: what is there keeps its colour
            kept, share = (b, f) if a.clear else (a, rest)
            if a.clear and b.clear:
                return dataclasses.replace(a, filter=self.add(self.multiply(rest, a.filter), self.multiply(f, b.filter)))
            clear = a if a.clear else b
            if is_tinted(clear) and share.picture is not None and share.picture.is_by_view() and only_gloss(kept):
                return dataclasses.replace(filtering(clear, self), clearcoat=ClearCoat(1.0, kept.roughness, index_like(share)))
            self.taken_as_clear(clear)
            return dataclasses.replace(kept, opacity=self.multiply(share, kept.opacity), shadows_pass=shadows_pass or kept.shadows_pass)
        return self.weighted(rest, a, f, b)

    def clear_to_shadows(self, node, stack, first):
        """Whether a mix has glass for the camera, and what lets light pass for shadow rays: windows are made so."""
        def share(ray):
            f = min(1.0, max(0.0, self.value_for(ray, node.inputs[0], stack).scalar()))
            return 1 - f if first else f
        return share("shadow") - share("camera") > 0.5

    def closure_add_shader(self, node, stack):
        a, b = self.surface(node.inputs[0], stack), self.surface(node.inputs[1], stack)
        if a.clear and only_shines(b) or b.clear and only_shines(a):  # a flame, a ghost: light passes whole, and more comes
            passing, shining = (a, b) if a.clear else (b, a)
            return dataclasses.replace(filtering(passing, self), emission=shining.emission)
        for surface in (a, b):
            if surface.clear:
                self.taken_as_clear(surface)
        if a.clear:
            return dataclasses.replace(b, opacity=ONE)
        if b.clear:
            return dataclasses.replace(a, opacity=ONE)
        if bpy.app.version >= (4, 3, 0) and any(luminance(s.slope) > 0 and luminance(other.gloss) > 0 for s, other in ((a, b), (b, a))):
            self.note("", "Rough diffuse with gloss added, whose facets are taken as brighter")
        return dataclasses.replace(self.weighted(ONE, a, ONE, b), opacity=a.opacity)

    # ---- Closures -----------------------------------------------------------------------------------------------

    def bumps(self, node, stack):
        """What turns the node's normal: a normal map, a bump map, or a bump map above a normal map."""
        socket = node.inputs.get("Normal")
        if socket is None or not socket.is_linked:
            return self.programmed_normal(self.base_normal, "")
        given = socket, stack
        source, _, stack = self.source(socket, stack)
        if source is None:
            return
        if self.base_normal is not NORMAL:
            return self.programmed_normal(*given)
        if source.type == "BUMP":
            self.bumps(source, stack)
            socket = source.inputs["Height"]
            if not socket.is_linked:
                return
            height = self.grey(self.value(socket, stack))
            plain = not any(source.inputs[name].is_linked for name in ("Distance", "Strength"))
            if isinstance(height.picture, ProgramPicture) or not plain or self.normals is not None and isinstance(self.normals[0], ProgramPicture):
                self.normals = None
                return self.programmed_normal(*given)
            if height.picture is not None and not height.picture.is_by_view():
                distance = self.number(source.inputs["Distance"], stack, "bump distance") * float(height.factor[0])
                strength = self.number(source.inputs["Strength"], stack, "bump strength")
                if distance == 0 or strength <= 0:
                    return
                found = height.picture, -distance if source.invert else distance, min(10.0, strength)
                if self.heights is None:
                    self.heights = found
                elif self.heights[0].key != found[0].key or self.heights[1:] != found[1:]:
                    self.note(found[0].name, "Several bump maps in one material, the first taken")
                return
        if source.type == "NORMAL_MAP" and source.space == "TANGENT":
            colour = self.value(source.inputs["Color"], stack)
            strength = self.number(source.inputs["Strength"], stack, "normal strength")
            if colour.picture is not None and not colour.picture.is_by_view() and (colour.factor == 1).all() and \
                    not isinstance(colour.picture, ProgramPicture) and not source.inputs["Strength"].is_linked and \
                    colour.picture.mapping.is_upright() and colour.picture.mapping.uv_map == source.uv_map:
                if strength > 0 and self.normals is None:
                    self.normals = colour.picture, min(10.0, strength)
                elif strength > 0 and self.normals[0].key != colour.picture.key:
                    self.note(colour.picture.name, "Several normal maps in one material, the first taken")
                return
        self.programmed_normal(*given)

    def programmed_normal(self, socket, stack):
        """A program that gives the normal; `socket`: or an expression."""
        try:
            expr = self.compiler.socket(socket, stack) if hasattr(socket, "is_linked") else socket
            found = program_of(self.owner, expr)
        except CannotCompile as what:
            self.note(str(what), "Normal and bump maps left out")
            return
        if expr is NORMAL or expr.constant():
            return
        if self.normals is None and self.heights is None:
            self.normals = found, 1.0
        elif self.normals is None or self.normals[0].key != found.key:
            self.note(found.name, "Several normals in one material, the first taken")

    def rough(self, node, stack):
        """Roughness, as one number and, where there is one, as the picture that it is the mean of."""
        value = self.clipped(self.grey(self.value(node.inputs.get("Roughness"), stack)))
        return {"roughness": value.scalar(), "rough_picture": value if value.picture is not None else None}

    def gloss(self, node, stack):
        return {"roughness": 0.0} if getattr(node, "distribution", "") == "SHARP" else self.even(node, stack, self.rough(node, stack))

    def even(self, node, stack, gloss):
        """The same roughness, where it is one across another, as one: the lobe's mean width."""
        socket = input_of(node, "Anisotropy", "Anisotropic")
        strength = 0.0 if socket is None else self.number(socket, stack, "anisotropy")
        if abs(strength) < 1e-3:
            return gloss
        self.note(node.bl_label, "Anisotropic gloss, taken as even and as wide in the mean")
        if socket.name == "Anisotropic":  # a Principled BSDF's
            stretch = math.sqrt(1 - 0.9 * min(1.0, max(0.0, strength)))
        else:
            stretch = 1 - min(0.99, abs(strength))

        def widened(r):
            wide, narrow = np.minimum(1, r * r / stretch), r * r * stretch
            return np.sqrt((wide + narrow) / 2)

        picture = gloss["rough_picture"]
        picture = None if picture is None else self.apply("anisotropy", widened, picture)
        return {"roughness": float(widened(gloss["roughness"])), "rough_picture": picture}

    def closure_bsdf_diffuse(self, node, stack):
        self.bumps(node, stack)
        return Surface(diffuse=self.value(node.inputs["Color"], stack), slope=self.slope(node.inputs["Roughness"], stack))

    def slope(self, socket, stack):
        return ZERO if socket is None else self.clipped(self.grey(self.value(socket, stack)))

    def closure_bsdf_glossy(self, node, stack):
        self.bumps(node, stack)
        gloss = self.gloss(node, stack)
        colour = self.value(node.inputs["Color"], stack)
        again = ZERO
        if getattr(node, "distribution", "") == "MULTI_GGX" and bpy.app.version < (4, 0, 0):
            # What single scattering loses and the facets reflect again, evenly: c (1 − L) · c L/(1 − c L).
            lost = float(np.interp(gloss["roughness"] ** 2, ALPHAS, LOSSES))
            again = self.apply("scattered again", lambda c: c * c * lost * (1 - lost) / (1 - c * lost), colour)
        return Surface(gloss=colour, diffuse=again, facets=facets(node), **gloss)

    closure_bsdf_anisotropic = closure_bsdf_glossy

    def closure_bsdf_metallic(self, node, stack):
        self.bumps(node, stack)
        self.note("Metallic BSDF", "Shaders taken as metal of their base colour")
        gloss = self.rough(node, stack)
        edge = node.inputs.get("Edge Tint")
        tint = None if edge is None else tuple(self.value(edge, stack).mean())
        return Surface(metal=self.value(input_of(node, "Base Color", "Color"), stack), tint=tint, facets=facets(node), **gloss)

    def closure_emission(self, node, stack):
        colour, strength = self.value(node.inputs["Color"], stack), self.value(node.inputs["Strength"], stack)
        return Surface(emission=self.multiply(colour, strength))

    closure_background = closure_emission

    def closure_bsdf_transparent(self, node, stack):
        return Surface(opacity=ZERO, clear=True, filter=self.value(node.inputs["Color"], stack))

    def taken_as_clear(self, surface):
        """What is mixed with other shaders is a hole."""
        if is_tinted(surface):
            self.note("Transparent BSDF", "Coloured transparency, taken as clear")

    def closure_holdout(self, node, stack):
        if self.ray == "camera":
            self.by_ray = True  # others see a black surface
        return Surface(holdout=self.ray == "camera")

    def closure_bsdf_glass(self, node, stack):
        self.bumps(node, stack)
        colour = self.value(node.inputs["Color"], stack)
        ior, gloss = self.number(node.inputs["IOR"], stack, "IOR"), self.gloss(node, stack)
        return Surface(glass=self.multiply(colour, colour), ior=ior, tint=tuple(colour.mean()), facets=facets(node), **gloss)

    def closure_bsdf_refraction(self, node, stack):
        self.note(node.bl_label, "Shaders taken as glass, which reflects too")
        return self.closure_bsdf_glass(node, stack)

    def closure_bsdf_translucent(self, node, stack):
        self.bumps(node, stack)
        return Surface(translucency=self.value(node.inputs["Color"], stack))

    def as_diffuse(self, node, stack):
        self.bumps(node, stack)
        self.note(node.bl_label, "Shaders taken as diffuse")
        return Surface(diffuse=self.value(input_of(node, "Color"), stack))

    closure_subsurface_scattering = as_diffuse
    closure_bsdf_toon = closure_bsdf_hair = closure_bsdf_hair_principled = as_diffuse

    def closure_bsdf_velvet(self, node, stack):
        self.bumps(node, stack)
        self.note(node.bl_label, SHEEN_BY_VIEW)
        sigma = max(0.01, self.number(input_of(node, "Sigma", "Roughness"), stack, "roughness"))
        if getattr(node, "distribution", "ASHIKHMIN") == "ASHIKHMIN":
            share = self.by_view(("velvet", sigma), lambda c, behind: view_albedos.velvet(c, sigma))
        else:
            share = self.microfibers(sigma)
        return Surface(diffuse=self.multiply(self.value(input_of(node, "Color"), stack), share))

    closure_bsdf_sheen = closure_bsdf_velvet

    def microfibers(self, roughness):
        roughness = min(1.0, roughness)
        return self.by_view(("microfibers", roughness), lambda c, behind: view_albedos.microfibers(c, roughness))

    def sheen(self, node, stack, base):
        """(what it adds to the diffuse part, factor of what lies beneath) of a Principled BSDF."""
        weight = self.clipped(self.grey(self.value(input_of(node, "Sheen", "Sheen Weight"), stack)))
        if weight.is_zero():
            return None, ONE
        self.note("sheen", SHEEN_BY_VIEW)
        tint = node.inputs["Sheen Tint"]
        if tint.type == "RGBA":  # since 4.0: above all else
            colour = self.multiply(self.value(tint, stack), weight)
            share = self.microfibers(self.number(node.inputs["Sheen Roughness"], stack, "sheen roughness"))
            return self.multiply(colour, share), self.complement(self.multiply(Value(min(1.0, float(colour.mean().max()))), share))
        towards, mean = min(1.0, max(0.0, self.number(tint, stack, "sheen tint"))), base.mean()
        hue = mean / luminance(base) if luminance(base) > 0 else np.ones(3)
        share = self.by_view(("sheen",), lambda c, behind: view_albedos.schlick_sheen(c))
        return self.multiply(self.multiply(weight, Value(1 + towards * (hue - 1))), share), ONE

    def closure_eevee_specular(self, node, stack):
        return Surface(diffuse=self.value(node.inputs["Base Color"], stack),
                       coat=self.value(node.inputs["Specular"], stack),
                       emission=self.value(node.inputs["Emissive Color"], stack), **self.rough(node, stack))

    def clear_coat(self, node, stack):
        """(coat or None, factor of the colours beneath)"""
        share = min(1.0, max(0.0, self.number(input_of(node, "Clearcoat", "Coat Weight"), stack, "clearcoat")))
        if share <= 0:
            return None, ONE
        rough = min(1.0, max(0.0, self.number(input_of(node, "Clearcoat Roughness", "Coat Roughness"), stack,
                                              "clearcoat roughness")))
        normal = input_of(node, "Clearcoat Normal", "Coat Normal")
        if normal is not None and normal.is_linked:
            self.note("clearcoat", "Normals of coats, taken as those of what is beneath")
        if bpy.app.version < (4, 0, 0):
            # A quarter of it, of the distribution GTR1, whose half vectors have their median at tan²θ = α where GGX's
            # have it at α². It takes nothing from what is beneath.
            coat = ClearCoat(0.25 * share, math.sqrt(rough), 1.5)
            self.note("clearcoat", "Clearcoats (GTR1) as GGX of the same median width")
            return coat, ONE
        coat = ClearCoat(share, rough, min(10.0, max(1.0, self.number(node.inputs["Coat IOR"], stack, "coat IOR"))))
        tint = np.clip(self.value(node.inputs.get("Coat Tint"), stack).mean(), 0, 1)
        if (tint == 1).all():
            return coat, ONE
        self.note("coat tint", "Tints of coats, taken as of light from all sides")
        square = coat.ior ** 2  # mean of 1/cosine beneath the border, over the projected solid angle above it
        depth = 2 * square * (1 - math.sqrt(1 - 1 / square)) if square > 1 else 2.0
        return coat, Value(1 - share + share * tint ** depth)

    def closure_bsdf_principled(self, node, stack):
        self.bumps(node, stack)

        def value(*names):
            socket = input_of(node, *names)
            return self.value(socket, stack) if socket is not None else ZERO

        film = input_of(node, "Thin Film Thickness")
        if film is not None and not self.value(film, stack).is_zero():
            self.note("thin film", "Principled features left out")
        base = value("Base Color")
        scattered = value("Subsurface", "Subsurface Weight")
        if not scattered.is_zero():
            self.note("subsurface", "Principled features taken as diffuse")
            if node.inputs.get("Subsurface Color") is not None:
                base = self.mix(scattered, base, value("Subsurface Color"))
        metallic, transmission = self.clipped(self.grey(value("Metallic"))), value("Transmission", "Transmission Weight")
        if metallic.picture is not None and not transmission.is_zero():
            self.note("metallic", "Textures taken as their mean")
            metallic = Value(metallic.mean())
        ior = self.number(node.inputs["IOR"], stack, "IOR")
        if node.inputs.get("Specular IOR Level") is not None:  # 4.x
            f0 = self.multiply(value("Specular IOR Level"), Value(2 * normal_reflectance(ior)))
        else:
            f0 = self.multiply(value("Specular"), Value(0.08))
        tint = node.inputs.get("Specular Tint")
        if tint is not None and tint.type == "RGBA":  # 4.x: of the dielectric straight on, of metal at its edge
            tint = self.value(tint, stack)
            f0, tint = self.multiply(f0, tint), tuple(tint.mean())
        elif tint is not None:  # towards the base colour's hue
            share = np.clip(self.number(tint, stack, "specular tint"), 0, 1)
            if share > 0 and not base.is_zero():
                f0 = self.multiply(f0, Value(1 + share * (base.mean() / max(luminance(base), 1e-6) - 1)))
            tint = None
        dielectric = self.complement(metallic)
        opaque = self.multiply(dielectric, self.complement(transmission))
        gloss = self.even(node, stack, self.rough(node, stack))
        clearcoat, beneath = self.clear_coat(node, stack)
        sheen, left = self.sheen(node, stack, base)
        base, f0 = self.multiply(beneath, base), self.multiply(beneath, f0)
        # Before 4.0 each border coloured by the base, since then by its root. A diffuse share needs the base itself.
        pure = transmission.picture is None and (transmission.factor >= 0.99).all()
        through = self.multiply(base, base) if pure and bpy.app.version < (4, 0, 0) else base
        glass = self.multiply(self.multiply(through, dielectric), transmission)
        metal = base
        rough_glass = node.inputs.get("Transmission Roughness")
        if rough_glass is not None and not transmission.is_zero() and not self.value(rough_glass, stack).is_zero():
            self.note("transmission roughness", "Principled features left out")
        emission = self.multiply(value("Emission", "Emission Color"), value("Emission Strength"))
        opacity = value("Alpha")
        by_place = None
        if metallic.picture is not None:
            by_place = ByPlace(metallic, base, f0)
        diffuse = self.multiply(base, opaque)
        if sheen is not None:
            diffuse = self.add(self.multiply(diffuse, left), sheen if left is not ONE else self.multiply(sheen, opaque))
            if left is not ONE:  # gloss in the mean, which may be a picture's by now
                rest = Value(left.mean())
                f0, metal, glass = self.multiply(f0, rest), self.multiply(metal, rest), self.multiply(glass, rest)
        return Surface(diffuse=diffuse, metal=self.multiply(metal, metallic), glass=glass,
                       coat=self.multiply(f0, opaque), ior=ior, emission=emission, opacity=opacity, by_place=by_place,
                       slope=self.slope(node.inputs.get("Diffuse Roughness"), stack),
                       clearcoat=clearcoat, burley=bpy.app.version < (4, 0, 0), tint=tint, facets=facets(node), **gloss)


@dataclasses.dataclass
class Converted:
    """A material with the pictures of its slots and where they lie on a mesh."""
    name: str
    values: library.Material
    pictures: dict
    mapping: Mapping
    by_ray: bool = False  # other kinds of rays may see another
    source: tuple = (None, 0)  # name and pass index in Blender

    def plain_pictures(self):
        """Those that want coordinates on a mesh."""
        return {slot: p for slot, p in self.pictures.items() if not isinstance(p, ProgramPicture) and not p.is_by_view()}

    def attributes(self):
        """What its programs ask of meshes, each once."""
        return list(dict.fromkeys(a for p in self.pictures.values() if isinstance(p, ProgramPicture) for a in p.attributes()))

    def is_hole(self):
        """Whether no ray meets it."""
        return self.values.opacity < 2 * HOLE and "opacity" not in self.pictures and not any(self.values.emission)

    def is_same(self, other):
        return (bytes(self.values), self.mapping, {slot: p.key for slot, p in self.pictures.items()}) == \
            (bytes(other.values), other.mapping, {slot: p.key for slot, p in other.pictures.items()})


COARSE = "Textures that repeat much against others of their material, at a lower resolution"
SLOTS = ("diffuse", "specular", "translucency", "emission", "opacity")
NUMBERS = ("roughness", "metallic", "diffuse_roughness")


class Materials:
    """Numbers materials and images of one scene, converting each once."""

    def __init__(self, report, max_shininess=1000.0, images=None, check=lambda: None):
        self.report, self.max_shininess = report, max_shininess
        self.images = images or Images(report, check)
        self.converted, self.pictures = [], []
        self.aspect, self.pixel, self.aov = 1.0, 0.0, None  # of the frame: width over height; cameras.pixel_width
        self._attributes = {}
        self.displacements = {}  # (height, whether in the world's units) by the full name of materials that move vertices
        self._numbers, self._picture_numbers = {}, {}

    def held_out(self, number):
        """Index of the same material as a hole to the camera."""
        return self._flagged(number, "holdout", library.HOLDOUT)

    def _flagged(self, number, name, flags):
        """Index of the same material with more flags."""
        if (number, name) not in self._numbers:
            base = self.converted[number]
            values = type(base.values).from_buffer_copy(base.values)
            values.flags |= flags
            self._numbers[number, name] = self._add(dataclasses.replace(base, name=f"{base.name} ({name})", values=values))
        return self._numbers[number, name]

    def _add(self, converted):
        self.converted.append(converted)
        return len(self.converted) - 1

    def numbers(self, material, pane=lambda: 0, bare=False):
        """Index of a Blender material (None: the default grey) for each kind of ray, in the order of library.RAYS; kinds
        that see it alike have one. `pane`: flags of glass on this mesh, asked of glass alone: light goes straight through
        panes; bodies bend it. `bare`: the mesh has no UV map."""
        key = None if material is None else material.name_full
        if key not in self._numbers:
            self._numbers[key] = self._number_by_ray(material)
        return tuple(self._on_mesh(self._without_uvs(number) if bare else number, pane) for number in self._numbers[key])

    def _without_uvs(self, number):
        """Index of the same material, whose normal map is one colour then, and whose tangents a program must have."""
        base = self.converted[number]
        picture = base.pictures.get("normal")
        if picture is None or isinstance(picture, ProgramPicture):
            return number
        if (number, "bare") not in self._numbers:
            bent = mapped_normal(of_picture(picture), const(base.values.normal_strength), "")
            pictures = {slot: p for slot, p in base.pictures.items() if slot != "height"} | {"normal": ProgramPicture(base.name, bent)}
            values = type(base.values).from_buffer_copy(base.values)
            values.normal_texture, values.normal_strength, values.height_texture = self.picture_number(pictures["normal"]), 1.0, 0
            self._numbers[number, "bare"] = self._add(dataclasses.replace(base, name=f"{base.name} (no UV map)", pictures=pictures, values=values))
        return self._numbers[number, "bare"]

    def _number_by_ray(self, material):
        first = self._convert(material, "camera")
        numbers = [self._add(first)]
        if not first.by_ray:
            return numbers * len(library.RAYS)
        for ray in list(library.RAYS)[1:]:
            converted = self._convert(material, ray)
            converted.name += f" ({ray} rays)"
            known = [n for n in numbers if self.converted[n].is_same(converted)]
            numbers.append(known[0] if known else self._add(converted))
        return numbers

    def _on_mesh(self, number, pane):
        values = self.converted[number].values
        if values.transmission <= 0 or values.flags & library.SHADOWS_PASS:
            return number
        flags = pane()
        if flags & library.OPEN_GLASS and any(values.absorption):
            flags = 0  # of what is below water shadow rays do not know how deep
        if flags:
            return self._flagged(number, "sheet" if flags & library.OPEN_GLASS else "pane", flags)
        self.report.note(self.converted[number].name, "Glass bodies: lamps do not shine straight through them, their light passes along light paths alone")
        return number

    def picture_number(self, picture):
        """1 + index among the scene's images."""
        if picture.key not in self._picture_numbers:
            self.pictures.append(picture)
            self._picture_numbers[picture.key] = len(self.pictures)
        return self._picture_numbers[picture.key]

    def attribute_number(self, name):
        """Of what programs ask of meshes: a tuple that names it."""
        return self._attributes.setdefault(name, len(self._attributes))

    def items(self):
        return [(c.name, c.values) for c in self.converted]

    def image_items(self):
        items = []
        for picture in self.pictures:  # which grows by the images of programs
            items.append(picture.compiled(self.picture_number, self.attribute_number) if isinstance(picture, ProgramPicture)
                         else image_of(picture))
        return items

    def _convert(self, material, ray):
        name = "default" if material is None else material.name
        surface, normals, heights = self._surface(material, name, ray)
        m = library.Material(opacity=1.0)
        pictures = {}
        factors = {}
        values = self._gloss(surface, name, m)
        for slot in NUMBERS:
            if slot in values:
                setattr(m, slot, float(values[slot].factor[0]))
                if values[slot].picture is not None:
                    pictures[slot] = values[slot].picture
        for slot in SLOTS:
            value = values.get(slot) or getattr(surface, slot)
            if value.picture is not None and value.is_zero():
                value = ZERO
            if value.picture is not None and value.picture.is_by_view() and slot in ("emission", "opacity"):
                linear = value.picture.linear()
                if np.ptp(linear) < 1e-6:
                    value = Value(np.round(value.mean(), 6))
                else:
                    value = Value(value.factor, ProgramPicture(name, of_picture(value.picture)))
            if slot == "emission" and (value.mean() < -1e-3).any():
                self.report.note(name, "Emission below 0 left out")
            factors[slot] = np.maximum(np.nan_to_num(value.factor), 0)
            if value.picture is not None:
                pictures[slot] = value.picture
        for slot in ("diffuse", "specular", "translucency"):
            if cut_of(factors[slot], pictures.get(slot)) > 0.01:
                self.report.note(name, "Colours above 1 cut to 1")
            # With a picture the library cuts the product.
            getattr(m, slot)[:] = np.minimum(factors[slot], 1 if slot not in pictures else LARGEST_FACTOR).tolist()
        m.emission[:] = factors["emission"].tolist()
        if factors["emission"].any():
            m.flags |= library.EMIT_BOTH_SIDES
        if surface.holdout:
            m.flags |= library.HOLDOUT
        opacity = float(factors["opacity"].mean())
        m.opacity = min(1.0, max(opacity, HOLE))
        if normals is not None:
            pictures["normal"], m.normal_strength = normals
        if heights is not None:
            pictures["height"], m.bump_distance, m.bump_strength = heights
        every = [slot for slot in (*SLOTS, *NUMBERS, "normal", "height")
                 if slot in pictures and not pictures[slot].is_by_view() and not isinstance(pictures[slot], ProgramPicture)]
        together = aligned([pictures[slot] for slot in every], lambda p: self.report.note(f"{name} ({p})", COARSE))
        if together is None or "normal" in every and not together[0].mapping.is_upright():  # which tangents follow
            # Each looked up by a program of its own, but for those of the first mapping; normals and heights stay.
            first = next((pictures[slot] for slot in ("normal", "height") if slot in every), pictures[every[0]])
            apart = [slot for slot in every if pictures[slot].mapping != first.mapping]
            for slot in set(apart) & {"normal", "height"}:
                self.report.note(name, "Textures of one material on several coordinates, all laid on the first's")
            for slot in set(apart) - {"normal", "height"}:
                pictures[slot] = ProgramPicture(name, of_picture(pictures[slot]))
            every = [slot for slot in every if pictures[slot].mapping == first.mapping and not isinstance(pictures[slot], ProgramPicture)]
        else:
            pictures.update(zip(every, together))
        mapping = pictures[every[0]].mapping if every else Mapping()
        for slot, picture in pictures.items():
            if slot == "opacity" and not isinstance(picture, ProgramPicture):
                picture = self._mask(picture)
            setattr(m, slot + "_texture", self.picture_number(picture))
        if {"normal", "height"} & set(pictures):
            if getattr(getattr(material, "cycles", None), "use_bump_map_correction", True):  # a setting since 4.3
                m.flags |= library.BUMP_SHADOWS
            else:  # Cycles then dims by another term, 2 to 8 % on a strongly bent map
                self.report.note(name, "Bump Map Correction switched off: bent normals dim nothing here, and a little in Cycles")
        source = (None, 0) if material is None else (material.name, material.pass_index)
        return Converted(name, m, pictures, mapping, surface.by_ray, source)

    def _gloss(self, surface, name, m):
        """Values of the slots diffuse and specular, of roughness and metallic where they are pictures, and of the diffuse part's
        roughness; flags and numbers into `m`."""
        evaluator = Evaluator(name, self.images, self.report)
        add = evaluator.add
        # A lobe without Fresnel stands beside Lambert alone; beside other shaders it counts as metal.
        bare = surface.by_place is None and all(luminance(v) <= 0 for v in (surface.metal, surface.glass, surface.coat))
        if luminance(surface.gloss) > 0 and not bare:
            surface = dataclasses.replace(surface, metal=add(surface.metal, surface.gloss), gloss=ZERO)
        d, metal, glass = luminance(surface.diffuse), luminance(surface.metal), luminance(surface.glass)
        coat, diffuse = surface.coat, surface.diffuse
        matt = metal + glass + luminance(coat) + luminance(surface.gloss) <= 0 and surface.clearcoat is None
        once = bpy.app.version < (4, 3, 0)
        grooved = luminance(surface.slope) > 0 and d > 0
        if matt and not (d > 0 and (surface.burley or surface.slope.picture is not None)):
            if grooved:
                m.flags |= library.OREN_NAYAR | (library.FACETS_ONCE if once else 0)
                m.roughness = float(surface.slope.factor[0])
            return {"diffuse": diffuse, "specular": ZERO}
        m.flags |= library.GGX | surface.facets
        if surface.burley and luminance(surface.gloss) <= 0:
            m.flags |= library.BURLEY
        if surface.tint is not None:
            m.specular_tint[:] = np.clip(surface.tint, 1e-3, 1).tolist()
        if surface.clearcoat is not None:
            c = surface.clearcoat
            m.coat, m.coat_roughness, m.coat_ior = c.share, self._raised(c.roughness, name), c.ior
        least = roughness_of(self.max_shininess)
        pictured = {}
        if grooved and not m.flags & library.BURLEY:
            m.flags |= library.DIFFUSE_ONCE if once else 0
            pictured["diffuse_roughness"] = surface.slope
        if surface.rough_picture is not None:
            value = surface.rough_picture
            texels = None if isinstance(value.picture, ProgramPicture) else value.texels()
            if texels is None or ((MIRROR <= texels) & (texels < least)).any():
                self._raised(MIRROR, name)
                value = evaluator.apply("gloss limit", lambda r: np.where((MIRROR <= r) & (r < least), least, r), value)
            pictured["roughness"] = value
        m.roughness, m.ior = surface.roughness if matt else self._raised(surface.roughness, name), min(10.0, max(0.1, surface.ior))
        if luminance(surface.gloss) > 0:
            m.flags |= library.NO_FRESNEL
            return {**pictured, "diffuse": diffuse, "specular": surface.gloss}
        if surface.by_place is not None:
            pictured["metallic"] = surface.by_place.metallic
            f0, glass = surface.by_place.f0, 0.0
            return {**pictured, "diffuse": surface.by_place.base, "specular": self._specular(f0, glass, name, m)}
        parts = [value for value in (diffuse, surface.metal, surface.glass) if luminance(value) > 0]
        if not all(same_hue(value, parts[0]) for value in parts):
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
        if surface.absorption is not None and m.transmission > 0:
            m.absorption[:] = surface.absorption
        if surface.shadows_pass and m.transmission > 0:
            m.flags |= library.SHADOWS_PASS
        opaque = (1 - m.metallic) * (1 - m.transmission)
        f0 = Value(coat.factor / opaque, coat.picture) if opaque > 1e-3 else ZERO
        return {**pictured, "diffuse": base, "specular": self._specular(f0, glass, name, m)}

    def _raised(self, roughness, name):
        least = roughness_of(self.max_shininess)
        if not MIRROR <= roughness < least:
            return roughness
        self.report.note(name, f"Roughness raised to the gloss limit (exponent {self.max_shininess:g})")
        return least

    def _specular(self, f0, glass, name, m):
        """Of a dielectric share with that reflectance straight on; may change the index in `m`."""
        most = float(f0.factor.max())
        if most <= 0:
            return ZERO
        if most > 0.66:
            self.report.note(name, "Coats that reflect more than 66 % straight on, cut to that")
        if glass <= 0 or normal_reflectance(m.ior) < most:
            m.ior = ior_of(most)
        factor = f0.factor / normal_reflectance(m.ior)
        return Value(factor if f0.picture is not None else np.minimum(1, factor), f0.picture)

    @staticmethod
    def _mask(picture):
        """The same picture in one channel, as masks are."""
        texels, flags = picture.stored()
        if texels.shape[2] == 1:
            return picture
        grey = (picture.linear() @ LUMINANCE)[..., None]
        return Picture(picture.name + " mask", (picture.key, "mask"), picture.mapping, picture.flags, linear=grey)

    def _displace(self, reader, material, socket):
        """Displacement as a bump beneath the material's own normals, of vertices, or both."""
        # A material's own since 4.1.
        method = getattr(material, "displacement_method", None) or getattr(getattr(material, "cycles", None), "displacement_method", "BUMP")
        try:
            height = reader.compiler.height(socket)
            if height is not None and method != "BUMP":
                self.displacements[material.name_full] = height
            if height is not None and method != "DISPLACEMENT" and not height[0].constant():
                reader.base_normal = bump_of(height[0], moved=method == "BOTH", width=reader.pixel)
        except CannotCompile as what:
            reader.note(str(what), "Displacement left out")

    def _surface(self, material, name, ray):
        if self.aov is None:
            return self._shaded_surface(material, name, ray)
        surface = self._shaded_surface(material, name, ray)[0]
        value = self._aov_value(material, name)
        # Without that output it stands before others, and counts as nothing.
        return Surface(emission=value or ZERO, opacity=surface.opacity, clear=surface.clear, holdout=value is None), None, None

    def _aov_value(self, material, name):
        """What the material's tree gives to the output of that name; None: it has none."""
        if material is None or not material.use_nodes or material.node_tree is None:
            return None
        reader = self._reader(material, name)
        for node in material.node_tree.nodes:
            if node.type == "OUTPUT_AOV" and self.aov[0] in {getattr(node, "aov_name", ""), node.name}:
                return reader.value(node.inputs["Value" if self.aov[1] == "VALUE" else "Color"], ())
        return None

    def _reader(self, material, name):
        reader = SurfaceReader(name, self.images, self.report)
        reader.aspect, reader.pixel, reader.material_index = self.aspect, self.pixel, material.pass_index
        return reader

    def _shaded_surface(self, material, name, ray):
        if material is None:
            return Surface(diffuse=Value(0.8)), None, None
        if not compat.has_nodes(material):
            return Surface(diffuse=Value(list(material.diffuse_color)[:3])), None, None
        reader = self._reader(material, name)
        reader.ray = ray
        tree = material.node_tree
        output = tree.get_output_node("CYCLES") or tree.get_output_node("ALL")
        if output is None:
            return Surface(), None, None
        if output.inputs["Displacement"].is_linked:
            self._displace(reader, material, output.inputs["Displacement"])
        # Outputs inside a group cannot be: the output stands in the tree itself.
        surface = reader.surface(output.inputs["Surface"])
        if is_tinted(surface):
            surface = filtering(surface, reader)
        if output.inputs["Volume"].is_linked:
            if not output.inputs["Surface"].is_linked:
                surface = Surface(opacity=ZERO, clear=True)  # no surface: rays pass
            if luminance(surface.glass) > 0:
                reader.ray = "transmission"  # those are the rays inside
                surface = dataclasses.replace(surface, absorption=tuple(volumes.absorption(reader, output.inputs["Volume"])))
            else:
                reader.note("", "Volumes left out")
        return dataclasses.replace(surface, by_ray=reader.by_ray), reader.normals, reader.heights
