"""lumicut.geometry and the C interface below it, against brute force in NumPy; and both against lumicut_geometry.h."""
import ctypes
import itertools
import math
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(os.environ.get("LUMICUT_SOURCE_DIR", pathlib.Path(__file__).resolve().parents[2]))
BUILD = pathlib.Path(os.environ.get("LUMICUT_BINARY_DIR", ROOT / "build/release"))
sys.path.insert(0, str(ROOT / "export_scripts"))
os.environ.setdefault("LUMICUT_GEOMETRY_LIBRARY", str(BUILD / "lib"))

import numpy as np  # noqa: E402

from lumicut import geometry as g  # noqa: E402

HEADER = ROOT / "geometry/c_api/include/lumicut/lumicut_geometry.h"
HAS_CGAL = (BUILD / "lib/liblumicut_geometry_cgal.so").exists()


def sheet(n=12, fold=0.0):
    """n x n squares, folded along the middle."""
    y, x = np.mgrid[:n + 1, :n + 1]
    vertices = np.stack([x, y, fold * np.maximum(0, x - n / 2)], -1).reshape(-1, 3).astype(float)
    a = (y[:-1, :-1] * (n + 1) + x[:-1, :-1]).reshape(-1, 1)
    return vertices, np.concatenate([a, a + 1, a + n + 2, a, a + n + 2, a + n + 1], 1).reshape(-1, 3)


class Agglomeration(unittest.TestCase):
    def test_of_boxes_merges_the_pair_of_least_area_first(self):
        low = np.random.default_rng(1).random((30, 3))
        boxes = np.concatenate([low, low + 0.01], 1)
        merges, costs = g.agglomerate(boxes)

        def area(i, j):
            extent = np.maximum(boxes[i, 3:], boxes[j, 3:]) - np.minimum(boxes[i, :3], boxes[j, :3])
            return extent[0] * extent[1] + extent[1] * extent[2] + extent[2] * extent[0]
        best = min(itertools.combinations(range(30), 2), key=lambda pair: area(*pair))
        first = merges[np.argmin(costs)]
        self.assertEqual(set(first), set(best))
        self.assertAlmostEqual(costs.min() / area(*best), 1, 4)
        self.assertEqual(sorted(merges.reshape(-1)), list(range(58)), "each cluster is merged once")

    def test_strategies_agree(self):
        balls = np.random.default_rng(2).random((200, 4))
        results = [g.agglomerate(balls, np.zeros(200), strategy) for strategy in g.STRATEGIES]
        for merges, costs in results[1:]:
            np.testing.assert_array_equal(merges, results[0][0])
            np.testing.assert_array_equal(costs, results[0][1])

    def test_refuses_by_name(self):
        for items, radii, strategy, says in (([[0, 0, 0, 1, 1]], None, "local", "items"), ([[1, 0, 0, 0, 0, 0]], None, "local", "box 0"),
                                             ([[0, 0, 0, 1, 1, 1]], None, "best", "strategy"), ([[math.nan]], [0], "local", "")):
            with self.assertRaisesRegex(g.Error, says):
                g.agglomerate(items, radii, strategy)


class OwnDissimilarities(unittest.TestCase):
    """Boxes (-lo, hi) by half their joint area, which `agglomerate` has too; and Manhattan distance of intervals' ends."""

    def setUp(self):
        rng = np.random.default_rng(8)
        lo = rng.random((60, 3), np.float32)
        self.boxes = np.column_stack([lo, lo + rng.random((60, 3), np.float32) * np.float32(0.2)])
        self.leaves = np.column_stack([-self.boxes[:, :3], self.boxes[:, 3:]])

    @staticmethod
    def area(a, others):
        x, y, z = (np.maximum(a[:3], others[:, :3]) + np.maximum(a[3:], others[:, 3:])).T
        return x * (y + z) + y * z

    def test_build_the_tree_of_the_area_of_boxes(self):
        merges, costs = g.agglomerate(self.boxes)
        for strategy in g.STRATEGIES:
            own, own_costs = g.agglomerate_by(self.leaves, np.maximum, self.area, strategy=strategy)
            np.testing.assert_array_equal(own, merges)
            np.testing.assert_allclose(own_costs, costs, rtol=1e-4)   # ours widens boxes by 1e-7

    def test_pass_on_what_their_functions_raise(self):
        def fails(a, others):
            raise KeyError("mine")
        with self.assertRaisesRegex(KeyError, "mine"):
            g.agglomerate_by(self.leaves, np.maximum, fails)
        with self.assertRaisesRegex(g.Error, "NaN"):
            g.agglomerate_by(self.leaves, np.maximum, lambda a, others: np.full(len(others), np.nan))
        with self.assertRaisesRegex(g.Error, "joint cluster"):
            g.agglomerate_by(self.leaves, np.minimum, self.area)
        with self.assertRaisesRegex(g.Error, "locally ordered"):
            g.agglomerate_by(self.leaves, np.maximum, self.area, may_decrease=True)
        self.assertEqual(len(g.agglomerate_by(self.leaves, np.maximum, self.area, may_decrease=True, strategy="heap")[0]), 59)
        with self.assertRaisesRegex(g.Error, "leaves"):
            g.agglomerate_by(np.zeros(3), np.maximum, self.area)
        self.assertEqual(len(g.agglomerate_by(np.zeros((0, 2)), np.maximum, self.area)[0]), 0)


