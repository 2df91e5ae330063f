"""Passes that are made of hits, or of frames beside the frame, against Cycles: indices, texture coordinates, Cryptomatte,
emission, environment."""
import json
import struct
import tempfile
import unittest

import bpy
import numpy as np

import helpers as h
from lumicut_blender import hit_passes


def metadata(path):
    """Text attributes of an EXR by name."""
    raw, at, found = open(path, "rb").read(), 8, {}
    while raw[at]:
        name, kind = raw[at:].split(b"\0", 2)[:2]
        at += len(name) + len(kind) + 2
        size, = struct.unpack_from("<i", raw, at)
        if kind == b"string":
            found[name.decode()] = raw[at + 4:at + 4 + size].decode()
        at += 4 + size
    return found


class Hashes(unittest.TestCase):
    def test_names_hash_as_the_published_examples_do(self):
        # Of the hash's reference implementation; and Cryptomatte's own specification: "hello" becomes 6.0705627102400005616e-17.
        self.assertEqual([hit_passes.murmur3(text) for text in (b"", b"hello", b"The quick brown fox jumps over the lazy dog")],
                         [0, 0x248bfa47, 0x2e4ff723])
        self.assertEqual(hit_passes.as_floats([hit_passes.id_of("hello")])[0], np.float32(6.0705627102400005616e-17))

    def test_no_name_becomes_an_infinity(self):
        floats = hit_passes.as_floats([hit_passes.id_of(f"name {i}") for i in range(20000)])
        self.assertTrue(np.isfinite(floats).all())
        self.assertGreater(np.abs(floats).min(), 1e-38)


