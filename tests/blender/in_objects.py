"""Objects and view layers beside Cycles: edit mode, flat scales, volumes alone, colours as shaders, overrides, filters."""
import unittest

import bpy
import numpy as np

import helpers as h

CUBE = ([(x, y, z) for z in (-1, 1) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))],
        [(3, 2, 1, 0), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)])


class BesideCycles(unittest.TestCase):
    def setUp(self):
        self.scene = h.new_scene(32, 32)
        self.scene.view_layers[0].use_pass_z = True
        h.add_light("SUN", energy=3, rotation=(0.4, 0.3, 0), angle=0.0)

    def compare(self, most=0.01, cycles=16, samples=16, layer=None, bounces=0, **parameters):
        """Images agree in means of 4x4 pixels; gives ours and the notes."""
        ours, theirs = h.both(cycles, samples, bounces, layer, **parameters)
        a, b = (h.blocks(image["Combined"]) for image in (ours, theirs))
        np.testing.assert_allclose(a.mean((0, 1)), b.mean((0, 1)), rtol=most, atol=1e-3)
        self.assertLess(np.abs(a - b).max(), 0.06)  # at outlines 16 samples tell coverage to a few per cent
        return ours, "\n".join(h.last_notes())


class Bumps(BesideCycles):
    def test_steps_of_a_height_are_as_wide_as_in_cycles(self):
        """Bricks under a low sun: their edges are lit, or dark, over a pixel."""
        m = bpy.data.materials.new("bricks")
        m.use_nodes = True
        nodes, links = m.node_tree.nodes, m.node_tree.links
        shader = h.shader(m, "ShaderNodeBsdfDiffuse", Color=(0.8, 0.8, 0.8, 1))
        bump, brick = nodes.new("ShaderNodeBump"), nodes.new("ShaderNodeTexBrick")
        bump.inputs["Distance"].default_value, brick.inputs["Scale"].default_value = 0.3, 3
        links.new(brick.outputs["Fac"], bump.inputs["Height"])
        links.new(bump.outputs[0], shader.inputs["Normal"])
        h.add_plane(4, material=m)
        bpy.data.objects["SUN"].rotation_euler = (1.0, 0, 0.5)
        ours, theirs = h.both(64, 64, 0)
        mean = [image["Combined"][..., :3].mean() for image in (ours, theirs)]
        # Steps of a two-thousandth of the distance: 1.16. What is left is how each places them.
        self.assertAlmostEqual(mean[0] / mean[1], 1, delta=0.04)


