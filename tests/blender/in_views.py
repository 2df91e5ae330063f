"""Views, film and passes beside Cycles: both eyes, borders to the row, exposure, mist, what compositors ask for."""
import unittest

import bpy
import numpy as np

import helpers as h
from lumicut_blender import cameras


def ball_in_the_sun(width, height):
    scene = h.new_scene(width, height)
    h.set_world((0.1, 0.15, 0.2))
    h.add_plane(6, -0.5, h.diffuse())
    h.add_sphere(0.8, (0.2, 0.1, 0.4), h.diffuse((0.9, 0.1, 0.1)))
    h.add_light("SUN", energy=2, rotation=(0.3, 0.4, 0), angle=0.0)
    scene.camera.rotation_euler = (0.4, 0, 0)
    scene.camera.location = (0, -2.5, 5)
    return scene


class Views(unittest.TestCase):
    def setUp(self):
        self.scene = ball_in_the_sun(40, 30)
        self.layer = self.scene.view_layers[0]

    # ---- Film ---------------------------------------------------------------------------------------------------

    def test_exposure_is_that_of_the_film_and_leaves_data_and_alpha_alone(self):
        self.layer.use_pass_z = True
        self.layer.lightgroups.add(name="Key")
        bpy.data.objects["SUN"].lightgroup = "Key"
        self.scene.render.film_transparent = True
        dark, _ = h.both(4, 4)
        self.scene.cycles.film_exposure = 2.5
        ours, theirs = h.both(256, 16)
        a, b = (image["Combined"].mean((0, 1)) for image in (ours, theirs))
        np.testing.assert_allclose(a, b, rtol=0.01)
        self.assertAlmostEqual(ours["Combined_Key"].mean() / theirs["Combined_Key"].mean(), 1, delta=0.01)
        with h.quiet():
            h.set_lumicut("exhaustive", 4, vpls=400, max_depth=0)
            bright = h.render()
        np.testing.assert_allclose(h.radiance(bright), 2.5 * h.radiance(dark), rtol=1e-5)
        np.testing.assert_array_equal(bright["Combined"][..., 3], dark["Combined"][..., 3])
        np.testing.assert_array_equal(bright["Depth"], dark["Depth"])

    def test_borders_are_cut_where_blender_cuts_them_to_the_row_and_column(self):
        render = self.scene.render
        render.use_border = render.use_crop_to_border = True
        h.set_cycles(1)
        h.set_lumicut("exhaustive", vpls=50, max_depth=0)
        shares = [k / 10 for k in range(11)] + [1 / 3, 2 / 3, 0.35, 0.999]
        with h.quiet():
            h.set_lumicut("exhaustive", vpls=50, max_depth=0)
            for width, height, percent in ((160, 120, 50), (50, 90, 100), (77, 61, 100)):
                render.resolution_x, render.resolution_y, render.resolution_percentage = width, height, percent
                for k in range(len(shares) - 3):
                    low, high = sorted((shares[k], shares[k + 3]))
                    render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = low, high, low, high
                    image = h.render()["Combined"]
                    with self.subTest(size=(width, height, percent), border=(low, high)):
                        self.assertTrue((image[..., 3] == 1).all(), "every row and column is rendered")
                        x0, y0, x1, y1 = cameras.crop_of(render, width * percent // 100, height * percent // 100)
                        self.assertEqual(image.shape[:2], (y1 - y0, x1 - x0))

    def test_tiles_of_a_farm_make_up_the_whole(self):
        render = self.scene.render
        render.resolution_x, render.resolution_y = 50, 30
        with h.quiet():
            h.set_lumicut("exhaustive", vpls=50, max_depth=0)
            whole = h.render()["Combined"]
            render.use_border = render.use_crop_to_border = True
            rows = []
            for y in range(5):
                render.border_min_y, render.border_max_y = y / 5, (y + 1) / 5
                row = []
                for x in range(5):
                    render.border_min_x, render.border_max_x = x / 5, (x + 1) / 5
                    row.append(h.render()["Combined"])
                rows.insert(0, np.concatenate(row, 1))
        np.testing.assert_array_equal(np.concatenate(rows), whole)

    # ---- Both eyes ----------------------------------------------------------------------------------------------

    def test_both_eyes_are_cycles(self):
        self.scene.render.use_multiview = True
        stereo = self.scene.camera.data.stereo
        stereo.interocular_distance, stereo.convergence_distance = 0.6, 4
        self.scene.camera.data.shift_x = 0.05
        for mode in ("OFFAXIS", "PARALLEL", "TOE"):
            for pivot in ("LEFT", "CENTER"):
                with self.subTest(mode=mode, pivot=pivot):
                    stereo.convergence_mode, stereo.pivot = mode, pivot
                    ours, theirs = h.both(64, 16)
                    for eye in ("left", "right"):
                        a, b = (h.blocks(image[eye][..., :3], 5) for image in (ours, theirs))
                        self.assertLess(np.abs(a - b).mean(), 0.01)
                        self.assertLess(np.abs(a - b).max(), 0.06)
                    self.assertGreater(np.abs(ours["left"] - ours["right"]).max(), 0.2)

    def test_views_of_cameras_by_suffix(self):
        render = self.scene.render
        render.use_multiview, render.views_format = True, "MULTIVIEW"
        main = self.scene.camera
        main.name = "Camera_left"
        other = h.link(bpy.data.objects.new("Camera_right", main.data))
        other.location, other.rotation_euler = (0.5, -2, 4), (0.3, 0.1, 0.2)
        render.views["left"].camera_suffix, render.views["right"].camera_suffix = "_left", "_right"
        ours, theirs = h.both(64, 16)
        for eye in ("left", "right"):
            a, b = (h.blocks(image[eye][..., :3], 5) for image in (ours, theirs))
            self.assertLess(np.abs(a - b).max(), 0.06)
        self.assertGreater(np.abs(ours["left"] - ours["right"]).max(), 0.2)

    # ---- Mist and the compositor --------------------------------------------------------------------------------

    def test_mist_is_cycles_in_perspective_and_orthographic(self):
        self.layer.use_pass_mist = True
        mist, camera = self.scene.world.mist_settings, self.scene.camera.data
        for kind, falloff, start, depth in (("PERSP", "QUADRATIC", 1, 9), ("PERSP", "LINEAR", 4.5, 1.5),
                                            ("PERSP", "INVERSE_QUADRATIC", 0, 20), ("ORTHO", "LINEAR", 2, 6)):
            with self.subTest(kind=kind, falloff=falloff):
                camera.type, camera.ortho_scale = kind, 8
                mist.falloff, mist.start, mist.depth = falloff, start, depth
                ours, theirs = (image["Mist"][..., 0] for image in h.both(64, 1))
                # Ours is the middle's of a pixel, which differs at outlines.
                self.assertLess(np.median(np.abs(ours - theirs)), 0.004)
                self.assertLess(np.abs(ours - theirs).mean(), 0.015)
                self.assertGreater(np.ptp(theirs), 0.1)

    def compositor(self, *names, layer=None):
        self.scene.use_nodes = True
        tree = self.scene.node_tree
        tree.nodes.clear()
        layers, out = tree.nodes.new("CompositorNodeRLayers"), tree.nodes.new("CompositorNodeComposite")
        layers.layer = layer or self.layer.name
        source = layers.outputs["Image"]
        for name in names:
            mix = tree.nodes.new("CompositorNodeMixRGB")
            mix.inputs[2].default_value = (1, 1, 1, 1)
            tree.links.new(layers.outputs[name], mix.inputs[0])
            tree.links.new(source, mix.inputs[1])
            source = mix.outputs[0]
        tree.links.new(source, out.inputs[0])
        return tree

    def render(self):
        with h.quiet():
            h.set_lumicut("exhaustive", vpls=50, max_depth=0)
            return h.render()

    def test_passes_that_a_compositor_needs_and_that_are_not_there_are_an_error_by_name(self):
        self.layer.use_pass_mist = self.layer.cycles.pass_debug_sample_count = True
        # 3.4 has sockets of passes that nobody chose, which 4.3 has not.
        unasked = ("AO",) if h.VERSION < (4, 0, 0) else ()
        with h.quiet():
            h.set_cycles(1)  # whose passes the node has
        tree = self.compositor("Mist", *unasked, "Debug Sample Count")
        with self.assertRaisesRegex(RuntimeError, f"not rendered: {', '.join((*unasked, 'Debug Sample Count'))}"):
            self.render()
        self.scene.render.use_compositing = False
        self.render()
        self.assertTrue(any(note == "Passes left out: Debug Sample Count" for note in h.last_notes()), h.last_notes())
        self.scene.render.use_compositing = True
        # What leads nowhere is not in use, and a pass that is chosen is there.
        tree.links.remove(next(n for n in tree.nodes if n.type == "COMPOSITE").inputs[0].links[0])
        self.render()
        self.compositor("Mist")
        self.render()

    def test_denoising_data_are_there_for_compositors(self):
        self.layer.cycles.denoising_store_passes = True
        ours = self.render()
        np.testing.assert_array_equal(ours["Noisy Image"], ours["Combined"])
        with h.quiet():
            h.set_cycles(16)
            theirs = h.render()
        for name in ("Denoising Normal", "Denoising Albedo", "Denoising Depth"):
            with self.subTest(name=name):
                difference = np.abs(ours[name] - theirs[name])
                self.assertLess(np.median(difference), 0.01)  # one sample here, the mean of a pixel's there
                self.assertLess(difference.mean(), 0.05)


class Denoising(unittest.TestCase):
    def setUp(self):
        self.scene = ball_in_the_sun(60, 40)
        self.layer = self.scene.view_layers[0]
        self.layer.lumicut.use_pass_denoising = True
        self.layer.lumicut.use_pass_error = True

    def rendered(self, **options):
        with h.quiet():
            h.set_lumicut("path_tracer", passes=8, **options)
            self.scene.lumicut.path_tracer.samples = 1
            return h.render()

    def test_it_takes_away_noise_and_can_be_turned_off(self):
        plain, denoised = self.rendered(), self.rendered(denoise=True)
        with h.quiet():
            self.scene.lumicut.path_tracer.samples = 256
            truth = h.render()

        def wrong(image):
            return np.sqrt(((image["Combined"] - truth["Combined"])[..., :3] ** 2).mean())
        self.assertLess(wrong(denoised), 0.75 * wrong(plain))  # edges keep theirs, and the picture is small
        np.testing.assert_array_equal(plain["Noisy Image"], denoised["Noisy Image"])
        self.assertTrue((denoised["Lumicut Error"] != plain["Lumicut Error"]).any())
        # A single pass tells nothing.
        with h.quiet():
            h.set_lumicut("path_tracer", denoise=True)
            image = h.render()
        np.testing.assert_array_equal(image["Noisy Image"], image["Combined"])

    def test_one_button_wires_the_compositors_node(self):
        self.layer.lumicut.use_pass_denoising = False
        h.set_lumicut("path_tracer", passes=2)
        for _ in range(2):  # once is enough, and twice no harm
            self.assertEqual(bpy.ops.lumicut.wire_denoiser(), {"FINISHED"})
        nodes = [n for n in self.scene.node_tree.nodes if n.type == "DENOISE"]
        self.assertEqual(len(nodes), 1)
        wired = {socket.name: socket.links[0].from_socket.name for socket in nodes[0].inputs if socket.links}
        self.assertEqual(wired, {"Image": "Noisy Image", "Normal": "Denoising Normal", "Albedo": "Denoising Albedo"})
        self.assertIn("COMPOSITE", [link.to_node.type for link in nodes[0].outputs["Image"].links])
        with h.quiet():
            h.render()  # no pass is missing


class Backdrops(unittest.TestCase):
    """Worlds that the camera sees otherwise than what they light with."""

    def setUp(self):
        self.scene = h.new_scene(40, 30)
        self.scene.camera.rotation_euler, self.scene.camera.location = (1.2, 0.1, 0.3), (1.5, -5, 2)
        h.add_sphere(1, material=h.diffuse())
        h.add_sphere(0.7, (2, 1, 0), self.mirror())
        tree = self.scene.world.node_tree
        self.links, self.nodes = tree.links, tree.nodes
        self.background = next(n for n in self.nodes if n.type == "BACKGROUND")
        self.output = next(n for n in self.nodes if n.type == "OUTPUT_WORLD")
        self.ray = self.nodes.new("ShaderNodeLightPath").outputs["Is Camera Ray"]

    @staticmethod
    def mirror():
        m = h.material("Mirror")
        h.shader(m, "ShaderNodeBsdfGlossy", Roughness=0.0)
        return m

    def image(self):
        """An environment that is smooth and different on all sides."""
        image = bpy.data.images.new("around", 64, 32, float_buffer=True)
        x, y = np.meshgrid(np.arange(64) / 64 * 2 * np.pi, np.arange(32) / 31)
        pixels = np.stack([0.5 + 0.4 * np.cos(x), 0.5 + 0.4 * np.sin(x), y, np.ones_like(x)], -1)
        image.pixels.foreach_set(pixels.astype(np.float32).ravel())
        texture = self.nodes.new("ShaderNodeTexEnvironment")
        texture.image = image
        mapping, coordinates = self.nodes.new("ShaderNodeMapping"), self.nodes.new("ShaderNodeTexCoord")
        mapping.inputs["Rotation"].default_value = (0.2, 0.4, 0.8)
        self.links.new(coordinates.outputs["Generated"], mapping.inputs[0])
        self.links.new(mapping.outputs[0], texture.inputs[0])
        return texture

    def compare(self):
        ours, theirs = h.both(256, 36, bounces=1, vpls=4000)  # a bounce for the mirror
        a, b = (h.blocks(image["Combined"], 5) for image in (ours, theirs))
        self.assertLess(np.abs(a - b).mean(), 0.01)
        self.assertLess(np.abs(a - b).max(), 0.02)
        return h.last_notes()

    def test_a_shader_for_the_camera_and_one_for_light(self):
        other, mix = self.nodes.new("ShaderNodeBackground"), self.nodes.new("ShaderNodeMixShader")
        other.inputs["Color"].default_value = (0.9, 0.6, 0.3, 1)
        self.background.inputs["Color"].default_value = (0.2, 0.4, 0.9, 1)
        self.links.new(self.ray, mix.inputs[0])
        self.links.new(self.background.outputs[0], mix.inputs[1])
        self.links.new(other.outputs[0], mix.inputs[2])
        self.links.new(mix.outputs[0], self.output.inputs["Surface"])
        self.assertEqual(self.compare(), [])
        self.scene.render.film_transparent = True
        self.compare()

    def test_an_image_for_the_camera_through_all_kinds_of_lenses(self):
        mix = self.nodes.new("ShaderNodeMixRGB")
        mix.inputs[1].default_value = (0.3, 0.5, 0.4, 1)
        self.links.new(self.ray, mix.inputs[0])
        self.links.new(self.image().outputs[0], mix.inputs[2])
        self.links.new(mix.outputs[0], self.background.inputs["Color"])
        camera = self.scene.camera.data
        for values in ({"lens": 20}, {"lens": 30, "shift_x": 0.2, "shift_y": -0.1}, {"type": "ORTHO", "ortho_scale": 6}):
            with self.subTest(values=values):
                for name, value in values.items():
                    setattr(camera, name, value)
                self.assertEqual(self.compare(), [])

    def test_light_by_an_image_before_a_plain_colour(self):
        mix = self.nodes.new("ShaderNodeMixRGB")
        mix.inputs[2].default_value = (0.9, 0.9, 0.9, 1)
        self.links.new(self.ray, mix.inputs[0])
        self.links.new(self.image().outputs[0], mix.inputs[1])
        self.links.new(mix.outputs[0], self.background.inputs["Color"])
        self.assertFalse(any("ray" in note for note in self.compare()))

    def test_what_cannot_be_read_for_the_camera_is_named(self):
        mix = self.nodes.new("ShaderNodeMixRGB")
        self.links.new(self.ray, mix.inputs[0])
        self.links.new(self.nodes.new("ShaderNodeTexNoise").outputs[1], mix.inputs[2])
        self.links.new(mix.outputs[0], self.background.inputs["Color"])
        with h.quiet():
            h.set_lumicut("exhaustive", vpls=50)
            h.render()
        self.assertIn("Worlds that differ by ray, taken as for lighting: World (Light Path)", h.last_notes())

    def test_a_world_hidden_from_the_camera_lights_before_black(self):
        self.background.inputs["Color"].default_value = (0.2, 0.4, 0.9, 1)
        self.scene.world.cycles_visibility.camera = False
        self.assertEqual(self.compare(), [])

    def test_a_world_hidden_from_kinds_of_rays(self):
        self.background.inputs["Color"].default_value = (0.2, 0.4, 0.9, 1)
        h.add_light("AREA", (0, 0, 4), 100)
        for ray in ("diffuse", "glossy"):
            with self.subTest(ray=ray):
                setattr(self.scene.world.cycles_visibility, ray, False)
                self.assertEqual(self.compare(), [])
                setattr(self.scene.world.cycles_visibility, ray, True)
