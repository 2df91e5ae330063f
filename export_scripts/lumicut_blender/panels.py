# SPDX-License-Identifier: Apache-2.0
"""Panels of the render properties, laid out as those of Cycles are, and what all panels share. The integrators' parameters
are drawn from the library's tables: PLACES says which panel shows one, and the panel Virtual Lights has the rest."""
import blf
import bpy
from bl_ui.utils import PresetPanel

from . import compat, operators, properties, report, runtime

ENGINE = operators.ENGINE
PLACES = {  # parameter -> panel, label there
    "seed": ("advanced", "Seed"), "max_depth": ("bounces", "Total"), "clamp_lights": ("clamping", "Near Lights"),
    "clamp_distance": ("clamping", "Distance"), "clamp_relative": ("clamping", "Relative"), "compensate": ("caustics", "Compensate"),
}
LABELS = {"vpls": "Lights", "virtual_lights": "Shape", "environment_vpls": "For the World", "direct_share": "For Direct",
          "local_visibility": "Visibility", "coarse_separation": "Coarse Limit", "representatives": "Choices", "representative": "Standing In",
          "reconstruction": "Reconstruct", "refine_coarse": "Refinements", "material_weight": "Materials", "sampled": "Sampled",
          "bright": "Bright From", "normal_threshold": "Normals", "block": "Block Size"}
NAMES_SHOWN = 8  # of one note


class Panel:
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "render"
    COMPAT_ENGINES = {ENGINE}
    owner = None  # what the context must have for the panel to show

    @classmethod
    def poll(cls, context):
        return context.engine in cls.COMPAT_ENGINES and (cls.owner is None or getattr(context, cls.owner) is not None)


class LibraryPanel(Panel):
    """One of what the library offers."""

    @classmethod
    def poll(cls, context):
        return super().poll(context) and bool(properties.tables.integrators)


class VirtualLightsPanel(LibraryPanel):
    """One that counts where virtual lights give the light."""

    @classmethod
    def poll(cls, context):
        return super().poll(context) and lit_by_virtual_lights(context.scene.lumicut)


def split(layout):
    layout.use_property_split = True
    layout.use_property_decorate = False
    return layout


def wrapped(layout, text, context=None, icon="NONE", width=0):
    """Text in lines as wide as the region, or as `width` points."""
    scale = bpy.context.preferences.system.ui_scale or 1.0  # 0 without a window
    if not width:
        region = (context or bpy.context).region
        width = region.width / scale - 65 if region is not None else 230
    if icon != "NONE":
        width -= 20
    blf.size(0, 11 * scale)
    lines, line = [], ""
    for word in text.split():
        longer = f"{line} {word}" if line else word
        if line and blf.dimensions(0, longer)[0] > width * scale:
            lines.append(line)
            longer = word
        line = longer
    lines.append(line)
    column = layout.column(align=True)
    column.scale_y = 0.8
    for i, line in enumerate(lines):
        column.label(text=line, icon=icon if i == 0 else "BLANK1" if icon != "NONE" else "NONE")


def columns_for(labels, context):
    """In how many columns buttons stand so that none is cut off: all side by side, or half of them."""
    scale = bpy.context.preferences.system.ui_scale or 1.0
    width = context.region.width / scale if context.region is not None else 333
    blf.size(0, 11 * scale)
    widest = max(blf.dimensions(0, label)[0] for label in labels) / scale
    return len(labels) if (widest + 14) * len(labels) <= width - 60 else (len(labels) + 1) // 2


def draw_parameters(layout, settings, place):
    """The common parameters of the scene's integrator that have this place."""
    for p in properties.tables.common_of(settings.integrator):
        where, label = PLACES.get(p["id"], (None, None))
        if where == place:
            layout.prop(getattr(settings, properties.COMMON), p["id"], text=label or LABELS.get(p["id"]))


def draw_own_parameters(layout, settings):
    for p in properties.tables.own_of(settings.integrator):
        layout.prop(getattr(settings, settings.integrator), p["id"], text=LABELS.get(p["id"]))


def lit_by_virtual_lights(settings):
    return "vpls" in properties.tables.ids.get(settings.integrator, ())


# ---- Sampling ---------------------------------------------------------------------------------------------------------


