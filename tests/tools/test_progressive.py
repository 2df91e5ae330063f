"""`lumicut render` in passes: stopped, killed, gone on; light groups mixed anew; illuminance."""
import json
import resource
import signal
import subprocess
import time
import unittest

from cli import BAD_FILE, COMMAND, INTERRUPTED, OK, SCENE, USAGE, Cli, lumicut

SMALL = ["--size", "48x48", "--vpls", "300", "-q"]


class Compared(Cli):
    def difference(self, a, b, *arguments):
        result = lumicut("compare", a, b, "--json", "--no-flip", *arguments)
        self.assert_ends(result, OK)
        return json.loads(result.stdout)


class Progressive(Compared):
    def test_a_killed_render_goes_on_to_the_unbroken_image(self):
        whole, broken = self.folder / "whole.exr", self.folder / "broken.exr"
        kept = self.folder / "render.checkpoint"
        passes = ["--passes", "16", "-p", "compensate=true", *SMALL]
        self.assert_ends(lumicut("render", SCENE, *passes, "--layers", "radiance,error", "-o", whole), OK)
        process = subprocess.Popen([COMMAND, "render", SCENE, *passes, "--threads", "1", "--checkpoint", kept, "-o", broken])
        limit = time.monotonic() + 60
        while not kept.exists() and process.poll() is None and time.monotonic() < limit:
            time.sleep(0.005)
        process.send_signal(signal.SIGKILL)
        process.wait()
        self.assertTrue(kept.exists())
        self.assertFalse(broken.exists())
        self.assert_ends(lumicut("render", SCENE, *passes, "--layers", "radiance,error", "--checkpoint", kept, "--resume",
                                 "-o", broken), OK)
        self.assertEqual(self.difference(broken, whole)["rmse"], 0)
        self.assertEqual(self.difference(broken, whole, "--layer", "error")["rmse"], 0)

    def test_denoising_writes_its_layers_and_changes_no_other(self):
        plain, denoised, named = (self.folder / name for name in ("plain.exr", "denoised.exr", "named.exr"))
        render = ["render", SCENE, "--passes", "4", "-p", "compensate=true", *SMALL]
        self.assert_ends(lumicut(*render, "-o", plain), OK)
        self.assert_ends(lumicut(*render, "--denoise", "-o", denoised), OK)
        self.assert_ends(lumicut(*render, "--layers", "denoised", "-o", named), OK)
        self.assertEqual(self.difference(denoised, plain)["rmse"], 0)
        self.assertGreater(self.difference(denoised, plain, "--layer", "denoised", "--reference-layer", "radiance")["rmse"], 0)
        self.assertEqual(self.difference(named, denoised, "--layer", "denoised")["rmse"], 0)
        self.assertGreater(self.difference(denoised, plain, "--layer", "denoising_albedo", "--reference-layer", "radiance")["rmse"], 0)

    def test_a_stopped_render_keeps_its_passes(self):
        kept = self.folder / "render.checkpoint"
        process = subprocess.Popen([COMMAND, "render", SCENE, "--passes", "100000", *SMALL, "--checkpoint", kept, "-o",
                                    self.folder / "a.exr"], stderr=subprocess.PIPE, text=True)
        limit = time.monotonic() + 60
        while not kept.exists() and process.poll() is None and time.monotonic() < limit:
            time.sleep(0.005)
        process.send_signal(signal.SIGINT)
        said = process.communicate(timeout=60)[1]
        self.assertEqual(process.returncode, INTERRUPTED)
        self.assertIn("render.checkpoint holds the passes that were done", said)
        self.assertEqual(self.files(), ["render.checkpoint"])

    def test_checkpoints_of_anything_else_are_refused(self):
        kept = self.folder / "render.checkpoint"
        arguments = ["render", SCENE, *SMALL, "--checkpoint", kept, "-o", self.folder / "a.exr"]
        self.assert_ends(lumicut(*arguments, "--passes", "2"), OK)
        other = lumicut(*arguments, "--resume", "--passes", "4", "--seed", "5")
        self.assertNotEqual(other.returncode, OK)
        self.assertIn("render.checkpoint", other.stderr)
        self.assertEqual(other.stderr, f"lumicut: {kept}: it was made with --seed 1 instead of 5. Give what it was made with, or begin anew "
                                       "without --resume\n")
        for words, said in ((("-p", "clamp_lights=9"), "-p clamp_lights=40 instead of 9"), (("--spp", "2"), "--spp 1 instead of 2"),
                            (("--crop", "0,0,8,8"), "another --crop"), (("--rays", "fast"), "another --accel, --builder or --rays")):
            self.assertIn("it was made with " + said, lumicut(*arguments, "--resume", "--passes", "4", *words).stderr)
        self.assertIn("it was made without --groups. ", lumicut(*arguments, "--resume", "--passes", "4", "--groups").stderr)
        kept.write_bytes(kept.read_bytes()[:-100])
        damaged = lumicut(*arguments, "--resume", "--passes", "4")
        self.assertNotEqual(damaged.returncode, OK)
        self.assertIn("cut short or damaged", damaged.stderr)

    def test_a_checkpoint_that_holds_all_passes_gives_the_image(self):
        whole, image, lights = (self.folder / name for name in ("whole.exr", "image.exr", "lights.vpl"))
        kept = self.folder / "render.checkpoint"
        render = ["render", SCENE, *SMALL, "--layers", "radiance,error", "--checkpoint", kept]
        self.assert_ends(lumicut(*render, "--passes", "3", "-o", whole, "--vpl-out", lights), OK)
        before, traced = kept.read_bytes(), lights.read_bytes()
        lights.unlink()
        # As when the run was killed, or the image's disk full, after the last pass.
        result = lumicut(*render, "--passes", "3", "--resume", "-o", image, "--vpl-out", lights)
        self.assert_ends(result, OK)
        self.assertEqual(result.stderr, "")
        self.assertEqual(self.difference(image, whole)["rmse"], 0)
        self.assertEqual(self.difference(image, whole, "--layer", "error")["rmse"], 0)
        self.assertEqual(lights.read_bytes(), traced)
        self.assertEqual(kept.read_bytes(), before)
        # Fewer were asked for: of what is held nothing can be taken away.
        for passes in (["--passes", "2"], []):
            image.unlink()
            self.assert_ends(lumicut(*render, *passes, "--resume", "-o", image), OK,
                             "render.checkpoint holds more passes than were asked for: the image is of all 3")
            self.assertEqual(self.difference(image, whole)["rmse"], 0)
        # A target that is reached, and a time that is over, ask for no more either.
        nine = ["--passes", "9"]
        self.assert_ends(lumicut(*render, *nine, "--resume", "-o", whole), OK)
        for stop in (["--target-error", "1000"], ["--seconds", "1e-9"]):
            result = lumicut(*render, *stop, "--resume", "-o", image)
            self.assert_ends(result, OK)
            self.assertEqual(result.stderr, "")
            self.assertEqual(self.difference(image, whole)["rmse"], 0)

    def test_a_checkpoint_that_cannot_be_written_is_noticed_before_the_first_pass(self):
        image = self.folder / "a.exr"
        endless = ["render", SCENE, *SMALL, "--passes", "1000000", "-o", image]
        nowhere = lumicut(*endless, "--checkpoint", self.folder / "none" / "a.checkpoint")
        self.assert_ends(nowhere, BAD_FILE, "none", "no place for a checkpoint", "does not exist")
        # No file may be larger: a full disk that needs no disk. A checkpoint of 48x48 pixels takes 250 kB.
        full = subprocess.run([COMMAND, *map(str, endless), "--checkpoint", self.folder / "a.checkpoint"],
                              capture_output=True, text=True, timeout=300, restore_signals=False,
                              preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (100000, 100000)))
        self.assert_ends(full, BAD_FILE, "a.checkpoint", "no place for a checkpoint", "cannot be written")
        self.assertEqual(self.files(), [])

    def test_room_for_light_groups_is_asked_for_too(self):
        scene = self.folder / "groups.json"
        scene.write_text(json.dumps(Mix.SCENE))
        kept = self.folder / "a.checkpoint"
        # 48x48 pixels of 116 bytes are 267,264, and of two groups 55,296 more.
        for groups, code in (([], OK), (["--groups"], BAD_FILE)):
            result = subprocess.run([COMMAND, "render", scene, *SMALL, *groups, "--checkpoint", kept, "-o", self.folder / "a.exr", "--layers",
                                     "radiance"], capture_output=True, text=True, timeout=300, restore_signals=False,
                                    preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (300000, 300000)))
            self.assert_ends(result, code, *(["no place for a checkpoint"] if groups else []))

    def test_a_checkpoint_that_fails_later_costs_no_image(self):
        image, folder = self.folder / "a.exr", self.folder / "folder"
        folder.mkdir()
        kept = folder / "a.checkpoint"
        process = subprocess.Popen([COMMAND, "render", SCENE, *SMALL, "--seconds", "3", "--checkpoint", kept, "-o", image],
                                   stderr=subprocess.PIPE, text=True)
        limit = time.monotonic() + 60
        while not kept.exists() and process.poll() is None and time.monotonic() < limit:
            time.sleep(0.005)
        folder.rename(self.folder / "away")
        _, told = process.communicate(timeout=120)
        self.assertEqual(process.returncode, BAD_FILE, told)
        self.assertIn("the image will be written all the same", told)
        self.assertEqual(told.count("the image will be written all the same"), 1)
        self.assertEqual(self.difference(image, image)["rmse"], 0)
        self.assertTrue((self.folder / "away" / "a.checkpoint").exists())

    def test_a_target_stops_when_the_error_is_reached(self):
        stats = self.folder / "stats.json"
        self.assert_ends(lumicut("render", SCENE, *SMALL, "--target-error", "0.6", "--stats", stats), OK)
        values = json.loads(stats.read_text())["values"]
        self.assertGreaterEqual(values["passes"], 8)
        self.assertLessEqual(values["error"], 0.6)

    def test_the_costliest_program_is_cancelled_at_once(self):
        # A hit takes some milliseconds and a pixel minutes, so that a cancel that waits for a pixel's end comes too late.
        steps = [{"op": "position"}] + [{"op": "voronoi", "mode": 11, "inputs": [0, [i], [1], [1], [1]]} for i in range(1000)]
        for slot in ("diffuse_texture", "emission_texture", "opacity_texture"):
            scene = {"camera": {"eye": [0.5, 0.5, 3], "at": [0.5, 0.5, 0], "fov_y": 20},
                     "materials": [{"name": "m", "diffuse": [0.5, 0.5, 0.5], "emission": [1, 1, 1], slot: {"program": "p"}}],
                     "meshes": [{"positions": [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], "quads": [[0, 1, 2, 3]] * 500, "material": "m"}],
                     "lights": [{"type": "point", "position": [0.5, 0.5, 2], "value": 5}], "programs": [{"name": "p", "steps": steps}]}
            path = self.folder / "costly.json"
            path.write_text(json.dumps(scene))
            for integrator in ("path_tracer", "lightcuts"):
                with self.subTest(slot=slot, integrator=integrator):
                    process = subprocess.Popen([COMMAND, "render", path, "-i", integrator, "--spp", "65536", "--size", "64x64", "-q", "-o", self.folder / "a.exr"],
                                               stderr=subprocess.DEVNULL)
                    time.sleep(1)  # reading is over
                    process.send_signal(signal.SIGTERM)
                    try:
                        self.assertEqual(process.wait(60), INTERRUPTED)
                    finally:
                        process.kill()

    def test_wrong_words_are_named(self):
        for arguments, text in ((["--confidence", "2"], "--confidence"), (["--resume"], "--checkpoint"),
                                (["--squares", "2", "--passes", "2"], "--squares")):
            self.assert_ends(lumicut("render", SCENE, *SMALL, "-o", self.folder / "a.exr", *arguments), USAGE, text)
        self.assertEqual(self.files(), [])


