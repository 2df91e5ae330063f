"""Files and streams of the command: full disks, links, pipes, devices, names in any language."""
import json
import os
import pathlib
import resource
import signal
import stat
import subprocess
import threading
import time
import unittest

from cli import BAD_FILE, BUILD, COMMAND, OK, SCENE, Cli, lumicut, together, wait_until_caught

GEOMETRY = BUILD / "bin/lumicut-geometry"
SMALL = ("--vpls", "50", "-q", "--size", "16x16", "--layers", "radiance")
TRIANGLE = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl m\nf 1/1 2/1 3/1\n"


def scene(**more):
    return {"camera": {"eye": [0, 0, 3], "at": [0, 0, 0], "fov_y": 40}, "materials": [{"name": "m"}],
            "meshes": [{"positions": [[0, 0, 0], [1, 0, 0], [0, 1, 0]], "triangles": [[0, 1, 2]], "material": "m"}],
            "lights": [{"type": "point", "position": [0, 0, 2], "value": 1}], **more}


class Files(Cli):
    def write_scene(self, name="scene.json", **more):
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(scene(**more)))
        return path

    def render(self, *arguments, **more):
        return subprocess.run([COMMAND, "render", SCENE, *SMALL, *map(str, arguments)], capture_output=True,
                              timeout=300, **more)


class Output(Files):
    def test_a_full_disk_is_an_error_and_the_old_files_stay(self):
        names = ("a.exr", "a.png", "s.json", "v.vpl")
        for name in names:
            (self.folder / name).write_text("old")

        def limit():  # of each file; SIGXFSZ must not end the command either
            resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100))

        for option, name in zip(("-o", "--png", "--stats", "--vpl-out"), names):
            result = self.render(option, self.folder / name, preexec_fn=limit)
            self.assertEqual(result.returncode, BAD_FILE, result.stderr)
            self.assertIn(name.encode() + b": cannot be written: File too large", result.stderr)
        self.assertEqual(self.files(), sorted(names))
        self.assertEqual({(self.folder / name).read_text() for name in names}, {"old"})

    def test_a_link_stays_and_a_mode_is_kept(self):
        (self.folder / "else").mkdir()
        there = self.folder / "else/a.exr"
        there.write_text("old")
        there.chmod(0o600)
        link = self.folder / "a.exr"
        link.symlink_to("else/a.exr")
        self.assertEqual(self.render("-o", link).returncode, OK)
        self.assertTrue(link.is_symlink())
        self.assertEqual(there.read_bytes()[:4], b"\x76\x2f\x31\x01")
        self.assertEqual(stat.S_IMODE(there.stat().st_mode), 0o600)
        self.assertEqual(os.listdir(self.folder / "else"), ["a.exr"])

    def assert_same_picture(self, streamed, path):
        # Not byte for byte: the header holds the seconds that the render took.
        (self.folder / "streamed.exr").write_bytes(streamed)
        result = lumicut("compare", self.folder / "streamed.exr", path, "--json", "--no-flip")
        self.assert_ends(result, OK)
        self.assertEqual(json.loads(result.stdout)["max_relative_error"], 0)

    def test_devices_and_pipes_stay(self):
        self.assertEqual(self.render("-o", "/dev/null").returncode, OK)
        self.assertTrue(pathlib.Path("/dev/null").is_char_device())
        result = self.render("-o", "/dev/full")
        self.assertEqual(result.returncode, BAD_FILE)
        self.assertIn(b"/dev/full: cannot be written: No space left", result.stderr)
        streamed = self.render("-o", "/dev/stdout").stdout
        self.assertEqual(self.render("-o", self.folder / "a.exr").returncode, OK)
        self.assert_same_picture(streamed, self.folder / "a.exr")
        pipe = self.folder / "pipe"
        os.mkfifo(pipe)
        came = []
        reader = threading.Thread(target=lambda: came.append(pipe.read_bytes()))
        reader.start()
        self.assertEqual(self.render("-o", pipe).returncode, OK)
        reader.join()
        self.assert_same_picture(came[0], self.folder / "a.exr")
        self.assertTrue(pipe.is_fifo())

    def test_a_copy_of_a_device_stays(self):
        copy = self.folder / "null"
        try:
            os.mknod(copy, 0o666 | stat.S_IFCHR, os.makedev(1, 3))
            copy.open("wb").close()
        except PermissionError:
            self.skipTest("making device files needs root, and a file system that has them")
        self.assertEqual(self.render("-o", copy).returncode, OK)
        self.assertTrue(copy.is_char_device())

    def test_standard_output_that_is_full_is_an_error(self):
        image = self.folder / "a.exr"
        self.assertEqual(self.render("-o", image).returncode, OK)
        points, disks = self.folder / "p.csv", self.folder / "d.csv"
        points.write_text("0,0\n1,1\n"), disks.write_text("0,0,2\n")
        calls = [[COMMAND, *words] for words in (
            ["--help"], ["info"], ["info", "--json"], ["render", "--help"], ["compare", image, image, "--json"],
            ["compare", image, image, "--no-flip"], ["check", SCENE, "--no-forecast"],
            ["render", SCENE, "--vpls", "50", "--size", "16x16", "-o", self.folder / "b.exr"])]
        if GEOMETRY.exists():
            calls += [[GEOMETRY, "--help"], [GEOMETRY, "hitting-set", "--points", points, "--disks", disks]]
        for call in calls:
            with open("/dev/full", "w") as full:
                result = subprocess.run(call, stdout=full, stderr=subprocess.PIPE, text=True, timeout=300)
            self.assertNotEqual(result.returncode, OK, call)
            self.assertIn("standard output: cannot be written: No space left", result.stderr, call)
        self.assertTrue((self.folder / "b.exr").exists(), "the image was written before")

    def test_a_reader_that_has_gone_is_no_message(self):
        for restore in (True, False):  # SIGPIPE ends the command, or is ignored
            read, write = os.pipe()
            os.close(read)
            result = subprocess.run([COMMAND, "info"], stdout=write, stderr=subprocess.PIPE, timeout=60,
                                    restore_signals=restore)
            os.close(write)
            self.assertNotEqual(result.returncode, OK)
            self.assertEqual(result.stderr, b"")

    def test_a_message_that_cannot_be_written_ends_no_render(self):
        path = self.write_scene(lights=[])
        with open("/dev/full", "w") as full:
            result = subprocess.run([COMMAND, "render", path, *SMALL, "-o", self.folder / "a.exr"], stderr=full, timeout=60)
        self.assertNotEqual(result.returncode, -signal.SIGABRT)
        self.assertNotEqual(result.returncode, 1)

    def test_text_goes_into_no_file_where_standard_output_is_closed(self):
        result = subprocess.run(["sh", "-c", '"$@" >&-', "sh", COMMAND, "render", SCENE, "--vpls", "50", "--size", "16x16",
                                 "-o", self.folder / "a.exr"], stderr=subprocess.PIPE, text=True, timeout=60)
        self.assertEqual(result.returncode, BAD_FILE)
        self.assertIn("standard output: cannot be written", result.stderr)
        self.assertNotIn(b"lights, 16x16", (self.folder / "a.exr").read_bytes())


