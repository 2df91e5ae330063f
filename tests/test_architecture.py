"""The architecture: includes go down the map of docs/design.md, the library links what it says, one version holds."""
import json
import os
import pathlib
import re
import subprocess
import tempfile
import unittest

ROOT = pathlib.Path(os.environ.get("LUMICUT_SOURCE_DIR", pathlib.Path(__file__).resolve().parents[1]))
BUILD = pathlib.Path(os.environ.get("LUMICUT_BINARY_DIR", ROOT / "build/release"))

# The layers of the library, highest first. A folder includes from itself and from the folders below it.
LAYERS = ["plugin", "render", "integrators", "clustering", "lights", "film", "scene", "bsdf", "geometry", "accel", "core"]
# "lumicut" is the public header, plugin/include/lumicut.
MAY_INCLUDE = {folder: set(LAYERS[index:]) for index, folder in enumerate(LAYERS)}
MAY_INCLUDE["plugin"] |= {"lumicut"}
# Hosts: of the library they know the public header and the metrics alone.
MAY_INCLUDE["io"] = {"io", "lumicut", "film/metrics.h"}
MAY_INCLUDE["tools"] = {"tools", "io", "lumicut", "film/metrics.h"}
# A host of geometry/, which reads and writes its files by io/.
MAY_INCLUDE["geometry/command"] = MAY_INCLUDE["geometry"] | {"io"}
# Benchmarks measure what is inside the library, below the C ABI. Nothing includes from bench/ but itself.
MAY_INCLUDE["bench"] = {"bench", "io", *LAYERS[1:]}
# Tests may look into everything but the benchmarks. Nothing includes from tests/ but itself.
MAY_INCLUDE["tests"] = {"tests", "tools", "io", "lumicut", *LAYERS}

SOURCES = {".h", ".hpp", ".cpp", ".c", ".inc"}
INCLUDE = re.compile(r'^\s*#\s*include\s+(["<])([^">]+)[">]')
# Headers in quotes that are not in the source tree: Highway's, which are included in quotes by its convention, and those
# that the build writes.
ELSEWHERE = re.compile(r"hwy/|lumicut_git_version\.h$|lumicut_report_assets\.h$")
# Stand-ins for oneTBB's headers, which include each other as oneTBB's do.
SYSTEM_HEADERS = "tests/tsan"
NOT_SOURCES = {"build", "out"}


def rule_of(path):
    """The longest folder of MAY_INCLUDE that holds the path, None where there is none."""
    parts = path.parent.parts
    names = ("/".join(parts[:length]) for length in range(len(parts), 0, -1))
    return next((name for name in names if name in MAY_INCLUDE), None)


def wrong_includes(root):
    found = []
    folders = [p for p in sorted(root.iterdir()) if p.is_dir() and p.name not in NOT_SOURCES and p.name[0] != "."]
    tops = {p.name for p in folders} | {"lumicut"}
    for path in (p for folder in folders for p in sorted(folder.rglob("*")) if p.suffix in SOURCES and p.is_file()):
        file = path.relative_to(root)
        if file.is_relative_to(SYSTEM_HEADERS):
            continue
        rule = rule_of(file)
        if rule is None:
            found.append(f"{file}: its folder is not on the map")
            continue
        for number, line in enumerate(path.read_text().splitlines(), 1):
            match = INCLUDE.match(line)
            if not match:
                continue
            quote, name = match.groups()
            top = name.partition("/")[0]
            if top in tops and "/" in name:
                if top not in MAY_INCLUDE[rule] and name not in MAY_INCLUDE[rule]:
                    found.append(f"{file}:{number}: {rule}/ includes {name}")
            elif quote == '"' and not ELSEWHERE.match(name) and ("/" in name or not (path.parent / name).exists()):
                found.append(f"{file}:{number}: {name} is neither a path from the root nor beside the file")
    return found


class Sources(unittest.TestCase):
    """A file that no target names is neither built nor tested, and nothing says so."""
    ELSEWHERE = ("tests/fuzz/", "tests/tsan/")  # of other presets

    def test_every_one_is_built(self):
        commands = BUILD / "compile_commands.json"
        if not commands.exists():
            self.skipTest("this build has no compile_commands.json")
        built = {str(pathlib.Path(entry["file"]).resolve().relative_to(ROOT.resolve())) for entry in json.loads(commands.read_text())
                 if pathlib.Path(entry["file"]).resolve().is_relative_to(ROOT.resolve())}
        there = {str(p.relative_to(ROOT)) for top in [*LAYERS, "io", "tools", "tests", "bench"] for p in (ROOT / top).rglob("*.cpp")}
        if not any(name.startswith("geometry/dnet") for name in built):
            self.skipTest("built without CGAL")
        self.assertEqual(sorted(name for name in there - built if not name.startswith(self.ELSEWHERE)), [])


