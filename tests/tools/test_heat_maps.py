"""Pictures of what points cost and how far they are off, and references on squares."""
import json
import unittest

from cli import BAD_FILE, OK, SCENE, USAGE, Cli, lumicut, read_png, write_exr

COUNTS = {"bounds": "bounds_per_pixel", "cut_size": "clusters_per_pixel", "rays": "rays_per_pixel"}
BAR_LEFT, BAR_TOP = 8, 8  # of the colour bar, from the picture's right end and top


def oklab(rgb):
    """[Ottosson 2020], written apart from the command's own."""
    r, g, b = (c / 255 / 12.92 if c <= 10 else ((c / 255 + 0.055) / 1.055) ** 2.4 for c in rgb)
    l, m, s = (x ** (1 / 3) for x in (0.4122214708 * r + 0.5363325363 * g + 0.0514459929 * b,
                                      0.2119034982 * r + 0.6806995451 * g + 0.1073969566 * b,
                                      0.0883024619 * r + 0.2817188376 * g + 0.6299787005 * b))
    return (0.2104542553 * l + 0.7936177850 * m - 0.0040720468 * s,
            1.9779984951 * l - 2.4285922050 * m + 0.4505937099 * s,
            0.0259040371 * l + 0.7827717662 * m - 0.8086757660 * s)


class HeatMaps(Cli):
    def bar(self, rows, width, height):
        """The colour bar's colours from low to high."""
        return [rows[y][width + BAR_LEFT + 5] for y in range(max(height, 100) - BAR_TOP - 1, BAR_TOP - 1, -1)]

    def test_every_count_has_a_picture_and_a_layer_that_agree_with_the_statistics(self):
        image, stats, maps = self.folder / "a.exr", self.folder / "a.json", self.folder / "maps"
        self.assert_ends(lumicut("render", SCENE, "-i", "lightcuts", "--vpls", "500", "--size", "128x96", "--spp", "2",
                                 "-o", image, "--stats", stats, "--heat-map", maps), OK)
        self.assertEqual(sorted(p.name for p in maps.iterdir()), sorted(f"{n}.png" for n in COUNTS))
        counted = json.loads(stats.read_text())
        for layer, key in COUNTS.items():
            result = lumicut("compare", image, image, "--layer", layer, "--json", "--no-flip")
            self.assert_ends(result, OK)
            # A layer is a mean over samples, of which the statistics have the sum.
            self.assertAlmostEqual(json.loads(result.stdout)["reference_mean"] * 2 / counted[key], 1, places=4)
            width, height, rows = read_png((maps / f"{layer}.png").read_bytes())
            self.assertGreater(width, 128)
            self.assertGreater(height, 100)
            self.assertGreater(len({p for row in rows[:96] for p in row[:128]}), 10, "many colours")

    def test_the_colour_map_is_perceptually_even_and_grows_lighter(self):
        maps = self.folder / "maps"
        self.assert_ends(lumicut("render", SCENE, "-i", "lightcuts", "--vpls", "300", "--size", "200x400", "--heat-map", maps), OK)
        _, _, rows = read_png((maps / "rays.png").read_bytes())
        colours = [oklab(c) for c in self.bar(rows, 200, 400)]
        self.assertEqual(len(colours), 384)
        # Over strides that are long against the rounding to 8 bits (about .003 in OKLab).
        points = colours[::16]
        steps = [sum((x - y) ** 2 for x, y in zip(a, b)) ** 0.5 for a, b in zip(points, points[1:])]
        self.assertLess(max(steps) / min(steps), 1.25, "equal steps look equally large")
        self.assertTrue(all(b[0] > a[0] + 0.01 for a, b in zip(points, points[1:])), "lightness rises")
        self.assertGreater(points[-1][0] - points[0][0], 0.65)

    def test_folders_that_cannot_be_are_named(self):
        taken = self.folder / "taken"
        taken.write_text("")
        for path in (taken, self.folder / "no/maps"):
            self.assert_ends(lumicut("render", SCENE, "--size", "8x8", "--vpls", "10", "--heat-map", path), BAD_FILE, str(path))
        self.assertEqual(self.files(), ["taken"])