class Objects(BesideCycles):
    def test_objects_in_edit_mode_render_with_their_modifiers(self):
        cube = h.add_mesh("Cube", *CUBE, h.diffuse((0.8, 0.3, 0.1)))
        cube.data.materials.append(h.diffuse((0.1, 0.3, 0.8), "blue"))
        cube.data.polygons[1].material_index = 1
        other = h.link(bpy.data.objects.new("other", cube.data))
        other.location, other.scale = (2, 0, 0), (0.3, 0.3, 0.3)
        subdivision = cube.modifiers.new("subdivision", "SUBSURF")
        subdivision.levels = subdivision.render_levels = 1
        bpy.context.view_layer.objects.active = cube
        cube.select_set(True)
        bpy.ops.object.mode_set(mode="EDIT")
        try:
            ours, _ = self.compare()
        finally:
            bpy.ops.object.mode_set(mode="OBJECT")
        self.assertGreater((ours["Depth"] < 100).mean(), 0.1)
        with h.quiet():
            again = h.render()
        np.testing.assert_array_equal(again["Combined"], ours["Combined"])

    def test_what_is_scaled_flat_renders(self):
        plane = h.add_plane(3, material=h.diffuse())
        plane.scale, plane.rotation_euler = (1, 1, 0), (0.5, 0.2, 0.1)
        _, notes = self.compare()
        self.assertNotIn("left out", notes)

    def test_flat_instances_render_as_meshes_of_their_own_do(self):
        """Without Cycles: its Embree ends Debian's Blender over an instance that has no inverse, and balls without
        thickness are black there where their halves shadow each other."""
        ball = h.add_sphere(0.7, (-1, -1, 1.5), h.diffuse((0.8, 0.2, 0.1)))
        others = [h.link(bpy.data.objects.new("other", ball.data)) for _ in range(3)]
        for x, other in enumerate(others):
            other.location, other.rotation_euler = (x - 0.5, 1, 1.5), (0, 0.9, 0)
            other.scale = ((0.5, 0.5, 0.5), (0, 0.5, 0.5), (-0.5, 0.5, 0))[x]
        with h.quiet():
            h.set_lumicut("exhaustive", 16, vpls=400, max_depth=0)
            shared = h.radiance(h.render())
            self.assertEqual(h.last_stats()["scene"]["instances"], 4)
            for other in others:
                other.data = other.data.copy()
            own = h.radiance(h.render())
        np.testing.assert_allclose(shared, own, atol=1e-3)

    def test_a_volume_alone_is_not_there_and_named(self):
        h.add_plane(3, material=h.diffuse())
        m = h.material("Haze")
        volume = m.node_tree.nodes.new("ShaderNodeVolumePrincipled")
        volume.inputs["Density"].default_value = 1e-6
        output = next(n for n in m.node_tree.nodes if n.type == "OUTPUT_MATERIAL")
        m.node_tree.links.new(volume.outputs[0], output.inputs["Volume"])
        box = h.add_mesh("Box", *CUBE, m)
        box.data.materials.append(h.diffuse((0.8, 0.2, 0.1), "red"))
        self.compare()
        self.assertEqual(h.last_stats()["scene"]["meshes"], 1)
        box.data.polygons[0].material_index = 1  # now one side of it is there
        _, notes = self.compare()
        self.assertEqual(h.last_stats()["scene"]["meshes"], 2)
        self.assertIn("Volumes left out: Haze", notes)

    def test_colours_in_place_of_shaders_shine(self):
        m = h.material("Colour")
        colour = m.node_tree.nodes.new("ShaderNodeRGB")
        colour.outputs[0].default_value = (0.7, 0.4, 0.1, 1)
        mix, diffuse = (m.node_tree.nodes.new("ShaderNode" + kind) for kind in ("MixShader", "BsdfDiffuse"))
        output = next(n for n in m.node_tree.nodes if n.type == "OUTPUT_MATERIAL")
        m.node_tree.links.new(colour.outputs[0], output.inputs["Surface"])
        h.add_plane(3, material=m)
        self.compare()
        m.node_tree.links.new(colour.outputs[0], mix.inputs[1])
        m.node_tree.links.new(diffuse.outputs[0], mix.inputs[2])
        m.node_tree.links.new(mix.outputs[0], output.inputs["Surface"])
        _, notes = self.compare()
        self.assertEqual(notes, "")

    def test_without_use_nodes_colours_are_those_of_the_viewport(self):
        m = h.emission(20)
        m.use_nodes, m.diffuse_color = False, (0.7, 0.4, 0.1, 1)
        h.add_plane(3, material=m)
        self.scene.world.use_nodes, self.scene.world.color = False, (0.1, 0.2, 0.3)
        lamp = next(ob for ob in self.scene.objects if ob.type == "LIGHT").data
        lamp.use_nodes = True
        next(n for n in lamp.node_tree.nodes if n.type == "EMISSION").inputs["Strength"].default_value = 7
        lamp.use_nodes = False
        self.compare(cycles=256)


