"""Shadow catchers of scene files: what the camera sees of them, against arithmetic; in Blender tests/blender/in_export.py holds
them against F12, and in_catchers.py that against Cycles."""
import json
import unittest

import cli
from cli import BAD_FILE, OK, USAGE, lumicut
from test_models import oiio


def square(half, height, material, **more):
    corners = [[-half, height, half], [half, height, half], [half, height, -half], [-half, height, -half]]
    return {"positions": corners, "quads": [[0, 1, 2, 3]], "material": material, **more}


class Catchers(cli.Cli):
    """A square above a floor that a sun shines on from above: its shadow is 2 wide, the floor 4, the image 8."""

    def render(self, *words, code=OK, lit=0.5, sun=True, **environment):
        scene = {"image": {"size": [16, 16], "samples": 4},
                 "camera": {"type": "orthographic", "eye": [0, 10, 0], "at": [0, 0, 0], "up": [0, 0, -1], "height": 8},
                 "materials": [{"name": "floor", "diffuse": [0.5, 0.25, 0.125]}, {"name": "roof", "diffuse": [0, 0, 0]}],
                 "lights": [{"type": "sun", "direction": [0, -1, 0], "value": 2, "shadow_catcher": sun},
                            {"type": "sun", "direction": [0, -1, 0], "value": 1, "color": [lit, lit, lit]}],
                 "meshes": [square(2, 0, "floor", shadow_catcher=True), square(1, 1, "roof", hidden_from=["camera"])]}
        if environment:
            scene["environment"] = environment
        path, out = self.folder / "scene.json", self.folder / "out.exr"
        path.write_text(json.dumps(scene))
        result = lumicut("render", path, "-i", "exhaustive", "-p", "max_depth=0", "--layers", "radiance,alpha", "-o", out, *words)
        self.assert_ends(result, code)
        if code != OK:
            return result.stderr
        opened = oiio.ImageInput.open(str(out))
        pixels, names = opened.read_image("float"), [name.split(".")[-1] for name in opened.spec().channelnames]
        self.assertEqual(len(names), 4)
        return pixels[..., [*map(names.index, "RGB"), ({*range(4)} - {*map(names.index, "RGB")}).pop()]]

    def test_shadows_are_alpha_and_the_rest_is_clear(self):
        pixels = self.render(lit=0)
        self.assertLess(abs(pixels[..., :3]).max(), 1e-6)
        self.assertLess(abs(pixels[6:10, 6:10, 3] - 1).max(), 1e-6)
        for beside in (pixels[:, :6, 3], pixels[:, 10:, 3], pixels[:6, :, 3], pixels[10:, :, 3]):
            self.assertLess(abs(beside).max(), 1e-6)

    def test_lights_of_the_scene_alone_brighten_and_throw_no_shadow(self):
        # In the shadow nothing of both suns is left; beside it the clear floor is not made darker than clear.
        pixels = self.render(lit=0.5)
        self.assertLess(abs(pixels[6:10, 6:10, 3] - 1).max(), 1e-6)
        self.assertLess(abs(pixels[4, 4, 3]), 1e-6)

    def test_the_world_that_the_camera_sees_is_darkened(self):
        # By the sun's part of what lights the floor: 2 beside pi of the even world, of which the square hides some.
        pixels = self.render("--vpls", "20000", lit=0, color=[1, 1, 1])
        self.assertLess(abs(pixels[0, 0, :3] - 1).max(), 1e-4)
        self.assertLess(abs(pixels[4, 4, :3] - 1).max(), 0.2)
        left = pixels[8, 8, 0]
        self.assertGreater(left, 0.15)
        self.assertLess(left, 1 - 2 / (2 + 3.1416))
        self.assertLess(abs(pixels[8, 8, 3] - (1 - left)), 1e-4)

    def test_shadows_are_in_the_usual_layers_and_the_picture(self):
        self.render(lit=0)
        exr, png = self.folder / "usual.exr", self.folder / "usual.png"
        self.assert_ends(lumicut("render", self.folder / "scene.json", "-i", "exhaustive", "-p", "max_depth=0", "-o", exr, "--png", png), OK)
        self.assertIn("A", oiio.ImageInput.open(str(exr)).spec().channelnames)
        picture = oiio.ImageInput.open(str(png)).read_image("uint8")
        self.assertEqual(picture.shape[2], 4)
        self.assertEqual(picture[8, 8].tolist(), [0, 0, 0, 255])
        self.assertEqual(picture[8, 1, 3], 0)
        # Where a world is seen, the picture is of it, darkened.
        self.render("--png", png, lit=0, color=[1, 1, 1])
        self.assertEqual(oiio.ImageInput.open(str(png)).spec().nchannels, 3)

    def test_passes_and_crops_are_of_them_too(self):
        whole = self.render("--passes", "3", lit=0)
        part = self.render("--passes", "3", "--crop", "4,5,12,9", lit=0)
        self.assertEqual(part.shape[:2], (4, 8))
        self.assertEqual(abs(part - whole[5:9, 4:12]).max(), 0)

    def test_what_cannot_be_is_said(self):
        self.assertIn("--groups: not with shadow catchers", self.render("--groups", code=USAGE))
        self.assertIn("--squares: not with shadow catchers", self.render("--squares", "1", code=USAGE))
        self.render("--vpl-out", self.folder / "a.vpl", lit=0)
        self.assertIn("--vpl-in: not with shadow catchers", self.render("--vpl-in", self.folder / "a.vpl", code=USAGE))
        self.assertIn("shows no shadow where no light", self.render("--strict", sun=False, code=BAD_FILE))

    def test_check_foretells_all_scenes_that_they_take(self):
        self.render(lit=0, color=[1, 1, 1])
        scene = json.loads((self.folder / "scene.json").read_text())
        del scene["meshes"][0]["shadow_catcher"]
        (self.folder / "plain.json").write_text(json.dumps(scene))
        caught, plain = (json.loads(lumicut("check", "--json", self.folder / name, "-i", "exhaustive", "--vpls", 100).stdout)["forecast"] for name in ("scene.json", "plain.json"))
        self.assertEqual((caught["shadow_scenes"], plain["shadow_scenes"]), (3, 0))
        # The floor is looked at twice, and so is the roof.
        self.assertGreater(caught["rays_per_pixel"], 1.5 * plain["rays_per_pixel"])
        self.assertIn("with 3 scenes more for shadow catchers", lumicut("check", self.folder / "scene.json").stdout)
        self.assert_ends(lumicut("check", "--groups", self.folder / "scene.json"), USAGE, "--groups: not with shadow catchers")

    def test_a_checkpoint_is_said_to_keep_the_whole_scene_alone(self):
        kept = self.folder / "kept"
        whole = self.render("--passes", "3", lit=0.5)
        self.assertEqual(abs(whole - self.render("--passes", "3", "--checkpoint", kept, lit=0.5)).max(), 0)
        self.assertEqual(abs(whole - self.render("--passes", "3", "--checkpoint", kept, "--resume", lit=0.5)).max(), 0)
        result = lumicut("render", self.folder / "scene.json", "-i", "exhaustive", "--checkpoint", kept, "-o", self.folder / "out.exr")
        self.assertIn("kept: keeps the passes of the whole scene; --resume renders the shadows anew", result.stderr)

    def test_check_says_nothing_else_is_suspicious_where_something_is(self):
        self.render(lit=0.5, sun=False)
        said = lumicut("check", "--no-forecast", self.folder / "scene.json").stdout
        self.assertIn("shows no shadow", said)
        self.assertIn("nothing else suspicious", said)

    def test_other_commands_say_that_they_take_them_for_objects(self):
        self.render(lit=0)
        cameras = self.folder / "cameras.json"
        cameras.write_text(json.dumps({"frames": 1, "views": [{"eye": [0, 5, 3], "at": [0, 0, 0], "fov_y": 40}]}))
        result = lumicut("errors", self.folder / "scene.json", "-o", self.folder / "errors.json", "--vpls", "10")
        self.assertIn("which is an ordinary object to `lumicut errors`", result.stderr)


if __name__ == "__main__":
    unittest.main()
