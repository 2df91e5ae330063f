# SPDX-License-Identifier: Apache-2.0
"""Panels of view layers, objects, worlds, materials, lights and cameras, and those that are borrowed from Blender."""
import bpy

from . import compat, passes
from .panels import ENGINE, Panel, split, wrapped

# Blender's own panels that fit: their sets of engines are theirs alone, unlike those of Cycles' panels.
BORROWED = {"EEVEE_MATERIAL_PT_context_material", "EEVEE_MATERIAL_PT_surface", "EEVEE_WORLD_PT_surface", "EEVEE_WORLD_PT_mist",
            "MATERIAL_PT_preview", "WORLD_PT_context_world", "DATA_PT_camera_dof"}
# Of those that say they fit every engine: panels of what is left out, and those that stand in these modules otherwise.
NOT_BORROWED = {"VIEWLAYER_PT_filter", "VIEWLAYER_PT_layer_passes", "RENDER_PT_simplify", "RENDER_PT_simplify_viewport",
                "RENDER_PT_simplify_render", "RENDER_PT_simplify_greasepencil", "RENDER_PT_gpencil", "DATA_PT_light", "NODE_DATA_PT_light", "DATA_PT_area",
                "DATA_PT_spot", "DATA_PT_falloff_curve", "DATA_PT_lightprobe", "DATA_PT_lightprobe_display",
                "DATA_PT_lightprobe_parallax", "DATA_PT_lightprobe_visibility", "DATA_PT_volume_render", "OBJECT_PT_visibility"}
GEOMETRY = {"MESH", "CURVE", "SURFACE", "FONT", "META", "CURVES", "POINTCLOUD"}


# ---- View layers ------------------------------------------------------------------------------------------------------


class LUMICUT_PT_filter(Panel, bpy.types.Panel):
    bl_label = "Filter"
    bl_context = "view_layer"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        column = split(self.layout).column(heading="Include")
        for prop, label in (("use_sky", "Environment"), ("use_solid", "Surfaces"), ("use_strand", "Curves")):
            column.prop(context.view_layer, prop, text=label)


class LUMICUT_PT_override(Panel, bpy.types.Panel):
    bl_label = "Override"
    bl_context = "view_layer"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        layout = split(self.layout)
        layout.prop(context.view_layer, "material_override", text="Material")
        if hasattr(context.view_layer, "world_override"):
            layout.prop(context.view_layer, "world_override", text="World")


PASSES = {  # Blender's, and those that Cycles adds to view layers: shown as soon as passes.LEFT_OUT lacks them
    "Data": (("use_pass_combined", "Combined"), ("use_pass_z", "Depth"), ("use_pass_mist", "Mist"), ("use_pass_position", "Position"),
             ("use_pass_normal", "Normal"), ("use_pass_vector", "Vector"), ("use_pass_uv", "UV"),
             ("use_pass_object_index", "Object Index"), ("use_pass_material_index", "Material Index")),
    "Light": (("use_pass_emit", "Emission"), ("use_pass_environment", "Environment"), ("use_pass_shadow", "Shadow"),
              ("use_pass_ambient_occlusion", "Occlusion"), ("use_pass_shadow_catcher", "Shadow Catcher")),
    "Diffuse": (("use_pass_diffuse_direct", "Direct"), ("use_pass_diffuse_indirect", "Indirect"), ("use_pass_diffuse_color", "Color")),
    "Glossy": (("use_pass_glossy_direct", "Direct"), ("use_pass_glossy_indirect", "Indirect"), ("use_pass_glossy_color", "Color")),
    "Transmission": (("use_pass_transmission_direct", "Direct"), ("use_pass_transmission_indirect", "Indirect"),
                     ("use_pass_transmission_color", "Color")),
    "Volume": (("use_pass_volume_direct", "Direct"), ("use_pass_volume_indirect", "Indirect")),
    "Cryptomatte": (("use_pass_cryptomatte_object", "Object"), ("use_pass_cryptomatte_material", "Material"),
                    ("use_pass_cryptomatte_asset", "Asset")),
}
OWN_PASSES = {"Data": ("use_pass_albedo", "use_pass_denoising"), "Light": ("use_pass_error", "use_pass_illuminance"),
              "Heat Maps": ("use_pass_cut_size", "use_pass_rays", "use_pass_bounds")}


class LUMICUT_PT_passes(Panel, bpy.types.Panel):
    bl_label = "Passes"
    bl_context = "view_layer"

    def draw(self, context):
        layout, layer = split(self.layout), context.view_layer
        for heading in (*PASSES, "Heat Maps"):
            rows = [(owner, prop, label) for prop, label in PASSES.get(heading, ()) if prop not in passes.LEFT_OUT
                    for owner in (layer, getattr(layer, "cycles", None)) if hasattr(owner, prop)]
            rows += [(layer.lumicut, prop, None) for prop in OWN_PASSES.get(heading, ())]
            column = layout.column(heading=heading, align=True) if rows else None
            for owner, prop, label in rows:
                column.prop(owner, prop, text=label)


