"""Mitsuba 3 scenes, which the test writes: against formulas, and against the same scene as JSON."""
import json
import math
import os
import struct
import subprocess
import unittest
import zlib

import numpy as np

import test_gltf
import test_models
from cli import BAD_FILE, COMMAND, OK, lumicut
from test_pbrt import SceneFiles, kept_inside


def scene(*parts):
    return '<scene version="3.0.0">\n' + "\n".join(parts) + "\n</scene>\n"


def camera(eye, at, fov=40, size=(48, 36), up="0, 1, 0", more=""):
    eye, at = (", ".join(map(str, v)) for v in (eye, at))
    return (f'<sensor type="perspective"><float name="fov" value="{fov}"/>{more}<transform name="to_world"><lookat origin="{eye}" target="{at}" '
            f'up="{up}"/></transform><film type="hdrfilm"><integer name="width" value="{size[0]}"/><integer name="height" value="{size[1]}"/></film></sensor>')


def rgb(name, *values):
    return f'<rgb name="{name}" value="{", ".join(map(str, values))}"/>'


def placed(*steps):
    return f'<transform name="to_world">{"".join(steps)}</transform>'


FLOOR = ('<shape type="rectangle">' + placed('<rotate x="1" angle="-90"/>') +
         '<bsdf type="diffuse"><rgb name="reflectance" value=".5"/></bsdf></shape>')