class Input(Files):
    def test_pipes_nobody_writes_into_and_devices_are_refused_at_once(self):
        pipe = self.folder / "pipe"
        os.mkfifo(pipe)
        (self.folder / "pipe.exr").symlink_to("pipe")
        good = self.write_scene()
        for what, why in ((pipe, "nobody writes"), ("/dev/zero", "is a device")):
            mesh = self.write_scene("mesh.json", meshes=[{"obj": str(what), "material": "m"}])
            ies = self.write_scene("ies.json", lights=[{"type": "point", "position": [0, 0, 2], "value": 1, "direction": [0, 0, -1],
                                                      "ies": str(what)}])
            calls = (["check", what, "--no-forecast"], ["check", mesh, "--no-forecast"],
                     ["check", ies, "--no-forecast"],
                     ["render", good, "--vpl-in", what, "-o", self.folder / "o.exr"],
                     ["render", good, "--passes", "2", "--checkpoint", what, "--resume", "-o", self.folder / "o.exr"],
                     ["bench", what, "-o", self.folder / "bench"], ["report", what, "-o", self.folder / "r.html"])
            begin = time.monotonic()
            for result in together([lambda words=words: lumicut(*words) for words in calls]):  # each waits 2 s for a writer
                self.assert_ends(result, BAD_FILE, f"{what}: ", why)
            self.assertLess(time.monotonic() - begin, 60)  # a hang's guard
        image = self.write_scene("image.json", environment={"image": str(pipe)})
        self.assert_ends(lumicut("check", image, "--no-forecast"), BAD_FILE, "is a pipe")
        self.assert_ends(lumicut("compare", self.folder / "pipe.exr", self.folder / "pipe.exr"), BAD_FILE, "is a pipe")
        self.assert_ends(lumicut("compare", "/dev/zero", "/dev/zero"), BAD_FILE, "is a device")

    def test_a_scene_comes_through_a_pipe(self):
        text = self.write_scene().read_text()
        result = subprocess.run([COMMAND, "check", "/dev/stdin", "--no-forecast"], input=text, text=True,
                                capture_output=True, timeout=60)
        self.assert_ends(result, OK)

    def test_a_pipe_that_is_silent_is_left_on_interrupt(self):
        pipe = self.folder / "pipe"
        os.mkfifo(pipe)
        writer = os.open(pipe, os.O_RDWR)  # holds it open and writes nothing
        process = subprocess.Popen([COMMAND, "check", pipe, "--no-forecast"], stderr=subprocess.PIPE)
        wait_until_caught(process, signal.SIGINT)
        time.sleep(0.2)  # reading begins at once after that
        process.send_signal(signal.SIGINT)
        self.assertNotEqual(process.wait(60), OK)
        process.stderr.close()
        os.close(writer)

    def test_deeply_nested_json_is_an_error_everywhere(self):
        good = self.write_scene()
        for opening in ("[", '{"a":'):
            deep = self.folder / "deep.json"
            deep.write_text(opening * 200_000)
            (self.folder / "bench").mkdir(exist_ok=True)
            (self.folder / "bench/results.json").write_text(deep.read_text())
            plan = self.folder / "plan.json"
            plan.write_text(json.dumps({"scenes": [str(good)], "runs": [{"integrator": "exhaustive"}]}))
            for words in (["check", deep], ["report", deep, "-o", self.folder / "r.html"], ["bench", deep, "-o", "b"],
                          ["bench", plan, "-o", self.folder / "bench", "--resume"],
                          ["flythrough", good, deep, "-o", self.folder / "f"]):
                result = lumicut(*words)
                self.assertEqual(result.returncode, BAD_FILE, (words, result.stderr))
                self.assertIn("nested deeper than 64", result.stderr, words)

    def test_the_values_of_variables_are_not_printed(self):
        path = self.write_scene(meshes=[{"obj": "/nowhere/${MY_SECRET}", "material": "m"}])
        plan = self.folder / "plan.json"
        plan.write_text(json.dumps({"scenes": ["/nowhere/${MY_SECRET}.json"], "runs": [{"integrator": "exhaustive"}]}))
        for words in (["check", path], ["render", path, "-o", self.folder / "a.exr"],
                      ["bench", plan, "-o", self.folder / "bench"]):
            result = lumicut(*words, env={"MY_SECRET": "hunter2"})
            self.assert_ends(result, BAD_FILE, "/nowhere/${MY_SECRET}")
            self.assertNotIn("hunter2", result.stderr + result.stdout)

    def test_a_small_image_that_claims_to_be_big_takes_no_memory(self):
        import struct
        import zlib

        def chunk(kind, data):
            return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

        claim = self.folder / "claim.png"
        claim.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", 16384, 16384, 16, 6, 0, 0, 0)) +
                          chunk(b"IDAT", zlib.compress(b"")) + chunk(b"IEND", b""))
        path = self.write_scene(materials=[{"name": "m", "diffuse_texture": "claim.png"}])
        result = subprocess.run([COMMAND, "check", path, "--no-forecast"], stderr=subprocess.PIPE, text=True, timeout=60,
                                preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (3 << 30, 3 << 30)))
        self.assert_ends(result, BAD_FILE, "claim.png", "16384 x 16384")


