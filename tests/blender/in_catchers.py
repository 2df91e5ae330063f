"""Shadow catchers beside Cycles: transparent and opaque films, lamps that are of the footage and such that are not."""
import threading
import time
import unittest

import bpy
import numpy as np

import helpers as h


class Catchers(unittest.TestCase):
    def setUp(self):
        self.scene = h.new_scene(40, 40)
        h.set_world((0.5, 0.4, 0.3))
        self.ground = h.add_plane(8, material=h.diffuse((0.8, 0.6, 0.3)))
        self.ground.is_shadow_catcher = True
        self.ball = h.add_sphere(0.6, (0.2, 0.1, 1), h.diffuse((0.8, 0.2, 0.1)), segments=48)
        self.sun = h.add_light("SUN", energy=4, rotation=(0.6, 0.5, 0), angle=0.1)
        self.sun.is_shadow_catcher = True
        self.scene.camera.location.z = 7

    def compare(self, most=0.03, **parameters):
        ours, theirs = h.both(256, 32, 2, **{"vpls": 2000} | parameters)
        a, b = (h.blocks(image["Combined"]) for image in (ours, theirs))
        np.testing.assert_allclose(a.mean((0, 1)), b.mean((0, 1)), atol=0.01)
        self.assertLess(np.abs(a - b).mean(), most / 3)
        self.assertLess(np.abs(a - b)[..., 3].max(), 2 * most)  # 2,000 lights leave a per cent or two of noise in shadows
        return ours, theirs

    def test_shadows_are_alpha_where_the_film_is_transparent(self):
        self.scene.render.film_transparent = True
        ours, theirs = self.compare()
        for image in (ours, theirs):
            alpha, red = image["Combined"][..., 3], image["Combined"][..., 0]
            shadow = (alpha > 0.3) & (alpha < 0.95) & (red < 1e-3)
            self.assertGreater(shadow.mean(), 0.03)
            self.assertLess(alpha[:4].max(), 0.05)

    def test_the_world_stands_behind_where_it_is_opaque(self):
        ours, _ = self.compare()
        np.testing.assert_allclose(ours["Combined"][2, 2], (0.5, 0.4, 0.3, 1), atol=0.02)

    def test_lamps_of_the_scene_alone_brighten_and_throw_no_shadow(self):
        self.sun.is_shadow_catcher = False
        self.scene.render.film_transparent = True
        ours, _ = self.compare()
        alpha, red = ours["Combined"][..., 3], ours["Combined"][..., 0]
        self.assertLess(alpha[red < 1e-3].max(), 0.3)

    def test_emitting_meshes_are_of_the_scene(self):
        lamp = h.add_mesh("Lamp", [(-1, -1, 3), (-1, 0, 3), (0, 0, 3), (0, -1, 3)], [(0, 1, 2, 3)], h.emission(8))
        lamp.visible_camera = False
        self.scene.render.film_transparent = True
        self.compare()

    def test_a_pass_of_its_own_takes_the_shadows_out_of_combined(self):
        self.scene.view_layers[0].cycles.use_pass_shadow_catcher = True
        for transparent in (True, False):
            with self.subTest(transparent=transparent):
                self.scene.render.film_transparent = transparent
                ours, theirs = self.compare()
                a, b = (h.blocks(image["Shadow Catcher"][..., :3]) for image in (ours, theirs))
                np.testing.assert_allclose(a.mean((0, 1)), b.mean((0, 1)), atol=0.02)
                self.assertLess(np.abs(a - b).mean(), 0.03)
                self.assertLess(np.abs(ours["Combined"][2, 2]).max(), 1e-6)

    def test_others_that_share_the_mesh_stay_what_they_are(self):
        twin = h.link(bpy.data.objects.new("Twin", self.ground.data))
        twin.scale, twin.location = (0.1, 0.1, 1), (-1.5, 1, 0.5)
        self.scene.render.film_transparent = True
        ours, _ = self.compare()
        self.assertGreater(ours["Combined"][..., 1].max(), 0.3)

    def test_denoised_frames_have_them_too(self):
        self.scene.render.film_transparent = True
        with h.quiet():
            h.set_cycles(256, 2)
            theirs = h.render()
            h.set_lumicut("lightcuts", 1, passes=16, denoise=True, vpls=1000)
            ours = h.render()
        a, b = (h.blocks(image["Combined"]) for image in (ours, theirs))
        np.testing.assert_allclose(a.mean((0, 1)), b.mean((0, 1)), atol=0.01)

    def test_views_show_them_as_f12_does(self):
        from lumicut_blender import cameras, collect, report, viewport
        self.scene.cycles.pixel_filter_type = "BOX"  # as views have it
        settings = self.scene.lumicut
        for transparent in (True, False):
            with self.subTest(transparent=transparent):
                self.scene.render.film_transparent = transparent
                with h.quiet():
                    h.set_lumicut("lightcuts", 1, passes=4, vpls=1000)
                    settings.viewport_passes, settings.viewport_lights, settings.denoise_viewport = 4, 1000, False
                    f12 = h.render()["Combined"]
                depsgraph = bpy.context.evaluated_depsgraph_get()
                owner = threading.Event()  # any object: nothing is drawn
                session = viewport.Session(owner)
                self.addCleanup(session.close, True)
                session.settings = session._settings(settings)
                session.data = collect.Collector(depsgraph, report.Report(), cache=session.cache).collect()
                camera = cameras.convert_camera(self.scene.camera, self.scene, report.Report())
                session._ask(session.data, camera, (40, 40))
                end = time.monotonic() + 60
                while session.message != "done" and not session.message.startswith("failed") and time.monotonic() < end:
                    time.sleep(0.05)
                self.assertEqual(session.message, "done")
                view = session.picture[::-1]
                np.testing.assert_allclose(h.blocks(view), h.blocks(f12), atol=1e-3)  # passes of the same seed