class Mitsuba(SceneFiles):
    def floor(self, *lights, eye=(0, 4, 0.001)):
        return self.write("floor.xml", scene(camera(eye, (0, 0, 0), 1, (8, 8)), FLOOR, *lights))

    def test_light_of_lamps_is_what_the_formulas_say(self):
        down = placed('<lookat origin="0, 2, 0" target="0, 0, 0" up="0, 0, 1"/>')
        for light, expected in (
                ('<emitter type="point"><point name="position" x="0" y="2" z="0"/>' + rgb("intensity", 8, 4, 2) + "</emitter>", np.array([8, 4, 2]) / 4),
                ('<emitter type="point"><rgb name="intensity" value="8"/>' + placed('<translate y="2"/>') + "</emitter>", np.full(3, 8 / 4)),
                ('<emitter type="spot"><spectrum name="intensity" value="6"/>' + down + "</emitter>", np.full(3, 6 / 4)),
                ('<emitter type="directional"><vector name="direction" value="0, -1, -1"/>' + rgb("irradiance", 3, 2, 1) + "</emitter>",
                 np.array([3, 2, 1]) / math.sqrt(2)),
                ('<emitter type="constant">' + rgb("radiance", 2, 1, 0.5) + "</emitter>", math.pi * np.array([2, 1, 0.5]))):
            with self.subTest(light):
                np.testing.assert_allclose(self.lamp(self.floor(light)), 0.5 / math.pi * expected, rtol=0.02 if "constant" in light else 2e-3)

    def test_the_spot_falls_off_linearly_in_the_angle(self):
        # At 25 degrees, half way between the beam's 20 and the cut at 30.
        target = f"{2 * math.tan(math.radians(25))}, 0, 0"
        light = ('<emitter type="spot"><float name="cutoff_angle" value="30"/><float name="beam_width" value="20"/><rgb name="intensity" value="1"/>' +
                 placed(f'<lookat origin="0, 2, 0" target="{target}" up="0, 0, 1"/>') + "</emitter>")
        np.testing.assert_allclose(self.lamp(self.floor(light)), 0.5 / math.pi * 0.5 / 4, rtol=3e-3)

    def test_area_lights_emit_on_the_side_of_their_normal(self):
        expected = 0.5 * 2 * 0.25 / 1.25  # rho L sin² of the disk's half angle
        for steps, more, lit in ((('<scale value=".5"/>', '<rotate x="1" angle="90"/>'), "", True), (('<scale value=".5"/>', '<rotate x="1" angle="-90"/>'), "", False),
                                 (('<scale value=".5"/>', '<rotate x="1" angle="-90"/>'), '<boolean name="flip_normals" value="true"/>', True),
                                 (('<scale x=".5" y="-.5" z=".5"/>', '<rotate x="1" angle="90"/>'), "", True)):
            with self.subTest(steps=steps, more=more):
                light = ('<shape type="disk">' + more + placed(*steps, '<translate y="1"/>') +
                         '<bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf><emitter type="area"><rgb name="radiance" value="2"/></emitter></shape>')
                np.testing.assert_allclose(self.lamp(self.floor(light, eye=(0, 0.5, 0.001))), expected if lit else 0, rtol=0.02)

    def test_the_sky_lies_as_its_axes_say(self):
        # The left edge of a picture lies towards -z, a quarter is +x, the middle +z; the top is y.
        for (x, y), seen in (((16, 8), (0, 0, 1)), ((8, 8), (1, 0, 0)), ((24, 8), (-1, 0, 0)), ((8, 0), (0, 1, 0))):
            pixels = np.zeros((16, 32, 3), np.float32)
            if y == 0:
                pixels[:2] = 1
            else:
                pixels[y - 2:y + 2, x - 2:x + 2] = 1
            self.write_exr("sky.exr", pixels)
            for turn, along in ((None, seen), ('<rotate y="1" angle="90"/>', (seen[2], seen[1], -seen[0]))):
                up = "0, 1, 0" if along[1] == 0 else "1, 0, 0"
                world = placed(turn) if turn else ""
                path = self.write("sky.xml", scene(
                    camera((0, 0, 0), along, 4, (5, 5), up), '<emitter type="envmap"><string name="filename" value="sky.exr"/>' + world + "</emitter>",
                    '<shape type="sphere"><point name="center" x="50" y="50" z="50"/></shape>'))
                # At the pole half a texel is mixed with the other one.
                self.assertGreater(self.render(path, "--vpls", 10)[0].mean(), 0.6, (seen, turn))

    def test_a_room_is_what_it_is_as_json(self):
        """Defaults, references, an include, a mesh of a file, a cube, an instance, textures, a two-sided material."""
        (self.folder / "dots.png").write_bytes(test_gltf.png(2, 2, [(255, 0, 0), (0, 255, 0), (0, 0, 255), (255, 255, 255)]))
        self.write("quad.obj", "v -3 0 3\nv 3 0 3\nv 3 0 -3\nv -3 0 -3\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n")
        self.write("parts.xml", scene('<bsdf type="twosided" id="red"><bsdf type="diffuse">' + rgb("reflectance", 0.7, 0.2, 0.1) + "</bsdf></bsdf>"))
        path = self.write("room.xml", scene(
            '<default name="light" value="40"/>', '<include filename="parts.xml"/>', camera((3, 4, 6), (0, 0.5, 0), more='<string name="fov_axis" value="y"/>'),
            '<emitter type="point"><point name="position" value="2, 5, 3"/><rgb name="intensity" value="$light"/></emitter>',
            '<shape type="obj"><string name="filename" value="quad.obj"/><bsdf type="diffuse"><texture name="reflectance" type="bitmap">'
            '<string name="filename" value="dots.png"/><string name="filter_type" value="nearest"/></texture></bsdf></shape>',
            '<shape type="cube">' + placed('<scale value=".5"/>', '<rotate y="1" angle="30"/>', '<translate x="-1" y=".5" z="1"/>') + '<ref id="red"/></shape>',
            '<shape type="shapegroup" id="group"><shape type="rectangle"><ref id="red"/></shape></shape>',
            '<shape type="instance"><ref id="group"/>' + placed('<translate x="1" y="1"/>') + "</shape>"))
        c, s = math.cos(math.radians(30)), math.sin(math.radians(30))
        corners = [(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]
        expected = self.write("room.json", {
            "image": {"size": [48, 36]}, "camera": {"eye": [3, 4, 6], "at": [0, 0.5, 0], "fov_y": 40},
            "lights": [{"type": "point", "position": [2, 5, 3], "value": 40}],
            "materials": [{"name": "dots", "diffuse_texture": {"file": "dots.png", "nearest": True}, "diffuse": [1, 1, 1]},
                          {"name": "red", "diffuse": [0.7, 0.2, 0.1]}],
            "meshes": [{"positions": [[-3, 0, 3], [3, 0, 3], [3, 0, -3], [-3, 0, -3]], "quads": [[0, 1, 2, 3]],
                        "uvs": [[0, 0], [1, 0], [1, 1], [0, 1]], "material": "dots"},
                       {"positions": [[c * x + s * z - 1, y + 0.5, -s * x + c * z + 1] for x, y, z in corners],
                        "quads": [list(f) for f in test_models.BOX[1]], "material": "red"},
                       {"positions": [[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0]], "quads": [[0, 1, 2, 3]], "material": "red"}]})
        self.assert_same(self.render(path, "--vpls", 500)[0], self.render(expected, "--vpls", 500)[0])

    def test_textures_of_rectangles_have_their_first_row_below(self):
        # v is 0 where y is -1, and pictures begin there.
        (self.folder / "four.png").write_bytes(test_gltf.png(2, 2, [(255, 0, 0), (0, 255, 0), (0, 0, 255), (255, 255, 255)]))
        path = self.write("flat.xml", scene(
            camera((0, 0, 3), (0, 0, 0), 30, (4, 4)), '<emitter type="constant"/>', '<shape type="rectangle"><bsdf type="diffuse"><texture name="reflectance" '
            'type="bitmap"><string name="filename" value="four.png"/><string name="filter_type" value="nearest"/></texture></bsdf></shape>'))
        albedo = self.render(path, "--vpls", 10, layers="albedo")[0]
        for (y, x), wanted in (((3, 0), (1, 0, 0)), ((3, 3), (0, 1, 0)), ((0, 0), (0, 0, 1)), ((0, 3), (1, 1, 1))):
            np.testing.assert_allclose(albedo[y, x], wanted, atol=1e-4)

    def test_materials_are_what_they_are_as_json(self):
        bsdf = '<bsdf type="{}">{}</bsdf>'.format
        ggx = '<string name="distribution" value="ggx"/><float name="alpha" value="{}"/>'.format
        for text, keys in (
                (bsdf("diffuse", rgb("reflectance", 0.2, 0.4, 0.6)), {"diffuse": [0.2, 0.4, 0.6]}),
                (bsdf("plastic", rgb("diffuse_reflectance", 0.2, 0.4, 0.6) + '<float name="int_ior" value="1.3"/><float name="ext_ior" value="1"/>'),
                 {"model": "ggx", "diffuse": [0.2, 0.4, 0.6], "roughness": 0, "ior": 1.3}),
                (bsdf("plastic", rgb("diffuse_reflectance", 0.2, 0.4, 0.6) + '<float name="int_ior" value="1.3"/><float name="ext_ior" value="1"/><boolean name="nonlinear" value="true"/>'),
                 {"model": "ggx", "diffuse": [c * (1 - kept_inside(1.3)) / (1 - c * kept_inside(1.3)) for c in (0.2, 0.4, 0.6)], "roughness": 0, "ior": 1.3}),
                (bsdf("roughplastic", ggx(0.25) + '<string name="int_ior" value="water"/><string name="ext_ior" value="vacuum"/>'),
                 {"model": "ggx", "diffuse": [0.5, 0.5, 0.5], "roughness": 0.5, "ior": 1.333}),
                (bsdf("roughconductor", ggx(0.25) + '<string name="material" value="none"/>' + rgb("specular_reflectance", 0.9, 0.6, 0.3)),
                 {"model": "ggx", "metallic": 1, "diffuse": [0.9, 0.6, 0.3], "roughness": 0.5}),
                (bsdf("dielectric", '<float name="int_ior" value="1.4"/><float name="ext_ior" value="1"/>'),
                 {"model": "ggx", "transmission": 1, "diffuse": [1, 1, 1], "roughness": 0, "ior": 1.4}),
                (bsdf("principled", rgb("base_color", 0.2, 0.4, 0.6) + '<float name="roughness" value=".3"/><float name="metallic" value=".4"/>'
                      '<float name="eta" value="1.4"/>'),
                 {"model": "ggx", "burley": True, "diffuse": [0.2, 0.4, 0.6], "roughness": 0.3, "metallic": 0.4, "ior": 1.4,
                  "coat_roughness": math.sqrt(0.1)}),
                (bsdf("mask", '<float name="opacity" value=".25"/>' + bsdf("diffuse", "")), {"diffuse": [0.5, 0.5, 0.5], "opacity": 0.25})):
            with self.subTest(text):
                path = self.write("ball.xml", scene(
                    camera((0, 0, 5), (0, 0, 0)), '<emitter type="directional"><vector name="direction" value="-1, -2, -3"/></emitter>', '<emitter type="constant">' + rgb("radiance", 0.1, 0.2, 0.3) + "</emitter>",
                    f'<shape type="sphere"><float name="radius" value="1.2"/>{text}</shape>'))
                self.assert_is_of_material(path, keys)

    def test_black_bodies_have_the_radiance_of_planck(self):
        # 2 h c² / wavelength^5 / (exp(h c / (wavelength k T)) - 1) under the curve of Y, a nanometre, over the curve's area.
        light = ('<emitter type="point"><point name="position" value="0, 2, 0"/><spectrum type="blackbody" name="intensity">'
                 '<float name="temperature" value="{}"/><float name="scale" value=".001"/></spectrum></emitter>')
        for kelvin in (3000, 5000):
            nm = np.arange(380, 780.0)
            y = (0.821 * np.exp(-0.5 * ((nm - 568.8) * np.where(nm < 568.8, 0.0213, 0.0247)) ** 2) +
                 0.286 * np.exp(-0.5 * ((nm - 530.9) * np.where(nm < 530.9, 0.0613, 0.0322)) ** 2))
            h, c, k = 6.62607015e-34, 2.99792458e8, 1.380649e-23
            planck = 1e-9 * 2 * h * c * c / (nm * 1e-9) ** 5 / np.expm1(h * c / (nm * 1e-9 * k * kelvin))
            luminance = self.lamp(self.floor(light.format(kelvin))) @ (0.2126, 0.7152, 0.0722)
            np.testing.assert_allclose(luminance, 0.5 / math.pi / 4 * 0.001 * (planck * y).sum() / y.sum(), rtol=0.01)

    def test_spectra_are_read_however_they_are_written(self):
        (self.folder / "red.spd").write_text("# nm, value\n400 .1\n600 .1\n\n650 .8\n700 .8\n")
        found = []
        for text in ('<spectrum name="reflectance" value="400:.1, 600:.1, 650:.8, 700:.8"/>', '<spectrum name="reflectance" filename="red.spd"/>',
                     '<spectrum name="reflectance" type="irregular"><string name="wavelengths" value="400, 600, 650, 700"/><string name="values" value=".1, .1, .8, .8"/></spectrum>',
                     '<spectrum name="reflectance" type="regular"><float name="wavelength_min" value="400"/><float name="wavelength_max" value="700"/>'
                     '<string name="values" value=".1, .1, .1, .1, .1, .8, .8"/></spectrum>'):
            found.append(self.albedo(f'<bsdf type="diffuse">{text}</bsdf>')[0][1, 1])
        self.assertGreater(found[0][0], 2 * found[0][2])
        for other in found[1:]:
            np.testing.assert_allclose(other, found[0], rtol=1e-4)
        even = self.albedo('<bsdf type="diffuse"><spectrum name="reflectance" value="300:.3, 900:.3"/></bsdf>')[0][1, 1]
        np.testing.assert_allclose(even, 0.3, rtol=1e-4)

    def albedo(self, bsdf, back=False, *more, layers="albedo"):
        """A square of 2 by 2 that fills the picture, seen from the front or from behind."""
        path = self.write("square.xml", scene(
            camera((0, 0, -3 if back else 3), (0, 0, 0), more="").replace('"perspective"', '"orthographic"').replace("48", "4").replace("36", "4").replace('<float name="fov" value="40"/>', ""),
            '<emitter type="directional"><vector name="direction" value="0, 0, -1"/></emitter>', f'<shape type="rectangle">{bsdf}</shape>', *more))
        return self.render(path, "--vpls", 10, layers=layers)

    def test_textures_turn_and_are_mirrored(self):
        (self.folder / "four.png").write_bytes(test_gltf.png(2, 2, [(255, 0, 0), (0, 255, 0), (0, 0, 255), (255, 255, 255)]))
        image = ('<bsdf type="diffuse"><texture name="reflectance" type="bitmap"><string name="filename" value="four.png"/>'
                 '<string name="filter_type" value="nearest"/>{}</texture></bsdf>').format
        plain = self.albedo(image(""))[0]
        turned = self.albedo(image('<transform name="to_uv"><translate x="-.5" y="-.5"/><rotate z="1" angle="90"/><translate x=".5" y=".5"/></transform>'))[0]
        # (u, v) looks up (1 - v, u): what was below on the right is now on the left.
        for (y, x), there in (((3, 0), (3, 3)), ((0, 0), (3, 0)), ((0, 3), (0, 0)), ((3, 3), (0, 3))):
            np.testing.assert_allclose(turned[y, x], plain[there], atol=1e-4)
        twice = '<transform name="to_uv"><scale value="2"/></transform>'
        mirrored = self.albedo(image(twice + '<string name="wrap_mode" value="mirror"/>'))[0]
        np.testing.assert_allclose(mirrored, mirrored[:, ::-1], atol=1e-4)
        np.testing.assert_allclose(mirrored, mirrored[::-1], atol=1e-4)
        self.assertGreater(np.abs(self.albedo(image(twice))[0] - mirrored).max(), 0.5)

    def test_blends_and_two_sides_have_both_of_their_bsdfs(self):
        one, two = ('<bsdf type="diffuse">' + rgb("reflectance", *c) + "</bsdf>" for c in ((0.8, 0.4, 0), (0, 0.4, 0.8)))
        a, b = np.array([0.8, 0.4, 0]), np.array([0, 0.4, 0.8])
        found, said = self.albedo(f'<bsdf type="blendbsdf"><float name="weight" value=".25"/>{one}{two}</bsdf>')
        np.testing.assert_allclose(found[1, 1], 0.75 * a + 0.25 * b, rtol=1e-5)
        self.assertNotIn("warning", said)
        for back, wanted in ((False, a), (True, b)):
            found, said = self.albedo(f'<bsdf type="twosided">{one}{two}</bsdf>', back)
            np.testing.assert_allclose(found[1, 1], wanted, atol=1e-5)
            self.assertNotIn("warning", said)

    def test_serialized_meshes_are_read_by_their_number(self):
        square = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]

        def packed(vertices, kind, flag, name):
            numbers = b"".join(struct.pack(f"<3{kind}", *v) for v in vertices)
            numbers += b"".join(struct.pack(f"<3{kind}", 0, 0, 1) for _ in vertices) + b"".join(struct.pack(f"<2{kind}", (x + 1) / 2, (y + 1) / 2) for x, y, _ in vertices)
            body = struct.pack("<I", flag | 3) + name + b"\0" + struct.pack("<QQ", len(vertices), 2) + numbers + struct.pack("<6I", 0, 1, 2, 0, 2, 3)
            return struct.pack("<HH", 0x041C, 4) + zlib.compress(body)
        first, second = packed([(2 * x, y, z) for x, y, z in square], "f", 0x1000, b"wide"), packed(square, "d", 0x2000, b"square")
        whole = first + second + struct.pack("<QQI", 0, len(first), 2)
        (self.folder / "two.serialized").write_bytes(whole)
        shape = '<shape type="serialized"><string name="filename" value="two.serialized"/><integer name="shape_index" value="{}"/><bsdf type="diffuse"/></shape>'.format
        for index, width in ((0, 4), (1, 2)):
            self.assert_ends(lumicut("convert", self.write("mesh.xml", scene(shape(index))), self.folder / "mesh.json"), OK)
            places = json.loads((self.folder / "mesh.json").read_text())["meshes"][0]["positions"]
            if isinstance(places, dict):
                places = np.fromfile(self.folder / places["file"], np.float32, 12, offset=places.get("offset", 0)).reshape(4, 3)
            self.assertEqual(np.ptp(np.array(places)[:, 0]), width)
        for broken, text in ((whole[:-1], "meshes"), (whole[:len(first) + 40] + whole[-20:], "two.serialized"), (b"abcd", "version"), (b"", "ends"), (whole, "number 7")):
            (self.folder / "two.serialized").write_bytes(broken)
            self.assert_ends(lumicut("render", self.write("mesh.xml", scene(shape(7 if broken is whole else 1))), "-o", self.folder / "x.exr"), BAD_FILE, text)

    def test_what_is_named_may_stand_before_its_name_and_lie_inside_of_others(self):
        self.write("shape.xml", scene('<shape type="rectangle"><ref id="above"/></shape>'))
        camera_above = camera((0, 0, 3), (0, 0, 0), 20, (4, 4))
        path = self.write("first.xml", scene(
            '<include filename="shape.xml"/>', camera_above, '<emitter type="constant"/>', '<bsdf type="twosided" id="above"><ref id="within"/></bsdf>',
            '<shape type="sphere"><point name="center" value="9, 9, 9"/><bsdf type="diffuse" id="within">' + rgb("reflectance", 0.1, 0.2, 0.3) + "</bsdf></shape>"))
        np.testing.assert_allclose(self.render(path, "--vpls", 10, layers="albedo")[0][1, 1], (0.1, 0.2, 0.3), rtol=1e-5)
        self.assert_ends(lumicut("render", self.write("loop.xml", scene('<shape type="sphere"><bsdf type="twosided" id="a"><ref id="a"/></bsdf></shape>')),
                                 "-o", self.folder / "x.exr"), BAD_FILE, "without end")

    def test_media_that_glass_holds_absorb(self):
        ball = ('<shape type="sphere"><bsdf type="{}"/><medium type="homogeneous" name="interior"><rgb name="sigma_t" value=".1, .2, .3"/>'
                '<float name="albedo" value="0"/><float name="scale" value="2"/></medium></shape>').format
        done = lumicut("convert", self.write("m.xml", scene(ball("dielectric"))), self.folder / "m.json")
        self.assert_ends(done, OK)
        self.assertNotIn("left out", done.stderr)
        np.testing.assert_allclose(json.loads((self.folder / "m.json").read_text())["materials"][-1]["absorption"], (0.2, 0.4, 0.6), rtol=1e-6)
        self.assert_ends(lumicut("convert", self.write("m.xml", scene(ball("diffuse"))), self.folder / "m.json"), OK, "media: left out")

    def test_scenes_of_before_version_2_are_read_as_they_are_now(self):
        now = scene(camera((0, 3, 5), (0, 0, 0)), '<emitter type="constant"/>',
                    '<shape type="rectangle">' + placed('<rotate x="1" angle="-90"/>') + '<bsdf type="roughplastic"><texture name="diffuse_reflectance" type="checkerboard">'
                    '<rgb name="color0" value=".7"/><rgb name="color1" value=".1"/><transform name="to_uv"><scale x="3" y="2"/><translate x="0.25" y="0"/></transform></texture>'
                    '<float name="int_ior" value="1.3"/><float name="alpha" value=".2"/></bsdf></shape>')
        before = now.replace("3.0.0", "0.5.0").replace("to_world", "toWorld").replace("lookat", "lookAt").replace("diffuse_reflectance", "diffuseReflectance").replace("int_ior", "intIOR").replace(
            '<transform name="to_uv"><scale x="3" y="2"/><translate x="0.25" y="0"/></transform>',
            '<float name="uscale" value="3"/><float name="vscale" value="2"/><float name="uoffset" value="0.25"/>')
        wanted, _ = self.render(self.write("now.xml", now), "--vpls", 200)
        found, said = self.render(self.write("before.xml", before), "--vpls", 200)
        np.testing.assert_array_equal(found, wanted)
        self.assertNotIn("left out", said)

    def test_hidden_emitters_light_and_are_not_seen(self):
        lamp = ('<shape type="disk">' + placed('<scale value=".5"/>', '<rotate x="1" angle="90"/>', '<translate y="1"/>') +
                '<bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf><emitter type="area"><rgb name="radiance" value="2"/></emitter></shape>')
        path = self.write("hidden.xml", scene('<integrator type="aov"><integrator type="path"><boolean name="hide_emitters" value="true"/></integrator></integrator>',
                                              camera((0, 4, 0.001), (0, 0, 0), 60, (9, 9)), FLOOR, lamp, '<emitter type="constant"><rgb name="radiance" value=".001"/></emitter>'))
        found = self.render(path, "--vpls", 2000, "-p", "clamp_lights=0")[0]
        np.testing.assert_allclose(found[4, 4], 0.5 * 2 * 0.25 / 1.25, rtol=0.03)  # through the lamp, on the floor
        self.assertEqual(found[0, 0].max(), 0)  # beside the floor

    def test_curves_are_moved_and_keep_their_radii(self):
        # Two curves: one of evenly placed points, one that is straight after its middle.
        self.write("curves.txt", "0 0 0 .1\n1 0 0 .1\n2 0 0 .1\r\n3 0 0 .1\n\n\n0 0 5 .2\n0 0 6 .2\n0 0 7 .2\n0 0 8 .2\n0 0 9 .2\n")
        for kind, ends in (("bsplinecurve", ((1, 2), (6, 8))), ("linearcurve", ((0, 3), (5, 9)))):
            path = self.write("curves.xml", scene(f'<shape type="{kind}"><string name="filename" value="curves.txt"/>' + placed('<scale value="2"/>', '<translate y="1"/>') + "</shape>"))
            self.assert_ends(lumicut("convert", path, self.folder / "curves.json"), OK)
            mesh = json.loads((self.folder / "curves.json").read_text())["meshes"][0]["positions"]
            flat = np.array(mesh) if isinstance(mesh, list) else np.fromfile(self.folder / mesh["file"], np.float32, 3 * mesh["count"], offset=mesh.get("offset", 0))
            rings = flat.reshape(-1, 12, 3)
            middles = rings.mean(axis=1)
            radii = np.linalg.norm(rings - middles[:, None], axis=2) * 12 * math.sin(math.pi / 12) / math.pi
            first = np.abs(middles[:, 2]) < 1
            np.testing.assert_allclose(middles[first][[0, -1]], [(2 * x, 1, 0) for x in ends[0]], atol=1e-5)
            np.testing.assert_allclose(middles[~first][[0, -1]], [(0, 1, 2 * z) for z in ends[1]], atol=1e-5)
            np.testing.assert_allclose(radii[first], 0.1, rtol=1e-5)
            np.testing.assert_allclose(radii[~first], 0.2, rtol=1e-5)
        for text, said in (("1 2 3\n", "line 1"), ("", "no points"), ("0 0 0 1\n1 0 0 1\n", "line 3: a curve of 2 points"), ("0 0 0 1\n0 0 0 -1", "line 2"),
                           ("0 0 0 1\nx", "line 2"), ("0 0 0 1\n\n\n1 1 1 1", "line 2: a curve of 1 points"), ("0 0 0 1\n0 1 0 1e39", "line 2: has a radius of 1e+39"),
                           ("0 0 0 1\n0 1e18 0 1", "line 2: has a coordinate of 1e+18")):
            self.write("curves.txt", text)
            path = self.write("curves.xml", scene('<shape type="bsplinecurve"><string name="filename" value="curves.txt"/></shape>'))
            self.assert_ends(lumicut("render", path, "-o", self.folder / "x.exr"), BAD_FILE, "curves.txt", said)

    def test_colours_of_vertices_are_linear_as_the_file_has_them(self):
        corners = ((-9, -9, 0.1, 0.2, 0.9), (9, -9, 0.3, 0.2, 0.9), (9, 9, 0.3, 0.6, 0.9), (-9, 9, 0.1, 0.6, 0.9))
        self.write("a.ply", "ply\nformat ascii 1.0\nelement vertex 4\n" + "".join(f"property float {n}\n" for n in ("x", "y", "z", "r", "g", "b")) +
                   "element face 2\nproperty list uchar int vertex_indices\nend_header\n" + "".join(f"{x} {y} 0 {r} {g} {b}\n" for x, y, r, g, b in corners) + "3 0 1 2\n3 0 2 3\n")
        bsdf = ('<bsdf type="diffuse"><texture type="mesh_attribute" name="reflectance"><string name="name" value="{}"/><float name="scale" value=".5"/></texture></bsdf>').format
        path = self.write("a.xml", scene(camera((0, 0, 20), (0, 0, 0), 2, (9, 9)), '<emitter type="constant"/>',
                                         '<shape type="ply"><string name="filename" value="a.ply"/>' + bsdf("vertex_color") + "</shape>"))
        found, said = self.render(path, "--vpls", 10, layers="albedo")
        np.testing.assert_allclose(found[4, 4], (0.1, 0.2, 0.45), atol=1e-4)  # the means of the corners, by half
        self.assertNotIn("warning", said)
        _, said = self.render(self.write("b.xml", scene(FLOOR.replace("rectangle", "cube").replace('<rgb name="reflectance" value=".5"/>', ""),
                                                        '<shape type="rectangle">' + bsdf("vertex_color") + "</shape>", '<shape type="disk">' + bsdf("face_color") + "</shape>")), "--vpls", 10)
        for text in ('shape "rectangle" has no colours of vertices and is black', "kind mesh_attribute are grey"):
            self.assertIn(text, said)

    def test_files_are_searched_for_where_path_says(self):
        (self.folder / "common/parts").mkdir(parents=True)
        (self.folder / "scenes").mkdir()
        self.write("common/a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
        self.write("common/parts/part.xml", scene('<path value="../.."/>', '<shape type="obj"><string name="filename" value="a.obj"/></shape>',
                                                  '<shape type="obj"><string name="filename" value="b.obj"/></shape>'))
        self.write("b.obj", "v 0 0 1\nv 1 0 1\nv 0 1 1\nf 1 2 3\n")
        path = self.write("scenes/main.xml", scene('<path value="../common"/>', '<include filename="parts/part.xml"/>'))
        self.assertEqual(json.loads(lumicut("check", "--no-forecast", "--json", path).stdout)["counts"]["triangles"], 2)

    def test_hair_has_the_colour_that_its_pigments_give(self):
        path = self.write("hair.xml", scene('<shape type="sphere"><bsdf type="hair"><float name="eumelanin" value=".5"/><float name="pheomelanin" value=".1"/></bsdf></shape>'))
        self.assert_ends(lumicut("convert", path, self.folder / "hair.json"), OK)
        found = json.loads((self.folder / "hair.json").read_text())["materials"][-1]["diffuse"]
        sigma = 0.5 * np.array([0.419, 0.697, 1.37]) + 0.1 * np.array([0.187, 0.4, 1.05])
        b = 0.3
        per_root = 5.969 - 0.215 * b + 2.532 * b ** 2 - 10.73 * b ** 3 + 5.574 * b ** 4 + 0.245 * b ** 5
        np.testing.assert_allclose(found, np.exp(-per_root * np.sqrt(sigma)), rtol=1e-5)

    def test_what_is_not_supported_is_named(self):
        path = self.floor('<emitter type="projector"/>', '<shape type="cube"><bsdf type="null"/><medium type="homogeneous" name="interior"/></shape>', '<emitter type="point"/>',
                          '<shape type="sdfgrid"/>', '<shape type="sphere"><bsdf type="measured"/><emitter type="directionalarea"/></shape>',
                          '<shape type="sphere"><float name="wide" value="2"/><bsdf type="roughplastic"><boolean name="odd" value="true"/></bsdf></shape>')
        _, said = self.render(path, "--vpls", 10)
        for text in ("emitters of the kind projector: left out", "media: left out", "bsdfs of the kind measured are diffuse", "shapes of the kind sdfgrid: left out",
                     "emitters of the kind directionalarea on shapes: left out",
                     "wide of sphere: left out", "odd of roughplastic: left out"):
            self.assertIn(text, said)

    def test_values_of_materials_out_of_range_are_cut_and_told(self):
        for bsdf, said in (('<bsdf type="diffuse"><rgb name="reflectance" value="3, .5, .5"/></bsdf>', 'line 5: reflectance of <bsdf type="diffuse"> is 3, not 0 to 1; 1 is taken'),
                           ('<bsdf type="diffuse"><rgb name="reflectance" value="-3, .5, .5"/></bsdf>', "is -3, not 0 to 1; 0 is taken"),
                           ('<bsdf type="plastic"><float name="int_ior" value="90"/></bsdf>', "int_ior over ext_ior"), ('<bsdf type="roughconductor"><float name="alpha" value="2"/></bsdf>', "alpha"),
                           ('<bsdf type="principled"><float name="metallic" value="2"/></bsdf>', "metallic"), ('<bsdf type="principled"><float name="clearcoat" value="9"/></bsdf>', "clearcoat"),
                           ('<bsdf type="hair"><float name="eumelanin" value="-3"/></bsdf>', "eumelanin"), ('<bsdf type="mask"><float name="opacity" value="2"/><bsdf type="diffuse"/></bsdf>', "opacity")):
            with self.subTest(bsdf):
                self.assertIn(said, self.render(self.floor('<emitter type="constant"/>\n<shape type="sphere">' + bsdf + "</shape>"), "--vpls", 10)[1])

    def test_curves_without_length_or_width_are_left_out(self):
        for text in ("0 0 0 0\n0 1 0 0\n\n0 0 0 1\n1 0 0 1", "0 0 0 1\n0 0 0 1\n\n0 0 0 1\n1 0 0 1"):
            self.write("curves.txt", text)
            path = self.write("curves.xml", scene('<shape type="linearcurve"><string name="filename" value="curves.txt"/></shape>'))
            done = lumicut("check", "--no-forecast", "--json", path)
            self.assertEqual(json.loads(done.stdout)["counts"]["triangles"], 24)
            self.assertIn("curves without length or width: left out", done.stdout)

    def test_wrong_files_are_refused_by_name(self):
        os.mkfifo(self.folder / "pipe.xml")
        self.write("loop.xml", scene('<include filename="loop.xml"/>'))
        deep = '<bsdf type="twosided">' * 100 + '<bsdf type="diffuse"/>' + "</bsdf>" * 100
        for part, texts in (("<shape", ("bad.xml", "line 4")), ('<shape type="sphere"><float name="radius" value="x"/></shape>', ("<float", "x")),
                            ('<shape type="sphere"><ref id="none"/></shape>', ("none", "no such id")), ('<include filename="loop.xml"/>', ("loop.xml: line 2", "loop.xml includes itself")),
                            ('<include filename="pipe.xml"/>', ("pipe.xml",)), ('<shape type="obj"><string name="filename" value="no.obj"/></shape>', ("no.obj",)),
                            (f'<shape type="sphere">{deep}</shape>', ("without end",)), (camera((0, 0, 0), (0, 0, 0)), ("lookat", "own place")),
                            ('<shape type="sphere"><float name="radius" value="$no"/></shape>', ("$no",)), (camera((0, 0, 1), (0, 0, 0), 400), ("fov", "400")),
                            ('\n<shape type="obj"><string name="filename" value="a"/><string name="filename" value="b"/></shape>', ("line 4", "filename", "given twice")),
                            ('<shape type="obj"/>', ("line 3", "name of the mesh is empty")), ('<shape type="ply"><string name="filename" value="."/></shape>', ("is a folder",)),
                            ('<shape type="cylinder"><float name="radius" value="0"/></shape>', ("radius is 0",)), ('<shape type="cylinder"><point name="p1" x="0" y="0" z="0"/></shape>', ("p0 and p1",)),
                            (camera((0, 0, 1), (0, 0, 0), more='<float name="aperture_radius" value="-1"/>').replace("perspective", "thinlens"), ("aperture_radius is -1",)),
                            ('<shape type="sphere"><bsdf type="diffuse"/><bsdf type="conductor"/></shape>', ("line 3", "second bsdf")),
                            ('<shape type="sphere"><emitter type="area"/><emitter type="area"/></shape>', ("line 3", "second emitter")),
                            ('<shape type="instance"/>', ("line 3", "no shapegroup")), ('<emitter type="point"><spectrum name="intensity" value="400:1, 500:-1"/></emitter>', ("line 3", "-1 at 500 nm")),
                            ('<shape type="sphere"><bsdf type="diffuse"><texture type="bitmap" name="reflectance"><string name="wrap_mode" value="tile"/></texture></bsdf></shape>', ("wrap_mode", "tile")),
                            (camera((0, 0, 1), (0, 0, 0), size=(16.5, 12)), ("16.5 by 12",)), ('<shape type="sphere"/></scene><scene version="3.0.0">', ("line 3", "after the end")), ("\0", ("line 3", "zero byte")),
                            ('<path/>', ("line 3", "<path>", "names no folder")), ('<path value="none"/>', ("none is no folder",)), ('<path value="loop.xml"/>', ("loop.xml is no folder",)),
                            ('<shape type="sphere" id="a"/><shape type="cube" id="a"/>', ("line 3", 'id="a"', "of that id")),
                            ('<shape type="sphere"><boolean name="flip_normals" value="yes"/></shape>', ("yes", "true or false")),
                            ('<shape type="sphere"><float name="radius"/></shape>', ("radius", "no value")),
                            ('<shape type="sphere"><emitter type="area"><rgb name="radiance" value="-1"/></emitter></shape>', ("radiance", "-1"))):
            with self.subTest(part[:60]):
                self.assert_ends(lumicut("render", self.write("bad.xml", scene(FLOOR, part)), "-o", self.folder / "x.exr"), BAD_FILE, *texts)
        self.assert_ends(lumicut("render", self.write("odd.xml", "<html/>"), "-o", self.folder / "x.exr"), BAD_FILE, "odd.xml", "<scene>")

    def test_two_thousand_equal_spheres_are_one_mesh(self):
        path = self.folder / "many.xml"
        path.write_text('<scene version="3.0.0">' + '<shape type="sphere"/>' * 2000 + "</scene>")
        # The memory of the process and of its threads' stacks, not of 18 million triangles.
        done = subprocess.run(["bash", "-c", f"ulimit -v 2000000; exec {COMMAND} check --no-forecast --threads 1 --json {path}"],
                              capture_output=True, text=True, timeout=300)
        self.assertEqual(done.returncode, OK, done.stderr)
        counts = json.loads(done.stdout)["counts"]
        self.assertEqual((counts["meshes"], counts["instances"]), (1, 2000))
        self.assertLess(counts["triangles"], 10000)


if __name__ == "__main__":
    unittest.main()