class Rays(BesideCycles):
    """A sphere over a floor: what each kind of ray sees. Without a world, whose light Cycles brings by shadow and diffuse rays in
    turn, so that a mesh that one kind alone sees darkens it by half."""

    def setUp(self):
        super().setUp()
        h.add_plane(3, material=h.diffuse())
        self.ball = h.add_sphere(0.6, (0.3, 0, 1), h.diffuse((0.8, 0.2, 0.1), "red"))

    def light_path(self, name, first, second, ray):
        """A material that is `second` where the ray is such a one."""
        m = h.material(name)
        nodes, links = m.node_tree.nodes, m.node_tree.links
        path, mix = nodes.new("ShaderNodeLightPath"), nodes.new("ShaderNodeMixShader")
        output = next(n for n in nodes if n.type == "OUTPUT_MATERIAL")
        for i, (kind, colour) in enumerate((first, second)):
            shader = nodes.new("ShaderNode" + kind)
            shader.inputs["Color"].default_value = (*colour, 1)
            links.new(shader.outputs[0], mix.inputs[1 + i])
        links.new(path.outputs[ray], mix.inputs[0])
        links.new(mix.outputs[0], output.inputs["Surface"])
        return m

    def test_visibility_of_objects(self):
        for rays in (("camera",), ("shadow",), ("diffuse", "shadow"), ("camera", "diffuse")):
            with self.subTest(hidden=rays):
                for ray in ("camera", "diffuse", "glossy", "transmission", "shadow"):
                    setattr(self.ball, "visible_" + ray, ray not in rays)
                _, notes = self.compare(0.015, cycles=256)
                self.assertEqual(notes, "")

    def test_indirect_only_collections(self):
        group = bpy.data.collections.new("Group")
        self.scene.collection.children.link(group)
        group.objects.link(self.ball)
        self.scene.collection.objects.unlink(self.ball)
        self.scene.view_layers[0].layer_collection.children["Group"].indirect_only = True
        ours, notes = self.compare(0.015, cycles=256)
        self.assertEqual(notes, "")
        self.assertGreater(ours["Depth"].min(), 2.5)

    def test_a_mirror_shows_what_glossy_rays_see(self):
        self.ball.data.materials[0] = h.diffuse((0.2, 0.8, 0.3), "green")
        mirror = h.material("mirror")
        h.shader(mirror, "ShaderNodeBsdfGlossy", Roughness=0.0, Color=(0.9, 0.9, 0.9, 1))
        self.scene.objects["Plane"].data.materials[0] = mirror
        for hidden in (False, True):
            with self.subTest(hidden=hidden):
                self.ball.visible_glossy = not hidden
                self.compare(0.03, cycles=400, bounces=3, vpls=4000, samples=4)

    def test_light_path_parts_a_material_by_the_ray(self):
        for name, first, second, ray in (
                ("seen", ("BsdfDiffuse", (0.1, 0.1, 0.8)), ("Emission", (0.9, 0.3, 0.1)), "Is Camera Ray"),
                ("no shadow", ("BsdfDiffuse", (0.8, 0.2, 0.1)), ("BsdfTransparent", (1, 1, 1)), "Is Shadow Ray"),
                ("bounce", ("BsdfDiffuse", (0.8, 0.2, 0.1)), ("BsdfDiffuse", (0.1, 0.2, 0.8)), "Is Diffuse Ray"),
                ("shines unseen", ("Emission", (3, 2, 1)), ("BsdfTransparent", (1, 1, 1)), "Is Camera Ray"),
                ("depth", ("BsdfDiffuse", (0.8, 0.2, 0.1)), ("BsdfDiffuse", (0.1, 0.2, 0.8)), "Ray Depth")):
            with self.subTest(material=name):
                self.ball.data.materials[0] = self.light_path(name, first, second, ray)
                _, notes = self.compare(0.03, cycles=400, bounces=2, vpls=4000, samples=4)
                self.assertEqual(notes, "")

    def test_holdouts_are_holes_to_the_camera(self):
        """Black, and clear on any film; their shadows stay, and mirrors show them."""
        mirror = h.material("mirror")
        h.shader(mirror, "ShaderNodeBsdfGlossy", Roughness=0.0, Color=(0.9, 0.9, 0.9, 1))
        for floor, shader, clear in ((h.diffuse(), False, True), (mirror, False, True), (h.diffuse(), True, True), (h.diffuse(), True, False)):
            with self.subTest(floor=floor.name, shader=shader, clear=clear):
                self.scene.render.film_transparent = clear
                self.scene.objects["Plane"].data.materials[0] = floor
                self.ball.is_holdout = not shader
                if shader:
                    self.ball.data.materials[0] = h.material("Hole")
                    h.shader(self.ball.data.materials[0], "ShaderNodeHoldout")
                ours, notes = self.compare(0.03, cycles=400, bounces=2, vpls=4000, samples=16)
                self.assertNotIn("oldout", notes)
                self.assertLess(ours["Combined"][..., 3].min(), 0.01)

    def test_what_no_kind_of_ray_tells_is_named(self):
        self.ball.data.materials[0] = self.light_path(
            "far", ("BsdfDiffuse", (0.8, 0.2, 0.1)), ("BsdfDiffuse", (0.1, 0.2, 0.8)), "Ray Length")
        with h.quiet():
            h.set_lumicut("exhaustive", vpls=50)
            h.render()
        self.assertIn("Numbers of a ray's path taken as 0: far (Light Path: Ray Length)", "\n".join(h.last_notes()))


