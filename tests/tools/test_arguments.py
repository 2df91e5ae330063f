"""What the command line says and files say of themselves is refused before work begins, by name."""
import json
import os
import signal
import struct
import subprocess
import threading
import time
import unittest

from cli import BAD_FILE, COMMAND, INTERRUPTED, OK, SCENE, USAGE, Cli, lumicut, wait_until_caught, write_exr

SMALL = ["render", SCENE, "--size", "16x12", "--vpls", "50", "-q"]


class Arguments(Cli):
    def refused(self, code, *arguments, says):
        self.assert_ends(lumicut(*arguments), code, says)

    def test_numbers_that_are_none_are_no_numbers(self):
        out = self.folder / "a.exr"
        for option in ("--seconds", "--target-error", "--confidence", "--exposure"):
            for value in ("nan", "-nan", "1e39", "inf"):
                self.refused(USAGE, *SMALL, "-o", out, option, value, says=option)
        self.refused(USAGE, "mix", out, "--others", "nan", "-o", self.folder / "b.exr", says="--others")
        for option in ("--scale", "--error-map-top", "--ignore-above", "--exposure"):
            self.refused(USAGE, "compare", out, out, option, "nan", says=option)
        self.assertFalse(out.exists())

    def test_sizes_do_not_wrap(self):
        for size in ("4294967312x12", "-4294967280x12", "0x5", "65537x1", "16x", "16x12x1", "16.5x12"):
            self.refused(USAGE, *SMALL[:2], f"--size={size}", "-q", "-o", self.folder / "a.exr", says="--size")
            self.refused(USAGE, "flythrough", SCENE, self.folder / "none.json", f"--size={size}", "-o", self.folder / "f.exr", says="--size")
            self.refused(USAGE, "bench", "--scene", SCENE, "--run", "exhaustive", f"--size={size}", "-o", self.folder / "b", says="--size")

    def test_two_outputs_of_one_place_are_refused(self):
        place = self.folder / "a"
        (self.folder / "link").symlink_to(place)
        for other in (place, f"{self.folder}/./a", self.folder / "link"):
            self.refused(BAD_FILE, *SMALL, "-o", place, "--png", other, says="two outputs")
            self.refused(BAD_FILE, *SMALL, "-o", other, "--checkpoint", place, says="two outputs")
        self.assertFalse(place.exists())
        self.assert_ends(lumicut(*SMALL, "-o", "/dev/null", "--png", "/dev/null"), OK)

    def test_a_picture_has_no_name_of_another_kind(self):
        exr, png, jpg = (self.folder / f"a.{kind}" for kind in ("exr", "png", "JPG"))
        self.refused(USAGE, *SMALL, "-o", png, says="--output: " + str(png) + " ends in .png, and would hold .exr")
        self.refused(USAGE, *SMALL, "--png", jpg, says="would hold .png")
        self.refused(USAGE, "compare", exr, exr, "--error-map", jpg, says="would hold .png or .exr")
        self.refused(USAGE, *SMALL, "--preset", "", "-o", exr, says="--preset: no preset has an empty name")
        self.assertEqual(list(self.folder.iterdir()), [])

    def test_emission_of_no_area_gives_a_black_image(self):
        scene = self.folder / "dark.json"
        scene.write_text(json.dumps({
            "image": {"size": [16, 12]}, "camera": {"eye": [0, 0.3, 3], "at": [0, 0, 0], "fov_y": 40},
            "materials": [{"name": "m"}, {"name": "e", "emission": [5, 5, 5]}],
            "meshes": [{"positions": [[-1, -1, 0], [1, -1, 0], [0, 1, 0]], "triangles": [[0, 1, 2]], "material": "m"},
                       {"positions": [[0, 0, 0], [0, 0, 0], [0, 0, 0]], "triangles": [[0, 1, 2]], "material": "e"}]}))
        self.assert_ends(lumicut("render", scene, "-p", "compensate=true", "--vpls", "100", "-q", "-o", self.folder / "o.exr"), OK)

    def test_a_pipe_without_a_reader_is_an_error(self):
        pipe = self.folder / "pipe"
        os.mkfifo(pipe)
        self.assert_ends(lumicut(*SMALL, "-o", pipe), BAD_FILE, "nobody reads")

        def read_a_little():
            with open(pipe, "rb") as stream:
                stream.read(10)
        reader = threading.Thread(target=read_a_little)
        reader.start()
        result = lumicut("render", SCENE, "--size", "200x150", "--vpls", "10", "--layers", "all", "-q", "-o", pipe)
        reader.join()
        self.assert_ends(result, BAD_FILE, str(pipe))

    def test_what_is_no_checkpoint_is_named(self):
        kept = self.folder / "kept"
        kept.write_bytes(b"")
        self.assert_ends(lumicut(*SMALL, "--checkpoint", kept, "--resume", "-o", self.folder / "a.exr"), BAD_FILE, str(kept))
        loop = self.folder / "loop"
        loop.symlink_to(loop)
        self.assert_ends(lumicut(*SMALL, "--checkpoint", loop, "--resume", "-o", self.folder / "a.exr"), BAD_FILE, str(loop))

    def test_damaged_results_of_a_bench_are_named(self):
        out = self.folder / "bench"
        plan = ["bench", "--scene", SCENE, "--run", "exhaustive", "--size", "16x12", "--vpls", "50", "-q", "-o", out]
        self.assert_ends(lumicut(*plan), OK)
        whole = json.loads((out / "results.json").read_text())
        for path in (["machine"], ["machine", "processor"], ["git"], ["format"], ["rows"], ["yardsticks"]):
            for value in (None, 1, "x"):
                damaged = json.loads(json.dumps(whole))
                at = damaged
                for key in path[:-1]:
                    at = at[key]
                if value is None:
                    del at[path[-1]]
                else:
                    at[path[-1]] = value
                (out / "results.json").write_text(json.dumps(damaged))
                result = lumicut(*plan, "--resume")
                self.assertIn(result.returncode, (OK, BAD_FILE), (path, value, result.stderr))
                if result.returncode == BAD_FILE:
                    self.assertIn("results.json", result.stderr)
        row = dict(whole["rows"][0])
        del row["preprocess_seconds"]
        (out / "results.json").write_text(json.dumps({**whole, "rows": [row]}))
        self.assert_ends(lumicut(*plan, "--resume"), OK)  # the row is made anew
        self.assertIn("preprocess_seconds", json.loads((out / "results.json").read_text())["rows"][0])
        (self.folder / "r.json").write_text('{"format": 1}')
        self.assert_ends(lumicut("report", self.folder / "r.json"), BAD_FILE, "r.json")

    def test_a_picture_larger_than_memory_is_refused(self):
        def attribute(name, kind, data):
            return name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<i", len(data)) + data
        side, channels = 16384, 64
        names = b"".join(b"c%02d\0" % c + struct.pack("<iBBBBii", 2, 0, 0, 0, 0, 1, 1) for c in range(channels)) + b"\0"
        box = struct.pack("<iiii", 0, 0, side - 1, side - 1)
        header = (attribute("channels", "chlist", names) + attribute("compression", "compression", b"\3") + attribute("dataWindow", "box2i", box)
                  + attribute("displayWindow", "box2i", box) + attribute("lineOrder", "lineOrder", b"\0")
                  + attribute("pixelAspectRatio", "float", struct.pack("<f", 1)) + attribute("screenWindowCenter", "v2f", bytes(8))
                  + attribute("screenWindowWidth", "float", struct.pack("<f", 1)))
        start = struct.pack("<ii", 20000630, 2) + header + b"\0"
        chunks = side // 16
        chunk = struct.pack("<ii", 0, 4) + bytes(2200)  # enough bytes a sample that the header alone is believed
        table = b"".join(struct.pack("<Q", len(start) + 8 * chunks + i * len(chunk)) for i in range(chunks))
        big = self.folder / "big.exr"
        big.write_bytes(start + table + chunk * chunks)
        if 4 * channels * side * side < os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2:
            self.skipTest("this machine has more memory than the picture takes")
        self.assert_ends(lumicut("compare", big, big), BAD_FILE, "memory")


    def scene(self, name="far.json", **changes):
        scene = {"image": {"size": [16, 12]}, "camera": {"eye": [0, 0.3, 3], "at": [0, 0, 0], "fov_y": 40},
                 "materials": [{"name": "m"}],
                 "meshes": [{"positions": [[-1, -1, 0], [1, -1, 0], [0, 1, 0]], "triangles": [[0, 1, 2]], "material": "m"}],
                 "lights": [{"type": "point", "position": [0, 2, 2], "value": 10}]}
        path = self.folder / name
        path.write_text(json.dumps({**scene, **changes}))
        return path

    def test_no_output_takes_the_place_of_an_input(self):
        scene, image, lights = self.scene("scene.json"), self.folder / "a.exr", self.folder / "a.vpl"
        self.assert_ends(lumicut("render", scene, "--size", "8x8", "--vpls", "20", "-q", "-o", image, "--vpl-out", lights), OK)
        (self.folder / "link.json").symlink_to(scene)
        (self.folder / "link.png").symlink_to(image)
        kept = {path: path.read_bytes() for path in (scene, image, lights)}
        for words in (["render", scene, "-o", scene], ["render", self.folder / "link.json", "--stats", scene],
                      ["render", scene, "--passes", "2", "--checkpoint", scene, "-o", self.folder / "b.exr"], ["render", scene, "--vpl-in", lights, "-o", lights],
                      ["compare", image, image, "--error-image", self.folder / "link.png"], ["mix", image, "-o", image]):
            with self.subTest(words):
                self.assert_ends(lumicut(*words), BAD_FILE, "is read")
        self.assertEqual({path: path.read_bytes() for path in kept}, kept)

    def test_values_of_files_are_refused_in_the_files_terms(self):
        lamp = {"type": "point", "position": [0, 2, 2], "value": 10}
        for changes, says in (
                ({"camera": {"eye": [0, 0, 1e18], "at": [0, 0, 0], "fov_y": 40}}, "camera.eye[2]"),
                ({"camera": {"eye": [0, 0, 3], "at": [0, 0, 0], "fov_y": 0.001}}, "camera.fov_y"),
                ({"camera": {"eye": [0, 0, 3], "at": [0, 0, 0], "fov_y": 40, "lens_radius": 1e18, "focus_distance": 1}}, "camera.lens_radius"),
                ({"lights": [lamp, {**lamp, "radius": 1e18}]}, "lights[1].radius"),
                ({"lights": [lamp, {**lamp, "type": "spot", "direction": [0, 0, 1], "angle": 360}]}, "lights[1].angle"),
                # Only the library sees this one: the edges are of lengths that a file may have.
                ({"lights": [lamp, {**lamp, "type": "rectangle", "u": [1e-20, 0, 0], "v": [0, 1e-20, 0]}]}, "lights[1].u"),
                ({"unit_scale": 1e12, "camera": {"eye": [0, 0, 1e6], "at": [0, 0, 0], "fov_y": 40}}, "camera.eye[2]")):
            path = self.scene(**changes)
            self.assert_ends(lumicut("render", path, "-q", "-o", self.folder / "a.exr"), BAD_FILE, str(path), says)
        (self.folder / "far.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1e18 0\nf 1 2 3\n")
        self.assert_ends(lumicut("render", self.scene(meshes=[{"obj": "far.obj"}]), "-q", "-o", self.folder / "a.exr"), BAD_FILE,
                         "far.obj", "line 3")

    def test_any_unit_renders(self):
        for scale in (1e-9, 1e9):
            self.assert_ends(lumicut("render", self.scene(unit_scale=scale), "-q", "-o", self.folder / "a.exr"), OK)

    def test_a_checkpoint_of_something_else_is_the_files_fault(self):
        kept = self.folder / "kept"
        kept.write_bytes(b"no checkpoint" * 100)
        self.assert_ends(lumicut(*SMALL, "--checkpoint", kept, "--resume", "-o", self.folder / "a.exr"), BAD_FILE, str(kept))
        self.assert_ends(lumicut(*SMALL, "--checkpoint", kept, "-o", self.folder / "a.exr"), OK)
        self.assert_ends(lumicut("render", self.scene(), "-q", "--checkpoint", kept, "--resume", "-o", self.folder / "b.exr"), BAD_FILE, str(kept))

    def test_empty_values_are_refused(self):
        out = self.folder / "a.exr"
        for option in ("-i", "--png", "--stats", "--checkpoint", "--vpl-in", "--vpl-out", "--heat-map", "--layers", "--size", "--crop", "--builder"):
            self.refused(USAGE, *SMALL[:2], "-q", "-o", out, option, "", says="is empty")
        self.refused(USAGE, "render", "", "-o", out, says="scene: is empty")
        self.refused(USAGE, "compare", out, "", says="reference: is empty")
        self.assertFalse(out.exists())

    def test_an_unknown_command_is_named(self):
        self.refused(USAGE, "rendr", SCENE, says='no command "rendr"; there are render, ')

    def test_whole_numbers_keep_their_sign(self):
        for option in ("--vpls", "--seed"):
            for value in ("-1", "99999999999999999999", "1x"):
                self.refused(USAGE, *SMALL[:2], "-q", "-o", self.folder / "a.exr", option, value, says=f"{option}: {value} is no number from")
        self.refused(USAGE, "check", SCENE, "--size", "0x5", says="--size 0x5: 0 is not 1 to 65536")
        self.refused(USAGE, *SMALL, "--layers", "depth,depth", "-o", self.folder / "a.exr", says="depth stands there twice")

    def test_no_passes_without_another_end_are_refused(self):
        self.refused(USAGE, *SMALL, "--passes", "0", "-o", self.folder / "a.exr", says="--passes 0: until --seconds or --target-error")
        self.assert_ends(lumicut(*SMALL, "--passes", "0", "--seconds", "0.1", "-o", self.folder / "a.exr"), OK)

    def test_the_version_names_what_traces_rays(self):
        said = lumicut("--version")
        self.assert_ends(said, OK)
        self.assertRegex(said.stdout, r"^lumicut \d+\.\d+\.\d+, ABI \d+\.\d+\nrays: bvh(, embree)?\n$")
        self.assertIn(said.stdout.splitlines()[1], lumicut("info").stdout)

    def test_json_of_other_encodings_or_with_zero_bytes_is_refused(self):
        text = self.scene().read_text()
        for bad, says in ((text.encode() + b"\0\0", f"line 1, column {len(text) + 1}: not JSON: a zero byte"), (b"{}\n{\0", "line 2, column 2"),
                          *((text.encode(name), "is UTF-16 text; save it as UTF-8") for name in ("utf-16", "utf-16-le", "utf-16-be"))):
            (self.folder / "bad.json").write_bytes(bad)
            self.refused(BAD_FILE, "check", self.folder / "bad.json", says=says)
        self.refused(BAD_FILE, "check", self.scene(environment={"skies": {}, "colour": 1}), says="environment")
        said = lumicut("check", self.scene(environment={"zzzzzzzz": 1})).stderr
        self.assertEqual(said.count("sky"), 1, said)

    def test_ctrl_c_ends_what_only_computes(self):
        # Rows of a small image many times over: reading them takes a good part of a second.
        small, wide, side = self.folder / "small.exr", self.folder / "wide.exr", 4000
        write_exr(small, side, 1, lambda x, y: (0.5, 0.5, 0.5))
        window = struct.pack("<4i", 0, 0, side - 1, 0)
        header, row = small.read_bytes().split(struct.pack("<ii", 0, 6 * side))
        header = header[:-8].replace(window, struct.pack("<4i", 0, 0, side - 1, side - 1))
        first = len(header) + 8 * side
        table = b"".join(struct.pack("<Q", first + y * (8 + len(row))) for y in range(side))
        wide.write_bytes(header + table + b"".join(struct.pack("<ii", y, len(row)) + row for y in range(side)))
        outputs = [self.folder / name for name in ("a.png", "b.exr", "c.exr")]
        self.refused(BAD_FILE, "mix", wide, "-o", outputs[2], says="has no layers radiance.GROUP")
        for number in (signal.SIGINT, signal.SIGTERM):
            for command in (["compare", wide, wide, "--hdr-flip", "--flip-image", outputs[0], "--error-map", outputs[1]], ["mix", wide, "-o", outputs[2]]):
                process = subprocess.Popen([COMMAND, *map(str, command)], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
                wait_until_caught(process, number)
                process.send_signal(number)
                said = process.communicate(timeout=60)[1]
                self.assertEqual(process.returncode, INTERRUPTED, said)
                self.assertIn("interrupted; nothing was written", said)
        self.assertFalse(any(path.exists() for path in outputs))

    def test_ctrl_c_ends_the_reading_of_files_at_once(self):
        (self.folder / "big.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\n" + "f 1 2 3\n" * 6000000)
        path = self.scene(meshes=[{"obj": "big.obj"}, {"obj": "none.obj"}])
        started = time.monotonic()
        self.assert_ends(lumicut("check", path), BAD_FILE, "none.obj")
        whole = time.monotonic() - started
        for command in (["render", path, "-o", self.folder / "a.exr"], ["check", path]):
            process = subprocess.Popen([COMMAND, *map(str, command)], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
            wait_until_caught(process, signal.SIGINT)
            time.sleep(whole / 8)
            process.send_signal(signal.SIGINT)
            started = time.monotonic()
            said = process.communicate()[1]
            self.assertEqual(process.returncode, INTERRUPTED)
            self.assertIn("nothing was written", said)
            self.assertLess(time.monotonic() - started, whole / 4)


class Geometry(Cli):
    def hitting_set(self, disks):
        (self.folder / "points.csv").write_bytes(b"0,0\n0.1,0\n1,0\n")
        (self.folder / "disks.csv").write_bytes(disks)
        command = os.path.join(os.environ["LUMICUT_BINARY_DIR"], "bin/lumicut-geometry")
        return subprocess.run([command, "hitting-set", "--points", self.folder / "points.csv", "--disks", self.folder / "disks.csv"],
                              capture_output=True, text=True)

    def test_a_byte_order_mark_or_a_number_out_of_range_is_no_heading(self):
        self.assertEqual(self.hitting_set(b"\xef\xbb\xbfx,y,radius\n1,0,0.5\n").returncode, 0)
        first = self.hitting_set(b"\xef\xbb\xbf5,5,0.5\n1,0,0.5\n")
        self.assertNotEqual(first.returncode, 0)
        self.assertIn("disk 0", first.stderr)
        far = self.hitting_set(b"5e400,5,0.5\n1,0,0.5\n")
        self.assertNotEqual(far.returncode, 0)
        self.assertIn("line 1", far.stderr)


if __name__ == "__main__":
    unittest.main()
