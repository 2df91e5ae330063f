"""The library as a package: its header under every compiler mode, what it exports, and what it installs."""
import os
import pathlib
import re
import shutil
import subprocess
import tempfile
import unittest

import abi

ROOT = pathlib.Path(os.environ.get("LUMICUT_SOURCE_DIR", pathlib.Path(__file__).resolve().parents[2]))
BUILD = pathlib.Path(os.environ.get("LUMICUT_BINARY_DIR", ROOT / "build/release"))
CC, CXX = os.environ.get("CC", "cc"), os.environ.get("CXX", "c++")
CMAKE = os.environ.get("LUMICUT_CMAKE", "cmake")
INCLUDE, HEADER = ROOT / "plugin/include", abi.HEADER
LIBRARY = BUILD / "lib/liblumicut.so"
VERSION = re.search(r"^project\(lumicut VERSION ([\d.]+) ", (ROOT / "CMakeLists.txt").read_text(), re.MULTILINE)[1]


def run(*command, **options):
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True, **options)
    if done.returncode != 0:
        raise AssertionError(f"{' '.join(map(str, command))}\n{done.stdout}{done.stderr}")
    return done.stdout


def first_example():
    """The lines of C in the header's first comment."""
    lines = HEADER.read_text().split(" */\n")[0].split("*/")[0].splitlines()
    start = next(n for n, line in enumerate(lines) if line.startswith(" * A picture")) + 2
    end = next(n for n in range(start, len(lines)) if not lines[n].removeprefix(" *").strip())
    return end, "\n".join(line.removeprefix(" *") for line in lines[start:end])


class Header(unittest.TestCase):
    HEADERS = ("lumicut.h", "lumicut_hits.h", "lumicut_lights.h", "lumicut_programs.h", "lumicut_state.h")
    WARNINGS = ["-Wall", "-Wextra", "-Wpadded", "-pedantic", "-pedantic-errors", "-Werror", "-fsyntax-only"]

    def compile(self, compiler, standard, language, header, warnings):
        run(compiler, "-x", language, f"-std={standard}", *warnings, f"-I{INCLUDE}", "-",
            input=f"#include <lumicut/{header}>\nint use(void);\nint use(void) {{ return LUMICUT_ABI_MAJOR; }}\n")

    def test_c_headers_compile_clean_and_without_padding_in_every_standard(self):
        for standard in ("c99", "c11", "c17", "gnu99"):
            with self.subTest(standard):
                for header in self.HEADERS:
                    self.compile(CC, standard, "c", header, [*self.WARNINGS, "-Wstrict-prototypes", "-Wc++-compat"])
        for standard in ("c++17", "c++20"):
            with self.subTest(standard):
                for header in self.HEADERS:
                    self.compile(CXX, standard, "c++", header, self.WARNINGS)

    def test_cxx_wrapper_compiles_clean_in_every_standard(self):
        for standard in ("c++17", "c++20"):
            with self.subTest(standard):
                self.compile(CXX, standard, "c++", "lumicut.hpp", [w for w in self.WARNINGS if w != "-Wpadded"])

    def test_the_first_page_suffices_to_render_a_picture(self):
        lines, example = first_example()
        self.assertLess(lines, 60, "lines of a page")
        small = example.replace("640", "64").replace("480", "48")
        self.assertNotEqual(small, example)
        source = ("#include <stdio.h>\n#include <lumicut/lumicut.h>\nint main(void) {\n" + small +
                  "\n  double sum = 0;\n  for (int i = 0; i < 3 * 64 * 48; ++i) sum += radiance[i];\n"
                  '  printf("%g", sum / (3 * 64 * 48));\n  return 0;\n}\n')
        with tempfile.TemporaryDirectory() as folder:
            program = pathlib.Path(folder) / "picture"
            run(CC, "-x", "c", "-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", f"-I{INCLUDE}", "-", "-o", program,
                f"-L{LIBRARY.parent}", "-llumicut", f"-Wl,-rpath,{LIBRARY.parent}", input=source)
            self.assertGreater(float(run(program)), 0.01)

    def test_c_header_includes_stdint_alone(self):
        self.assertEqual(re.findall(r"#include\s+(\S+)", HEADER.read_text()), ["<stdint.h>"])


