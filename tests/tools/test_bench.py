"""lumicut bench: what it measures, what it keeps, what it refuses. No test looks at a time's value."""
import json
import math
import shutil
import signal
import subprocess
import time
import unittest

from cli import BAD_FILE, COMMAND, FAILED, INTERRUPTED, OK, ROOT, SCENE, USAGE, Cli, lumicut, together

ROOM = ROOT / "reference_images/indirect_room/indirect_room.json"
SMALL = {"size": [32, 24], "vpls": 200}
LC = {"name": "LC", "integrator": "lightcuts", "parameters": {"error": 0.05}}
IC = {"name": "IC", "integrator": "illumination_cut", "parameters": {"error": 0.05}}


class Bench(Cli):
    def plan(self, scenes=(str(SCENE),), runs=(LC,), name="plan.json", **more):
        path = self.folder / name
        path.write_text(json.dumps({**SMALL, "scenes": list(scenes), "runs": list(runs), **more}))
        return path

    def bench(self, plan, *arguments, code=OK, texts=()):
        result = lumicut("bench", plan, "-o", self.folder / "out", *arguments)
        self.assert_ends(result, code, *texts)
        return result

    def results(self):
        return json.loads((self.folder / "out/results.json").read_text())

    def rows(self):
        return {(r["run"], r["vpls_requested"]): r for r in self.results()["rows"]}


class Results(Bench):
    def test_rows_tables_images_and_resume(self):
        sweep = {**LC, "parameters": {"error": [0.02, 0.1]}}
        plan = self.plan(runs=[sweep, IC], vpls=[150, 300], yardstick=True, description="a \"small\" one")
        result = self.bench(plan)
        results, rows = self.results(), self.rows()
        self.assertEqual(set(rows), {(name, n) for name in ("LC error=0.02", "LC error=0.1", "IC") for n in (150, 300)})
        for key in ("version", "git", "machine", "threads", "accel", "plan", "baseline"):
            self.assertIn(key, results)
        self.assertEqual(results["baseline"], "LC error=0.02")
        self.assertGreater(results["yardsticks"][0]["mray_per_second"], 0)
        for row in rows.values():
            for key in ("scene", "integrator", "parameters", "seed", "vpls", "width", "height", "samples", "threads", "accel",
                        "version", "git", "preprocess_seconds", "render_seconds", "total_seconds", "amortised_seconds",
                        "rays_per_pixel", "bounds_per_pixel", "clusters_per_pixel", "rmse", "lmse", "mean_relative_error",
                        "p95_relative_error", "p99_relative_error", "max_relative_error", "peak_bytes", "command", "triangles"):
                self.assertIn(key, row)
            for key in ("render_on_exhaustive", "total_on_exhaustive", "render_on_baseline", "total_on_baseline"):
                self.assertGreater(row["speedup"][key], 0)
            self.assertEqual((row["width"], row["height"], row["samples"]), (32, 24, 1))
            self.assertTrue((self.folder / "out" / row["image"]).exists())
        for n in (150, 300):
            self.assertLess(rows["LC error=0.02", n]["rmse"], rows["LC error=0.1", n]["rmse"])
            self.assertEqual(rows["LC error=0.02", n]["speedup"]["total_on_baseline"], 1)
        # The row's own measures are those of `compare`.
        row = rows["IC", 150]
        compared = lumicut("compare", self.folder / "out" / row["image"], self.folder / "out" / row["reference"], "--json", "--no-flip")
        self.assertEqual(json.loads(compared.stdout)["rmse"], row["rmse"])
        text, markdown = ((self.folder / "out" / f"tables.{end}").read_text() for end in ("txt", "md"))
        self.assertIn(text, result.stdout)
        for word in ("Preprocessing (s)", "Render (s)", "Rays a pixel", "LMSE", "Rel. error (%)", "Peak memory (MB)",
                     "Speed-up on exhaustive", "grows as n^", "LC error=0.02 (lightcuts, error=0.02)"):
            self.assertIn(word, text)
            self.assertIn(word, markdown)
        widths = {line.count("|") for line in markdown.split("\n\n")[1].splitlines()}
        self.assertEqual(len(widths), 1, "a whole Markdown table")

        # What stands is refused, kept, or begun anew.
        self.bench(plan, code=USAGE, texts=("--resume", "--overwrite"))
        images = {p: p.stat().st_mtime_ns for p in (self.folder / "out/images").iterdir()}
        self.bench(self.plan(runs=[sweep, IC, {"name": "wide", "integrator": "exhaustive"}], vpls=[150, 300],
                             description="a \"small\" one"), "--resume")
        again = self.rows()
        self.assertEqual({k: again[k]["seconds_each"] for k in rows}, {k: rows[k]["seconds_each"] for k in rows})
        self.assertEqual({p: p.stat().st_mtime_ns for p in images}, images)
        self.assertEqual(again["wide", 150]["rmse"], 0)
        self.assertTrue(all(r["cached"] for r in self.results()["references"]))

    def test_repetitions_give_the_same_counts_and_medians_of_seconds(self):
        plan = self.plan(runs=[LC, IC], repeat=3, keep_images=False)
        self.bench(plan, "-q")
        first = self.rows()
        for row in first.values():
            self.assertNotIn("counts_vary", row)
            self.assertEqual(len(row["seconds_each"]), 3)
            self.assertEqual(row["render_seconds"], sorted(s["render"] for s in row["seconds_each"])[1])
            self.assertNotIn("image", row)
        self.assertEqual(list((self.folder / "out/images").iterdir()), [])
        self.bench(plan, "-q", "--overwrite", "--repeat", "1", "--threads", "1")
        for key, row in self.rows().items():
            self.assertEqual(row["counters"], first[key]["counters"])
            self.assertEqual(row["rmse"], first[key]["rmse"])

    def test_a_reference_on_squares_measures_those_pixels(self):
        self.bench(self.plan(size=[96, 64]), "--reference-squares", "2", "-q")
        results = self.results()
        reference, row = results["references"][0], results["rows"][0]
        self.assertEqual((reference["rendered_pixels"], row["compared_pixels"]), (2048, 2048))
        self.assertTrue(reference["render_seconds_estimated"])

    def test_runs_can_be_named_on_the_command_line(self):
        result = lumicut("bench", "--scene", SCENE, "--run", "lightcuts error=0.1", "--run", "illumination_cut", "--vpls", "100",
                         "--size", "16x12", "-o", self.folder / "out", "-q")
        self.assert_ends(result, OK)
        self.assertEqual([r["run"] for r in self.results()["rows"]], ["lightcuts error=0.1", "illumination_cut"])
        self.assertEqual(result.stdout + result.stderr, "")