class Names(Files):
    def test_paths_in_any_language(self):
        for name in ("Küche 灯", "it's \"so\" 100%s", "line\nbreak", os.fsdecode(b"latin\xe9")):
            folder = self.folder / name
            folder.mkdir()
            (folder / f"{name}.obj").write_text(TRIANGLE)
            (folder / "m.mtl").write_text("newmtl m\nKd 1 1 1\n")
            word = name if name.isprintable() else "x"  # JSON is UTF-8
            mesh = {"obj": f"{name}.obj"} if word == name else scene()["meshes"][0]
            path = folder / f"{name}.json"
            path.write_text(json.dumps(scene(meshes=[mesh]), ensure_ascii=False))
            out, plan = folder / f"{name}.exr", folder / f"{name}.plan"
            words = ["render", path, *SMALL, "--passes", "2", "--checkpoint", folder / f"{name}.ck", "-o", out, "--png",
                     folder / f"{name}.png", "--stats", folder / f"{name}.stats"]
            self.assert_ends(lumicut(*words, env={"LANG": "C", "LC_ALL": "C"}), OK)
            self.assert_ends(lumicut("compare", out, out), OK)
            self.assert_ends(lumicut("check", path, "--no-forecast"), OK)
            if word == name:
                plan.write_text(json.dumps({"scenes": [{"file": f"{name}.json", "size": [8, 8], "vpls": 20}],
                                            "runs": [{"integrator": "lightcuts"}]}, ensure_ascii=False))
                self.assert_ends(lumicut("bench", plan, "-o", folder / "bench", "-q"), OK)
                self.assert_ends(lumicut("report", folder / "bench/results.json", "-o", folder / f"{name}.html"), OK)
            self.assertFalse([p for p in os.listdir(folder) if p.endswith(".part")])


if __name__ == "__main__":
    unittest.main()
