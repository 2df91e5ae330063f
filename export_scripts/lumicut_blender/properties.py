# SPDX-License-Identifier: Apache-2.0
"""Settings of a scene. Those of the integrators are drawn from the library's own parameter tables, none is named here.
What nobody set is as the preset Good has it."""
import math
import re

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, PointerProperty

from . import runtime
from .lumicut import library

COMMON = "common"  # the group of parameters that nearly all integrators share
ACCELS = [
    ("bvh", "BVH", "The library's own tree: shares nothing with the host"),
    ("embree", "Embree", "Intel's tree, where the library has it; the add-on's zip has not. On Blender from blender.org, which carries an Embree of its own, the two may clash"),
]
BUILDERS = [  # of lumicut_scene_desc
    ("DEFAULT", "Default", "Binned splits down to 4096 triangles, agglomeration below, then reinsertion: 5 % in 3 passes"),
    ("binned-agglomerative+reinsert:20x8", "Long Renders", "As the default, with more reinsertion: 20 % in 8 passes. A few percent less work for each ray"),
    ("binned", "Fastest to Build", "Binned splits alone"),
]
PASSES = {  # of the library's channels: pass name, property, label
    "albedo": ("Albedo", "use_pass_albedo", "Albedo", "Diffuse and specular reflectance", "RGB", "COLOR"),
    "cut_size": ("Lumicut Cut Size", "use_pass_cut_size", "Cut Size", "Heat map: clusters or lights summed, a sample", "X", "VALUE"),
    "rays": ("Lumicut Rays", "use_pass_rays", "Shadow Rays", "Heat map: shadow rays, a sample", "X", "VALUE"),
    "bounds": ("Lumicut Bounds", "use_pass_bounds", "Bounds", "Heat map: error bounds evaluated, a sample", "X", "VALUE"),
    "error": ("Lumicut Error", "use_pass_error", "Error", "Half the width of the luminance's confidence interval, from the passes: 0 where there are fewer than two", "X", "VALUE"),
    "illuminance": ("Lumicut Illuminance", "use_pass_illuminance", "Illuminance", "Lux on the side that is seen. Takes about as long again", "X", "VALUE"),
}
GROUP_PASS = "Combined_"  # of a light group, as Cycles names it

STOPS = ("passes", "max_seconds", "target_error", "confidence")  # of lumicut_render_desc, under the same names

USUAL_ERROR = 0.02  # when the noise threshold is switched on
RENDER_SETTINGS = ("samples", *STOPS, "denoise", "firefly_filter")  # what presets set beside the integrator and its parameters
SMALL_WORDS = {"a", "an", "and", "are", "as", "at", "by", "for", "in", "of", "or", "the", "to", "with"}


def title_case(text):
    """A label as Blender writes them: "Clamp (relative)" becomes "Clamp (Relative)"."""
    words = re.split(r"([\s(]+)", text)
    return "".join(word if i > 0 and word in SMALL_WORDS else word[:1].upper() + word[1:] for i, word in enumerate(words))


def property_of(parameter, default=None):
    """The Blender property that a row of the library's table asks for. `default`: another one, as text."""
    unit = parameter["unit"]
    text = parameter["description"] + (f" [{unit}]" if unit else "")
    common = {"name": title_case(parameter["label"]), "description": text}
    default = parameter["default_text"] if default is None else default
    low, high = parameter["minimum"], parameter["maximum"]
    if parameter["type"] == library.BOOL:
        return BoolProperty(default=default in {"1", "true"}, **common)
    if parameter["type"] == library.CHOICE:
        names = parameter["choices"].split("|")
        items = [(name, title_case(name.replace("_", " ")), text) for name in names]
        return EnumProperty(items=items, default=default, **common)
    if parameter["type"] == library.INT:
        limit = 2**31 - 1
        return IntProperty(default=int(default), min=int(max(low, -limit)), max=int(min(high, limit)), **common)
    return FloatProperty(default=float(default), min=low, max=min(high, 3e38), precision=4, step=1,
                         subtype="DISTANCE" if unit == "scene units" else "NONE", **common)


