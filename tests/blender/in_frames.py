"""Frames: passes against Cycles, cameras, borders, transparency, several layers, colour of what is seen directly."""
import math
import re
import unittest

import bpy
import numpy as np

import helpers as h
from lumicut_blender import engine


def interior(a, b):
    """Pixels that both images agree to be hit, without those at outlines: Cycles' one sample lies elsewhere in the pixel."""
    hit = (a < 1e9) & (b < 1e9)
    near = np.abs(np.diff(b, axis=0, prepend=b[:1])) + np.abs(np.diff(b, axis=1, prepend=b[:, :1]))
    near += np.abs(np.diff(b[::-1], axis=0, prepend=b[-1:]))[::-1] + np.abs(np.diff(b[:, ::-1], axis=1, prepend=b[:, -1:]))[:, ::-1]
    return hit & (near < 0.2)


class Passes(unittest.TestCase):
    def setUp(self):
        self.scene = h.new_scene(80, 60)
        layer = bpy.context.view_layer
        layer.use_pass_z = layer.use_pass_normal = layer.use_pass_position = True
        h.add_plane(3, -0.5, h.diffuse())
        h.add_sphere(0.8, (0.2, 0.1, 0.4), h.diffuse((0.9, 0.1, 0.1)))
        h.add_light("POINT", (1, -1, 4), 100)

    def passes(self):
        with h.quiet():
            h.set_cycles(1)
            cycles = h.render()
            h.set_lumicut("exhaustive", vpls=200)
            ours = h.render()
        return {name.split("_")[-1]: value for name, value in ours.items()}, cycles

    def compare(self):
        ours, cycles = self.passes()
        a, b = ours["Depth"][..., 0], cycles["Depth"][..., 0]
        inside = interior(a, b)
        self.assertGreater(inside.mean(), 0.05)
        # Cycles' sample is anywhere in the pixel; outlines are left out, slopes are not.
        self.assertLess(np.abs(a - b)[inside].mean(), 0.01)
        self.assertLess(((a > 1e9) != (b > 1e9)).mean(), 0.03, "background against Cycles")
        self.assertTrue((a[a > 1e9] == b[b > 1e9].max()).all(), "depth of the background is Cycles'")
        for name, most in (("Normal", 0.05), ("Position", 0.05)):
            difference = np.linalg.norm(ours[name] - cycles[name], axis=-1)
            self.assertLess(difference[inside].mean(), most, name)
        return ours, cycles

    def test_depth_normal_and_position_are_cycles(self):
        ours, _ = self.compare()
        n = ours["Normal"]
        length = np.linalg.norm(n, axis=-1)
        np.testing.assert_allclose(length[length > 0], 1, atol=1e-5)

    def test_cameras_of_all_fits_shifts_and_projections(self):
        camera = self.scene.camera
        camera.rotation_euler = (0.2, -0.15, 0.3)
        camera.location = (-0.9, -1.2, 5)
        for values, size, aspect in (
                ({"lens": 35}, (80, 60), (1, 1)),
                ({"lens": 40, "shift_x": 0.15, "shift_y": -0.1}, (80, 60), (1, 1)),
                ({"lens": 40, "shift_x": 0.15, "shift_y": -0.1}, (50, 80), (1, 1)),
                ({"lens": 30, "sensor_fit": "VERTICAL", "sensor_height": 20, "shift_x": 0.1}, (80, 60), (1, 1)),
                ({"lens": 30, "sensor_fit": "HORIZONTAL"}, (50, 80), (1, 1)),
                ({"lens": 35}, (80, 60), (2, 1)),
                ({"type": "ORTHO", "ortho_scale": 4, "shift_x": 0.1, "shift_y": 0.05}, (80, 60), (1, 1)),
                ({"type": "ORTHO", "ortho_scale": 4, "shift_x": 0.1}, (50, 80), (1, 1))):
            with self.subTest(values=values, size=size, aspect=aspect):
                camera.data = bpy.data.cameras.new("Camera")
                for name, value in values.items():
                    setattr(camera.data, name, value)
                self.scene.render.resolution_x, self.scene.render.resolution_y = size
                self.scene.render.pixel_aspect_x, self.scene.render.pixel_aspect_y = aspect
                self.compare()

    def test_own_passes_hold_what_their_names_say(self):
        settings = bpy.context.view_layer.lumicut
        settings.use_pass_albedo = settings.use_pass_cut_size = settings.use_pass_rays = settings.use_pass_bounds = True
        with h.quiet():
            h.set_lumicut("lightcuts", vpls=500)
            ours = h.render()
        layers = {name: value for name, value in ours.items()}
        for name in ("Albedo", "Lumicut Cut Size", "Lumicut Rays", "Lumicut Bounds"):
            self.assertIn(name, layers)
        albedo = layers["Albedo"]
        hit = ours["Depth"][..., 0] < 1e9
        np.testing.assert_allclose(np.unique(albedo[hit][:, 0].round(3)), [0.5, 0.9])
        self.assertEqual(albedo[~hit].max(), 0)
        self.assertGreater(layers["Lumicut Cut Size"][hit].min(), 0)

    def test_error_shrinks_with_passes_and_stops_them(self):
        scene, layer = self.scene.lumicut, bpy.context.view_layer.lumicut
        layer.use_pass_error = True
        h.add_light("AREA", (0, 1, 3), 60, size=1.0)
        errors = []
        with h.quiet():
            for passes in (1, 4, 16):
                h.set_lumicut("exhaustive", vpls=60)
                scene.passes = passes
                errors.append(h.render()["Lumicut Error"].mean())
            self.assertFalse(any("single pass" in note for note in h.last_notes()))
            scene.passes, scene.target_error, scene.confidence = 0, 0.2, 0.9
            said = []
            cls = engine.LumicutEngine
            saved, cls.say = cls.say, lambda this, *words: (said.append(words), saved(this, *words))
            try:
                h.render()
            finally:
                cls.say = saved
        self.assertEqual(errors[0], 0)
        self.assertGreater(errors[1], 0)
        # Half an interval: Student's t of 4 against 16 passes, 3.18 to 2.13, over the root of their numbers.
        self.assertLess(errors[2], errors[1])
        values = h.last_stats()["stats"]["values"]
        self.assertGreaterEqual(values["passes"], 8)
        self.assertLessEqual(values["error"], 0.2)
        texts = [words[0] for words in said]
        self.assertTrue(any(re.match(r"pass \d+, error [0-9.]+ %, ", text) for text in texts), texts[-3:])
        shares = [words[1] for words in said if len(words) > 1 and words[0].startswith("pass")]
        self.assertTrue(all(0 <= share <= 1 for share in shares))

    def test_a_time_limit_ends_the_passes(self):
        scene = self.scene.lumicut
        with h.quiet():
            h.set_lumicut("exhaustive", vpls=60)
            scene.passes, scene.max_seconds = 0, 0.5
            h.render()
        self.assertGreater(h.last_stats()["stats"]["values"]["passes"], 1)

    def test_illuminance_is_pi_times_radiance_over_albedo_in_lux(self):
        bpy.context.view_layer.lumicut.use_pass_illuminance = True
        with h.quiet():
            h.set_lumicut("exhaustive", vpls=60, max_depth=0)
            ours = h.render()
        lux = ours["Lumicut Illuminance"][..., 0]
        plane = (ours["Depth"][..., 0] < 1e9) & (np.abs(ours["Position"][..., 2] + 0.5) < 1e-3) & (ours["Combined"][..., 0] > 0.01)
        self.assertGreater(plane.sum(), 100)
        expected = 683 * np.pi * ours["Combined"][..., 0] / 0.5  # a grey plane under a white lamp
        np.testing.assert_allclose(lux[plane], expected[plane], rtol=1e-3)

    def groups(self):
        """Two groups of lamps, an emissive mesh in the first, one lamp in none."""
        layer = bpy.context.view_layer
        for name in ("Key", "Room", "Empty"):
            layer.lightgroups.add(name=name)
        bpy.data.objects["POINT"].lightgroup = "Key"
        lamp = h.add_plane(0.4, 2.5, h.emission(8, (1, 0.7, 0.4)), "Lamp")
        lamp.lightgroup = "Key"
        lamp.location.x = 1.5
        h.add_light("AREA", (-1, 1, 3), 60, size=0.5).lightgroup = "Room"
        h.add_light("SUN", energy=0.5, rotation=(0.4, 0.2, 0), angle=0.0)
        h.set_world((0.1, 0.2, 0.3))
        self.scene.world.lightgroup = "Room"

    def test_light_groups_and_the_rest_sum_to_combined_and_agree_with_cycles(self):
        self.groups()
        rest = {}
        cls = engine.LumicutEngine
        saved = cls._write

        def write(this, render, depsgraph, passes, crop, tile, height):
            rest.update(numbers=render.groups(), image=render.read("radiance.0"))
            saved(this, render, depsgraph, passes, crop, tile, height)

        cls._write = write
        try:
            with h.quiet():
                h.set_lumicut("exhaustive", passes=16, vpls=5000, max_depth=0, direct_share=1.0)
                ours = h.render()
        finally:
            cls._write = saved
        self.assertEqual(rest["numbers"], [0, 1, 2])
        total = ours["Combined_Key"] + ours["Combined_Room"] + rest["image"]
        np.testing.assert_allclose(total, ours["Combined"][..., :3], rtol=1e-4, atol=1e-4)
        self.assertEqual(ours["Combined_Empty"].max(), 0)
        with h.quiet():
            h.set_cycles(512)
            cycles = h.render()
        for name in ("Combined_Key", "Combined_Room"):
            a, b = h.blocks(ours[name], 5), h.blocks(cycles[name], 5)
            np.testing.assert_allclose(a.mean((0, 1)) / b.mean((0, 1)), 1, atol=0.02, err_msg=name)
            self.assertGreater(b.mean(), 0.01)

    def test_light_groups_are_listed_where_an_integrator_has_none(self):
        self.groups()
        with h.quiet():
            h.set_lumicut("path_tracer", 1)
            h.render()
        self.assertTrue(any("Light groups left out" in note for note in h.last_notes()), h.last_notes())

    def test_a_border_is_cut_out_of_the_whole(self):
        render = self.scene.render
        with h.quiet():
            h.set_lumicut("exhaustive", vpls=300)
            whole = h.radiance(h.render())
            render.use_border = True
            render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = 0.25, 0.75, 0.2, 0.5
            inside = h.radiance(h.render())
            render.use_crop_to_border = True
            cropped = h.radiance(h.render())
        self.assertEqual(cropped.shape, (18, 40, 3))
        np.testing.assert_array_equal(cropped, whole[30:48, 20:60])
        np.testing.assert_array_equal(inside[30:48, 20:60], cropped)
        inside[30:48, 20:60] = 0
        self.assertEqual(inside.max(), 0)

    def test_transparent_film_has_cycles_alpha_and_no_sky(self):
        h.set_world((0.2, 0.3, 0.4))
        self.scene.render.film_transparent = True
        with h.quiet():
            h.set_cycles(64)
            cycles = h.render()["Combined"]
            h.set_lumicut("exhaustive", 16, vpls=2000, max_depth=0)
            ours = h.render()["Combined"]
        # 16 samples a pixel tell coverage to 1/16 at outlines.
        self.assertLess(np.abs(ours[..., 3] - cycles[..., 3]).max(), 0.2)
        self.assertLess(np.abs(ours[..., 3] - cycles[..., 3]).mean(), 0.005)
        background = cycles[..., 3] == 0
        self.assertGreater(background.sum(), 50)
        self.assertEqual(ours[background].max(), 0)
        self.scene.render.film_transparent = False
        with h.quiet():
            opaque = h.render()["Combined"]
        self.assertEqual(opaque[..., 3].min(), 1)
        np.testing.assert_allclose(opaque[background][:, :3], np.broadcast_to((0.2, 0.3, 0.4), (background.sum(), 3)), rtol=1e-6)

    def test_two_view_layers_hold_their_own_collections(self):
        sphere = bpy.data.objects["Sphere"]
        group = bpy.data.collections.new("Second")
        self.scene.collection.children.link(group)
        group.objects.link(sphere)
        self.scene.collection.objects.unlink(sphere)
        second = self.scene.view_layers.new("Without")
        second.layer_collection.children["Second"].exclude = True
        second.use_pass_z = True
        image = self.scene.render.image_settings
        with h.quiet():
            h.set_lumicut("exhaustive", vpls=200)
            import tempfile
            image.file_format, image.color_depth, image.exr_codec = "OPEN_EXR_MULTILAYER", "32", "NONE"
            with tempfile.TemporaryDirectory() as folder:
                self.scene.render.filepath = folder + "/a.exr"
                bpy.ops.render.render(write_still=True)
                data = open(folder + "/a.exr", "rb").read()
        self.assertIn(b"ViewLayer.Combined.R", data)
        self.assertIn(b"Without.Depth.Z", data)

    def test_depth_of_field_blurs_as_much_as_in_cycles(self):
        bpy.data.objects.remove(bpy.data.objects["POINT"])
        h.add_light("SUN", energy=3, rotation=(0.3, 0.2, 0), angle=0.0)
        camera = self.scene.camera.data
        with h.quiet():
            h.set_lumicut("exhaustive", 64, vpls=200, max_depth=0)
            sharp = h.radiance(h.render())
            camera.dof.use_dof, camera.dof.focus_distance, camera.dof.aperture_fstop = True, 4.0, 0.05
            ours = h.radiance(h.render())
            h.set_cycles(256)
            cycles = h.radiance(h.render())
        blur, expected = h.blocks(ours - sharp, 2), h.blocks(cycles - sharp, 2)
        # The share of Cycles' blur that is in ours; 64 lens samples leave some per cent of noise.
        self.assertAlmostEqual((blur * expected).sum() / (expected ** 2).sum(), 1, delta=0.06)
        self.assertLess(np.abs(blur - expected).mean(), 0.25 * np.abs(expected).mean())

    def test_animation_renders_every_frame_with_its_own_places(self):
        import os
        import tempfile
        sphere = bpy.data.objects["Sphere"]
        for frame, x in ((1, -0.8), (2, 0.8)):
            sphere.location.x = x
            sphere.keyframe_insert("location", frame=frame)
        self.scene.frame_end = 2
        image = self.scene.render.image_settings
        image.file_format, image.color_depth, image.exr_codec = "OPEN_EXR_MULTILAYER", "32", "NONE"
        with tempfile.TemporaryDirectory() as folder, h.quiet():
            h.set_lumicut("exhaustive", vpls=200)
            self.scene.render.filepath = folder + "/a_"
            bpy.ops.render.render(animation=True)
            frames = [h.read_exr(f"{folder}/{name}")["Combined"][..., 0] for name in sorted(os.listdir(folder))]
        self.assertEqual(len(frames), 2)
        self.assertGreater(np.abs(frames[0] - frames[1]).max(), 0.1)

    def test_emission_is_seen_from_both_sides_with_its_strength(self):
        lamp = h.add_plane(1.0, 1.5, h.emission(3, (1, 0.5, 0.2)), "Lamp")
        for turn in (0, math.pi):
            lamp.rotation_euler = (turn, 0, 0)
            lamp.location = (0, 0, 3 if turn else 0)
            with h.quiet():
                h.set_lumicut("exhaustive", vpls=200)
                centre = h.radiance(h.render())[30, 40]
            np.testing.assert_allclose(centre, (3, 1.5, 0.6), rtol=1e-4)


