"""Every type of lamp gives what Cycles of the same Blender gives, in Blender's units: direct light on a diffuse plane."""
import math
import pathlib
import tempfile
import unittest

import bpy
import numpy as np

import helpers as h
from lumicut_blender import compat, sky

# Cycles at 512 samples and our 40,000 lights leave less than 0.3 % of noise in the mean of 1024 pixels.
MEAN = 0.01
# Blocks of 4x4 pixels have eight times the noise, and shadows' and spots' edges run through them.
BLOCK = 0.03


class LightUnits(unittest.TestCase):
    def setUp(self):
        h.new_scene()
        h.add_plane(material=h.diffuse((0.8, 0.5, 0.3)))

    def agree(self, samples=512, block=BLOCK, lights=40000, of_pixel=4):
        ours, cycles = self._both(samples, lights, of_pixel)
        a, b = h.radiance(ours), h.radiance(cycles)
        self.assertGreater(b.mean(), 0.0)
        ratio = a.mean((0, 1)) / b.mean((0, 1))
        np.testing.assert_allclose(ratio, 1, atol=MEAN, err_msg="mean against Cycles")
        a, b = h.blocks(a), h.blocks(b)
        worst = (np.abs(a - b) / np.maximum(b, 0.1 * b.max())).max()
        self.assertLess(worst, block, "blocks of 4x4 pixels against Cycles")

    @staticmethod
    def _both(samples, lights, of_pixel):
        with h.quiet():
            h.set_cycles(samples)
            # Cycles' own choice of a map for worlds of nodes takes longer than all else here.
            world = bpy.context.scene.world.cycles
            world.sampling_method, world.sample_map_resolution = "MANUAL", 256
            reference = h.render()
            h.set_lumicut("exhaustive", of_pixel, vpls=lights, max_depth=0, direct_share=1.0)
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

    def test_spots_whose_scale_stretches_the_cone(self):
        """In 3.4 it does not."""
        for scale, blend, radius in (((1, 1.6, 1), 0, 0), ((2, 1, 0.8), 0.6, 0), ((1, 1, 1.6), 0.3, 0.1), ((2, 2, 2), 0.3, 0.4)):
            with self.subTest(scale=scale, blend=blend, radius=radius):
                self.setUp()
                h.add_light("SPOT", (0, 0, 2.5), 200, (0.1, 0.2, 0.5), scale, spot_size=math.radians(60), spot_blend=blend,
                            shadow_soft_size=radius)
                self.agree(block=0.15 if blend == 0 else 0.1)  # edges, as above

    def test_area_lamps_that_a_parent_shears(self):
        """Edges across each other in the lamp's plane, then a plane that is not across the matrix's z axis either: disks are
        laid across it then, which only their own depth tells."""
        flat, tilted = ((2, 1, 1), (0, 0, 0.785)), ((1.5, 1, 1), (0.15, 0.3, 0.3))
        for shape, (scale, turn), spread, block in (("RECTANGLE", flat, math.pi, 0.05), ("RECTANGLE", tilted, math.pi, BLOCK),
                                                    ("ELLIPSE", flat, 2.2 if compat.SHEARED_FROM_CORNER else math.pi, BLOCK),
                                                    ("DISK", tilted, math.pi, 0.08)):
            with self.subTest(shape=shape, scale=scale):
                self.lamp_below(scale, turn, shape=shape, spread=spread).data.size_y = 0.6
                self.agree(samples=256, block=block, lights=10000)
                said = [note for note in h.last_notes() if "heared" in note]
                self.assertEqual(bool(said), shape == "RECTANGLE" or turn == tilted[1], said)

    def test_area_lamps_whose_parent_has_no_scale_along_one_axis(self):
        """Along the lamp's own: rectangles light both sides before 4.3, others nothing. Along another: the lamp's axis lies in
        its plane, and what is before it is lit from both of its sides."""
        for shape, spread, turned in (("SQUARE", math.pi, 1), ("SQUARE", math.pi, -1), ("SQUARE", 2.2, 1), ("DISK", math.pi, 1)):
            with self.subTest(shape=shape, spread=spread, turned=turned):
                self.lamp_below((1, turned, 0), (0, 0, 0), shape=shape, spread=spread)
                if compat.RECTANGLES_NEED_NO_AXIS and shape == "SQUARE" and spread == math.pi:
                    self.agree(samples=256, lights=4000, of_pixel=1)
                else:
                    self.assertEqual([h.radiance(image).max() for image in self._both(4, 100, 1)], [0, 0])
        self.lamp_below((1, 0, 1), (0.5, 0.3, 0), shape="SQUARE")
        self.agree(samples=256, block=0.3, lights=4000, of_pixel=1)  # a plane of points, seen from its edge
        self.assertTrue(any("Sheared rectangles" in note for note in h.last_notes()))

    def lamp_below(self, scale, turn, **values):
        self.setUp()
        parent = h.link(bpy.data.objects.new("Parent", None))
        parent.scale, parent.location = scale, (0.3, 0.2, 1.5)
        lamp = h.add_light("AREA", (0, 0, 0), 100, turn, size=1.0, **values)
        lamp.parent = parent
        return lamp

    def test_tilted_spot(self):
        h.add_light("SPOT", (1.5, 0, 2.5), 200, (0, math.radians(35), 0), spot_size=math.radians(90), spot_blend=0.3,
                    shadow_soft_size=0)
        self.agree()

    def test_lamps_of_a_radius_have_soft_edges_and_soft_shadows(self):
        h.add_mesh("Card", [(0, -1, 0.6), (0.6, -1, 0.6), (0.6, 1, 0.6), (0, 1, 0.6)], [(0, 1, 2, 3)], h.diffuse())
        for kind, radius in (("SPOT", 0.05), ("SPOT", 0.5), ("SPOT", 2.0), ("POINT", 1.0)):
            with self.subTest(kind=kind, radius=radius):
                for ob in [ob for ob in bpy.data.objects if ob.type == "LIGHT"]:
                    bpy.data.objects.remove(ob)
                lamp = h.add_light(kind, (0, 0, 2.5), 200, shadow_soft_size=radius)
                if kind == "SPOT":
                    lamp.data.spot_size, lamp.data.spot_blend = math.radians(70), 0.1
                a, b = (h.blocks(h.radiance(image)) for image in self._both(256, 4000, 4))
                np.testing.assert_allclose(a.mean((0, 1)) / b.mean((0, 1)), 1, atol=MEAN)
                self.assertLess(np.abs(a - b).max() / b.max(), BLOCK)

    def textured(self, kind, coordinate, texture, scale=2.0, **values):
        """A lamp whose colour is a texture by coordinates: (node, output)."""
        ob = h.add_light(kind, **{"location": (0.3, 0.2, 1.2), "energy": 100, "rotation": (0.3, -0.2, 0.7), **values})
        ob.data.use_nodes = True
        tree = ob.data.node_tree
        emission = next(n for n in tree.nodes if n.type == "EMISSION")
        node, source = tree.nodes.new(texture), tree.nodes.new(coordinate[0])
        if texture == "ShaderNodeTexImage":
            node.image = bpy.data.images.new("pattern", 8, 8, float_buffer=True)
            pixels = np.ones((8, 8, 4), np.float32)
            y, x = np.mgrid[:8, :8]
            pixels[..., 0], pixels[..., 1], pixels[..., 2] = (x < 4) * 2.0, (y < 3) * 1.0, 0.2
            node.image.pixels.foreach_set(pixels.ravel())
        else:
            node.inputs["Scale"].default_value = scale
        tree.links.new(source.outputs[coordinate[1]], node.inputs["Vector"])
        tree.links.new(node.outputs[0], emission.inputs["Color"])
        return ob

    def test_textures_over_area_lamps(self):
        for shape, coordinate, texture in (("RECTANGLE", ("ShaderNodeNewGeometry", "Parametric"), "ShaderNodeTexImage"),
                                           ("ELLIPSE", ("ShaderNodeTexCoord", "Generated"), "ShaderNodeTexChecker"),
                                           ("SQUARE", ("ShaderNodeTexCoord", "Normal"), "ShaderNodeTexNoise"),
                                           ("RECTANGLE", ("ShaderNodeTexCoord", "UV"), "ShaderNodeTexImage")):
            with self.subTest(shape=shape, coordinate=coordinate):
                self.setUp()
                self.textured("AREA", coordinate, texture, shape=shape, size=1.5, size_y=1.0)
                self.agree(block=0.05)
                self.assertEqual(h.last_notes(), [])

    def test_images_that_lamps_throw(self):
        for kind, coordinate, texture in (("POINT", ("ShaderNodeTexCoord", "Normal"), "ShaderNodeTexChecker"),
                                          ("SPOT", ("ShaderNodeTexCoord", "Normal"), "ShaderNodeTexImage"),
                                          ("SPOT", ("ShaderNodeNewGeometry", "Normal"), "ShaderNodeTexNoise"),
                                          ("POINT", ("ShaderNodeTexCoord", "Generated"), "ShaderNodeTexChecker")):
            with self.subTest(kind=kind, coordinate=coordinate):
                self.setUp()
                lamp = self.textured(kind, coordinate, texture, shadow_soft_size=0)
                if kind == "SPOT":
                    lamp.data.spot_size, lamp.data.spot_blend = 2.0, 0.3
                self.agree(block=0.12)  # sharp edges run through blocks
                self.assertEqual(h.last_notes(), [])

    def test_textures_of_suns_are_looked_up_the_way_the_light_goes(self):
        for rotation, angle, coordinate in (((0.5, 0.3, 0.2), 0.01, ("ShaderNodeTexCoord", "Object")),
                                            ((0.9, -0.3, 1), 0.2, ("ShaderNodeNewGeometry", "Position")),
                                            ((0.2, 0.7, 0), 0.05, ("ShaderNodeTexCoord", "Normal"))):
            with self.subTest(coordinate):
                self.setUp()
                lamp = self.textured("SUN", coordinate, "ShaderNodeTexNoise", angle=angle)
                lamp.rotation_euler, lamp.data.energy = rotation, 3
                self.agree(block=0.06)
                self.assertEqual(h.last_notes(), [])

    def test_falloff_by_the_distance_to_what_is_lit(self):
        for kind, output, smooth, radius in (("POINT", "Linear", 0, 0), ("POINT", "Constant", 0, 0.05), ("SPOT", "Constant", 1, 0),
                                             ("POINT", "Quadratic", 2, 0), ("SPOT", "Quadratic", 0, 0.3)):
            with self.subTest(kind=kind, output=output, smooth=smooth):
                self.setUp()
                h.add_mesh("Step", [(0, -3, 0.5), (3, -3, 0.5), (3, 3, 0.5), (0, 3, 0.5)], [(0, 1, 2, 3)], h.diffuse((0.3, 0.5, 0.8)))
                ob = h.add_light(kind, (-0.3, 0.2, 1.7), 50, (0.1, 0.2, 0), shadow_soft_size=radius)
                ob.data.use_nodes = True
                tree = ob.data.node_tree
                node = tree.nodes.new("ShaderNodeLightFalloff")
                node.inputs["Strength"].default_value, node.inputs["Smooth"].default_value = 1.5, smooth
                tree.links.new(node.outputs[output], next(n for n in tree.nodes if n.type == "EMISSION").inputs["Strength"])
                self.agree(block=0.15)  # the step's edge runs through blocks
                named = [note for note in h.last_notes() if note.startswith("Light Falloff, by how far")]
                self.assertEqual(len(named), 0 if output == "Quadratic" and not smooth else 1)

    def test_falloff_of_area_lamps_is_that_of_a_mean_distance(self):
        ob = h.add_light("AREA", (0, 0, 2), 50, size=0.5)
        ob.data.use_nodes = True
        tree = ob.data.node_tree
        node = tree.nodes.new("ShaderNodeLightFalloff")
        tree.links.new(node.outputs["Linear"], next(n for n in tree.nodes if n.type == "EMISSION").inputs["Strength"])
        ours, cycles = self._both(256, 4000, 4)
        a, b = (h.radiance(image)[8:24, 8:24].mean() for image in (ours, cycles))
        self.assertAlmostEqual(a / b, 1, delta=0.3)

    def test_coordinates_that_lamps_do_not_have_are_named(self):
        self.textured("AREA", ("ShaderNodeTexCoord", "Window"), "ShaderNodeTexNoise")
        with h.quiet():
            h.set_lumicut("exhaustive", vpls=50)
            h.render()
        self.assertTrue([note for note in h.last_notes() if "constant" in note and "AREA" in note], h.last_notes())

    def test_a_lamp_at_a_ceiling_lights_the_room_below(self):
        ceiling = h.add_plane(6, 2.5, h.diffuse())
        ceiling.visible_camera = False
        h.add_light("SPOT", (0, 0, 2.4), 200, spot_size=2.0, spot_blend=0.2, shadow_soft_size=0.5)
        with h.quiet():
            h.set_cycles(512, 3)
            theirs = h.radiance(h.render())
            h.set_lumicut("exhaustive", 4, passes=8, vpls=2000, max_depth=3)
            ours = h.radiance(h.render())
        np.testing.assert_allclose(ours.mean((0, 1)) / theirs.mean((0, 1)), 1, atol=0.02)

    def test_lamps_without_shadows(self):
        h.add_mesh("Card", [(0, -1, 0.6), (0.6, -1, 0.6), (0.6, 1, 0.6), (0, 1, 0.6)], [(0, 1, 2, 3)], h.diffuse())
        for kind, size in (("POINT", {"shadow_soft_size": 0.2}), ("SUN", {"angle": 0.1}), ("AREA", {"size": 0.5})):
            with self.subTest(kind=kind):
                lamp = h.add_light(kind, (0, 0, 2.5), 5 if kind == "SUN" else 200, **size)
                owner = lamp.data.cycles if hasattr(lamp.data.cycles, "cast_shadow") else lamp.data
                setattr(owner, "cast_shadow" if owner is not lamp.data else "use_shadow", False)
                self.agree(128, 0.05, 4000)
                bpy.data.objects.remove(lamp)

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

    def ies_lamp(self, kind="POINT", lobed=True, **values):
        """A lamp with a measured lobe that has no symmetry, and its IES node."""
        ob = h.add_light(kind, energy=100, shadow_soft_size=0, **values)
        ob.data.use_nodes = True
        tree = ob.data.node_tree
        node = tree.nodes.new("ShaderNodeTexIES")
        emission = next(n for n in tree.nodes if n.type == "EMISSION")
        tree.links.new(node.outputs[0], emission.inputs["Strength"])
        vertical, horizontal = range(0, 91, 10), range(0, 360 if lobed else 1, 45)
        rows = [" ".join(f"{900 * math.cos(math.radians(v)) * (1 + 0.4 * math.sin(math.radians(3 * v + h_)) * (v > 0)):.3f}"
                         for v in vertical) for h_ in horizontal]
        text = "\n".join(["IESNA:LM-63-1995", "[TEST] lobe", "TILT=NONE", f"1 1000 0.5 {len(vertical)} {len(horizontal)} 1 2 0 0 0",
                          "1.1 0.9 60", " ".join(map(str, vertical)), " ".join(map(str, horizontal)), *rows]) + "\n"
        return ob, node, text

    def test_ies_files_of_points_are_turned_and_scaled_as_cycles_does(self):
        for location, rotation, scale in (((0, 0, 2), (0, 0, 0), (1, 1, 1)), ((1, -0.5, 2), (0.4, 0.6, 1.2), (1, 1, 1)),
                                          ((0.5, 0, 2), (0.1, 0.2, 0.7), (-1, 1, 1))):
            with self.subTest(rotation=rotation, scale=scale):
                self.setUp()
                _, node, text = self.ies_lamp(location=location, rotation=rotation, scale=scale)
                node.ies = bpy.data.texts.new("lobe")
                node.ies.write(text)
                self.agree(block=0.05)  # nothing comes from above 90 degrees: an edge runs through the tilted ones' blocks
                self.assertEqual(h.last_notes(), [])

    def test_an_ies_file_outside_is_read_and_nodes_multiply_and_turn_it(self):
        ob, node, text = self.ies_lamp(location=(0.3, 0, 2))
        tree = ob.data.node_tree
        coordinates, mapping, product = (tree.nodes.new(k) for k in ("ShaderNodeTexCoord", "ShaderNodeMapping", "ShaderNodeMath"))
        mapping.inputs["Rotation"].default_value = (0.3, -0.2, 1.0)
        tree.links.new(coordinates.outputs["Normal"], mapping.inputs["Vector"])
        tree.links.new(mapping.outputs[0], node.inputs["Vector"])
        node.inputs["Strength"].default_value = 0.7
        product.operation = "MULTIPLY"
        product.inputs[1].default_value = 1.5
        tree.links.new(node.outputs[0], product.inputs[0])
        tree.links.new(product.outputs[0], next(n for n in tree.nodes if n.type == "EMISSION").inputs["Strength"])
        with tempfile.TemporaryDirectory() as folder:
            node.mode, node.filepath = "EXTERNAL", folder + "/lobe.ies"
            pathlib.Path(node.filepath).write_text(text)
            self.agree(block=0.05)
        self.assertEqual(h.last_notes(), [])

    def test_ies_files_of_spots_are_cut_by_the_cone(self):
        for lobed, blend, turn in ((False, 0.6, 0.0), (True, 0.3, 0.5)):
            with self.subTest(lobed=lobed, blend=blend, turn=turn):
                self.setUp()
                ob, node, text = self.ies_lamp("SPOT", lobed, location=(0, 0, 2.5), spot_size=math.radians(80), spot_blend=blend)
                node.ies = bpy.data.texts.new("lobe")
                node.ies.write(text)
                if turn:
                    mapping = ob.data.node_tree.nodes.new("ShaderNodeMapping")
                    coordinates = ob.data.node_tree.nodes.new("ShaderNodeTexCoord")
                    mapping.inputs["Rotation"].default_value = (turn, 0, 0)
                    ob.data.node_tree.links.new(coordinates.outputs["Normal"], mapping.inputs["Vector"])
                    ob.data.node_tree.links.new(mapping.outputs[0], node.inputs["Vector"])
                self.agree(block=0.05)

    def test_ies_files_that_cannot_be_mapped_are_listed_by_name(self):
        _, node, _ = self.ies_lamp(location=(0, 0, 2))
        node.ies = bpy.data.texts.new("broken")
        node.ies.write("nothing of the kind")
        other, _, text = self.ies_lamp("SUN")
        with h.quiet():
            h.set_lumicut("exhaustive", vpls=100)
            image = h.radiance(h.render())
        notes = "\n".join(h.last_notes())
        self.assertRegex(notes, "Lamps whose IES file cannot be read left out: POINT: broken .*TILT")
        self.assertRegex(notes, "IES textures of lamps other than point and spot, taken as even: SUN")
        self.assertGreater(np.median(image), 0)  # the sun is there

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
                self.agree(lights=160000, of_pixel=1)  # no edge is in the picture

    def world_nodes(self, *kinds):
        tree = bpy.context.scene.world.node_tree
        return (tree.links, next(n for n in tree.nodes if n.type == "BACKGROUND"), *(tree.nodes.new(kind) for kind in kinds))

    def narrow_images(self):
        """A quarter as wide as users have them, to spare time."""
        self.addCleanup(setattr, sky, "WIDTH", sky.WIDTH)
        sky.WIDTH = 256

    def test_skies_of_all_models_are_cycles_own_with_the_sun_as_a_lamp(self):
        self.narrow_images()
        links, background, node = self.world_nodes("ShaderNodeTexSky")
        links.new(node.outputs[0], background.inputs["Color"])
        plane = bpy.data.objects["Plane"]
        kinds = [item.identifier for item in node.bl_rna.properties["sky_type"].enum_items]
        self.assertGreaterEqual(len(kinds), 3)
        for kind in kinds:
            # A board throws the sun's shadow: nothing of the sun may be left in the image, which knows no edge that fine.
            board = h.add_plane(0.8, 1.0, h.diffuse(), "Board")
            node.sky_type = kind
            node.sun_elevation, node.sun_rotation, node.sun_size = 0.6, 0.9, 0.05
            node.sun_direction = (0.5, 0.3, 0.6)
            node.sun_intensity, background.inputs["Strength"].default_value = 0.8, 0.1
            plane.rotation_euler = (0.2, 0, 0)
            with self.subTest(kind=kind):
                self.agree(samples=256, block=0.08, lights=40000)
                self.assertRegex("\n".join(h.last_notes()), "Worlds rendered by Cycles into an image of 256 x 128: World")
                self.assertEqual(h.last_stats()["scene"]["lamps"], 1 if "NISHITA" in kind or "SCATTERING" in kind else 0)
            bpy.data.objects.remove(board)

    def test_worlds_of_any_nodes_come_as_cycles_has_them_and_are_rendered_once(self):
        self.narrow_images()
        links, background, mix, other, noise, ramp, ray = self.world_nodes(
            "ShaderNodeMixShader", "ShaderNodeBackground", "ShaderNodeTexNoise", "ShaderNodeValToRGB", "ShaderNodeLightPath")
        noise.inputs["Scale"].default_value = 2
        ramp.color_ramp.elements[1].color = (1, 0.6, 0.2, 1)
        links.new(noise.outputs["Fac"], ramp.inputs[0])
        links.new(ramp.outputs["Color"], background.inputs["Color"])
        other.inputs["Color"].default_value = (0, 0, 9, 1)
        links.new(ray.outputs["Is Camera Ray"], mix.inputs[0])  # what the camera alone sees lights nothing
        links.new(background.outputs[0], mix.inputs[1])
        links.new(other.outputs[0], mix.inputs[2])
        output = next(n for n in bpy.context.scene.world.node_tree.nodes if n.type == "OUTPUT_WORLD")
        links.new(mix.outputs[0], output.inputs["Surface"])
        begun = []
        saved, sky.Process = sky.Process, lambda *words: (begun.append(words), saved(*words))[1]
        try:
            self.agree(block=0.05)
            self.agree(samples=64, block=0.1)
            self.assertEqual(len(begun), 1)
            ramp.color_ramp.elements[1].color = (0.2, 0.6, 1, 1)
            self.agree(block=0.05)
            self.assertEqual(len(begun), 2)
        finally:
            sky.Process = saved

    def test_a_world_that_cycles_cannot_render_is_listed_with_the_reason(self):
        links, background, noise = self.world_nodes("ShaderNodeTexNoise")
        links.new(noise.outputs["Color"], background.inputs["Color"])
        saved, sky.WIDTH = sky.WIDTH, 0
        try:
            with h.quiet():
                h.set_lumicut("exhaustive", vpls=100)
                h.render()
        finally:
            sky.WIDTH = saved
        notes = "\n".join(h.last_notes())
        self.assertRegex(notes, r"could not render into an image: World \(.*Error")
        self.assertIn("Nodes taken as a constant colour", notes)

    def test_a_lamp_among_others_keeps_its_share(self):
        h.add_light("POINT", (1, 1, 2), 60, shadow_soft_size=0)
        h.add_light("AREA", (-1, 0, 2), 80, shape="DISK", size=0.5)
        h.add_light("SUN", (0, 0, 3), 1.0, (0.4, 0, 0), angle=0.0)
        self.agree()