def tracing_of(settings):
    """What traces rays, as library.Scene takes it: the library's own tree where it has no other."""
    accel = settings.accel if runtime.has_accel(settings.accel) else "bvh"
    own = accel == "bvh" and settings.builder != "DEFAULT"
    return {"accel": accel, "builder": settings.builder if own else None, "robust": settings.robust}


def text_of(value):
    """As lumicut_integrator_set takes it. Blender keeps floats in single precision: 0.02 must not become 0.0199999996."""
    if isinstance(value, bool):
        return "true" if value else "false"
    return f"{value:.7g}" if isinstance(value, float) else str(value)


def value_of(parameter, text):
    """The other way round, for a property of property_of."""
    kind = parameter["type"]
    if kind == library.BOOL:
        return text in {"1", "true"}
    return text if kind == library.CHOICE else int(text) if kind == library.INT else float(text)


class Tables:
    """The parameter tables, parted into what nearly all integrators share and what each has alone."""

    def __init__(self, integrators, presets=(), usual=None):
        """What library.Library's integrators() and presets() give."""
        self.integrators = integrators
        self.presets = {row.id: row for row in presets}
        self.usual = self.presets.get(usual)
        self.of = {row.id: row.parameters for row in integrators}
        self.ids = {identifier: {p["id"] for p in parameters} for identifier, parameters in self.of.items()}
        first = integrators[0].parameters if integrators else []
        # Shared by more than half: a path tracer has no virtual lights, so their parameters are not its own.
        self.common = [p for p in first if 2 * sum(p["id"] in ids for ids in self.ids.values()) > len(self.ids)]
        self.common_ids = {p["id"] for p in self.common}

    def row(self, integrator):
        return next(row for row in self.integrators if row.id == integrator)

    def has(self, integrator, trait):
        """Whether it has a trait, such as library.LIGHT_GROUPS."""
        return bool(self.row(integrator).traits & trait)

    def suggested(self, quality, wanted=None):
        """(integrator, its parameters) for a quality: the wanted one, or the first that the library suggests something for,
        or the first."""
        rows = [row for row in self.integrators if row.presets[quality]] or self.integrators
        row = next((row for row in rows if row.id == wanted), rows[0] if rows else None)
        return (row.id, row.presets[quality]) if row is not None else ("", {})

    def groups(self):
        """[(group, [parameters])]; the common ones first."""
        return [(COMMON, self.common)] * bool(self.integrators) + [(name, self.own_of(name)) for name in self.of]

    def own_of(self, integrator):
        return [p for p in self.of.get(integrator, []) if p["id"] not in self.common_ids]

    def common_of(self, integrator):
        """Of the common parameters those that the integrator has."""
        return [p for p in self.common if p["id"] in self.ids.get(integrator, ())]


tables = Tables([])
_classes = []


class LumicutViewLayerSettings(bpy.types.PropertyGroup):
    __annotations__ = {prop: BoolProperty(name=label, description=text) for _, prop, label, text, _, _ in PASSES.values()} | {
        "use_pass_denoising": BoolProperty(name="Denoising Data", description="What a denoiser takes: the image with fireflies spread (Noisy Image), albedo, normal and depth of what is seen, in mirrors and through glass too")}


def parameters_of(settings, integrator=None):
    """{name: text} of an integrator's parameters as the scene has them."""
    integrator = integrator or settings.integrator
    own = {p["id"]: text_of(getattr(getattr(settings, integrator), p["id"])) for p in tables.own_of(integrator)}
    return common_parameters_of(settings, integrator) | own


def common_parameters_of(settings, integrator):
    return {p["id"]: text_of(getattr(getattr(settings, COMMON), p["id"])) for p in tables.common_of(integrator)}


