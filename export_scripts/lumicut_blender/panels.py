# SPDX-License-Identifier: Apache-2.0
"""Panels and operators. The integrator's panel is drawn from the library's parameter table."""
import pathlib

import bpy
from bpy.props import EnumProperty, StringProperty
from bpy_extras.io_utils import ExportHelper

from . import engine, properties, runtime

ENGINE = "LUMICUT"
# Blender's own panels that fit: their sets of engines are theirs alone, unlike those of Cycles' panels.
BORROWED = {"EEVEE_MATERIAL_PT_context_material", "EEVEE_MATERIAL_PT_surface", "EEVEE_WORLD_PT_surface",
            "MATERIAL_PT_preview", "WORLD_PT_context_world"}
NOT_BORROWED = {"VIEWLAYER_PT_filter", "VIEWLAYER_PT_layer_passes", "RENDER_PT_freestyle", "DATA_PT_light",
                "RENDER_PT_simplify_viewport", "RENDER_PT_simplify_render"}


class LUMICUT_OT_preset(bpy.types.Operator):
    """Sets the integrator and its parameters for a purpose"""
    bl_idname = "lumicut.preset"
    bl_label = "Lumicut Preset"
    bl_options = {"REGISTER", "UNDO"}
    preset: EnumProperty(name="Preset", items=[(key, row[0], row[1]) for key, row in properties.PRESETS.items()])  # noqa: F821

    @classmethod
    def poll(cls, context):
        return bool(properties.tables.integrators)

    @classmethod
    def description(cls, context, values):
        return properties.PRESETS[values.preset][1]

    def execute(self, context):
        properties.apply_preset(context.scene.lumicut, self.preset)
        return {"FINISHED"}


class LUMICUT_OT_wire_denoiser(bpy.types.Operator):
    """Renders what Open Image Denoise takes, and puts the compositor's Denoise node between the render layer and what it leads to"""
    bl_idname = "lumicut.wire_denoiser"
    bl_label = "Denoise in the Compositor"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        return hasattr(context.scene, "node_tree")

    def execute(self, context):
        scene, layer = context.scene, context.view_layer
        layer.lumicut.use_pass_denoising = True
        scene.use_nodes = True
        layer.update_render_passes()
        tree = scene.node_tree
        source = next((n for n in tree.nodes if n.type == "R_LAYERS" and n.scene in {None, scene} and n.layer == layer.name), None)
        if source is None:
            source = tree.nodes.new("CompositorNodeRLayers")
            source.scene, source.layer = scene, layer.name
        missing = [name for name in ("Noisy Image", "Denoising Normal", "Denoising Albedo") if name not in source.outputs]
        if missing:
            self.report({"ERROR"}, f"the render layer has no {', '.join(missing)}: is Lumicut the scene's engine?")
            return {"CANCELLED"}
        if any(link.to_node.type == "DENOISE" for link in source.outputs["Noisy Image"].links):
            return {"FINISHED"}
        node = tree.nodes.new("CompositorNodeDenoise")
        node.location = source.location.x + 320, source.location.y
        if hasattr(node, "prefilter"):
            node.prefilter = "NONE"  # the guides are free of noise
        targets = [link.to_socket for link in source.outputs["Image"].links]
        if not targets:
            composite = next((n for n in tree.nodes if n.type == "COMPOSITE"), None) or tree.nodes.new("CompositorNodeComposite")
            targets = [composite.inputs["Image"]]
        for target in targets:
            tree.links.new(node.outputs["Image"], target)
        for name, socket in (("Noisy Image", "Image"), ("Denoising Normal", "Normal"), ("Denoising Albedo", "Albedo")):
            tree.links.new(source.outputs[name], node.inputs[socket])
        return {"FINISHED"}


class LUMICUT_OT_reload_library(bpy.types.Operator):
    """Looks for the library again, and draws the panels from what it offers"""
    bl_idname = "lumicut.reload_library"
    bl_label = "Reload Library"

    def execute(self, context):
        from . import viewport
        viewport.stop_all()
        properties.unregister()
        runtime.load()
        properties.register()
        if runtime.loaded() is None:
            self.report({"WARNING"}, runtime.failure())
        else:
            self.report({"INFO"}, f"Lumicut {runtime.loaded().version}, {runtime.loaded().path}")
        return {"FINISHED"}


