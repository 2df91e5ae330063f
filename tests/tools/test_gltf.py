"""glTF scenes, which the test writes: what is read of them, and what is said of those that are wrong."""
import base64
import json
import math
import os
import struct
import time
import unittest
import zlib

import OpenImageIO as oiio

import cli
from cli import BAD_FILE, OK, lumicut

SQUARE = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
FACES = (0, 1, 2, 0, 2, 3)


def read_exr(path):
    """{channel: values, row by row from the top}"""
    opened = oiio.ImageInput.open(str(path))
    pixels = opened.read_image("float").reshape(-1, opened.spec().nchannels)
    return {name: pixels[:, i].tolist() for i, name in enumerate(opened.spec().channelnames)}


def png(width, height, pixels):
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    rows = b"".join(b"\0" + bytes(v for p in pixels[y * width:(y + 1) * width] for v in p) for y in range(height))
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)) +
            chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b""))


class Document:
    """A glTF document that grows by parts."""

    def __init__(self):
        self.bytes = b""
        self.json = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": []}], "nodes": [], "meshes": [], "materials": [],
                     "accessors": [], "bufferViews": [], "cameras": []}

    def accessor(self, values, kind, letter="f"):
        width = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}[kind]
        data = struct.pack(f"<{len(values)}{letter}", *values)
        self.json["bufferViews"].append({"buffer": 0, "byteOffset": len(self.bytes), "byteLength": len(data)})
        self.bytes += data + b"\0" * (-len(data) % 4)
        component = {"f": 5126, "H": 5123, "I": 5125}[letter]
        self.json["accessors"].append({"bufferView": len(self.json["bufferViews"]) - 1, "componentType": component, "type": kind,
                                       "count": len(values) // width})
        return len(self.json["accessors"]) - 1

    def square(self, material=None, uvs=None):
        primitive = {"attributes": {"POSITION": self.accessor([x for p in SQUARE for x in p], "VEC3")},
                     "indices": self.accessor(FACES, "SCALAR", "H")}
        if uvs:
            primitive["attributes"]["TEXCOORD_0"] = self.accessor(uvs, "VEC2")
        if material is not None:
            self.json["materials"].append(material)
            primitive["material"] = len(self.json["materials"]) - 1
        self.json["meshes"].append({"primitives": [primitive]})
        return len(self.json["meshes"]) - 1

    def node(self, **fields):
        self.json["nodes"].append(fields)
        self.json["scenes"][0]["nodes"].append(len(self.json["nodes"]) - 1)

    def camera(self, distance=3.0, height=2.0):
        self.json["cameras"].append({"type": "orthographic", "orthographic": {"xmag": height / 2, "ymag": height / 2, "znear": 0.1, "zfar": 99}})
        self.node(camera=len(self.json["cameras"]) - 1, translation=[0, 0, distance])

    def light(self, kind, intensity, **node):
        self.json.setdefault("extensions", {}).setdefault("KHR_lights_punctual", {"lights": []})["lights"].append(
            {"type": kind, "intensity": intensity} | ({"spot": {}} if kind == "spot" else {}))
        number = len(self.json["extensions"]["KHR_lights_punctual"]["lights"]) - 1
        self.json["extensionsUsed"] = ["KHR_lights_punctual"]
        self.node(extensions={"KHR_lights_punctual": {"light": number}}, **node)

    def write(self, path):
        text = dict(self.json)
        for name in ("materials", "cameras"):
            if not text[name]:
                del text[name]
        if path.suffix == ".glb":
            text["buffers"] = [{"byteLength": len(self.bytes)}]
            head = json.dumps(text).encode()
            head += b" " * (-len(head) % 4)
            path.write_bytes(struct.pack("<4sII", b"glTF", 2, 28 + len(head) + len(self.bytes)) + struct.pack("<I4s", len(head), b"JSON") +
                             head + struct.pack("<I4s", len(self.bytes), b"BIN\0") + self.bytes)
        else:
            text["buffers"] = [{"byteLength": len(self.bytes),
                                "uri": "data:application/octet-stream;base64," + base64.b64encode(self.bytes).decode()}]
            path.write_text(json.dumps(text))
        return path


class Gltf(cli.Cli):
    def render(self, path, *words, size="16x16", layers="radiance"):
        out = self.folder / "out.exr"
        done = lumicut("render", path, "-o", out, "--size", size, "--layers", layers, "-i", "exhaustive", "-p", "clamp_lights=0", *words)
        self.assertEqual(done.returncode, OK, done.stderr)
        return read_exr(out), done.stderr

    def test_lux_below_a_lamp_are_candela_over_squared_distance_in_either_form_of_file(self):
        for name in ("scene.gltf", "scene.glb"):
            d = Document()
            d.node(mesh=d.square({"pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.5, 0.5, 1], "metallicFactor": 0, "roughnessFactor": 1},
                                  "extensions": {"KHR_materials_specular": {"specularFactor": 0}}}))
            d.camera(height=0.02)
            d.light("point", 683, translation=[0, 0, 2])
            image, _ = self.render(d.write(self.folder / name), size="4x4")
            self.assertAlmostEqual(image["R"][5], 0.5 / math.pi / 4, delta=2e-4, msg=name)

    def test_nodes_and_instances_are_where_their_transforms_say(self):
        d = Document()
        mesh = d.square({"emissiveFactor": [1, 1, 1]})
        d.node(mesh=mesh, scale=[0.25, 0.25, 1], translation=[-0.5, 0.5, 0])
        d.node(mesh=mesh, scale=[0.25, 0.25, 1], extensions={"EXT_mesh_gpu_instancing": {"attributes": {
            "TRANSLATION": d.accessor([2, 2, 0, -2, -2, 0], "VEC3")}}})
        d.camera()
        image, _ = self.render(d.write(self.folder / "a.gltf"), layers="radiance,depth", size="8x8")
        seen = {(i % 8 // 4, i // 8 // 4) for i, v in enumerate(image["R"]) if v > 0.9}
        self.assertEqual(seen, {(0, 0), (1, 0), (0, 1)})  # upper left, upper right, lower left

    def test_emission_has_its_strength(self):
        d = Document()
        d.node(mesh=d.square({"emissiveFactor": [0.5, 1, 0], "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 6}}}))
        d.camera()
        image, _ = self.render(d.write(self.folder / "a.gltf"), size="4x4")
        self.assertEqual([round(image[c][5], 5) for c in "RGB"], [3, 6, 0])

    def test_textures_turn_and_lie_as_their_transform_says(self):
        # Red, green above; blue, white below, without a filter.
        four = self.folder / "four.png"
        four.write_bytes(png(2, 2, [(255, 0, 0), (0, 255, 0), (0, 0, 255), (255, 255, 255)]))
        # Turned coordinates go counter-clockwise, and so the image clockwise.
        for transform, expected in (({}, "RGBW"), ({"offset": [0.5, 0]}, "GRWB"), ({"rotation": math.pi / 2, "offset": [0, 1]}, "BRWG")):
            d = Document()
            d.json["images"], d.json["samplers"] = [{"uri": four.name}], [{"magFilter": 9728}]
            d.json["textures"] = [{"source": 0, "sampler": 0}]
            texture = {"index": 0, "extensions": {"KHR_texture_transform": transform}}
            d.node(mesh=d.square({"pbrMetallicRoughness": {"baseColorTexture": texture, "metallicFactor": 0}}, [0, 1, 1, 1, 1, 0, 0, 0]))
            d.camera()
            image, _ = self.render(d.write(self.folder / "a.gltf"), layers="albedo", size="4x4")
            letters = {(True, False, False): "R", (False, True, False): "G", (False, False, True): "B", (True, True, True): "W"}
            found = "".join(letters[tuple(image[f"albedo.{c}"][i] > 0.5 for c in "RGB")] for i in (0, 3, 12, 15))
            self.assertEqual(found, expected, transform)

    def test_colours_of_vertices_multiply_the_base_colour_and_its_texture(self):
        (self.folder / "grey.png").write_bytes(png(1, 1, [(188, 188, 188)]))  # .5 in linear light
        for letters, values in (("f", [0.2, 0.4, 0.8] * 4), ("H", [13107, 26214, 52428, 65535] * 4)):
            for texture, factor in ((None, 1), ({"index": 0}, 0.5029)):
                d = Document()
                base = {"metallicFactor": 0, "baseColorFactor": [0.5, 1, 1, 1]} | ({"baseColorTexture": texture} if texture else {})
                mesh = d.square({"pbrMetallicRoughness": base}, [0, 0, 1, 0, 1, 1, 0, 1])
                plain = d.square({"pbrMetallicRoughness": base}, [0, 0, 1, 0, 1, 1, 0, 1])
                d.json["meshes"][plain]["primitives"][0]["material"] = 0  # the same material without colours stays as it is
                d.json["images"], d.json["textures"] = [{"uri": "grey.png"}], [{"source": 0}]
                accessor = d.accessor(values, "VEC3" if letters == "f" else "VEC4", letters)
                d.json["accessors"][accessor]["normalized"] = letters == "H"
                d.json["meshes"][mesh]["primitives"][0]["attributes"]["COLOR_0"] = accessor
                d.node(mesh=mesh, scale=[0.5, 1, 1], translation=[-0.5, 0, 0])
                d.node(mesh=plain, scale=[0.5, 1, 1], translation=[0.5, 0, 0])
                d.camera()
                image, _ = self.render(d.write(self.folder / "a.gltf"), layers="albedo", size="4x4")
                left, right = ([image[f"albedo.{c}"][i] for c in "RGB"] for i in (4, 7))
                for found, wanted in zip(left + right, [0.1, 0.4, 0.8, 0.5, 1, 1]):
                    # Albedo has a dielectric's gloss on top: 4 % of what is left.
                    self.assertAlmostEqual(found, wanted * factor, delta=0.05)

    def test_a_file_without_camera_and_light_is_framed_under_a_sky(self):
        d = Document()
        d.node(mesh=d.square(), translation=[1000, 50, -20], rotation=[-0.70710678, 0, 0, 0.70710678], scale=[30, 30, 1])
        image, _ = self.render(d.write(self.folder / "a.gltf"), layers="radiance,depth", size="32x32", *("--vpls", "300"))
        hit = [v for v in image["Z"] if v > 0 and math.isfinite(v) and v < 1e30]
        self.assertGreater(len(hit), 0.1 * 32 * 32)
        self.assertLess(len(hit), 32 * 32)
        self.assertGreater(min(image["B"]), 0)

    def converted(self, material):
        d = Document()
        d.node(mesh=d.square(material))
        d.json["extensionsUsed"] = d.json["extensionsRequired"] = list(material["extensions"])
        self.assert_ends(lumicut("convert", d.write(self.folder / "a.gltf"), self.folder / "a.json"), OK)
        return json.loads((self.folder / "a.json").read_text())["materials"][0]

    def test_specular_and_gloss_become_metal_and_roughness(self):
        for factors, base, metallic, roughness in (
                ({"diffuseFactor": [0.6, 0.3, 0.1, 1], "specularFactor": [0.04] * 3, "glossinessFactor": 0.25}, (0.6, 0.3, 0.1), 0, 0.75),
                ({"diffuseFactor": [0, 0, 0, 1], "specularFactor": [1, 0.8, 0.3], "glossinessFactor": 0.9}, (1, 0.8, 0.3), 1, 0.1)):
            found = self.converted({"extensions": {"KHR_materials_pbrSpecularGlossiness": factors}})
            for value, wanted in zip((*found["diffuse"], found.get("metallic", 0), found["roughness"]), (*base, metallic, roughness)):
                self.assertAlmostEqual(value, wanted, delta=0.02)  # metals of a colour keep a little of the rest

    def test_volumes_absorb_and_bend_light(self):
        glass = {"KHR_materials_transmission": {"transmissionFactor": 1}}
        self.assertIs(self.converted({"extensions": glass})["shadows_pass"], True)
        found = self.converted({"extensions": glass | {"KHR_materials_volume": {"thicknessFactor": 1, "attenuationDistance": 2, "attenuationColor": [1, 0.5, 0.25]}}})
        self.assertNotIn("shadows_pass", found)
        for value, colour in zip(found["absorption"], (1, 0.5, 0.25)):
            self.assertAlmostEqual(value, -math.log(colour) / 2, places=5)

    def test_what_is_left_out_is_named(self):
        d = Document()
        d.node(mesh=d.square({"emissiveFactor": [1, 1, 1]}))
        d.camera()
        d.json["extensionsUsed"] = ["KHR_materials_sheen"]
        _, said = self.render(d.write(self.folder / "a.gltf"))
        self.assertIn("KHR_materials_sheen: left out", said)

    def test_wrong_files_are_refused_by_name(self):
        def wrong(change, *texts):
            d = Document()
            d.node(mesh=d.square({}))
            change(d)
            done = lumicut("render", d.write(self.folder / "bad.gltf"), "-o", self.folder / "x.exr", "--size", "8x8")
            self.assert_ends(done, BAD_FILE, "bad.gltf", *texts)
        wrong(lambda d: d.json["accessors"][1].update(count=4000), "accessors[1]", "4000", "buffers[0]")
        wrong(lambda d: d.json["accessors"][d.json["meshes"][0]["primitives"][0]["indices"]].update(componentType=5126, count=1),
              "accessors[", "componentType 5126", "indices")
        wrong(lambda d: d.json["nodes"][0].update(extensions={"KHR_lights_punctual": {"light": 1e300}}), "nodes[0].extensions.KHR_lights_punctual.light", "1e+300")
        wrong(lambda d: d.json["nodes"][0].update(children=[0]), "scenes[0].nodes[0]", "nodes[0] is a child of nodes[0]")
        wrong(lambda d: d.json["materials"][0].update(pbrMetallicRoughness={"roughnessFactor": 3}), "materials[0].roughnessFactor", "3")
        wrong(lambda d: d.json.update(extensionsRequired=["KHR_draco_mesh_compression"], extensionsUsed=["KHR_draco_mesh_compression"]),
              "KHR_draco_mesh_compression")
        wrong(lambda d: d.json["asset"].update(version="1.0"), "asset.version", "1.0")
        wrong(lambda d: d.json["materials"][0].update(alphaMode="CUT"), "materials[0].alphaMode", "CUT", "OPAQUE, MASK, BLEND")
        wrong(lambda d: d.json["nodes"][0].update(matrix=[1, 0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]), "nodes[0].matrix", "not affine")
        for extension, key, value in (("specular", "specularFactor", 5), ("volume", "attenuationDistance", -1), ("volume", "attenuationColor", [2, 1, 1]), ("emissive_strength", "emissiveStrength", -2)):
            wrong(lambda d: d.json["materials"][0].update(extensions={f"KHR_materials_{extension}": {key: value}}), f"materials[0].extensions.KHR_materials_{extension}.{key}")
        wrong(lambda d: d.json["nodes"].clear() or d.json["scenes"][0].update(nodes=[]), "no triangles")
        for name, content in (("torn.glb", b"glTF\2\0\0\0\xff\0\0\0"), ("text.gltf", b"{"), ("empty.gltf", b"")):
            (self.folder / name).write_bytes(content)
            self.assert_ends(lumicut("render", self.folder / name, "-o", self.folder / "x.exr"), BAD_FILE, name)
        self.assert_ends(lumicut("render", self.folder / "no.glb", "-o", self.folder / "x.exr"), BAD_FILE, "no.glb")

    def refused(self, change, *texts, name="bad.gltf"):
        d = Document()
        d.node(mesh=d.square({}))
        change(d)
        started = time.monotonic()
        self.assert_ends(lumicut("convert", d.write(self.folder / name), self.folder / "x.json"), BAD_FILE, name, *texts)
        self.assertLess(time.monotonic() - started, 30, texts)  # none is waited for or grows without end

    def test_deeply_nested_json_is_refused_in_either_form_of_file(self):
        deep = []
        for _ in range(500):
            deep = [deep]
        for name in ("bad.gltf", "bad.glb"):
            self.refused(lambda d: d.json.update(extras=deep), "deeper than 64 levels", name=name)
        nested = b'{"asset":{"version":"2.0"},"extras":' + b"[" * 50000 + b"]" * 50000 + b"}"
        nested += b" " * (-len(nested) % 4)
        (self.folder / "a.gltf").write_bytes(nested)
        (self.folder / "a.glb").write_bytes(struct.pack("<4sIIII", b"glTF", 2, 20 + len(nested), len(nested), 0x4E4F534A) + nested)
        for name in ("a.gltf", "a.glb"):
            self.assert_ends(lumicut("convert", self.folder / name, self.folder / "x.json"), BAD_FILE, name, "deeper than 64 levels")

    def test_pipes_devices_and_folders_are_refused_as_buffers_and_images(self):
        os.mkfifo(self.folder / "pipe")
        for uri, text in (("pipe", "pipe"), (".", "folder"), ("../" * 12 + "dev/zero", "device")):
            for kind in ("buffers", "images"):
                d = Document()
                d.node(mesh=d.square({}))
                path = d.write(self.folder / "bad.gltf")
                written = json.loads(path.read_text())
                written.setdefault(kind, [{}])[0]["uri"] = uri
                path.write_text(json.dumps(written))
                self.assert_ends(lumicut("convert", path, self.folder / "x.json"), BAD_FILE, "bad.gltf", f"{kind}[0].uri", f"is a {text}")

    def test_a_node_has_one_parent(self):
        self.refused(lambda d: d.json["nodes"].extend([{"children": [2, 2]}, {}]), "nodes[1].children[1]", "nodes[2] is a child of nodes[1] already")
        self.refused(lambda d: d.json["nodes"].extend([{"children": [3]}, {"children": [3]}, {}]), "nodes[2].children[0]", "of nodes[1]")
        self.refused(lambda d: d.json["scenes"][0]["nodes"].append(0), "scenes[0].nodes[1]", "twice")

    def test_without_a_scene_children_stand_in_their_parents_alone(self):
        d = Document()
        mesh = d.square({"emissiveFactor": [1, 1, 1]})
        d.json["nodes"] = [{"children": [1], "translation": [5, 0, 0]}, {"mesh": mesh}]
        del d.json["scene"], d.json["scenes"]
        self.assert_ends(lumicut("convert", d.write(self.folder / "a.gltf"), self.folder / "a.json"), OK)
        meshes = json.loads((self.folder / "a.json").read_text())["meshes"]
        self.assertEqual(sum(len(m.get("instances", [0])) for m in meshes), 1)

    def test_values_of_a_wrong_kind_are_refused_by_name(self):
        for number in (7, -1, 2**31, 2**63, 1.5, "a"):
            self.refused(lambda d: d.json["nodes"][0].update(mesh=number), "nodes[0].mesh", str(number), "meshes")
        self.refused(lambda d: d.json["nodes"][0].update(matrix=[1, 1, 1]), "nodes[0].matrix", "16")
        self.refused(lambda d: d.json["nodes"][0].update(rotation=[0, 0, 0, 0]), "nodes[0].rotation", "length is 0")
        self.refused(lambda d: d.json["meshes"][0]["primitives"][0].update(material=-2), "meshes[0].primitives[0].material", "-2")
        for color in ([-1, 0, 0], [1, "x", 0], [1, 1], "red"):
            self.refused(lambda d: d.light("point", 1) or d.json["extensions"]["KHR_lights_punctual"]["lights"][0].update(color=color),
                         "extensions.KHR_lights_punctual.lights[0].color")
        for extension, key in (("KHR_materials_ior", "ior"), ("KHR_materials_transmission", "transmissionFactor"),
                               ("KHR_materials_volume", "attenuationColor")):
            self.refused(lambda d: d.json["materials"][0].update(extensions={extension: {key: "x"}}), f"materials[0].extensions.{extension}.{key}")
        self.refused(lambda d: d.json["materials"][0].update(extensions={"KHR_materials_ior": []}), "materials[0].extensions.KHR_materials_ior")
        self.refused(lambda d: d.json["materials"][0].update(pbrMetallicRoughness={"metallicFactor": "x"}),
                     "materials[0].pbrMetallicRoughness.metallicFactor")

    def held(self, picture, name):
        """A scene whose base colour is an image in its buffer."""
        d = Document()
        d.json["bufferViews"].append({"buffer": 0, "byteOffset": 0, "byteLength": len(picture)})
        d.bytes += picture + b"\0" * (-len(picture) % 4)
        d.json["images"], d.json["textures"] = [{"bufferView": 0, "mimeType": "image/png"}], [{"source": 0}]
        d.node(mesh=d.square({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicFactor": 0}}, [0, 1, 1, 1, 1, 0, 0, 0]))
        d.camera()
        return d.write(self.folder / name)

    def test_images_in_buffers_are_read_from_memory_and_named_by_their_place(self):
        # No folder for temporary files: none is needed, so that none can stay behind.
        nowhere = {"TMPDIR": str(self.folder / "none")}
        for name in ("a.gltf", "a.glb"):
            out = self.folder / "x.exr"
            done = lumicut("render", self.held(png(1, 1, [(255, 0, 0)]), name), "-o", out, "--size", "4x4", "--layers", "albedo",
                           "--vpls", "10", env=nowhere)
            self.assert_ends(done, OK)
            image = read_exr(out)
            self.assertGreater(image["albedo.R"][5], 0.9)
            self.assertLess(image["albedo.G"][5], 0.1)
            for wrong in (b"no picture at all", png(1, 1, [(255, 0, 0)])[:40], b"\xff\xd8\xff"):
                done = lumicut("convert", self.held(wrong, name), self.folder / "x.json", env=nowhere)
                self.assert_ends(done, BAD_FILE, f"{name}: images[0]", "materials[0]")


if __name__ == "__main__":
    unittest.main()
