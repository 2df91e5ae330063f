"""`lumicut convert`: what it writes renders to the same image, bit for bit, from every format; and nothing is lost."""
import json
import os
import struct
import unittest

import numpy as np

import cli
import test_gltf
import test_models
from cli import BAD_FILE, OK, ROOT, USAGE, lumicut

MESHES = {"floor": (test_models.FLOOR, (0.6, 0.55, 0.5)), "box": (test_models.BOX, (0.7, 0.2, 0.1))}


def gltf_scene(path):
    """Instances, textures, a normal map, a cut-out, a clear coat, glass, an odd spot."""
    (path.parent / "dots.png").write_bytes(test_gltf.png(3, 2, [(255, 0, 0), (9, 200, 0), (0, 0, 255), (90, 80, 70), (1, 2, 3), (4, 5, 6)]))
    (path.parent / "bumps.png").write_bytes(test_gltf.png(2, 1, [(120, 140, 250), (140, 120, 240)]))
    d = test_gltf.Document()
    d.json["images"] = [{"uri": "dots.png"}, {"uri": "bumps.png"}]
    d.json["textures"] = [{"source": 0}, {"source": 1}]
    uvs = [0, 1, 1.5, 1, 1.5, 0, 0, 0]
    red = d.square({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicRoughnessTexture": {"index": 0}},
                    "normalTexture": {"index": 1, "scale": 0.7}, "extensions": {"KHR_materials_clearcoat": {"clearcoatFactor": 0.3}}}, uvs)
    cut = d.square({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicFactor": 0.2}, "alphaMode": "BLEND"}, uvs)
    glow = d.square({"emissiveFactor": [0.3, 1, 0.7], "doubleSided": True, "extensions": {"KHR_materials_transmission": {"transmissionFactor": 0.4}}})
    d.node(mesh=red, rotation=[0.1, 0.2, 0.3, 0.927], translation=[0.1, 0.2, -0.5])
    d.node(mesh=cut, scale=[0.3, 0.31, 1], extensions={"EXT_mesh_gpu_instancing": {"attributes": {
        "TRANSLATION": d.accessor([2, 2, 0.3, -2, -2, 0.4], "VEC3")}}})
    d.node(mesh=glow, scale=[0.2, 0.2, 1], translation=[0.9, -0.3, 1], rotation=[0, 0.6, 0, 0.8])
    d.light("spot", 400, rotation=[0.123, -0.234, 0.0345, 0.964], translation=[0.5, 0.6, 2])
    d.light("directional", 90, rotation=[0.3123, 0.4, 0.1345, 0.85])
    d.camera(height=2.2)
    return d.write(path)


def json_scene(path):
    """What no other format says: programs, attributes, measured lights, groups, masks, areas, lenses, a sky."""
    (path.parent / "lamp.ies").write_text("IESNA:LM-63-1995\nTILT=NONE\n1 1000 1 3 2 1 2 .1 .1 .1\n1 1 50\n0 45 90\n0 180\n900 700 10\n"
                                          "800 300 5\n")
    program = {"name": "tint", "steps": [{"op": "attribute", "attribute": "colour"}, {"op": "position"},
                                         {"op": "noise", "mode": 42, "inputs": [1, [0], [2], [0.5], [2], [0], [1], [0]]},
                                         {"op": "ramp", "inputs": [2], "table": [0.1, 0.2, 0.3, 0.9, 0.8, 0.77]},
                                         {"op": "mix", "mode": 2, "inputs": [[1], 0, 3]}]}
    square = [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]
    path.write_text(json.dumps({
        "unit_scale": 0.3, "up": "z", "image": {"size": [32, 24], "samples": 2},
        "camera": {"eye": [3, -5, 2.1], "at": [0.1, 0.2, 0.3], "fov_y": 37.7, "shift": [0.01, 0.02], "lens_radius": 0.05, "focus_distance": 5,
                   "near": 0.1, "far": 90},
        "programs": [program],
        "materials": [{"name": "a", "diffuse_texture": {"program": "tint"}}, {"name": "a 2", "model": "phong", "specular": [0.1, 0.2, 0.3],
                                                                             "shininess": 33.3, "diffuse": [0.2, 0.1, 0.7]},
                      {"name": "glass", "model": "ggx", "transmission": 1, "shadows_pass": True, "open_glass": True, "ior": 1.45,
                       "specular_tint": [1, 0.9, 0.8]},
                      {"name": "cloth", "model": "ggx", "burley": True, "multiple_scattering": "lobe", "translucency": [0.1, 0.2, 0.1], "coat": 0.5, "coat_roughness": 0.2},
                      {"name": "glazed", "model": "ggx", "diffuse_roughness": 0.6, "diffuse_facets": "once", "absorption": [0.1, 0.2, 0.3], "diffuse_roughness_texture": {"program": "tint"}}],
        "meshes": [{"positions": square, "quads": [[0, 1, 2, 3]], "material": "a", "transform": {"scale": 3}, "shadow_catcher": True,
                    "attributes": [{"name": "colour", "domain": "vertices", "components": 3, "values": [1, .5, .2, .3, 1, 1, .2, .2, 1, 1, 1, 1]}]},
                   {"positions": square, "quads": [[0, 1, 2, 3]], "material": "a 2", "hidden_from": ["camera", "glossy"], "group": 3,
                    "normals": [[0.1, 0.2, 0.9], [0, 0, 1], [0.3, 0, 1], [0, 0.1, 1]],
                    "instances": [{"rotate": {"axis": [1, 2, 3], "degrees": 77}, "translate": [0, 1, 1]}, {"scale": [1, -2, 1]}]}] +
                  [{"positions": square, "quads": [[0, 1, 2, 3]], "material": name, "transform": {"scale": 0.4, "translate": [x, 0, 1]}}
                   for name, x in (("glass", -0.5), ("cloth", 0.6), ("glazed", 1.7))],
        "lights": [{"type": "point", "position": [0, 0, 3], "direction": [0.1, 0.2, -0.9], "ies": "lamp.ies", "value": 0.7, "rotation": 20},
                   {"type": "spot", "position": [1, 1, 3], "direction": [0.3, 0.123, -0.77], "ies": "lamp.ies", "value": 0.7, "angle": 50},
                   {"type": "spot", "position": [1, 1, 3], "direction": [0.3, 0.123, -0.77], "value": 3, "unit": "watt", "angle": 50, "blend": 0.3,
                    "cosine": True, "radius": 0.01, "group": 2, "shadow_catcher": True},
                   {"type": "rectangle", "position": [-2, 0, 2], "u": [1, 0, 0.1], "v": [0, 1, 0], "value": 2, "spread": 120},
                   {"type": "disk", "position": [2, 0, 2], "u": [0, 1, 0.1], "v": [1, 0, 0], "value": 2, "visible": True}],
        "environment": {"sky": {"sun_elevation": 33, "sun_rotation": 77}, "strength": 0.01}}))
    return path


class Convert(cli.Cli):
    def write(self, name, text):
        (self.folder / name).write_text(text)
        return self.folder / name

    def image(self, scene, *words):
        out = self.folder / (scene.stem + "_" + scene.suffix[1:] + ".exr")
        done = lumicut("render", scene, "-o", out, "--vpls", 300, "--seed", 3, *words)
        self.assertEqual(done.returncode, OK, done.stderr)
        return test_models.oiio.ImageInput.open(str(out)).read_image("float")

    def assert_same_image(self, scene, *words):
        there = self.folder / f"{scene.stem}_converted.json"
        self.assert_ends(lumicut("convert", scene, there), OK)
        again = self.folder / f"{scene.stem}_again.json"
        self.assert_ends(lumicut("convert", there, again), OK)
        wanted = self.image(scene, *words)
        self.assertGreater(np.nan_to_num(wanted[..., 0]).max(), 0)
        for path in (there, again):
            found = self.image(path, *words)
            self.assertEqual(found.shape, wanted.shape)
            self.assertEqual(np.count_nonzero(found.view(np.uint32) != wanted.view(np.uint32)), 0, path.name)

    def test_every_format_renders_to_the_same_bits(self):
        size = ("--size", "40x30", "--layers", "radiance,depth,normal,albedo")
        self.write("wood.mtl", "newmtl a\nKd .8 .7 .6\nmap_Kd dots.png\nmap_d dots.png\nnewmtl b\nKd .2 .4 .1\nKs .3 .3 .3\nNs 20\n")
        for scene, words in ((gltf_scene(self.folder / "a.gltf"), size), (json_scene(self.folder / "b.json"), ()),
                             (self.write("c.obj", "mtllib wood.mtl\nusemtl a\nvt 0 0\nvt 2 0\nvt 2 2\nvt 0 2\nvn 0 .9 .1\n"
                                         "v -3 0 3\nv 3 0 3\nv 3 0 -3\nv -3 0 -3\nf 1/1/1 2/2/1 3/3/1 4/4/1\nusemtl b\nf 1 2 4\n"), size),
                             (self.write("d.ply", test_models.ply(test_models.FLOOR, test_models.BOX)), size),
                             (self.write("e.dae", test_models.collada(MESHES)), size), (self.write("f.fbx", test_models.fbx(MESHES)), size),
                             (ROOT / "reference_images/cornell_box/cornell_box.json", size),
                             *((ROOT / "tests/tools/scenes" / name, size)
                               for name in ("cornell.pbrt", "materials.pbrt", "forest.pbrt", "mixes.pbrt", "hair.pbrt", "cornell.xml", "table.xml"))):
            with self.subTest(scene.name):
                self.assert_same_image(scene, *words)

    def test_a_second_conversion_takes_the_first_ones_place_and_leaves_nothing_of_it(self):
        out = self.folder / "out.json"
        first = gltf_scene(self.folder / "a.gltf")
        self.assert_ends(lumicut("convert", first, out), OK)
        before = sorted((self.folder / "out_files").iterdir())
        self.assertGreater(len(before), 3)
        (self.folder / "out_files/mine.txt").write_text("kept")
        self.assert_ends(lumicut("convert", self.write("f.fbx", test_models.fbx(MESHES)), out), OK)
        after = sorted(p.name for p in (self.folder / "out_files").iterdir())
        self.assertEqual(len(after), 3)
        self.assertIn("mine.txt", after)
        self.image(out, "--size", "8x6")

    def test_what_stood_there_stays_where_a_conversion_fails(self):
        out = self.folder / "out.json"
        self.assert_ends(lumicut("convert", gltf_scene(self.folder / "a.gltf"), out), OK)
        before = {p: p.read_bytes() for p in [out, *(self.folder / "out_files").iterdir()]}
        self.assert_ends(lumicut("convert", self.write("bad.ply", "ply\n"), out), BAD_FILE, "bad.ply")
        self.assert_ends(lumicut("convert", out, out), BAD_FILE, "out.json", "is read")
        self.assert_ends(lumicut("convert", self.folder / "a.gltf", f"{self.folder}/\udcff.json"), BAD_FILE, "UTF-8")
        self.assert_ends(lumicut("convert", self.folder / "a.gltf", self.folder / "out.txt"), USAGE, ".json")
        self.assert_ends(lumicut("convert", self.folder / "a.gltf", self.folder / "none/out.json"), BAD_FILE, "none")
        # No room for the meshes of a bigger one.
        big = self.write("big.ply", test_models.ply(([(x, 0, z) for x in range(60) for z in range(60)],
                                                     [(60 * x + z, 60 * x + z + 1, 60 * x + z + 61) for x in range(59) for z in range(59)])))
        limited = cli.subprocess.run(["bash", "-c", f"ulimit -f 16; trap '' XFSZ; exec {cli.COMMAND} convert {big} {out}"],
                                     capture_output=True, text=True)
        self.assertEqual(limited.returncode, BAD_FILE, limited.stderr)
        self.assertEqual({p: p.read_bytes() for p in [out, *(self.folder / "out_files").iterdir()]}, before)

    def test_parts_that_do_not_lie_in_their_file_are_refused_by_name(self):
        (self.folder / "m.bin").write_bytes(struct.pack("<9f3I", 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 1, 2))
        good = {"camera": {"eye": [0, 0, 3], "at": [0, 0, 0], "fov_y": 40}, "materials": [{"name": "m"}],
                "environment": {}, "meshes": [{"positions": {"file": "m.bin", "count": 3}, "material": "m",
                                               "triangles": {"file": "m.bin", "offset": 36, "count": 1}}]}

        def check(code, change, *texts):
            scene = json.loads(json.dumps(good))
            change(scene["meshes"][0])
            self.assert_ends(lumicut("render", self.write("s.json", json.dumps(scene)), "-o", self.folder / "x.exr", "--size", "4x4"), code, *texts)
        check(OK, lambda m: None)
        check(BAD_FILE, lambda m: m["positions"].update(count=4000), "m.bin", "48 bytes")
        check(BAD_FILE, lambda m: m["positions"].update(offset=1 << 50), "m.bin")
        check(BAD_FILE, lambda m: m["triangles"].update(offset=12), "triangles", "vertex")
        check(BAD_FILE, lambda m: m["triangles"].update(file="none.bin"), "none.bin")
        check(BAD_FILE, lambda m: m.update(material=["m", "m"]), "triangle_materials")
        check(BAD_FILE, lambda m: m.update(material=["m"], triangle_materials=[1]), "triangle_materials", "material 1 of 1")
        check(BAD_FILE, lambda m: m.update(transforms={"file": "m.bin", "count": 1}), "flattens")
        os.mkfifo(self.folder / "pipe.bin")
        check(BAD_FILE, lambda m: m["positions"].update(file="pipe.bin"), "pipe.bin")


if __name__ == "__main__":
    unittest.main()