class LUMICUT_OT_export(bpy.types.Operator, ExportHelper):
    """Writes what F12 would render, at render levels of modifiers, as files that the lumicut command renders"""
    bl_idname = "export_scene.lumicut"
    bl_label = "Export Lumicut Scene"
    filename_ext = ".json"
    filter_glob: StringProperty(default="*.json", options={"HIDDEN"})  # noqa: F722, F821
    check_existing: bpy.props.BoolProperty(default=True, options={"HIDDEN"})  # noqa: F821

    def execute(self, context):
        path = pathlib.Path(bpy.path.abspath(self.filepath))
        if not path.parent.is_dir():
            self.report({"ERROR"}, f"{path.parent} is no folder")
            return {"CANCELLED"}
        # Only a render has render levels of modifiers: the engine writes the scene in place of rendering it.
        scene = context.scene
        before = scene.render.engine
        scene.render.engine = ENGINE
        engine.export_requests.append(path)
        try:
            bpy.ops.render.render(scene=scene.name)
        except RuntimeError as error:
            self.report({"ERROR"}, str(error).strip())
            return {"CANCELLED"}
        finally:
            engine.export_requests.clear()
            scene.render.engine = before
        self.report({"INFO"}, f"Wrote {path}")
        return {"FINISHED"}


class Panel:
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "render"
    COMPAT_ENGINES = {ENGINE}

    @classmethod
    def poll(cls, context):
        return context.engine in cls.COMPAT_ENGINES


def wrapped(layout, text, width=56, icon="NONE"):
    words, line = text.split(), ""
    lines = []
    for word in words:
        if line and len(line) + len(word) + 1 > width:
            lines.append(line)
            line = ""
        line = f"{line} {word}" if line else word
    lines.append(line)
    for i, line in enumerate(lines):
        layout.label(text=line, icon=icon if i == 0 else "BLANK1" if icon != "NONE" else "NONE")


class LUMICUT_PT_integrator(Panel, bpy.types.Panel):
    bl_label = "Many Lights"

    def draw(self, context):
        layout = self.layout
        settings = context.scene.lumicut
        if not properties.tables.integrators:
            box = layout.box()
            wrapped(box, runtime.failure() or "The Lumicut library is not loaded.", icon="ERROR")
            box.operator("lumicut.reload_library", icon="FILE_REFRESH")
            return
        row = layout.row(align=True)
        for key, preset in properties.PRESETS.items():
            row.operator("lumicut.preset", text=preset[0]).preset = key
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.prop(settings, "integrator")
        column = layout.column(align=True)
        for p in properties.tables.own_of(settings.integrator):
            column.prop(getattr(settings, settings.integrator), p["id"])
        layout.prop(settings, "samples")
        column = layout.column(align=True)
        for name in properties.STOPS:
            column.prop(settings, name)


class LUMICUT_PT_denoise(Panel, bpy.types.Panel):
    bl_label = "Denoise"

    @classmethod
    def poll(cls, context):
        return super().poll(context) and bool(properties.tables.integrators)

    def draw_header(self, context):
        self.layout.prop(context.scene.lumicut, "denoise", text="")

    def draw(self, context):
        layout, settings = self.layout, context.scene.lumicut
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.prop(settings, "firefly_filter")
        layout.prop(settings, "denoise_viewport")
        if settings.passes == 1:
            layout.label(text="A frame of one pass is not denoised", icon="INFO")
        layout.operator("lumicut.wire_denoiser")


class LUMICUT_PT_lights(Panel, bpy.types.Panel):
    bl_label = "Virtual Lights"

    @classmethod
    def poll(cls, context):
        return super().poll(context) and bool(properties.tables.integrators)

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        column = layout.column(align=True)
        settings = context.scene.lumicut
        for p in properties.tables.common_of(settings.integrator):
            column.prop(getattr(settings, properties.COMMON), p["id"])
        layout.prop(settings, "max_shininess")
        layout.prop(settings, "viewport_lights")


