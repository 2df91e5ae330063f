"""Runs inside Blender with a window: picks the engine, renders, cancels, uses the viewport, keeps screenshots.

Steps are generators that a timer drives: Blender's interface runs between them, and is never waited for by sleeping.
"""
import json
import os
import pathlib
import subprocess
import sys
import time
import traceback

import bpy

OUT = pathlib.Path(os.environ["LUMICUT_UI_OUT"])
PATIENCE = float(os.environ.get("LUMICUT_UI_PATIENCE", "300"))
result = {"steps": []}
finished = []
gaps = {"last": time.perf_counter(), "largest": 0.0, "ticks": 0}


def screenshot(name):
    subprocess.run(["import", "-window", "root", str(OUT / f"{name}.png")], check=True)
    result["steps"].append(name)


def area(kind):
    return next(a for a in bpy.context.window_manager.windows[0].screen.areas if a.type == kind)


def region(of):
    return next(r for r in of.regions if r.type == "WINDOW")


def on_complete(*_):
    finished.append("complete")


def on_cancel(*_):
    finished.append("cancel")


def watch(cls, name):
    """Keeps the most CPU seconds that a call took of the interface's thread."""
    original = getattr(cls, name)

    def timed(*arguments):
        start = time.thread_time()
        try:
            return original(*arguments)
        finally:
            key = f"{name}_cpu_seconds"
            result[key] = max(result.get(key, 0.0), time.thread_time() - start)

    setattr(cls, name, timed)


def sessions():
    from lumicut_blender import viewport
    return [s for s in viewport._sessions if not s.closed]


def until(condition, what):
    end = time.perf_counter() + PATIENCE
    while not condition():
        if time.perf_counter() > end:
            raise TimeoutError(f"waited in vain for {what}")
        yield 0.05


def pause(seconds):
    end = time.perf_counter() + seconds
    while time.perf_counter() < end:
        yield 0.05


