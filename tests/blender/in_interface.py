"""The interface without a window: labels, presets, what files of older versions mean, what a note's name selects."""
import pathlib
import re
import tempfile
import types
import unittest

import addon_utils
import bpy

import helpers as h
from lumicut_blender import compat, data_panels, migration, operators, panels, passes, properties, report, runtime

ENGINE = panels.ENGINE


class Recorder:
    """Stands for a layout, and keeps what is put into it: [(kind, text shown, tooltip)]."""

    def __init__(self, rows=None):
        self.__dict__["rows"] = [] if rows is None else rows
        self.__dict__["enabled"] = True

    def __setattr__(self, name, value):
        if name == "enabled":
            self.__dict__[name] = value

    def _nested(self, *_, heading="", **__):
        if heading:
            self.rows.append(("heading", heading, None))
        return Recorder(self.rows)

    column = row = split = box = grid_flow = _nested

    def prop(self, owner, name, text=None, **_):
        found = owner.bl_rna.properties[name]  # a KeyError is a panel that asks for what is not there
        kind = "toggle" if found.type == "BOOLEAN" else "prop"
        self.rows.append((kind, found.name if text is None else text, found.description))
        if found.type == "ENUM" and owner.bl_rna.identifier.startswith("Lumicut"):
            self.rows += [("value" if text != "" else "wide value", item.name, item.description) for item in found.enum_items]

    def prop_search(self, owner, name, *_, text=None, **__):
        self.prop(owner, name, text)

    def label(self, text="", **_):
        self.rows.append(("label", text, None))

    def operator(self, name, text=None, **_):
        module, function = name.split(".")
        kind = getattr(getattr(bpy.ops, module), function).get_rna_type()
        self.rows.append(("name" if name == "lumicut.select_named" else "operator", kind.name if text is None else text, kind.description))
        return types.SimpleNamespace()

    def separator(self, *_, **__):
        pass

    menu = popover = template_list = template_node_view = separator


def context(**more):
    scene = bpy.context.scene
    values = {"scene": scene, "view_layer": bpy.context.view_layer, "engine": ENGINE, "region": None, "object": None, "material": None,
              "world": scene.world, "light": None, "camera": scene.camera.data if scene.camera else None}
    return types.SimpleNamespace(**values | more)


def own_panels():
    """Classes with what draws their headers and bodies; but for the popover of presets, which Blender's code draws."""
    for cls in (*panels.CLASSES, *data_panels.CLASSES):
        if cls is not panels.LUMICUT_PT_sampling_presets:
            functions = [next((vars(c)[name] for c in cls.__mro__ if isinstance(vars(c).get(name), types.FunctionType)), None)
                         for name in ("draw_header", "draw")]
            yield cls, [function for function in functions if function is not None]


def drawn(**more):
    """{panel: rows of a Recorder} of all panels that show in such a context."""
    found = {}
    where = context(**more)
    for cls, functions in own_panels():
        if not cls.poll(where):
            continue
        recorder = Recorder()
        values = {name: getattr(cls, name, None) for name in ("bl_label", "owner", "suffix", "severities", "hint", "rays")}
        for function in functions:
            function(types.SimpleNamespace(layout=recorder, **values), where)
        found[cls.__name__] = recorder.rows
    return found


def wide_contexts():
    """Contexts that together show every panel with all that it may hold."""
    scene = bpy.context.scene
    h.add_plane(material=h.diffuse())
    plane, settings = bpy.data.objects["Plane"], scene.lumicut
    yield {"object": plane, "material": plane.data.materials[0]}
    for kind in ("POINT", "SPOT", "SUN", "AREA"):
        lamp = h.add_light(kind)
        lamp.data.use_nodes = True
        yield {"object": lamp, "light": lamp.data}
    lamp.data.shape = "RECTANGLE"
    yield {"light": lamp.data}
    for row in properties.tables.integrators:
        settings.integrator = row.id
        yield {}
    settings.integrator, settings.use_threshold, settings.use_viewport_threshold = "lightcuts", True, True
    settings.common.compensate, settings.passes = True, 1
    yield {}
    made = report.Report()
    for name, text in (("Plane", "Volumes left out"), ("Diffuse (Toon)", "Shaders taken as diffuse"), ("Diffuse", "Colours above 1 cut to 1")):
        made.note(name, text)
    runtime.remember(made)
    runtime.last.update(stats={"phases": {"light tree": 1.0}}, scene={"triangles": 2, "instances": 1, "lamps": 1})
    yield {}


# Points of text that the factory's Properties editor has room for in a window 1500 pixels wide (260 of them; 333 of 1920),
# measured there: beside a value in a panel inside another, on a checkbox, on a button or a line of its own, of a menu
# beside its label, in the title of a panel inside another. Sentences are wrapped to the region, here to 230.
LABEL, CHECKBOX, LINE, VALUE, TITLE, SENTENCE = 67, 92, 160, 80, 125, 235
BLENDERS = {"Child Particles"}  # Blender's own panels cut this off too