class BallTrees(unittest.TestCase):
    def setUp(self):
        rng = np.random.default_rng(3)
        self.centres, self.radii = rng.uniform(-1, 1, (90, 3)), rng.uniform(0, 0.4, 90)
        self.queries, self.reaches = rng.uniform(-1, 1, (40, 3)), rng.uniform(0, 0.5, 40)
        self.apart = np.linalg.norm(self.queries[:, None] - self.centres, axis=2)

    def test_searches_are_those_of_brute_force_with_every_builder(self):
        q, r = self.reaches[:, None], self.radii
        expected = {"containing": self.apart + q <= r, "intersecting": self.apart <= q + r, "contained": self.apart + r <= q}
        for builder in g.BUILDERS:
            tree = g.BallTree(self.centres, self.radii, builder)
            self.assertEqual(len(tree), 90)
            for kind, hits in expected.items():
                found = tree.search(kind, self.queries, self.reaches)
                self.assertEqual([list(f) for f in found], [list(np.flatnonzero(row)) for row in hits], (builder, kind))
            np.testing.assert_array_equal(tree.nearest(self.queries, 5), np.argsort(self.apart, 1, kind="stable")[:, :5])

    def test_nearest_by_nearest_and_furthest_points_and_best_mates(self):
        reach = {"centre": self.apart, "least": np.maximum(0, self.apart - self.radii), "greatest": self.apart + self.radii}
        q, r = self.reaches[:, None], self.radii
        joint = np.maximum(np.maximum(q, r), (self.apart + q + r) / 2)
        for builder in g.BUILDERS:
            tree = g.BallTree(self.centres, self.radii, builder)
            for by, distances in reach.items():
                np.testing.assert_array_equal(tree.nearest(self.queries, 6, by), np.argsort(distances, 1, kind="stable")[:, :6], f"{builder} {by}")
            mates = tree.best_mate(self.queries, self.reaches)
            np.testing.assert_allclose(joint[np.arange(40), mates], joint.min(1), rtol=1e-12)
        with self.assertRaisesRegex(g.Error, "by"):
            tree.nearest(self.queries, 1, "mean")

    def test_leaves_come_and_go(self):
        tree = g.BallTree(self.centres[:3], builder="insertion")
        leaf = tree.insert([9, 9, 9])
        self.assertEqual((leaf, tree.nearest([[8, 9, 9]])[0, 0]), (3, 3))
        tree.remove(leaf)
        self.assertNotEqual(tree.nearest([[8, 9, 9]])[0, 0], 3)
        self.assertEqual(list(tree.nearest([[0, 0, 0]], 5)[0, 3:]), [g.NONE, g.NONE])
        with self.assertRaisesRegex(g.Error, "leaf"):
            tree.remove(77)

    def test_bottom_up_is_no_larger_than_kd_in_the_plane(self):
        points = np.random.default_rng(4).random((500, 2))
        self.assertLess(g.BallTree(points, builder="bottom-up").volume, g.BallTree(points, builder="kd").volume)

    def test_refuses_by_name(self):
        for centres, radii, says in ((np.zeros(3), None, "centres"), (np.zeros((2, 2)), [1], "radii: 2 numbers"), ([[math.inf, 0]], None, ""),
                                     ([[0, 0]], [-1], "radi")):
            with self.assertRaisesRegex(g.Error, says):
                g.BallTree(centres, radii)
        with self.assertRaisesRegex(g.Error, "kind"):
            g.BallTree([[0, 0]]).search("near", [[0, 0]])