class Matches(Bench):
    def test_equal_error_is_found_by_varying_the_parameter(self):
        def match(**more):
            return {"integrator": "illumination_cut", "match": {"measure": "rmse", "vary": "error", "range": [0.001, 0.9], **more}}

        runs = [LC, {"name": "as LC", **match(to="LC", tolerance=0.1)}, {"name": "absurd", **match(to=1e-9, steps=3, range=[0.04, 0.05])}]
        result = self.bench(self.plan(scenes=[str(ROOM)], runs=runs))
        rows = self.rows()
        found = rows["as LC", 200]
        self.assertTrue(found["match"]["matched"])
        # Within the tolerance that the plan gives.
        self.assertAlmostEqual(math.log(found["rmse"] / rows["LC", 200]["rmse"]), 0, delta=math.log(1.1) + 1e-9)
        self.assertEqual(found["rmse"], found["match"]["reached"])
        self.assertEqual(float(found["parameters"]["error"]), float(found["match"]["text"]))
        self.assertLessEqual(len(found["match"]["steps"]), 10)
        # Out of reach: the nearest is kept, and said to be no match.
        absurd = rows["absurd", 200]["match"]
        self.assertFalse(absurd["matched"])
        self.assertAlmostEqual(absurd["value"], 0.04)
        self.assertIn("(nearest)", result.stdout)
        self.assertEqual([p.name for p in (self.folder / "out/images").iterdir() if "trial" in p.name], [])

    def test_equal_time_takes_the_step_nearest_to_the_target(self):
        run = {"name": "timed", "integrator": "light_slice",
               "match": {"measure": "total_seconds", "to": "LC", "vary": "columns", "range": [2, 150], "steps": 4, "start": 20}}
        self.bench(self.plan(runs=[LC, run]), "-q")
        match = self.rows()["timed", 200]["match"]
        off = [abs(math.log(s["measured"] / match["target"])) for s in match["steps"]]
        self.assertEqual(match["reached"], match["steps"][off.index(min(off))]["measured"])
        self.assertEqual(match["value"], round(match["value"]), "columns are whole")


