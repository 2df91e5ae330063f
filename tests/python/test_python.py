"""The Python package, against formulas and loops, and the examples of docs/python.md."""
import math
import os
import pathlib
import re
import sys
import tempfile
import unittest
import unittest.mock

ROOT = pathlib.Path(os.environ.get("LUMICUT_SOURCE_DIR", pathlib.Path(__file__).resolve().parents[2]))
BUILD = pathlib.Path(os.environ.get("LUMICUT_BINARY_DIR", ROOT / "build/release"))
sys.path.insert(0, str(ROOT / "export_scripts"))
os.environ.setdefault("LUMICUT_LIBRARY", str(BUILD / "lib/liblumicut.so"))

import numpy as np  # noqa: E402

import lumicut  # noqa: E402

FLOOR = [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], [[0, 1, 2], [0, 2, 3]]


def room(device):
    """A floor and a wall under a lamp of some size."""
    scene = lumicut.Scene(device)
    scene.set_materials([lumicut.Material(diffuse=(0.7, 0.6, 0.5)), lumicut.Material(diffuse=(0.2, 0.3, 0.8))])
    scene.add_mesh(*FLOOR, material=0)
    scene.add_mesh([[-1, 1, 0], [1, 1, 0], [1, 1, 2], [-1, 1, 2]], FLOOR[1], material=1)
    scene.set_lights([lumicut.Light(type=lumicut.RECTANGLE, color=(1, 1, 1), value=20, position=(0, 0, 1.5), u=(0.5, 0, 0), v=(0, -0.5, 0))])
    scene.set_camera(lumicut.look_at((0, -4, 2), (0, 0, 0.5)))
    scene.commit()
    return scene


