"""pbrt-v4 scenes, which the test writes: against formulas, and against the same scene as JSON."""
import gzip
import json
import math
import os
import unittest

import numpy as np

import cli
import test_gltf
import test_models
from cli import BAD_FILE, OK, ROOT, SCENE, lumicut

SCENES = ROOT / "tests/tools/scenes"
HEAD = 'Film "rgb" "integer xresolution" [ 48 ] "integer yresolution" [ 36 ]\n'


def fresnel(cosine, index):
    """Of a dielectric; `index`: of the other side over that of this one."""
    sine2 = (1 - cosine ** 2) / index ** 2
    other = np.sqrt(np.maximum(0, 1 - sine2))
    parts = ((index * cosine - other) / (index * cosine + other)) ** 2, ((cosine - index * other) / (cosine + index * other)) ** 2
    return np.where(sine2 >= 1, 1, sum(parts) / 2)


def kept_inside(index):
    """What a dielectric's border reflects of even light from inside."""
    cosines = (np.arange(100000) + 0.5) / 100000
    return (2 * cosines * fresnel(cosines, 1 / index)).mean()


def look(eye, at, up=(0, 1, 0)):
    return "LookAt " + "  ".join(" ".join(map(str, v)) for v in (eye, at, up)) + "\n"


class SceneFiles(cli.Cli):
    def write(self, name, text):
        path = self.folder / name
        path.write_text(text if isinstance(text, str) else json.dumps(text))
        return path

    def write_exr(self, name, pixels):
        out = test_models.oiio.ImageOutput.create(str(self.folder / name))
        out.open(str(self.folder / name), test_models.oiio.ImageSpec(pixels.shape[1], pixels.shape[0], 3, "float"))
        out.write_image(np.ascontiguousarray(pixels))
        out.close()

    def render(self, path, *words, layers="radiance", method="exhaustive"):
        out = self.folder / (path.name + ".exr")
        done = lumicut("render", path, "-o", out, "--layers", layers, "-i", method, "--seed", 1, *words)
        self.assertEqual(done.returncode, OK, done.stderr)
        image = test_models.oiio.ImageInput.open(str(out))
        spec = image.spec()
        return image.read_image("float").reshape(spec.height, spec.width, -1), done.stderr

    def assert_same(self, a, b, share=1e-3, off=0.01):
        self.assertEqual(a.shape, b.shape)
        self.assertGreater(b.max(), 0)
        self.assertLess((np.abs(a - b).max(axis=2) > share * b.max()).mean(), off)

    def assert_is_of_material(self, scene, keys):
        """It looks as it does with its materials written down as JSON."""
        self.assert_ends(lumicut("convert", scene, self.folder / "ball.json"), OK)
        again = json.loads((self.folder / "ball.json").read_text())
        for material in again["materials"]:
            name = material["name"]
            material.clear()
            material.update({"name": name} | keys)
        self.assert_same(self.render(scene, "--vpls", 100)[0], self.render(self.write("again.json", again), "--vpls", 100)[0])

    def lamp(self, scene, place="7x7"):
        """Radiance of a floor of reflectance .5 in the middle, of light that comes straight from lamps."""
        return self.render(scene, "--size", place, "--vpls", 2000, "-p", "clamp_lights=0")[0][3, 3]


