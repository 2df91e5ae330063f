# SPDX-License-Identifier: Apache-2.0
"""Files of older versions: what they leave unset they mean as that version had it.

Blender keeps what was set and takes the rest from today's defaults. A scene in which anything was set gets the former
defaults of what was not; one that nobody touched has none to keep. Scenes are marked once they are seen; those that come
later were made by this version.
"""
import bpy

from . import properties, runtime

VERSION = 1  # 0: files saved before settings had a version
# Of version 0 where they differ from today's, beside parameters that the library's tables had the defaults of.
NOT_KEPT = {"rna_type", "name", "version", "use_threshold", "use_viewport_threshold"}
FORMER = {"samples": 4, "passes": 1, "integrator": "illumination_cut"}


def groups_of(settings):
    """[(group or None for the scene's own, its properties)]."""
    yield None, settings
    for group, _ in properties.tables.groups():
        yield group, getattr(settings, group)


def touched(settings):
    return any(owner.is_property_set(key) for group, owner in groups_of(settings) for key, prop in owner.bl_rna.properties.items()
               if key not in NOT_KEPT and prop.type != "POINTER")


def migrate(settings):
    """Gives what is not set the value that version 0 had."""
    for key, value in FORMER.items():
        if not settings.is_property_set(key) and (key != "integrator" or value in properties.tables.of):
            setattr(settings, key, value)
    for group, parameters in properties.tables.groups():
        owner = getattr(settings, group)
        for p in parameters:
            former = properties.value_of(p, p["default_text"])
            if not owner.is_property_set(p["id"]) and getattr(owner, p["id"]) != former:
                setattr(owner, p["id"], former)


def _migrate_scenes(from_file):
    if runtime.loaded() is None:
        return  # without the library's tables most settings are not there
    _state["seen"] = True
    for scene in bpy.data.scenes:
        if scene.library is None and scene.lumicut.version < VERSION:
            if from_file and touched(scene.lumicut):
                migrate(scene.lumicut)
            scene.lumicut.version = VERSION


@bpy.app.handlers.persistent
def _loaded(*_):
    _migrate_scenes(True)


@bpy.app.handlers.persistent
def _before_use(*_):
    """Of the file in which the add-on was switched on: --addons does so after reading it, and registering sees no data."""
    _migrate_scenes(not _state["seen"] and bpy.data.is_saved)


HANDLERS = {"load_post": _loaded, "render_init": _before_use, "save_pre": _before_use}
_state = {"seen": False}


def register():
    _state["seen"] = False
    for name, handler in HANDLERS.items():
        getattr(bpy.app.handlers, name).append(handler)
    bpy.app.timers.register(_before_use, first_interval=0.0)


def unregister():
    for name, handler in HANDLERS.items():
        if handler in getattr(bpy.app.handlers, name):
            getattr(bpy.app.handlers, name).remove(handler)
    if bpy.app.timers.is_registered(_before_use):
        bpy.app.timers.unregister(_before_use)
