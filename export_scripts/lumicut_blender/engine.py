# SPDX-License-Identifier: Apache-2.0
"""The render engine: final frames. The viewport's half is in viewport.py."""
import math
import threading
import time
import traceback

import bpy

from . import cameras, collect, export, motion, passes, properties, runtime, shadow_catcher, sky, viewport
from .lumicut import library
from .report import WRONG, Report

POLL_MS = 40
SHOW_SECONDS = 0.25  # between two changes of what is shown: each redraws the window, and a window that draws hears no key
export_requests = []  # folders that the next render writes a scene to, in place of rendering


class Stopped(Exception):
    pass


class Watched:
    """Runs calls of the library in a thread, so that the host's stop button is looked at while they work."""

    def __init__(self, engine):
        self.engine = engine

    def run(self, handle, phase, fn):
        failure = []

        def work():
            try:
                fn()
            except BaseException as error:  # handed over to the caller
                failure.append(error)

        thread = threading.Thread(target=work, name="lumicut")
        thread.start()
        stopped = False
        while thread.is_alive():
            thread.join(POLL_MS / 1000)
            if not stopped and self.engine.is_stopped():
                stopped = True
                handle.cancel()
            self.engine.say(phase)
        if failure and not isinstance(failure[0], library.Cancelled):
            raise failure[0]
        if stopped or failure:
            raise Stopped