class ErrorMaps(Cli):
    def images(self):
        reference, image = self.folder / "r.exr", self.folder / "i.exr"
        write_exr(reference, 128, 104, lambda x, y: (1, 1, 1))
        # 1.125 and .875 are exact in half floats.
        write_exr(image, 128, 104, lambda x, y: (1.125,) * 3 if x < 32 else (0.875,) * 3 if x < 64 else
                  (float("nan"),) * 3 if y < 8 else (1, 1, 1))
        return image, reference

    def test_known_errors_have_the_colours_of_the_bar(self):
        image, reference = self.images()
        error, signed = self.folder / "e.png", self.folder / "s.png"
        self.assert_ends(lumicut("compare", image, reference, "--no-flip", "--error-map", error, "--signed-error-map", signed), OK)
        _, _, rows = read_png(error.read_bytes())
        bar = [rows[y][128 + BAR_LEFT + 5] for y in range(104 - BAR_TOP - 1, BAR_TOP - 1, -1)]
        near = min(range(len(bar)), key=lambda i: sum(abs(a - b) for a, b in zip(bar[i], rows[50][10])))
        # .125 on a scale from .001 to 1: log 125 / log 1000. The bar is 88 pixels high.
        self.assertAlmostEqual(near / (len(bar) - 1), 0.699, delta=0.02)
        self.assertEqual(rows[50][10], rows[50][50], "the sign does not count")
        self.assertEqual(rows[50][100], (0, 0, 0), "no error")
        self.assertEqual(rows[2][100], (128, 128, 128), "not a number")
        _, _, rows = read_png(signed.read_bytes())
        bright, dark, none = rows[50][10], rows[50][50], rows[50][100]
        self.assertGreater(bright[0], bright[2] + 50)
        self.assertGreater(dark[2], dark[0] + 50)
        self.assertLess(max(none) - min(none), 8, "none is grey")

    def test_errors_are_written_as_numbers(self):
        image, reference = self.images()
        for option, layer, mean in (("--error-map", "relative_error", 0.125), ("--signed-error-map", "signed_relative_error", 0)):
            numbers = self.folder / "e.exr"
            self.assert_ends(lumicut("compare", image, reference, "--no-flip", option, numbers), OK)
            result = lumicut("compare", numbers, numbers, "--layer", layer, "--no-flip", "--json")
            self.assert_ends(result, OK)
            m = json.loads(result.stdout)
            self.assertEqual(m["pixels"], 128 * 104 - 64 * 8)
            share = 64 * 104 / m["pixels"]
            # The signed halves cancel.
            self.assertAlmostEqual(m["reference_mean"], mean * share, places=5)

    def test_a_map_that_cannot_be_written_is_named_before_work(self):
        image, reference = self.images()
        self.assert_ends(lumicut("compare", image, reference, "--error-map", self.folder / "no/e.png"), BAD_FILE, "no/e.png")


class Squares(Cli):
    def test_squares_are_parts_of_the_whole_image(self):
        whole, part, stats = self.folder / "whole.exr", self.folder / "part.exr", self.folder / "part.json"
        arguments = ("render", SCENE, "-i", "exhaustive", "--vpls", "200", "--size", "150x70", "--layers", "radiance")
        self.assert_ends(lumicut(*arguments, "-o", whole), OK)
        self.assert_ends(lumicut(*arguments, "-o", part, "--squares", "5", "--stats", stats), OK)
        result = lumicut("compare", part, whole, "--no-flip", "--json")
        self.assert_ends(result, OK)
        m, counted = json.loads(result.stdout), json.loads(stats.read_text())
        self.assertEqual((m["max_relative_error"], m["pixels"]), (0, counted["rendered_pixels"]))
        self.assertEqual(m["bad_pixels"], 150 * 70 - m["pixels"])
        self.assertLessEqual(m["pixels"], 5 * 32 * 32)
        # More squares than there are give the whole image.
        self.assert_ends(lumicut(*arguments, "-o", part, "--squares", "1000"), OK)
        m = json.loads(lumicut("compare", part, whole, "--no-flip", "--json").stdout)
        self.assertEqual((m["max_relative_error"], m["pixels"]), (0, 150 * 70))

    def test_squares_and_a_crop_exclude_each_other(self):
        self.assert_ends(lumicut("render", SCENE, "-o", self.folder / "a.exr", "--squares", "2", "--crop", "0,0,8,8"), USAGE, "--crop")
        self.assert_ends(lumicut("render", SCENE, "-o", self.folder / "a.exr", "--squares", "0"), USAGE, "--squares")


if __name__ == "__main__":
    unittest.main()