class Layout(unittest.TestCase):
    def setUp(self):
        h.new_scene()
        self.saved = dict(runtime.last)

    def tearDown(self):
        runtime.last.update(self.saved)

    def rows(self):
        for more in wide_contexts():
            for name, rows in drawn(**more).items():
                yield from ((name, *row) for row in rows)

    def test_every_panel_draws_and_every_property_is_there(self):
        shown = set()
        for more in wide_contexts():
            shown |= set(drawn(**more))
        self.assertEqual(shown, {cls.__name__ for cls, _ in own_panels()})

    def test_no_label_is_cut_off_at_the_default_width(self):
        import blf
        rows = list(self.rows())
        blf.size(0, 11)  # after the panels, which measure too
        room = {"prop": LABEL, "toggle": CHECKBOX, "heading": LABEL, "value": VALUE, "label": SENTENCE}
        wide = {(name, kind, text, blf.dimensions(0, text)[0]) for name, kind, text, _ in rows
                if blf.dimensions(0, text)[0] > room.get(kind, LINE) and text not in BLENDERS}
        self.assertFalse(wide)
        for cls, _ in own_panels():
            self.assertLessEqual(blf.dimensions(0, cls.bl_label)[0], TITLE, cls)

    def test_labels_are_in_title_case(self):
        self.assertFalse({(name, text) for name, kind, text, _ in self.rows()
                          if kind not in {"label", "name"} and text != properties.title_case(text)})  # those are sentences
        for cls, _ in own_panels():
            self.assertEqual(cls.bl_label, properties.title_case(cls.bl_label))

    def test_tooltips_say_more_than_the_label(self):
        for group, owner in migration.groups_of(bpy.context.scene.lumicut):
            for key, prop in owner.bl_rna.properties.items():
                if key not in {"rna_type", "name"} and prop.type != "POINTER":
                    self.assertGreater(len(prop.description), len(prop.name) + 5, f"{group}.{key}: {prop.description!r}")
                    self.assertNotEqual(prop.description[-1], ".")  # Blender adds it

    def test_every_parameter_of_every_integrator_has_a_place(self):
        settings = bpy.context.scene.lumicut
        places = {None, *(cls for cls in ("advanced", "bounces", "clamping", "caustics"))}
        self.assertEqual({place for place, _ in panels.PLACES.values()} | {None}, places)
        for row in properties.tables.integrators:
            settings.integrator = row.id
            shown = [text for rows in drawn().values() for kind, text, _ in rows if kind in {"prop", "toggle"}]
            for p in row.parameters:
                label = panels.PLACES.get(p["id"], (None, panels.LABELS.get(p["id"])))[1] or properties.title_case(p["label"])
                self.assertIn(label, shown, (row.id, p["id"]))

    def test_one_panel_for_light_one_for_depth_of_field_and_none_for_what_is_left_out(self):
        there = [p for p in bpy.types.Panel.__subclasses__() if ENGINE in getattr(p, "COMPAT_ENGINES", ()) and p.is_registered]
        lamps = [p.__name__ for p in there if p.bl_label in {"Light", "Area Shape", "Spot Shape", "Beam Shape"}]
        self.assertEqual(sorted(lamps), ["LUMICUT_PT_beam_shape", "LUMICUT_PT_light"])
        labels = [p.bl_label for p in there if getattr(p, "bl_context", "") in {"data", "render", "object", "view_layer", "world", "material"}]
        self.assertEqual(labels.count("Depth of Field"), 1)
        for label in ("Freestyle", "Grease Pencil", "Falloff Curve", "Probe", "Motion Blur", "Bloom"):
            self.assertNotIn(label, labels)
        self.assertEqual(labels.count("Visibility"), 1)


