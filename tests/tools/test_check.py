"""lumicut check: what is counted, each kind of suspicious input by name, and a forecast that holds within a factor of 2."""
import copy
import json
import os
import subprocess
import unittest

from cli import BAD_FILE, COMMAND, FAILED, OK, ROOT, USAGE, Cli as Base, lumicut

QUAD = [[0, 1, 2, 3]]


def quad(a, b, c, d, material="grey", **more):
    return {"positions": [a, b, c, d], "quads": QUAD, "material": material, **more}


def box(lo, hi, material="grey", inwards=False, **more):
    (a, b, c), (x, y, z) = lo, hi
    p = [[a, b, c], [x, b, c], [x, y, c], [a, y, c], [a, b, z], [x, b, z], [x, y, z], [a, y, z]]
    faces = [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [3, 7, 6, 2], [0, 4, 7, 3], [1, 2, 6, 5]]
    return {"positions": p, "quads": [f[::-1] for f in faces] if inwards else faces, "material": material, **more}


GOOD = {
    "image": {"size": [64, 48]},
    "camera": {"eye": [0, 1, 4], "at": [0, 1, 0], "fov_y": 50},
    "materials": [{"name": "grey"}, {"name": "glow", "diffuse": [0, 0, 0], "emission": [5, 5, 5]}],
    "meshes": [quad([-3, 0, 3], [3, 0, 3], [3, 0, -3], [-3, 0, -3], name="floor"),
               quad([-3, 0, -3], [3, 0, -3], [3, 4, -3], [-3, 4, -3], name="wall"),
               box([-1, 0, -1], [0, 1, 0], name="block")],
    "lights": [{"type": "point", "position": [1, 2, 1], "value": 10}],
}


