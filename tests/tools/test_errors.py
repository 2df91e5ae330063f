"""`lumicut errors`: what an image's error is made of."""
import json
import math
import unittest

from cli import BAD_FILE, OK, SCENE, USAGE, Cli, lumicut, read_png


class Errors(Cli):
    def errors(self, *arguments, scene=SCENE):
        result = lumicut("errors", scene, "--size", "24x18", "-q", "--json", *arguments)
        self.assert_ends(result, OK)
        return json.loads(result.stdout)

    def test_the_exhaustive_sum_has_no_clustering_error(self):
        found = self.errors("-i", "exhaustive", "--vpls", "200", "--sets", "4", "--paths", "64")
        self.assertEqual(found["clustering"]["rmse"], 0)
        self.assertGreater(found["sampling"]["rmse"], 0.01)

    def test_a_coarse_threshold_shows_as_clustering_and_nowhere_else(self):
        settings = ["-i", "lightcuts", "--vpls", "2000", "--sets", "4", "--paths", "64"]
        fine, coarse = self.errors(*settings, "-p", "error=0.001"), self.errors(*settings, "-p", "error=0.3")
        self.assertLess(fine["clustering"]["rmse"], 0.005)
        self.assertGreater(coarse["clustering"]["rmse"], 4 * fine["clustering"]["rmse"])
        for part in ("sampling", "clamping"):  # the same lights and truth
            self.assertEqual(fine[part]["rmse"], coarse[part]["rmse"])

    def test_more_lights_lessen_sampling_and_a_larger_clamp_darkens(self):
        few = self.errors("-i", "exhaustive", "--vpls", "200", "--sets", "12", "--paths", "256")
        many = self.errors("-i", "exhaustive", "--vpls", "3200", "--sets", "12", "--paths", "256")
        # 16 times the lights: a quarter, on the mean over 12 sets; half leaves room for what they scatter.
        self.assertLess(many["sampling"]["expected_rmse"], 0.5 * few["sampling"]["expected_rmse"])
        clamped = self.errors("-i", "exhaustive", "--vpls", "3200", "--sets", "12", "--paths", "256", "-p", "clamp_relative=0.4")
        self.assertLess(clamped["clamping"]["bias"], many["clamping"]["bias"] - 0.02)
        self.assertGreater(clamped["clamping"]["rmse"], abs(clamped["clamping"]["bias"]))

    def test_the_means_of_the_parts_add_up_to_the_total(self):
        found = self.errors("-i", "illumination_cut", "--vpls", "500", "--sets", "3", "--paths", "32")
        parts = sum(found[name]["bias"] for name in ("clustering", "sampling", "clamping"))
        self.assertTrue(math.isclose(parts, found["total"]["bias"], abs_tol=1e-5))  # images are of single precision

    def test_a_folder_holds_maps_images_and_figures(self):
        folder = self.folder / "errors"
        told = self.errors("-i", "lightcuts", "--vpls", "300", "--sets", "2", "--paths", "16", "-o", folder)
        self.assertEqual(sorted(p.name for p in folder.iterdir()),
                         ["clamping.png", "clustering.png", "errors.exr", "errors.json", "sampling.png", "total.png"])
        self.assertEqual(json.loads((folder / "errors.json").read_text()), told)
        width, height, _ = read_png((folder / "total.png").read_bytes())
        self.assertGreaterEqual(width, 24)
        for layer in ("exhaustive", "expected", "truth"):
            compared = lumicut("compare", folder / "errors.exr", folder / "errors.exr", "--layer", layer, "--no-flip", "--json")
            self.assert_ends(compared, OK)
        other = lumicut("render", SCENE, "--size", "24x18", "--spp", "1", "-q", "-i", "lightcuts", "--vpls", "300", "--layers",
                        "radiance", "-o", self.folder / "a.exr")
        self.assert_ends(other, OK)
        same = lumicut("compare", folder / "errors.exr", self.folder / "a.exr", "--no-flip", "--json")
        self.assertEqual(json.loads(same.stdout)["rmse"], 0)  # the image that is taken apart is that of `render`

    def test_wrong_words_and_black_scenes_are_named(self):
        self.assert_ends(lumicut("errors", SCENE, "-i", "path_tracer"), USAGE, "path_tracer", "no virtual lights")
        self.assert_ends(lumicut("errors", SCENE, "--sets", "1"), USAGE, "--sets")
        self.assert_ends(lumicut("errors", self.folder / "none.json"), BAD_FILE, "none.json")
        scene = self.folder / "black.json"
        scene.write_text(json.dumps({"camera": {"eye": [0, 0, 4], "at": [0, 0, 0], "fov_y": 40}, "width": 8, "height": 8}))
        black = lumicut("errors", scene, "-q", "--sets", "2", "--paths", "8")
        self.assertNotEqual(black.returncode, OK)
        self.assertIn("black", black.stderr)


if __name__ == "__main__":
    unittest.main()