def preset_values(name):
    """{(group or None for the scene's own, property): value} of all that a preset sets: but for the seed, what an image
    depends on."""
    preset = tables.presets[name]
    values = {(None, key): value for key, value in of_preset(preset).items()}
    values[None, "integrator"] = preset.integrator
    for group, parameters in ((COMMON, tables.common_of(preset.integrator)), (preset.integrator, tables.own_of(preset.integrator))):
        values |= {(group, p["id"]): value_of(p, preset.parameters.get(p["id"], p["default_text"])) for p in parameters if p["id"] != "seed"}
    return values


def of_preset(preset):
    """{name: value} of RENDER_SETTINGS. A frame of one iteration has nothing to denoise by, so that the switch may stay on."""
    return DEFAULTS | {"samples": preset.samples, "passes": preset.passes, "target_error": preset.target_error}


def _owner(settings, group):
    return settings if group is None else getattr(settings, group)


def apply_preset(settings, name):
    for (group, key), value in preset_values(name).items():
        setattr(_owner(settings, group), key, value)


def active_preset(settings):
    """The preset that the settings are those of, or None."""
    def same(a, b):
        return math.isclose(a, b, rel_tol=1e-5) if isinstance(b, float) else a == b

    for name in tables.presets:
        if all(same(getattr(_owner(settings, group), key), value) for (group, key), value in preset_values(name).items()):
            return name
    return None


def saved_values(settings):
    """As preset_values, of the scene: with all that a file or a preset of the user's keeps."""
    values = {(None, key): getattr(settings, key) for key in (*RENDER_SETTINGS, "integrator")}
    for group, parameters in tables.groups():
        values |= {(group, p["id"]): getattr(getattr(settings, group), p["id"]) for p in parameters}
    return values


def _set_threshold(settings, on):
    settings.target_error = USUAL_ERROR if on else 0.0


def _set_viewport_threshold(settings, on):
    settings.viewport_target_error = USUAL_ERROR if on else 0.0


DEFAULTS = {"samples": 1, "passes": 1, "max_seconds": 0.0, "target_error": 0.0, "confidence": 0.95, "denoise": True, "firefly_filter": True}


