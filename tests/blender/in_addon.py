"""The add-on itself: switching on and off, the library's tables, what is missing, many renders in one process."""
import ctypes
import os
import pathlib
import re
import unittest
import unittest.mock

import addon_utils
import bpy
import numpy as np

import helpers as h
import lumicut_blender
from lumicut_blender import passes, properties, runtime
from lumicut_blender.lumicut import library

PACKAGE = pathlib.Path(lumicut_blender.__file__).resolve().parent


class Registration(unittest.TestCase):
    def setUp(self):
        h.new_scene()

    def tearDown(self):
        addon_utils.enable("lumicut_blender")

    def engines(self):
        return [getattr(cls, "bl_idname", "") for cls in bpy.types.RenderEngine.__subclasses__() if cls.is_registered]

    def test_it_goes_away_and_comes_back_and_renders_still(self):
        for _ in range(3):
            addon_utils.disable("lumicut_blender")
            self.assertNotIn("LUMICUT", self.engines())
            self.assertFalse(hasattr(bpy.types.Scene, "lumicut"))
            self.assertFalse(hasattr(bpy.types, "LUMICUT_PT_sampling"))
            self.assertFalse([p for p in bpy.types.Panel.__subclasses__()
                              if "LUMICUT" in getattr(p, "COMPAT_ENGINES", ())
                              and p.__module__.split(".")[0] != "lumicut_blender"])
            self.assertIsNotNone(addon_utils.enable("lumicut_blender"))
            self.assertIn("LUMICUT", self.engines())
        h.add_plane()
        with h.quiet():
            h.set_lumicut(vpls=100)
            h.render()

    def test_reloading_scripts_keeps_it_working(self):
        import importlib
        addon_utils.disable("lumicut_blender")
        importlib.reload(lumicut_blender)
        addon_utils.enable("lumicut_blender")
        h.add_plane()
        with h.quiet():
            h.set_lumicut(vpls=100)
            h.render()

    def test_panels_of_cycles_are_left_alone(self):
        for panel in bpy.types.Panel.__subclasses__():
            if panel.__module__.startswith("cycles"):
                self.assertNotIn("LUMICUT", panel.COMPAT_ENGINES, panel.__name__)