class LUMICUT_PT_sampling_presets(PresetPanel, bpy.types.Panel):
    bl_label = "Sampling Presets"
    preset_subdir = operators.PRESETS_FOLDER
    preset_operator = "script.execute_preset"
    preset_add_operator = operators.LUMICUT_OT_sampling_preset_add.bl_idname
    COMPAT_ENGINES = {ENGINE}

    def draw(self, context):
        layout = self.layout
        layout.emboss = "PULLDOWN_MENU"
        if properties.tables.integrators:
            active, column = properties.active_preset(context.scene.lumicut), layout.column(align=True)
            for key, preset in properties.tables.presets.items():
                row = column.row(align=True)
                row.alignment = "LEFT"
                row.operator("lumicut.preset", text=preset.label, icon="CHECKMARK" if key == active else "BLANK1").preset = key
            layout.separator()
        if bpy.utils.preset_paths(self.preset_subdir):
            PresetPanel.draw(self, context)
            return
        row = layout.row(align=True)  # none of the user's yet: Blender's own list would say that paths are missing
        name = row.row()
        name.emboss = "NORMAL"
        name.prop(context.window_manager, "preset_name", text="")
        row.operator(self.preset_add_operator, text="", icon="ADD").name = context.window_manager.preset_name


class LUMICUT_PT_sampling(Panel, bpy.types.Panel):
    bl_label = "Sampling"

    def draw_header_preset(self, context):
        LUMICUT_PT_sampling_presets.draw_panel_header(self.layout)

    def draw(self, context):
        layout = self.layout
        if not properties.tables.integrators:
            box = layout.box()
            wrapped(box, runtime.failure() or "The Lumicut library is not loaded.", context, "ERROR")
            box.operator("lumicut.reload_library", icon="FILE_REFRESH")
            return
        active = properties.active_preset(context.scene.lumicut)
        presets = properties.tables.presets
        grid = layout.grid_flow(row_major=True, columns=columns_for([p.label for p in presets.values()], context), even_columns=True, align=True)
        for key, preset in presets.items():
            grid.operator("lumicut.preset", text=preset.label, depress=key == active).preset = key
        if active is None:
            layout.label(text="Custom: none of these", icon="DOT")


def draw_threshold(layout, settings, toggle, prop):
    row = layout.column(heading="Threshold").row(align=True)
    row.prop(settings, toggle, text="")
    value = row.row()
    value.active = getattr(settings, toggle)
    value.prop(settings, prop, text="")


class LUMICUT_PT_sampling_viewport(LibraryPanel, bpy.types.Panel):
    bl_label = "Viewport"
    bl_parent_id = "LUMICUT_PT_sampling"

    def draw(self, context):
        layout, settings = split(self.layout), context.scene.lumicut
        draw_threshold(layout, settings, "use_viewport_threshold", "viewport_target_error")
        layout.prop(settings, "viewport_passes", text="Iterations")
        layout.prop(settings, "viewport_seconds")
        if lit_by_virtual_lights(settings):
            layout.prop(settings, "viewport_lights")
        layout.prop(settings, "denoise_viewport")


class LUMICUT_PT_sampling_render(LibraryPanel, bpy.types.Panel):
    bl_label = "Render"
    bl_parent_id = "LUMICUT_PT_sampling"

    def draw(self, context):
        layout, settings = split(self.layout), context.scene.lumicut
        draw_threshold(layout, settings, "use_threshold", "target_error")
        endless = settings.passes == 0 and not settings.use_threshold and settings.max_seconds == 0
        layout.prop(settings, "passes", text="Iterations")
        layout.prop(settings, "samples")
        layout.prop(settings, "max_seconds")
        if not lit_by_virtual_lights(settings):
            draw_own_parameters(layout, settings)
        if endless:
            wrapped(layout, "Nothing ends this: set iterations, a threshold or a time limit", context, "ERROR")


class LUMICUT_PT_denoise(LibraryPanel, bpy.types.Panel):
    bl_label = "Denoise"
    bl_parent_id = "LUMICUT_PT_sampling_render"
    bl_options = {"DEFAULT_CLOSED"}

    def draw_header(self, context):
        self.layout.prop(context.scene.lumicut, "denoise", text="")

    def draw(self, context):
        layout, settings = split(self.layout), context.scene.lumicut
        column = layout.column()
        column.active = settings.denoise
        column.prop(settings, "firefly_filter")
        if settings.passes == 1:
            wrapped(layout, "One iteration alone is not denoised", context, "INFO")
        row = layout.row()
        row.enabled = compat.has_denoiser()
        row.operator("lumicut.wire_denoiser")
        if not row.enabled:
            wrapped(layout, "This Blender is built without Open Image Denoise", context, "INFO")