def steps():
    scene = bpy.context.scene
    bpy.context.preferences.view.show_splash = False
    bpy.context.preferences.view.render_display_type = "WINDOW"
    properties, view = area("PROPERTIES"), area("VIEW_3D")
    scene.render.engine = "BLENDER_WORKBENCH"
    yield from pause(1)
    # The engine, as the interface offers it.
    result["offered"] = any(getattr(cls, "bl_idname", "") == "LUMICUT" for cls in bpy.types.RenderEngine.__subclasses__())
    properties.spaces.active.context = "RENDER"
    scene.render.engine = "LUMICUT"
    with bpy.context.temp_override(window=bpy.context.window_manager.windows[0], area=view, region=region(view)):
        bpy.ops.lumicut.preset(preset="draft")
    scene.lumicut.samples = 1
    yield from pause(1)
    screenshot("panels")

    # A frame, of a scene with something that is approximated.
    cloth = next(n for n in bpy.data.materials["cloth"].node_tree.nodes if n.type == "BSDF_DIFFUSE")
    tree = bpy.data.materials["cloth"].node_tree
    toon, both = tree.nodes.new("ShaderNodeBsdfToon"), tree.nodes.new("ShaderNodeMixShader")
    surface = next(n for n in tree.nodes if n.type == "OUTPUT_MATERIAL").inputs["Surface"]
    tree.links.new(cloth.outputs[0], both.inputs[1])
    tree.links.new(toon.outputs[0], both.inputs[2])
    tree.links.new(both.outputs[0], surface)
    bpy.app.handlers.render_complete.append(on_complete)
    bpy.app.handlers.render_cancel.append(on_cancel)
    bpy.ops.render.render("INVOKE_DEFAULT")
    yield from until(lambda: finished, "the end of a render")
    result["render"] = finished.pop()
    yield from pause(1)
    screenshot("render")
    from lumicut_blender import runtime
    result["notes"], result["stats"] = runtime.last["notes"], bool(runtime.last["stats"])

    # A longer one, which Escape ends.
    bpy.ops.lumicut.preset(preset="reference")
    scene.lumicut.samples = 64
    scene.lumicut.common.vpls = 1000000
    bpy.ops.render.render("INVOKE_DEFAULT")
    yield from pause(3)
    screenshot("rendering")
    window = subprocess.run(["xdotool", "search", "--name", "Render"], capture_output=True, text=True).stdout.split()
    for name in window[-1:]:
        subprocess.run(["xdotool", "windowfocus", name, "mousemove", "--window", name, "200", "200", "key", "--window", name, "Escape"])
    pressed = time.perf_counter()  # the interface could not hear it before xdotool ended
    while not finished:
        if time.perf_counter() - pressed > 20 and not result.get("escape_again"):
            result["escape_again"] = True
            subprocess.run(["xdotool", "key", "Escape"])
        if time.perf_counter() - pressed > PATIENCE:
            raise TimeoutError("waited in vain for the end of a cancelled render")
        yield 0.02
    result["cancel"], result["cancel_seconds"] = finished.pop(), time.perf_counter() - pressed
    for other in list(bpy.context.window_manager.windows)[1:]:
        with bpy.context.temp_override(window=other):
            bpy.ops.wm.window_close()
    yield from pause(0.5)

    # The viewport.
    from lumicut_blender import viewport
    for name in ("update", "_paint", "draw"):
        watch(viewport.Session, name)
    bpy.ops.lumicut.preset(preset="draft")
    scene.lumicut.viewport_passes = 2
    view = area("VIEW_3D")
    space = view.spaces.active
    space.overlay.show_overlays = False
    space.region_3d.view_perspective = "CAMERA"
    space.shading.type = "RENDERED"
    gaps.update(last=time.perf_counter(), largest=0.0, ticks=0)
    yield from until(lambda: sessions() and sessions()[0].levels_done >= 1, "the first coarse picture")
    first = sessions()[0]
    yield from until(lambda: sessions() and sessions()[0].levels_done >= 3 and sessions()[0].message == "done", "the finest picture")
    result["levels"], number = first.levels_done, first.picture_number
    result["ticks_while_rendering"], result["largest_gap"] = gaps["ticks"], gaps["largest"]
    yield from until(lambda: first.shown == first.picture_number, "the finest picture on the screen")
    yield from pause(0.5)
    screenshot("viewport")
    # Another setting: the picture follows, and the scene is not collected anew.
    number, data = first.picture_number, first.data
    scene.lumicut.viewport_lights = 4000
    yield from until(lambda: first.picture_number > number + 2 and first.message == "done", "pictures of fewer lights")
    result["setting_followed"] = first.data is data
    scene.lumicut.viewport_lights = 5000
    number = first.picture_number
    yield from until(lambda: first.picture_number > number + 2 and first.message == "done", "pictures of as many lights as before")
    number = first.picture_number
    # An object moves: pictures begin anew.
    before = first.picture.copy()
    vase = next(ob for ob in scene.objects if ob.name.startswith("vase"))
    vase.location.x += 1.0
    yield from until(lambda: first.picture_number > number + 2 and first.message == "done", "pictures of a moved object")
    result["object_moved"] = bool(before.shape == first.picture.shape and abs(before - first.picture).max() > 0.05)
    # The view turns in the midst of it.
    number = first.picture_number
    space.region_3d.view_perspective = "PERSP"
    for i in range(5):
        space.region_3d.view_location.x += 0.1
        view.tag_redraw()
        yield from pause(0.1)
    yield from until(lambda: first.picture_number > number and first.message == "done", "pictures of a turned view")
    yield from until(lambda: first.shown == first.picture_number, "the turned view on the screen")
    yield from pause(0.3)
    screenshot("viewport_turned")
    # A material changes, then another engine takes over and ours comes back.
    space.shading.type = "SOLID"
    yield from pause(0.5)
    space.shading.type = "RENDERED"
    yield from until(lambda: any(s.levels_done >= 3 and s.message == "done" for s in sessions()), "the viewport once more")
    result["again"] = True


running = steps()


def tick():
    now = time.perf_counter()
    gaps["largest"], gaps["ticks"], gaps["last"] = max(gaps["largest"], now - gaps["last"]), gaps["ticks"] + 1, now
    try:
        delay = next(running)
        gaps["last"] = time.perf_counter()
        return delay
    except StopIteration:
        result["ok"] = True
    except BaseException:
        result["failure"] = traceback.format_exc()
        try:
            screenshot("failure")
        except Exception:
            pass
    (OUT / "result.json").write_text(json.dumps(result))
    sys.stdout.flush()
    from lumicut_blender import viewport
    viewport.stop_all()
    bpy.ops.wm.quit_blender()
    return None


bpy.app.timers.register(tick, first_interval=1.5)
