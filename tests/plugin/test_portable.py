"""The library of the self-contained zip (build_zip.sh): what it asks of a machine, and that it lives beside other copies of
what it carries. Runs when asked (./check.sh portable); the zip or its build must be there."""
import os
import pathlib
import re
import shutil
import subprocess
import tempfile
import unittest
import zipfile

import abi

ROOT = pathlib.Path(__file__).resolve().parents[2]
BUILD = pathlib.Path(os.environ.get("LUMICUT_PORTABLE_DIR", ROOT / "build/portable"))
TESTS = pathlib.Path(os.environ.get("LUMICUT_BINARY_DIR", ROOT / "build/no-embree"))  # programs built another way
GLIBC = (2, 28)  # what Blender 4 needs itself


def run(*command, **options):
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True, **options)
    if done.returncode != 0:
        raise AssertionError(f"{' '.join(map(str, command))}: {done.returncode}\n{done.stdout}{done.stderr}")
    return done.stdout


class Zip(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        archive = next(BUILD.glob("lumicut_blender-*.zip"))
        with zipfile.ZipFile(archive) as opened:
            opened.extractall(cls.folder.name)
            cls.names = opened.namelist()
        cls.library = pathlib.Path(cls.folder.name) / "lumicut_blender/lib/liblumicut.so.1"

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()


class Symbols(Zip):
    def test_it_needs_the_c_library_alone(self):
        needed = set(re.findall(r"\(NEEDED\).*\[(.+?)\]", run("readelf", "-d", self.library)))
        self.assertLessEqual(needed, {"libc.so.6", "libm.so.6", "libpthread.so.0", "ld-linux-x86-64.so.2"})
        self.assertNotRegex(run("readelf", "-d", self.library), "RPATH|RUNPATH|TEXTREL")

    def test_it_needs_no_symbol_newer_than_glibc_2_28_and_none_of_other_libraries(self):
        versions = set(re.findall(r"Name: (\S+)  Flags", run("readelf", "--version-info", "--wide", self.library)))
        versions -= {"LUMICUT_1", "liblumicut.so.1"}
        glibc = {v for v in versions if re.fullmatch(r"GLIBC_[\d.]+", v)}
        self.assertEqual(versions, glibc)
        self.assertGreater(len(glibc), 3)
        self.assertLessEqual(max(tuple(map(int, v[6:].split("."))) for v in glibc), GLIBC, sorted(glibc))

    def test_what_it_takes_without_a_version_is_weak_and_no_part_of_what_it_carries(self):
        taken = [line.split() for line in run("nm", "-D", "--undefined-only", self.library).splitlines()]
        bare = {words[-1]: words[-2] for words in taken if "@" not in words[-1]}
        # Transactional memory and profiling, which no host has.
        self.assertEqual({n for n, kind in bare.items() if kind != "w" or not re.match("_ITM_|_ZGTt|__gmon_start__", n)}, set())

    def test_it_shows_the_functions_of_the_header_alone(self):
        shown = {line.split()[-1].partition("@@")[0] for line in run("nm", "-D", "--defined-only", self.library).splitlines()}
        self.assertEqual(shown - {"LUMICUT_1"}, set(abi.parse().functions))

    def test_licences_of_what_is_linked_in_are_in_the_zip(self):
        self.assertLessEqual({f"lumicut_blender/licenses/{n}.txt" for n in ("oneTBB", "Highway", "libstdc++")}, set(self.names))


FOREIGN = """
import ctypes, sys, threading
library, host, *others = sys.argv[1:]
held = [ctypes.CDLL(path, mode=ctypes.RTLD_GLOBAL) for path in others]  # as a host links them
embree = held[0]
embree.rtcNewDevice.restype = ctypes.c_void_p
device = ctypes.c_void_p(embree.rtcNewDevice(b"threads=2"))
assert device
sys.path.insert(0, host)
import lumicut
dev = lumicut.Device(2, library)
with lumicut.Scene(dev) as scene, lumicut.Integrator(dev, "lightcuts") as method:
    scene.set_materials([lumicut.Material(diffuse=(0.5, 0.5, 0.5))])
    scene.add_mesh([[-1, -1, -3], [1, -1, -3], [1, 1, -3], [-1, 1, -3]], [[0, 1, 2], [0, 2, 3]])
    scene.set_lights([lumicut.Light(type=lumicut.POINT, color=(1, 1, 1), value=10)])
    scene.set_camera(lumicut.Camera(to_world=(1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0), fov_y=0.6))
    scene.commit()
    method.set("vpls", 100)
    with lumicut.Render(method, scene, 32, 32) as render:
        render.wait(lumicut.FOREVER)
        print("mean", float(render.read("radiance").mean()))
try:
    lumicut.Scene(dev, "embree")
    sys.exit("it took the host's Embree")
except lumicut.Error as error:
    assert error.code == lumicut.UNSUPPORTED
embree.rtcReleaseDevice(device)
"""


def system_library(*names):
    folder = pathlib.Path("/usr/lib/x86_64-linux-gnu")
    return next((folder / name for name in names if (folder / name).exists()), None)


class Beside(Zip):
    def test_it_renders_in_a_process_with_another_onetbb_highway_and_embree(self):
        others = [system_library("libembree4.so.4", "libembree3.so.3"), system_library("libtbb.so.12"), system_library("libhwy.so.1"),
                  system_library("libstdc++.so.6")]
        if None in others:
            self.skipTest("libembree, libtbb or libhwy is not installed")
        with tempfile.TemporaryDirectory() as folder:
            program = pathlib.Path(folder) / "host.py"
            program.write_text(FOREIGN)
            shutil.copytree(ROOT / "export_scripts/lumicut", pathlib.Path(folder) / "lumicut")
            text = run("/usr/bin/python3", program, self.library, folder, *others)
        self.assertGreater(float(re.search(r"mean (\S+)", text)[1]), 0.01)

    def test_the_abi_s_tests_pass_on_it(self):
        program = TESTS / "bin/test_plugin"
        if not program.exists():
            self.skipTest(f"{program} is not built")
        # Instruction sets are chosen by a Highway that program and library share, which they do not here.
        run(program, "--gtest_filter=-InstructionSets.*:*PeakMemory.OfARenderIs*:Lifecycle.*", timeout=1200,
            env={**os.environ, "LD_PRELOAD": str(self.library), "LUMICUT_SOURCE_DIR": str(ROOT), "LUMICUT_BINARY_DIR": str(TESTS)})


if __name__ == "__main__":
    unittest.main(verbosity=2)
