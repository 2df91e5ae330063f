# SPDX-License-Identifier: Apache-2.0
"""The engine in 3D views: coarse pictures first, then finer ones, in a thread of their own.

The interface's thread collects what changed and draws the last picture; uploading, building and rendering are the
worker's. A new view or scene cancels what runs; nothing waits for it.
"""
import threading
import time
import traceback
import weakref

import bpy
import gpu
import numpy as np
from gpu_extras.presets import draw_texture_2d

from . import cameras, collect, passes, properties, runtime, shadow_catcher, sky
from .lumicut import library
from .images import Images
from .report import Report

# (pixels of the view a pixel of the picture, quality that the library suggests an integrator for or None for the scene's own)
LEVELS = ((8, "interactive"), (3, "preview"), (1, None))
POLL_MS = 40
SHOW_SECONDS = 0.5  # between two pictures of the finest level's passes
_sessions = weakref.WeakSet()
TICK = 0.05


class Session:
    """One 3D view."""

    def __init__(self, engine):
        self.engine = weakref.ref(engine)
        self.condition = threading.Condition()
        self.request = None      # (scene data or None for "as before", camera, size, settings)
        self.running = None      # what the worker would have to cancel
        self.closed = False
        self.picture, self.picture_number, self.shown = None, 0, -1  # (h, w, 4), bottom row first
        self.texture, self.texture_number = None, -1
        self.message, self.told = "collecting", ""
        self.cache, self.images = collect.MeshCache(), None
        self.data, self.settings, self.view = None, None, None
        self.scene = ""          # its name
        self.levels_done = 0
        self.thread = None
        _sessions.add(self)
        if not bpy.app.timers.is_registered(_tick):
            bpy.app.timers.register(_tick, first_interval=TICK)

    # ---- The interface's side -----------------------------------------------------------------------------------

    def update(self, engine, context, depsgraph):
        updated = {u.id.name_full for u in depsgraph.updates if u.is_updated_geometry}
        self.cache.forget(updated)
        report = Report()
        if self.images is None or any(isinstance(u.id, bpy.types.Image) for u in depsgraph.updates):
            self.images = Images(report)
        self.images.report = report
        settings = depsgraph.scene.lumicut
        try:
            data = collect.Collector(depsgraph, report, cache=self.cache, images=self.images,
                                     max_shininess=settings.max_shininess, bake=sky.bake_later).collect()
        except Exception as error:
            traceback.print_exc()
            self.message = f"collecting failed: {error}"
            return
        self.data, self.scene = data, depsgraph.scene.name
        self.settings = self._settings(settings)
        self.view = None  # the next draw asks for it
        runtime.remember(report)
        engine.tag_redraw()

    @staticmethod
    def _settings(settings):
        chosen = settings.integrator
        levels = []
        for divisor, quality in LEVELS:
            name, suggested = properties.tables.suggested(quality) if quality else (chosen, {})
            if not suggested:
                name = chosen
            values = (properties.parameters_of if name == chosen else properties.common_parameters_of)(settings, name) | suggested
            if "vpls" in values:
                values["vpls"] = str(settings.viewport_lights)
            if quality and "compensate" in values:
                values["compensate"] = "false"  # noise, until passes average it
            levels.append((divisor, name, values))
        final = {"passes": settings.viewport_passes, "max_seconds": settings.viewport_seconds, "target_error": settings.viewport_target_error,
                 "confidence": settings.confidence}
        return {"levels": levels, "final": final, "denoise": settings.denoise_viewport and settings.viewport_passes > 1, "exposure": passes.exposure(settings.id_data), "tracing": properties.tracing_of(settings), "threads": settings.threads,
                "max_shininess": settings.max_shininess}

    def settings_now(self):
        """The scene's settings, or None where they are those of the picture."""
        scene = bpy.data.scenes.get(self.scene)
        if scene is None or self.settings is None or not properties.tables.integrators:
            return None
        fresh = self._settings(scene.lumicut)
        return fresh if fresh != self.settings else None

    def draw(self, engine, context, depsgraph):
        region = context.region
        width, height = region.width, region.height
        if self.data is None and not self.message.startswith("collecting failed"):
            self.update(engine, context, depsgraph)
        changed = ()
        fresh = self.settings_now()
        if fresh is not None:
            changed = {key for key, value in fresh.items() if value != self.settings[key]}
            self.settings = fresh
            if "max_shininess" in changed:
                self.update(engine, context, depsgraph)  # materials are read with it
        if self.data is not None and runtime.loaded() is not None:
            camera = cameras.viewport_camera(context, width, height)
            view = (bytes(camera), width, height)
            if view != self.view or changed:
                new_scene = self.view is None or not {"tracing", "threads"}.isdisjoint(changed)
                self.view = view
                self._ask(self.data if new_scene else None, camera, (width, height))
        elif runtime.loaded() is None:
            self.message = "the library is not loaded: see the render properties"
        self._paint(width, height)
        if self.message != self.told:
            self.told = self.message
            engine.update_stats("Lumicut", self.message)

    def _ask(self, data, camera, size):
        with self.condition:
            if data is None and self.request is not None:
                data = self.request[0]  # not yet begun: its scene still waits
            self.request = (data, camera, size, self.settings)
            if self.running is not None:
                self.running.cancel()
            if self.thread is None:
                self.thread = threading.Thread(target=self._work, name="lumicut viewport", daemon=True)
                self.thread.start()
            self.condition.notify()

    def _paint(self, width, height):
        with self.condition:
            picture, number = self.picture, self.picture_number
        if picture is None:
            return
        if self.texture is None or self.texture_number != number:
            rows, columns = picture.shape[:2]
            buffer = gpu.types.Buffer("FLOAT", rows * columns * 4, picture.reshape(-1))
            self.texture = gpu.types.GPUTexture((columns, rows), format="RGBA16F", data=buffer)
            self.texture_number = number
        engine = self.engine()
        gpu.state.blend_set("ALPHA_PREMULT")
        engine.bind_display_space_shader(bpy.context.scene)
        draw_texture_2d(self.texture, (0, 0), width, height)
        engine.unbind_display_space_shader()
        gpu.state.blend_set("NONE")
        self.shown = number

    def close(self, wait=False):
        with self.condition:
            self.closed = True
            if self.running is not None:
                self.running.cancel()
            self.condition.notify()
        if wait and self.thread is not None:
            self.thread.join(5)

    # ---- The worker's side --------------------------------------------------------------------------------------

    def _cancelled(self):
        return self.closed or self.request is not None

    def _guarded(self, handle, fn):
        """fn(), which a new request cancels through `handle`."""
        with self.condition:
            if self._cancelled():
                raise library.Cancelled(library.CANCELLED, "a newer view waits")
            self.running = handle
        try:
            return fn()
        finally:
            with self.condition:
                self.running = None

    def _work(self):
        scenes, integrators = {}, {}  # "": the whole scene; those that shadow catchers need beside it
        pending = None  # scene data that was not yet uploaded when a newer view came
        while True:
            with self.condition:
                while self.request is None and not self.closed:
                    self.condition.wait()
                if self.closed:
                    break
                data, camera, size, settings = self.request
                self.request = None
            pending = data or pending
            try:
                device = runtime.device(settings["threads"])
                if pending is not None:
                    self.message = "building"
                    pending.camera = camera
                    parts = {"": pending} | (shadow_catcher.scenes(pending) if shadow_catcher.is_needed(pending) else {})
                    fresh = {name: library.Scene(device, **settings["tracing"]) for name in parts}
                    for name, part in parts.items():
                        part.upload(fresh[name], self._raise_if_cancelled)
                        self._guarded(fresh[name], fresh[name].commit)
                    scenes, integrators, pending = fresh, {}, None
                for scene in scenes.values():
                    scene.set_camera(camera)
                    self._guarded(scene, scene.commit)
                self._render_levels(device, scenes, integrators, size, settings, camera)
                self.message = "done"
            except library.Cancelled:
                continue
            except (library.Error, library.LibraryMissing) as error:
                self.message = f"failed: {error}"
            except Exception as error:
                traceback.print_exc()
                self.message = f"failed: {error}"

    def _raise_if_cancelled(self):
        if self._cancelled():
            raise library.Cancelled(library.CANCELLED, "a newer view waits")

    def _render_levels(self, device, scenes, integrators, size, settings, camera):
        def start(part, name, values, pixels, **options):
            key = (part, name, tuple(sorted(values.items())))
            if key not in integrators:
                integrator = library.Integrator(device, name)
                for parameter, value in values.items():
                    integrator.set(parameter, value)
                integrators[key] = integrator
            return library.Render(integrators[key], scenes[part], *pixels, **options)

        beside = [part for part in scenes if part]
        for number, (divisor, name, values) in enumerate(settings["levels"]):
            pixels = max(1, size[0] // divisor), max(1, size[1] // divisor)
            self.message = f"{pixels[0]} x {pixels[1]}"
            rounds = [{"flags": 0}]
            if divisor == 1:
                # Pictures of scenes beside each other come when all of them are done: one pass of each before the rest.
                rounds = ([{"flags": 0}] if beside and settings["final"]["passes"] != 1 else []) \
                    + [settings["final"] | {"flags": library.DENOISE if settings["denoise"] else 0}]
            for options in rounds:
                channel = "denoised" if options["flags"] else "radiance"
                with start("", name, values, pixels, **options) as render:
                    done = self._guarded(render, lambda: self._follow(render, settings, camera, not beside))
                    caught = {}
                    for part in beside:  # of the same samples
                        with start(part, name, values, pixels, passes=max(1, done.passes_done), flags=options["flags"]) as other:
                            self._guarded(other, lambda: self._follow(other, settings, camera, False))
                            caught[part] = {image: other.read(image) for image in {"radiance", "alpha", channel}}
                    self._show(render, settings, camera, channel, caught)
            self.levels_done = number + 1

    def _follow(self, render, settings, camera, show):
        """Waits for the end, and gives the last status; meanwhile shows the mean of the passes so far, where it is to `show`."""
        shown, passes_shown = time.perf_counter(), 0
        while (status := render.wait(POLL_MS)).state == library.RUNNING:
            if status.passes_total == 1 or status.passes_done == 0:
                continue
            self.message = f"iteration {status.passes_done + 1}" + (f"/{status.passes_total}" if status.passes_total else "")
            if show and status.passes_done > passes_shown and time.perf_counter() > shown + SHOW_SECONDS:
                self._show(render, settings, camera, "radiance")
                shown, passes_shown = time.perf_counter(), status.passes_done
        return status

    def _show(self, render, settings, camera, channel, caught=None):
        """`caught`: of the scenes that shadow catchers need [shadow_catcher.py], where there are any."""
        data = self.data
        radiance, alpha = render.read(channel), render.read("alpha")
        height, width = radiance.shape[:2]
        picture = np.ones((height, width, 4), np.float32)
        behind = data.backdrop.seen(camera, width, height, (0, 0, width, height)) if data.backdrop is not None else 0
        if caught:
            radiance, alpha = shadow_catcher.over(render.read("radiance"), alpha, caught, behind, not data.transparent, channel)
        elif data.backdrop is not None:
            radiance = radiance + (1 - alpha) * behind
        picture[..., :3] = radiance[::-1] * settings["exposure"]
        if data.transparent:
            picture[..., 3] = alpha[::-1, :, 0]
        with self.condition:
            self.picture = np.ascontiguousarray(np.minimum(picture, 60000.0))  # of half floats
            self.picture_number += 1


def _tick():
    """Redraws views that have news: drawing belongs to the interface's thread."""
    alive = False
    fresh_sky = sky.poll()
    for session in list(_sessions):
        if session.closed:
            continue
        alive = True
        engine = session.engine()
        try:
            if engine is None:
                session.close()
            elif fresh_sky:
                session.data = None  # collected anew at the next draw
                engine.tag_redraw()
            elif session.settings_now() is not None:
                engine.tag_redraw()
            elif session.shown != session.picture_number and session.picture is not None or session.message != session.told:
                engine.tag_redraw()
        except ReferenceError:  # Blender has freed it
            session.close()
    return TICK if alive else None


def of(engine):
    session = getattr(engine, "_session", None)
    if session is None:
        session = engine._session = Session(engine)
    return session


def forget(engine):
    try:
        session = engine.__dict__.get("_session")
    except (AttributeError, ReferenceError):
        return
    if session is not None:
        session.close()


def stop_all():
    sky.stop_all()
    for session in list(_sessions):
        session.close(wait=True)
    if bpy.app.timers.is_registered(_tick):
        bpy.app.timers.unregister(_tick)
