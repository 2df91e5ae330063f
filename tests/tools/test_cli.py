"""The lumicut command as its users meet it: exit codes, messages, files whole or absent, Ctrl-C."""
import json
import os
import pty
import select
import shutil
import signal
import subprocess
import time
import unittest

from cli import BAD_FILE, BUILD, COMMAND, FAILED, INTERRUPTED, OK, SCENE, USAGE, Cli as Base, lumicut, wait_until_busy, write_exr


class Cli(Base):
    def render(self, *arguments, scene=SCENE):
        return lumicut("render", scene, "--size", "24x24", "--vpls", "200", *arguments)


class Info(Cli):
    def test_integrators_and_their_parameters_are_listed(self):
        result = lumicut("info", "--json")
        self.assert_ends(result, OK)
        info = json.loads(result.stdout)
        integrators = {i["id"]: {p["id"] for p in i["parameters"]} for i in info["integrators"]}
        traits = {i["id"]: set(i["traits"]) for i in info["integrators"]}
        presets = {i["id"]: i["presets"] for i in info["integrators"]}
        self.assertIn("exhaustive", integrators)
        self.assertIn("lightcuts", integrators)
        self.assertIn("error", integrators["lightcuts"])
        tracer = integrators.pop("path_tracer")
        self.assertEqual(tracer, {"seed", "max_depth", "samples"}, "what virtual lights need has no effect on it")
        for parameters in integrators.values():
            self.assertLessEqual({"vpls", "seed", "clamp_distance"}, parameters)
        self.assertEqual({name for name in traits if "virtual_lights" not in traits[name]}, {"path_tracer"})
        self.assertEqual({name for name in traits if "saved_state" in traits[name]}, {"wspd"})
        self.assertEqual({name for name in traits if "all_lights" in traits[name]}, {"exhaustive"})
        self.assertEqual(presets["lightcuts"]["good"], "vpls=3000 error=0.05 compensate=true importance=true trace_gloss=true")
        self.assertIn("radiance", [c["name"] for c in info["channels"]])
        text = lumicut("info").stdout
        for name in integrators:
            self.assertIn(f"\n{name}: ", text)

    def test_help_names_every_command_and_the_exit_codes(self):
        result = lumicut("--help")
        self.assert_ends(result, OK)
        for word in ("render", "compare", "info", "Exit codes"):
            self.assertIn(word, result.stdout)
        self.assert_ends(lumicut("render", "--help"), OK)

    def test_a_missing_library_is_named(self):
        self.assert_ends(lumicut("info", env={"LUMICUT_LIBRARY": "/nowhere.so"}), FAILED, "/nowhere.so")


class Pictures(Cli):
    """OpenImageIO and its 250 libraries are loaded for pictures alone."""

    def test_the_command_links_no_openimageio(self):
        libraries = subprocess.run(["ldd", COMMAND], capture_output=True, text=True, check=True).stdout
        self.assertIn("libOpenEXR", libraries)
        self.assertNotIn("libOpenImageIO", libraries)

    def test_a_missing_module_is_named_where_a_picture_needs_it(self):
        alone = self.folder / "bin/lumicut"
        alone.parent.mkdir()
        shutil.copy(COMMAND, alone)
        env = {**os.environ, "LUMICUT_LIBRARY": str(BUILD / "lib/liblumicut.so")}
        exr, png = self.folder / "a.exr", self.folder / "a.png"
        render = [alone, "render", SCENE, "--size", "8x8", "--vpls", "20", "-q", "-o", exr]
        for words, code in ((render, OK), ([*render, "--png", png], BAD_FILE), ([alone, "compare", exr, exr], BAD_FILE)):
            result = subprocess.run(words, env=env, capture_output=True, text=True)
            self.assertEqual(result.returncode, code, result.stderr)
            if code != OK:
                self.assertIn("the module images.so cannot be loaded", result.stderr)
                self.assertIn("lib/lumicut/images.so", result.stderr)