class Absorption(BesideCycles):
    def test_glass_takes_the_light_of_the_way_through_it(self):
        """A slab over an emissive floor, seen through both borders."""
        h.add_plane(3, material=h.emission(1, (1, 1, 1)))
        for kind, inputs in (("VolumeAbsorption", {"Density": 1.5, "Color": (0.9, 0.5, 0.2, 1)}),
                             ("VolumePrincipled", {"Density": 2.0, "Color": (0, 0, 0, 1), "Absorption Color": (0.5, 0.2, 0.1, 1)})):
            with self.subTest(volume=kind):
                m = h.material(kind)
                h.shader(m, "ShaderNodeBsdfGlass", Roughness=0.0, IOR=1.3)
                volume = m.node_tree.nodes.new("ShaderNode" + kind)
                for name, value in inputs.items():
                    volume.inputs[name].default_value = value
                output = next(n for n in m.node_tree.nodes if n.type == "OUTPUT_MATERIAL")
                m.node_tree.links.new(volume.outputs[0], output.inputs["Volume"])
                slab = h.add_mesh("Slab", *CUBE, m)
                slab.location, slab.scale = (0, 0, 1), (2, 2, 0.3)
                _, notes = self.compare(0.02, cycles=400, samples=64, bounces=8)
                self.assertNotIn("olumes", notes)
                bpy.data.objects.remove(slab)

    def test_below_a_single_sheet_is_water(self):
        """Which absorbs, so that no light goes straight through its surface: shadow rays know no depth."""
        h.add_plane(3, material=h.emission(1, (1, 1, 1)))
        m = h.material("Water")
        h.shader(m, "ShaderNodeBsdfGlass", Roughness=0.0, IOR=1.3)
        volume = m.node_tree.nodes.new("ShaderNodeVolumeAbsorption")
        volume.inputs["Density"].default_value, volume.inputs["Color"].default_value = 1.5, (0.9, 0.5, 0.2, 1)
        m.node_tree.links.new(volume.outputs[0], next(n for n in m.node_tree.nodes if n.type == "OUTPUT_MATERIAL").inputs["Volume"])
        h.add_plane(3, 0.4, m)
        _, notes = self.compare(0.02, cycles=400, samples=64, bounces=8)
        self.assertIn("Glass bodies", notes)