class Rooms(unittest.TestCase):
    def test_a_small_room_agrees_with_long_cycles_up_to_the_clamp(self):
        """A closed diffuse room. What the clamp takes away lies in corners: mean within 6 %, the open middle within 3 %."""
        scene = h.new_scene(40, 30)
        scene.camera.location, scene.camera.rotation_euler = (0, -1.9, 1.2), (math.radians(85), 0, 0)
        scene.camera.data.lens = 20
        white, red = h.diffuse((0.7, 0.7, 0.7), "white"), h.diffuse((0.7, 0.2, 0.1), "red")
        h.add_mesh("Room", [(x, y, z) for z in (0, 2.5) for x, y in ((-2, -2), (2, -2), (2, 2), (-2, 2))],
                   [(0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3)], white)
        h.add_mesh("Left", [(-2, -2, 0), (-2, 2, 0), (-2, 2, 2.5), (-2, -2, 2.5)], [(0, 1, 2, 3)], red)
        h.add_light("AREA", (0.3, 0.2, 2.4), 40, shape="RECTANGLE", size=0.8, size_y=0.5)
        h.add_sphere(0.5, (0.6, 0.7, 0.5), white)
        with h.quiet():
            h.set_cycles(1500, 32)
            cycles = h.radiance(h.render())
            h.set_lumicut("lightcuts", 4, vpls=30000, error=0.01)
            ours = h.radiance(h.render())
        ratio = ours.mean((0, 1)) / cycles.mean((0, 1))
        self.assertTrue((ratio > 0.94).all() and (ratio < 1.01).all(), f"means against Cycles: {ratio}")
        middle = h.blocks(ours, 5)[1:-1, 1:-1].mean((0, 1)) / h.blocks(cycles, 5)[1:-1, 1:-1].mean((0, 1))
        np.testing.assert_allclose(middle, 1, atol=0.05)

    def test_lamps_shine_through_a_glass_window_as_in_cycles_when_compensated(self):
        """A lamp outside, a pane, a table, a glass ball. Light goes straight through the pane; the ball stops shadow rays."""
        scene = h.new_scene(32, 24)
        scene.camera.location, scene.camera.rotation_euler = (0, -1.9, 1.2), (math.radians(85), 0, 0)
        scene.camera.data.lens = 20
        white, glass = h.diffuse((0.7, 0.7, 0.7), "white"), h.material("glass")
        h.shader(glass, "ShaderNodeBsdfGlass", Roughness=0.0, IOR=1.45)

        def box(name, low, high, material):
            return h.add_mesh(name, [(x, y, z) for z in (low[2], high[2]) for x, y in
                                     ((low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1]))],
                              [(3, 2, 1, 0), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)], material)

        h.add_mesh("Room", [(x, y, z) for z in (0, 2.5) for x, y in ((-2, -2), (2, -2), (2, 2), (-2, 2))],
                   [(0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (2, 6, 7, 3), (3, 7, 4, 0)], white)
        for y0, y1, z0, z1 in ((-2, -1, 0, 2.5), (1, 2, 0, 2.5), (-1, 1, 0, 0.8), (-1, 1, 2, 2.5)):  # the wall about the window
            h.add_mesh("Wall", [(2, y0, z0), (2, y1, z0), (2, y1, z1), (2, y0, z1)], [(0, 1, 2, 3)], white)
        box("Pane", (1.98, -1, 0.8), (2, 1, 2), glass)
        box("Table", (-1, 0, 0), (0.4, 1, 0.6), h.diffuse((0.6, 0.4, 0.2), "wood"))
        h.add_sphere(0.3, (-0.3, 0.4, 0.9), glass, 48)
        h.add_light("AREA", (3, 0, 1.4), 300, (0, math.pi / 2, 0), shape="RECTANGLE", size=2.2, size_y=3.0)
        means = {}
        with h.quiet():
            h.set_cycles(400, 24)
            cycles = h.radiance(h.render()).mean()
            for compensate in (False, True):
                h.set_lumicut("illumination_cut", 1, vpls=3000, error=0.05, compensate=compensate)
                scene.lumicut.passes = 16
                means[compensate] = h.radiance(h.render()).mean() / cycles
        # The noise of 16 passes and of Cycles in the mean of 768 pixels: about 1 %, and caustics are rare and bright.
        self.assertAlmostEqual(means[True], 1, delta=0.05)
        self.assertAlmostEqual(means[False], 0.94, delta=0.04)  # without what the ball lets through; .6 where the pane stops it
        self.assertTrue(any("Glass" in note and "glass" in note for note in h.last_notes()), h.last_notes())
