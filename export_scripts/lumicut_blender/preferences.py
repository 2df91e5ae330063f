# SPDX-License-Identifier: Apache-2.0
"""The add-on's preferences: where the library lies, if not in the add-on."""
import bpy
from bpy.props import StringProperty

from . import runtime


class LumicutPreferences(bpy.types.AddonPreferences):
    bl_idname = __package__

    library_path: StringProperty(
        name="Library", subtype="FILE_PATH", default="",  # noqa: F722, F821
        description="File or folder of the Lumicut library, where the add-on does not bring one. Then press Reload Library")  # noqa: F722

    def draw(self, context):
        layout = self.layout
        layout.prop(self, "library_path")
        lib = runtime.loaded()
        if lib is not None:
            layout.label(text=f"Lumicut {lib.version}, {lib.origin}: {lib.path}", icon="CHECKMARK")
        else:
            from .panels import wrapped
            wrapped(layout, runtime.failure(), context, "ERROR")
        layout.operator("lumicut.reload_library", icon="FILE_REFRESH")