class Check(Base):
    def scene(self, change=None):
        scene = copy.deepcopy(GOOD)
        if change:
            change(scene)
        path = self.folder / "scene.json"
        path.write_text(json.dumps(scene))
        return path

    def check(self, change=None, *arguments):
        result = lumicut("check", self.scene(change), "--json", "--no-forecast", *arguments)
        self.assert_ends(result, OK)
        return json.loads(result.stdout)

    def kinds(self, change=None, *arguments):
        return {s["kind"] for s in self.check(change, *arguments)["suspicious"]}

    def assert_suspects(self, kind, change, *words, arguments=(), others=()):
        found = self.check(change, *arguments)["suspicious"]
        self.assertEqual({s["kind"] for s in found}, {kind, *others}, found)
        text = " ".join(s["text"] for s in found if s["kind"] == kind)
        for word in words:
            self.assertIn(word, text)

    def test_counts_and_power_are_those_of_the_scene(self):
        def change(s):
            s["meshes"].append(quad([0, 3, 0], [0, 3, 1], [1, 3, 1], [1, 3, 0], "glow", instances=[
                {"translate": [0, 0, 0]}, {"translate": [-2, 0, 0], "scale": 0.5}]))
            s["meshes"][-1]["positions"] = s["meshes"][-1]["positions"][::-1]
            s["lights"].append({"type": "rectangle", "position": [0, 3, 0], "u": [1, 0, 0], "v": [0, 0, 1], "value": 2})
        found = self.check(change)
        self.assertEqual(found["suspicious"], [])
        counts = found["counts"]
        self.assertEqual((counts["meshes"], counts["instances"], counts["triangles"]), (4, 5, 18))
        self.assertEqual((counts["triangles_with_instances"], counts["emissive_triangles"]), (20, 4))
        self.assertEqual(counts["lights"], {"point": 1, "rectangle": 1})
        pi = 3.14159265358979
        self.assertAlmostEqual(found["power"]["point"], 40 * pi, 3)
        self.assertAlmostEqual(found["power"]["rectangle"], 2 * pi, 4)
        self.assertAlmostEqual(found["power"]["emissive_meshes"], 5 * pi * 1.25, 4)

    def test_reference_scenes_are_not_suspicious(self):
        for name in ("cornell_box", "indirect_room", "court"):
            result = lumicut("check", ROOT / f"reference_images/{name}/{name}.json", "--no-forecast", "--strict")
            self.assert_ends(result, OK)
            self.assertIn("nothing suspicious", result.stdout)

    def test_lights_without_power_are_named(self):
        self.assert_suspects("zero_power_light", lambda s: s["lights"].append({**s["lights"][0], "value": 0}), "lights[1]")
        self.assert_suspects("zero_power_light", lambda s: s["lights"].append({**s["lights"][0], "color": [0, 0, 0]}),
                             "lights[1]", "color")
        self.assert_suspects("no_light", lambda s: s.pop("lights"))

    def test_emission_that_nobody_sees_is_named(self):
        self.assert_suspects("emits_inwards", lambda s: s["meshes"].append(
            box([1, 2, 0], [1.2, 2.2, 0.2], "glow", inwards=True, name="bulb")), "bulb", "glow")
        self.assertEqual(self.kinds(lambda s: s["meshes"].append(box([1, 3, 0], [1.2, 3.2, 0.2], "glow"))), set())
        up, down = [[0, 3, 0], [0, 3, 1], [1, 3, 1], [1, 3, 0]], [[1, 3, 0], [1, 3, 1], [0, 3, 1], [0, 3, 0]]
        self.assert_suspects("emits_away", lambda s: s["meshes"].append(quad(*up, "glow", name="panel")), "panel")
        self.assertEqual(self.kinds(lambda s: s["meshes"].append(quad(*down, "glow"))), set())
        self.assert_suspects("emits_outwards", lambda s: s["meshes"].append(
            box([-9, -9, -9], [9, 9, 9], "glow", name="dome")), "dome")
        self.assertEqual(self.kinds(lambda s: s["meshes"].append(box([-9, -9, -9], [9, 9, 9], "glow", inwards=True))), set())

    def test_broken_meshes_are_named(self):
        self.assert_suspects("degenerate_triangles", lambda s: s["meshes"].append(
            {"positions": [[0, 2, 0], [1, 2, 0], [2, 2, 0]], "triangles": [[0, 1, 2]], "material": "grey", "name": "thin"}),
            "thin", "1 of 1")
        self.assert_suspects("flipped_normals", lambda s: s["meshes"][0].update(normals=[[0, -1, 0]] * 4), "floor")
        self.assertEqual(self.kinds(lambda s: s["meshes"][0].update(normals=[[0, 1, 0]] * 4)), set())
        self.assert_suspects("duplicate_faces", lambda s: s["meshes"].append(
            quad([-3, 0, 3], [3, 0, 3], [3, 0, -3], [-3, 0, -3], name="rug")), "rug", "floor", "2 triangles")

    def test_the_camera_is_questioned(self):
        self.assert_suspects("camera_sees_nothing", lambda s: s["camera"].update(at=[0, 1, 9]))
        self.assert_suspects("camera_blocked", lambda s: s["meshes"].append(
            quad([-1, 0, 3.995], [1, 0, 3.995], [1, 2, 3.995], [-1, 2, 3.995])))
        self.assert_suspects("camera_inside", lambda s: s["meshes"].append(box([-0.5, 0.5, 3.5], [0.5, 1.5, 4.5], name="crate")),
                             "crate", arguments=("-p", "clamp_distance=0.1"))
        self.assert_suspects("clamp", None, "median", arguments=("-p", "clamp_distance=4"))
        self.assert_suspects("clamp", None, "tiny", arguments=("-p", "clamp_distance=1e-9"))

    def test_lamps_in_closed_bodies_are_named(self):
        self.assert_suspects("light_inside", lambda s: s["meshes"].append(box([0.5, 1.5, 0.5], [1.5, 2.5, 1.5], name="shade")),
                             "lights[0]", "shade")
        # A room around camera and lamp is what rooms are for.
        self.assertEqual(self.kinds(lambda s: s["meshes"].append(box([-5, -1, -5], [5, 5, 5]))), set())

    def test_surfaces_that_reflect_too_much_are_named(self):
        self.assert_suspects("albedo_above_one", lambda s: s["materials"].append(
            {"name": "chrome", "diffuse": [0.5, 0.5, 0.5], "specular": [0.9, 0.9, 0.9]}) or s["meshes"][2].update(material="chrome"),
            "chrome", "1.4")
        # A GGX coat's factor is no reflectance: what the coat leaves is all that the base gets.
        self.assertEqual(self.kinds(lambda s: s["materials"].append(
            {"name": "paint", "model": "ggx", "diffuse": [0.3, 0.3, 0.3]}) or s["meshes"][2].update(material="paint")), set())
        self.assert_suspects("albedo_above_one", lambda s: s["materials"].append(
            {"name": "mix", "model": "ggx", "fresnel": False, "diffuse": [0.6, 0.6, 0.6], "specular": [0.8, 0.8, 0.8]})
            or s["meshes"][2].update(material="mix"), "mix", "1.4")
        self.assert_suspects("albedo_near_one", lambda s: s["materials"][0].update(diffuse=[0.99, 0.99, 0.99]), "99.0 %")

    def test_surfaces_of_programs_are_not_counted_as_white(self):
        def change(scene):
            scene["programs"] = [{"name": "dots", "steps": [{"op": "position"}]}]
            scene["materials"][0].update(diffuse=[1, 1, 1], diffuse_texture={"program": "dots"})

        self.assertEqual(self.kinds(change), set())

    def test_scenes_far_from_the_origin_are_named(self):
        def far(s):
            for mesh in s["meshes"]:
                mesh["positions"] = [[x + 1e5, y, z] for x, y, z in mesh["positions"]]
            for key in ("eye", "at"):
                s["camera"][key][0] += 1e5
            s["lights"][0]["position"][0] += 1e5
        self.assertIn("far_from_origin", self.kinds(far))

    def test_strict_makes_suspicion_an_error(self):
        scene = self.scene(lambda s: s.pop("lights"))
        self.assert_ends(lumicut("check", scene, "--no-forecast"), OK)
        result = lumicut("check", scene, "--no-forecast", "--strict")
        self.assert_ends(result, FAILED)
        self.assertIn("suspicious: no_light", result.stdout)
        self.assert_ends(lumicut("check", self.scene(), "--no-forecast", "--strict"), OK)

    def test_warnings_about_files_are_told_and_errors_where_strict(self):
        (self.folder / "untidy.mtl").write_text("newmtl red\nKd 1 0 0\nmap_Kd none.png\n")
        (self.folder / "untidy.obj").write_text(
            "mtllib UNTIDY.mtl\nv -1 0 -1\nv 1 0 -1\nv 0 0 1\nusemtl red\nf 1 3 2\nusemtl blue\nf 1 2 3\nl 1 2\n")
        scene = self.scene(lambda s: s["meshes"].append({"obj": "untidy.obj"}))
        told = ("untidy.obj: line 1: ", "untidy.mtl: line 3: ", "none.png", "untidy.obj: line 7: ", "blue", "untidy.obj: line 9: ")
        result = lumicut("check", scene, "--no-forecast")
        self.assert_ends(result, OK)
        for text in told:
            self.assertIn(text, result.stdout)
        self.assert_ends(lumicut("check", scene, "--no-forecast", "--strict"), FAILED)
        image = self.folder / "o.exr"
        render = ("render", scene, "-o", image, "--size", "8x8", "--vpls", "10", "-q")
        result = lumicut(*render)
        self.assert_ends(result, OK, *told)
        self.assertEqual(result.stderr.count("warning"), 4, result.stderr)
        image.unlink()
        for command in (render, ("errors", scene, "-o", self.folder / "errors", "-q"),
                        ("bench", "--scene", scene, "--run", "lightcuts", "-o", self.folder / "bench", "-q")):
            self.assert_ends(lumicut(*command, "--strict"), BAD_FILE, "untidy.obj: line 7: " if command[0] != "bench" else "strict")
        self.assertFalse(image.exists())

    def test_wrong_files_and_options_end_as_in_render(self):
        self.assert_ends(lumicut("check", "none.json"), BAD_FILE, "none.json")
        self.assert_ends(lumicut("check", self.scene(lambda s: s["meshes"].append({"obj": "none.obj"}))), BAD_FILE, "none.obj")
        self.assert_ends(lumicut("check", self.scene(), "-i", "lightcutz"), USAGE, "lightcutz")
        self.assert_ends(lumicut("check", self.scene(), "--size", "9"), USAGE, "--size")

    def test_render_tells_the_same_at_high_verbosity(self):
        scene = self.scene(lambda s: s["lights"].append({**s["lights"][0], "value": 0}))
        result = lumicut("render", scene, "--verbosity", "2", "--vpls", "100", "--stats", self.folder / "s.json")
        self.assert_ends(result, OK, "zero_power_light", "lights[1]", "3 meshes")
        quiet = lumicut("render", scene, "--vpls", "100", "--stats", self.folder / "s.json")
        self.assertNotIn("zero_power_light", quiet.stderr)

    def test_what_render_would_refuse_is_refused(self):
        nowhere = self.folder / "none/kept"
        self.assert_ends(lumicut("check", self.scene(), "--checkpoint", nowhere), BAD_FILE, "no place for a checkpoint", "none")
        self.assert_ends(lumicut("check", self.scene(), "--groups", "-i", "path_tracer"), USAGE, "--groups", "path_tracer")
        self.assert_ends(lumicut("check", self.scene(), "--passes", "0"), USAGE, "--passes")


