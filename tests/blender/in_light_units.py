"""Every type of lamp gives what Cycles of the same Blender gives, in Blender's units: direct light on a diffuse plane."""
import math
import unittest

import bpy
import numpy as np

import helpers as h

# Cycles at 512 samples and our 40,000 lights leave less than 0.3 % of noise in the mean of 1024 pixels.
MEAN = 0.01
# Blocks of 4x4 pixels have eight times the noise, and shadows' and spots' edges run through them.
BLOCK = 0.03


class LightUnits(unittest.TestCase):
    def setUp(self):
        h.new_scene()
        h.add_plane(material=h.diffuse((0.8, 0.5, 0.3)))

    def agree(self, samples=512, block=BLOCK, lights=40000):
        ours, cycles = self._both(samples, lights)
        a, b = h.radiance(ours), h.radiance(cycles)
        self.assertGreater(b.mean(), 0.0)
        ratio = a.mean((0, 1)) / b.mean((0, 1))
        np.testing.assert_allclose(ratio, 1, atol=MEAN, err_msg="mean against Cycles")
        a, b = h.blocks(a), h.blocks(b)
        worst = (np.abs(a - b) / np.maximum(b, 0.1 * b.max())).max()
        self.assertLess(worst, block, "blocks of 4x4 pixels against Cycles")

    @staticmethod
    def _both(samples, lights):
        with h.quiet():
            h.set_cycles(samples)
            reference = h.render()
            h.set_lumicut("exhaustive", 4, vpls=lights, max_depth=0, clamp_relative=0.001, direct_share=1.0)
            ours = h.render()
        return ours, reference

    def test_point(self):
        h.add_light("POINT", (0.5, 0.3, 2), 100, shadow_soft_size=0)
        self.agree()

    def test_point_with_radius(self):
        h.add_light("POINT", (0, 0, 2), 100, shadow_soft_size=0.2)
        self.agree()

    def test_coloured_light_with_strength_in_its_nodes(self):
        ob = h.add_light("POINT", (0, 0, 2), 50, shadow_soft_size=0, color=(1, 0.5, 0.25))
        ob.data.use_nodes = True
        node = next(n for n in ob.data.node_tree.nodes if n.type == "EMISSION")
        node.inputs["Strength"].default_value = 2.5
        self.agree()

    def test_spot_sharp_and_soft(self):
        for blend, size in ((0.0, 150), (0.5, 80), (1.0, 120)):
            with self.subTest(blend=blend, size=size):
                self.setUp()
                h.add_light("SPOT", (0, 0, 2.5), 200, spot_size=math.radians(size), spot_blend=blend, shadow_soft_size=0)
                self.agree(block=0.06 if blend == 0 else BLOCK)

    def test_tilted_spot(self):
        h.add_light("SPOT", (1.5, 0, 2.5), 200, (0, math.radians(35), 0), spot_size=math.radians(90), spot_blend=0.3,
                    shadow_soft_size=0)
        self.agree()

    def test_sun(self):
        for angle in (0.0, 10.0):
            with self.subTest(angle=angle):
                self.setUp()
                h.add_light("SUN", (0, 0, 2), 3.0, (0.6, 0.2, 0), angle=math.radians(angle))
                self.agree()

    def test_areas_of_all_shapes(self):
        for shape, size_y in (("SQUARE", 1), ("RECTANGLE", 0.4), ("DISK", 1), ("ELLIPSE", 0.5)):
            with self.subTest(shape=shape):
                self.setUp()
                h.add_light("AREA", (0, 0, 2), 100, shape=shape, size=1.0, size_y=size_y)
                self.agree()

    def test_scaled_and_tilted_area(self):
        h.add_light("AREA", (0.6, 0, 2), 100, (0.3, 0.5, 0.2), (2, 0.5, 1), shape="RECTANGLE", size=0.8, size_y=0.6)
        self.agree()

    def test_spread(self):
        for degrees in (120, 60, 20):
            with self.subTest(degrees=degrees):
                self.setUp()
                h.add_light("AREA", (0, 0, 2), 100, shape="SQUARE", size=0.5, spread=math.radians(degrees))
                self.agree(block=0.05)  # the profile falls to 0 inside of the blocks

    def test_spread_of_a_disk(self):
        h.add_light("AREA", (0, 0, 2), 100, shape="DISK", size=0.7, spread=math.radians(90))
        self.agree()

    def test_emissive_mesh(self):
        lamp = h.add_plane(0.8, 2.0, h.emission(20, (1, 0.8, 0.6)), "Lamp")
        lamp.visible_camera = True
        lamp.location = (2.2, 0, 0)  # out of the picture: lamps' own pixels are not the point
        self.agree()

    def test_world_colour(self):
        h.set_world((0.4, 0.6, 0.9), 1.5)
        self.agree()

    def test_world_image_turned(self):
        image = bpy.data.images.new("sky", 64, 32, float_buffer=True)
        u, v = np.meshgrid((np.arange(64) + 0.5) / 64, (np.arange(32) + 0.5) / 32)
        pixels = np.ones((32, 64, 4), np.float32)
        pixels[..., 0] = 1 + np.sin(2 * np.pi * u)
        pixels[..., 1] = 2 * v
        pixels[..., 2] = 0.3 + 2 * (u > 0.5)
        image.pixels.foreach_set(pixels.reshape(-1))
        image.pack()
        tree = bpy.context.scene.world.node_tree
        background = next(n for n in tree.nodes if n.type == "BACKGROUND")
        texture, mapping, coordinates = (tree.nodes.new(k) for k in
                                         ("ShaderNodeTexEnvironment", "ShaderNodeMapping", "ShaderNodeTexCoord"))
        texture.image = image
        tree.links.new(coordinates.outputs["Generated"], mapping.inputs["Vector"])
        tree.links.new(mapping.outputs[0], texture.inputs["Vector"])
        tree.links.new(texture.outputs[0], background.inputs["Color"])
        background.inputs["Strength"].default_value = 1.3
        plane = bpy.data.objects["Plane"]
        for turn, tilt in (((0, 0, 1.0), (0, 0, 0)), ((0.7, 0.4, 0.3), (0.5, 0, 0))):
            with self.subTest(turn=turn):
                mapping.inputs["Rotation"].default_value = turn
                plane.rotation_euler = tilt
                # All pixels share one random set of directions: 160,000 leave 0.4 % of noise in the mean.
                self.agree(lights=160000)

    def test_a_lamp_among_others_keeps_its_share(self):
        h.add_light("POINT", (1, 1, 2), 60, shadow_soft_size=0)
        h.add_light("AREA", (-1, 0, 2), 80, shape="DISK", size=0.5)
        h.add_light("SUN", (0, 0, 3), 1.0, (0.4, 0, 0), angle=0.0)
        self.agree()
