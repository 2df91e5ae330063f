"""The exported folder renders to what F12 renders; files appear whole or not at all."""
import json
import math
import os
import pathlib
import subprocess
import tempfile
import unittest

import bpy
import numpy as np

import helpers as h
from lumicut_blender import export, scene_data

COMMAND = pathlib.Path(os.environ["LUMICUT_BINARY_DIR"]) / "bin/lumicut"


def run(*words):
    return subprocess.run([str(w) for w in words], capture_output=True, text=True)


def picture(name, width, height, alpha=False, floats=False):
    image = bpy.data.images.new(name, width, height, alpha=alpha, float_buffer=floats)
    u, v = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
    pixels = np.ones((height, width, 4), np.float32)
    pixels[..., 0], pixels[..., 1], pixels[..., 2] = 0.2 + 0.8 * u, 0.5 + 0.5 * np.sin(9 * v), 0.3
    if alpha:
        pixels[..., 3] = (u - 0.5) ** 2 + (v - 0.5) ** 2 < 0.2
    image.pixels.foreach_set(pixels.reshape(-1))
    image.pack()
    return image


def textured(name, image, alpha=False, nearest=False, clamp=False):
    m = h.material(name)
    node = h.shader(m, "ShaderNodeBsdfPrincipled")
    node.inputs["Roughness"].default_value = 0.4
    texture = m.node_tree.nodes.new("ShaderNodeTexImage")
    texture.image = image
    texture.interpolation = "Closest" if nearest else "Linear"
    texture.extension = "EXTEND" if clamp else "REPEAT"
    m.node_tree.links.new(texture.outputs["Color"], node.inputs["Base Color"])
    if alpha:
        m.node_tree.links.new(texture.outputs["Alpha"], node.inputs["Alpha"])
    return m


def worn(name, wear, heights):
    """Of textured roughness and metal, bumps and a clear coat."""
    m = h.material(name)
    node = h.shader(m, "ShaderNodeBsdfPrincipled")
    node.inputs[next(k for k in ("Clearcoat", "Coat Weight") if k in node.inputs)].default_value = 0.7
    node.inputs[next(k for k in ("Clearcoat Roughness", "Coat Roughness") if k in node.inputs)].default_value = 0.3
    bump = m.node_tree.nodes.new("ShaderNodeBump")
    bump.inputs["Distance"].default_value = 0.05
    m.node_tree.links.new(bump.outputs[0], node.inputs["Normal"])
    for image, inputs in ((wear, (node.inputs["Roughness"], node.inputs["Metallic"])), (heights, (bump.inputs["Height"],))):
        texture = m.node_tree.nodes.new("ShaderNodeTexImage")
        texture.image = image
        for socket in inputs:
            m.node_tree.links.new(texture.outputs["Color"], socket)
    return m