class Layers(BesideCycles):
    def setUp(self):
        super().setUp()
        h.set_world((0.1, 0.2, 0.4))
        h.add_plane(3, material=h.diffuse())
        self.ball = h.add_sphere(0.5, (0.5, 0, 1), h.emission(2, (1, 0.5, 0.2)))
        self.layer = self.scene.view_layers[0]

    def test_a_material_that_overrides(self):
        self.layer.material_override = h.diffuse((0.2, 0.7, 0.3), "clay")
        ours, _ = self.compare(cycles=256)
        self.assertLess(ours["Combined"][..., 0].max(), 1)

    def test_the_filter_of_the_environment(self):
        self.layer.use_sky = False
        for transparent in (False, True):
            with self.subTest(transparent=transparent):
                self.scene.render.film_transparent = transparent
                self.compare(cycles=256)

    def test_the_filter_of_surfaces(self):
        self.layer.use_solid = False
        ours, _ = self.compare()
        self.assertGreater(ours["Depth"].min(), 1e9)

    def test_several_layers_each_with_their_own_settings(self):
        second = self.scene.view_layers.new("Second")
        second.material_override = h.diffuse((0.2, 0.7, 0.3), "clay")
        group = bpy.data.collections.new("Group")
        self.scene.collection.children.link(group)
        group.objects.link(self.ball)
        self.scene.collection.objects.unlink(self.ball)
        second.layer_collection.children["Group"].exclude = True
        unused = self.scene.view_layers.new("Unused")
        unused.use = False
        first, _ = self.compare(0.02, cycles=256, layer=self.layer.name)  # a bright outline by 16 samples
        other, _ = self.compare(cycles=256, layer="Second")
        self.assertGreater(first["Combined"][..., 0].max(), 1.5)
        self.assertLess(other["Combined"][..., 0].max(), 1)
        self.assertNotIn("Depth", other)

    def test_what_collections_hold_out_is_not_listed(self):
        group = bpy.data.collections.new("Group")
        self.scene.collection.children.link(group)
        group.objects.link(self.ball)
        self.scene.collection.objects.unlink(self.ball)
        of_layer = self.layer.layer_collection.children["Group"]
        of_layer.holdout = True
        with h.quiet():
            h.set_lumicut("exhaustive", vpls=50)
            h.render()
        self.assertFalse([note for note in h.last_notes() if "oldout" in note])

    def test_notes_of_all_layers_are_shown(self):
        m = h.material("Toon")
        h.shader(m, "ShaderNodeBsdfToon")
        self.ball.data.materials[0] = m
        second = self.scene.view_layers.new("Second")
        second.material_override = h.diffuse((0.2, 0.7, 0.3), "clay")
        with h.quiet():
            h.set_lumicut("exhaustive", vpls=100)
            h.render()
        self.assertIn("Shaders taken as diffuse: Toon (Toon BSDF)", h.last_notes())