class Hulls(unittest.TestCase):
    def test_of_a_sliding_window_holds_all_points_and_is_made_of_them(self):
        t = np.arange(400)
        chain = np.stack([(50 + t) * np.cos(t * 0.3), (50 + t) * np.sin(t * 0.3)], 1)
        hull = g.Hull()
        hull.push(chain[:100])
        for i in range(100, 400, 10):
            hull.push(chain[i:i + 10])
            hull.pop(10)
            window, corners = chain[i - 90:i + 10], hull.vertices()
            self.assertEqual(len(hull), 100)
            edges = np.roll(corners, -1, 0) - corners
            side = edges[:, None, 0] * (window[:, 1] - corners[:, None, 1]) - edges[:, None, 1] * (window[:, 0] - corners[:, None, 0])
            self.assertGreaterEqual(side.min(), -1e-9, "counter-clockwise around the whole window")
            self.assertTrue({tuple(c) for c in corners} <= {tuple(w) for w in window})

    def test_says_which_point_crosses(self):
        hull = g.Hull(check_simple=True)
        with self.assertRaisesRegex(g.Error, "point 3"):
            hull.push([[0, 0], [2, 2], [2, 0], [0, 2]])
        with self.assertRaisesRegex(g.Error, "7 points to remove of 3"):
            hull.pop(7)


class HittingSets(unittest.TestCase):
    def setUp(self):
        rng = np.random.default_rng(5)
        self.points = rng.random((14, 2))
        self.disks = np.column_stack([self.points[rng.integers(0, 14, 10)], rng.uniform(0.05, 0.4, 10)])
        self.hit = np.linalg.norm(self.disks[:, None, :2] - self.points, axis=2) <= self.disks[:, 2:]

    def test_is_the_smallest_there_is(self):
        best = next(k for k in range(1, 15) if any(self.hit[:, list(s)].any(1).all() for s in itertools.combinations(range(14), k)))
        chosen, known = g.hitting_set(self.points, self.disks)
        self.assertTrue(self.hit[:, chosen].any(1).all())
        self.assertEqual(len(chosen), best)
        self.assertLessEqual(known["lower_bound"], best)

    def test_every_method_hits_every_disk(self):
        for method in ("greedy", "pruned", "local", *(["dnet"] if HAS_CGAL else [])):
            chosen, _ = g.hitting_set(self.points, self.disks, method)
            self.assertTrue(self.hit[:, chosen].any(1).all(), method)

    def test_refuses_by_name(self):
        empty = np.append(self.disks, [[9, 9, 0.1]], 0)
        with self.assertRaisesRegex(g.Error, "disk 10"):
            g.hitting_set(self.points, empty)
        self.assertEqual(g.hitting_set(self.points, empty, drop_empty=True)[1]["empty_disks"], 1)
        for start in ([14], [-1], [0.5]):
            with self.assertRaisesRegex(g.Error, "start"):
                g.hitting_set(self.points, self.disks, "local", start=start)


    def test_of_ranges_is_that_of_the_disks_that_hold_them(self):
        ranges = [np.flatnonzero(row) for row in self.hit]
        chosen, known = g.hitting_set_of_ranges(14, ranges)
        expected, of_disks = g.hitting_set(self.points, self.disks)
        self.assertEqual((list(chosen), known["lower_bound"]), (list(expected), of_disks["lower_bound"]))
        for exchange in (2, 3, 4):
            local, _ = g.hitting_set_of_ranges(14, ranges, "local", start=np.arange(14), exchange=exchange)
            self.assertTrue(self.hit[:, local].any(1).all())
        self.assertEqual(len(g.hitting_set_of_ranges(14, [*ranges, []], drop_empty=True)[0]), len(chosen))
        for lists, says in (([[14]], "point 14"), ([[]], "range 0"), ([[-1]], "ranges")):
            with self.assertRaisesRegex(g.Error, says):
                g.hitting_set_of_ranges(14, lists)

    def test_points_in_squares_are_those_within_their_sides(self):
        found = g.points_in_copies(self.points, [[1, 1], [-1, 1], [-1, -1], [1, -1]], self.disks)
        within = np.abs(self.disks[:, None, :2] - self.points).max(2) <= self.disks[:, 2:]
        self.assertEqual([sorted(f) for f in found], [list(np.flatnonzero(row)) for row in within])

    def test_the_tight_instance_stops_exchanges_of_three(self):
        points, disks, start = g.tight_instance(6)
        held = np.linalg.norm(disks[:, None, :2] - points, axis=2) <= disks[:, 2:]
        np.testing.assert_array_equal(held.sum(1), 2)
        np.testing.assert_array_equal(held[:, start].sum(1), 1)
        self.assertEqual(list(g.hitting_set(points, disks, "local", start=start)[0]), list(start))
        with self.assertRaisesRegex(g.Error, "side 0"):
            g.tight_instance(0)

    def test_independent_disks_do_not_touch(self):
        chosen = g.independent_disks(self.disks)
        apart = np.linalg.norm(self.disks[chosen][:, None, :2] - self.disks[chosen][:, :2], axis=2)
        touch = apart <= self.disks[chosen][:, 2] + self.disks[chosen][:, 2:]
        np.testing.assert_array_equal(touch, np.eye(len(chosen), dtype=bool))
        with self.assertRaisesRegex(g.Error, "exchange 7"):
            g.independent_disks(self.disks, 7)