class BesideCycles(unittest.TestCase):
    def setUp(self):
        self.scene = h.new_scene(32, 24)
        h.set_world((0.2, 0.3, 0.4))
        self.layer = self.scene.view_layers[0]
        grey, red = h.diffuse(name="grey"), h.diffuse((0.8, 0.2, 0.1), "red")
        grey.pass_index, red.pass_index = 5, 3
        self.ground = h.add_plane(3, material=grey, name="Ground")
        uvs = self.ground.data.uv_layers.new(name="UVMap")
        for i, at in enumerate([(0, 0), (1, 0), (1, 2), (0, 1)]):
            uvs.data[i].uv = at
        self.ball = h.add_sphere(0.5, (0.3, 0.2, 0.8), red, name="Ball")
        self.ball.pass_index = 7
        empty = h.link(bpy.data.objects.new("Parent", None))
        self.ball.parent = empty
        h.add_light("SUN", energy=2)

    def render_both(self, samples=256):
        with h.quiet():
            h.set_cycles(samples)
            theirs = h.render()
            self.path = tempfile.mkdtemp() + "/image.exr"
            h.set_lumicut("exhaustive", 4, passes=16, vpls=50)
            ours = h.render()
        self.assertFalse([note for note in h.last_notes() if note.startswith("Passes left out")])
        return ours, theirs

    def test_indices_of_objects_and_materials(self):
        self.layer.use_pass_object_index = self.layer.use_pass_material_index = True
        ours, theirs = self.render_both(16)
        for name in ("IndexOB", "IndexMA"):
            self.assertEqual(sorted(np.unique(ours[name])), sorted(np.unique(theirs[name])))
            self.assertLess((ours[name] != theirs[name]).mean(), 0.06, "but for outlines, of one sample in both")

    def test_texture_coordinates(self):
        self.layer.use_pass_uv = True
        ours, theirs = self.render_both()
        np.testing.assert_allclose(h.blocks(ours["UV"]), h.blocks(theirs["UV"]), atol=0.02)

    def test_emission_and_environment(self):
        self.layer.use_pass_emit = self.layer.use_pass_environment = True
        self.ball.data.materials[0] = h.emission(3, (1, 0.5, 0.2))
        for exposure in (1, 2):
            self.scene.cycles.film_exposure = exposure
            ours, theirs = self.render_both()
            for name in ("Emit", "Env"):
                np.testing.assert_allclose(h.blocks(ours[name]), h.blocks(theirs[name]), atol=0.05 * exposure, err_msg=name)
                np.testing.assert_allclose(ours[name].mean(), theirs[name].mean(), rtol=0.01)

    def test_light_of_kinds_of_lobes_sums_to_the_image(self):
        """Each pass agrees with Cycles', and all together, with emission and world, are Combined."""
        lobes = [(lobe, what) for lobe in ("diffuse", "glossy", "transmission") for what in ("direct", "indirect", "color")]
        for lobe, what in lobes:
            setattr(self.layer, f"use_pass_{lobe}_{what}", True)
        self.layer.use_pass_emit = self.layer.use_pass_environment = True
        m = h.material("mixed")
        mix, gloss, tree = h.shader(m, "ShaderNodeMixShader"), m.node_tree.nodes.new("ShaderNodeBsdfGlossy"), m.node_tree
        diffuse = tree.nodes.new("ShaderNodeBsdfDiffuse")
        mix.inputs[0].default_value, gloss.inputs["Roughness"].default_value, gloss.distribution = 0.4, 0.5, "GGX"
        diffuse.inputs["Color"].default_value, gloss.inputs["Color"].default_value = (0.7, 0.3, 0.2, 1), (0.6, 0.7, 0.8, 1)
        tree.links.new(diffuse.outputs[0], mix.inputs[1])
        tree.links.new(gloss.outputs[0], mix.inputs[2])
        self.ground.data.materials[0] = m
        h.add_sphere(0.4, (-0.6, 0.4, 0.5), h.emission(2), name="Lamp")
        mirror = h.material("mirror")
        h.shader(mirror, "ShaderNodeBsdfGlossy", Roughness=0.0, Color=(0.9, 0.8, 0.7, 1))
        h.add_sphere(0.3, (-0.5, -0.5, 0.4), mirror, name="Mirror")
        with h.quiet():
            h.set_cycles(512, 8)
            theirs = h.render()
            h.set_lumicut("exhaustive", 4, passes=16, vpls=2000, compensate=True)
            ours = h.render()
        self.assertEqual(h.last_notes(), [])
        for image in (ours, theirs):
            whole = image["Emit"] + image["Env"]
            for short in ("Diff", "Gloss", "Trans"):
                whole = whole + image[short + "Col"] * (image[short + "Dir"] + image[short + "Ind"])
            np.testing.assert_allclose(h.blocks(whole), h.blocks(image["Combined"][..., :3]), atol=0.02)
        for name in ("DiffDir", "DiffInd", "DiffCol", "GlossDir", "GlossInd", "GlossCol"):
            a, b = h.blocks(ours[name]), h.blocks(theirs[name])
            np.testing.assert_allclose(a.mean((0, 1)), b.mean((0, 1)), rtol=0.04, atol=2e-3, err_msg=name)

    def test_ambient_occlusion(self):
        self.layer.use_pass_ambient_occlusion = True
        for distance in (10, 0.4):
            self.scene.world.light_settings.distance = distance
            ours, theirs = self.render_both()
            np.testing.assert_allclose(h.blocks(ours["AO"]), h.blocks(theirs["AO"]), atol=0.04)
            np.testing.assert_allclose(ours["AO"].mean(), theirs["AO"].mean(), rtol=0.01)

    def move(self, ob, frames, **places):
        """Keys of properties, a value each frame."""
        for name, values in places.items():
            for frame, value in zip(frames, values):
                setattr(ob, name, value)
                ob.keyframe_insert(name, frame=frame)

    def compare_vectors(self, most=0.03):
        self.layer.use_pass_vector = True
        self.scene.frame_set(1)
        ours, theirs = self.render_both()
        a, b = ours["Vector"], theirs["Vector"]
        self.assertGreater(np.abs(b).max(), 1)
        inside = np.abs(b - np.roll(b, 1, 0)).max(-1) + np.abs(b - np.roll(b, 1, 1)).max(-1) < 0.8
        self.assertGreater(inside.mean(), 0.4)
        # In pixels; outlines are of other samples.
        self.assertLess(np.quantile(np.abs(a - b)[inside].max(-1), 0.95), most)
        np.testing.assert_allclose(h.blocks(a), h.blocks(b), atol=0.25)
        self.assertEqual(self.scene.frame_current, 1)

    def test_vectors_of_objects_that_move(self):
        self.move(self.ball, (0, 1, 2), location=[(0, 0.3, 0.8), (0.3, 0.2, 0.8), (0.6, 0.3, 0.9)])
        self.ground.scale.x = -1  # a mirrored mesh that stands alone
        self.move(self.ground, (0, 1, 2), rotation_euler=[(0, 0, -0.1), (0, 0, 0), (0, 0, 0.2)])
        self.compare_vectors()

    def test_vectors_of_a_camera_that_moves_and_of_vertices(self):
        camera = self.scene.camera
        self.move(camera, (1, 2), location=[camera.location.copy(), camera.location + camera.location * 0.1])
        self.move(camera, (1, 2), rotation_euler=[(0.1, 0, 0), (0.15, 0.02, 0.1)])
        self.ground.shape_key_add(name="Basis")
        key = self.ground.shape_key_add(name="bent")
        for point in key.data:
            point.co.z += 0.5 * point.co.x
        self.move(key, (0, 1, 2), value=[0, 0.5, 1])
        # Cycles of 4.3 gives vectors to what stands still before an orthographic camera that does.
        for kind in ("PERSP", "ORTHO") if h.VERSION < (4, 0, 0) else ("PERSP",):
            with self.subTest(kind):
                camera.data.type, camera.data.ortho_scale = kind, 4
                self.compare_vectors()

    def test_vectors_of_instances_follow_their_own(self):
        parent = h.add_mesh("Parent", [(-0.8, -0.5, 0.5), (0.8, -0.5, 0.5), (0, 0.8, 0.5)], [(0, 1, 2)])
        parent.instance_type, parent.show_instancer_for_render = "VERTS", False
        self.ball.parent, self.ball.location = parent, (0, 0, 0)
        self.ball.scale = (0.6,) * 3
        self.move(parent, (0, 1, 2), rotation_euler=[(0, 0, -0.3), (0, 0, 0), (0, 0, 0.4)])
        self.compare_vectors()

    def test_vectors_of_a_panorama(self):
        camera = self.scene.camera
        camera.data.type = "PANO"
        own = camera.data if hasattr(camera.data, "panorama_type") else camera.data.cycles
        own.panorama_type = "EQUIRECTANGULAR"
        camera.location, camera.rotation_euler = (0.3, -0.4, 1.5), (1.5, 0, 0.2)
        self.move(camera, (1, 2), location=[camera.location.copy(), (0.4, -0.2, 1.6)])
        self.compare_vectors()

    @unittest.skipIf(h.VERSION >= (4, 0, 0), "Cycles has no such pass")
    def test_shadows_of_lamps(self):
        self.layer.use_pass_shadow = True
        self.scene.render.resolution_x, self.scene.render.resolution_y = 96, 72
        h.add_light("POINT", (1, 1, 2), 100, shadow_soft_size=0.2)
        h.add_light("SPOT", (-1, 0.5, 3), 300, shadow_soft_size=0.1, spot_size=0.7)
        sky = h.add_light("AREA", (0, 0, 4), 200, size=0.5)
        sky.data.color = (1, 0.5, 0.2)
        h.add_sphere(0.2, (-0.6, 0.4, 0.5), h.emission(2), name="Lamp")
        ours, theirs = self.render_both(512)
        a, b = h.blocks(ours["Shadow"], 12), h.blocks(theirs["Shadow"], 12)
        self.assertLess(b.min(), 0.5)
        np.testing.assert_allclose(a, b, atol=0.08)  # where a part of a lamp's cone reaches, that part counts alone
        np.testing.assert_allclose(a.mean(), b.mean(), rtol=0.02)

    def test_volumes_are_black_where_a_compositor_adds_them_up(self):
        for what in ("direct", "indirect"):
            setattr(self.layer.cycles, f"use_pass_volume_{what}", True)
        ours, theirs = self.render_both(16)
        for name in ("VolumeDir", "VolumeInd"):
            self.assertEqual(ours[name].shape, theirs[name].shape)
            self.assertEqual(np.abs(ours[name]).max(), 0)

    def test_texture_coordinates_of_mirrored_meshes(self):
        self.layer.use_pass_uv = True
        self.ground.scale.x = -1
        ours, theirs = self.render_both()
        np.testing.assert_allclose(h.blocks(ours["UV"]), h.blocks(theirs["UV"]), atol=0.02)

    def test_aovs_of_constants_images_and_programs(self):
        for name, kind in (("tint", "COLOR"), ("worn", "VALUE")):
            aov = self.layer.aovs.add()
            aov.name, aov.type = name, kind
        tree = self.ball.data.materials[0].node_tree
        for name, feeds in (("tint", "Color"), ("worn", "Value")):
            node = tree.nodes.new("ShaderNodeOutputAOV")
            setattr(node, "aov_name" if hasattr(node, "aov_name") else "name", name)
            if feeds == "Color":
                node.inputs["Color"].default_value = (0.2, 0.5, 2.0, 1)
            else:
                checks = tree.nodes.new("ShaderNodeTexChecker")
                tree.links.new(checks.outputs["Fac"], node.inputs["Value"])
        ours, theirs = self.render_both()
        for name in ("tint", "worn"):
            np.testing.assert_allclose(ours[name].mean((0, 1)), theirs[name].mean((0, 1)), atol=0.005, err_msg=name)
            self.assertLess(np.abs(h.blocks(ours[name]) - h.blocks(theirs[name])).max(), 0.12, name)

    def test_cryptomatte(self):
        twin = h.link(bpy.data.objects.new("Twin", self.ball.data))
        twin.location = (-0.6, -0.3, 0.7)
        self.layer.pass_cryptomatte_depth = 4
        for kind in hit_passes.CRYPTOMATTES:
            setattr(self.layer, "use_pass_cryptomatte_" + kind, True)
        ours, theirs = self.render_both()
        names = {"CryptoObject": ("Ground", "Ball", "Twin"), "CryptoMaterial": ("grey", "red"), "CryptoAsset": ("Ground", "Parent", "Twin")}
        for kind, of in names.items():
            for name in of:
                wanted = hit_passes.as_floats([hit_passes.id_of(name)])[0]
                cover = []
                for image in (ours, theirs):
                    total = 0
                    for level in range(2):
                        # The reader sorts channels, whose names are in lower case here, as it finds them: a b g r.
                        a, b, g, r = np.moveaxis(image[f"{kind}{level:02d}"], -1, 0)
                        total = total + np.where(r == wanted, g, 0) + np.where(b == wanted, a, 0)
                    cover.append(total)
                np.testing.assert_allclose(cover[0], cover[1], atol=0.12, err_msg=f"{kind} {name}")  # of 64 samples
                self.assertAlmostEqual(cover[0].mean(), cover[1].mean(), delta=0.005)
                self.assertGreater(cover[0].max(), 0.99)

    def test_the_image_says_which_name_is_which_number(self):
        self.layer.use_pass_cryptomatte_object = True
        image = self.scene.render.image_settings
        said = []
        for engine in (h.set_cycles, h.set_lumicut):
            with h.quiet(), tempfile.TemporaryDirectory() as folder:
                engine()
                image.file_format, image.color_depth, image.exr_codec = "OPEN_EXR_MULTILAYER", "32", "NONE"
                self.scene.render.filepath = folder + "/image.exr"
                bpy.ops.render.render(write_still=True)
                said.append({k: v for k, v in metadata(folder + "/image.exr").items() if k.startswith("cryptomatte/")})
        theirs, ours = said
        self.assertEqual(set(theirs), set(ours))
        for key, text in theirs.items():
            if key.endswith("/manifest"):
                self.assertEqual(json.loads(text), json.loads(ours[key]))
            else:
                self.assertEqual(text, ours[key])

    def test_the_compositor_takes_them(self):
        self.layer.use_pass_object_index = True
        with h.quiet():
            h.set_lumicut("exhaustive", 4, vpls=50)  # whose passes the node has
        self.scene.use_nodes = True
        tree = self.scene.node_tree
        tree.nodes.clear()
        source, mask, out = (tree.nodes.new(kind) for kind in ("CompositorNodeRLayers", "CompositorNodeIDMask", "CompositorNodeComposite"))
        mask.index = 7
        tree.links.new(source.outputs["IndexOB"], mask.inputs[0])
        tree.links.new(mask.outputs[0], out.inputs[0])
        with h.quiet():
            ours = h.render()
        self.assertGreater(ours["IndexOB"].max(), 6)
