# SPDX-License-Identifier: Apache-2.0
"""Operators: presets, the compositor's denoiser, selecting what a note names, the library, export."""
import pathlib

import bpy
from bl_operators.presets import AddPresetBase
from bpy.props import BoolProperty, EnumProperty, StringProperty
from bpy_extras.io_utils import ExportHelper

from . import compat, engine, properties, runtime

ENGINE = "LUMICUT"
PRESETS_FOLDER = "lumicut/sampling"  # of the user's, below scripts/presets


class LUMICUT_OT_preset(bpy.types.Operator):
    """Sets how the scene is sampled for a purpose"""
    bl_idname = "lumicut.preset"
    bl_label = "Lumicut Preset"
    bl_options = {"REGISTER", "UNDO"}
    preset: EnumProperty(name="Preset", items=lambda values, context: [row[:3] for row in properties.tables.presets.values()])  # noqa: F821

    @classmethod
    def poll(cls, context):
        return bool(properties.tables.integrators)

    @classmethod
    def description(cls, context, values):
        return properties.tables.presets[values.preset].description

    def execute(self, context):
        properties.apply_preset(context.scene.lumicut, self.preset)
        return {"FINISHED"}


class LUMICUT_OT_sampling_preset_add(AddPresetBase, bpy.types.Operator):
    """Keeps or removes a preset of your own: all that the presets set"""
    bl_idname = "lumicut.sampling_preset_add"
    bl_label = "Add Sampling Preset"
    preset_menu = "LUMICUT_PT_sampling_presets"
    preset_subdir = PRESETS_FOLDER

    @property
    def preset_values(self):
        values = properties.saved_values(bpy.context.scene.lumicut)
        return [".".join(["bpy.context.scene.lumicut", *(part for part in place if part is not None)]) for place in values]


def users_of(name):
    """Objects of all scenes that a note's name stands for: itself, or those that use the data of that name. Notes add what
    is meant in brackets or behind a colon."""
    kinds = ("objects", "materials", "lights", "meshes", "curves", "cameras", "images", "particles", "collections", "worlds")
    names = [name] + [name[:at] for at in range(len(name) - 1, 0, -1) if name[at:].startswith((" (", ": "))]
    for shorter in names:
        for kind in kinds:
            found = getattr(bpy.data, kind).get(shorter)
            if found is not None:
                return _objects_using(found)
    return []


def _objects_using(data):
    if isinstance(data, bpy.types.Object):
        return [data]
    if isinstance(data, bpy.types.Collection):
        return list(data.all_objects)
    users = bpy.data.user_map()
    objects, seen, todo = [], {data}, [data]
    while todo:
        for user in users.get(todo.pop(), ()):
            if user in seen:
                continue
            seen.add(user)
            if isinstance(user, bpy.types.Object):
                objects.append(user)
            elif not isinstance(user, (bpy.types.Scene, bpy.types.Collection)):
                todo.append(user)
    return objects


class LUMICUT_OT_select_named(bpy.types.Operator):
    """Selects the object, or all objects with the material, image or light of this name"""
    bl_idname = "lumicut.select_named"
    bl_label = "Select What Is Named"
    bl_options = {"REGISTER", "UNDO"}
    name: StringProperty(name="Name")  # noqa: F821

    def execute(self, context):
        there = context.view_layer.objects
        found = [ob for ob in users_of(self.name) if ob.name in there]
        if not found:
            self.report({"INFO"}, f"No object of this view layer uses {self.name}")
            return {"CANCELLED"}
        if context.mode != "OBJECT":
            bpy.ops.object.mode_set(mode="OBJECT")
        for ob in there:
            if ob.select_get():
                ob.select_set(False)
        for ob in found:
            ob.select_set(True)
        there.active = found[0]
        return {"FINISHED"}


class LUMICUT_OT_wire_denoiser(bpy.types.Operator):
    """Renders what Open Image Denoise takes, and puts the compositor's Denoise node between the render layer and what it leads to"""
    bl_idname = "lumicut.wire_denoiser"
    bl_label = "Denoise in the Compositor"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context):
        scene, layer = context.scene, context.view_layer
        layer.lumicut.use_pass_denoising = True
        tree = compat.make_compositor_tree(scene)
        layer.update_render_passes()
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
            targets = [compat.compositor_image_input(tree)]
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
    check_existing: BoolProperty(default=True, options={"HIDDEN"})  # noqa: F821

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


def menu(self, context):
    self.layout.operator(LUMICUT_OT_export.bl_idname, text="Lumicut scene (.json)")


CLASSES = (LUMICUT_OT_preset, LUMICUT_OT_sampling_preset_add, LUMICUT_OT_select_named, LUMICUT_OT_wire_denoiser,
           LUMICUT_OT_reload_library, LUMICUT_OT_export)


def register():
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.TOPBAR_MT_file_export.append(menu)


def unregister():
    bpy.types.TOPBAR_MT_file_export.remove(menu)
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