@unittest.skipUnless(HAS_CGAL, "built without CGAL")
class EpsilonNets(unittest.TestCase):
    def test_no_heavy_disk_is_without_a_point(self):
        rng = np.random.default_rng(6)
        points, weights = rng.random((300, 2)), rng.random(300)
        for thesis in (False, True):
            net = g.epsilon_net(points, 0.1, weights, thesis)
            heaviest = g.heaviest_unhit_disk(points, net, weights)
            self.assertLess(heaviest, 0.1 * weights.sum())
            # Disks at random hold no more than that where they hold no point of the net.
            centres, radii = rng.random((400, 2)), rng.random(400) * 0.3
            inside = np.linalg.norm(centres[:, None] - points, axis=2) <= radii[:, None]
            unhit = ~inside[:, net].any(1)
            self.assertLessEqual((inside[unhit] * weights).sum(1).max(), heaviest + 1e-9)

    def test_refuses_by_name(self):
        with self.assertRaisesRegex(g.Error, "epsilon"):
            g.epsilon_net([[0, 0]], 2)
        with self.assertRaisesRegex(g.Error, "net: 5"):
            g.heaviest_unhit_disk([[0, 0]], [5])


class FaceClusters(unittest.TestCase):
    def test_two_planes_are_two_clusters(self):
        vertices, faces = sheet(fold=1.0)
        clusters = g.FaceClusters(vertices, faces, clusters=1)
        clusters.run()
        self.assertGreater(clusters.error, 1)
        clusters.refine(1e-6, 8)
        self.assertLess(clusters.error, 1e-6)
        left = vertices[faces].mean(1)[:, 0] < 6
        self.assertFalse(set(clusters.labels[left]) & set(clusters.labels[~left]))

    def test_follow_a_mesh_that_moves(self):
        vertices, faces = sheet()
        clusters = g.FaceClusters(vertices, faces, clusters=9)
        clusters.run()
        clusters.move(sheet(fold=0.5)[0])
        clusters.run(10)
        self.assertEqual((len(clusters), len(set(clusters.labels)), len(clusters.labels)), (9, 9, 288))

    def test_of_the_tree_are_balanced_by_weight(self):
        vertices, faces = sheet()
        weights = np.where(np.arange(288) % 24 < 12, 10.0, 1.0)

        def apart(tree):
            halves = np.bincount(tree.labels(1), weights)
            self.assertEqual(len(halves), 2)
            return abs(halves[0] - halves[1]) / weights.sum()
        self.assertLess(apart(g.FaceTree(vertices, faces, weights)), 0.2)
        tree = g.FaceTree(vertices, faces)
        self.assertLess(tree.imbalance, 0.5)
        before = apart(tree)
        tree.set_weights(weights)
        self.assertLess(apart(tree), before)

    def test_one_weight_at_a_time_balances_as_well(self):
        vertices, faces = sheet()
        tree = g.FaceTree(vertices, faces, np.ones(288))
        for face in range(288):
            tree.set_weight(face, 10.0 if face % 24 < 12 else 1.0)
        weights = np.where(np.arange(288) % 24 < 12, 10.0, 1.0)
        halves = np.bincount(tree.labels(1), weights)
        self.assertLess(abs(halves[0] - halves[1]) / weights.sum(), 0.35, "imbalance of at most tau = 1")
        with self.assertRaisesRegex(g.Error, "no face 288"):
            tree.set_weight(288, 1)

    def test_by_angles_borders_lie_on_creases(self):
        vertices, faces = sheet(fold=2.0)
        clusters = g.FaceClusters(vertices, faces, clusters=2, lambda_=0, metric="schlafman")
        clusters.run()
        left = vertices[faces].mean(1)[:, 0] < 6
        self.assertFalse(set(clusters.labels[left]) & set(clusters.labels[~left]))
        other = [g.FaceClusters(vertices, faces, clusters=5, random_seeds=seed) for seed in (1, 1, 2)]
        for clusters in other:
            clusters.run(2)
        self.assertEqual(list(other[0].labels), list(other[1].labels))
        self.assertNotEqual(list(other[0].labels), list(other[2].labels))

    def test_make_an_atlas_that_is_true_to_planes(self):
        vertices, faces = sheet(fold=1.0)
        labels = (vertices[faces].mean(1)[:, 0] > 6).astype(np.uint32)
        corners, turned_away = g.texture_atlas(vertices, faces, labels)
        self.assertEqual(turned_away, 0)
        self.assertTrue(corners.min() >= 0 and corners.max() <= 1)
        edges = np.linalg.norm(vertices[faces] - np.roll(vertices[faces], 1, 1), axis=2)
        ratio = np.linalg.norm(corners - np.roll(corners, 1, 1), axis=2) / edges
        np.testing.assert_allclose(ratio, ratio[0, 0], rtol=1e-9)
        with self.assertRaisesRegex(g.Error, "gap"):
            g.texture_atlas(vertices, faces, labels, 1)

    def test_refuse_by_name(self):
        vertices, faces = sheet(2)
        for make, says in ((lambda: g.FaceClusters(vertices, faces + 5), ""), (lambda: g.FaceClusters(vertices[:, :2], faces), "vertices"),
                           (lambda: g.FaceClusters(vertices, faces - 1), "faces"), (lambda: g.FaceTree(vertices, faces, [1]), "weights: 8"),
                           (lambda: g.FaceClusters(vertices, faces, 2).move(vertices[1:]), "vertices: 9")):
            with self.assertRaisesRegex(g.Error, says):
                make()


