"""Images as Blender shows them: alpha, factors, UDIM tiles, sequences, curves. Each beside Cycles, as what a plane emits
or reflects."""
import os
import tempfile
import unittest

import bpy
import numpy as np

import helpers as h

LINEAR = "Linear" if h.VERSION < (4, 0, 0) else "Linear Rec.709"


def image_of(name, texels, space="sRGB", as_float=False):
    """(h, w, 3 or 4) texels, top row first, as they are stored; packed."""
    height, width, channels = texels.shape
    image = bpy.data.images.new(name, width, height, alpha=True, float_buffer=as_float)
    image.colorspace_settings.name = space
    pixels = np.ones((height, width, 4), np.float32)
    pixels[..., :channels] = texels
    image.pixels.foreach_set(pixels[::-1].reshape(-1))
    image.update()
    return image


def halves(left, right, size=16):
    texels = np.empty((size, 2 * size, len(left)), np.float32)
    texels[:, :size], texels[:, size:] = left, right
    return texels


class Images(unittest.TestCase):
    def setUp(self):
        self.scene = h.new_scene(32, 16)
        self.scene.camera.data.type, self.scene.camera.data.ortho_scale = "ORTHO", 4
        h.set_world((1, 1, 1))

    def board(self, material, uvs=((0, 0), (1, 0), (1, 1), (0, 1))):
        plane = h.add_mesh("Board", [(-2, -1, 0), (2, -1, 0), (2, 1, 0), (-2, 1, 0)], [(0, 1, 2, 3)], material)
        plane.data.uv_layers.new(name="Map").data.foreach_set("uv", np.ravel(uvs))
        return plane

    def textured(self, image, shader="ShaderNodeEmission", socket="Color"):
        """(material, image node, shader node)"""
        m = h.material("Textured")
        node = h.shader(m, shader)
        texture = m.node_tree.nodes.new("ShaderNodeTexImage")
        texture.image = image
        m.node_tree.links.new(texture.outputs["Color"], node.inputs[socket])
        return m, texture, node

    def compare(self, tolerance=0.01, **settings):
        """Means of the left and of the right half agree; gives ours."""
        ours, theirs = h.both(samples=4, cycles=32, **settings)
        means = [[h.radiance(x)[2:-2, a:b].mean((0, 1)) for a, b in ((2, 14), (18, 30))] for x in (ours, theirs)]
        np.testing.assert_allclose(means[0], means[1], rtol=tolerance, atol=0.002)
        return means[0]

    def test_stored_colours_of_any_colour_space(self):
        names = ("Filmic sRGB", "Linear ACES", "XYZ") if h.VERSION < (4, 0, 0) else ("Filmic sRGB", "ACES2065-1", "Linear Rec.2020")
        for space in names:
            with self.subTest(space=space):
                self.board(self.textured(image_of(space, halves((0.6, 0.4, 0.2), (0.3, 0.5, 0.4)), space))[0])
                self.compare()
                self.assertEqual(h.last_notes(), [])
                bpy.data.objects.remove(bpy.data.objects["Board"])

    def test_alpha_that_is_not_linked_darkens_as_stored(self):
        m, texture, _ = self.textured(image_of("a", halves((.8, .6, .4, .25), (.8, .6, .4, 1))))
        self.board(m)
        left, right = self.compare()
        self.assertLess(left[0], 0.1 * right[0])  # 0.25 of the sRGB value, which is less of the light
        for mode in ("CHANNEL_PACKED", "NONE"):
            with self.subTest(mode=mode):
                texture.image.alpha_mode = mode
                left, right = self.compare()
                np.testing.assert_allclose(left, right, rtol=1e-3)

    def test_data_are_not_darkened_by_alpha(self):
        m, _, _ = self.textured(image_of("a", halves((.8, .6, .4, .25), (.8, .6, .4, 1)), "Non-Color"))
        self.board(m)
        left, right = self.compare()
        np.testing.assert_allclose(left, right, rtol=1e-3)

    def test_alpha_that_is_linked_leaves_colours_alone_and_floats_are_divided_by_it(self):
        for as_float in (False, True):
            with self.subTest(as_float=as_float):
                self.setUp()
                image = image_of("a", halves((.8, .6, .4, .25), (.8, .6, .4, 1)), LINEAR if as_float else "sRGB", as_float)
                m, texture, _ = self.textured(image)
                output = next(n for n in m.node_tree.nodes if n.type == "OUTPUT_MATERIAL")
                mix, dark = (m.node_tree.nodes.new("ShaderNode" + kind) for kind in ("MixShader", "Emission"))
                dark.inputs["Color"].default_value = (0, 0, 0, 1)
                m.node_tree.links.new(texture.outputs["Alpha"], mix.inputs[0])
                m.node_tree.links.new(dark.outputs[0], mix.inputs[1])
                m.node_tree.links.new(output.inputs["Surface"].links[0].from_socket, mix.inputs[2])
                m.node_tree.links.new(mix.outputs[0], output.inputs["Surface"])
                self.board(m)
                left, right = self.compare()
                np.testing.assert_allclose(left, right * (1 if as_float else 0.25), rtol=0.01)

    def test_a_factor_above_1_stays_until_it_has_met_the_texture(self):
        for value in (51 / 255, 102 / 255):
            with self.subTest(value=value):
                self.setUp()
                m, _, node = self.textured(image_of("g", np.full((4, 4, 3), value, np.float32), "Non-Color"),
                                           "ShaderNodeBsdfPrincipled", "Base Color")
                node.inputs["Roughness"].default_value = 0.8
                board = self.board(m)
                with h.quiet():
                    h.set_lumicut("exhaustive", vpls=2000, max_depth=0)
                    textured = h.radiance(h.render()).mean()
                    self.assertFalse(any("above 1" in note for note in h.last_notes()), h.last_notes())
                    constant = h.material("Constant")
                    h.shader(constant, "ShaderNodeBsdfPrincipled", Base_Color=(value, value, value, 1), Roughness=0.8)
                    board.data.materials[0] = constant
                    self.assertAlmostEqual(h.radiance(h.render()).mean() / textured, 1, delta=1e-4)

    def test_what_stays_above_1_in_a_whole_picture_is_named(self):
        m, texture, node = self.textured(image_of("g", np.full((4, 4, 3), 0.9, np.float32), "Non-Color"), "ShaderNodeBsdfDiffuse")
        scale = m.node_tree.nodes.new("ShaderNodeMixRGB")
        scale.blend_type = "MULTIPLY"
        scale.inputs[0].default_value, scale.inputs[2].default_value = 1, (1.5, 1.5, 1.5, 1)
        m.node_tree.links.new(texture.outputs["Color"], scale.inputs[1])
        m.node_tree.links.new(scale.outputs[0], node.inputs["Color"])
        self.board(m)
        with h.quiet():
            h.set_lumicut("exhaustive", vpls=100)
            h.render()
        self.assertIn("Colours above 1 cut to 1: Textured", h.last_notes())

    def tiles(self, folder, packed):
        """An image of the tiles 1001, 1002 and 1012."""
        for number, colour in ((1001, (.9, .05, .05)), (1002, (.05, .9, .05)), (1012, (.1, .2, .9))):
            tile = image_of(str(number), np.full((8, 8, 3), colour, np.float32))
            tile.filepath_raw, tile.file_format = f"{folder}/t.{number}.png", "PNG"
            tile.save()
            bpy.data.images.remove(tile)
        image = bpy.data.images.load(f"{folder}/t.1001.png")
        image.source, image.filepath = "TILED", f"{folder}/t.<UDIM>.png"
        for number in (1002, 1012):
            if number not in {tile.number for tile in image.tiles}:
                image.tiles.new(number)
        if packed:
            image.pack()
            for name in os.listdir(folder):
                os.remove(f"{folder}/{name}")
        return image

    def test_udim_tiles_lie_where_cycles_lays_them(self):
        for packed in (False, True):
            for v in (0, 1):
                with self.subTest(packed=packed, row=v), tempfile.TemporaryDirectory() as folder:
                    self.setUp()
                    m, texture, _ = self.textured(self.tiles(folder, packed))
                    texture.interpolation = "Closest"
                    self.board(m, ((0, v), (2, v), (2, 1 + v), (0, 1 + v)))
                    left, right = self.compare()
                    self.assertGreater(abs(left - right).max(), 0.5)
                    self.assertFalse(any("first" in note for note in h.last_notes()), h.last_notes())
                    if v == 1:  # no tile 1011
                        np.testing.assert_allclose(left, (1, 0, 1), atol=1e-3)

    def test_sequences_show_the_picture_of_their_frame(self):
        with tempfile.TemporaryDirectory() as folder:
            for number in range(1, 6):
                picture = image_of(str(number), np.full((4, 8, 3), number / 6, np.float32))
                picture.filepath_raw, picture.file_format = f"{folder}/s_{number:04d}.png", "PNG"
                picture.save()
                bpy.data.images.remove(picture)
            image = bpy.data.images.load(f"{folder}/s_0001.png")
            image.source = "SEQUENCE"
            m, texture, _ = self.textured(image)
            user = texture.image_user
            self.board(m)
            shown = []
            for frame, start, offset, cyclic in ((2, 1, 0, False), (4, 2, 1, False), (9, 1, 0, False), (7, 1, 0, True)):
                user.frame_duration, user.frame_start, user.frame_offset, user.use_cyclic = 5, start, offset, cyclic
                user.use_auto_refresh = True
                self.scene.frame_set(frame)
                with self.subTest(frame=frame, start=start, offset=offset, cyclic=cyclic):
                    shown.append(self.compare()[0][0])
        self.assertEqual([round(6 * (1.055 * v ** (1 / 2.4) - 0.055)) for v in shown], [2, 4, 5, 2])

    def test_curves_bend_images_and_constants_as_in_cycles(self):
        x = np.linspace(0.05, 0.95, 32)
        texels = np.stack(np.broadcast_arrays(x[None], x[::-1][None], np.full((16, 32), 0.3)), -1)
        for kind, extend in (("RGBCurve", "EXTRAPOLATED"), ("RGBCurve", "HORIZONTAL"), ("FloatCurve", "EXTRAPOLATED")):
            with self.subTest(kind=kind, extend=extend):
                self.setUp()
                m, texture, node = self.textured(image_of("ramp", texels, "Non-Color", True))
                curves = m.node_tree.nodes.new("ShaderNode" + kind)
                curves.inputs[0].default_value = 0.8
                mapping = curves.mapping
                mapping.extend = extend
                mapping.curves[0].points.new(0.3, 0.6)
                mapping.curves[0].points[0].location = (0.1, 0.05)
                if kind == "RGBCurve":
                    mapping.curves[1].points.new(0.5, 0.2)
                    mapping.curves[3].points.new(0.6, 0.7)
                mapping.update()
                m.node_tree.links.new(texture.outputs["Color"], curves.inputs[1])
                m.node_tree.links.new(curves.outputs[0], node.inputs["Color"])
                self.board(m)
                # The picture's texels are bent here, its filtered colours there; ramps differ little.
                self.compare(0.02)
                self.assertEqual(h.last_notes(), [])


