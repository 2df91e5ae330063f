#!/usr/bin/env python3
"""A Python benchmark on its smallest input, a few seconds, so that a broken one is noticed. Its figures mean nothing.

    bench/smoke.py progressive|blender_collect|blender_room|blender_truth

Where Blender or a module is missing, the benchmark is imported with a stand-in for it and prints its help, which is what
can be seen of it there; the last line then begins with "skipped".
"""
import importlib
import json
import os
import pathlib
import runpy
import subprocess
import sys
import tempfile
import unittest.mock

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent
BUILD = pathlib.Path(os.environ.get("LUMICUT_BINARY_DIR", ROOT / "build/release"))
sys.path[:0] = [str(HERE), str(ROOT / "tests/blender"), str(ROOT / "export_scripts/scenes")]
SCENE = ROOT / "reference_images/cornell_box/cornell_box.json"


def run(name, *words):
    print(f"{name}.py {' '.join(map(str, words))}", flush=True)
    sys.argv = [str(HERE / f"{name}.py"), *map(str, words)]
    runpy.run_path(sys.argv[0], run_name="__main__")


def help_alone(name, missing, before=()):
    """What a machine without `missing` can see of a benchmark: that it can be imported, and what its arguments are."""
    for module in missing:
        sys.modules[module] = unittest.mock.MagicMock(__file__=str(HERE))
    try:
        run(name, *before, "--help")
    except SystemExit as end:
        if end.code:
            raise


def progressive(folder):
    missing = []
    for module in ("numpy", "OpenImageIO"):
        try:
            importlib.import_module(module)
        except ImportError:
            missing.append(module)
    if missing:
        help_alone("progressive", missing)
        print(f"skipped: Python's {' and '.join(missing)} not installed (./setup.sh installs them)")
        return
    small = [SCENE, "--folder", folder / "box", "--size", "8x8", "--command", BUILD / "bin/lumicut"]
    lights = ["--", "-p", "compensate=true", "--vpls", "20"]
    run("progressive", "truth", *small, "--parts", 2, "--spp", 1, "--paths", 1)
    run("progressive", "curve", *small, "--passes", 1, 2, *lights)
    run("progressive", "coverage", *small, "--passes", 2, "--seeds", 2, *lights)
    run("progressive", "plot", folder / "box", "--output", folder / "curve.svg")
    assert json.loads(next((folder / "box").glob("*.curve.json")).read_text())
    assert (folder / "curve.svg").stat().st_size > 0


def inside_blender(name, folder):
    kept = ["--folder", folder / "kept"]
    if name == "blender_collect":
        run(name, "--", "--smoke")
        return
    run("../export_scripts/scenes/blender_indirect_room", "--", "--output", folder / "room.blend", "--detail", 0)
    if name == "blender_truth":
        run(name, "--", *kept, "--parts", 2, "--samples", 1, "--paths", 1, "--camera-samples", 1, "--size", 16, 12)
        return
    for mode in (["reference"], ["table"], ["curve"], ["one", "--lumicut", "lightcuts,1,vpls=50,error=0.5"], ["again"]):
        run(name, "--", *mode, *kept, "--smoke")


def main():
    if "--" in sys.argv:  # Blender calls this file again
        name, folder = sys.argv[sys.argv.index("--") + 1:]
        inside_blender(name, pathlib.Path(folder))
        return
    name, = sys.argv[1:]
    with tempfile.TemporaryDirectory() as folder:
        if name == "progressive":
            progressive(pathlib.Path(folder))
            return
        from test_blender import BLENDER, Home
        if not BLENDER:
            help_alone(name, ["bpy", "numpy", "helpers", "lumicut_blender"], ["--"])
            print("skipped: Blender is not installed (./setup.sh installs it)")
            return
        home = Home()
        done = subprocess.run([BLENDER, "-b", "--factory-startup", "--addons", "cycles,lumicut_blender", "--python-exit-code", "1",
                               "-P", __file__, "--", name, folder], env=home.environment(), cwd=folder)
        home.folder.cleanup()
        sys.exit(done.returncode)


if __name__ == "__main__":
    main()