class Interface(unittest.TestCase):
    def test_signatures_are_those_of_the_header(self):
        text = re.sub(r"/\*.*?\*/", "", HEADER.read_text(), flags=re.S)
        declared = {name: [a.strip() for a in arguments.split(",") if a.strip() != "void"] for name, arguments
                    in re.findall(r"LUMICUT_GEOMETRY_API [\w* ]+?lumicut_(\w+)\(([^)]*)\);", text)}
        functions = g.FUNCTIONS | g.CGAL_FUNCTIONS
        self.assertEqual(set(functions), set(declared))
        plain = {"int": ctypes.c_int, "size_t": ctypes.c_size_t, "double": ctypes.c_double, "uint32_t": ctypes.c_uint32,
                 "uint64_t": ctypes.c_uint64, "float": ctypes.c_float}
        for name, arguments in declared.items():
            self.assertEqual(len(arguments), len(functions[name][1]), name)
            for argument, kind in zip(arguments, functions[name][1]):
                base, pointer = argument.replace("const ", "").split()[0].rstrip("*"), "*" in argument
                wanted = plain.get(base, None)
                if base == "char":
                    wanted, pointer = ctypes.c_char_p, False
                elif base in ("lumicut_face_clusters_desc", "lumicut_hitting_set_info", "lumicut_dissimilarity"):
                    wanted = {"f": g.FaceClustersDesc, "h": g.HittingSetInfo, "d": g.Dissimilarity}[base.removeprefix("lumicut_")[0]]
                elif wanted is None:
                    wanted = ctypes.c_void_p
                self.assertIs(kind, ctypes.POINTER(wanted) if pointer else wanted, f"{name}: {argument}")

    def test_libraries_show_these_functions_alone(self):
        for library, functions in (("geometry", g.FUNCTIONS), ("geometry_cgal", g.CGAL_FUNCTIONS)):
            file = BUILD / f"lib/liblumicut_{library}.so"
            if not file.exists():
                continue
            shown = subprocess.run(["nm", "-D", "--defined-only", "--format=just-symbols", file], capture_output=True, text=True, check=True)
            names = {line.split("@")[0] for line in shown.stdout.split()} - {"LUMICUT_GEOMETRY_1"}
            self.assertEqual(names, {"lumicut_" + name for name in functions})

    def test_null_is_refused(self):
        dll = g._geometry()
        self.assertEqual(dll.lumicut_balltree_remove(None, 0), 1)
        self.assertIn(b"tree is NULL", dll.lumicut_geometry_error())
        self.assertEqual(dll.lumicut_hull_push(None, None, 1), 1)
        self.assertEqual(dll.lumicut_balltree_create(None, None, 5, 2, 0, ctypes.byref(ctypes.c_void_p())), 1)
        self.assertIn(b"centres is NULL", dll.lumicut_geometry_error())
        self.assertEqual(dll.lumicut_balltree_create(None, None, 1 << 60, 2, 0, ctypes.byref(ctypes.c_void_p())), 1)
        for release in ("balltree", "hull", "face_clusters", "face_tree", "indices"):
            getattr(dll, f"lumicut_{release}_release")(None)

    def test_a_host_in_c_finds_the_installed_library(self):
        compiler, pkg_config, cmake = shutil.which("cc"), shutil.which("pkg-config"), shutil.which("cmake")
        if not (compiler and pkg_config and cmake):
            self.skipTest("no C compiler or pkg-config")
        with tempfile.TemporaryDirectory() as folder:
            for component in ("geometry", "geometry_cgal", "geometry_development"):
                subprocess.run([cmake, "--install", BUILD, "--prefix", folder, "--component", component], check=True, capture_output=True)
            host = pathlib.Path(folder) / "host.c"
            host.write_text("""#include <lumicut/lumicut_geometry.h>
#include <stdio.h>
int main(void) {
  const double points[8] = {0, 0, 1, 0, 1, 1, .5, .4};
  double corners[8];
  size_t count = 0;
  lumicut_hull hull = NULL;
  if (lumicut_hull_create(0, &hull) != LUMICUT_GEOMETRY_OK || lumicut_hull_push(hull, points, 4) != LUMICUT_GEOMETRY_OK) return 1;
  lumicut_hull_size(hull, NULL, &count);
  lumicut_hull_vertices(hull, corners);
  printf("%zu %s\\n", count, lumicut_hull_pop(hull, 9) == LUMICUT_GEOMETRY_INVALID_STATE ? lumicut_geometry_error() : "?");
  lumicut_hull_release(hull);
  return 0;
}
""")
            library = next(pathlib.Path(folder).rglob("liblumicut_geometry.so.1")).parent
            flags = subprocess.run([pkg_config, "--cflags", "--libs", "lumicut_geometry"], check=True, capture_output=True, text=True,
                                   env=os.environ | {"PKG_CONFIG_PATH": str(library / "pkgconfig")}).stdout.split()
            subprocess.run([compiler, "-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", host, "-o", host.with_suffix(""), *flags],
                           check=True)
            done = subprocess.run([host.with_suffix("")], capture_output=True, text=True, env=os.environ | {"LD_LIBRARY_PATH": str(library)}, check=True)
            self.assertEqual(done.stdout.split()[0], "3")
            self.assertIn("9 points to remove of 4", done.stdout)
            project = pathlib.Path(folder) / "project"
            project.mkdir()
            (project / "CMakeLists.txt").write_text("""cmake_minimum_required(VERSION 3.22)
project(host LANGUAGES C)
find_package(lumicut_geometry 1.0 REQUIRED)
add_executable(host ../host.c)
target_link_libraries(host PRIVATE lumicut::geometry)
""")
            for command in ([cmake, "-S", project, "-B", project / "build", f"-DCMAKE_PREFIX_PATH={folder}"], [cmake, "--build", project / "build"]):
                built = subprocess.run(command, capture_output=True, text=True)
                self.assertEqual(built.returncode, 0, built.stdout + built.stderr)


class TheDocsExamples(unittest.TestCase):
    def test_run_one_after_the_other(self):
        text = (ROOT / "docs/geometry.md").read_text()
        found = re.findall(r"```python\n(.*?)```", text, re.S)
        self.assertTrue(found)
        names = {}
        for example in found:
            if "epsilon_net" in example and not HAS_CGAL:
                continue
            exec(compile(example, "docs/geometry.md", "exec"), names)


if __name__ == "__main__":
    unittest.main()