class LUMICUT_PT_light_groups(Panel, bpy.types.Panel):
    bl_label = "Light Groups"
    bl_parent_id = "LUMICUT_PT_passes"
    bl_context = "view_layer"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        layer = context.view_layer
        row = self.layout.row()
        row.template_list("UI_UL_list", "lightgroups", layer, "lightgroups", layer, "active_lightgroup_index", rows=3)
        column = row.column(align=True)
        column.operator("scene.view_layer_add_lightgroup", icon="ADD", text="")
        column.operator("scene.view_layer_remove_lightgroup", icon="REMOVE", text="")
        column.separator()
        column.menu("VIEWLAYER_MT_lightgroup_sync", icon="DOWNARROW_HLT", text="")


# ---- Objects ----------------------------------------------------------------------------------------------------------


class LightGroup(Panel):
    """Which light group of the view layer something emits into."""
    bl_label = "Light Group"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        layer, owner = context.view_layer, getattr(context, self.owner)
        row = split(self.layout).row(align=True)
        row.prop_search(owner, "lightgroup", layer, "lightgroups", text="Light Group")
        add = row.column(align=True)
        add.enabled = bool(owner.lightgroup) and owner.lightgroup not in layer.lightgroups
        add.operator("scene.view_layer_add_lightgroup", icon="ADD", text="").name = owner.lightgroup


class LUMICUT_PT_object_light_group(LightGroup, bpy.types.Panel):
    bl_context = "object"
    owner = "object"


class LUMICUT_PT_visibility(Panel, bpy.types.Panel):
    bl_label = "Visibility"
    bl_context = "object"
    bl_options = {"DEFAULT_CLOSED"}
    owner = "object"

    def draw(self, context):
        layout, ob = split(self.layout), context.object
        layout.prop(ob, "hide_select", text="Selectable", toggle=False, invert_checkbox=True)
        column = layout.column(heading="Show In")
        column.prop(ob, "hide_viewport", text="Viewports", toggle=False, invert_checkbox=True)
        column.prop(ob, "hide_render", text="Renders", toggle=False, invert_checkbox=True)
        if ob.type in GEOMETRY:
            column = layout.column(heading="Mask")
            column.prop(ob, "is_shadow_catcher", text="Shadow Catcher")
            column.prop(ob, "is_holdout", text="Holdout")


class LUMICUT_PT_ray_visibility(Panel, bpy.types.Panel):
    bl_label = "Ray Visibility"
    bl_parent_id = "LUMICUT_PT_visibility"
    bl_context = "object"
    owner = "object"

    @classmethod
    def poll(cls, context):
        return super().poll(context) and context.object.type in GEOMETRY | {"LIGHT"}

    def draw(self, context):
        column = split(self.layout).column()
        for ray in ("camera", "diffuse", "glossy", "transmission", "shadow")[:4 if context.object.type == "LIGHT" else 5]:
            column.prop(context.object, "visible_" + ray, text=ray.capitalize())


# ---- Worlds, materials ------------------------------------------------------------------------------------------------


class LUMICUT_PT_world_light_group(LightGroup, bpy.types.Panel):
    bl_context = "world"
    owner = "world"


class LUMICUT_PT_world_ray_visibility(Panel, bpy.types.Panel):
    bl_label = "Ray Visibility"
    bl_context = "world"
    bl_options = {"DEFAULT_CLOSED"}
    owner = "world"
    rays = ("camera", "diffuse", "glossy", "transmission")

    @classmethod
    def poll(cls, context):
        return super().poll(context) and hasattr(context.world, "cycles_visibility")  # it belongs to Cycles, and counts here too

    def draw(self, context):
        column = split(self.layout).column()
        for ray in self.rays:
            column.prop(context.world.cycles_visibility, ray, text=ray.capitalize())


class MaterialOutput(Panel):
    """What leads to a socket of the material's output."""
    bl_context = "material"
    bl_options = {"DEFAULT_CLOSED"}
    owner = "material"
    hint = ""

    @classmethod
    def poll(cls, context):
        return super().poll(context) and compat.has_nodes(context.material) and not context.material.grease_pencil

    def draw(self, context):
        wrapped(self.layout, self.hint, context, "INFO")
        compat.panel_node_draw(split(self.layout), context.material.node_tree, "OUTPUT_MATERIAL", self.bl_label)


class LUMICUT_PT_material_volume(MaterialOutput, bpy.types.Panel):
    bl_label = "Volume"
    hint = "Counts inside surfaces of glass: what it absorbs"


class LUMICUT_PT_material_displacement(MaterialOutput, bpy.types.Panel):
    bl_label = "Displacement"
    hint = "Rendered as a bump map"


