"""How the add-on's exporter places its files, without Blender: its Writer is replaced."""
import ast
import json
import os
import pathlib
import shutil
import tempfile
import unittest

ROOT = pathlib.Path(os.environ.get("LUMICUT_SOURCE_DIR", pathlib.Path(__file__).resolve().parents[2]))
EXPORT = ROOT / "export_scripts/lumicut_blender/export.py"


class Failure(RuntimeError):
    pass


def exporter(files, fail=False):
    """write_scene of the add-on with a Writer that writes `files` {name: text}, and then fails or not."""
    function = next(node for node in ast.parse(EXPORT.read_text()).body
                    if isinstance(node, ast.FunctionDef) and node.name == "write_scene")

    class Writer:
        def __init__(self, folder, data, stem):
            self.folder = folder

        def scene(self, width, height, settings):
            for name, text in files.items():
                (self.folder / name).parent.mkdir(parents=True, exist_ok=True)
                (self.folder / name).write_text(text)
            if fail:
                raise Failure("the disk is full")
            return {"description": "", "materials": [{"diffuse_texture": "textures/a.png"}], "lights": [],
                    "meshes": [{"obj": name} for name in files if name.endswith(".obj")]}

    names = {"json": json, "os": os, "pathlib": pathlib, "shutil": shutil, "tempfile": tempfile, "Writer": Writer,
             "command_of": lambda *_: ["lumicut"], "ExportError": Failure}
    exec(compile(ast.Module([function], []), str(EXPORT), "exec"), names)  # as it stands in the add-on
    return lambda path: names["write_scene"](path, None, 1, 1, None)


class Export(unittest.TestCase):
    def setUp(self):
        temporary = tempfile.TemporaryDirectory()
        self.addCleanup(temporary.cleanup)
        self.folder = pathlib.Path(temporary.name)
        self.scene = self.folder / "room.json"
        self.files = self.folder / "room_files"

    def listed(self):
        return sorted(str(p.relative_to(self.folder)) for p in self.folder.rglob("*") if not p.is_dir())

    def meshes(self):
        """Text of the meshes that the scene file names."""
        return [(self.folder / mesh["obj"]).read_text() for mesh in json.loads(self.scene.read_text())["meshes"]]

    def export(self, text, fail=False, **more):
        exporter({"meshes/a.obj": text, "textures/a.png": text, **more}, fail)(self.scene)

    def test_an_export_writes_its_files_and_nothing_else(self):
        self.export("one")
        self.assertEqual(self.listed(), ["room.json", "room_files/.lumicut-export.json", "room_files/meshes/a.obj",
                                         "room_files/textures/a.png"])
        self.assertEqual(self.meshes(), ["one"])

    def test_files_of_others_stay_and_their_own_go(self):
        self.files.mkdir()
        (self.files / "thesis.txt").write_text("years of work")
        self.export("one")
        (self.files / "meshes/mine.obj").write_text("mine")
        for text in ("two", "three", "four"):
            self.export(text)
            self.assertEqual(self.meshes(), [text])
            self.assertEqual((self.files / "thesis.txt").read_text(), "years of work")
            self.assertEqual((self.files / "meshes/mine.obj").read_text(), "mine")
            # The scene, the manifest, two files; two that are another's.
            self.assertEqual(len(self.listed()), 6, self.listed())

    def test_a_file_of_another_with_a_name_of_ours_is_not_overwritten(self):
        (self.files / "meshes").mkdir(parents=True)
        (self.files / "meshes/a.obj").write_text("mine")
        self.export("one")
        self.assertEqual((self.files / "meshes/a.obj").read_text(), "mine")
        self.assertEqual(self.meshes(), ["one"])

    def test_a_file_that_was_changed_since_stays(self):
        self.export("one")
        (self.files / "textures/a.png").write_text("painted over")
        self.export("two")
        self.assertEqual((self.files / "textures/a.png").read_text(), "painted over")
        self.assertFalse((self.files / "meshes").exists())

    def test_a_failed_export_leaves_the_earlier_whole(self):
        self.export("one")
        before = self.listed()
        with self.assertRaises(Failure):
            self.export("two", fail=True)
        self.assertEqual(self.listed(), before)
        self.assertEqual(self.meshes(), ["one"])
        self.scene.unlink()
        self.scene.mkdir()  # nothing can take its place
        with self.assertRaises(Failure):
            self.export("two")
        self.assertEqual(self.listed(), before[1:])

    def test_a_failed_first_export_leaves_nothing(self):
        with self.assertRaises(Failure):
            self.export("one", fail=True)
        self.assertEqual(list(self.folder.iterdir()), [])

    def test_what_a_killed_export_left_is_removed(self):
        (self.files / ".lumicut-abc.part/content").mkdir(parents=True)
        (self.files / ".lumicut-abc.part/content/a.obj").write_text("half")
        self.export("one")
        self.assertFalse((self.files / ".lumicut-abc.part").exists())

    def test_a_manifest_reaches_no_file_outside(self):
        victim = self.folder / "victim"
        victim.write_text("precious")
        self.files.mkdir()
        stamp = [victim.stat().st_size, victim.stat().st_mtime_ns]
        link = self.files / "link"
        link.symlink_to(self.folder)
        for names in (["../victim"], [str(victim)], ["link/victim"]):
            (self.files / ".lumicut-export.json").write_text(json.dumps({"files": {name: stamp for name in names}}))
            self.export("one")
            self.assertEqual(victim.read_text(), "precious")
        for text in ("[" * 100000, "{}", "[]", "{\"files\": 3}", "\xff"):
            (self.files / ".lumicut-export.json").write_text(text)
            self.export("one")
            self.assertEqual(self.meshes(), ["one"])

    def test_links_and_modes_stay(self):
        (self.folder / "else").mkdir()
        there = self.folder / "else/room.json"
        there.write_text("{}")
        there.chmod(0o600)
        self.scene.symlink_to("else/room.json")
        self.export("one")
        self.assertTrue(self.scene.is_symlink())
        self.assertEqual(there.stat().st_mode & 0o777, 0o600)
        self.assertEqual(self.meshes(), ["one"])


if __name__ == "__main__":
    unittest.main()