class Mappings(unittest.TestCase):
    """Two images of one material on different coordinates."""

    def setUp(self):
        self.scene = h.new_scene(40, 40)
        self.scene.camera.data.type, self.scene.camera.data.ortho_scale = "ORTHO", 2
        h.set_world((0.2, 0.4, 0.8))
        self.m = h.material("Two")
        x, y = np.meshgrid(np.arange(8) / 7, np.arange(8) / 7)
        self.ramp = image_of("ramp", np.stack([x, y, 0.2 + 0 * x], -1), "Non-Color")
        self.disk = image_of("disk", ((np.hypot(x - 0.4, y - 0.5) < 0.4) * 1.0)[..., None].repeat(3, 2), "Non-Color")
        h.add_plane(2, material=self.m).data.uv_layers.new(name="Map").data.foreach_set("uv", [0, 0, 1, 0, 1, 1, 0, 1])

    def node(self, kind, **links):
        node = self.m.node_tree.nodes.new("ShaderNode" + kind)
        for name, socket in links.items():
            self.m.node_tree.links.new(socket, node.inputs[name.replace("_", " ")])
        return node

    def texture(self, image, scale=(1, 1), turn=0.0, place=(0, 0)):
        mapping = self.node("Mapping", Vector=self.node("TexCoord").outputs["UV"])
        mapping.inputs["Scale"].default_value, mapping.inputs["Location"].default_value = (*scale, 1), (*place, 0)
        mapping.inputs["Rotation"].default_value = (0, 0, turn)
        texture = self.node("TexImage", Vector=mapping.outputs[0])
        texture.image = image
        return texture.outputs["Color"]

    def shown(self, *links):
        output = next(n for n in self.m.node_tree.nodes if n.type == "OUTPUT_MATERIAL")
        self.m.node_tree.links.new(links[0], output.inputs["Surface"])
        ours, theirs = h.both(64, 64)
        a, b = (h.blocks(h.radiance(image), 4) for image in (ours, theirs))
        # Texels are filtered before they meet here, and after that there.
        self.assertLess(np.abs(a - b).mean(), 0.02)
        self.assertGreater(np.corrcoef(a.ravel(), b.ravel())[0, 1], 0.98)
        return h.last_notes()

    def test_products_of_images_that_repeat_together_are_cycles(self):
        for scale, turn, place in (((3, 3), 0, (0, 0)), ((2.5, 1.5), 0, (0.3, 0.1)), ((2, 2), np.pi / 2, (0, 0.25)),
                                   ((0.5, 1), 0, (0, 0)), ((-2, 1), 0, (0, 0))):
            with self.subTest(scale=scale, turn=turn, place=place):
                self.setUp()
                product = self.node("MixRGB", Color1=self.texture(self.ramp), Color2=self.texture(self.disk, scale, turn, place))
                product.blend_type = "MULTIPLY"
                product.inputs[0].default_value = 1
                self.assertEqual(self.shown(self.node("Emission", Color=product.outputs[0]).outputs[0]), [])

    def test_slots_of_a_material_keep_their_own_tiling(self):
        colour = self.node("Emission", Color=self.texture(self.ramp, (1, 1)))
        mask = self.node("MixShader", Fac=self.texture(self.disk, (4, 2)))
        self.m.node_tree.links.new(self.node("BsdfTransparent").outputs[0], mask.inputs[1])
        self.m.node_tree.links.new(colour.outputs[0], mask.inputs[2])
        self.assertEqual(self.shown(mask.outputs[0]), [])

    def test_what_does_not_repeat_together_is_looked_up_by_programs(self):
        colour = self.node("Emission", Color=self.texture(self.ramp))
        mask = self.node("MixShader", Fac=self.texture(self.disk, (1.37, 2), 0.4))
        self.m.node_tree.links.new(self.node("BsdfTransparent").outputs[0], mask.inputs[1])
        self.m.node_tree.links.new(colour.outputs[0], mask.inputs[2])
        self.m.node_tree.links.new(mask.outputs[0], next(n for n in self.m.node_tree.nodes if n.type == "OUTPUT_MATERIAL").inputs[0])
        self.assertEqual(self.shown(mask.outputs[0]), [])