class LUMICUT_PT_performance(Panel, bpy.types.Panel):
    bl_label = "Performance"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        settings = context.scene.lumicut
        layout.prop(settings, "accel")
        if runtime.loaded() and properties.tracing_of(settings)["accel"] != settings.accel:
            layout.label(text="Not in this library: BVH is used", icon="INFO")
        if settings.accel == "bvh":
            layout.prop(settings, "builder")
        layout.prop(settings, "robust")
        layout.prop(settings, "threads")
        if runtime.loaded() is not None:
            wrapped(layout, f"Lumicut {runtime.loaded().version}, {runtime.loaded().origin}")
        layout.operator("lumicut.reload_library", icon="FILE_REFRESH")


class LUMICUT_PT_statistics(Panel, bpy.types.Panel):
    bl_label = "Last Render"

    def draw(self, context):
        layout = self.layout
        last = runtime.last
        if not last["stats"]:
            layout.label(text="Nothing rendered yet")
            return
        stats, scene = last["stats"], last["scene"]
        grid = layout.column(align=True)

        def line(name, text):
            row = grid.split(factor=0.5)
            row.label(text=name)
            row.label(text=text)

        line("Integrator", last["integrator"])
        line("Time", f"{last['seconds']:.2f} s, collecting {last['collect_seconds']:.2f} s")
        for name, seconds in stats.get("phases", {}).items():
            line(f"   {name}", f"{seconds:.2f} s")
        line("Triangles", f"{scene['triangles']:,} in {scene['instances']:,} instances")
        line("Lamps", f"{scene['lamps']:,}")
        line("Virtual lights", f"{int(stats.get('values', {}).get('vpls', 0)):,}")
        counters = stats.get("counters", {})
        points = max(1, counters.get("points", 1))
        for key, name in (("rays", "Shadow rays a point"), ("clusters", "Clusters a point"), ("bounds", "Bounds a point")):
            line(name, f"{counters.get(key, 0) / points:.1f}")
        line("Memory", f"{stats.get('peak_bytes', 0) / 2**20:,.0f} MiB at most")


class LUMICUT_PT_notes(Panel, bpy.types.Panel):
    bl_label = "Approximated"

    def draw(self, context):
        notes = runtime.last["notes"]
        if not notes:
            self.layout.label(text="Nothing in the last render", icon="CHECKMARK")
        for note in notes:
            wrapped(self.layout, note, icon="INFO")


class LUMICUT_PT_passes(Panel, bpy.types.Panel):
    bl_label = "Passes"
    bl_context = "view_layer"

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        layer = context.view_layer
        column = layout.column(heading="Data", align=True)
        column.prop(layer, "use_pass_combined")
        column.prop(layer, "use_pass_z")
        column.prop(layer, "use_pass_mist")
        column.prop(layer, "use_pass_normal")
        column.prop(layer, "use_pass_position")
        column.prop(layer.lumicut, "use_pass_albedo")
        column.prop(layer.lumicut, "use_pass_denoising")
        column = layout.column(heading="Heat Maps", align=True)
        for prop in ("use_pass_cut_size", "use_pass_rays", "use_pass_bounds", "use_pass_error", "use_pass_illuminance"):
            column.prop(layer.lumicut, prop)


class LUMICUT_PT_light_groups(Panel, bpy.types.Panel):
    bl_label = "Light Groups"
    bl_context = "view_layer"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        layer = context.view_layer
        row = self.layout.row()
        row.template_list("UI_UL_list", "lightgroups", layer, "lightgroups", layer, "active_lightgroup_index", rows=3)
        column = row.column(align=True)
        column.operator("scene.view_layer_add_lightgroup", icon="ADD", text="")
        column.operator("scene.view_layer_remove_lightgroup", icon="REMOVE", text="")


class LightGroup(Panel):
    """Which light group of the view layer something emits into."""
    bl_label = "Light Group"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        self.layout.use_property_split = True
        self.layout.prop_search(self.owner(context), "lightgroup", context.view_layer, "lightgroups", text="Light Group")