class LumicutEngine(bpy.types.RenderEngine):
    bl_idname = "LUMICUT"
    bl_label = "Lumicut"
    bl_use_preview = True
    bl_use_eevee_viewport = True
    bl_use_postprocess = True
    bl_use_shading_nodes_custom = False
    bl_use_alembic_procedural = False

    # ---- Final frames -------------------------------------------------------------------------------------------

    def render(self, depsgraph):
        # An exception that leaves here gives a blank image and exit code 0, and error_set alone saves the image: report.
        try:
            self._render(depsgraph)
        except (Stopped, collect.Cancelled):
            if bpy.app.background:
                self.report({"ERROR"}, "Lumicut: cancelled, no image")
        except (library.Error, library.LibraryMissing, export.ExportError, OSError) as error:
            self.report({"ERROR"}, f"Lumicut: {error}")
        except Exception as error:
            traceback.print_exc()
            self.report({"ERROR"}, f"Lumicut: a defect of the add-on: {type(error).__name__}: {error}")

    # Blender's own functions cannot be overridden; these two can, and tests do.

    def is_stopped(self):
        """Whether the user wants no more of it: asked at least every 40 ms, in every phase."""
        return self.test_break()

    def say(self, phase, fraction=None):
        """The phase's name, and how far it is. Called at every poll; shown after a while, and at once where the phase is
        new and does not say how far it is. Passes go through their phases many times a second."""
        now, shown = time.perf_counter(), getattr(self, "_shown", None)
        if shown is not None and (now < shown[1] + SHOW_SECONDS if fraction is not None else shown[0] == phase):
            return
        self._shown = phase, now
        if fraction is None:
            self.update_stats("Lumicut", phase)
            return
        self.update_stats("Lumicut", f"{phase} {100 * fraction:.0f} %" if phase else "")
        # Preparing has several phases, which count from 0 each: it gets the first fifth together.
        self.update_progress(0.2 + 0.8 * fraction if phase == "render" else 0.2 * fraction)

    def _check(self):
        if self.is_stopped():
            raise collect.Cancelled

    def _render(self, depsgraph):
        runtime.require()
        scene = depsgraph.scene_eval
        settings = depsgraph.scene.lumicut
        if not self.is_preview and not export_requests:
            passes.check_compositor(depsgraph.scene, depsgraph.view_layer_eval)
        started = time.perf_counter()
        self.say("collecting the scene")
        report = self._report_of(scene.frame_current)
        layer = depsgraph.view_layer_eval
        hits = not self.is_preview and passes.wants_hits(layer)
        collector = collect.Collector(depsgraph, report, self._check, max_shininess=settings.max_shininess,
                                      bake=None if self.is_preview else sky.bake, hits=hits,
                                      uv_maps=hits and layer.use_pass_uv)
        data = collector.collect()
        views = cameras.views_of(self, scene, report)
        motions = motion.collect(self, depsgraph, data, views, collector.materials.images, report, self._check) \
            if hits and layer.use_pass_vector and not export_requests else None
        data.camera = views[0][1]
        collected = time.perf_counter() - started
        width, height = self.resolution_x, self.resolution_y
        crop = cameras.crop_of(scene.render, width, height)
        self._options = self._render_options(depsgraph, settings, data.groups, report)
        if export_requests:
            factor = passes.exposure(scene)
            if factor != 1:
                report.note(f"{factor:g}", "Film exposure, which scene files do not have")
            if data.backdrop is not None:
                report.note(scene.world.name, "Worlds that the camera sees otherwise, black in scene files' images")
            if len(views) > 1:
                report.note(views[0][0], "Of several views the first alone is exported")
        tracing = properties.tracing_of(settings)
        if tracing["accel"] != settings.accel:
            report.note(settings.accel, "Not in this library, whose own tree traces rays")
        self._tell(report)
        if export_requests and not self.is_preview:
            export.write_scene(export_requests[0], data, width, height, settings)
            self._blank(depsgraph, crop)
            return
        if self.is_preview:
            integrator_name, samples, parameters = self._preview_settings()
        else:
            integrator_name, samples = settings.integrator, settings.samples
            parameters = properties.parameters_of(settings)

        device = runtime.device(settings.threads)
        watched = Watched(self)
        with library.Scene(device, **tracing) as target, library.Integrator(device, integrator_name) as integrator:
            data.upload(target, self._check)
            triangles, instances = data.triangles(), sum(len(m.transforms) for m in data.meshes)
            self._backdrop = None
            if data.backdrop is not None:
                self._backdrop = (lambda camera, tile, seen=data.backdrop.seen: seen(camera, width, height, tile),
                                  data.environment.group if data.environment is not None else 0)
            lamps, meshes, groups = data.lamps, len(data.meshes), data.groups
            catching = {}
            if not self.is_preview and shadow_catcher.is_needed(data):
                catching = {name: (part, library.Scene(device, **tracing)) for name, part in shadow_catcher.scenes(data).items()}
                for part, beside in catching.values():
                    part.upload(beside, self._check)
                catching = {name: beside for name, (_, beside) in catching.items()}
            held = None if self.is_preview else passes.holdouts(data)
            of_hits = passes.hit_passes_of(data, layer, motions, held) if hits or held else None
            seen = {} if self.is_preview else passes.scenes_beside(data, layer, lambda aov: collect.Collector(
                depsgraph, None, self._check, max_shininess=settings.max_shininess, aov=aov).collect())
            frames = {name: (part, library.Scene(device, **tracing)) for name, part in seen.items()}
            for part, beside in frames.values():
                part.upload(beside, self._check)
            frames, seen = {name: beside for name, (_, beside) in frames.items()}, None
            data = part = None  # the library has its own copy now
            for name, value in parameters.items():
                integrator.set(name, value)
            for view, self._view in enumerate(views):
                target.set_camera(self._view[1])
                watched.run(target, "acceleration structure", target.commit)
                self._check()
                with library.Render(integrator, target, width, height, samples, crop, self._tile_size(crop),
                                    **self._options) as render:
                    finished = self._follow(render, depsgraph, crop, height, groups, not catching)
                    self._caught = {name: self._frame_beside(watched, name, beside, integrator_name, parameters, samples,
                                                             finished.passes_done, width, height, crop)
                                    for name, beside in catching.items()}
                    of_lamps = {}
                    for name, beside in frames.items():
                        if name in {passes.SHADOWED, passes.UNSHADOWED}:
                            own = properties.tables.has(integrator_name, library.LIGHT_GROUPS)
                            plain = {k: v for k, v in parameters.items() if k in {"vpls", "seed"}} if own else {"vpls": "3000"}
                            of_lamps[name] = self._frame_beside(watched, name, beside, integrator_name if own else "lightcuts", plain,
                                                                samples, finished.passes_done, width, height, crop, groups=True)
                            continue
                        frame = self._frame_beside(watched, name, beside, integrator_name, parameters, samples,
                                                   finished.passes_done, width, height, crop)
                        self._passes[name] = passes.of_frame(name, layer, frame, passes.exposure(scene))
                    if of_lamps:
                        self._passes[passes.BESIDE["use_pass_shadow"][0]] = passes.of_shadows(of_lamps)
                    if not self.is_preview:
                        self._passes |= passes.of_lobes(layer, scene, lambda name, **more: self._frame_beside(
                            watched, name, target, integrator_name, parameters, samples, finished.passes_done, width, height, crop,
                            **more), passes.exposure(scene))
                    if of_hits is not None:
                        self.say("passes of hits")
                        frame = library.RenderDesc(width=width, height=height, samples=samples, passes=self._options["passes"],
                                                   filter=self._options["pixel_filter"], filter_width=self._options["filter_width"])
                        frame.crop[:] = crop
                        seed = int(integrator.get("seed"))
                        self._passes |= of_hits.trace(target, frame, seed, finished.passes_done, self._check, view)
                        for field, text in of_hits.metadata(layer.name).items():
                            self.get_result().stamp_data_add_field(field, text)
                    self._write(render, depsgraph, self._chosen, crop, crop, height)
                    self.update_progress(1.0)
                    stats = render.stats()
        if not self.is_preview:
            runtime.remember(report)
            runtime.last.update(stats=stats, collect_seconds=collected, seconds=time.perf_counter() - started,
                                integrator=integrator_name,
                                scene={"triangles": triangles, "instances": instances, "meshes": meshes, "lamps": lamps})

    @staticmethod
    def _preview_settings():
        integrator, parameters = properties.tables.suggested("preview")
        return integrator, 1, parameters or {"vpls": "300"}

    def _render_options(self, depsgraph, settings, groups, report):
        """What lumicut_render_desc has beside size, samples and tiles."""
        self._denoised = False
        if self.is_preview:
            return {}
        if groups and not properties.tables.has(settings.integrator, library.LIGHT_GROUPS):
            report.note(settings.integrator, "Light groups left out by integrators that cannot tell them apart")
            groups = []
        options = {name: getattr(settings, name) for name in properties.STOPS}
        options["pixel_filter"], options["filter_width"] = cameras.filter_of(depsgraph.scene_eval)
        layer = depsgraph.view_layer_eval
        options["flags"] = (library.ILLUMINANCE if layer.lumicut.use_pass_illuminance else 0) | (library.GROUPS if groups else 0)
        self._denoised = settings.denoise and settings.passes != 1
        if self._denoised or passes.wants_denoising(layer):
            options["flags"] |= library.DENOISE | (0 if settings.firefly_filter else library.KEEP_FIREFLIES)
        passes.note_left_out(layer, report)
        if layer.samples > 0:
            report.note(layer.name, "Samples of view layers left out, which take the scene's")
        if layer.lumicut.use_pass_error and settings.passes == 1:
            report.note(layer.name, "Error passes that are 0, as a single pass cannot tell")
        return options

    @staticmethod
    def _tile_size(crop):
        # About a hundred tiles at most sizes: the host spends a millisecond or two on each.
        side = max(crop[2] - crop[0], crop[3] - crop[1])
        return 32 if side <= 320 else 64 if side <= 800 else 128

    def _tell(self, report):
        if self.is_preview:
            return
        runtime.remember(report)
        for (severity, _, _), line in zip(report.entries(), report.lines(most_names=12)):
            if line not in self._told:
                self._told.add(line)
                self.report({"WARNING" if severity == WRONG else "INFO"}, f"Lumicut: {line}")  # printed, where there is no window

    def _report_of(self, frame):
        """One for all view layers of a frame, which this is called for one after the other."""
        if getattr(self, "_notes", (None,))[0] != frame:
            self._notes, self._told = (frame, Report()), set()
        return self._notes[1]

    def _frame_beside(self, watched, name, scene, integrator_name, parameters, samples, passes_done, width, height, crop,
                      flags=0, groups=False, **more):
        """{channel: pixels} of another scene, rendered as the whole one was [shadow_catcher.py], or of the direct light of each
        of its `groups`; or of the same one, with `more` of what lumicut_render_desc has."""
        if not flags and not more:
            scene.set_camera(self._view[1])
            watched.run(scene, "acceleration structure", scene.commit)
            flags = library.DIRECT | library.GROUPS if groups else self._options["flags"] & (library.DENOISE | library.KEEP_FIREFLIES)
        if more.get("occlusion"):  # by no light
            parameters = parameters | {name: "1" for name in ("vpls", "samples") if name in parameters}
        with library.Integrator(scene.device, integrator_name) as integrator:
            for parameter, value in parameters.items():
                integrator.set(parameter, value)
            with library.Render(integrator, scene, width, height, samples, crop, self._tile_size(crop), passes=max(1, passes_done),
                                flags=flags, **{name: self._options[name] for name in ("pixel_filter", "filter_width")}, **more) as render:
                self._poll(render, f"beside: {name}", lambda: None)
                channels = ["radiance", "alpha", *(f"radiance.{group}" for group in render.groups())]
                channels += (["denoised"] if flags & library.DENOISE else []) + (["albedo"] if more or groups else [])
                return {channel: render.read(channel) for channel in channels}

    def _follow(self, render, depsgraph, crop, height, groups, show_tiles):
        """Polls until the frame is done; hands tiles over as they finish. The library's last status."""
        self._chosen = self._pass_list(depsgraph, groups, render.groups())
        self._caught, self._passes, self._tiles_shown = {}, {}, 0.0

        def show():
            if show_tiles and not bpy.app.background and time.perf_counter() > self._tiles_shown + SHOW_SECONDS:
                self._tiles_shown = time.perf_counter()
                deadline = self._tiles_shown + 0.1
                while time.perf_counter() < deadline and not self.is_stopped() and (tile := render.next_tile()) is not None:
                    self._write(render, depsgraph, self._chosen, crop, tile, height)

        return self._poll(render, "", show)

    def _poll(self, render, name, show):
        """Until it is done. `name`: of a render beside the frame's own, else empty; `show`: called while it runs."""
        stopped = False
        while True:
            try:
                status = render.wait(POLL_MS)
            except library.Cancelled:
                raise Stopped from None
            if not stopped and self.is_stopped():
                stopped = True
                render.cancel()
                continue
            phase, fraction = (status.phase or b"").decode(), status.fraction
            if status.passes_total != 1:
                phase, fraction = self._progress(status, phase)
            if name:
                phase, fraction = f"{name}: {phase}", status.tiles_done / max(1, status.tiles_total)
            self.say(phase, fraction)
            if status.state != library.RUNNING:
                break
            if not stopped:
                show()
        if self.is_stopped():
            raise Stopped
        return status

    def _progress(self, status, phase):
        """Text and share of a render of several passes."""
        total = status.passes_total
        number = f"{min(status.passes_done + 1, total)}/{total}" if total else f"{status.passes_done + 1}"
        error = f", error {100 * status.error:.2g} %" if math.isfinite(status.error) else ""
        if total:
            return f"pass {number}{error}, {phase}", status.tiles_done / max(1, status.tiles_total)
        # Until stopped: by the clock, or by the error, which falls with the root of the passes.
        stops, share = self._options, 0.0
        if stops["max_seconds"] > 0:
            share = status.seconds / stops["max_seconds"]
        if stops["target_error"] > 0 and math.isfinite(status.error):
            share = max(share, (stops["target_error"] / max(status.error, 1e-9)) ** 2)
        return f"pass {number}{error}, {phase}", min(1.0, share)

    def _pass_list(self, depsgraph, groups=(), lit=()):
        """[(pass name, what fills it, or None for black)] beside Combined. `groups`: names of light groups, from number 1;
        `lit`: numbers of those that something emits into."""
        layer = depsgraph.view_layer_eval
        chosen = passes.wanted(layer)
        for name, letters, _, _ in passes.added(chosen):
            self.add_pass(name, len(letters), letters, layer=layer.name)
        chosen = [(name, source) for name, _, _, source in chosen]
        for number, group in enumerate(groups, 1):
            self.add_pass(properties.GROUP_PASS + group, 3, "RGB", layer=layer.name)
            chosen.append((properties.GROUP_PASS + group, f"radiance.{number}" if number in lit else None))
        return chosen

    def _write(self, render, depsgraph, chosen, crop, tile, height):
        """A finished rectangle into the render result, which counts from the border's lower left corner."""
        x0, y0, x1, y1 = tile
        view, camera = self._view
        result = self.begin_result(x0 - crop[0], crop[3] - y1, x1 - x0, y1 - y0, layer=depsgraph.view_layer_eval.name, view=view)
        try:
            found = result.layers[0].passes
            filler = passes.Filler(render, depsgraph.scene_eval, camera, tile, *(self._backdrop or ()), denoised=self._denoised,
                                   caught=self._caught, shadows_apart=passes.wants_shadows_apart(depsgraph.view_layer_eval),
                                   beside=self._passes)
            for name, source in [("Combined", "combined"), *chosen]:
                target = found.get(name)
                pixels = filler.fill(name, source) if target is not None and source is not None else None
                if pixels is not None:
                    passes.write_pass(target, pixels)
        finally:
            self.end_result(result)

    def _blank(self, depsgraph, crop):
        result = self.begin_result(0, 0, crop[2] - crop[0], crop[3] - crop[1], layer=depsgraph.view_layer_eval.name)
        self.end_result(result)

    def update_render_passes(self, scene=None, renderlayer=None):
        self.register_pass(scene, renderlayer, "Combined", 4, "RGBA", "COLOR")
        for name, letters, kind, _ in passes.wanted(renderlayer):
            self.register_pass(scene, renderlayer, name, len(letters), letters, kind)
        for group in getattr(renderlayer, "lightgroups", ()):
            self.register_pass(scene, renderlayer, properties.GROUP_PASS + group.name, 3, "RGB", "COLOR")

    # ---- Viewport -----------------------------------------------------------------------------------------------

    def view_update(self, context, depsgraph):
        viewport.of(self).update(self, context, depsgraph)

    def view_draw(self, context, depsgraph):
        viewport.of(self).draw(self, context, depsgraph)

    def __del__(self):
        viewport.forget(self)


def register():
    bpy.utils.register_class(LumicutEngine)


def unregister():
    viewport.stop_all()
    bpy.utils.unregister_class(LumicutEngine)