def rich_scene():
    """Everything that a scene file can carry."""
    scene = h.new_scene(80, 60)
    scene.camera.location, scene.camera.rotation_euler = (0, -5, 3), (math.radians(60), 0, 0)
    scene.camera.data.shift_x = 0.05
    floor = h.add_plane(6, 0, textured("Floor/ö tiles", picture("tiles", 16, 16)), "Floor/ö")
    floor.data.uv_layers.new(name="Map").data.foreach_set("uv", [0, 0, 2, 0, 2, 2, 0, 2])
    board = h.add_plane(1.5, 0, textured("Board", picture("board", 8, 8, alpha=True), True, True, True), "Board")
    board.data.uv_layers.new(name="Map").data.foreach_set("uv", [-0.1, 0, 1.1, 0, 1.1, 1, -0.1, 1])
    board.location, board.rotation_euler = (-1.2, 0.5, 0.8), (math.radians(80), 0, 0.3)
    plate = h.add_plane(0.8, 0, worn("Plate", picture("wear", 16, 16, floats=True), picture("heights", 16, 16)), "Plate")
    plate.data.uv_layers.new(name="Map").data.foreach_set("uv", [0, 0, 1, 0, 1, 1, 0, 1])
    plate.location, plate.rotation_euler = (0.2, -1.4, 0.5), (math.radians(50), 0, -0.2)
    ball = h.add_sphere(0.4, (0.8, 0, 0.4), h.diffuse((0.7, 0.2, 0.1), "red"), 16)
    ball.data.polygons.foreach_set("use_smooth", [p.index % 3 > 0 for p in ball.data.polygons])
    for i in range(3):
        copy = h.link(bpy.data.objects.new(f"copy {i}", ball.data))
        copy.location, copy.scale = (1.7 - 0.4 * i, 1 + i, 0.3), (0.5, 0.8, -0.5)
    cube = h.add_mesh("Cube", [(x, y, z) for z in (-1, 1) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))],
                      [(3, 2, 1, 0), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)], h.diffuse())
    cube.scale, cube.location, cube.rotation_euler = (-0.3, 0.2, 0.3), (-0.5, -1, 0.3), (0.1, 0.2, 0.3)
    subdivision = cube.modifiers.new("subdivision", "SUBSURF")
    subdivision.levels, subdivision.render_levels = 0, 2
    lamp = h.add_plane(0.3, 2.5, h.emission(15, (1, 0.7, 0.4)), "Lamp")
    lamp.location.x = -2
    h.add_light("POINT", (1, 1, 2), 40, shadow_soft_size=0.1)
    h.add_light("SPOT", (-1, -1, 3), 80, (0.3, 0.1, 0), spot_size=1.0, spot_blend=0.4, shadow_soft_size=0)
    h.add_light("SUN", (0, 0, 3), 0.7, (0.6, 0.4, 0), angle=0.05)
    for kind, place, turn in (("POINT", (1.5, -1, 2), (0.3, 0.4, 0.5)), ("SPOT", (-1.5, 1, 2.5), (0, 0, 0.8))):
        measured = h.add_light(kind, place, 60, turn, shadow_soft_size=0)
        measured.data.use_nodes = True
        tree = measured.data.node_tree
        node = tree.nodes.new("ShaderNodeTexIES")
        node.ies = bpy.data.texts.new("lobe/ö")
        node.ies.write("IESNA:LM-63-1995\nTILT=NONE\n1 1000 1 3 4 1 2 0 0 0 1 1 0\n0 30 80\n0 90 180 270\n"
                       "900 500 0\n900 700 0\n900 300 0\n900 100 0\n")
        tree.links.new(node.outputs[0], next(n for n in tree.nodes if n.type == "EMISSION").inputs["Strength"])
    h.add_light("AREA", (2, 0, 2.5), 50, (0, 0.5, 0), shape="ELLIPSE", size=0.6, size_y=0.3, spread=2.0)
    tree = scene.world.node_tree
    background = next(n for n in tree.nodes if n.type == "BACKGROUND")
    sky, mapping, coordinates = (tree.nodes.new(k) for k in ("ShaderNodeTexEnvironment", "ShaderNodeMapping", "ShaderNodeTexCoord"))
    sky.image = picture("sky", 32, 16, floats=True)
    mapping.inputs["Rotation"].default_value = (0.3, 0.1, 1.0)
    tree.links.new(coordinates.outputs["Generated"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs[0], sky.inputs["Vector"])
    tree.links.new(sky.outputs[0], background.inputs["Color"])
    background.inputs["Strength"].default_value = 0.3
    return scene


class Export(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.path = pathlib.Path(self.folder.name) / "scene.json"

    def f12(self):
        scene = bpy.context.scene
        image = scene.render.image_settings
        if hasattr(image, "media_type"):
            image.media_type = "IMAGE"
        image.file_format, image.color_depth, image.color_mode, image.exr_codec = "OPEN_EXR", "32", "RGB", "ZIP"
        scene.render.filepath = self.folder.name + "/f12.exr"
        with h.quiet():
            bpy.ops.render.render(write_still=True)
        return self.folder.name + "/f12.exr"

    def export(self):
        with h.quiet():
            self.assertEqual(bpy.ops.export_scene.lumicut(filepath=str(self.path)), {"FINISHED"})

    def compare(self, most=0.002):
        """F12 beside the command on the exported files, same integrator and parameters."""
        self.export()
        ours = self.f12()
        words = export.command_of(self.path, bpy.context.scene.lumicut)
        done = run(COMMAND, *words[1:])
        self.assertEqual(done.returncode, 0, done.stderr)
        done = run(COMMAND, "compare", self.path.with_suffix(".exr"), ours, "--json", "--no-flip")
        self.assertEqual(done.returncode, 0, done.stderr)
        result = json.loads(done.stdout)
        self.assertGreater(result["reference_mean"], 0.01)
        self.assertEqual(result["bad_pixels"], 0)
        self.assertLess(abs(result["bias"]), most)
        # Vertices that the OBJ's reader merges and normals that it makes unit again change last digits: pixels at
        # edges of shadows may fall to the other side.
        self.assertLess(result["rmse"], 5 * most, result)
        return result

    @unittest.skipUnless(COMMAND.exists(), f"{COMMAND} is not built")
    def test_the_command_renders_what_f12_renders(self):
        rich_scene()
        h.set_lumicut("exhaustive", 2, vpls=3000)
        self.compare()

    @unittest.skipUnless(COMMAND.exists(), f"{COMMAND} is not built")
    def test_it_does_so_for_another_integrator_an_orthographic_camera_and_a_transparent_film(self):
        scene = rich_scene()
        scene.camera.data = bpy.data.cameras.new("ortho")
        scene.camera.data.type, scene.camera.data.ortho_scale = "ORTHO", 5
        scene.render.film_transparent = True
        h.set_lumicut("lightcuts", 1, vpls=3000, error=0.01)
        self.compare()

    @unittest.skipUnless(COMMAND.exists(), f"{COMMAND} is not built")
    def test_shadow_catchers_are_what_f12_shows(self):
        scene = h.new_scene(40, 40)
        h.set_world((0.5, 0.4, 0.3))
        ground = h.add_plane(8, material=h.diffuse((0.8, 0.6, 0.3)))
        ground.is_shadow_catcher = True
        h.add_sphere(0.6, (0.2, 0.1, 1), h.diffuse((0.8, 0.2, 0.1)), segments=48)
        h.add_light("SUN", energy=4, rotation=(0.6, 0.5, 0), angle=0.1).is_shadow_catcher = True
        h.add_light("POINT", location=(-2, -1, 2), energy=100).is_shadow_catcher = False  # new lamps are
        h.set_lumicut("exhaustive", 2, passes=2, vpls=500)
        for transparent in (True, False):
            with self.subTest(transparent=transparent):
                scene.render.film_transparent = transparent
                self.compare()
                self.assertFalse([note for note in h.last_notes() if "catcher" in note])
                described = json.loads(self.path.read_text())
                self.assertEqual([light.get("shadow_catcher", False) for light in described["lights"]], [True, False])

    def test_modifiers_have_render_levels_and_the_engine_comes_back(self):
        scene = rich_scene()
        scene.render.engine = "CYCLES"
        self.export()
        self.assertEqual(scene.render.engine, "CYCLES")
        text = next(self.path.parent.glob("scene_files/meshes/Cube.obj")).read_text()
        self.assertEqual(text.count("\nf "), 6 * 16 * 2)

    def test_exporting_again_replaces_and_leaves_nothing_beside(self):
        rich_scene()
        self.export()
        listing = lambda: sorted(p.relative_to(self.path.parent) for p in self.path.parent.rglob("*"))  # noqa: E731
        before = listing()
        self.export()
        # Until the scene file is replaced both sets of files exist, so the second lies in a folder of its own.
        self.assertEqual(sorted(p.name for p in before if p.name != "scene_files"),
                         sorted(p.name for p in listing() if p.name not in ("scene_files", "2")))
        self.export()
        self.assertEqual(before, listing())
        self.assertFalse([p for p in before if str(p).startswith(".")])

    def test_what_cannot_be_written_is_an_error_that_names_the_folder(self):
        rich_scene()
        with self.assertRaisesRegex(RuntimeError, "nowhere"), h.quiet():
            bpy.ops.export_scene.lumicut(filepath=self.folder.name + "/nowhere/scene.json")
        for ob in [ob for ob in bpy.context.scene.objects if ob.type == "MESH"]:
            bpy.data.objects.remove(ob)
        with self.assertRaisesRegex(RuntimeError, "no mesh"), h.quiet():
            bpy.ops.export_scene.lumicut(filepath=str(self.path))
        self.assertEqual(list(self.path.parent.iterdir()), [])


class Formats(unittest.TestCase):
    def test_png_and_exr_read_back_in_blender(self):
        rng = np.random.default_rng(1)
        with tempfile.TemporaryDirectory() as folder:
            byte = rng.integers(0, 256, (5, 7, 3), np.uint8)
            pathlib.Path(folder, "a.png").write_bytes(export.png(byte))
            image = bpy.data.images.load(folder + "/a.png")
            read = np.array(image.pixels, np.float32).reshape(5, 7, 4)[::-1, :, :3]
            np.testing.assert_array_equal(np.rint(read * 255), byte)
            floats = rng.random((5, 7, 3), np.float32) * 3
            pathlib.Path(folder, "a.exr").write_bytes(export.exr(floats))
            image = bpy.data.images.load(folder + "/a.exr")
            read = np.array(image.pixels, np.float32).reshape(5, 7, 4)[::-1, :, :3]
            np.testing.assert_array_equal(read, floats)

    def test_numbers_of_an_obj_read_back_bit_for_bit(self):
        rng = np.random.default_rng(2)
        positions = (rng.standard_normal((100, 3)) * 10.0 ** rng.integers(-5, 5, (100, 3))).astype(np.float32)
        mesh = scene_data.Mesh("m", positions, np.arange(99).reshape(-1, 3))
        lines = [l.split()[1:] for l in export.obj(mesh, "m.mtl", ["a"]).splitlines() if l.startswith("v ")]
        np.testing.assert_array_equal(np.array(lines, np.float32), positions)

    def test_names_of_files_are_plain_and_differ(self):
        used = set()
        names = [export.plain_name(n, used, ".obj") for n in ("a/b", "a b", "A_b", "ö", "", "..", "x" * 300)]
        self.assertEqual(len({n.lower() for n in names}), len(names))
        for name in names:
            self.assertRegex(name, r"^[A-Za-z0-9_-]+\.obj$")


