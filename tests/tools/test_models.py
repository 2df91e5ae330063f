"""OBJ, PLY, COLLADA and FBX files as scenes, which the test writes: against the same scene as JSON."""
import json
import math
import os
import pathlib
import resource
import struct
import subprocess
import unittest

import OpenImageIO as oiio

import cli
from cli import BAD_FILE, COMMAND, OK, ROOT, lumicut

# A box that stands on a floor, seen from above: (corners, faces)
FLOOR = ([(-3, 0, 3), (3, 0, 3), (3, 0, -3), (-3, 0, -3)], [(0, 1, 2, 3)])
BOX = ([(x, y, z) for x in (-1, 1) for y in (0, 1.5) for z in (-0.5, 0.5)],
       [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)])
EYE, AT = (5, 4, 6), (0, 0.5, 0)
WATT, LAMP = 500, (2, 5, 3)


def pixels_of(path):
    image = oiio.ImageInput.open(str(path))
    return image.read_image("float").reshape(-1, image.spec().nchannels)[:, :3]


def scene_json(meshes, **more):
    return {"materials": [{"name": name, "diffuse": colour} for name, (_, colour) in meshes.items()],
            "meshes": [{"positions": m[0], "quads": m[1], "material": name} for name, (m, _) in meshes.items()],
            "camera": {"eye": EYE, "at": AT, "fov_y": 40},
            "lights": [{"type": "point", "position": LAMP, "value": WATT, "unit": "watt"}], **more}


def obj(*meshes):
    lines, first = [], 1
    for corners, faces in meshes:
        lines += [f"v {x} {y} {z}" for x, y, z in corners]
        lines += ["f " + " ".join(str(first + i) for i in face) for face in faces]
        first += len(corners)
    return "\n".join(lines) + "\n"


def ply(*meshes):
    corners, faces = [], []
    for c, f in meshes:
        faces += [[len(corners) + i for i in face] for face in f]
        corners += c
    return (f"ply\nformat ascii 1.0\nelement vertex {len(corners)}\nproperty float x\nproperty float y\nproperty float z\n"
            f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n" +
            "".join(f"{x} {y} {z}\n" for x, y, z in corners) + "".join(f"{len(f)} {' '.join(map(str, f))}\n" for f in faces))


def looking(eye, at):
    """Row-major 4x4 of a camera that looks along -z."""
    def unit(v):
        return [x / math.sqrt(sum(y * y for y in v)) for x in v]

    def cross(a, b):
        return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    z = unit([a - b for a, b in zip(eye, at)])
    x = unit(cross((0, 1, 0), z))
    y = cross(z, x)
    return [v for r in range(3) for v in (x[r], y[r], z[r], eye[r])] + [0, 0, 0, 1]


def collada(meshes, up="Y_UP", meter=1.0):
    def words(values):
        return " ".join(f"{v:.9g}" for v in values)
    effects = "".join(
        f'<effect id="{n}-e"><profile_COMMON><technique sid="t"><lambert><diffuse><color>{words(colour)} 1</color></diffuse></lambert>'
        f'</technique></profile_COMMON></effect>' for n, (_, colour) in meshes.items())
    materials = "".join(f'<material id="{n}-m" name="{n}"><instance_effect url="#{n}-e"/></material>' for n in meshes)
    geometries = "".join(
        f'<geometry id="{n}-g"><mesh><source id="{n}-p"><float_array id="{n}-a" count="{3 * len(m[0])}">'
        f'{words(v for p in m[0] for v in p)}</float_array><technique_common><accessor source="#{n}-a" count="{len(m[0])}" stride="3">'
        '<param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>'
        f'<vertices id="{n}-v"><input semantic="POSITION" source="#{n}-p"/></vertices><polylist material="s" count="{len(m[1])}">'
        f'<input semantic="VERTEX" source="#{n}-v" offset="0"/><vcount>{words(len(f) for f in m[1])}</vcount>'
        f'<p>{words(i for f in m[1] for i in f)}</p></polylist></mesh></geometry>' for n, (m, _) in meshes.items())
    nodes = "".join(
        f'<node id="{n}"><instance_geometry url="#{n}-g"><bind_material><technique_common><instance_material symbol="s" target="#{n}-m"/>'
        '</technique_common></bind_material></instance_geometry></node>' for n in meshes)
    fov_x = math.degrees(2 * math.atan(4 / 3 * math.tan(math.radians(20))))
    return (
        '<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">'
        f'<asset><unit meter="{meter}"/><up_axis>{up}</up_axis></asset><library_cameras><camera id="c" name="c"><optics><technique_common>'
        f'<perspective><xfov>{fov_x:.9g}</xfov><aspect_ratio>1.3333333333</aspect_ratio><znear>.1</znear><zfar>99</zfar></perspective>'
        '</technique_common></optics></camera></library_cameras><library_lights><light id="l" name="l"><technique_common><point><color>'
        f'{WATT} {WATT} {WATT}</color></point></technique_common></light></library_lights><library_effects>{effects}</library_effects>'
        f'<library_materials>{materials}</library_materials><library_geometries>{geometries}</library_geometries><library_visual_scenes>'
        f'<visual_scene id="s">{nodes}<node id="cn"><matrix>{words(looking(EYE, AT))}</matrix><instance_camera url="#c"/></node>'
        f'<node id="ln"><translate>{words(LAMP)}</translate><instance_light url="#l"/></node></visual_scene></library_visual_scenes>'
        '<scene><instance_visual_scene url="#s"/></scene></COLLADA>')