class Failures(Bench):
    def test_bad_plans_are_named_with_file_key_and_value(self):
        match = {"measure": "rmse", "to": "LC", "vary": "error", "range": [0.01, 0.1]}
        many = [0.01 + i / 10000 for i in range(300)]
        wrong = [
            ({"scenes": []}, "scenes", "no scene"),
            ({"runs": []}, "runs", "no run"),
            ({"vpls": [100, 100]}, "vpls[1]", "twice"),
            ({"vpls": 0}, "vpls", "0"),
            ({"size": [10]}, "size", "[width, height]"),
            ({"repeat": "often"}, "repeat", "often"),
            ({"repaet": 2}, "repaet", "repeat"),
            ({"accel": "octree"}, "accel", "octree"),
            ({"baseline": "LD"}, "baseline", "LD", "LC"),
            ({"runs": [{"integrator": "lightcutz"}]}, "runs[0].integrator", "lightcutz"),
            ({"runs": [{**LC, "parameters": {"eror": 1}}]}, "runs[0].parameters.eror", "eror"),
            ({"runs": [{**LC, "parameters": {"error": [0.1, 7]}}]}, "runs[0].parameters.error[1]", "7"),
            ({"runs": [{**LC, "parameters": {"vpls": 7}}]}, "runs[0].parameters.vpls", "scene"),
            ({"runs": [LC, LC]}, "runs[1]", "another run", "LC"),
            ({"scenes": [str(SCENE), str(SCENE)]}, "scenes[1]", "another scene"),
            ({"scenes": [{"file": str(SCENE), "reference": "r.exr", "vpls": [1, 2]}]}, "scenes[0]", "reference"),
            ({"parameters": {"error": 0.1}}, "parameters.error", "error"),
            ({"runs": [LC, {**IC, "match": {**match, "to": "LD"}}]}, "runs[1].match.to", "LD"),
            ({"runs": [LC, {**IC, "match": {**match, "vary": "visibility"}}]}, "runs[1].match.vary", "visibility"),
            ({"runs": [LC, {**IC, "match": {**match, "range": [0.1, 0.01]}}]}, "runs[1].match.range"),
            ({"runs": [LC, {**IC, "match": {**match, "range": [0.1, 10]}}]}, "runs[1].match.range", "error"),
            ({"runs": [LC, {**IC, "match": {**match, "measure": "beauty"}}]}, "runs[1].match.measure", "beauty"),
            # Lists beside each other multiply.
            ({"runs": [{**LC, "parameters": {"error": many, "max_cut": list(range(10, 310))}}]}, "runs[0].parameters", "10000 runs"),
            ({"vpls": list(range(1, 101)), "seeds": list(range(100)), "samples": list(range(1, 101))}, "scenes[0]", "100000"),
        ]
        plans = [self.plan(**{"runs": [LC], **change, "name": f"{i}.json"}) for i, (change, *_) in enumerate(wrong)]
        results = together([lambda plan=plan: lumicut("bench", plan, "-o", self.folder / "out") for plan in plans])
        for (change, *texts), plan, result in zip(wrong, plans, results):
            with self.subTest(change=change):
                self.assert_ends(result, BAD_FILE, plan.name, *texts)
                self.assertEqual(result.stderr.count("\n"), 1, result.stderr)
            plan.unlink()
        (self.folder / "plan.json").write_text('{\n"scenes": ]')
        self.bench(self.folder / "plan.json", code=BAD_FILE, texts=("plan.json", "line 2"))
        self.bench(self.folder / "none.json", code=BAD_FILE, texts=("none.json",))
        self.assertEqual(self.files(), ["plan.json"], "nothing was begun")

    def test_wrong_command_lines_are_named(self):
        self.bench("", code=USAGE, texts=("plan",))
        self.bench(self.plan(), "--scene", SCENE, code=USAGE, texts=("--scene",))
        self.bench(self.plan(), "--only", "kitchen", code=USAGE, texts=("kitchen", "cornell_box"))
        self.bench(self.plan(), "--size", "4by4", code=USAGE, texts=("4by4",))
        self.assert_ends(lumicut("bench", "--scene", SCENE, "--run", "lightcuts error"), USAGE, "name=value")

    def test_absent_scenes_are_skipped_when_they_may_be(self):
        absent = self.folder / "absent.json"
        scenes = [{"file": str(absent), "optional": True}, "${LUMICUT_NOWHERE}/a.json", str(SCENE)]
        result = self.bench(self.plan(scenes=scenes))
        self.assertIn("LUMICUT_NOWHERE is not set", result.stderr)
        self.assertIn(f"{absent}: no such file", result.stderr)
        self.assertEqual([s["scene"] for s in self.results()["skipped"]], ["a", "absent"])
        self.assertEqual(len(self.results()["rows"]), 1)
        self.bench(self.plan(scenes=[str(absent)]), "--overwrite", code=BAD_FILE, texts=("absent.json",))

    def test_a_run_that_fails_leaves_the_others(self):
        self.bench(self.plan(), "-q")
        reference = self.folder / "out/references" / (self.results()["references"][0]["group"] + ".exr")
        shutil.copy(reference, self.folder / "other.exr")
        scenes = [{"name": "other", "file": str(SCENE), "reference": "other.exr", "size": [8, 8]}, str(SCENE)]
        self.bench(self.plan(scenes=scenes), "--overwrite", code=FAILED, texts=("8 x 8", "32 x 24"))
        self.assertEqual(["failed" in r for r in self.results()["rows"]], [True, False])

    def stop_after(self, name, plan, *arguments):
        """Interrupts when the run of this name has ended."""
        process = subprocess.Popen([COMMAND, "bench", plan, "-o", self.folder / "out", *arguments], stdout=subprocess.DEVNULL,
                                   stderr=subprocess.PIPE, text=True)
        line = process.stderr.readline()
        self.assertIn(name, line)
        time.sleep(0.4)
        self.assertIsNone(process.poll(), "long enough to be interrupted")
        process.send_signal(signal.SIGINT)
        text = process.communicate(timeout=60)[1]
        self.assertEqual(process.returncode, INTERRUPTED, text)
        self.assertIn("--resume", text)

    def test_an_interrupt_keeps_what_is_finished(self):
        size = [640, 640]
        reference = self.folder / "r.exr"
        self.assert_ends(lumicut("render", SCENE, "-i", "lightcuts", "-p", "error=1", "--vpls", "50", "--size", "640x640",
                                 "--layers", "radiance", "--half", "-o", reference), OK)
        # The second takes minutes: every light of many at every point.
        runs = [{"name": "quick", "integrator": "lightcuts", "parameters": {"error": 1, "max_cut": 2}},
                {"name": "slow", "integrator": "lightcuts", "parameters": {"error": 1e-7}}]
        plan = self.plan(scenes=[{"file": str(SCENE), "reference": "r.exr", "size": size, "vpls": 20000}], runs=runs)
        self.stop_after("quick", plan)
        self.assertEqual([r["run"] for r in self.results()["rows"]], ["quick"])
        self.assertIn("quick", (self.folder / "out/tables.txt").read_text())
        left = sorted(p.name for p in (self.folder / "out").rglob("*") if p.is_file())
        self.assertEqual(left, ["cornell_box.20000vpls.seed1.quick.exr", "results.json", "tables.md", "tables.txt"])
        # A second stop, before the old row's turn, does not lose it.
        kept = self.results()["rows"][0]["seconds_each"]
        first = {"name": "first", "integrator": "lightcuts", "parameters": {"error": 1, "max_cut": 3}}
        plan = self.plan(scenes=[{"file": str(SCENE), "reference": "r.exr", "size": size, "vpls": 20000}], runs=[first, runs[1], runs[0]])
        self.stop_after("first", plan, "--resume")
        self.assertEqual([r["run"] for r in self.results()["rows"]], ["first", "quick"])
        self.assertEqual(self.results()["rows"][1]["seconds_each"], kept)


class Plans(Bench):
    def test_the_plans_of_the_project_are_good(self):
        plans = sorted((ROOT / "bench/plans").glob("*.json"))
        self.assertGreaterEqual(len(plans), 4)
        for result in together([lambda plan=plan: lumicut("bench", plan, "--check") for plan in plans]):
            self.assert_ends(result, OK)


if __name__ == "__main__":
    unittest.main()