def register():
    global tables
    lib = runtime.loaded()
    tables = Tables(lib.integrators(), *lib.presets()) if lib is not None else Tables([])
    untouched = of_preset(tables.usual) if tables.usual else DEFAULTS
    annotations = {
        "version": IntProperty(description="Of what the file's settings mean, see migration.py", default=0, options={"HIDDEN"}),
        "samples": IntProperty(name="Samples", description="Samples a pixel in each iteration, for edges, texture and depth of field. Leave it at 1 where there are many iterations",
                               default=untouched["samples"], min=1, max=65536, soft_max=64),
        "passes": IntProperty(name="Iterations", description="Images with virtual lights of their own that are averaged: twice as many halve the noise's square. 0: until the noise threshold or the time limit ends the render",
                              default=untouched["passes"], min=0, max=1 << 20, soft_max=256),
        "max_seconds": FloatProperty(name="Time Limit", description="Stop after the iteration that ends nearest to this, in seconds. 0: no limit",
                                     default=untouched["max_seconds"], min=0.0, max=1e9, unit="TIME_ABSOLUTE"),
        "use_threshold": BoolProperty(name="Noise Threshold", description="Stop before the last iteration where the image is clean enough",
                                      get=lambda settings: settings.target_error > 0, set=_set_threshold),
        "target_error": FloatProperty(name="Noise Threshold", description="Stop after 8 iterations or more, when the error is at most this share of a pixel's luminance, in as large a part of the pixels as Confidence says. Smaller is cleaner and slower. 0: never",
                                      default=untouched["target_error"], min=0.0, max=1.0, precision=3, step=1),
        "confidence": FloatProperty(name="Confidence", description="How sure the noise threshold and the pass Error are: the part of the pixels whose error is within what they say",
                                    default=untouched["confidence"], min=0.5, max=0.999, precision=3, step=1),
        "denoise": BoolProperty(name="Denoise", description="Take away the noise of compensation, gloss and glass at the end of a frame of two or more iterations, by what these tell of it. The light of virtual lights stays as it is",
                                default=untouched["denoise"]),
        "firefly_filter": BoolProperty(name="Spread Fireflies", description="Spread what is bright in a single iteration over its surroundings, so that it is no dot. No light is lost",
                                       default=untouched["firefly_filter"]),
        "viewport_passes": IntProperty(name="Iterations", description="How many images the viewport averages after the first coarse ones, each with virtual lights of its own",
                                       default=16, min=1, max=1 << 20, soft_max=256),
        "viewport_seconds": FloatProperty(name="Time Limit", description="Stop refining the viewport after so many seconds. 0: no limit",
                                          default=0.0, min=0.0, max=1e9, unit="TIME_ABSOLUTE"),
        "use_viewport_threshold": BoolProperty(name="Noise Threshold", description="Stop refining the viewport where its picture is clean enough",
                                               get=lambda settings: settings.viewport_target_error > 0, set=_set_viewport_threshold),
        "viewport_target_error": FloatProperty(name="Noise Threshold", description="Stop refining the viewport when the error is at most this share of a pixel's luminance. 0: never",
                                               default=0.0, min=0.0, max=1.0, precision=3, step=1),
        "denoise_viewport": BoolProperty(name="Denoise", description="Denoise the viewport's picture after its last iteration, where there are two or more",
                                         default=True),
        "accel": EnumProperty(name="Rays By", description="What finds the triangles that rays hit", items=ACCELS, default="bvh"),
        "builder": EnumProperty(name="Builder", description="How the library's own tree is made: takes time once a frame, and saves some on each ray", items=BUILDERS, default="DEFAULT"),
        "robust": BoolProperty(name="Watertight Rays", description="No ray slips between two triangles that share an edge. Switch it off to trace a little faster",
                               default=True),
        "max_shininess": FloatProperty(name="Gloss Limit", description="Sharpest glossy lobe that lights shade, as Blinn's exponent: sharper ones, up to mirrors, show the virtual lights as blots. Lower it where gloss is blotchy",
                                       default=300.0, min=1.0, max=100000.0),
        "viewport_lights": IntProperty(name="Lights", description="Virtual lights in each iteration of the viewport. Fewer answer faster, more are smoother",
                                       default=5000, min=100, max=1000000),
        "threads": IntProperty(name="Threads", description="Threads that render. 0: as many as the machine has. Leave one to the interface where there are few",
                               default=0, min=0, max=1024),
    }
    integrator, suggested = (tables.usual.integrator, tables.usual.parameters) if tables.usual else tables.suggested("good")
    if tables.integrators:
        annotations["integrator"] = EnumProperty(
            name="Integrator", description="How the virtual lights are summed",
            items=[(row.id, title_case(row.label), f"{row.description}. {row.source}") for row in tables.integrators],
            default=integrator)
    for group, parameters in tables.groups():
        defaults = suggested if group in {COMMON, integrator} else {}
        cls = type(f"LumicutParameters_{group}", (bpy.types.PropertyGroup,),
                   {"__annotations__": {p["id"]: property_of(p, defaults.get(p["id"])) for p in parameters}})
        bpy.utils.register_class(cls)
        _classes.append(cls)
        annotations[group] = PointerProperty(type=cls)
    settings = type("LumicutSettings", (bpy.types.PropertyGroup,), {"__annotations__": annotations})
    for cls in (settings, LumicutViewLayerSettings):
        bpy.utils.register_class(cls)
        _classes.append(cls)
    bpy.types.Scene.lumicut = PointerProperty(type=settings)
    bpy.types.ViewLayer.lumicut = PointerProperty(type=LumicutViewLayerSettings)


def unregister():
    del bpy.types.ViewLayer.lumicut
    del bpy.types.Scene.lumicut
    while _classes:
        bpy.utils.unregister_class(_classes.pop())