class Presets(unittest.TestCase):
    def fresh(self):
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        addon_utils.enable("lumicut_blender")
        return bpy.context.scene.lumicut

    def test_a_scene_that_nobody_touched_renders_with_good(self):
        settings = self.fresh()
        self.assertFalse(migration.touched(settings))
        self.assertEqual(properties.active_preset(settings), "good")
        default = properties.parameters_of(settings)
        bpy.ops.lumicut.preset(preset="good")
        self.assertEqual(properties.parameters_of(settings), default)

    def test_the_active_preset_is_shown_and_none_once_something_differs(self):
        settings = self.fresh()
        for name in properties.tables.presets:
            bpy.ops.lumicut.preset(preset=name)
            self.assertEqual(properties.active_preset(settings), name)
        settings.common.seed = 7  # another picture of the same kind
        self.assertEqual(properties.active_preset(settings), "reference")
        settings.passes += 1
        self.assertIsNone(properties.active_preset(settings))

    def test_a_preset_of_the_users_is_kept_and_comes_back(self):
        settings = self.fresh()
        settings.integrator, settings.passes, settings.lightcuts.error, settings.common.vpls = "lightcuts", 5, 0.125, 777
        self.assertEqual(bpy.ops.lumicut.sampling_preset_add(name="Mine"), {"FINISHED"})
        path = pathlib.Path(bpy.utils.user_resource("SCRIPTS", path="presets/" + operators.PRESETS_FOLDER)) / "Mine.py"
        self.addCleanup(path.unlink, missing_ok=True)
        bpy.ops.lumicut.preset(preset="draft")
        self.assertEqual(bpy.ops.script.execute_preset(filepath=str(path), menu_idname="LUMICUT_PT_sampling_presets"), {"FINISHED"})
        self.assertEqual((settings.integrator, settings.passes, settings.lightcuts.error, settings.common.vpls), ("lightcuts", 5, 0.125, 777))
        self.assertEqual(bpy.ops.lumicut.sampling_preset_add(name="Mine", remove_name=True), {"FINISHED"})
        self.assertFalse(path.exists())


class OldFiles(unittest.TestCase):
    """Files of the version before settings had one, and defaults that were other ones."""

    def reopened(self, change, version=0):
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        addon_utils.enable("lumicut_blender")
        scene = bpy.context.scene
        scene.render.engine = ENGINE
        change(scene.lumicut)
        handlers = bpy.app.handlers.save_pre[:]
        bpy.app.handlers.save_pre.clear()
        if version == 0:
            scene.lumicut.property_unset("version")
        with tempfile.TemporaryDirectory() as folder:
            path = folder + "/old.blend"
            bpy.ops.wm.save_as_mainfile(filepath=path)
            bpy.app.handlers.save_pre.extend(handlers)
            bpy.ops.wm.open_mainfile(filepath=path)
        return bpy.context.scene.lumicut

    def test_what_was_set_stays_and_what_was_not_is_as_it_was(self):
        def change(settings):
            settings.integrator = "lightcuts"
            settings.max_shininess = 150

        settings = self.reopened(change)
        self.assertEqual((settings.integrator, settings.max_shininess), ("lightcuts", 150))
        self.assertEqual((settings.samples, settings.passes, settings.common.vpls, settings.common.compensate), (4, 1, 60000, False))
        self.assertAlmostEqual(settings.lightcuts.error, 0.02)

    def test_presets_of_then_mean_the_same(self):
        def good_of_then(settings):  # it set these, and unset the rest
            settings.samples, settings.passes, settings.integrator = 1, 16, "lightcuts"
            settings.common.vpls, settings.common.compensate, settings.lightcuts.error = 3000, True, 0.05

        # Good has importance since; a file of then renders as it did.
        settings = self.reopened(good_of_then)
        self.assertIsNone(properties.active_preset(settings))
        self.assertEqual((settings.samples, settings.passes, settings.common.vpls, settings.common.importance), (1, 16, 3000, False))

        def draft_of_then(settings):
            settings.samples, settings.integrator = 1, "illumination_cut"
            settings.common.vpls, settings.illumination_cut.error = 10000, 0.05

        self.assertEqual(properties.active_preset(self.reopened(draft_of_then)), "draft")

    def test_scenes_that_nobody_touched_get_good(self):
        self.assertEqual(properties.active_preset(self.reopened(lambda settings: None)), "good")

    def test_files_of_today_mean_what_they_say(self):
        def change(settings):
            settings.passes = 9

        settings = self.reopened(change, version=1)
        self.assertEqual((settings.passes, settings.samples, settings.common.vpls), (9, 1, 3000))

    def test_new_scenes_in_an_open_file_are_new(self):
        self.reopened(lambda settings: setattr(settings, "passes", 3))
        settings = bpy.data.scenes.new("Another").lumicut
        settings.passes = 5
        migration._before_use()
        self.assertEqual((settings.passes, settings.samples, settings.common.vpls), (5, 1, 3000))