class LUMICUT_PT_material_viewport(Panel, bpy.types.Panel):
    bl_label = "Gloss"
    bl_context = "material"
    bl_options = {"DEFAULT_CLOSED"}
    owner = "material"

    def draw(self, context):
        from .materials import MIRROR, roughness_of
        limit = context.scene.lumicut.max_shininess
        rough = roughness_of(limit)
        wrapped(self.layout, f"Roughness below {MIRROR:g} is a mirror's, from there to {rough:.2f} it is taken as {rough:.2f} "
                             f"(Light Paths > Clamping > Gloss Limit).", context)


# ---- Lights, cameras --------------------------------------------------------------------------------------------------


class LUMICUT_PT_light(Panel, bpy.types.Panel):
    bl_label = "Light"
    bl_context = "data"
    owner = "light"

    def draw(self, context):
        layout, light = self.layout, context.light
        layout.row().prop(light, "type", expand=True)
        layout.use_property_split = True
        column = layout.column()
        column.prop(light, "color")
        column.prop(light, "energy", text="Strength" if light.type == "SUN" else "Power")
        if hasattr(light, "exposure"):  # 4.5 and later
            column.prop(light, "exposure")
        column.separator()
        if light.type in {"POINT", "SPOT"}:
            column.prop(light, "shadow_soft_size", text="Radius")
        elif light.type == "SUN":
            column.prop(light, "angle", text="Angle")
        else:
            column.prop(light, "shape")
            sizes = column.column(align=True)
            if light.shape in {"RECTANGLE", "ELLIPSE"}:
                sizes.prop(light, "size", text="Size X")
                sizes.prop(light, "size_y", text="Y")
            else:
                sizes.prop(light, "size", text="Size")


class LUMICUT_PT_light_nodes(Panel, bpy.types.Panel):
    bl_label = "Nodes"
    bl_context = "data"
    owner = "light"

    def draw(self, context):
        layout, light = split(self.layout), context.light
        if compat.shows_nodes_switch(light):
            layout.prop(light, "use_nodes", icon="NODETREE")
        if compat.has_nodes(light):
            output = light.node_tree.get_output_node("ALL") or light.node_tree.get_output_node("CYCLES")
            if output is not None:
                layout.template_node_view(light.node_tree, output, output.inputs["Surface"])


class LUMICUT_PT_beam_shape(Panel, bpy.types.Panel):
    bl_label = "Beam Shape"
    bl_parent_id = "LUMICUT_PT_light"
    bl_context = "data"
    owner = "light"

    @classmethod
    def poll(cls, context):
        return super().poll(context) and context.light.type in {"SPOT", "AREA"}

    def draw(self, context):
        layout, light = self.layout, context.light
        layout.use_property_split = True
        if light.type == "SPOT":
            layout.prop(light, "spot_size", text="Spot Size")
            layout.prop(light, "spot_blend", text="Blend", slider=True)
            layout.prop(light, "show_cone")
        else:
            layout.prop(light, "spread", text="Spread")


class LUMICUT_PT_camera_aperture(Panel, bpy.types.Panel):
    bl_label = "Aperture"
    bl_parent_id = "DATA_PT_camera_dof"
    bl_context = "data"
    owner = "camera"

    def draw(self, context):
        layout, dof = self.layout, context.camera.dof
        layout.use_property_split = True
        layout.active = dof.use_dof
        layout.prop(dof, "aperture_fstop", text="F-Stop")


CLASSES = (LUMICUT_PT_passes, LUMICUT_PT_light_groups, LUMICUT_PT_filter, LUMICUT_PT_override, LUMICUT_PT_object_light_group,
           LUMICUT_PT_visibility, LUMICUT_PT_ray_visibility, LUMICUT_PT_world_light_group, LUMICUT_PT_world_ray_visibility,
           LUMICUT_PT_material_volume,
           LUMICUT_PT_material_displacement, LUMICUT_PT_material_viewport, LUMICUT_PT_light, LUMICUT_PT_light_nodes,
           LUMICUT_PT_beam_shape, LUMICUT_PT_camera_aperture)


def borrowed():
    for panel in bpy.types.Panel.__subclasses__():
        if not hasattr(panel, "COMPAT_ENGINES") or panel.__name__ in NOT_BORROWED or "freestyle" in panel.__name__:
            continue
        if "BLENDER_RENDER" in panel.COMPAT_ENGINES or panel.__name__ in BORROWED:
            yield panel


def register():
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    for panel in borrowed():
        panel.COMPAT_ENGINES.add(ENGINE)


def unregister():
    for panel in bpy.types.Panel.__subclasses__():
        if hasattr(panel, "COMPAT_ENGINES") and not panel.__module__.startswith(__package__):
            panel.COMPAT_ENGINES.discard(ENGINE)
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