class LUMICUT_PT_sampling_advanced(LibraryPanel, bpy.types.Panel):
    bl_label = "Advanced"
    bl_parent_id = "LUMICUT_PT_sampling"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        layout, settings = split(self.layout), context.scene.lumicut
        draw_parameters(layout, settings, "advanced")
        layout.prop(settings, "confidence")


# ---- Light paths ------------------------------------------------------------------------------------------------------


class LUMICUT_PT_light_paths(LibraryPanel, bpy.types.Panel):
    bl_label = "Light Paths"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        pass


class LUMICUT_PT_max_bounces(LibraryPanel, bpy.types.Panel):
    bl_label = "Max Bounces"
    bl_parent_id = "LUMICUT_PT_light_paths"

    def draw(self, context):
        draw_parameters(split(self.layout), context.scene.lumicut, "bounces")


class LUMICUT_PT_clamping(VirtualLightsPanel, bpy.types.Panel):
    bl_label = "Clamping"
    bl_parent_id = "LUMICUT_PT_light_paths"

    def draw(self, context):
        layout, settings = split(self.layout), context.scene.lumicut
        draw_parameters(layout.column(align=True), settings, "clamping")
        layout.prop(settings, "max_shininess")


class LUMICUT_PT_caustics(VirtualLightsPanel, bpy.types.Panel):
    bl_label = "Corners and Caustics"
    bl_parent_id = "LUMICUT_PT_light_paths"

    def draw(self, context):
        layout, settings = split(self.layout), context.scene.lumicut
        draw_parameters(layout, settings, "caustics")
        if settings.passes == 1 and getattr(settings.common, "compensate", False):
            wrapped(layout, "Noisy in one iteration: take several", context, "INFO")


class LUMICUT_PT_lights(LibraryPanel, bpy.types.Panel):
    bl_label = "Virtual Lights"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        settings = context.scene.lumicut
        self.layout.prop(settings, "integrator", text="")  # their names are long
        layout = split(self.layout.column())
        if lit_by_virtual_lights(settings):
            draw_own_parameters(layout.column(align=True), settings)
        draw_parameters(layout.column(align=True), settings, None)


# ---- Film, performance ------------------------------------------------------------------------------------------------


class LUMICUT_PT_film(Panel, bpy.types.Panel):
    bl_label = "Film"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        layout, of_cycles = split(self.layout), getattr(context.scene, "cycles", None)
        if of_cycles is not None:  # it belongs to Cycles, and counts here too
            layout.prop(of_cycles, "film_exposure", text="Exposure")
        layout.prop(context.scene.render, "film_transparent", text="Transparent")


class LUMICUT_PT_pixel_filter(Panel, bpy.types.Panel):
    bl_label = "Pixel Filter"
    bl_parent_id = "LUMICUT_PT_film"

    @classmethod
    def poll(cls, context):
        return super().poll(context) and getattr(context.scene, "cycles", None) is not None

    def draw(self, context):
        layout, of_cycles = split(self.layout), context.scene.cycles
        layout.prop(of_cycles, "pixel_filter_type", text="Type")
        if of_cycles.pixel_filter_type != "BOX":
            layout.prop(of_cycles, "filter_width", text="Width")


class LUMICUT_PT_performance(Panel, bpy.types.Panel):
    bl_label = "Performance"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        layout, settings = split(self.layout), context.scene.lumicut
        layout.prop(settings, "threads")
        if runtime.loaded() is not None:
            wrapped(layout, f"Lumicut {runtime.loaded().version}, {runtime.loaded().origin}", context)
        layout.operator("lumicut.reload_library", icon="FILE_REFRESH")


class LUMICUT_PT_acceleration(Panel, bpy.types.Panel):
    bl_label = "Acceleration Structure"
    bl_parent_id = "LUMICUT_PT_performance"

    def draw(self, context):
        layout, settings = split(self.layout), context.scene.lumicut
        layout.prop(settings, "accel")
        if runtime.loaded() and properties.tracing_of(settings)["accel"] != settings.accel:
            wrapped(layout, "Not in this library: BVH is used", context, "INFO")
        if settings.accel == "bvh":
            layout.prop(settings, "builder")
        layout.prop(settings, "robust")


