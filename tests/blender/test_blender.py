"""Blender from outside: the batches that run inside, the zip, exit codes, interruption, libraries that do not fit.

Skipped where Blender is not installed; with a message, so that nobody takes it for passed.
"""
import json
import os
import pathlib
import re
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import unittest
import zipfile

HERE = pathlib.Path(__file__).resolve().parent
ROOT = pathlib.Path(os.environ.get("LUMICUT_SOURCE_DIR", HERE.parents[1]))
BUILD = pathlib.Path(os.environ.get("LUMICUT_BINARY_DIR", ROOT / "build/release"))
BLENDER = os.environ.get("LUMICUT_BLENDER") or shutil.which("blender")
# A zip to test in place of the sources and the build beside them.
ZIP = os.environ.get("LUMICUT_ZIP")
LIBRARY = None if ZIP else BUILD / "lib/liblumicut.so"
PATIENCE = 900  # seconds until a hanging Blender is killed: not a measure of anything

BATCHES = {
    "units": ["in_light_units", "in_materials", "in_images", "in_programs"],
    "scenes": ["in_addon", "in_cancel", "in_catchers", "in_collect", "in_export", "in_film", "in_frames", "in_interface", "in_objects", "in_passes", "in_views"],
    "status": ["in_status"],
}

WRONG_LIBRARY = """
#include <stdint.h>
const char* lumicut_version(uint32_t* major, uint32_t* minor) { *major = 9; *minor = 2; return "9.2.0"; }
"""