def fbx(meshes, unit=100.0, creator="", lamp=""):
    """ASCII FBX 7.3, lengths in `unit` centimetres."""
    def p(name, kind, *values):
        return f'P: "{name}", "{kind}", "", "A",{",".join(map(str, values))}\n'
    objects, links, number = [], [], 100
    for name, (mesh, colour) in meshes.items():
        corners = ",".join(f"{v}" for c in mesh[0] for v in c)
        faces = ",".join(str(i if k + 1 < len(f) else -i - 1) for f in mesh[1] for k, i in enumerate(f))
        g, m, t = number, number + 1, number + 2
        number += 3
        objects += [
            f'Geometry: {g}, "Geometry::{name}", "Mesh" {{\nVertices: *{3 * len(mesh[0])} {{\na: {corners}\n}}\n'
            f'PolygonVertexIndex: *{sum(map(len, mesh[1]))} {{\na: {faces}\n}}\nLayerElementMaterial: 0 {{\n'
            'MappingInformationType: "AllSame"\nReferenceInformationType: "IndexToDirect"\nMaterials: *1 {\na: 0\n}\n}\n'
            'Layer: 0 {\nLayerElement:  {\nType: "LayerElementMaterial"\nTypedIndex: 0\n}\n}\n}\n',
            f'Model: {m}, "Model::{name}", "Mesh" {{\nProperties70:  {{\n}}\n}}\n',
            f'Material: {t}, "Material::{name}", "" {{\nShadingModel: "phong"\nProperties70:  {{\n' + p("DiffuseColor", "Color", *colour) +
            p("SpecularFactor", "Number", 0) + p("ShininessExponent", "Number", 0) + "}\n}\n"]
        links += [(m, 0), (g, m), (t, m)]
    direction = [a - e for a, e in zip(AT, EYE)]  # the camera looks along +x; turned about z first, then y
    around_y = math.degrees(math.atan2(-direction[2], direction[0]))
    around_z = math.degrees(math.atan2(direction[1], math.hypot(direction[0], direction[2])))
    fov_x = math.degrees(2 * math.atan(4 / 3 * math.tan(math.radians(20))))
    objects += [
        'NodeAttribute: 10, "NodeAttribute::c", "Camera" {\nTypeFlags: "Camera"\nProperties70:  {\n' + p("FieldOfView", "FieldOfView", fov_x) +
        p("AspectWidth", "double", 4) + p("AspectHeight", "double", 3) + "}\n}\n",
        'Model: 11, "Model::c", "Camera" {\nProperties70:  {\n' + p("Lcl Translation", "Lcl Translation", *EYE) +
        p("RotationActive", "bool", 1) + p("RotationOrder", "enum", 5) + p("Lcl Rotation", "Lcl Rotation", 0, around_y, around_z) + "}\n}\n",
        'NodeAttribute: 12, "NodeAttribute::l", "Light" {\nTypeFlags: "Light"\nProperties70:  {\n' + p("LightType", "enum", 0) +
        p("Intensity", "Number", 100 * WATT) + lamp + "}\n}\n",
        'Model: 13, "Model::l", "Light" {\nProperties70:  {\n' + p("Lcl Translation", "Lcl Translation", *LAMP) + "}\n}\n"]
    links += [(11, 0), (10, 11), (13, 0), (12, 13)]
    settings = p("UpAxis", "int", 1) + p("UpAxisSign", "int", 1) + p("FrontAxis", "int", 2) + p("FrontAxisSign", "int", 1)
    settings += p("CoordAxis", "int", 0) + p("CoordAxisSign", "int", 1) + p("UnitScaleFactor", "double", unit)
    return ("; FBX 7.3.0 project file\nFBXHeaderExtension:  {\nFBXHeaderVersion: 1003\nFBXVersion: 7300\n" + creator + "}\nGlobalSettings:  {\nVersion: 1000\n"
            "Properties70:  {\n" + settings + "}\n}\nObjects:  {\n" + "".join(objects) + "}\nConnections:  {\n" +
            "".join(f'C: "OO",{a},{b}\n' for a, b in links) + "}\n")