class Presets(Compared):
    def stats(self, *arguments):
        path = self.folder / "stats.json"
        self.assert_ends(lumicut("render", SCENE, "--size", "16x12", "-q", "--stats", path, *arguments), OK)
        values = json.loads(path.read_text())
        return values["integrator"], values["samples"], values["values"].get("passes", 1), values["parameters"]

    def test_good_is_what_nobody_chose(self):
        image, named = self.folder / "image.exr", self.folder / "named.exr"
        self.assertEqual(self.stats("-o", image)[:3], ("lightcuts", 1, 16))
        self.assertEqual(self.stats("--preset", "good", "-o", named)[3]["compensate"], "1")
        self.assertEqual(self.difference(image, named, "--layer", "denoised")["rmse"], 0)

    def test_other_options_change_a_preset(self):
        integrator, samples, passes, parameters = self.stats("--preset", "reference", "--passes", "2", "--spp", "3", "--vpls", "20")
        self.assertEqual((integrator, samples, passes, parameters["vpls"], parameters["compensate"]), ("exhaustive", 3, 2, "20", "1"))
        self.assertEqual(self.stats("--seconds", "0.001")[2], 1)
        self.assertEqual(self.stats("-p", "error=0.1")[2:], self.stats("-i", "lightcuts", "-p", "error=0.1")[2:])
        self.assertEqual(self.stats("-p", "error=0.1", "--preset", "draft")[0], "illumination_cut")
        image = self.folder / "plain.exr"
        self.stats("--no-denoise", "-o", image)
        self.assert_ends(lumicut("compare", image, image, "--layer", "denoised"), BAD_FILE, "denoised")

    def test_wrong_ones_are_named(self):
        for arguments, text in ((["--preset", "best"], "draft, good, final, reference"), (["--preset", "good", "-i", "wspd"], "--integrator"),
                                (["--preset", "good", "--squares", "2"], "--preset"),
                                (["--preset", "good", "--vpl-out", self.folder / "a.vpl"], "importance"),
                                (["-i", "path_tracer", "--vpl-out", self.folder / "a.vpl"], "no virtual lights")):
            self.assert_ends(lumicut("render", SCENE, "-o", self.folder / "a.exr", *arguments), USAGE, text)
        self.assertEqual(self.files(), [])