class Includes(unittest.TestCase):
    def test_each_goes_down_the_map(self):
        self.assertEqual(wrong_includes(ROOT), [])

    def test_one_that_does_not_is_named(self):
        for file, include in (("core/vec.h", '"scene/scene.h"'), ("scene/scene.cpp", "<lumicut/lumicut.h>"),
                              ("io/a.cpp", '"film/film.h"'), ("tools/a.cpp", '"plugin/objects.h"'),
                              ("bench/kernels/a.cpp", '"plugin/objects.h"'), ("bench/a.h", '"tests/support/render.h"'),
                              ("tests/core/a.cpp", '"bench/smoke.h"'), ("accel/a.cpp", '"bench/smoke.h"'),
                              ("bench/kernels/a.cpp", '"meshes.h"'), ("core/a.cpp", '"../scene/scene.h"'),
                              ("geometry/hull.cpp", '"io/image_file.h"'), ("unknown/a.cpp", "<vector>")):
            with self.subTest(file=file, include=include), tempfile.TemporaryDirectory() as folder:
                for top in [*LAYERS, "io", "tools", "tests", "bench"]:
                    (pathlib.Path(folder) / top).mkdir()
                path = pathlib.Path(folder) / file
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_text(f"#include {include}\n")
                self.assertEqual(len(wrong_includes(pathlib.Path(folder))), 1)

    def test_the_map_of_the_docs_has_the_same_layers_in_the_same_order(self):
        written = re.findall(r"^(\w+)/ ", (ROOT / "docs/design.md").read_text(), re.MULTILINE)
        self.assertEqual([folder for folder in written if folder in LAYERS], LAYERS)
        self.assertEqual({"tools", "io", "tests", "bench"} - set(written), set())

    def test_the_build_adds_the_layers_from_the_lowest_up(self):
        added = re.search(r"^set\(folders (.+)\)$", (ROOT / "CMakeLists.txt").read_text(), re.MULTILINE)[1].split()
        self.assertEqual(added, LAYERS[::-1])


class Library(unittest.TestCase):
    def test_it_links_embree_tbb_highway_and_the_c_and_cxx_runtimes_alone(self):
        library = BUILD / "lib/liblumicut.so"
        if not library.exists():
            self.skipTest(f"{library} is not built")
        needed = re.findall(r"\(NEEDED\).*\[(.+?)\]",
                            subprocess.run(["readelf", "-d", library], check=True, capture_output=True, text=True).stdout)
        # Sanitizer runtimes appear in sanitizer builds alone.
        allowed = re.compile(r"^(libembree[34]|libtbb|libhwy|libstdc\+\+|libm|libgcc_s|libc|ld-linux-x86-64|libasan|libubsan|libtsan)\.so")
        self.assertEqual([name for name in needed if not allowed.match(name)], [])


class Version(unittest.TestCase):
    def setUp(self):
        self.version = re.search(r"^project\(lumicut VERSION (\d+\.\d+\.\d+) ", (ROOT / "CMakeLists.txt").read_text(),
                                 re.MULTILINE)[1]

    def test_every_file_that_states_it_states_the_projects(self):
        addon = ROOT / "export_scripts/lumicut_blender"
        places = [(addon / "__init__.py", r'"version": \((\d+, \d+, \d+)\)', ", "),
                  (addon / "blender_manifest.toml", r'^version = "(.*)"$', "."),
                  (ROOT / "plugin/include/lumicut/lumicut.h", r'"(\d+\.\d+\.\d+)"', "."),
                  *((page, r"lumicut_blender-([\d.]+)\.zip", ".") for page in (ROOT / "README.md", ROOT / "docs/blender.md"))]
        for path, pattern, separator in places:
            with self.subTest(path=path):
                found = re.findall(pattern, path.read_text(), re.MULTILINE)
                self.assertEqual(set(found), {self.version.replace(".", separator)})

    def test_it_is_the_newest_release_of_the_changelog(self):
        headings = re.findall(r"^## \[(.+?)\](.*)$", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)
        self.assertEqual(headings[0], ("Unreleased", ""))
        self.assertEqual(headings[1][0], self.version)
        for name, date in headings[1:]:
            self.assertRegex(f"{name}{date}", r"^\d+\.\d+\.\d+ - \d{4}-\d\d-\d\d$")

    def test_no_other_source_states_it(self):
        written = re.compile(rf'(?<![\d.]){re.escape(self.version)}(?![\d.]*\d)')
        states = {"CMakeLists.txt", "plugin/include/lumicut/lumicut.h",
                  "export_scripts/lumicut_blender/blender_manifest.toml"}
        found = []
        for path in sorted(p for p in ROOT.rglob("*") if p.suffix in {*SOURCES, ".py", ".toml", ".txt", ".cmake", ".in", ".sh"}):
            name = path.relative_to(ROOT).as_posix()
            if path.is_file() and name.partition("/")[0] not in NOT_SOURCES and name not in states:
                found += [f"{name}: {line.strip()}" for line in path.read_text().splitlines() if written.search(line)]
        self.assertEqual(found, [])

    def test_the_add_on_knows_the_abi_of_the_header(self):
        header = (ROOT / "plugin/include/lumicut/lumicut.h").read_text()
        abi = [int(re.search(rf"^#define LUMICUT_ABI_{part} (\d+)$", header, re.MULTILINE)[1]) for part in ("MAJOR", "MINOR")]
        python = (ROOT / "export_scripts/lumicut/library.py").read_text()
        self.assertEqual(re.search(r"^ABI_MAJOR, ABI_MINOR = (\d+), (\d+)$", python, re.MULTILINE).groups(), tuple(map(str, abi)))


class Decisions(unittest.TestCase):
    def test_each_is_numbered_dated_and_in_the_index_in_order(self):
        folder = ROOT / "docs/decisions"
        rows, numbers = [], []
        for page in sorted(p for p in folder.glob("*.md") if p.name != "README.md"):
            self.assertRegex(page.name, r"^\d{4}-[a-z0-9-]+\.md$")
            number = int(page.name[:4])
            self.assertNotIn(number, numbers)
            numbers.append(number)
            match = re.match(r"# (.+)\n\nDecided on (\d{4}-\d\d-\d\d)\.\n", page.read_text())
            self.assertTrue(match, page.name)
            rows.append(f"| [{number:04d}]({page.name}) | {match[1]} | {match[2]} |")
        self.assertEqual(re.findall(r"^\| \[.*$", (folder / "README.md").read_text(), re.MULTILINE), rows)


if __name__ == "__main__":
    unittest.main()