class Tables(unittest.TestCase):
    def setUp(self):
        h.new_scene()

    def test_every_parameter_of_the_library_is_a_property_with_its_default(self):
        settings = bpy.context.scene.lumicut
        rows = runtime.require().integrators()
        self.assertGreater(len(rows), 4)
        for row in rows:
            identifier, parameters = row.id, row.parameters
            text = properties.parameters_of(settings, identifier)
            self.assertEqual(set(text), {p["id"] for p in parameters})
            for p in parameters:
                if p["type"] in (library.INT, library.FLOAT):
                    self.assertEqual(float(text[p["id"]]), float(p["default_text"]), (identifier, p["id"]))
                elif p["type"] == library.BOOL:
                    self.assertEqual(text[p["id"]] == "true", p["default_text"] in {"1", "true"}, (identifier, p["id"]))
                else:
                    self.assertEqual(text[p["id"]], p["default_text"], (identifier, p["id"]))

    def test_tooltips_and_ranges_are_the_librarys(self):
        settings = bpy.context.scene.lumicut
        row = next(r for r in runtime.require().integrators() if r.id == "lightcuts")
        error = next(p for p in row.parameters if p["id"] == "error")
        prop = settings.lightcuts.bl_rna.properties["error"]
        self.assertIn(error["description"], prop.description)
        self.assertEqual((prop.hard_min, prop.hard_max), (error["minimum"], error["maximum"]))

    def test_every_integrator_renders_what_it_is_set_to(self):
        h.add_plane(material=h.diffuse())
        h.add_light("POINT")
        for identifier in (row.id for row in runtime.require().integrators()):
            with self.subTest(integrator=identifier), h.quiet():
                h.set_lumicut(identifier, vpls=200)
                self.assertGreater(h.radiance(h.render()).mean(), 0.01)
                self.assertEqual(h.last_stats()["integrator"], identifier)

    def test_an_integrator_gets_the_parameters_that_it_lists(self):
        settings = bpy.context.scene.lumicut
        for row in runtime.require().integrators():
            self.assertEqual(set(properties.parameters_of(settings, row.id)), {p["id"] for p in row.parameters}, row.id)
        self.assertNotIn("vpls", properties.parameters_of(settings, "path_tracer"))
        self.assertIn("vpls", {p["id"] for p in properties.tables.common})

    def test_presets_set_what_they_promise(self):
        settings = bpy.context.scene.lumicut
        rows = {row.id: row for row in runtime.require().integrators()}
        self.assertEqual(list(properties.tables.presets), ["draft", "good", "final", "reference"])
        for name, preset in properties.tables.presets.items():
            bpy.ops.lumicut.preset(preset=name)
            self.assertEqual(settings.integrator, preset.integrator)
            text = properties.parameters_of(settings)
            self.assertTrue(preset.parameters, name)
            self.assertLessEqual(set(preset.parameters), {p["id"] for p in rows[preset.integrator].parameters})
            for key, value in preset.parameters.items():
                if value in {"true", "false"}:
                    self.assertEqual(text[key], value)
                else:
                    self.assertAlmostEqual(float(text[key]), float(value), places=6)
            for key in ("samples", "passes", "target_error"):
                self.assertAlmostEqual(getattr(settings, key), getattr(preset, key), places=6)

    def test_previews_take_an_integrator_that_the_library_suggests_for_them(self):
        for quality in ("interactive", "preview"):
            integrator, parameters = properties.tables.suggested(quality)
            self.assertTrue(parameters)
            self.assertLessEqual(set(parameters), properties.tables.ids[integrator])

    def test_a_library_before_1_4_is_taken_to_have_every_trait_and_to_suggest_nothing(self):
        old = [row._replace(traits=library.ANY_TRAIT, presets=dict.fromkeys(library.QUALITIES, {}))
               for row in runtime.require().integrators()]
        tables = properties.Tables(old)
        self.assertTrue(tables.has("lightcuts", library.LIGHT_GROUPS))
        self.assertEqual(tables.suggested("draft", "lightcuts"), ("lightcuts", {}))
        self.assertEqual(tables.suggested("preview"), (old[0].id, {}))

    def test_presets_leave_no_stop_of_the_one_before(self):
        settings = bpy.context.scene.lumicut
        settings.max_seconds, settings.target_error, settings.confidence = 5, 0.1, 0.9
        bpy.ops.lumicut.preset(preset="reference")
        self.assertTrue(settings.common.compensate and settings.passes > 1)
        bpy.ops.lumicut.preset(preset="draft")
        self.assertFalse(settings.common.compensate)
        self.assertEqual((settings.passes, settings.max_seconds, settings.target_error), (1, 0, 0))

    def test_a_library_without_embree_renders_by_its_own_tree_and_says_so(self):
        h.add_plane(material=h.diffuse())
        h.add_light("POINT")
        bpy.context.scene.lumicut.accel = "embree"
        with h.quiet(), unittest.mock.patch.object(runtime, "has_accel", lambda name: name == "bvh"):
            h.set_lumicut(vpls=100)
            self.assertGreater(h.radiance(h.render()).max(), 0)
        self.assertTrue(any("embree" in note and "own tree" in note for note in runtime.last["notes"]), runtime.last["notes"])

    def test_both_trees_give_the_same_image(self):
        import numpy as np
        if not runtime.has_accel("embree"):
            self.skipTest("this library has no Embree")
        h.add_plane(material=h.diffuse())
        h.add_sphere(0.5, (0, 0, 0.5))
        h.add_light("POINT", energy=100, shadow_soft_size=0)
        images = []
        for accel in ("bvh", "embree"):
            bpy.context.scene.lumicut.accel = accel
            with h.quiet():
                h.set_lumicut(vpls=300)
                images.append(h.radiance(h.render()))
        # Rays that graze edges may end on either side: single pixels, never areas.
        self.assertLess((np.abs(images[0] - images[1]).max(-1) > 0.01).mean(), 0.02)

    def test_statistics_are_those_of_the_last_render(self):
        h.add_plane(material=h.diffuse())
        h.add_light("POINT")
        with h.quiet():
            h.set_lumicut("lightcuts", vpls=500)
            h.render()
        last = h.last_stats()
        self.assertEqual(last["scene"], {"triangles": 2, "instances": 1, "meshes": 1, "lamps": 1})
        self.assertGreater(last["stats"]["counters"]["points"], 0)
        self.assertIn("light tree", last["stats"]["phases"])