class Reach(BesideCycles):
    """What a lamp lights, by kinds of rays and by linking."""

    def setUp(self):
        super().setUp()
        bpy.data.objects.remove(next(ob for ob in self.scene.objects if ob.type == "LIGHT"))
        self.ground = h.add_plane(6, material=h.diffuse())
        gloss = h.material("Gloss")
        h.shader(gloss, "ShaderNodeBsdfGlossy", Roughness=0.5).distribution = "GGX"
        mirror = h.material("Mirror")
        h.shader(mirror, "ShaderNodeBsdfGlossy", Roughness=0.0)
        self.balls = [h.add_sphere(0.8, (x, 0, 0.8), m) for x, m in ((-1.7, h.diffuse()), (1.7, mirror))]
        self.plate = h.add_plane(1.5, 0.3, gloss, "Plate")

    def test_lamps_hidden_from_kinds_of_rays(self):
        self.balls[1].hide_render = True  # a mirror's image of a lamp is a few pixels, all noise
        for kind, values in (("POINT", {"shadow_soft_size": 0.0}), ("AREA", {"size": 1.5}), ("SUN", {"energy": 0.5, "angle": 0.1})):
            lamp = h.add_light(kind, (0.5, -1, 4), **{"energy": 100, **values})
            for ray in ("diffuse", "glossy"):
                with self.subTest(kind=kind, ray=ray):
                    setattr(lamp, "visible_" + ray, False)
                    try:
                        _, notes = self.compare(0.02, 64, vpls=1000)
                        self.assertEqual(notes, "")
                    finally:
                        setattr(lamp, "visible_" + ray, True)
            bpy.data.objects.remove(lamp)

    def test_lamps_that_the_camera_sees(self):
        for kind, values in (("AREA", {"size": 1.5, "shape": "DISK"}), ("POINT", {"shadow_soft_size": 0.5}),
                             ("SPOT", {"shadow_soft_size": 0.5, "spot_size": 2.5})):
            with self.subTest(kind=kind):
                lamp = h.add_light(kind, (0, 2, 1), energy=3, rotation=(-1.5, 0, 0) if kind != "POINT" else (0, 0, 0), **values)
                lamp.rotation_euler = (0, 0, 0)
                lamp.location = (0.6, 0.4, 3)
                self.scene.camera.location, self.scene.camera.rotation_euler = (0.5, 0.2, 0.5), (3.0, 0, 0)
                lamp.visible_camera = True
                try:
                    _, notes = self.compare(0.02, 64, vpls=400)
                    self.assertEqual(notes, "")
                finally:
                    bpy.data.objects.remove(lamp)

    @unittest.skipIf(bpy.app.version < (4, 0, 0), "linking came with 4.0")
    def test_linked_lamps(self):
        lamp = h.add_light("POINT", (1.2, -2, 3), 150, shadow_soft_size=0.0)
        h.add_light("POINT", (-2, -2, 3), 50, shadow_soft_size=0.0)
        linked = bpy.data.collections.new("linked")
        self.plate.data.materials[0] = h.diffuse((0.3, 0.6, 0.2), "green")
        self.balls[1].hide_render = True  # mirrors show what they see whatever the bounces
        for what in ("receiver_collection", "blocker_collection"):
            setattr(lamp.light_linking, what, linked)
            for state in ("INCLUDE", "EXCLUDE"):
                for objects in (self.balls[:1], [self.ground, self.plate]):
                    with self.subTest(what=what, state=state, count=len(objects)):
                        for ob in list(linked.objects):
                            linked.objects.unlink(ob)
                        for ob in objects:
                            linked.objects.link(ob)
                        for link in linked.collection_objects:
                            link.light_linking.link_state = state
                        _, notes = self.compare(0.02, 64)
                        self.assertEqual(notes, "")
            setattr(lamp.light_linking, what, None)


class Displacement(BesideCycles):
    """Vertices moved by the material."""

    def displaced(self, method, space="OBJECT", image=False):
        m = h.diffuse((0.7, 0.6, 0.5), "displaced")
        tree = m.node_tree
        output = next(n for n in tree.nodes if n.type == "OUTPUT_MATERIAL")
        node, texture = tree.nodes.new("ShaderNodeDisplacement"), tree.nodes.new("ShaderNodeTexImage" if image else "ShaderNodeTexNoise")
        node.space, node.inputs["Scale"].default_value = space, 0.6
        if image:
            pixels = np.zeros((32, 32, 4), np.float32)
            x, y = np.meshgrid(np.arange(32), np.arange(32))
            pixels[..., :3] = (0.5 + 0.5 * np.sin(x / 5) * np.cos(y / 4))[..., None]
            picture = bpy.data.images.new("heights", 32, 32, float_buffer=True)
            picture.pixels.foreach_set(pixels.ravel())
            texture.image = picture
        else:
            texture.inputs["Scale"].default_value = 1.5
            coordinates = tree.nodes.new("ShaderNodeTexCoord")
            tree.links.new(coordinates.outputs["Object"], texture.inputs["Vector"])
        tree.links.new(texture.outputs[0], node.inputs["Height"])
        tree.links.new(node.outputs[0], output.inputs["Displacement"])
        owner = m if hasattr(m, "displacement_method") else m.cycles
        owner.displacement_method = method
        return m

    def test_vertices_move_as_in_cycles(self):
        for space, image, scale in (("OBJECT", False, 1.0), ("OBJECT", True, 1.0), ("WORLD", False, 2.0)):
            with self.subTest(space=space, image=image):
                ball = h.add_sphere(1.2 / scale, material=self.displaced("DISPLACEMENT", space, image), segments=64)
                ball.scale = (scale,) * 3
                uvs = ball.data.uv_layers.new(name="UVMap")
                places = np.array([ball.data.vertices[l.vertex_index].co[:] for l in ball.data.loops])
                uvs.data.foreach_set("uv", (0.5 + 0.3 * places[:, :2]).astype(np.float32).ravel())
                _, notes = self.compare(0.02)
                self.assertEqual(notes, "")
                bpy.data.objects.remove(ball)

    def test_bumps_may_lie_on_moved_vertices(self):
        h.add_sphere(1.2, material=self.displaced("BOTH"), segments=24)
        ours, theirs = h.both(16, 16, 0)
        # Slopes over other steps on coarse triangles.
        np.testing.assert_allclose(ours["Combined"].mean((0, 1)), theirs["Combined"].mean((0, 1)), rtol=0.06)
        self.assertEqual(h.last_notes(), [])