class LUMICUT_PT_statistics(Panel, bpy.types.Panel):
    bl_label = "Last Render"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        layout = self.layout
        last = runtime.last
        if not last["stats"]:
            layout.label(text="Nothing Rendered Yet")
            return
        stats, scene = last["stats"], last["scene"]
        grid = layout.column(align=True)

        def line(name, text):
            row = grid.split(factor=0.5)
            row.label(text=properties.title_case(name))
            row.label(text=text)

        line("Integrator", last["integrator"])
        line("Time", f"{last['seconds']:.2f} s")
        line("Collecting", f"{last['collect_seconds']:.2f} s")
        for name, seconds in stats.get("phases", {}).items():
            line(name, f"{seconds:.2f} s")
        line("Triangles", f"{scene['triangles']:,}")
        line("Instances", f"{scene['instances']:,}")
        line("Lamps", f"{scene['lamps']:,}")
        line("Virtual Lights", f"{int(stats.get('values', {}).get('vpls', 0)):,}")
        counters = stats.get("counters", {})
        points = max(1, counters.get("points", 1))
        for key, name in (("rays", "Rays a Point"), ("clusters", "Clusters a Point"), ("bounds", "Bounds a Point")):
            line(name, f"{counters.get(key, 0) / points:.1f}")
        line("Peak Memory", f"{stats.get('peak_bytes', 0) / 2**20:,.0f} MiB")


class Notes(Panel):
    severities = {}  # those it shows, and their icons

    def draw(self, context):
        entries = [entry for entry in runtime.last["entries"] if entry[0] in self.severities]
        if not entries:
            self.layout.label(text="Nothing in the Last Render", icon="CHECKMARK")
        for severity, text, names in entries:
            column = self.layout.column(align=True)
            wrapped(column, text, context, self.severities[severity])
            for name in names[:NAMES_SHOWN]:
                row = column.row()
                row.alignment = "LEFT"
                row.operator("lumicut.select_named", text=name, icon="RESTRICT_SELECT_OFF", emboss=False).name = name
            if len(names) > NAMES_SHOWN:
                column.label(text=f"and {len(names) - NAMES_SHOWN} More", icon="BLANK1")


class LUMICUT_PT_notes(Notes, bpy.types.Panel):
    """What the last picture has otherwise than asked for, worst first."""
    bl_label = "Approximated"
    severities = {report.WRONG: "ERROR", report.APPROXIMATED: "INFO"}

    def draw_header(self, context):
        worst = min((entry[0] for entry in runtime.last["entries"]), default=report.NUANCE)
        if worst in self.severities:
            self.layout.label(text="", icon=self.severities[worst])


class LUMICUT_PT_nuances(Notes, bpy.types.Panel):
    """What only a measurement tells."""
    bl_label = "Nuances"
    bl_parent_id = "LUMICUT_PT_notes"
    bl_options = {"DEFAULT_CLOSED"}
    severities = {report.NUANCE: "DOT"}

    @classmethod
    def poll(cls, context):
        return super().poll(context) and any(entry[0] in cls.severities for entry in runtime.last["entries"])


class LUMICUT_PT_simplify(Panel, bpy.types.Panel):
    bl_label = "Simplify"
    bl_options = {"DEFAULT_CLOSED"}

    def draw_header(self, context):
        self.layout.prop(context.scene.render, "use_simplify", text="")

    def draw(self, context):
        pass


class Simplify(Panel):
    bl_parent_id = "LUMICUT_PT_simplify"
    suffix = ""

    def draw(self, context):
        layout, render = split(self.layout), context.scene.render
        layout.active = render.use_simplify
        layout.prop(render, "simplify_subdivision" + self.suffix, text="Subdivisions")
        layout.prop(render, "simplify_child_particles" + self.suffix, text="Child Particles")


class LUMICUT_PT_simplify_viewport(Simplify, bpy.types.Panel):
    bl_label = "Viewport"


class LUMICUT_PT_simplify_render(Simplify, bpy.types.Panel):
    bl_label = "Render"
    suffix = "_render"


CLASSES = (LUMICUT_PT_sampling_presets, LUMICUT_PT_sampling, LUMICUT_PT_sampling_viewport, LUMICUT_PT_sampling_render,
           LUMICUT_PT_denoise, LUMICUT_PT_sampling_advanced, LUMICUT_PT_light_paths, LUMICUT_PT_max_bounces,
           LUMICUT_PT_clamping, LUMICUT_PT_caustics, LUMICUT_PT_film, LUMICUT_PT_pixel_filter, LUMICUT_PT_performance, LUMICUT_PT_acceleration,
           LUMICUT_PT_lights, LUMICUT_PT_statistics, LUMICUT_PT_notes, LUMICUT_PT_nuances, LUMICUT_PT_simplify,
           LUMICUT_PT_simplify_viewport, LUMICUT_PT_simplify_render)


def register():
    for cls in CLASSES:
        bpy.utils.register_class(cls)


def unregister():
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