class Notes(unittest.TestCase):
    def setUp(self):
        h.new_scene()

    def test_they_are_sorted_by_what_they_do_to_the_picture(self):
        made = report.Report()
        made.note("Car", "Clearcoats (GTR1) as GGX of the same median width")
        made.note("Cloth (Velvet)", "Shaders taken as diffuse")
        made.note("Smoke", "Volumes left out")
        self.assertEqual([severity for severity, _, _ in made.entries()], [report.WRONG, report.APPROXIMATED, report.NUANCE])
        self.assertTrue(made.lines()[0].startswith("Volumes left out"))

    def test_every_text_of_the_sources_has_a_severity_that_was_chosen(self):
        texts = set()
        for path in sorted(pathlib.Path(panels.__file__).parent.glob("*.py")):
            texts |= set(re.findall(r'note\((?:[^()"]|\([^()]*\)|"[^"]*")*?, f?"([A-Z][^"]+)"', path.read_text()))
        self.assertGreater(len(texts), 60)
        wrong = {text for text in texts if report.severity_of(text) == report.WRONG}
        self.assertGreater(len(wrong), 15)
        for text in texts:
            if "left out" in text:
                self.assertEqual(report.severity_of(text), report.WRONG, text)

    def test_a_name_selects_the_objects_that_it_stands_for(self):
        material, image = h.diffuse(name="Oak (old)"), bpy.data.images.new("grain.png", 4, 4)
        first, second = h.add_plane(material=material, name="Table"), h.add_sphere(material=material, name="Bowl: small")
        node = material.node_tree.nodes.new("ShaderNodeTexImage")
        node.image = image
        lamp = h.add_light("POINT")
        for name, expected in (("Table", {first}), ("Bowl: small", {second}), ("Bowl: small: hair", {second}),
                               ("Oak (old) (Toon BSDF)", {first, second}), ("grain.png", {first, second}), ("POINT", {lamp})):
            self.assertEqual(bpy.ops.lumicut.select_named(name=name), {"FINISHED"}, name)
            self.assertEqual(set(bpy.context.selected_objects), expected, name)
            self.assertIn(bpy.context.view_layer.objects.active, expected)
        self.assertEqual(bpy.ops.lumicut.select_named(name="nobody"), {"CANCELLED"})

    def test_the_last_render_tells_them_in_parts(self):
        toon = h.material("Toon")
        h.shader(toon, "ShaderNodeBsdfToon")
        h.add_plane(material=toon)
        h.add_light("POINT")
        with h.quiet():
            h.set_lumicut(vpls=100)
            h.render()
        self.assertIn((report.APPROXIMATED, "Shaders taken as diffuse", ["Toon (Toon BSDF)"]), runtime.last["entries"])


class OtherVersions(unittest.TestCase):
    """What Blender 5 has otherwise, by stand-ins that have what its release notes say."""

    def test_nodes_without_a_switch_are_followed(self):
        tree = object()
        self.assertTrue(compat.has_nodes(types.SimpleNamespace(node_tree=tree)))
        self.assertFalse(compat.has_nodes(types.SimpleNamespace(node_tree=tree, use_nodes=False)))
        self.assertFalse(compat.has_nodes(types.SimpleNamespace(node_tree=None, use_nodes=True)))

    def test_the_compositor_is_a_group_of_its_own(self):
        class Thing:
            def __init__(self, kind="", **more):
                self.type, self.mute, self.inputs, self.outputs = kind, False, [], []
                self.__dict__.update(more)

        layers = Thing("R_LAYERS", scene=None, layer="ViewLayer")
        output = Thing("GROUP_OUTPUT")
        link = types.SimpleNamespace(from_node=layers, from_socket=types.SimpleNamespace(name="Emission"))
        output.inputs = [types.SimpleNamespace(links=[link])]
        group = types.SimpleNamespace(nodes=[layers, output])
        scene = Thing(compositing_node_group=group, render=types.SimpleNamespace(use_compositing=True))
        self.assertIs(compat.compositor_tree(scene), group)
        self.assertEqual(passes.of_compositor(scene, "ViewLayer"), {"Emission"})
        scene.compositing_node_group = None
        self.assertEqual(passes.of_compositor(scene, "ViewLayer"), set())

    def test_the_image_goes_into_the_groups_output(self):
        output = types.SimpleNamespace(type="GROUP_OUTPUT", inputs={})
        made = []

        class Interface:
            def new_socket(self, name, in_out, socket_type):
                made.append((name, in_out, socket_type))
                output.inputs[name] = "the socket"

        tree = types.SimpleNamespace(nodes=[output], interface=Interface())
        self.assertEqual(compat.compositor_image_input(tree), "the socket")
        self.assertEqual(compat.compositor_image_input(tree), "the socket")
        self.assertEqual(made, [("Image", "OUTPUT", "NodeSocketColor")])

    def test_nothing_asks_for_what_is_gone(self):
        for path in sorted(pathlib.Path(panels.__file__).parent.glob("*.py")):
            found = re.findall(r"\bbgl\b|\.bindcode|node_tree\.(?:inputs|outputs)|EEVEE_NEXT|(?:scene|layer)\.\w+\[\"|scene\.node_tree", path.read_text())
            self.assertEqual(found, ["scene.node_tree"] * 2 if path.name == "compat.py" else [], path.name)