class Models(cli.Cli):
    def render(self, path, *words):
        out = self.folder / (path.name + ".exr")
        done = lumicut("render", path, "-o", out, "--size", "48x36", "--layers", "radiance", "--vpls", 300, "--seed", 1, *words)
        self.assertEqual(done.returncode, OK, done.stderr)
        return pixels_of(out), done.stderr

    def write(self, name, text):
        path = self.folder / name
        path.write_text(text if isinstance(text, str) else json.dumps(text))
        return path

    def assert_same(self, a, b, share=1e-3):
        # Edges may fall on either side of a pixel's centre where coordinates differ in their last digit.
        self.assertGreater(b.max(), 0)
        off = abs(a - b).max(axis=1) > share * b.max()
        self.assertLess(off.mean(), 0.01)

    def test_obj_and_ply_give_the_same_picture_under_the_same_sky(self):
        a, _ = self.render(self.write("room.obj", obj(FLOOR, BOX)))
        b, _ = self.render(self.write("room.ply", ply(FLOOR, BOX)))
        self.assertGreater((abs(a - a[0]).max(axis=1) > 0.01).mean(), 0.1)  # the scene is in the picture
        self.assertGreater(a.min(), 0)
        # The sky's light paths start elsewhere: the one mesh is an instance. Their noise is 1 % in the mean.
        self.assert_same(a, b, 0.1)
        self.assertLess(abs(a - b).mean(), 0.02 * a.mean())

    def test_collada_and_fbx_are_what_the_same_scene_is_as_json(self):
        meshes = {"floor": (FLOOR, (0.6, 0.55, 0.5)), "box": (BOX, (0.7, 0.2, 0.1))}
        expected, _ = self.render(self.write("room.json", scene_json(meshes)))
        # FBX becomes GGX, whose light paths go on elsewhere.
        for name, text, share in (("room.dae", collada(meshes), 1e-3), ("room.fbx", fbx(meshes), 0.03)):
            with self.subTest(name):
                self.assert_same(self.render(self.write(name, text))[0], expected, share)

    def test_grey_of_a_lamp_is_blenders_white_in_its_files_alone(self):
        meshes = {"floor": (FLOOR, (0.6, 0.55, 0.5))}
        grey = 'P: "Color", "Color", "", "A",0.8,0.8,0.8\n'
        white, _ = self.render(self.write("white.fbx", fbx(meshes)))
        self.assert_same(self.render(self.write("a.fbx", fbx(meshes, creator='Creator: "Blender (stable FBX IO)"\n', lamp=grey)))[0], white)
        self.assert_same(self.render(self.write("b.fbx", fbx(meshes, creator='Creator: "Another"\n', lamp=grey)))[0], 0.8 * white)

    def test_units_of_length_are_metres(self):
        # In half metres all is half as long, and the lamp four times as bright.
        meshes = {"floor": (FLOOR, (0.6, 0.55, 0.5)), "box": (BOX, (0.7, 0.2, 0.1))}
        scene = scene_json(meshes)
        expected = 4 * self.render(self.write("room.json", scene))[0]
        for name, text, share in (("room.dae", collada(meshes, meter=0.5), 1e-3), ("room.fbx", fbx(meshes, unit=50.0), 0.03)):
            with self.subTest(name):
                self.assert_same(self.render(self.write(name, text))[0], expected, share)

    def test_what_is_wrong_is_refused_by_name_and_ends(self):
        cases = {"empty.ply": "", "text.fbx": "no model", "torn.dae": "<COLLADA", "points.ply": ply((FLOOR[0], [])),
                 "far.ply": ply(([(0, 0, 0), (1, 0, 0), (0, 1e30, 0)], [(0, 1, 2)])), "empty.obj": "# nothing\n",
                 "lie.ply": "ply\nformat binary_little_endian 1.0\nelement vertex 4000000000\nproperty float x\nproperty float y\n"
                            "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"}
        for name, text in cases.items():
            with self.subTest(name):
                self.assert_ends(lumicut("render", self.write(name, text), "-o", self.folder / "x.exr"), BAD_FILE, name)
        self.assert_ends(lumicut("render", self.folder / "none.fbx", "-o", self.folder / "x.exr"), BAD_FILE, "none.fbx", "no such file")
        os.mkfifo(self.folder / "pipe.fbx")
        self.assert_ends(lumicut("render", self.folder / "pipe.fbx", "-o", self.folder / "x.exr"), BAD_FILE, "pipe.fbx")

    def test_a_ply_in_which_assimp_would_read_for_ever_is_refused(self):
        (self.folder / "endless.ply").write_bytes((ROOT / "tests/fuzz/corpus/model/endless_ply").read_bytes()[1:])
        self.assert_ends(lumicut("render", self.folder / "endless.ply", "-o", self.folder / "x.exr"), BAD_FILE, "endless.ply", "no end_header")

    def test_counts_of_a_ply_that_its_file_cannot_hold_are_named(self):
        def ply_of(kind="ascii", vertices=3, count="uchar", face=b"3 0 1 2\n"):
            return (f"ply\nformat {kind} 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\nproperty float z\n"
                    f"element face 1\nproperty list {count} int vertex_indices\nend_header\n").encode() + (
                        b"0 0 0\n1 0 0\n0 1 0\n" if kind == "ascii" else struct.pack("<9f", 0, 0, 0, 1, 0, 0, 0, 1, 0)) + face
        binary = "binary_little_endian"
        path = self.folder / "a.ply"
        for good in (ply_of(), ply_of(binary, face=struct.pack("<B3i", 3, 0, 1, 2))):
            path.write_bytes(good)
            self.assert_ends(lumicut("convert", path, self.folder / "x.json"), OK)
        for bad, *texts in ((ply_of(vertices=4000000000), "element vertex promises 4000000000 rows", "bytes"),
                            (ply_of(binary, vertices=4000000000), "element vertex promises 4000000000 rows"),
                            (ply_of(vertices=-3), "element vertex promises -3 rows"),
                            (ply_of(face=b"255 0 1 2\n"), "row 0", "\"face\"", "a list of 255"),
                            (ply_of(face=b""), "after 0 of the 1 rows", "\"face\""),
                            (ply_of(binary, vertices=30, face=b""), "of the 30 rows", "\"vertex\""),
                            (ply_of(binary, count="uint", face=struct.pack("<I3i", 4000000000, 0, 1, 2)), "row 0", "4000000000"),
                            (ply_of(binary, count="int", face=struct.pack("<i3i", -3, 0, 1, 2)), "row 0", "below 0")):
            path.write_bytes(bad)
            self.assert_ends(lumicut("convert", path, self.folder / "x.json"), BAD_FILE, "a.ply", *texts)

    def test_small_files_that_grow_in_assimp_end_by_their_memory(self):
        # Nodes of COLLADA that stand for two others each: 2^40 in the end.
        nodes = "".join(f'<node id="a{i}">' + f'<instance_node url="#a{i + 1}"/>' * 2 + "</node>" for i in range(40)) + '<node id="a40"/>'
        path = self.write("grown.dae", '<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">'
                          '<asset><unit meter="1"/><up_axis>Y_UP</up_axis></asset><library_nodes>' + nodes + "</library_nodes><library_visual_scenes>"
                          '<visual_scene id="s"><node id="n"><instance_node url="#a0"/></node></visual_scene></library_visual_scenes>'
                          '<scene><instance_visual_scene url="#s"/></scene></COLLADA>')
        self.assert_ends(lumicut("convert", path, self.folder / "x.json"), BAD_FILE, "grown.dae", "the reader of dae files")
        children = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
        self.assertLess(children, 1400)  # MB: one GiB, and what a process of the command has

    def test_colours_of_vertices_of_a_ply_are_its_colour(self):
        text = ply(FLOOR).replace("property float z\n", "property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n")
        head, body = text.split("end_header\n")
        lines = body.splitlines()
        path = self.write("red.ply", head + "end_header\n" + "\n".join([f"{line} 188 55 0" for line in lines[:4]] + lines[4:]) + "\n")
        out = self.folder / "x.exr"
        self.assert_ends(lumicut("render", path, "-o", out, "--size", "9x9", "--layers", "albedo", "--vpls", 10), OK)
        image = oiio.ImageInput.open(str(out)).read_image("float")
        for found, wanted in zip(image[4, 4, -3:], (0.503, 0.038, 0)):  # of sRGB 188 and 55
            self.assertAlmostEqual(found, wanted, delta=2e-3)

    def test_a_texture_that_is_missing_is_warned_of(self):
        self.write("a.mtl", "newmtl a\nKd 1 1 1\nmap_Kd none.png\n")
        _, said = self.render(self.write("a.obj", "mtllib a.mtl\nusemtl a\n" + obj(FLOOR)))
        self.assertIn("none.png", said)

    def test_the_reader_of_models_leaves_no_process_and_no_file_behind(self):
        before = set(pathlib.Path("/tmp").glob("lumicut-*"))
        self.render(self.write("room.ply", ply(FLOOR)))
        self.assertLessEqual(set(pathlib.Path("/tmp").glob("lumicut-*")), before)
        running = subprocess.run(["pgrep", "-f", f"{COMMAND} render {self.folder}"], capture_output=True, text=True).stdout
        self.assertEqual(running, "")


if __name__ == "__main__":
    unittest.main()