class Strands(unittest.TestCase):
    """What Curves Info and attributes tell of hair and curves, shown as emission beside Cycles."""

    def setUp(self):
        self.scene = h.new_scene(48, 48)
        h.set_world((0, 0, 0))
        self.scene.camera.location.z = 4
        self.m = h.material("shown")
        self.emission = h.shader(self.m, "ShaderNodeEmission")
        self.ground = h.add_plane(3, material=self.m)

    def hair(self, **more):
        self.ground.modifiers.new("grass", "PARTICLE_SYSTEM")
        settings = self.ground.particle_systems[0].settings
        settings.type, settings.count, settings.hair_length = "HAIR", 400, 0.8
        settings.root_radius, settings.tip_radius, settings.radius_scale = 1.0, 0.3, 0.05
        for name, value in more.items():
            setattr(settings, name, value)

    def agree(self, node, output):
        tree = self.m.node_tree
        tree.links.new(node.outputs[output], self.emission.inputs["Color"])
        with h.quiet():
            h.set_cycles(64)
            self.scene.cycles_curves.shape = "THICK"
            theirs = h.render()["Combined"][..., :3]
            h.set_lumicut("exhaustive", 4, passes=16, vpls=1)
            ours = h.render()["Combined"][..., :3]
        self.assertEqual(h.last_notes(), [])
        self.assertGreater(theirs.max(), 1e-3)
        scale = max(1e-3, theirs.max())
        # Hairs are prisms of three sides, which seen from above cover 5 % less.
        np.testing.assert_allclose(h.blocks(ours, 8) / scale, h.blocks(theirs, 8) / scale, atol=0.05, err_msg=output)
        np.testing.assert_allclose(ours.mean(), theirs.mean(), rtol=0.08, err_msg=output)

    def test_curves_info_of_hair(self):
        self.hair()
        info = self.m.node_tree.nodes.new("ShaderNodeHairInfo")
        for output in ("Is Strand", "Intercept", "Length", "Thickness", "Random"):
            with self.subTest(output):
                self.agree(info, output)

    def test_coordinates_and_colours_where_hair_grows(self):
        self.hair()
        uvs = self.ground.data.uv_layers.new(name="other")
        colours = self.ground.data.color_attributes.new("tint", "BYTE_COLOR", "CORNER")
        for i, (u, v) in enumerate(((0, 0), (1, 0), (1, 1), (0, 1))):
            uvs.data[i].uv = (u, v)
            colours.data[i].color = (u, v, 0.5, 1)
        tree = self.m.node_tree
        node = tree.nodes.new("ShaderNodeUVMap")
        node.uv_map = "other"
        self.agree(node, "UV")
        node = tree.nodes.new("ShaderNodeVertexColor")
        node.layer_name = "tint"
        self.agree(node, "Color")

    def test_an_objects_own_numbers_are_its_hairs_too(self):
        self.hair()
        self.ground.color = (0.2, 0.7, 0.4, 1)
        self.agree(self.m.node_tree.nodes.new("ShaderNodeObjectInfo"), "Color")