class Usage(Cli):
    def test_wrong_command_lines_are_named(self):
        out = self.folder / "o.exr"
        self.assert_ends(lumicut(), USAGE)
        self.assert_ends(lumicut("rendr"), USAGE)
        self.assert_ends(lumicut("render"), USAGE, "scene")
        self.assert_ends(lumicut("render", SCENE), USAGE, "nothing to write")
        self.assert_ends(self.render("-o", out, "-i", "lightcutz"), USAGE, "lightcutz")
        self.assert_ends(self.render("-o", out, "-p", "eror=1"), USAGE, "eror")
        self.assert_ends(self.render("-o", out, "-p", "error"), USAGE, "name=value")
        self.assert_ends(self.render("-o", out, "-i", "lightcuts", "-p", "error=much"), USAGE, "much")
        self.assert_ends(self.render("-o", out, "--layers", "radiance,colour"), USAGE, "colour", "depth")
        self.assert_ends(self.render("-o", out, "--accel", "octree"), USAGE, "octree")
        self.assert_ends(self.render("-o", out, "--groups", "-i", "path_tracer"), USAGE, "--groups", "path_tracer")
        self.assert_ends(self.render("-o", out, "--builder", "magic"), USAGE, "magic", "binned-agglomerative")
        self.assert_ends(self.render("-o", out, "--accel", "embree", "--builder", "sweep"), USAGE, "embree")
        self.assert_ends(self.render("-o", out, "--crop", "0,0,30,10"), USAGE, "0,0,30,10", "24 x 24")
        self.assert_ends(lumicut("render", SCENE, "-o", out, "--size", "24"), USAGE, "24")
        self.assert_ends(lumicut("render", SCENE, "-o", out, "--size", "24xx"), USAGE, "24xx")
        self.assert_ends(lumicut("render", SCENE, "-o", out, "--size", "-4x5"), USAGE)
        self.assert_ends(lumicut("render", SCENE, "-o", out, "--threads", "-1"), USAGE)
        self.assertEqual(self.files(), [])

    def test_files_that_are_missing_or_wrong_are_named(self):
        out = self.folder / "o.exr"
        self.assert_ends(self.render("-o", out, scene="none.json"), BAD_FILE, "none.json")
        self.assert_ends(self.render("-o", self.folder / "no/o.exr"), BAD_FILE, "no/o.exr")
        self.assert_ends(self.render("-o", out, "--vpl-in", "none.vpl"), BAD_FILE, "none.vpl")
        self.assert_ends(lumicut("compare", "a.exr", "b.exr"), BAD_FILE, "a.exr")
        bad = self.folder / "bad.json"
        bad.write_text('{"camera": {"eye": [0, 0, 1], "at": [0, 0, 0], "fov_y": "wide"}}')
        self.assert_ends(self.render("-o", out, scene=bad), BAD_FILE, "bad.json", "camera.fov_y", '"wide"')
        bad.write_text('{\n"camera": ')
        self.assert_ends(self.render("-o", out, scene=bad), BAD_FILE, "bad.json", "line 2")
        self.assertEqual(self.files(), ["bad.json"])


