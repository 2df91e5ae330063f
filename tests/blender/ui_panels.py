"""Runs inside Blender with a window: every panel of the add-on opened, and one screenshot for each tab of the properties."""
import json
import os
import pathlib
import sys
import traceback

import bpy
from lumicut_blender import data_panels, panels, report, runtime

OUT = pathlib.Path(os.environ["LUMICUT_UI_OUT"])
result = {"shots": []}
TABS = (("render", "RENDER", None), ("view_layer", "VIEW_LAYER", None), ("object", "OBJECT", "Cube"), ("material", "MATERIAL", "Cube"),
        ("light", "DATA", "Light"), ("camera", "DATA", "Camera"))


def open_all():
    """No operator opens a panel; those that do not say they begin closed are open."""
    parts = (panels, data_panels)
    for part in reversed(parts):
        part.unregister()
    for part in parts:
        for cls in part.CLASSES:
            cls.bl_options = set()
        part.register()


def properties_area():
    window = bpy.context.window_manager.windows[0]
    return window, next(a for a in window.screen.areas if a.type == "PROPERTIES")


def screenshot(name):
    window, area = properties_area()
    with bpy.context.temp_override(window=window, area=area, region=next(r for r in area.regions if r.type == "WINDOW")):
        bpy.ops.screen.screenshot_area(filepath=str(OUT / f"panels_{name}.png"))
    result["shots"].append(name)


def steps():
    bpy.context.preferences.view.show_splash = False
    bpy.context.scene.render.engine = "LUMICUT"
    for area in bpy.context.window_manager.windows[0].screen.areas:
        if area.type == "VIEW_3D":
            area.type = "TEXT_EDITOR"  # software GL would draw the view over and over
    open_all()
    notes = report.Report()
    notes.note("Smoke", "Volumes left out")
    for name in ("Velvet", "Skin"):
        notes.note(f"{name} (Principled BSDF)", "Principled features taken as diffuse")
    runtime.remember(notes)
    result["width"] = properties_area()[1].width
    for name, tab, ob in TABS:
        if ob is not None:
            bpy.context.view_layer.objects.active = bpy.data.objects[ob]
        yield 0.5  # Blender sees which tabs there are when it draws
        properties_area()[1].spaces.active.context = tab
        yield 0.5
        screenshot(name)
    result["ok"] = True


running = steps()


def tick():
    try:
        return next(running)
    except StopIteration:
        pass
    except BaseException:
        result["failure"] = traceback.format_exc()
    (OUT / "panels.json").write_text(json.dumps(result))
    sys.stdout.flush()
    bpy.ops.wm.quit_blender()
    return None


bpy.app.timers.register(tick, first_interval=1.0)