class Mix(Compared):
    SCENE = {
        "camera": {"eye": [0, 0, 4], "at": [0, 0, 0], "fov_y": 40},
        "materials": [{"name": "grey", "diffuse": [0.5, 0.5, 0.5], "specular": [0.2, 0.2, 0.2], "shininess": 20}],
        "meshes": [{"positions": [[-2, -2, 0], [2, -2, 0], [2, 2, 0], [-2, 2, 0]], "quads": [[0, 1, 2, 3]],
                    "material": "grey"}],
        "lights": [{"type": "point", "position": [-1, 0, 1], "value": 3, "group": 1},
                   {"type": "point", "position": [1, 0, 1], "value": 2, "color": [1, 0.5, 0.2], "group": 2}],
    }

    def render(self, scene, name, *arguments):
        path, out = self.folder / f"{name}.json", self.folder / f"{name}.exr"
        path.write_text(json.dumps(scene))
        self.assert_ends(lumicut("render", path, "--size", "32x24", "-q", "-o", out, *arguments), OK)
        return out

    def test_a_mix_is_the_render_with_lamps_of_that_brightness(self):
        groups = self.render(self.SCENE, "groups", "--groups")
        scene = json.loads(json.dumps(self.SCENE))
        scene["lights"][0]["value"] *= 0.25
        scene["lights"][1]["color"] = [0.5, 0.5, 0.6]
        truth, mixed = self.render(scene, "truth"), self.folder / "mixed.exr"
        self.assert_ends(lumicut("mix", groups, "--gain", "1=0.25", "--gain", "2=0.5,1,3", "-o", mixed, "--png",
                                 self.folder / "mixed.png"), OK)
        self.assertLess(self.difference(mixed, truth)["rmse"], 1e-5)
        self.assertEqual((self.folder / "mixed.png").read_bytes()[:4], b"\x89PNG")
        # The groups together, as they are.
        self.assert_ends(lumicut("mix", groups, "-o", mixed), OK)
        self.assertLess(self.difference(mixed, groups)["rmse"], 1e-6)
        self.assert_ends(lumicut("mix", groups, "--gain", "1=1", "--others", "0", "-o", mixed), OK)
        del scene["lights"][1]
        scene["lights"][0]["value"] = 3
        self.assertLess(self.difference(mixed, self.render(scene, "one"))["rmse"], 1e-5)

    def test_wrong_mixes_are_named(self):
        groups, out = self.render(self.SCENE, "groups", "--groups"), self.folder / "out.exr"
        plain = self.render(self.SCENE, "plain")
        for arguments, code, text in (
                ([groups, "--gain", "9=1"], USAGE, "no light group 9; there are 1, 2"),
                ([groups, "--gain", "1=x"], USAGE, "\"x\" is not a number"),
                ([groups, "--gain", "1=-2"], USAGE, "below 0"),
                ([groups, "--gain", "1=1,2"], USAGE, "one number or three"),
                ([groups, "--gain", "1=1", "--gain", "1=2"], USAGE, "twice"),
                ([plain], BAD_FILE, "no layers radiance.GROUP"),
                ([self.folder / "none.exr"], BAD_FILE, "none.exr")):
            with self.subTest(text):
                self.assert_ends(lumicut("mix", *arguments, "-o", out), code, text)
        self.assertFalse(out.exists())


class Lux(Cli):
    def test_the_layer_is_lux(self):
        path, out = self.folder / "floor.json", self.folder / "floor.exr"
        path.write_text(json.dumps({
            "camera": {"eye": [0, 0, 1], "at": [0, 0, 0], "fov_y": 0.01},
            "materials": [{"name": "floor", "diffuse": [0.3, 0.6, 0.1]}],
            "meshes": [{"positions": [[-2, -2, 0], [2, -2, 0], [2, 2, 0], [-2, 2, 0]], "quads": [[0, 1, 2, 3]],
                        "material": "floor"}],
            "lights": [{"type": "point", "position": [0, 0, 2], "value": 8}]}))
        self.assert_ends(lumicut("render", path, "--size", "2x2", "-q", "--layers", "radiance,illuminance", "-o", out), OK)
        result = lumicut("compare", out, out, "--layer", "illuminance", "--json", "--no-flip")
        self.assert_ends(result, OK)
        self.assertAlmostEqual(json.loads(result.stdout)["reference_mean"] / (683 * 8 / 4), 1, delta=0.01)


if __name__ == "__main__":
    unittest.main()
