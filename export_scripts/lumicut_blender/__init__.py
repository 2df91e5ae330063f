# SPDX-License-Identifier: Apache-2.0
"""Lumicut in Blender: a render engine of many lights. docs/blender.md tells how to install and use it."""
bl_info = {
    "name": "Lumicut",
    "author": "The Lumicut authors",
    "version": (1, 0, 0),
    "blender": (3, 4, 0),
    "location": "Render Properties > Render Engine > Lumicut",
    "description": "Global illumination from many virtual lights, without noise",
    "category": "Render",
}

if "bpy" in locals():  # reloaded by the host: its parts, too, from the bottom up
    import importlib
    for _part in (library, compat, report, scene_data, images, mappings, runtime, programs, program_values, nodes, mesh_attributes, linking, view_albedos, materials, ies, sky, directions,  # noqa: F821
                  lamp_textures, falloffs, sheared, lights, worlds, cameras, collect, motion, hit_passes, properties, migration, shadow_catcher, passes, export, viewport,  # noqa: F821
                  engine, preferences, operators, panels, data_panels):  # noqa: F821
        importlib.reload(_part)
else:
    try:
        import numpy  # noqa: F401
    except ImportError:
        raise ImportError("Lumicut needs NumPy in Blender's Python: Blender's own builds have it, beside Debian's install python3-numpy") from None
    from .lumicut import library  # noqa: F401
    from . import (cameras, collect, compat, data_panels, directions, engine, export, falloffs, hit_passes, ies, images, lamp_textures, lights, linking, mappings, materials,  # noqa: F401
                   mesh_attributes, migration, motion, nodes, operators, panels, passes, preferences, program_values, programs, properties, report,
                   runtime, scene_data, shadow_catcher, sheared, sky, view_albedos, viewport, worlds)

import bpy  # noqa: E402, F401


def register():
    bpy.utils.register_class(preferences.LumicutPreferences)
    if runtime.load() is None:
        print(f"lumicut: {runtime.failure()}", flush=True)
    properties.register()
    migration.register()
    engine.register()
    operators.register()
    panels.register()
    data_panels.register()


def unregister():
    data_panels.unregister()
    panels.unregister()
    operators.unregister()
    engine.unregister()
    migration.unregister()
    properties.unregister()
    runtime.release()
    bpy.utils.unregister_class(preferences.LumicutPreferences)