class Render(Cli):
    def test_image_statistics_and_lights_are_written(self):
        names = {"-o": "a.exr", "--png": "a.png", "--stats": "a.json", "--vpl-out": "a.vpl"}
        arguments = [x for option, name in names.items() for x in (option, self.folder / name)]
        result = self.render(*arguments, "-i", "lightcuts", "-p", "error=0.05", "--seed", "7")
        self.assert_ends(result, OK)
        self.assertEqual(self.files(), sorted(names.values()))
        self.assertEqual(result.stderr, "", "no progress bar in a pipe")
        stats = json.loads((self.folder / "a.json").read_text())
        for key in ("seconds", "rays_per_pixel", "bounds_per_pixel", "clusters_per_pixel", "peak_bytes"):
            self.assertGreater(stats[key], 0, key)
        self.assertLessEqual({"reading files", "acceleration structure", "render"}, set(stats["phases"]))
        # seconds holds neither reading nor building, but all the rest.
        inner = sum(s for name, s in stats["phases"].items() if name not in ("reading files", "acceleration structure"))
        self.assertLessEqual(inner, stats["seconds"] * 1.01 + 0.001)
        self.assertEqual((stats["width"], stats["height"], stats["seed"]), (24, 24, "7"))
        self.assertEqual(stats["parameters"]["error"], "0.05")
        self.assertEqual((self.folder / "a.vpl").stat().st_size, 40 + 112 * stats["vpls"])

    def test_peak_memory_is_the_commands_own(self):
        ballast = bytearray(os.urandom(1)) * (400 << 20)  # getrusage gives it to whom this process starts
        self.assert_ends(self.render("--stats", self.folder / "a.json"), OK)
        self.assertLess(json.loads((self.folder / "a.json").read_text())["peak_bytes"], len(ballast) / 2)
        forecast = json.loads(lumicut("check", SCENE, "--size", "24x24", "--vpls", "200", "--json").stdout)["forecast"]
        self.assertLess(forecast["peak_bytes"], len(ballast) / 2)

    def difference(self, a, b):
        result = lumicut("compare", a, b, "--no-flip", "--json")
        self.assert_ends(result, OK)
        return json.loads(result.stdout)["max_relative_error"]

    def test_the_same_lights_give_the_same_image(self):
        first, second, lights, again = (self.folder / n for n in ("a.exr", "b.exr", "a.vpl", "b.vpl"))
        for how in (("exhaustive",), ("exhaustive", "-p", "virtual_lights=spheres"), ("lightcuts", "--seed", "5")):
            self.assert_ends(self.render("-i", *how, "-o", first, "--vpl-out", lights), OK)
            self.assert_ends(self.render("-i", *how, "-o", second, "--vpl-in", lights, "--vpl-out", again, "--threads", "1"), OK)
            self.assertEqual(again.read_bytes(), lights.read_bytes())
            self.assertEqual(self.difference(first, second), 0)

    def test_lamps_too_small_for_a_radiance_are_points(self):
        """They lit nothing."""
        images = []
        for radius in (0, 1e-30):
            path, image = self.folder / "scene.json", self.folder / f"{len(images)}.exr"
            path.write_text(json.dumps({
                "camera": {"eye": [0, 0, 3], "at": [0, 0, 0], "fov_y": 40}, "materials": [{"name": "grey", "diffuse": [0.5, 0.5, 0.5]}],
                "meshes": [{"positions": [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], "quads": [[0, 1, 2, 3]], "material": "grey"}],
                "lights": [{"type": "point", "position": [0, 0, 1], "value": 1, "radius": radius}]}))
            self.assert_ends(self.render("-i", "exhaustive", "--layers", "radiance", "-o", image, scene=path), OK)
            images.append(image)
        self.assertEqual(self.difference(*images), 0)

    def test_lights_of_older_files_and_damaged_ones(self):
        image, lights, bad = (self.folder / n for n in ("a.exr", "a.vpl", "bad.vpl"))
        self.assert_ends(self.render("-i", "exhaustive", "-o", image, "--vpl-out", lights), OK)
        whole = lights.read_bytes()
        count = int.from_bytes(whole[16:24], "little")
        records = [whole[40 + 112 * i:40 + 112 * i + 64] for i in range(count)]
        old = self.folder / "old.vpl"
        old.write_bytes(b"LUMIVPL\n" + (1).to_bytes(4, "little") + (64).to_bytes(4, "little") + whole[16:24] + bytes(8) +
                        b"".join(records))
        result = self.render("-i", "exhaustive", "-o", image, "--vpl-in", old)
        self.assert_ends(result, OK)
        self.assertIn(f"{count} lights", result.stdout)
        for damaged, text in ((whole[:-1], f"says {count} lights"), (whole[:36], "header"),
                              (whole[:40 + 64] + b"\x09" + whole[40 + 65:], "lumicut_vpl_origin[0].source"),
                              (whole[:52] + b"\x09" + whole[53:], "lumicut_vpl[0].kind"),
                              (whole[:72] + b"\x00\x00\xc0\x7f" + whole[76:], "lumicut_vpl[0].intensity"),
                              (whole[:32] + bytes(8) + whole[40:], "emitter_samples")):
            bad.write_bytes(damaged)
            self.assert_ends(self.render("-i", "exhaustive", "-o", image, "--vpl-in", bad), BAD_FILE, "bad.vpl", text)

    def test_a_crop_is_a_part_of_the_whole(self):
        whole, part = self.folder / "whole.exr", self.folder / "part.exr"
        self.assert_ends(self.render("-i", "exhaustive", "-o", whole), OK)
        self.assert_ends(self.render("-i", "exhaustive", "-o", part, "--crop", "4,6,20,22", "--layers", "radiance"), OK)
        self.assertLess(part.stat().st_size, whole.stat().st_size)
        self.assert_ends(lumicut("compare", part, whole), BAD_FILE, "16 x 16", "24 x 24")

    def test_layers_can_be_compared_by_name(self):
        image = self.folder / "a.exr"
        self.assert_ends(self.render("-i", "exhaustive", "-o", image, "--layers", "radiance,depth"), OK)
        self.assert_ends(lumicut("compare", image, image, "--layer", "depth"), OK)
        self.assert_ends(lumicut("compare", image, image, "--layer", "normal"), BAD_FILE, "normal", "depth")

    def test_an_interrupt_leaves_no_file(self):
        for code, wait in ((signal.SIGINT, 0.2), (signal.SIGTERM, 0.8)):
            names = [x for option, name in (("-o", "a.exr"), ("--png", "a.png"), ("--stats", "a.json")) for x in (option, self.folder / name)]
            process = subprocess.Popen([COMMAND, "render", SCENE, "-i", "exhaustive", "--vpls", "500000", "--size", "2000x2000", *names],
                                       stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
            wait_until_busy(process, wait)
            self.assertIsNone(process.poll(), "long enough to be interrupted")
            process.send_signal(code)
            started = time.monotonic()
            _, text = process.communicate(timeout=60)
            self.assertEqual(process.returncode, INTERRUPTED, text)
            self.assertIn("interrupted", text)
            # Work is polled every few milliseconds; the margin is for a crowded machine and sanitizers.
            self.assertLess(time.monotonic() - started, 20)
            self.assertEqual(self.files(), [])

    def test_a_terminal_sees_progress(self):
        master, slave = pty.openpty()
        self.addCleanup(os.close, master)
        process = subprocess.Popen([COMMAND, "render", SCENE, "-i", "exhaustive", "--vpls", "5000", "--size", "64x64",
                                    "-o", self.folder / "a.exr"], stdout=subprocess.DEVNULL, stderr=slave)
        os.close(slave)
        text = b""
        while process.poll() is None or select.select([master], [], [], 0)[0]:
            if select.select([master], [], [], 0.1)[0]:
                try:
                    piece = os.read(master, 65536)
                except OSError:  # the other end is closed
                    break
                text += piece
        self.assertEqual(process.wait(), OK)
        self.assertIn(b"%", text)


class Compare(Cli):
    def image(self, name, pixel, size=(16, 8)):
        path = self.folder / name
        write_exr(path, *size, pixel)
        return path

    def measures(self, *arguments):
        result = lumicut("compare", *arguments, "--json")
        self.assert_ends(result, OK)
        return json.loads(result.stdout)

    def test_known_images_give_known_measures(self):
        # .5 and .75 are exact in half floats.
        reference = self.image("r.exr", lambda x, y: (0.5, 0.5, 0.5))
        image = self.image("i.exr", lambda x, y: (0.75, 0.75, 0.75) if x < 8 else (0.5, 0.5, 0.5))
        m = self.measures(image, reference)
        self.assertAlmostEqual(m["mean_relative_error"], 0.25)
        self.assertAlmostEqual(m["p99_relative_error"], 0.5)
        self.assertAlmostEqual(m["rmse"], 0.5 / 2 ** 0.5)
        self.assertAlmostEqual(m["bias"], 0.25)
        self.assertGreater(m["flip"], 0)
        same = self.measures(reference, reference)
        self.assertEqual((same["rmse"], same["lmse"], same["flip"], same["bad_pixels"]), (0, 0, 0, 0))

    def test_lamps_can_be_left_out(self):
        reference = self.image("r.exr", lambda x, y: (30, 30, 30) if x == 0 else (1, 1, 1))
        image = self.image("i.exr", lambda x, y: (90, 90, 90) if x == 0 else (1, 1, 1))
        self.assertGreater(self.measures(image, reference)["rmse"], 1)
        m = self.measures(image, reference, "--ignore-above", "20")
        self.assertEqual((m["rmse"], m["ignored_pixels"]), (0, 8))

    def test_error_images_are_written(self):
        a = self.image("a.exr", lambda x, y: (0.5, 0.5, 0.5))
        b = self.image("b.exr", lambda x, y: (0.5, 0.625, 0.5))
        error, flip = self.folder / "e.png", self.folder / "f.png"
        self.measures(a, b, "--error-image", error, "--scale", "16", "--flip-image", flip)
        for path in (error, flip):
            self.assertTrue(path.read_bytes().startswith(b"\x89PNG"))

    def test_images_that_do_not_fit_are_refused(self):
        a, b = self.image("a.exr", lambda x, y: (1, 1, 1)), self.image("b.exr", lambda x, y: (1, 1, 1), (8, 8))
        self.assert_ends(lumicut("compare", a, b), BAD_FILE, "16 x 8", "8 x 8")
        (self.folder / "c.exr").write_bytes(a.read_bytes()[:-50])
        self.assert_ends(lumicut("compare", self.folder / "c.exr", a), BAD_FILE, "c.exr")
        nan = self.image("n.exr", lambda x, y: (float("nan"), 1, 1))
        self.assert_ends(lumicut("compare", nan, a), FAILED, "not finite")


if __name__ == "__main__":
    unittest.main()
