"""lumicut-geometry: every command against brute force, on the user's own files, and on bad ones."""
import math
import os
import pathlib
import random
import signal
import subprocess
import tempfile
import unittest

COMMAND = pathlib.Path(os.environ["LUMICUT_BINARY_DIR"]) / "bin/lumicut-geometry"


def run(*arguments, text=""):
    return subprocess.run([COMMAND, *map(str, arguments)], input=text, capture_output=True, text=True, timeout=300, check=False)


def rows(text):
    return [[float(v) for v in line.split(",")] for line in text.splitlines() if line and line[0] not in "ih#"]


def convex_hull(points):
    """Andrew's monotone chain; integers, so that it is exact."""
    points = sorted(set(points))
    if len(points) < 3:
        return points

    def half(path):
        out = []
        for p in path:
            while len(out) > 1 and (out[-1][0] - out[-2][0]) * (p[1] - out[-2][1]) <= (out[-1][1] - out[-2][1]) * (p[0] - out[-2][0]):
                out.pop()
            out.append(p)
        return out[:-1]
    return half(points) + half(points[::-1])


@unittest.skipUnless(COMMAND.exists(), "built without lumicut-geometry")
class GeometryCommand(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.random = random.Random(7)

    def write(self, name, lines):
        path = self.folder / name
        path.write_text("".join(line + "\n" for line in lines))
        return path

    def refused(self, *arguments, says=(), text="", code=2):
        done = run(*arguments, text=text)
        self.assertEqual(done.returncode, code, done.stderr)
        for part in says:
            self.assertIn(part, done.stderr)

    def test_numbers_beyond_what_is_computed_with_are_named_by_line(self):
        good, far = self.write("good.csv", ["0,0,1", "2,2,1"]), self.write("far.csv", ["# nothing", "0,0,1", "1e200,0,1"])
        points = self.write("points.csv", ["0,0", "0,-1e71"])
        self.refused("balltree", far, says=["far.csv, line 3", "column 1 is 1e200, beyond 1e+15"])
        self.refused("balltree", self.write("minus.csv", ["0,0,1", "0,0,-1"]), "--radii", says=["minus.csv, line 2", "column 3 is -1, below 0"])
        self.refused("balltree", good, "--queries", far, says=["far.csv, line 3"])
        self.refused("independent-set", "--disks", far, says=["far.csv, line 3", "x is 1e200, beyond 1e+70"])
        self.refused("independent-set", "--disks", self.write("minus.csv", ["0,0,-1"]), says=["line 1", "radius is -1, below 0"])
        self.refused("independent-set", "--disks", good, "--start", self.write("s.csv", ["0", "1.5"]), says=["s.csv, line 2", "1.5"])
        self.refused("hitting-set", "--points", points, "--disks", good, says=["points.csv, line 2", "y is -1e71"])

    def test_what_scripts_and_other_programs_make_is_named(self):
        points = self.write("p.csv", ["0,0", "1,0", "0,1"])
        (self.folder / "wide.csv").write_bytes("0,0\n1,1\n".encode("utf-16"))
        self.refused("balltree", self.folder / "wide.csv", says=["wide.csv: is UTF-16 text"], code=1)
        for option in ("--picture", "--queries", "--out"):
            self.refused("balltree", points, option, "", says=[f"{option}: is empty"])
        self.refused("hull", points, "--window", "-1", says=["--window"])
        self.assertRegex(run("--version").stdout, r"^lumicut-geometry \d+\.\d+\.\d+\n$")

    def test_a_folder_that_cannot_be_made_is_named(self):
        mesh = self.write("m.obj", ["v 0 0 0", "v 1 0 0", "v 0 1 0", "f 1 2 3"])
        for out in (mesh, mesh / "below"):
            self.refused("recluster", mesh, "--frames", 1, "--clusters", 1, "--out", out, says=[f"lumicut-geometry: --out {out}: cannot be made a folder"], code=1)

    def test_many_equal_or_overlapping_inputs_take_no_quadratic_time(self):
        # A tenth of a second here; by all pairs, half a minute.
        same = self.write("same.csv", ["0.5,0.5"] * 50000)
        done = run("balltree", same, "--queries", same, "--count", 2)
        self.assertEqual(done.stdout, "0,1\n" * 50000)
        done = run("balltree", same, "--queries", same, "--kind", "best-mate")
        self.assertEqual(done.stdout, "0\n" * 50000)
        # Here every pair touches, and is looked at a few times.
        done = run("independent-set", "--disks", self.write("disks.csv", [f"{self.random.random()},{self.random.random()},10" for _ in range(6000)]))
        self.assertEqual(len(rows(done.stdout)), 1)

    def test_long_work_tells_how_far_it_is_and_ends_at_ctrl_c(self):
        line = self.write("line.csv", [f"{x},0" for x in range(200000)])
        shown, terminal = os.openpty()
        try:
            process = subprocess.Popen([COMMAND, "balltree", line, "--builder", "insertion"], stderr=terminal, stdout=subprocess.DEVNULL)
            said = b""
            while b" %, " not in said:
                self.assertIsNone(process.poll())
                said += os.read(shown, 1000)
            self.assertIn(b"ball tree: ", said)
            process.send_signal(signal.SIGINT)
            self.assertEqual(process.wait(30), 130)
            self.assertIn(b"interrupted", os.read(shown, 10000))
        finally:
            os.close(shown)
            os.close(terminal)

    # Hull

    def test_hull_of_a_stream_is_that_of_its_window(self):
        # A chain that goes round and outwards is simple.
        chain = [(round((100 + 20 * t) * math.cos(0.7 * t)), round((100 + 20 * t) * math.sin(0.7 * t))) for t in range(60)]
        stream, window, expected = [], [], []
        for i, p in enumerate(chain):
            stream.append(f"{p[0]},{p[1]}")
            window.append(p)
            if i % 3 == 2:
                stream.append("-")
                window.pop(0)
            if i % 7 == 6:
                stream.append("?")
                expected.append(set(convex_hull(window)))
        done = run("hull", "-", text="# a spiral\n" + "\r\n".join(stream) + "\n")
        self.assertEqual(done.returncode, 0, done.stderr)
        told = [{(int(x), int(y)) for x, y in rows(part.split("\n", 1)[1])} for part in done.stdout.split("hull of ")[1:]]
        self.assertEqual(told[:len(expected)], expected)
        self.assertEqual(told[-1], set(convex_hull(window)), "the last one, unasked")
        self.assertIn("60 insertions, 20 deletions", done.stderr)

    def test_hull_of_a_window_forgets_by_itself(self):
        file = self.write("chain.csv", [f"{x},{x * x}" for x in range(50)])
        done = run("hull", file, "--window", 5, "--summary")
        self.assertEqual(done.stdout, "5 points, 5 hull vertices\n")
        picture = self.folder / "hull.svg"
        done = run("hull", file, "--window", 5, "--picture", picture)
        self.assertEqual(done.returncode, 0, done.stderr)
        chain, corners = (picture.read_text().split(f"<{kind} ")[1].split('points="')[1].split('"')[0].split() for kind in ("polyline", "polygon"))
        self.assertEqual((len(chain), set(chain)), (5, set(corners)))

    def test_hull_says_which_line_is_wrong(self):
        self.refused("hull", "-", text="0,0\n1;1\n", says=["standard input, line 2", "y is missing"])
        self.refused("hull", "-", text="0,nan\n", says=["line 1", "y"])
        self.refused("hull", "-", text="0,0,0\n", says=["line 1", "more than x and y"])
        self.refused("hull", "-", text="-\n", says=["line 1"])
        self.refused("hull", "-", "--check-simple", text="0,0\n2,2\n2,0\n0,2\n", says=["line 4"])
        self.refused("hull", self.folder / "none.csv", says=["none.csv"], code=1)

    # Ball trees

    def test_searches_of_each_builder_are_those_of_brute_force(self):
        balls = [[self.random.uniform(-1, 1) for _ in range(3)] + [self.random.uniform(0, 0.4)] for _ in range(80)]
        queries = [[self.random.uniform(-1, 1) for _ in range(3)] + [self.random.uniform(0, 0.5)] for _ in range(20)]
        balls_file = self.write("balls.csv", ["x,y,z,radius"] + [",".join(map(repr, b)) for b in balls])
        with_radius = self.write("q.csv", [",".join(map(repr, q)) for q in queries])
        points = self.write("p.csv", [",".join(map(repr, q[:3])) for q in queries])

        def found(test):
            return [[i for i, b in enumerate(balls) if test(math.dist(b[:3], q[:3]), b[3], q[3])] for q in queries]

        for builder in ("kd", "top-down", "insertion", "cheap-insertion", "bottom-up"):
            for kind, file, expected in (
                    ("intersecting", with_radius, found(lambda d, b, q: d <= b + q)),
                    ("contained", with_radius, found(lambda d, b, q: d + b <= q)),
                    ("containing", with_radius, found(lambda d, b, q: d + q <= b)),
                    ("containing", points, found(lambda d, b, q: d <= b)),
                    ("nearest", points, [sorted(range(80), key=lambda i, q=q: math.dist(balls[i][:3], q[:3]))[:4] for q in queries])):
                done = run("balltree", balls_file, "--radii", "--builder", builder, "--queries", file, "--kind", kind, "--count", 4)
                self.assertEqual(done.returncode, 0, done.stderr)
                self.assertEqual([[int(v) for v in line.split(",") if v] for line in done.stdout.split("\n")[:-1]], expected, (builder, kind))

    def test_nearest_by_furthest_points_and_the_best_mate(self):
        balls = [[self.random.uniform(-1, 1) for _ in range(2)] + [self.random.uniform(0, 0.4)] for _ in range(50)]
        queries = [[self.random.uniform(-1, 1) for _ in range(2)] + [self.random.uniform(0, 0.5)] for _ in range(10)]
        file, with_radius = (self.write(name, [",".join(map(repr, b)) for b in rows_]) for name, rows_ in (("b.csv", balls), ("q.csv", queries)))
        points = self.write("p.csv", [",".join(map(repr, q[:2])) for q in queries])
        done = run("balltree", file, "--radii", "--queries", points, "--count", 3, "--by", "greatest")
        self.assertEqual([[int(v) for v in line.split(",")] for line in done.stdout.split()],
                         [sorted(range(50), key=lambda i, q=q: math.dist(balls[i][:2], q[:2]) + balls[i][2])[:3] for q in queries], done.stderr)
        done = run("balltree", file, "--radii", "--queries", with_radius, "--kind", "best-mate")

        def joint(b, q):
            return max(b[2], q[2], (math.dist(b[:2], q[:2]) + b[2] + q[2]) / 2)
        for line, q in zip(done.stdout.split(), queries, strict=True):
            self.assertAlmostEqual(joint(balls[int(line)], q), min(joint(b, q) for b in balls))

    def test_all_builders_are_compared_and_a_tree_is_drawn(self):
        file = self.write("points.csv", [f"{self.random.random()},{self.random.random()}" for _ in range(100)])
        done = run("balltree", file, "--builder", "all")
        self.assertEqual([line.split()[0] for line in done.stderr.splitlines()],
                         ["kd", "top-down", "insertion", "cheap-insertion", "bottom-up"])
        for name, begin in (("t.svg", b"<svg"), ("t.png", b"\x89PNG")):
            done = run("balltree", file, "--picture", self.folder / name)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertTrue((self.folder / name).read_bytes().startswith(begin))
        self.assertEqual((self.folder / "t.svg").read_text().count("stroke="), 99, "a circle for each inner ball")

    def test_balls_that_make_no_tree_are_refused_by_name(self):
        file = self.write("b.csv", ["0,0,1", "1,1"])
        self.refused("balltree", file, says=["b.csv, line 2", "column 3"])
        self.refused("balltree", self.write("e.csv", ["# nothing"]), says=["e.csv", "no balls"])
        self.refused("balltree", self.write("n.csv", ["0,0,-1"]), "--radii", says=["column 3 is -1"])
        three = self.write("three.csv", ["0,0,0"])
        self.refused("balltree", three, "--picture", self.folder / "t.svg", says=["three.csv", "3 dimensions"])
        self.refused("balltree", three, "--queries", self.write("two.csv", ["0,0"]), says=["two.csv", "2 dimensions"])
        self.refused("balltree", three, "--picture", self.folder / "t.jpg", says=["ends in .jpg", ".svg or .png"], code=2)
        self.refused("balltree", three, "--builder", "all", "--picture", self.folder / "t.svg", says=["--builder all"])

    # Nets and hitting sets

    def instance(self):
        points = [(self.random.random(), self.random.random()) for _ in range(120)]
        disks = [(*self.random.choice(points), self.random.uniform(0.02, 0.2)) for _ in range(90)]
        return points, disks, self.write("p.csv", [f"{x!r},{y!r}" for x, y in points]), self.write("d.csv", [f"{x!r},{y!r},{r!r}" for x, y, r in disks])

    def test_every_method_hits_every_disk_and_local_search_ends_below_its_start(self):
        points, disks, p, d = self.instance()
        sizes = {}
        for method in ("default", "greedy", "pruned", "local", "dnet"):
            done = run("hitting-set", "--points", p, "--disks", d, "--method", method)
            if method == "dnet" and "without CGAL" in done.stderr:
                continue
            self.assertEqual(done.returncode, 0, done.stderr)
            chosen = [points[int(row.split(",")[0])] for row in done.stdout.splitlines()[1:]]
            sizes[method] = len(chosen)
            for x, y, r in disks:
                self.assertTrue(any(math.dist((x, y), c) <= r for c in chosen), method)
        self.assertLessEqual(sizes["default"], sizes["local"])
        self.assertLessEqual(sizes["local"], sizes["pruned"])
        self.assertLessEqual(sizes["pruned"], sizes["greedy"])
        everything = self.write("all.csv", ["index"] + [str(i) for i in range(len(points))])
        done = run("hitting-set", "--points", p, "--disks", d, "--method", "local", "--start", everything, "--exchange", 2)
        self.assertLess(len(done.stdout.splitlines()) - 1, 120)
        self.refused("hitting-set", "--points", p, "--disks", d, "--method", "local", "--start", self.write("s.csv", ["500"]), says=["s.csv", "500", "120 points"])

    def test_the_tight_instance_stops_local_search_of_three_and_not_of_four(self):
        p, d, s, out = (self.folder / name for name in ("p.csv", "d.csv", "s.csv", "out.csv"))
        self.assertEqual(run("instance", "tight", "--side", 8, "--points", p, "--disks", d, "--start", s).returncode, 0)
        sizes = {}
        for k in (3, 4):
            done = run("hitting-set", "--points", p, "--disks", d, "--method", "local", "--start", s, "--exchange", k, "--out", out)
            self.assertEqual(done.returncode, 0, done.stderr)
            sizes[k] = len(rows(out.read_text()))
        self.assertEqual(sizes[3], 4 * 8 * 8)
        self.assertLess(sizes[4], 5 * 45)
        done = run("instance", "rnd", "--count", 200, "--disk-count", 100, "--radius", 0.1, "--points", p, "--disks", d)
        self.assertEqual((done.returncode, len(rows(p.read_text()))), (0, 200), done.stderr)
        self.refused("instance", "fix", "--points", p, "--disks", d, "--start", s, says=["--start"])

    def test_ranges_and_shapes_are_hit(self):
        points, disks, p, d = self.instance()
        square = self.write("square.csv", ["1,1", "-1,1", "-1,-1", "1,-1"])
        inside = [[i for i, q in enumerate(points) if max(abs(q[0] - x), abs(q[1] - y)) <= r] for x, y, r in disks]
        ranges = self.write("ranges.csv", [",".join(map(str, row)) for row in inside])
        chosen = {}
        for name, what in (("shape", ("--disks", d, "--shape", square)), ("ranges", ("--ranges", ranges))):
            for method in ("default", "local"):
                done = run("hitting-set", "--points", p, *what, "--method", method)
                self.assertEqual(done.returncode, 0, done.stderr)
                chosen[name, method] = {int(row.split(",")[0]) for row in done.stdout.splitlines()[1:]}
                self.assertTrue(all(chosen[name, method] & set(row) for row in inside), (name, method))
        self.assertEqual(chosen["shape", "default"], chosen["ranges", "default"])
        self.refused("hitting-set", "--points", p, "--ranges", self.write("r.csv", ["0,1", "5,120"]), says=["r.csv, line 2", "field 2", "120"])
        self.refused("hitting-set", "--points", p, "--ranges", ranges, "--method", "dnet", says=["dnet"])
        self.refused("hitting-set", "--points", p, "--disks", d, "--shape", self.write("s.csv", ["1,1", "1,-1"]), says=["shape"])

    def test_an_independent_set_does_not_touch_itself(self):
        _, disks, _, d = self.instance()
        sizes = []
        for k in (2, 3, 4):
            done = run("independent-set", "--disks", d, "--exchange", k, "--picture", self.folder / "set.svg")
            self.assertEqual(done.returncode, 0, done.stderr)
            found = rows(done.stdout)
            sizes.append(len(found))
            self.assertTrue(all(math.dist(a[1:3], b[1:3]) > a[3] + b[3] for a in found for b in found if a is not b))
            self.assertTrue(all(disks[int(a[0])] == tuple(a[1:]) for a in found))
        self.assertLessEqual(sizes[0], sizes[2])
        self.refused("independent-set", "--disks", d, "--start", self.write("s.csv", ["90"]), says=["s.csv", "90 disks"])

    def test_nets_follow_weights_and_c0(self):
        points, _, p, _ = self.instance()
        if "without CGAL" in run("net", "--points", p).stderr:
            self.skipTest("built without CGAL")
        heavy = 17
        weights = self.write("w.csv", ["1000" if i == heavy else "1" for i in range(len(points))])
        done = run("net", "--points", p, "--weights", weights, "--epsilon", 0.5)
        self.assertIn(str(heavy), [row.split(",")[0] for row in done.stdout.splitlines()[1:]], "it holds more than half alone")
        done = run("net", "--points", p, "--epsilon", 0.5, "--picture", self.folder / "net.png")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertTrue((self.folder / "net.png").read_bytes().startswith(b"\x89PNG"))
        sizes = [len(run("net", "--points", p, "--epsilon", 0.2, "--thesis", "--c0", c0).stdout.splitlines()) for c0 in (2, 20)]
        self.assertLess(sizes[0], sizes[1])
        self.refused("net", "--points", p, "--weights", self.write("few.csv", ["1"]), says=["few.csv", "1 weights of 120 points"])

    # Face clusters

    def grid(self, name, lift):
        """A sheet of 12 x 12 squares that is folded along its middle by `lift`."""
        lines = [f"v {x} {y} {lift * max(0, x - 6)}" for y in range(13) for x in range(13)]
        for y in range(12):
            for x in range(12):
                a = 13 * y + x + 1
                lines += [f"f {a} {a + 1} {a + 14}", f"f {a} {a + 14} {a + 13}"]
        return self.write(name, lines)

    def test_frames_of_the_users_keep_their_clusters(self):
        frames = [self.grid(f"sheet{i}.obj", i / 2) for i in range(3)]
        out = self.folder / "out"
        done = run("recluster", *frames, "--clusters", 8, "--out", out, "--no-pictures")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(sorted(f.name for f in out.iterdir()), sorted(f"frame_000{i}.{e}" for i in range(3) for e in ("csv", "ply")))
        for i in range(3):
            labels = [int(v) for v in (out / f"frame_000{i}.csv").read_text().split()]
            self.assertEqual((len(labels), len(set(labels))), (288, 8))

    def test_an_error_threshold_finds_the_number_of_clusters(self):
        # Two planes at a right angle: two clusters have no error at all.
        sheet = self.grid("fold.obj", 1.0)
        done = run("recluster", sheet, "--frames", 1, "--clusters", 1, "--error", 0.001, "--out", self.folder / "out", "--no-pictures")
        self.assertEqual(done.returncode, 0, done.stderr)
        error = float(done.stdout.split("error ")[1].split()[0])
        self.assertLessEqual(error, 0.001)
        self.assertGreaterEqual(int(done.stdout.split(" clusters")[0].split()[-1]), 2)

    def test_the_tree_balances_the_users_weights(self):
        sheet = self.grid("sheet.obj", 0)
        weights = [1 + 9 * (f % 24 < 12) for f in range(288)]
        done = run("recluster", sheet, "--frames", 1, "--method", "tree", "--level", 1, "--out", self.folder / "out", "--no-pictures",
                   "--weights", self.write("w.csv", map(str, weights)))
        self.assertEqual(done.returncode, 0, done.stderr)
        labels = [int(v) for v in (self.folder / "out/frame_0000.csv").read_text().split()]
        halves = [sum(w for w, label in zip(weights, labels) if label == k) for k in (0, 1)]
        self.assertLess(abs(halves[0] - halves[1]), 0.2 * sum(halves))

    def test_an_atlas_and_boxes_of_the_last_frame_are_written(self):
        frames = [self.grid(f"sheet{i}.obj", i) for i in range(2)]
        atlas, out = self.folder / "atlas.obj", self.folder / "out"
        done = run("recluster", *frames, "--clusters", 4, "--atlas", atlas, "--atlas-picture", self.folder / "atlas.png", "--boxes", "--out", out, "--no-pictures")
        self.assertEqual(done.returncode, 0, done.stderr)
        lines = [line.split() for line in atlas.read_text().splitlines()]
        uv = [[float(v) for v in line[1:]] for line in lines if line[0] == "vt"]
        places = [[float(v) for v in line[1:]] for line in lines if line[0] == "v"]
        faces = [[[int(k) - 1 for k in corner.split("/")] for corner in line[1:]] for line in lines if line[0] == "f"]
        self.assertEqual((len(faces), len(uv), len(places)), (288, 864, 169))
        self.assertTrue(all(0 <= v <= 1 for p in uv for v in p))
        labels = [int(v) for v in (out / "frame_0001.csv").read_text().split()]
        boxes = {int(row[0]): row[1:] for row in ([float(v) for v in line.split(",")] for line in (out / "frame_0001_boxes.csv").read_text().splitlines()[1:])}
        for label, face in zip(labels, faces):
            for v, _ in face:
                self.assertTrue(all(boxes[label][k] - 1e-6 <= places[v][k] <= boxes[label][3 + k] + 1e-6 for k in range(3)))
        self.assertIn("4 charts", done.stdout)
        self.assertTrue((self.folder / "atlas.png").read_bytes().startswith(b"\x89PNG"))
        self.refused("recluster", *frames, "--atlas", self.folder / "no/where.obj", says=["where.obj"], code=1)

    def test_metrics_seeds_filters_and_discs_are_options(self):
        sheet = self.grid("sheet.obj", 1.0)
        labels = {}
        for name, options in (("eq8", ()), ("eq9", ("--metric", "schlafman", "--lambda", 0.2)), ("random", ("--random-seeds", 5)),
                              ("tree", ("--method", "tree", "--level", 3)), ("bloom", ("--method", "tree", "--level", 3, "--bloom-bits", 128)),
                              ("discs", ("--method", "tree", "--level", 3, "--simply-connected"))):
            done = run("recluster", sheet, "--frames", 1, "--clusters", 8, "--out", self.folder / name, "--no-pictures", *options)
            self.assertEqual(done.returncode, 0, done.stderr)
            labels[name] = (self.folder / name / "frame_0000.csv").read_text().split()
            self.assertEqual(len(set(labels[name])), 8, name)
            if name == "discs":
                self.assertIn("287 discs, 0 with holes", done.stdout)
        self.assertEqual(len({tuple(labels[k]) for k in ("eq8", "eq9", "random")}), 3)
        self.assertNotEqual(labels["tree"], labels["bloom"])
        self.refused("recluster", sheet, "--metric", "schlafman", "--lambda", 2, "--out", self.folder, says=["lambda is 2"])
        self.refused("recluster", sheet, "--method", "tree", "--simply-connected", "--bloom-bits", 128, "--out", self.folder, says=["bloom_bits is 128"])

    def test_frames_that_do_not_fit_are_refused_by_name(self):
        a, b = self.grid("a.obj", 0), self.write("b.obj", ["v 0 0 0", "v 1 0 0", "v 0 1 0", "f 1 2 3"])
        self.refused("recluster", a, b, "--out", self.folder, says=["b.obj", "a.obj", "faces"])
        self.refused("recluster", a, "--method", "kmeans", "--weights", b, says=["--weights"])
        self.refused("recluster", a, "--method", "tree", "--weights", self.write("w.csv", ["1", "2"]), "--out", self.folder, says=["w.csv", "2 weights of 288 faces"])


if __name__ == "__main__":
    unittest.main()