class Home:
    """A user's folder of their own, with or without the add-on in it."""

    def __init__(self, addon=True):
        self.folder = tempfile.TemporaryDirectory(prefix="lumicut_home_")
        self.path = pathlib.Path(self.folder.name)
        (self.path / "scripts/addons").mkdir(parents=True)
        if addon and ZIP:
            shutil.unpack_archive(ZIP, self.path / "scripts/addons")
        elif addon:
            (self.path / "scripts/addons/lumicut_blender").symlink_to(ROOT / "export_scripts/lumicut_blender")

    def environment(self, library=LIBRARY):
        env = {k: v for k, v in os.environ.items() if not k.startswith(("BLENDER_USER", "LUMICUT_")) or k == "LUMICUT_UPDATE_DOCS"}
        env |= {"BLENDER_USER_SCRIPTS": str(self.path / "scripts"), "BLENDER_USER_CONFIG": str(self.path / "config"),
                "BLENDER_USER_EXTENSIONS": str(self.path / "extensions"),
                "LUMICUT_SOURCE_DIR": str(ROOT), "LUMICUT_BINARY_DIR": str(BUILD), "HOME": str(self.path),
                "PYTHONDONTWRITEBYTECODE": "1",
                # Blender's Python takes its home from the first python3 in PATH, which may be another version's.
                "PATH": "/usr/local/bin:/usr/bin:/bin"}
        if library is not None:
            env["LUMICUT_LIBRARY"] = str(library)
        return env

    def run(self, *words, library=LIBRARY):
        return subprocess.run([BLENDER, "-b", *map(str, words)], env=self.environment(library), cwd=self.path,
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace", timeout=PATIENCE)

    def python(self, code, *before, library=LIBRARY):
        script = self.path / "script.py"
        script.write_text(code)
        return self.run("--factory-startup", *before, "--python-exit-code", 7, "-P", script, library=library)


ROOM = """
import sys; sys.path.insert(0, {here!r})
import addon_utils; addon_utils.enable("lumicut_blender")
import bpy, helpers as h
scene = h.new_scene(64, 48)
h.add_plane(material=h.diffuse())
h.add_sphere(0.6, (0, 0, 0.6), h.diffuse((0.8, 0.2, 0.1)), {segments})
h.add_light("POINT", energy=100)
{more}
h.set_lumicut({settings})
bpy.ops.wm.save_as_mainfile(filepath={path!r})
"""


def make_room(home, settings="'lightcuts', vpls=500", more="", segments=24, library=LIBRARY):
    path = str(home.path / "room.blend")
    done = home.python(ROOM.format(here=str(HERE), path=path, settings=settings, more=more, segments=segments), library=library)
    assert os.path.exists(path), done.stdout
    return path


def farm(home, blend, *extra, library=LIBRARY):
    """As a render farm calls it. (process, image or None)"""
    done = home.run(blend, "--addons", "lumicut_blender", "-E", "LUMICUT", "-o", "//out_####", "-F", "OPEN_EXR", *extra,
                    "-f", 1, library=library)
    image = home.path / "out_0001.exr"
    return done, image if image.exists() else None


@unittest.skipUnless(BLENDER, "Blender is not installed: nothing of the add-on is tested (./setup.sh installs it)")
class Blender(unittest.TestCase):
    def setUp(self):
        self.home = Home()
        self.addCleanup(self.home.folder.cleanup)


class Batches(Blender):
    def batch(self, name):
        done = self.home.run("--factory-startup", "--python-exit-code", 1, "-P", HERE / "inside.py", "--", *BATCHES[name])
        lines = [line for line in done.stdout.splitlines() if not line.startswith(("Fra:", "Saved:", "Info:")) and line.strip()]
        sys.stderr.write("\n".join(lines) + "\n")
        self.assertEqual(done.returncode, 0, f"batch {name} failed, see above")

    def test_units(self):
        self.batch("units")

    def test_scenes(self):
        self.batch("scenes")

    def test_status(self):
        self.batch("status")


class Farms(Blender):
    def test_a_frame_is_written_and_the_exit_code_is_0(self):
        done, image = farm(self.home, make_room(self.home))
        self.assertEqual(done.returncode, 0, done.stdout)
        self.assertIsNotNone(image)

    def test_approximations_are_in_the_log_once(self):
        more = "m = h.material('Fog'); n = h.shader(m, 'ShaderNodeBsdfGlass'); h.add_sphere(0.2, (0, 0, 1), m)"
        done, _ = farm(self.home, make_room(self.home, more=more))
        self.assertEqual(len([l for l in done.stdout.splitlines() if "Glass" in l and "Fog" in l]), 1, done.stdout)

    def test_a_scene_without_a_camera_ends_with_1_and_no_image(self):
        done, image = farm(self.home, make_room(self.home, more="bpy.data.objects.remove(scene.camera)"))
        self.assertEqual(done.returncode, 1, done.stdout)
        self.assertIsNone(image)

    def test_without_numpy_the_add_on_says_what_to_install(self):
        # As beside Debian's Blender, which does not depend on it.
        done = self.home.python("import sys; sys.modules['numpy'] = None\nimport addon_utils; addon_utils.enable('lumicut_blender')")
        self.assertRegex(done.stdout, "ImportError: Lumicut needs NumPy .*python3-numpy")

    @unittest.skipIf(ZIP, "the zip's own library is there")
    def test_a_missing_library_ends_with_1_no_image_and_says_what_was_tried(self):
        blend = make_room(self.home)
        done, image = farm(self.home, blend, library="/nowhere/liblumicut.so.1")
        self.assertEqual(done.returncode, 1, done.stdout)
        self.assertIsNone(image)
        self.assertRegex(done.stdout, r"no usable Lumicut library.*/nowhere/liblumicut\.so\.1")

    @unittest.skipIf(ZIP, "the zip's own library is there")
    def test_a_library_of_another_abi_is_refused_by_number(self):
        names = re.findall(r'^    "(\w+)": \(', (ROOT / "export_scripts/lumicut/library.py").read_text(), re.M)
        self.assertGreater(len(names), 20)
        source = self.home.path / "wrong.c"
        source.write_text(WRONG_LIBRARY + "".join(f"int lumicut_{n}(void) {{ return 0; }}\n" for n in names if n != "version"))
        wrong = self.home.path / "libwrong.so"
        subprocess.run(["cc", "-shared", "-fPIC", "-o", wrong, source], check=True)
        blend = make_room(self.home)
        done, image = farm(self.home, blend, library=wrong)
        self.assertEqual(done.returncode, 1, done.stdout)
        self.assertIsNone(image)
        self.assertIn("speaks ABI 9.2, this add-on ABI 1:", done.stdout)
        source.write_text(WRONG_LIBRARY)
        subprocess.run(["cc", "-shared", "-fPIC", "-o", wrong, source], check=True)
        done, image = farm(self.home, blend, library=wrong)
        self.assertEqual(done.returncode, 1, done.stdout)
        self.assertIn("lacks the functions", done.stdout)

    def test_a_defect_of_ours_is_an_error_and_not_a_blank_image(self):
        blend = make_room(self.home)
        broken = self.home.path / "break.py"
        broken.write_text("import lumicut_blender.collect as c\n"
                          "def fail(*_): raise KeyError('torn')\nc.Collector.collect = fail\n")
        done, image = farm(self.home, blend, "-P", broken)
        self.assertEqual(done.returncode, 1, done.stdout)
        self.assertIsNone(image)
        self.assertIn("torn", done.stdout)

    def test_an_animation_writes_every_frame(self):
        blend = make_room(self.home)
        done = self.home.run(blend, "--addons", "lumicut_blender", "-E", "LUMICUT", "-o", "//a_##", "-F", "OPEN_EXR",
                             "-s", 1, "-e", 3, "-a")
        self.assertEqual(done.returncode, 0, done.stdout)
        self.assertEqual(len(list(self.home.path.glob("a_0*.exr"))), 3)


class Interruption(Blender):
    def interrupt(self, phase, **room):
        """SIGINT as soon as the phase is at work. (exit code, all output, files)"""
        blend = make_room(self.home, **room)
        process = subprocess.Popen([BLENDER, "-b", blend, "--addons", "lumicut_blender", "-E", "LUMICUT", "-o", "//out_####",
                                    "-F", "OPEN_EXR", "-f", "1"], env=self.home.environment(), cwd=self.home.path,
                                   stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace")
        output, sent = [], False
        watchdog = threading.Timer(PATIENCE, process.kill)
        watchdog.start()
        for line in process.stdout:
            output.append(line)
            if not sent and re.search(phase, line):
                process.send_signal(signal.SIGINT)
                sent = True
        process.wait()
        process.stdout.close()
        watchdog.cancel()
        self.assertTrue(sent, "".join(output[-30:]))
        # The whole frame would take far longer than the watchdog's patience.
        self.assertEqual(process.returncode, 1, "".join(output[-30:]))
        self.assertFalse(list(self.home.path.glob("out_*")))
        self.assertIn("cancelled", "".join(output))

    def test_while_rendering(self):
        for integrator in ("exhaustive", "illumination_cut", "light_slice"):
            with self.subTest(integrator=integrator):
                error = ", error=0" if integrator == "illumination_cut" else ""
                self.interrupt(r"\| render \d", settings=f"'{integrator}', 64, vpls=2000000{error}",
                               more="scene.render.resolution_x = scene.render.resolution_y = 1024")

    def test_while_tracing_light_paths(self):
        self.interrupt(r"light paths", settings="'lightcuts', vpls=50000000")


def blender_version():
    text = subprocess.run([BLENDER, "-b", "--version"], capture_output=True, text=True, errors="replace").stdout
    return tuple(map(int, re.search(r"Blender (\d+)\.(\d+)", text).groups()))


def older(archive, path):
    """The zip as of version 0.9.0."""
    with zipfile.ZipFile(archive) as source, zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as out:
        for name in source.namelist():
            content = source.read(name)
            if name.endswith("blender_manifest.toml"):
                content, count = re.subn(rb'^version = "[\d.]+"', b'version = "0.9.0"', content, flags=re.M)
                assert count == 1
            if name == "lumicut_blender/__init__.py":
                content, count = re.subn(rb'"version": \([\d, ]+\)', b'"version": (0, 9, 0)', content)
                assert count == 1
            out.writestr(name, content)
    return path


class TheZip(Blender):
    def setUp(self):
        self.home = Home(addon=False)
        self.addCleanup(self.home.folder.cleanup)
        self.archive = ZIP or next(iter(sorted(BUILD.glob("lumicut_blender-*.zip"))), None)
        if self.archive is None:
            self.skipTest(f"no zip in {BUILD}: build lumicut_blender_zip")

    def test_an_update_over_an_older_version_keeps_preferences(self):
        old = older(self.archive, self.home.path / "old.zip")
        first = ("import bpy, sys\nbpy.ops.preferences.addon_install(filepath={path!r}, overwrite=True)\n"
                 "bpy.ops.preferences.addon_enable(module='lumicut_blender')\n"
                 "print('version', sys.modules['lumicut_blender'].bl_info['version'])\n"
                 "p = bpy.context.preferences.addons['lumicut_blender'].preferences\n{then}")
        done = self.home.python(first.format(path=str(old), then="p.library_path = '/a/place'\nbpy.ops.wm.save_userpref()"), library=None)
        self.assertEqual(done.returncode, 0, done.stdout)
        self.assertIn("version (0, 9, 0)", done.stdout)
        script = self.home.path / "update.py"
        script.write_text(first.format(path=str(self.archive), then="assert p.library_path == '/a/place', p.library_path"))
        done = self.home.run("--python-exit-code", 7, "-P", script, library=None)  # with the user's preferences
        self.assertEqual(done.returncode, 0, done.stdout)
        self.assertNotIn("version (0, 9, 0)", done.stdout)

    def extension(self, *words):
        """`blender --command extension`, as this home's user."""
        return subprocess.run([BLENDER, "--command", "extension", *map(str, words)], env=self.home.environment(library=None), cwd=self.home.path, stdin=subprocess.DEVNULL,
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace", timeout=PATIENCE)

    def in_extension(self, code):
        script = self.home.path / "script.py"
        script.write_text("import bpy\nNAME = 'bl_ext.user_default.lumicut_blender'\n"
                          "p = bpy.context.preferences.addons[NAME].preferences\n" + code)
        done = self.home.run("--python-exit-code", 7, "-P", script, library=None)
        self.assertEqual(done.returncode, 0, done.stdout)

    def test_it_is_an_extension_that_validates_installs_renders_and_updates(self):
        if blender_version() < (4, 2):
            self.skipTest("extensions came with Blender 4.2")
        done = self.extension("validate", self.archive)
        self.assertEqual(done.returncode, 0, done.stdout)
        self.assertIn("Success", done.stdout)
        install = ("install-file", "-r", "user_default", "-e")
        done = self.extension(*install, older(self.archive, self.home.path / "old.zip"))
        self.assertIn("Installed", done.stdout)
        self.in_extension("p.library_path = '/a/place'\nbpy.ops.wm.save_userpref()\n")
        done = self.extension(*install, self.archive)
        self.assertIn("einstalled", done.stdout)
        image = self.home.path / "image.png"
        self.in_extension(f"""
assert p.library_path == '/a/place', p.library_path
import importlib, pathlib
runtime = importlib.import_module(NAME + '.runtime')
assert runtime.require().origin == 'bundled with the add-on', runtime.require().origin
manifest = pathlib.Path(runtime.__file__).with_name('blender_manifest.toml').read_text()
assert 'version = "0.9.0"' not in manifest
scene = bpy.context.scene
scene.render.engine = 'LUMICUT'
scene.render.resolution_x = scene.render.resolution_y = 32
scene.render.filepath = {str(image)!r}
bpy.ops.render.render(write_still=True)
""")
        self.assertTrue(image.exists())

    def test_the_documented_command_installs_it_word_for_word(self):
        text = (ROOT / "docs/blender.md").read_text()
        command = re.search(r"`(blender -b --python-expr \"import bpy; bpy\.ops\.preferences\.addon_install.*?)`", text)[1]
        words = shlex.split(command)
        self.assertEqual(words[0], "blender")
        name = re.search(r"lumicut_blender-[\d.]+\.zip", command)[0]
        shutil.copy(self.archive, self.home.path / name)
        env = {k: v for k, v in self.home.environment(library=None).items() if not k.startswith("BLENDER_USER")}
        done = subprocess.run([BLENDER, *words[1:]], env=env, cwd=self.home.path, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=PATIENCE)
        self.assertNotIn("Traceback", done.stdout)
        done = subprocess.run([BLENDER, "-b", "--python-exit-code", "7", "--python-expr", "from lumicut_blender import runtime\n"
                               "assert runtime.require().origin == 'bundled with the add-on'"], env=env, cwd=self.home.path,
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=PATIENCE)
        self.assertEqual(done.returncode, 0, done.stdout)

    def test_it_installs_renders_and_exports_without_a_window(self):
        archive = self.archive
        done = self.home.python(
            f"import bpy\nbpy.ops.preferences.addon_install(filepath={str(archive)!r})\n"
            "assert bpy.ops.preferences.addon_enable(module='lumicut_blender') == {'FINISHED'}\n"
            "from lumicut_blender import runtime\nassert runtime.require().origin == 'bundled with the add-on', runtime.failure()\n",
            library=None)
        self.assertEqual(done.returncode, 0, done.stdout)
        blend = make_room(self.home, library=None)
        done, image = farm(self.home, blend, library=None)
        self.assertEqual(done.returncode, 0, done.stdout)
        self.assertIsNotNone(image)
        out = self.home.path / "exported.json"
        done = self.home.run(blend, "--addons", "lumicut_blender", "--python-exit-code", 1, "--python-expr",
                             f"import bpy; bpy.ops.export_scene.lumicut(filepath={str(out)!r})", library=None)
        self.assertEqual(done.returncode, 0, done.stdout)
        self.assertTrue(out.exists())


TOOLS = ("xvfb-run", "import", "xdotool", "convert")
IMAGES = ROOT / "docs/images"


@unittest.skipUnless(all(map(shutil.which, TOOLS)), f"one of {', '.join(TOOLS)} is not installed: the interface is not tested")
class Interface(Blender):
    """Runs with a window, under Xvfb. Screenshots stay in the build's blender_screenshots; with LUMICUT_UPDATE_DOCS=1 they
    become those of the documentation."""

    def window(self, script, shots, size, *words):
        """What Blender printed in a window of that size, running the script."""
        shots.mkdir(parents=True, exist_ok=True)
        done = subprocess.run(["xvfb-run", "-a", "-s", f"-screen 0 {size[0]}x{size[1]}x24", BLENDER, *map(str, words), "--addons", "lumicut_blender",
                               "--window-geometry", "0", "0", *map(str, size), "--python", str(HERE / script)],
                              env=self.home.environment() | {"LUMICUT_UI_OUT": str(shots)}, cwd=self.home.path,
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace", timeout=PATIENCE)
        return done.stdout

    def test_every_panel_opens_and_its_screenshots_are_those_of_the_documentation(self):
        shots = BUILD / "blender_panels"
        shutil.rmtree(shots, ignore_errors=True)
        said = self.window("ui_panels.py", shots, (1920, 3300), "--factory-startup")
        self.assertTrue((shots / "panels.json").exists(), said[-3000:])
        result = json.loads((shots / "panels.json").read_text())
        self.assertTrue(result.get("ok"), result.get("failure"))
        self.assertNotIn("Traceback", said)  # a panel that fails to draw says so, and is empty
        self.assertEqual(result["width"], 333)  # as the factory has it on a screen of 1920: labels are measured for it

        def sheet(name, *tabs):
            """Screenshots side by side, without what is empty at their ends, in 160 colours."""
            path = shots / name
            columns = [word for tab in tabs for word in ("(", str(shots / f"panels_{tab}.png"), "-trim", "+repage", "-bordercolor", "#303030", "-border", "4", ")")]
            subprocess.run(["convert", "-background", "#303030", *columns, "-gravity", "north", "+append", "+dither", "-colors", "160",
                            "-strip", f"PNG8:{path}"], check=True)
            if os.environ.get("LUMICUT_UPDATE_DOCS"):
                shutil.copy(path, IMAGES / name)
            self.assertLess(path.stat().st_size, 150000)
            size = [subprocess.run(["identify", "-format", "%w %h", p], capture_output=True, text=True, check=True).stdout
                    for p in (path, IMAGES / name)]
            self.assertEqual(*size, f"{name} is not that of today's panels: run this with LUMICUT_UPDATE_DOCS=1")

        sheet("blender_panels.png", "render", "view_layer", "object")
        sheet("blender_panels_data.png", "material", "light", "camera")

    def test_engine_render_cancel_and_viewport(self):
        shots = BUILD / "blender_screenshots"
        shutil.rmtree(shots, ignore_errors=True)
        blend = self.home.path / "room.blend"
        done = self.home.run("--factory-startup", "--addons", "lumicut_blender", "--python-exit-code", 7, "-P",
                             ROOT / "export_scripts/scenes/blender_indirect_room.py", "--",
                             "--output", blend, "--detail", 0, "--width", 640, "--height", 480)
        self.assertEqual(done.returncode, 0, done.stdout)
        said = self.window("ui_script.py", shots, (1500, 1000), blend)
        self.assertTrue((shots / "result.json").exists(), said[-3000:])
        result = json.loads((shots / "result.json").read_text())
        sys.stderr.write(json.dumps(result, indent=1) + "\n")
        self.assertTrue(result.get("ok"), result.get("failure"))
        self.assertTrue(result["offered"])
        self.assertEqual((result["render"], result["cancel"]), ("complete", "cancel"))
        self.assertTrue(any("Shaders taken as diffuse" in note for note in result["notes"]))
        self.assertEqual(result["levels"], 3)
        # The interface's own timer went on while the worker rendered.
        self.assertGreater(result["ticks_while_rendering"], 5)
        self.assertTrue(result["setting_followed"])
        self.assertTrue(result["object_moved"])
        self.assertTrue(result["again"])
        for name in ("panels", "render", "rendering", "viewport", "viewport_turned"):
            self.assertGreater((shots / f"{name}.png").stat().st_size, 10000, name)
        if os.environ.get("LUMICUT_UPDATE_DOCS"):
            for name in ("render", "viewport"):
                subprocess.run(["convert", shots / f"{name}.png", "-resize", "1200x", "-strip", "-quality", "82", IMAGES / f"blender_{name}.jpg"], check=True)


if __name__ == "__main__":
    unittest.main(verbosity=2)