class TheLibrary(unittest.TestCase):
    def test_all_ctypes_are_in_one_file(self):
        for path in PACKAGE.glob("*.py"):
            self.assertNotIn("ctypes", path.read_text(), path.name)

    def test_imports_are_blenders_numpys_and_pythons_own(self):
        import sys
        allowed = set(sys.stdlib_module_names) | {"blf", "bl_operators", "bl_ui", "bpy", "_cycles", "gpu", "gpu_extras", "bpy_extras", "mathutils", "numpy"}
        for path in PACKAGE.glob("*.py"):
            for name in re.findall(r"^\s*(?:import|from)\s+([A-Za-z_]\w*)", path.read_text(), re.M):
                self.assertIn(name, allowed, path.name)

    def test_a_missing_library_is_named_and_so_is_the_cure(self):
        saved = os.environ.pop("LUMICUT_LIBRARY", None)
        candidates = library.candidates
        library.candidates = lambda *_: [("preference", "/nowhere/liblumicut.so.1")]
        try:
            with self.assertRaisesRegex(library.LibraryMissing, "nowhere.*preferences"):
                library.Library()
        finally:
            library.candidates = candidates
            if saved:
                os.environ["LUMICUT_LIBRARY"] = saved

    def test_errors_of_the_library_name_field_and_value(self):
        device = library.Device(runtime.require())
        scene = library.Scene(device)
        with self.assertRaisesRegex(library.Error, "lumicut_material.*diffuse"):
            scene.set_materials([library.Material(diffuse=(ctypes.c_float * 3)(2, 0, 0))])

    def test_a_scene_without_a_camera_is_an_error(self):
        scene = h.new_scene()
        bpy.data.objects.remove(scene.camera)
        h.add_plane()
        with h.quiet():
            h.set_lumicut(vpls=100)
            with self.assertRaisesRegex(RuntimeError, "camera"):
                bpy.ops.render.render()


class ManyRenders(unittest.TestCase):
    def test_fifty_renders_do_not_grow_the_process(self):
        h.new_scene(48, 32)
        h.add_plane(material=h.diffuse())
        for i in range(20):
            h.add_sphere(0.2, (i % 5 - 2, i // 5 - 2, 0.3), h.diffuse(), 64)
        h.add_light("POINT")

        def resident():
            ctypes.CDLL(None).malloc_trim(0)  # what is free and was kept, in as many heaps as there were threads
            with open("/proc/self/statm") as f:
                return int(f.read().split()[1]) * os.sysconf("SC_PAGESIZE")

        sizes = []
        with h.quiet():
            h.set_lumicut("illumination_cut", vpls=300)
            for _ in range(50):
                bpy.ops.render.render()
                sizes.append(resident())
        scene_bytes = 20 * 64 * 32 * 2 * 3 * 24
        # A scene that stayed would add its meshes' bytes each time; allocators may keep a few of them at first.
        # Medians: what allocators give back for a moment does not count.
        growth = np.median(sizes[-10:]) - np.median(sizes[10:20])
        # They come and go by up to 25 MiB all the same.
        self.assertLess(growth, 30 * scene_bytes / 5, f"{[s >> 20 for s in sizes]} MiB")


class Passes(unittest.TestCase):
    def test_a_pass_is_written_by_one_copy(self):
        import numpy as np

        class Rect:
            calls = []

            def foreach_set(self, array):
                self.calls.append(array)

        class Pass:
            rect = Rect()

        pixels = np.arange(24, dtype=np.float32).reshape(2, 4, 3)
        passes.write_pass(Pass, pixels)
        self.assertEqual(len(Rect.calls), 1)
        np.testing.assert_array_equal(Rect.calls[0].reshape(2, 4, 3), pixels[::-1])
