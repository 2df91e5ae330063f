"""lumicut flythrough: many views of one preparation, saved and loaded."""
import json
import unittest

from cli import BAD_FILE, OK, SCENE, USAGE, Cli, lumicut, together

FRONT = {"eye": [1, 1, 6.6], "at": [1, 1, 0], "fov_y": 24}  # the scene's own
SIDE = {"eye": [0.4, 1.4, 6], "at": [1, 0.9, 0]}


class Flythrough(Cli):
    def path(self, *cameras, name="path.json", **more):
        file = self.folder / name
        file.write_text(json.dumps({"cameras": cameras, **more}))
        return file

    def fly(self, path, *arguments):
        return lumicut("flythrough", SCENE, path, "--size", "32x24", "--vpls", "300", *arguments)

    def same(self, a, b):
        result = lumicut("compare", a, b, "--json", "--no-flip")
        self.assert_ends(result, OK)
        return json.loads(result.stdout)["max_relative_error"] == 0

    def test_a_path_has_as_many_views_as_asked_for(self):
        stats = self.folder / "s.json"
        result = self.fly(self.path(FRONT, SIDE, frames=4), "-o", self.folder / "v.exr", "--png", self.folder / "v.png", "--stats", stats)
        self.assert_ends(result, OK)
        names = [f"v.{i:04}.{end}" for i in range(4) for end in ("exr", "png")]
        self.assertEqual(self.files(), sorted(names + ["path.json", "s.json"]))
        s = json.loads(stats.read_text())
        self.assertEqual(len(s["views"]), 4)
        self.assertTrue(all(v["prepare_reused"] for v in s["views"]), "prepared once")
        self.assertEqual((s["width"], s["height"], s["loaded"]), (32, 24, False))
        # Seconds a view and the share of the preparation add up.
        self.assertAlmostEqual(s["amortised_seconds_per_view"], s["seconds_per_view"] + s["prepare_seconds"] / 4, places=9)
        self.assertFalse(self.same(self.folder / "v.0000.exr", self.folder / "v.0003.exr"))
        # Without "frames" there is one view a camera, and the ends of a path are its cameras.
        self.assert_ends(self.fly(self.path(FRONT, SIDE), "-o", self.folder / "w.exr"), OK)
        self.assertEqual([n for n in self.files() if n.startswith("w.")], ["w.0000.exr", "w.0001.exr"])
        for a, b in (("v.0000", "w.0000"), ("v.0003", "w.0001")):
            self.assertTrue(self.same(self.folder / f"{a}.exr", self.folder / f"{b}.exr"))

    def test_a_view_is_the_image_that_render_makes(self):
        for integrator in ("wspd", "lightcuts"):
            self.assert_ends(self.fly(self.path(SIDE, FRONT), "-i", integrator, "-o", self.folder / "v.exr", "-q"), OK)
            self.assert_ends(lumicut("render", SCENE, "-i", integrator, "--size", "32x24", "--vpls", "300", "-o", self.folder / "r.exr"), OK)
            result = lumicut("compare", self.folder / "v.0001.exr", self.folder / "r.exr", "--json", "--no-flip")
            # Both cameras are the same up to rounding of their matrices, which may move a ray over an edge.
            self.assertLess(json.loads(result.stdout)["mean_relative_error"], 1e-3)

    def test_what_was_prepared_is_saved_and_used_again(self):
        state, stats = self.folder / "room.state", self.folder / "s.json"
        self.assert_ends(self.fly(self.path(SIDE), "--save-state", state, "-o", self.folder / "a.exr"), OK)
        result = self.fly(self.path(SIDE), "--load-state", state, "-o", self.folder / "b.exr", "--stats", stats)
        self.assert_ends(result, OK)
        self.assertIn("loaded", result.stdout)
        self.assertTrue(self.same(self.folder / "a.0000.exr", self.folder / "b.0000.exr"))
        s = json.loads(stats.read_text())
        self.assertTrue(s["loaded"] and s["views"][0]["prepare_reused"])

    def test_states_that_do_not_fit_are_refused(self):
        state, out = self.folder / "room.state", self.folder / "a.exr"
        path = self.path(FRONT)
        self.assert_ends(self.fly(path, "--save-state", state, "-q"), OK)
        whole = state.read_bytes()
        self.assert_ends(self.fly(path, "--load-state", state, "-p", "separation=0.5", "-o", out), BAD_FILE, "room.state")
        self.assert_ends(self.fly(path, "--load-state", self.folder / "none.state", "-o", out), BAD_FILE, "none.state")
        for damaged in (whole[:len(whole) // 2], whole[:-1], b"", whole[:100] + bytes([whole[100] ^ 255]) + whole[101:]):
            state.write_bytes(damaged)
            self.assert_ends(self.fly(path, "--load-state", state, "-o", out), BAD_FILE, "room.state")
        self.assert_ends(self.fly(path, "-i", "lightcuts", "--save-state", self.folder / "l.state", "-o", out), USAGE, "lightcuts", "no state")
        self.assertEqual(self.files(), ["path.json", "room.state"])

    def test_bad_cameras_are_named(self):
        out = ("-o", self.folder / "a.exr")
        wrong = [
            (([],), {}, "cameras[0]"),
            ((), {}, "no camera"),
            (({"eye": [0, 0, 1]},), {}, "cameras[0]", '"at"'),
            (({"eye": [0, 0, 1], "at": [0, 0, 1]},), {}, "cameras[0]", "same point"),
            (({"eye": [0, 3, 0], "at": [0, 0, 0]},), {}, "cameras[0]", "up"),
            (({**FRONT, "fov_y": 200},), {}, "cameras[0].fov_y", "200"),
            (({**FRONT, "fov": 20},), {}, "cameras[0]", '"fov"', "fov_y"),
            ((FRONT,), {"frames": 0}, "frames", "0"),
            ((FRONT,), {"speed": 2}, "speed"),
            ((FRONT, {"eye": [1, 1, 0], "at": [1, 1, 6.6]}), {"frames": 3}, "looks nowhere"),
        ]
        paths = [self.path(*cameras, name=f"{i}.json", **more) for i, (cameras, more, *_) in enumerate(wrong)]
        results = together([lambda path=path: self.fly(path, *out) for path in paths])
        for (cameras, more, *texts), path, result in zip(wrong, paths, results):
            with self.subTest(cameras=cameras, more=more):
                self.assert_ends(result, BAD_FILE, path.name, *texts)
            path.unlink()
        self.assert_ends(self.fly(self.folder / "none.json", *out), BAD_FILE, "none.json")
        self.assertEqual(self.files(), [])

    def test_wrong_command_lines_are_named(self):
        path, out = self.path(FRONT), ("-o", self.folder / "a.exr")
        self.assert_ends(lumicut("flythrough", SCENE), USAGE, "cameras")
        self.assert_ends(self.fly(path, "-i", "wsdp", *out), USAGE, "wsdp")
        self.assert_ends(self.fly(path, "-p", "separation=9", *out), USAGE, "9")
        self.assert_ends(self.fly(path, "--load-state", "a", "--save-state", "b", *out), USAGE, "--save-state")
        self.assert_ends(lumicut("flythrough", SCENE, path, "--size", "9", *out), USAGE, "--size")
        self.assert_ends(self.fly(path, "-o", self.folder / "no/a.exr"), BAD_FILE, "no/a.exr")
        self.assertEqual(self.files(), ["path.json"])


if __name__ == "__main__":
    unittest.main()