class Forecast(Base):
    """By CPU seconds, rays and bytes: the clock on the wall depends on what else the machine does."""

    def render(self, *arguments):
        stats = self.folder / "stats.json"
        process = subprocess.Popen([COMMAND, "render", *arguments, "--stats", stats, "-o", self.folder / "o.exr", "-q"],
                                   stdout=subprocess.DEVNULL)
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        self.assertEqual(process.returncode, OK)
        measured = json.loads(stats.read_text())
        measured["cpu"] = usage.ru_utime + usage.ru_stime
        return measured

    def assert_holds(self, name, *arguments):
        result = lumicut("check", *arguments, "--json")
        self.assert_ends(result, OK)
        forecast = json.loads(result.stdout)["forecast"]
        measured = self.render(*arguments)
        reading = measured["phases"]["reading files"] + measured["phases"]["acceleration structure"]
        for what, foretold, found in (("rays", forecast["rays_per_pixel"], measured["rays_per_pixel"]),
                                      ("bytes", forecast["peak_bytes"], measured["peak_bytes"]),
                                      ("cpu", forecast["cpu_seconds"] + reading, measured["cpu"])):
            self.assertLess(foretold / found, 2, f"{name}: {what}")
            self.assertGreater(foretold / found, 0.5, f"{name}: {what}")
        return forecast, measured

    def test_time_rays_and_memory_are_within_a_factor_of_two(self):
        # Much longer than loading the libraries and writing the image, which the forecast leaves out.
        for name, arguments in (("cornell_box", ("--size", "448x448", "--vpls", "20000")),
                                ("indirect_room", ("--size", "192x144", "--vpls", "12000", "-i", "exhaustive"))):
            self.assert_holds(name, str(ROOT / f"reference_images/{name}/{name}.json"), "--spp", "1", *arguments)

    def test_of_passes_light_groups_and_checkpoints_too(self):
        scene = json.loads((ROOT / "reference_images/cornell_box/cornell_box.json").read_text())
        for mesh in scene["meshes"]:
            mesh["obj"] = str(ROOT / "reference_images/cornell_box" / mesh["obj"])
        lamp = {"type": "point", "position": [0.5, 0.5, 0.5], "value": 1}
        scene["lights"] = [{**lamp, "group": 1}, {**lamp, "position": [0.2, 0.5, 0.5], "group": 2}]
        path, kept = self.folder / "groups.json", self.folder / "kept"
        path.write_text(json.dumps(scene))
        # So large that films, not libraries, are most of the memory: 6 passes of few lights.
        words = [path, "--spp", "1", "--size", "448x448", "--vpls", "600", "-p", "error=0.1", "--passes", "6", "--groups", "--checkpoint", kept]
        forecast, measured = self.assert_holds("passes", *map(str, words))
        self.assertEqual((forecast["passes"], measured["values"]["passes"]), (6, 6))
        # All but the header and the key, a description of the scene.
        self.assertAlmostEqual(forecast["checkpoint_bytes"] / kept.stat().st_size, 1, delta=0.01)
        self.assertGreater(forecast["peak_bytes"], measured["values"]["estimated_bytes"])
        text = lumicut("check", *words).stdout
        self.assertIn("6 passes", text)
        self.assertIn("a checkpoint of", text)


if __name__ == "__main__":
    unittest.main()
