"""Measured lamps and skies from scene file to image."""
import json
import unittest

from cli import BAD_FILE, OK, Cli as Base, lumicut

LAMP = "IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 3 1 1 2 0 0 0\n1 1 60\n0 90 180\n0\n683 683 683\n"


class Ies(Base):
    def render(self, name, lights, *arguments, **more):
        scene = self.folder / f"{name}.json"
        scene.write_text(json.dumps({
            "image": {"size": [32, 24]}, "camera": {"eye": [0, 1, 4], "at": [0, 0.5, 0], "fov_y": 50},
            "materials": [{"name": "grey"}],
            "meshes": [{"positions": [[-3, 0, 3], [3, 0, 3], [3, 0, -3], [-3, 0, -3], [3, 4, -3], [-3, 4, -3]],
                        "quads": [[0, 1, 2, 3], [3, 2, 4, 5]], "material": "grey"}],
            "lights": lights, **more}))
        image = self.folder / f"{name}.exr"
        result = lumicut("render", scene, "-o", image, "--vpls", "2000", "-q", *arguments)
        self.assert_ends(result, OK)
        return image

    def difference(self, a, b):
        result = lumicut("compare", a, b, "--json", "--no-flip")
        self.assert_ends(result, OK)
        return json.loads(result.stdout)["max_relative_error"]

    def test_an_even_lamp_of_683_candela_is_a_point_lamp_of_one_watt_per_steradian(self):
        (self.folder / "lamp.ies").write_text(LAMP)
        even = {"type": "point", "position": [0.5, 2, 0], "value": 2}
        direct = ("-i", "exhaustive", "-p", "max_depth=0")
        plain = self.render("plain", [even], *direct)
        profiled = {**even, "ies": "lamp.ies", "direction": [0.2, -1, 0]}
        self.assertLess(self.difference(self.render("ies", [profiled], *direct), plain), 1e-4)
        for method in ("lightcuts", "illumination_cut", "wspd", "stochastic_lightcuts"):
            image = self.render(method, [profiled], "-i", method, "-p", "max_depth=0")
            self.assertLess(self.difference(image, plain), 0.05, method)

    def test_lights_of_a_profile_go_through_a_file(self):
        (self.folder / "lamp.ies").write_text(LAMP.replace("683 683 683", "683 100 0"))
        lamp = {"type": "point", "position": [0.5, 2, 0], "value": 2, "ies": "lamp.ies", "direction": [0, -1, 0]}
        lights = self.folder / "a.vpl"
        first = self.render("first", [lamp], "-i", "exhaustive", "--vpl-out", lights)
        self.assertEqual(self.difference(self.render("second", [lamp], "-i", "exhaustive", "--vpl-in", lights), first), 0)

    def test_a_broken_file_is_named(self):
        (self.folder / "lamp.ies").write_text(LAMP.replace("683 683 683", "683 x 683"))
        scene = self.folder / "s.json"
        scene.write_text(json.dumps({"camera": {"eye": [0, 1, 4], "at": [0, 0, 0], "fov_y": 50}, "lights": [
            {"type": "point", "position": [0, 2, 0], "value": 1, "ies": "lamp.ies", "direction": [0, -1, 0]}]}))
        self.assert_ends(lumicut("render", scene, "-o", self.folder / "o.exr"), BAD_FILE, "lamp.ies", "line 7", "candela", " x")

    def test_a_sky_lights_a_scene(self):
        image = self.render("sky", [], "-i", "lightcuts", environment={"sky": {"sun_elevation": 40, "resolution": 64}})
        self.assertTrue(image.exists())
        found = json.loads(lumicut("check", self.folder / "sky.json", "--json", "--no-forecast").stdout)
        self.assertEqual(found["counts"]["lights"], {"sun": 1})
        self.assertEqual(found["counts"]["environment"], "image 128 x 64")


if __name__ == "__main__":
    unittest.main()