class LUMICUT_PT_object_light_group(LightGroup, bpy.types.Panel):
    bl_context = "object"

    @classmethod
    def poll(cls, context):
        return super().poll(context) and context.object is not None

    @staticmethod
    def owner(context):
        return context.object


class LUMICUT_PT_world_light_group(LightGroup, bpy.types.Panel):
    bl_context = "world"

    @classmethod
    def poll(cls, context):
        return super().poll(context) and context.world is not None

    @staticmethod
    def owner(context):
        return context.world


class LUMICUT_PT_film(Panel, bpy.types.Panel):
    bl_label = "Film"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        self.layout.use_property_split = True
        of_cycles = getattr(context.scene, "cycles", None)
        if of_cycles is not None:  # it belongs to Cycles, and counts here too
            self.layout.prop(of_cycles, "film_exposure", text="Exposure")
        self.layout.prop(context.scene.render, "film_transparent", text="Transparent")


class LUMICUT_PT_light(Panel, bpy.types.Panel):
    bl_label = "Light"
    bl_context = "data"

    @classmethod
    def poll(cls, context):
        return super().poll(context) and context.light is not None

    def draw(self, context):
        layout, light = self.layout, context.light
        layout.row().prop(light, "type", expand=True)
        layout.use_property_split = True
        layout.prop(light, "color")
        layout.prop(light, "energy")
        if light.type in {"POINT", "SPOT"}:
            layout.prop(light, "shadow_soft_size", text="Radius")
        if light.type == "SPOT":
            layout.prop(light, "spot_size")
            layout.prop(light, "spot_blend", slider=True)
        if light.type == "SUN":
            layout.prop(light, "angle")
        if light.type == "AREA":
            layout.prop(light, "shape")
            layout.prop(light, "size")
            if light.shape in {"RECTANGLE", "ELLIPSE"}:
                layout.prop(light, "size_y")
            if hasattr(light, "spread"):
                layout.prop(light, "spread")


class LUMICUT_PT_material_viewport(Panel, bpy.types.Panel):
    bl_label = "Gloss"
    bl_context = "material"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context):
        return super().poll(context) and context.material is not None

    def draw(self, context):
        from .materials import MIRROR, roughness_of
        limit = context.scene.lumicut.max_shininess
        rough = roughness_of(limit)
        wrapped(self.layout, f"Rendered as metal, glass or coated diffuse. Roughness below {MIRROR:g} is followed as a "
                             f"mirror's, from there to {rough:.2f} taken as {rough:.2f} (Gloss Limit {limit:g}).")


def menu(self, context):
    self.layout.operator(LUMICUT_OT_export.bl_idname, text="Lumicut scene (.json)")


CLASSES = (LUMICUT_OT_preset, LUMICUT_OT_wire_denoiser, LUMICUT_OT_reload_library, LUMICUT_OT_export, LUMICUT_PT_integrator, LUMICUT_PT_denoise, LUMICUT_PT_lights,
           LUMICUT_PT_performance, LUMICUT_PT_statistics, LUMICUT_PT_notes, LUMICUT_PT_film, LUMICUT_PT_passes,
           LUMICUT_PT_light_groups, LUMICUT_PT_object_light_group, LUMICUT_PT_world_light_group,
           LUMICUT_PT_light, LUMICUT_PT_material_viewport)


def borrowed():
    for panel in bpy.types.Panel.__subclasses__():
        if not hasattr(panel, "COMPAT_ENGINES") or panel.__name__ in NOT_BORROWED:
            continue
        if "BLENDER_RENDER" in panel.COMPAT_ENGINES or panel.__name__ in BORROWED:
            yield panel


def register():
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.TOPBAR_MT_file_export.append(menu)
    for panel in borrowed():
        panel.COMPAT_ENGINES.add(ENGINE)


def unregister():
    for panel in bpy.types.Panel.__subclasses__():
        if hasattr(panel, "COMPAT_ENGINES") and panel not in CLASSES:
            panel.COMPAT_ENGINES.discard(ENGINE)
    bpy.types.TOPBAR_MT_file_export.remove(menu)
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