class Portable(unittest.TestCase):
    def test_what_is_newer_than_glibc_2_28_is_known_to_the_portable_build(self):
        """plugin/portable/old_glibc.c must have each function that this library takes of a newer one."""
        newer = {name for name, minor in re.findall(r" (\w+)@GLIBC_2\.(\d+)", run("nm", "-D", "--undefined-only", LIBRARY)) if int(minor) > 28}
        source = (ROOT / "plugin/portable/old_glibc.c").read_text()
        self.assertEqual({name for name in newer if not re.search(rf"^(OLD\({name},|.*\b{name}( =|\())", source, re.M)}, set())


class Exports(unittest.TestCase):
    def test_the_library_exports_what_the_header_declares_and_nothing_else(self):
        exported = set()
        for line in run("nm", "-D", "--defined-only", LIBRARY).splitlines():
            name, _, version = line.split()[-1].partition("@@")
            if name == "LUMICUT_1":  # the version itself
                continue
            exported.add(name)
            self.assertEqual(version, "LUMICUT_1", name)
        self.assertEqual(exported, set(abi.parse().functions))

    def test_the_soname_carries_the_abi_major(self):
        self.assertIn("Library soname: [liblumicut.so.1]", run("readelf", "-d", LIBRARY))


class CHost(unittest.TestCase):
    def test_a_host_in_c99_renders_through_dlopen(self):
        with tempfile.TemporaryDirectory() as folder:
            out = pathlib.Path(folder) / "image"
            text = run(BUILD / "bin/c_host", LIBRARY, out)
            self.assertGreater(float(re.search(r"mean radiance (\S+)", text)[1]), 0.01)
            self.assertEqual(out.with_suffix(".ppm").stat().st_size, len(b"P6\n96 64\n255\n") + 96 * 64 * 3)
            self.assertEqual(out.with_suffix(".pfm").stat().st_size, len(b"PF\n96 64\n-1.0\n") + 96 * 64 * 12)

    def test_a_library_that_is_not_there_is_told(self):
        done = subprocess.run([BUILD / "bin/c_host", "/nowhere/liblumicut.so", "x"], capture_output=True, text=True)
        self.assertEqual(done.returncode, 1)
        self.assertIn("/nowhere/liblumicut.so", done.stderr)


MAIN = """
#include <lumicut/lumicut.hpp>
#include <cstdio>
int main() {
  lumicut::api::Device device(1);
  lumicut::api::Integrator integrator(device, "exhaustive");
  std::printf("Lumicut %s, %s lights", lumicut_version(nullptr, nullptr), integrator.value("vpls").c_str());
}
"""
PROJECT = """
cmake_minimum_required(VERSION 3.22)
project(host LANGUAGES CXX)
find_package(lumicut 1.0 REQUIRED)
add_executable(host main.cpp)
target_compile_features(host PRIVATE cxx_std_17)
target_link_libraries(host PRIVATE lumicut::lumicut)
"""


class Install(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        base = pathlib.Path(cls.folder.name)
        for component in ("library", "development"):
            run(CMAKE, "--install", BUILD, "--component", component, "--prefix", base / "first")
        cls.prefix = base / "moved"  # an installed tree may be moved
        (base / "first").rename(cls.prefix)
        cls.project = base / "host"
        cls.project.mkdir()
        (cls.project / "main.cpp").write_text(MAIN)
        (cls.project / "CMakeLists.txt").write_text(PROJECT)

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def test_a_project_finds_it_with_find_package(self):
        build = self.project / "build"
        run(CMAKE, "-S", self.project, "-B", build, f"-DCMAKE_PREFIX_PATH={self.prefix}", f"-DCMAKE_CXX_COMPILER={CXX}")
        run(CMAKE, "--build", build)
        self.assertEqual(run(build / "host"), f"Lumicut {VERSION}, 60000 lights")

    @unittest.skipUnless(shutil.which("pkg-config"), "pkg-config is not installed")
    def test_a_project_finds_it_with_pkg_config(self):
        folder = next(self.prefix.rglob("lumicut.pc")).parent
        environment = {**os.environ, "PKG_CONFIG_PATH": str(folder)}
        flags = run("pkg-config", "--cflags", "--libs", "lumicut", env=environment).split()
        self.assertEqual(run("pkg-config", "--modversion", "lumicut", env=environment).strip(), VERSION)
        program = self.project / "with_pkg_config"
        run(CXX, "-std=c++17", self.project / "main.cpp", "-o", program, *flags,
            f"-Wl,-rpath,{next(self.prefix.rglob('liblumicut.so')).parent}")
        self.assertEqual(run(program), f"Lumicut {VERSION}, 60000 lights")


if __name__ == "__main__":
    unittest.main()
