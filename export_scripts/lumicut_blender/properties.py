# SPDX-License-Identifier: Apache-2.0
"""Settings of a scene. Those of the integrators are drawn from the library's own parameter tables, none is named here."""
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
    ("binned-agglomerative+reinsert:20x8", "Best for Long Renders", "As the default, with more reinsertion: 20 % in 8 passes. A few percent less work for each ray"),
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

DEFAULT_INTEGRATOR = "illumination_cut"
PRESETS = {
    # name, a quality of the library's: (label, tooltip, own settings, integrator, which the library suggests parameters for)
    "draft": ("Draft", "A first look: one sample, few lights, wide bounds",
              {"samples": 1}, DEFAULT_INTEGRATOR),
    "good": ("Good", "For most images: the mean of 16 passes of 3,000 lights each, with what the clamp takes brought back, denoised",
             {"samples": 1, "passes": 16}, "lightcuts"),
    "reference": ("Reference", "256 passes that each sum all of 4,000 lights anew, with what the clamp takes brought back: slow, and as path traced: corners, gloss and glass too",
                  {"samples": 1, "passes": 256}, "exhaustive"),
}


def property_of(parameter):
    """The Blender property that a row of the library's table asks for."""
    unit = parameter["unit"]
    text = parameter["description"] + (f" [{unit}]" if unit else "")
    common = {"name": parameter["label"], "description": text}
    default = parameter["default_text"]
    low, high = parameter["minimum"], parameter["maximum"]
    if parameter["type"] == library.BOOL:
        return BoolProperty(default=default in {"1", "true"}, **common)
    if parameter["type"] == library.CHOICE:
        names = parameter["choices"].split("|")
        items = [(name, name.replace("_", " ").capitalize(), text) for name in names]
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

    def __init__(self, integrators):
        self.integrators = integrators
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
        row = next((row for row in rows if row.id == wanted), rows[0])
        return row.id, row.presets[quality]

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


def apply_preset(settings, name):
    _, _, own, wanted = PRESETS[name]
    for key in (*STOPS, "denoise", "firefly_filter"):
        settings.property_unset(key)
    for key, value in own.items():
        setattr(settings, key, value)
    settings.integrator, values = tables.suggested(name, wanted)
    for group, parameters in tables.groups():
        if group not in {COMMON, settings.integrator}:
            continue
        for p in parameters:
            target = getattr(settings, group)
            if p["id"] in values:
                setattr(target, p["id"], value_of(p, values[p["id"]]))
            elif p["id"] != "seed":
                target.property_unset(p["id"])


def register():
    global tables
    lib = runtime.loaded()
    tables = Tables(lib.integrators() if lib is not None else [])
    annotations = {
        "samples": IntProperty(name="Samples", description="Samples a pixel, for edges, texture and depth of field. One lies at the pixel's centre",
                               default=4, min=1, max=65536, soft_max=64),
        "passes": IntProperty(name="Passes", description="Whole images with virtual lights of their own, averaged: with Compensate they converge to the path traced image. 0: until stopped by what follows",
                              default=1, min=0, max=1 << 20, soft_max=64),
        "max_seconds": FloatProperty(name="Time Limit", description="Stop after the pass that ends nearest to this; 0: never",
                                     default=0.0, min=0.0, max=1e9, unit="TIME_ABSOLUTE"),
        "target_error": FloatProperty(name="Target Error", description="Stop after at least 8 passes, when the error is at most this share of a pixel's luminance, in as large a part of the pixels as Confidence says; 0: never",
                                      default=0.0, min=0.0, max=1.0, precision=3, step=1),
        "confidence": FloatProperty(name="Confidence", description="Of the interval of the pass Error and of Target Error",
                                    default=0.95, min=0.5, max=0.999, precision=3, step=1),
        "denoise": BoolProperty(name="Denoise", description="From two passes on: take away the noise of compensation, gloss and glass, by what the passes tell of it. The light of virtual lights stays as it is",
                                default=True),
        "firefly_filter": BoolProperty(name="Spread Fireflies", description="What is bright in a single pass is spread over its surroundings, so that it is no dot. No light is lost",
                                       default=True),
        "denoise_viewport": BoolProperty(name="Viewport", description="The viewport's last picture is the mean of four passes, denoised: for scenes that compensate, and for the path tracer",
                                         default=False),
        "accel": EnumProperty(name="Tree for Rays", description="What finds the triangles that rays hit", items=ACCELS, default="bvh"),
        "builder": EnumProperty(name="Tree Builder", description="How the library's own tree is made", items=BUILDERS, default="DEFAULT"),
        "robust": BoolProperty(name="Watertight Rays", description="No ray slips between two triangles that share an edge; without it, tracing is a little faster",
                               default=True),
        "max_shininess": FloatProperty(name="Gloss Limit", description="Sharpest glossy lobe that lights shade, as Blinn's exponent: sharper ones, up to mirrors, show the virtual lights as blots",
                                       default=300.0, min=1.0, max=100000.0),
        "viewport_lights": IntProperty(name="Viewport Lights", description="Virtual lights while the viewport renders",
                                       default=5000, min=100, max=1000000),
        "threads": IntProperty(name="Threads", description="0: all", default=0, min=0, max=1024),
    }
    if tables.integrators:
        identifiers = [row.id for row in tables.integrators]
        annotations["integrator"] = EnumProperty(
            name="Integrator", description="How the virtual lights are summed",
            items=[(row.id, row.label, f"{row.description}. {row.source}") for row in tables.integrators],
            default=DEFAULT_INTEGRATOR if DEFAULT_INTEGRATOR in identifiers else identifiers[0])
    for group, parameters in tables.groups():
        cls = type(f"LumicutParameters_{group}", (bpy.types.PropertyGroup,),
                   {"__annotations__": {p["id"]: property_of(p) for p in parameters}})
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