class Pbrt(SceneFiles):
    def floor(self, lights, material='Material "diffuse" "rgb reflectance" [ .5 .5 .5 ]', head=""):
        return self.write("floor.pbrt", head + 'Film "rgb" "integer xresolution" 8 "integer yresolution" 8\n' + look((0, 4, 0.001), (0, 0, 0)) +
                          f'Camera "perspective" "float fov" 1\nWorldBegin\n{lights}\n{material}\n'
                          'Shape "trianglemesh" "point3 P" [ -1 0 1  1 0 1  1 0 -1  -1 0 -1 ] "integer indices" [ 0 1 2 0 2 3 ]\n')

    def test_light_of_lamps_is_what_the_formulas_say(self):
        for light, expected in (
                ('LightSource "point" "rgb I" [ 8 4 2 ] "point3 from" [ 0 2 0 ]', np.array([8, 4, 2]) / 4),
                ('LightSource "point" "float power" 100 "point3 from" [ 0 2 0 ]', np.full(3, 100 / (4 * math.pi) / 4)),
                ('LightSource "spot" "rgb I" [ 1 1 1 ] "float scale" 6 "point3 from" [ 0 2 0 ] "point3 to" [ 0 0 0 ]', np.full(3, 6 / 4)),
                ('Translate 0 2 0 Rotate 90 1 0 0 LightSource "spot" "rgb I" [ 6 6 6 ]', np.full(3, 6 / 4)),  # along z
                ('LightSource "distant" "rgb L" [ 3 2 1 ] "point3 from" [ 0 1 1 ] "point3 to" [ 0 0 0 ]', np.array([3, 2, 1]) / math.sqrt(2)),
                ('LightSource "distant" "float illuminance" 5 "point3 from" [ 0 1 0 ] "point3 to" [ 0 0 0 ]', np.full(3, 5)),
                ('LightSource "infinite" "rgb L" [ 1 .5 .25 ] "float scale" 2', math.pi * np.array([2, 1, 0.5]))):
            with self.subTest(light):
                found = self.lamp(self.floor(f"AttributeBegin {light} AttributeEnd"))
                # The environment's virtual lights are a few thousand directions.
                np.testing.assert_allclose(found, 0.5 / math.pi * expected, rtol=0.02 if "infinite" in light else 2e-3)

    def test_the_spot_falls_off_as_its_cosines_say(self):
        # Half way between the cosines of 20 and 40 degrees the light is half of that in the middle.
        half = math.acos((math.cos(math.radians(20)) + math.cos(math.radians(40))) / 2)
        light = ('LightSource "spot" "rgb I" [ 1 1 1 ] "float coneangle" 40 "float conedeltaangle" 20 "point3 from" [ 0 2 0 ] '
                 f'"point3 to" [ {2 * math.tan(half)} 0 0 ]')
        np.testing.assert_allclose(self.lamp(self.floor(light)), 0.5 / math.pi * 0.5 / 4, rtol=3e-3)

    def test_area_lights_emit_on_the_side_of_their_normal(self):
        disk = 'AttributeBegin Translate 0 1 0 Rotate {} 1 0 0 {} Material "diffuse" "rgb reflectance" [ 0 0 0 ] AreaLightSource "diffuse" "rgb L" [ 2 2 2 ] {} Shape "disk" "float radius" .5 AttributeEnd'
        expected = 0.5 * 2 * 0.25 / 1.25  # rho L sin² of the disk's half angle
        for angle, words, more, lit in ((90, "", "", True), (-90, "", "", False), (-90, "ReverseOrientation", "", True),
                                        (-90, "", '"bool twosided" true', True), (-90, "Scale 1 1 -1", "", False), (90, "Scale -1 1 1", "", False)):
            with self.subTest(angle=angle, words=words, more=more):
                camera_below = self.floor(disk.format(angle, words, more)).read_text().replace("LookAt 0 4 0.001", "LookAt 0 0.5 0.001")
                found = self.lamp(self.write("below.pbrt", camera_below))
                # Of 2,000 places on both sides half lie behind.
                np.testing.assert_allclose(found, expected if lit else 0, rtol=0.05 if more else 0.02)

    def test_below_a_smooth_coat_light_meets_the_base_again_and_again(self):
        # A sun at 45 degrees, seen straight from above: through the coat, base and border any number of times, and out.
        sun = 'LightSource "distant" "rgb L" [ 1 1 1 ] "point3 from" [ 0 1 1 ] "point3 to" [ 0 0 0 ]'
        (self.folder / "grey.png").write_bytes(test_gltf.png(1, 1, [(188, 188, 188)]))
        texture = 'Texture "t" "spectrum" "imagemap" "string filename" "grey.png"'
        for index, base in ((1.5, 0.1), (1.5, 0.5), (1.3, 0.9), (1.5, None)):
            material = f'{texture} Material "coateddiffuse" "float eta" {index} ' + ('"texture reflectance" "t"' if base is None else f'"rgb reflectance" [ {base} {base} {base} ]')
            base = base or ((188 / 255 + 0.055) / 1.055) ** 2.4
            through = (1 - fresnel(1, index)) * (1 - fresnel(math.sqrt(0.5), index)) / index ** 2
            expected = math.sqrt(0.5) / math.pi * through * base / (1 - base * kept_inside(index))
            with self.subTest(index=index, base=base):
                # The library reads what coats let through from tables.
                np.testing.assert_allclose(self.lamp(self.floor(sun, material)), expected, rtol=7e-3)

    def test_a_mirror_of_gold_reflects_as_gold(self):
        # Straight down a wall of light lies above: what comes back is Fresnel's reflectance of gold at 0 degrees.
        sky = 'LightSource "infinite" "rgb L" [ 1 1 1 ]'
        scene = self.floor(sky, 'Material "conductor" "spectrum eta" "metal-Au-eta" "spectrum k" "metal-Au-k" "float roughness" 0')
        found = self.render(scene, "--vpls", 100)[0][4, 4]
        for value, (eta, k) in zip(found, ((0.1188, 3.306), (0.3954, 2.516), (1.587, 1.764))):
            self.assertAlmostEqual(value, ((eta - 1) ** 2 + k * k) / ((eta + 1) ** 2 + k * k), delta=0.01)

    def test_a_room_is_what_it_is_as_json(self):
        """Include, named materials, coordinate systems, instances, a sphere, a textured quad, a left-handed camera."""
        (self.folder / "dots.png").write_bytes(test_gltf.png(2, 2, [(255, 0, 0), (0, 255, 0), (0, 0, 255), (255, 255, 255)]))
        self.write("parts.pbrt", 'MakeNamedMaterial "red" "string type" "diffuse" "rgb reflectance" [ .7 .2 .1 ]\n'
                   'Texture "dots" "spectrum" "imagemap" "string filename" "dots.png" "string filter" "point"\n')
        scene = self.write("room.pbrt", "# A room\nScale -1 1 1\n" + look((3, 4, 6), (0, 0.5, 0)) + 'Camera "perspective" "float fov" [ 40 ]\n' + HEAD +
                           'WorldBegin\nInclude "parts.pbrt"\nLightSource "point" "rgb I" [ 40 40 40 ] "point3 from" [ 2 5 3 ]\n'
                           'AttributeBegin Material "diffuse" "texture reflectance" "dots"\nShape "trianglemesh" "integer indices" [0 1 2 0 2 3]'
                           '"point3 P" [-3 0 3  3 0 3  3 0 -3  -3 0 -3] "point2 uv" [0 0 1 0 1 1 0 1]\nAttributeEnd\n'
                           'ObjectBegin "block" Identity NamedMaterial "red" Shape "bilinearmesh" "point3 P" [-.5 0 0 .5 0 0 -.5 1 0 .5 1 0] ObjectEnd\n'
                           'AttributeBegin Translate -1 0 1 ObjectInstance "block" AttributeEnd\n'
                           'AttributeBegin ConcatTransform [ 0 0 -1 0  0 2 0 0  1 0 0 0  1 0 1 1 ] ObjectInstance "block" AttributeEnd\n')
        expected = self.write("room.json", {
            "image": {"size": [48, 36]}, "camera": {"eye": [3, 4, 6], "at": [0, 0.5, 0], "fov_y": 40},
            "lights": [{"type": "point", "position": [2, 5, 3], "value": 40}],
            "materials": [{"name": "dots", "diffuse_texture": {"file": "dots.png", "nearest": True}, "diffuse": [1, 1, 1]},
                          {"name": "red", "diffuse": [0.7, 0.2, 0.1]}],
            "meshes": [{"positions": [[-3, 0, 3], [3, 0, 3], [3, 0, -3], [-3, 0, -3]], "quads": [[0, 1, 2, 3]],
                        "uvs": [[0, 0], [1, 0], [1, 1], [0, 1]], "material": "dots"},
                       {"positions": [[-.5, 0, 0], [.5, 0, 0], [.5, 1, 0], [-.5, 1, 0]], "quads": [[0, 1, 2, 3]], "material": "red",
                        "instances": [{"translate": [-1, 0, 1]}, [0, 0, 1, 1, 0, 2, 0, 0, -1, 0, 0, 1]]}]})
        wanted = self.render(expected, "--vpls", 500)[0]
        self.assert_same(self.render(scene, "--vpls", 500)[0], wanted)
        # Without Scale -1 1 1 pbrt's world is left-handed, and the picture the other way round.
        self.write("room.pbrt", scene.read_text().replace("Scale -1 1 1\n", "").replace("3 4 6", "-3 4 6").replace("[ 2 5 3 ]", "[ -2 5 3 ]")
                   .replace("WorldBegin", "WorldBegin Scale -1 1 1").replace("from\" [ -2", "from\" [ 2"))
        # Bounced light starts in directions that are not mirrored.
        self.assert_same(self.render(scene, "--vpls", 500)[0], wanted, 0.1)

    def test_spheres_and_materials_are_what_they_are_as_json(self):
        materials = (('"diffuse" "rgb reflectance" [ .2 .4 .6 ]', {"diffuse": [0.2, 0.4, 0.6]}),
                     ('"coateddiffuse" "rgb reflectance" [ .2 .4 .6 ] "float roughness" .0625',
                      {"model": "ggx", "diffuse": [c * (1 - kept_inside(1.5)) / (1 - c * kept_inside(1.5)) for c in (0.2, 0.4, 0.6)], "roughness": 0.5}),
                     ('"conductor" "rgb reflectance" [ .9 .6 .3 ] "float roughness" .25 "bool remaproughness" false',
                      {"model": "ggx", "metallic": 1, "diffuse": [0.9, 0.6, 0.3], "roughness": 0.5}),
                     ('"dielectric" "float eta" 1.3', {"model": "ggx", "transmission": 1, "diffuse": [1, 1, 1], "roughness": 0, "ior": 1.3}))
        for text, keys in materials:
            with self.subTest(text):
                scene = self.write("ball.pbrt", look((0, 0, 5), (0, 0, 0)) + HEAD + 'Camera "perspective" "float fov" 40\nWorldBegin\n'
                                   f'LightSource "distant" "rgb L" [2 2 2] "point3 from" [1 2 3] "point3 to" [0 0 0]\nLightSource "infinite" "rgb L" [.1 .2 .3]\nMaterial {text}\nShape "sphere" "float radius" 1.2')
                self.assert_is_of_material(scene, keys)

    def test_checkers_mixes_and_scales_are_computed_at_the_hit(self):
        texture = ('Texture "two" "spectrum" "checkerboard" "float uscale" 2 "float vscale" 2 "rgb tex1" [ .8 .8 .8 ] "rgb tex2" [ .2 .2 .2 ]\n'
                   'Texture "dim" "spectrum" "scale" "texture tex" "two" "float scale" .5\n'
                   'Texture "both" "spectrum" "mix" "texture tex1" "dim" "rgb tex2" [ 0 0 0 ] "float amount" .25\n')
        scene = self.write("check.pbrt", HEAD.replace("48", "4").replace("36", "4") + look((0, 0, 3), (0, 0, 0), (0, 1, 0)).replace("LookAt", "Scale -1 1 1 LookAt") +
                           f'Camera "orthographic"\nWorldBegin\n{texture}Material "diffuse" "texture reflectance" "both"\n'
                           'LightSource "infinite"\nShape "bilinearmesh" "point3 P" [-1 -1 0 1 -1 0 -1 1 0 1 1 0]')
        albedo = self.render(scene, "--vpls", 10, layers="albedo")[0][:, :, 0]
        # (0, 0) is even, below on the left.
        bright, dark = 0.8 * 0.5 * 0.75, 0.2 * 0.5 * 0.75
        for (y, x), wanted in (((3, 0), bright), ((3, 3), dark), ((0, 0), dark), ((0, 3), bright)):
            self.assertAlmostEqual(albedo[y, x], wanted, delta=1e-5)

    def test_the_octahedral_sky_lies_as_its_axes_say(self):
        # A picture of one bright direction each: the middle of the square is +z, its corners -z, the middles of its sides x and y.
        for (x, y), seen in (((8, 8), (0, 0, 1)), ((15, 8), (1, 0, 0)), ((8, 15), (0, 1, 0)), ((0, 8), (-1, 0, 0))):
            pixels = np.zeros((17, 17, 3), np.float32)
            pixels[max(0, y - 1):y + 2, max(0, x - 1):x + 2] = 1
            self.write_exr("sky.exr", pixels)
            up = (0, 1, 0) if seen[1] == 0 else (1, 0, 0)
            scene = self.write("sky.pbrt", look((0, 0, 0), seen, up) + 'Film "rgb" "integer xresolution" 5 "integer yresolution" 5\n'
                               'Camera "perspective" "float fov" 4\nWorldBegin\nLightSource "infinite" "string filename" "sky.exr"\n'
                               'Translate 50 50 50 Shape "sphere"')
            # At the pole half a texel is mixed with the other one.
            self.assertGreater(self.render(scene, "--vpls", 10)[0].mean(), 0.6, seen)

    def test_the_cornell_box_is_that_of_the_reference_images_in_pbrt_and_mitsuba(self):
        box = json.loads(SCENE.read_text())
        box["meshes"][0] = {"obj": str(SCENE.parent / "cornell_box.obj"), "materials": {"shiny": {"diffuse": [0.73] * 3, "specular": [0, 0, 0]}}}
        words = ("--size", "64x64", "--vpls", 3000)
        wanted = self.render(self.write("box.json", box), *words)[0]
        for name in ("cornell.pbrt", "cornell.xml"):
            found = self.render(SCENES / name, *words)[0]
            # The blocks are squares there and nearly squares here: their edges differ, and the walls within the noise of 3,000 lights.
            self.assertLess((np.abs(found - wanted).max(axis=2) > 0.1 * np.median(wanted)).mean(), 0.12, name)
            np.testing.assert_allclose(found[2:10, 40:60].mean(axis=(0, 1)), wanted[2:10, 40:60].mean(axis=(0, 1)), rtol=0.03, err_msg=name)
            np.testing.assert_allclose(np.median(found), np.median(wanted), rtol=0.03, err_msg=name)

    def test_the_film_exposes_as_its_speed_and_time_say(self):
        light = 'LightSource "point" "rgb I" [ 8 8 8 ] "point3 from" [ 0 2 0 ] LightSource "infinite" "rgb L" [ .1 .1 .1 ]'
        found = {}
        for words in ("", '"float iso" 400 "float exposuretime" .5', '"float iso" 100'):
            path = self.floor(light)
            path.write_text(path.read_text().replace('"integer yresolution" 8', f'"integer yresolution" 8 {words}'))
            found[words] = self.lamp(path)
        first, *others = found.values()
        np.testing.assert_allclose(others[0], 2 * first, rtol=1e-4)
        np.testing.assert_allclose(others[1], first, rtol=1e-6)

    def test_attributes_stand_for_parameters_that_are_not_given(self):
        found = self.lamp(self.floor('Attribute "light" "rgb I" [ 8 4 2 ] "point3 from" [ 0 2 0 ] Attribute "material" "rgb reflectance" [ .1 .1 .1 ]\n'
                                     'LightSource "point" AttributeBegin Attribute "light" "rgb I" [ 1 1 1 ] AttributeEnd LightSource "point" "rgb I" [ 0 4 6 ]'))
        np.testing.assert_allclose(found, 0.5 / math.pi * np.array([8, 8, 8]) / 4, rtol=2e-3)

    def test_motion_ends_where_it_begins(self):
        found, said = self.render(self.floor('AttributeBegin ActiveTransform EndTime Translate 0 7 0 ActiveTransform All '
                                             'LightSource "point" "rgb I" [ 8 8 8 ] "point3 from" [ 0 2 0 ] AttributeEnd'), "--vpls", 100, "-p", "clamp_lights=0")
        np.testing.assert_allclose(found[4, 4], 0.5 / math.pi * 2, rtol=2e-3)
        self.assertIn("motion: left out", said)

    def test_area_lights_without_alpha_light_and_are_not_seen(self):
        # Above the camera's way to the floor: a ball of 60 W, which stops nothing.
        light = 'AttributeBegin Translate 0 2 0 AreaLightSource "diffuse" "float power" 60 Shape "sphere" "float radius" .25 "float alpha" 0 AttributeEnd'
        # Between radius and distance a ball shines as its middle does.
        np.testing.assert_allclose(self.lamp(self.floor(light)), 0.5 / math.pi * 60 / (4 * math.pi * 2 * 2), rtol=0.03)

    def test_skies_of_a_picture_have_the_illuminance_that_is_asked_for(self):
        pixels = np.full((32, 32, 3), 0.25, np.float32)
        pixels[:, 16:] = (1, 2, 0.5)
        self.write_exr("sky.exr", pixels)
        sky = 'AttributeBegin Rotate -90 1 0 0 LightSource "infinite" "string filename" "sky.exr" "float illuminance" 7 AttributeEnd'
        np.testing.assert_allclose(self.lamp(self.floor(sky)) @ (0.2126, 0.7152, 0.0722), 0.5 / math.pi * 7, rtol=0.02)

    def square(self, *words, layers="albedo", camera='Camera "orthographic"', size=4):
        """A square of 2 by 2 that fills the picture, u to the right and v upwards."""
        scene = self.write("square.pbrt", HEAD.replace("48", str(size)).replace("36", str(size)) + "Scale -1 1 1 " + look((0, 0, 3), (0, 0, 0)) +
                           f'{camera}\nWorldBegin\nLightSource "distant" "rgb L" [ 1 1 1 ] "point3 from" [ 0 0 1 ] "point3 to" [ 0 0 0 ]\n' + "\n".join(words) +
                           '\nShape "bilinearmesh" "point3 P" [-1 -1 0 1 -1 0 -1 1 0 1 1 0]')
        return self.render(scene, "--vpls", 10, layers=layers)

    def test_textures_are_placed_by_plane_and_by_space(self):
        (self.folder / "dots.png").write_bytes(test_gltf.png(2, 2, [(255, 0, 0), (0, 255, 0), (0, 0, 255), (255, 255, 255)]))
        # x from -1 to 1 is u from 0 to 1 there: the picture as it is.
        plane = 'AttributeBegin Translate -1 -1 0 Texture "t" "spectrum" "imagemap" "string filename" "dots.png" "string filter" "point" "string mapping" "planar" "vector3 v1" [ .5 0 0 ] "vector3 v2" [ 0 .5 0 ] AttributeEnd'
        found = self.square(plane, 'Material "diffuse" "texture reflectance" "t"')[0]
        for (y, x), wanted in (((0, 0), (1, 0, 0)), ((0, 3), (0, 1, 0)), ((3, 0), (0, 0, 1)), ((3, 3), (1, 1, 1))):
            np.testing.assert_allclose(found[y, x], wanted, atol=1e-4)
        # Cubes of side 1, of which z = 0 + 0.5 cuts one.
        space = 'AttributeBegin Translate 0 0 -.5 Texture "t" "spectrum" "checkerboard" "integer dimension" 3 "rgb tex1" [ .8 .8 .8 ] "rgb tex2" [ .2 .2 .2 ] AttributeEnd'
        found = self.square(space, 'Material "diffuse" "texture reflectance" "t"')[0][:, :, 0]
        np.testing.assert_allclose([found[0, 0], found[0, 3], found[3, 0], found[3, 3]], [0.2, 0.8, 0.8, 0.2], atol=1e-5)

    def test_textures_are_placed_around_a_sphere_and_a_cylinder(self):
        # Red, green, blue and white by quarters of a turn: the picture's first row is v = 1.
        (self.folder / "turn.png").write_bytes(test_gltf.png(4, 1, [(255, 0, 0), (0, 255, 0), (0, 0, 255), (255, 255, 255)]))
        texture = 'Texture "t" "spectrum" "imagemap" "string filename" "turn.png" "string filter" "point" "string mapping" "cylindrical"'
        found = self.square(texture, 'Material "diffuse" "texture reflectance" "t"')[0]
        # u is (pi + atan2(y, x)) / 2 pi.
        for (y, x), wanted in (((0, 0), (1, 1, 1)), ((0, 3), (0, 0, 1)), ((3, 0), (1, 0, 0)), ((3, 3), (0, 1, 0))):
            np.testing.assert_allclose(found[y, x], wanted, atol=1e-4)
        # v is atan2(y, x) / 2 pi, within 0 to 1, and u the angle to z, here nearly a quarter turn: z is .01.
        (self.folder / "turn.png").write_bytes(test_gltf.png(1, 4, [(255, 255, 255), (0, 0, 255), (0, 255, 0), (255, 0, 0)]))
        found = self.square(texture.replace("cylindrical", "spherical"), 'Material "diffuse" "texture reflectance" "t"')[0]
        for (y, x), wanted in (((0, 3), (1, 0, 0)), ((0, 0), (0, 1, 0)), ((3, 0), (0, 0, 1)), ((3, 3), (1, 1, 1))):
            np.testing.assert_allclose(found[y, x], wanted, atol=1e-4)
        # 60 degrees between the normal and the direction: half of each.
        mix = 'AttributeBegin Rotate 60 0 1 0 Texture "t" "spectrum" "directionmix" "vector3 dir" [ 0 0 2 ] "rgb tex1" [ .8 0 0 ] "rgb tex2" [ 0 .8 0 ] AttributeEnd'
        np.testing.assert_allclose(self.square(mix, 'Material "diffuse" "texture reflectance" "t"')[0][1, 1], (0.4, 0.4, 0), atol=1e-5)

    def test_hair_has_the_colour_that_its_pigments_give(self):
        def colour(words):
            scene = self.write("hair.pbrt", f'Film "rgb"\nWorldBegin\nMaterial "hair" {words}\nShape "sphere"')
            self.assert_ends(lumicut("convert", scene, self.folder / "hair.json"), OK)
            return json.loads((self.folder / "hair.json").read_text())["materials"][-1]["diffuse"]
        # pbrt's own inversion: the absorption of a colour is (ln c / polynomial)².
        wanted = np.array([0.8, 0.5, 0.2])
        per_root = 5.969 - 0.215 * 0.3 + 2.532 * 0.3 ** 2 - 10.73 * 0.3 ** 3 + 5.574 * 0.3 ** 4 + 0.245 * 0.3 ** 5
        sigma = (np.log(wanted) / per_root) ** 2
        np.testing.assert_allclose(colour(f'"rgb sigma_a" [ {" ".join(map(str, sigma))} ]'), wanted, rtol=1e-5)
        np.testing.assert_allclose(colour('"rgb reflectance" [ .8 .5 .2 ]'), wanted, rtol=1e-6)
        np.testing.assert_allclose(colour(""), np.exp(-per_root * np.sqrt(1.3 * np.array([0.419, 0.697, 1.37]))), rtol=1e-5)
        np.testing.assert_allclose(colour('"float pheomelanin" 2'), np.exp(-per_root * np.sqrt(2 * np.array([0.187, 0.4, 1.05]))), rtol=1e-5)

    def test_goniometric_lights_shine_by_their_picture(self):
        # The middle of the square lies along the light's y, its corners opposite; x and y of the square are x and z.
        pixels = np.zeros((32, 32, 3), np.float32)
        pixels[10:22, 10:22] = 3
        pixels[8:24, 26:] = 5
        pixels[:6, 8:24] = 7
        self.write_exr("lamp.exr", pixels)
        light = 'AttributeBegin Translate 0 2 0 {} LightSource "goniometric" "rgb I" [ 8 4 2 ] "string filename" "lamp.exr" {} AttributeEnd'.format
        for turn, value in (("Rotate 180 1 0 0", 3), ("", 0), ("Rotate -90 0 0 1", 5), ("Rotate 90 0 0 1", 0), ("Rotate -90 0 0 1 Scale 1 1 -1", 5),
                            ("Rotate 90 1 0 0", 0), ("Rotate -90 1 0 0", 7), ("Rotate 90 1 0 0 Scale 1 1 -1", 7), ("Rotate -90 1 0 0 Scale 1 1 -1", 0)):
            with self.subTest(turn):
                np.testing.assert_allclose(self.lamp(self.floor(light(turn, ""))), 0.5 / math.pi * value * np.array([8, 4, 2]) / 4, rtol=5e-3)
        power = self.lamp(self.floor(light("Rotate 180 1 0 0", '"float power" 50').replace("8 4 2", "1 1 1")))
        np.testing.assert_allclose(power, 0.5 / math.pi * 3 * 50 / (4 * math.pi * pixels.mean()) / 4, rtol=5e-3)

    def test_pictures_of_area_lights_have_the_power_that_is_asked_for(self):
        pixels = np.full((8, 8, 3), 0.25, np.float32)
        pixels[:4] = (0.5, 1, 0)
        self.write_exr("lamp.exr", pixels)
        scene = self.write("lamp.pbrt", 'Film "rgb"\nWorldBegin\nAreaLightSource "diffuse" "string filename" "lamp.exr" "float power" 10\n'
                           'Shape "bilinearmesh" "point3 P" [ 0 0 0 2 0 0 0 1 0 2 1 0 ]')
        self.assert_ends(lumicut("convert", scene, self.folder / "lamp.json"), OK)
        emission = json.loads((self.folder / "lamp.json").read_text())["materials"][-1]["emission"]
        mean = pixels.mean(axis=(0, 1)) @ (0.2126, 0.7152, 0.0722)
        np.testing.assert_allclose(np.array(emission) * mean * 2 * math.pi, 10, rtol=1e-4)

    def test_coats_of_textured_roughness_have_its_mean(self):
        (self.folder / "grey.png").write_bytes(test_gltf.png(2, 1, [(51, 51, 51), (153, 153, 153)]))
        scene = self.write("coat.pbrt", 'Film "rgb"\nWorldBegin\nTexture "t" "float" "imagemap" "string encoding" "linear" "float scale" .5 "string filename" "grey.png"\n'
                           'Material "coatedconductor" "texture interface.roughness" "t" "bool remaproughness" false\nShape "sphere"')
        done = lumicut("convert", scene, self.folder / "coat.json")
        self.assert_ends(done, OK)
        self.assertIn("textures of interface.roughness are their mean", done.stderr)
        self.assertAlmostEqual(json.loads((self.folder / "coat.json").read_text())["materials"][-1]["coat_roughness"], math.sqrt(0.2), places=4)

    def test_equal_disks_and_cylinders_are_one_mesh(self):
        parts = "".join(f'AttributeBegin Translate {x} 0 0 Shape "disk" Shape "cylinder" Shape "sphere" "float zmax" .5 AttributeEnd\n' for x in range(50))
        group = f'ObjectBegin "all" {parts} ObjectEnd AttributeBegin Translate 0 9 0 ObjectInstance "all" AttributeEnd\n'
        scene = self.write("many.pbrt", f'Film "rgb"\nWorldBegin\n{parts}{group}Shape "disk" "float radius" 2')
        counts = json.loads(lumicut("check", "--no-forecast", "--json", scene).stdout)["counts"]
        self.assertEqual((counts["meshes"], counts["instances"]), (4, 301))

    def test_bumps_of_computed_heights_take_their_slopes_over_the_librarys_own_width(self):
        """Over the first step's value, such as u, bricks were flat."""
        path = self.write("bumps.pbrt", HEAD + 'Camera "perspective"\nWorldBegin\n'
                          'Texture "t" "float" "checkerboard" "float uscale" 8 "float vscale" 8 "float tex1" .1 "float tex2" 0\n'
                          'Material "diffuse" "texture displacement" "t"\nShape "sphere"\n')
        done = lumicut("convert", path, self.folder / "bumps.json")
        self.assertEqual(done.returncode, OK, done.stderr)
        programs = json.loads((self.folder / "bumps.json").read_text())["programs"]
        bumps = [step for program in programs for step in program["steps"] if step["op"] == "bump"]
        self.assertEqual([step["inputs"][4] for step in bumps], [[0, 0, 0]])

    def test_textures_of_numbers_and_of_colours_may_share_a_name(self):
        found = self.square('Texture "t" "spectrum" "constant" "rgb value" [ .3 .4 .5 ] Texture "t" "float" "constant" "float value" .25',
                            'Texture "both" "spectrum" "scale" "texture tex" "t" "texture scale" "t"', 'Material "diffuse" "texture reflectance" "both"')[0]
        np.testing.assert_allclose(found[1, 1], np.array([0.3, 0.4, 0.5]) * 0.25, rtol=1e-5)

    def test_displacement_bends_the_normal_as_the_height_falls(self):
        # The height rises by 1.5 over a width of 2; light comes straight.
        ramp = ('Texture "ramp" "float" "bilerp" "float v00" 0 "float v01" 0 "float v10" 1 "float v11" 1\n'
                'Texture "height" "float" "scale" "texture tex" "ramp" "float scale" 1.5')
        found = self.square(ramp, 'Material "diffuse" "rgb reflectance" [ .5 .5 .5 ] "texture displacement" "height"', layers="radiance")[0]
        np.testing.assert_allclose(found[1:3, 1:3], 0.5 / math.pi / math.hypot(1, 0.75), rtol=5e-3)

    def test_mixes_have_their_parts_by_their_amounts(self):
        parts = ('MakeNamedMaterial "a" "string type" "diffuse" "rgb reflectance" [ .8 .4 0 ]\nMakeNamedMaterial "b" "string type" "diffuse" "rgb reflectance" [ 0 .4 .8 ]\n'
                 'MakeNamedMaterial "none" "string type" "interface"\nTexture "half" "float" "checkerboard" "float tex1" 1 "float tex2" 0 "float uscale" 2 "float vscale" 2\n')
        a, b = np.array([0.8, 0.4, 0]), np.array([0, 0.4, 0.8])
        found, said = self.square(parts, 'Material "mix" "string materials" [ "a" "b" ] "float amount" .25')
        np.testing.assert_allclose(found[1, 1], 0.75 * a + 0.25 * b, rtol=1e-5)
        self.assertNotIn("warning", said)
        found = self.square(parts, 'Material "mix" "string materials" [ "a" "b" ] "texture amount" "half"')[0]
        np.testing.assert_allclose(found[3, 0], b, atol=1e-5)
        np.testing.assert_allclose(found[0, 0], a, atol=1e-5)
        # Three quarters are not there: what is seen is a quarter of the light.
        found, said = self.square(parts, 'Material "mix" "string materials" [ "a" "none" ] "float amount" .75', layers="radiance", size=64)
        np.testing.assert_allclose(found.mean(axis=(0, 1)), 0.25 * a / math.pi, atol=0.02)
        self.assertNotIn("warning", said)
        # A mix of a mix; with a coated one the share of the coat; with metal both beside each other.
        for more, told in (('"string type" "mix" "string materials" [ "a" "b" ]', None), ('"string type" "coateddiffuse" "rgb reflectance" [ 0 .4 .8 ]', None),
                           ('"string type" "conductor" "rgb reflectance" [ .9 .6 .3 ] "float roughness" .5', "reflects alike at all angles"),
                           ('"string type" "dielectric"', "has one colour")):
            self.assert_ends(lumicut("convert", self.write("mix.pbrt", f'Film "rgb"\nWorldBegin {parts}MakeNamedMaterial "c" {more}\n'
                                                           'Material "mix" "string materials" [ "a" "c" ] "float amount" .5 Shape "sphere"'), self.folder / "mix.json"), OK, told or "")
            material = json.loads((self.folder / "mix.json").read_text())["materials"][-1]
            if "conductor" in more:
                np.testing.assert_allclose(material["diffuse"], a / 2, atol=1e-6)
                np.testing.assert_allclose(material["specular"], [0.45, 0.3, 0.15], atol=1e-6)
            elif "dielectric" in more:
                self.assertAlmostEqual(material["transmission"], 0.5)
            else:
                below_coat = b * (1 - kept_inside(1.5)) / (1 - b * kept_inside(1.5))
                np.testing.assert_allclose(material["diffuse"], 0.75 * a + 0.25 * b if "mix" in more else (a + below_coat) / 2, atol=1e-4)
                if "coated" in more:
                    np.testing.assert_allclose(material["specular"], [0.5] * 3)

    def test_media_that_glass_holds_absorb(self):
        text = ('Film "rgb"\nWorldBegin MakeNamedMedium "ruby" "string type" "homogeneous" "rgb sigma_a" [ .1 .2 .3 ] "rgb sigma_s" [ {} ] "float scale" 2\n'
                'MediumInterface "ruby" "" Material "{}" Shape "sphere"').format
        for words, said in (("0 0 0", ""), ("0 1 0", "scattering inside of glass: left out")):
            done = lumicut("convert", self.write("m.pbrt", text(words, "dielectric")), self.folder / "m.json")
            self.assert_ends(done, OK, said)
            self.assertEqual("left out" in done.stderr, bool(said))
            np.testing.assert_allclose(json.loads((self.folder / "m.json").read_text())["materials"][-1]["absorption"], (0.2, 0.4, 0.6), rtol=1e-6)
        self.assert_ends(lumicut("convert", self.write("m.pbrt", text("0 0 0", "diffuse")), self.folder / "m.json"), OK, "media: left out")

    def positions(self, shape):
        """Vertices and triangles of a shape, as convert writes them."""
        self.assert_ends(lumicut("convert", self.write("shape.pbrt", f'Film "rgb"\nWorldBegin {shape}'), self.folder / "shape.json"), OK)
        mesh = json.loads((self.folder / "shape.json").read_text())["meshes"][0]

        def numbers(key, kind):
            part = mesh[key]
            return np.array(part) if isinstance(part, list) else np.fromfile(self.folder / part["file"], kind, 3 * part["count"], offset=part.get("offset", 0))
        return numbers("positions", np.float32).reshape(-1, 3), numbers("triangles", np.uint32).reshape(-1, 3)

    def test_subdivision_surfaces_go_through_the_limits_of_their_corners(self):
        octahedron = ('Shape "loopsubdiv" "integer levels" {} "point3 P" [ 1 0 0 -1 0 0 0 1 0 0 -1 0 0 0 1 0 0 -1 ] '
                      '"integer indices" [ 0 2 4 2 1 4 1 3 4 3 0 4 2 0 5 1 2 5 3 1 5 0 3 5 ]').format
        for levels in (0, 1, 4):
            vertices, triangles = self.positions(octahedron(levels))
            self.assertEqual(len(triangles), 8 * 4 ** levels)
            # Four neighbours: the limit has 1 - 4/8 of the corner, and their sum, which is 0.
            np.testing.assert_allclose(np.abs(vertices).max(), 0.5 if levels == 0 else vertices[0, 0], rtol=1e-6)
            np.testing.assert_allclose(vertices[0], (0.5, 0, 0), atol=1e-6)
        # The edge of a square is a cubic spline: 4/6 of the corner and 1/6 of each neighbour.
        vertices, _ = self.positions('Shape "loopsubdiv" "integer levels" 3 "point3 P" [ 0 0 0 6 0 0 6 6 0 0 6 0 ] "integer indices" [ 0 1 2 0 2 3 ]')
        np.testing.assert_allclose(vertices[0], (1, 1, 0), atol=1e-5)

    def test_parts_of_spheres_have_their_area(self):
        vertices, triangles = self.positions('Shape "sphere" "float radius" 1 "float zmin" -.5 "float zmax" .75 "float phimax" 120')
        p = vertices[triangles]
        area = np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1).sum() / 2
        self.assertAlmostEqual(area, 2 * math.pi * 1.25 / 3, delta=0.005 * area)
        self.assertAlmostEqual(vertices[:, 2].min(), -0.5, delta=1e-5)
        self.assertAlmostEqual(vertices[:, 2].max(), 0.75, delta=1e-5)

    def test_curves_go_where_their_splines_do(self):
        def rings(words):
            vertices, triangles = self.positions(f'Shape "curve" {words}')
            self.assertEqual(len(triangles), 24 * (len(vertices) // 12 - 1))
            rings = vertices.reshape(-1, 12, 3)
            middles = rings.mean(axis=1)
            return middles, np.linalg.norm(rings - middles[:, None], axis=2)
        wider = math.pi / (12 * math.sin(math.pi / 12))
        middles, radii = rings('"integer degree" 2 "float width0" .2 "float width1" .1 "point3 P" [ 0 0 0  1 2 0  2 0 0 ]')
        t = middles[:, 0] / 2
        np.testing.assert_allclose(middles[:, 1], 4 * t * (1 - t), atol=1e-5)
        np.testing.assert_allclose(radii, np.tile((0.1 - 0.05 * t)[:, None] * wider, 12), rtol=1e-5)
        # Chords lie within a quarter of the radius.
        chord = np.linspace(middles[:-1], middles[1:], 9)[1:-1]
        self.assertLess(np.abs(chord[:, :, 1] - chord[:, :, 0] * (2 - chord[:, :, 0])).max(), 0.25 * 0.1)
        cubic, _ = rings('"float width" .01 "point3 P" [ 0 0 0  0 0 3  3 3 3  3 3 0  3 3 -3  6 0 0  6 0 3 ]')
        np.testing.assert_allclose(cubic[[0, -1]], [(0, 0, 0), (6, 0, 3)], atol=1e-6)
        self.assertLess(np.linalg.norm(cubic - (3, 3, 0), axis=1).min(), 1e-5)
        # Evenly placed points of a spline are a straight line between the second and the last but one.
        for degree, ends in ((3, (1, 4)), (2, (0.5, 4.5))):
            line, _ = rings(f'"string basis" "bspline" "integer degree" {degree} "point3 P" [ 0 0 0 1 0 0 2 0 0 3 0 0 4 0 0 5 0 0 ]')
            np.testing.assert_allclose(line[[0, -1], 0], ends, atol=1e-6)

    def test_curves_cover_their_width(self):
        rng = np.random.default_rng(3)
        words, covered = ['LightSource "infinite" "rgb L" [ 1 1 1 ]', 'Material "diffuse" "rgb reflectance" [ 0 0 0 ]', "Scale .5 .5 .5"], 0
        for x in range(8):
            for y in range(8):
                angle = rng.uniform(0, math.pi)
                half = 0.2 * np.array([math.cos(angle), math.sin(angle), 0])
                middle = np.array([x - 3.5, y - 3.5, 0]) / 2
                points = [middle + half * k for k in (-1, -1 / 3, 1 / 3, 1)]
                words.append(f'Shape "curve" "string type" "cylinder" "float width0" .03 "float width1" .01 "point3 P" [ {" ".join(str(c) for p in points for c in p)} ]')
                covered += 0.02 * 0.4
        film = HEAD.replace("48", "128").replace("36", "128") + "Scale -1 1 1 " + look((0, 0, 3), (0, 0, 0)) + 'Camera "orthographic"\nWorldBegin\n'
        found = self.render(self.write("strands.pbrt", film + "\n".join(words)), "--vpls", 10, "--spp", 64)[0].mean()
        # Half size, of 2 by 2. A prism of twelve sides is up to .023 narrower and .012 wider than on the average.
        self.assertAlmostEqual((1 - found) / (covered / 16), 1, delta=0.025)
        ribbon = ('LightSource "infinite" "rgb L" [ 1 1 1 ] Material "diffuse" "rgb reflectance" [ 0 0 0 ] Shape "curve" "string type" "ribbon" "normal N" [ {0} {0} ] '
                  '"float width" .5 "point3 P" [ -.5 0 0 -.2 0 0 .2 0 0 .5 0 0 ]').format
        for normal, share in (("0 0 1", 0.125), ("0 1 1", 0.125 / math.sqrt(2)), ("0 1 0", 0)):
            found = self.render(self.write("ribbon.pbrt", film + ribbon(normal)), "--vpls", 10, "--spp", 16)[0].mean()
            self.assertAlmostEqual(1 - found, share, delta=2e-3)

    def test_curves_that_cannot_be_are_named(self):
        curve = 'Shape "curve" {} "point3 P" [ 0 0 0 0 1 0 0 2 0 0 3 0 ]'.format
        for words, text in (('"string type" "tube"', "the type tube"), ('"float width" 1e39', "the widths 1e+39"), ('"float width" -1', "the widths -1"),
                            ('"string type" "ribbon"', "has 0 numbers in N, not 6"), ('"string basis" "hermite"', "the basis")):
            self.assert_ends(lumicut("render", self.write("bad.pbrt", 'Film "rgb"\nWorldBegin\n' + curve(words)), "-o", self.folder / "x.exr"), BAD_FILE, text)
        for nothing in (curve('"float width" 0'), 'Shape "curve" "point3 P" [ 1 1 1 1 1 1 1 1 1 1 1 1 ]'):
            _, said = self.render(self.floor(nothing), "--vpls", 10)
            self.assertIn("curves without length or width: left out", said)

    def test_much_hair_is_one_mesh(self):
        strand = 'Shape "curve" "float width" .01 "point3 P" [ {0} 0 0  {0} 1 0  {0} 2 0  {0} 3 0 ]\n'.format
        head = 'Film "rgb"\nWorldBegin\nMaterial "hair" "float eumelanin" {}\n'.format
        path = self.write("hair.pbrt", head(1) + "".join(map(strand, range(12000))) + 'Material "hair" "float eumelanin" 2\n' + strand(-1))
        self.assert_ends(lumicut("convert", path, self.folder / "hair.json"), OK)
        scene = json.loads((self.folder / "hair.json").read_text())
        self.assertEqual([mesh["triangles"]["count"] if isinstance(mesh["triangles"], dict) else len(mesh["triangles"]) // 3 for mesh in scene["meshes"]], [12000 * 6, 24])

    def test_meshes_and_scenes_may_be_packed(self):
        ply = ("ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\n"
               "property list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n").encode()
        (self.folder / "a.ply.gz").write_bytes(gzip.compress(ply))
        (self.folder / "part.pbrt.gz").write_bytes(gzip.compress(b'Shape "plymesh" "string filename" "a.ply.gz"'))
        (self.folder / "whole.pbrt.gz").write_bytes(gzip.compress(b'Film "rgb"\nWorldBegin Include "part.pbrt.gz"'))
        self.assert_ends(lumicut("convert", self.folder / "whole.pbrt.gz", self.folder / "whole.json"), OK)
        vertices, triangles = self.positions('Include "part.pbrt.gz"')
        np.testing.assert_allclose(np.sort(vertices, axis=0), np.sort([[0, 0, 0], [1, 0, 0], [0, 1, 0]], axis=0))
        for broken in (gzip.compress(ply)[:-20], gzip.compress(b"ply\nnonsense"), b"\x1f\x8b\x08nonsense", gzip.compress(bytes(1 << 28))):
            (self.folder / "a.ply.gz").write_bytes(broken)
            self.assert_ends(lumicut("render", self.folder / "shape.pbrt", "-o", self.folder / "x.exr"), BAD_FILE, "a.ply.gz")

    def test_what_is_not_supported_is_named(self):
        _, said = self.render(self.floor('LightSource "projection"\nLightSource "point" "float shininess" 3\nMakeNamedMedium "fog" "string type" "cloud"\nMediumInterface "fog" ""\n'
                                         'Material "measured" "string filename" "a.bsdf"\nShape "nurbs"\n'
                                         'Texture "t" "float" "fbm"\nMaterial "coateddiffuse" "float albedo" .5\nShape "sphere" "float wide" 1'), "--vpls", 10)
        for text in ("lights of the kind projection: left out", "media: left out", "kind measured is diffuse", "shapes of the kind nurbs: left out",
                     "kind fbm is grey", '"albedo" of materials of the kind coateddiffuse: left out', '"shininess" of lights of the kind point: left out',
                     '"wide" of shapes of the kind sphere: left out'):
            self.assertIn(text, said)

    def test_values_of_materials_out_of_range_are_cut_and_told(self):
        hair = 'Material "hair" {}'
        for words, said in (('Material "diffuse" "rgb reflectance" [ .5 5 .5 ]', 'line 6: material "diffuse": reflectance is 5, not 0 to 1; 1 is taken'),
                            ('Material "diffuse" "rgb reflectance" [ .5 -5 .5 ]', "reflectance is -5, not 0 to 1; 0 is taken"),
                            ('MakeNamedMaterial "red" "string type" "coateddiffuse" "float roughness" 3', 'material "red": roughness is 3'),
                            ('Material "dielectric" "float eta" 0', "eta is 0"), ('Material "conductor" "rgb k" [ -1 1 1 ]', "k is -1"),
                            ('Material "diffusetransmission" "float scale" 9', "scale times reflectance is 2.25"),
                            ('Texture "t" "spectrum" "scale" "float scale" -2 "texture tex" "u" Material "diffuse" "texture reflectance" "t"', "a factor of a texture is -2"),
                            (hair.format('"float eumelanin" -1'), "eumelanin is -1"), (hair.format('"rgb sigma_a" [ 1 1 -1 ]'), "sigma_a is -1"),
                            (hair.format('"float beta_n" 9'), "beta_n is 9"), (hair.format('"rgb reflectance" [ 2 2 2 ]'), "reflectance is 2"),
                            ('LightSource "distant" "float illuminance" -3', "illuminance is -3, which counts for nothing"),
                            ('Shape "sphere" "float alpha" 3', "alpha is 3"), ('Shape "disk" "float innerradius" 3', "innerradius is 3, not 0 to 1"), ('Shape "sphere" "float phimax" -9', "phimax is -9"),
                            ('AttributeBegin AreaLightSource "diffuse" "float power" -3 Shape "sphere" AttributeEnd', "power is -3, which counts for nothing"),
                            ('Shape "sphere" "float zmin" .5 "float zmax" .5', "which has no triangles: left out"), ('LightSource "distant" "rgb L" [ 1 1 1 ] "float scale" 1 "float scale" 2', "is given twice")):
            with self.subTest(words):
                _, said_here = self.render(self.floor('Texture "u" "spectrum" "checkerboard"\n' + words, ""), "--vpls", 10)
                self.assertIn(said, said_here)
        many = self.floor("\n".join('Material "diffuse" "float reflectance" 2' for _ in range(30)), "")
        said = self.render(many, "--vpls", 10)[1]
        self.assertEqual(said.count("reflectance is 2"), 10)
        self.assertIn("20 more values out of range", said)

    def test_a_light_without_its_picture_is_left_out(self):
        (self.folder / "d.exr").mkdir()
        self.write_exr("black.exr", np.zeros((8, 8, 3), np.float32))
        for name, said in (("no.exr", "no.exr does not exist; the light is left out"), ("d.exr", "d.exr is a folder; the light is left out"), ("black.exr", "picture is black: left out")):
            _, said_here = self.render(self.floor(f'LightSource "goniometric" "string filename" "{name}"'), "--vpls", 10)
            self.assertIn(said, said_here)
            self.assertNotIn("grey", said_here)

    def test_wrong_files_are_refused_with_file_and_line(self):
        good = self.floor("LightSource \"point\"").read_text()
        self.write("loop.pbrt", 'Include "loop.pbrt"')
        for k in range(30):
            self.write(f"twice{k}.pbrt", f'Include "twice{k + 1}.pbrt" Include "twice{k + 1}.pbrt"')
        self.write("twice30.pbrt", "")
        self.write("short.pbrt", "# nothing\n\n\n")
        self.write("open.pbrt", "\nTranslate 1 x")
        (self.folder / "folder.pbrt").mkdir()
        self.write_exr("bright.exr", np.full((8, 8, 3), 1e38, np.float32))
        self.write_exr("strong.exr", np.full((8, 8, 3), 1e18, np.float32))
        os.mkfifo(self.folder / "pipe.pbrt")
        for change, texts in ((("WorldBegin", "WorldBegn"), ("line 4", "WorldBegn")), (("0 1 2 0 2 3", "0 1 2 0 2 9"), ("9", "4 vertices")),
                              (("fov\" 1", "fov\" x"), ("line 3", "\"x\"")), (("LookAt 0 4 0.001", "LookAt 0 0 0"), ("its own place",)),
                              (("WorldBegin", 'WorldBegin Include "loop.pbrt"'), ("loop.pbrt: line 1", "loop.pbrt includes itself")),
                              (("WorldBegin", 'WorldBegin Include "twice0.pbrt"'), ("without end",)),
                              (("WorldBegin", 'WorldBegin Include "pipe.pbrt"'), ("pipe.pbrt",)), (("WorldBegin", 'WorldBegin Include "none.pbrt"'), ("none.pbrt",)),
                              (("WorldBegin", "WorldBegin AttributeEnd"), ("AttributeEnd",)), (("WorldBegin", "WorldBegin AttributeBegin"), ("AttributeBegin of line 4", "no end")),
                              (("WorldBegin", 'WorldBegin ObjectBegin "a"'), ("ObjectBegin of line 4", "no end")),
                              (("WorldBegin", 'WorldBegin ObjectBegin "a" AttributeBegin ObjectEnd'), ("ObjectEnd where the AttributeBegin of line 4",)),
                              (("WorldBegin", 'WorldBegin Include ""'), ("line 4", "name of the file is empty")),
                              (("WorldBegin", 'WorldBegin Include "folder.pbrt"'), ("line 4", "folder.pbrt is a folder")),
                              (("WorldBegin", 'WorldBegin Include "short.pbrt"\nWorldBegn'), ("bad.pbrt: line 5", "WorldBegn")),
                              (("WorldBegin", 'WorldBegin Include "open.pbrt"'), ("open.pbrt: line 2", "finite number")),
                              (("WorldBegin", 'WorldBegin LightSource "infinite" "rgb L" [ -1 0 0 ]'), ("line 4", "colour of -1")),
                              (("WorldBegin", 'WorldBegin AttributeBegin AreaLightSource "diffuse" "rgb L" [ -1 0 0 ] Shape "sphere" AttributeEnd'), ("line 4", "colour of -1")),
                              (("WorldBegin", 'WorldBegin LightSource "goniometric" "string filename" "strong.exr"'), ("line 4", "strong.exr", "1e+18")),
                              (("WorldBegin", "WorldBegin Rotate 9 0 0 0"), ("line 4", "no axis")), (("WorldBegin", 'WorldBegin Texture "t" "colour" "constant"'), ("line 4", '"colour"')),
                              (("\"float fov\" 1", '"float lensradius" -1'), ("lensradius is -1",)), (("\"float fov\" 1", '"float lensradius" 1 "float focaldistance" 0'), ("focaldistance is 0",)),
                              (("\"float fov\" 1", '"float screenwindow" [ 1 2 ]'), ("line 3", "2 numbers instead of 4")), (("\"float fov\" 1", '"float frameaspectratio" 0'), ("frameaspectratio is 0",)),
                              (("WorldBegin", 'WorldBegin LightSource "distant" "point3 to" [ 0 0 0 ]'), ("line 4", "in no direction")),
                              (("WorldBegin", 'WorldBegin LightSource "point" "spectrum I" [ 400 1 500 -1 ]'), ("line 4", "-1 at 500 nm")),
                              (("WorldBegin", 'WorldBegin LightSource "point" "spectrum I" [ 400 1 500 ]'), ("line 4", "3 numbers, not pairs")),
                              (("WorldBegin", 'WorldBegin LightSource "infinite" "string filename" "bright.exr"'), ("bright.exr", "1e+38", "at most 1e20")),
                              (("WorldBegin", 'WorldBegin Shape "cylinder" "float radius" -1'), ("line 4", "radius of -1")),
                              *((("WorldBegin", f'WorldBegin Shape "curve" "point3 P" [ 0 0 0 1 1 1 2 2 2 3 3 3 ] {words}'), ("line 4", said)) for words, said in (
                                  ('"string width" "a"', "not a number"), ('"float width" [ 1 2 ]', "2 numbers instead of one"), ('"float type" 3', "not a text"),
                                  ('"integer degree" 2.5', "no whole number"), ('"point3 N" "a"', "no number"), ('"string N" 1', "no text in quotes"),
                                  ('"vector N" [ 1 2 ]', "multiple of 3"), ('"length width" 1', "of no type"))),
                              (("WorldBegin", 'WorldBegin ObjectInstance "a"'), ('"a"',)), (("\"float fov\" 1", "\"float fov\" ["), ("line 4", "WorldBegin", "finite number")),
                              (("WorldBegin", 'WorldBegin Shape "plymesh" "string filename" "no.ply"'), ("no.ply",)),
                              (("WorldBegin", 'WorldBegin Shape "curve" "point3 P" [ 0 0 0 1 1 1 ]'), ("line 4", "6 numbers in P")),
                              (("WorldBegin", 'WorldBegin Shape "curve" "integer degree" 7 "point3 P" [ 0 0 0 1 1 1 ]'), ("line 4", "degree 7")),
                              (("WorldBegin", 'WorldBegin Shape "curve" "string type" "ribbon" "point3 P" [ 0 0 0 1 1 1 2 2 2 3 3 3 ]'), ("1 segments", "in N"))):
            with self.subTest(change):
                self.assertIn(change[0], good)
                self.assert_ends(lumicut("render", self.write("bad.pbrt", good.replace(*change)), "-o", self.folder / "x.exr"), BAD_FILE, *texts)


if __name__ == "__main__":
    unittest.main()