class Package(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.device = lumicut.Device(2)

    def test_a_point_light_shines_by_the_inverse_square_of_its_distance(self):
        scene = lumicut.Scene(self.device)
        scene.set_materials([lumicut.Material(diffuse=(0.5, 0.5, 0.5))])
        scene.add_mesh(*FLOOR)
        scene.set_camera(lumicut.look_at((0, -4, 2), (0, 0, 0)))
        scene.commit()
        method = lumicut.Integrator(self.device, "exhaustive").set("clamp_lights", 0)
        lamp = np.zeros(1, lumicut.VPL)
        lamp["kind"], lamp["position"], lamp["intensity"] = lumicut.VPL_OMNI, (0, 0, 2), (3, 2, 1)
        method.set_lights(lamp)
        method.prepare(scene)
        points = np.zeros(5, lumicut.POINT_TO_SHADE)
        points["position"][:, 0] = x = np.linspace(-0.9, 0.9, 5)
        points["normal"] = points["geometric_normal"] = points["to_viewer"] = (0, 0, 1)
        points["pixel"] = np.arange(5)
        square = x**2 + 4
        expected = 0.5 / math.pi / square * 2 / np.sqrt(square)
        np.testing.assert_allclose(method.shade(points), expected[:, None] * [3, 2, 1], rtol=1e-4)  # rays start off the surface

    def test_virtual_lights_go_out_and_come_in_and_render_the_same_image(self):
        scene = room(self.device)
        first = lumicut.Integrator(self.device, "lightcuts").set("vpls", 2000)
        image = lumicut.render(scene, first, 48, 36)
        lights, origins = first.lights()
        self.assertGreater(len(lights), 100)
        with tempfile.TemporaryDirectory() as folder:
            file = pathlib.Path(folder) / "lights.npz"
            np.savez(file, lights=lights, origins=origins, samples=origins.emitter_samples)
            with np.load(file) as saved:
                lights, origins = saved["lights"], saved["origins"].view(lumicut.library.Origins)
                origins.emitter_samples = int(saved["samples"])
        second = lumicut.Integrator(self.device, "lightcuts").set("vpls", 2000)
        second.set_lights(lights, origins)
        np.testing.assert_array_equal(lumicut.render(scene, second, 48, 36), image)

    def test_the_closest_hits_are_those_of_trying_every_triangle(self):
        random = np.random.default_rng(1)
        corners = random.uniform(-1, 1, (200, 1, 3)) + random.uniform(-0.2, 0.2, (200, 3, 3))
        origins, directions = random.uniform(-2, 2, (500, 3)), random.normal(size=(500, 3))
        accel = lumicut.Accel(self.device, corners.reshape(-1, 3), np.arange(600).reshape(-1, 3))
        self.assertEqual(accel.info().primitive_count, 200)
        distance, triangle, u, v, normal = accel.intersect(origins, directions)
        # Moeller and Trumbore, all rays with all triangles.
        a, e1, e2 = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        p = np.cross(directions[:, None], e2[None])
        det = (p * e1).sum(-1)
        s = origins[:, None] - a[None]
        bu = (s * p).sum(-1) / det
        q = np.cross(s, e1[None])
        bv, t = (directions[:, None] * q).sum(-1) / det, (e2 * q).sum(-1) / det
        t = np.where((bu >= 0) & (bv >= 0) & (bu + bv <= 1) & (t > 0), t, np.inf)
        best = t.argmin(1)
        hit = np.isfinite(t.min(1))
        self.assertGreater(hit.sum(), 20)
        # Doubles against singles: a ray through an edge may go either way.
        same = (distance < np.inf) == hit
        self.assertGreaterEqual(same.sum(), 499)
        both = same & hit & (triangle == best)
        self.assertGreaterEqual(both.sum(), hit.sum() - 1)
        np.testing.assert_allclose(distance[both], t.min(1)[both], rtol=1e-4)
        self.assertTrue((triangle[~hit & same] == lumicut.NO_ID).all())
        np.testing.assert_array_equal(accel.occluded(origins, directions)[same], hit[same])
        self.assertFalse(accel.occluded(origins[:1] + 100, directions[:1] * 0 + (1, 0, 0), 0, 1).any())

    def test_a_picture_has_the_channels_that_were_asked_for_and_is_the_same_twice(self):
        scene = room(self.device)
        images = [lumicut.render(scene, "lightcuts", 40, 30, channels=("radiance", "depth", "normal"), vpls=500, error=0.02) for _ in range(2)]
        self.assertEqual({n: i.shape for n, i in images[0].items()}, {"radiance": (30, 40, 3), "depth": (30, 40, 1), "normal": (30, 40, 3)})
        for name in images[0]:
            np.testing.assert_array_equal(images[0][name], images[1][name])
        self.assertGreater(images[0]["radiance"].mean(), 0.01)

    def test_a_preset_is_what_it_stands_for(self):
        scene, preset = room(self.device), lumicut.presets()["good"]
        image = lumicut.render(scene, width=16, height=12, preset="good", vpls=20)
        same = lumicut.render(scene, preset.integrator, 16, 12, preset.samples, passes=preset.passes, flags=preset.flags,
                              **(preset.parameters | {"vpls": 20}))
        np.testing.assert_array_equal(image, same)
        with self.assertRaisesRegex(ValueError, "best.*draft, good, final, reference"):
            lumicut.render(scene, preset="best")

    def test_progress_may_cancel(self):
        scene = room(self.device)
        told = []

        def stop(share, phase):
            told.append((share, phase))
            return False
        with self.assertRaises(lumicut.Cancelled):
            lumicut.render(scene, "exhaustive", 2000, 2000, vpls=2000000, progress=stop)
        self.assertTrue(told and 0 <= told[0][0] <= 1)

    def test_wrong_input_is_named(self):
        scene = room(self.device)
        for text, call in (("lightcutz", lambda: lumicut.render(scene, "lightcutz")),
                           ("colour", lambda: lumicut.render(scene, "lightcuts", 8, 8, vpls=10, colour=1)),
                           (r"shape \(3,\)", lambda: lumicut.Accel(self.device, *FLOOR).intersect([1, 2, 3], [0, 0, 1])),
                           ("1 for 2 lights", lambda: lumicut.Integrator(self.device, "lightcuts").set_lights(
                               np.zeros(2, lumicut.VPL), np.zeros(1, lumicut.VPL_ORIGIN))),
                           (r"textures\[0\].*float16", lambda: scene.set_textures([(np.zeros((2, 2, 4), np.float16), 0)])),
                           (r"textures\[0\].*shape \(2, 2\)", lambda: scene.set_textures([(np.zeros((2, 2), np.float32), 0)])),
                           ("indices: whole", lambda: scene.add_mesh(FLOOR[0], [[2**32, 1, 2]])),
                           ("indices: whole", lambda: scene.add_mesh(FLOOR[0], [[np.nan, 1, 2]])),
                           ("indices: whole", lambda: lumicut.Accel(self.device, FLOOR[0], [[-1, 1, 2]])),
                           ("materials: whole", lambda: scene.add_mesh(*FLOOR, materials=[2**32, 0])),
                           (r"positions: has the shape \(3, 4\)", lambda: scene.add_mesh(np.zeros((3, 4)), [[0, 1, 2]])),
                           (r"transforms: has the shape \(4, 3, 1\)", lambda: scene.add_mesh(*FLOOR, transforms=np.zeros((4, 3, 1)))),
                           ("positions: are of the type complex", lambda: scene.add_mesh(np.zeros((3, 3), complex), [[0, 1, 2]]))):
            with self.assertRaisesRegex(lumicut.Error, text):
                call()
        with self.assertRaisesRegex(ValueError, "no direction"):
            lumicut.look_at((0, 0, 0), (0, 0, 0))
        with self.assertRaisesRegex(lumicut.LibraryMissing, "/nowhere"):
            with unittest.mock.patch.object(lumicut.library, "candidates", lambda *_: [("preference", "/nowhere/liblumicut.so.1")]):
                lumicut.load("/nowhere")


class Examples(unittest.TestCase):
    def test_those_of_the_page_run(self):
        blocks = re.findall(r"^```python\n(.*?)^```", (ROOT / "docs/python.md").read_text(), re.M | re.S)
        self.assertGreater(len(blocks), 3)
        before = os.getcwd()
        with tempfile.TemporaryDirectory() as folder:
            os.chdir(folder)
            try:
                names = {}
                for block in blocks:  # each goes on from those before it
                    exec(compile(block, "docs/python.md", "exec"), names)
            finally:
                os.chdir(before)


if __name__ == "__main__":
    unittest.main(verbosity=2)
