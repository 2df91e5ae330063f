"""What is collected: meshes, instances, modifiers at render levels, materials, notes about what is not followed."""
import math
import unittest

import bpy
import numpy as np

import helpers as h
from lumicut_blender import collect, materials, report, strands
from lumicut_blender.lumicut import library

FACETS = library.FACETS_ONCE | library.BRIGHT_LOBE  # by the version of Blender


def collected(max_shininess=1000.0):
    """(scene data, notes) of the viewport's dependency graph."""
    found = report.Report()
    data = collect.Collector(bpy.context.evaluated_depsgraph_get(), found, max_shininess=max_shininess).collect()
    return data, found.lines()


def the_material(m, max_shininess=1000.0):
    """(library.Material, notes, data) of a plane with this material and a UV map."""
    h.add_plane(material=m).data.uv_layers.new(name="UVMap")
    data, notes = collected(max_shininess)
    return dict(data.materials)[m.name], notes, data


class Geometry(unittest.TestCase):
    def setUp(self):
        h.new_scene()

    def test_instances_share_a_mesh_and_are_counted(self):
        ob = h.add_sphere(segments=16)
        for i in range(9):
            copy = h.link(bpy.data.objects.new("copy", ob.data))
            copy.location.x = i
        data, _ = collected()
        self.assertEqual(len(data.meshes), 1)
        self.assertEqual(len(data.meshes[0].transforms), 10)
        with h.quiet():
            h.set_lumicut(vpls=100)
            h.render()
        self.assertEqual(h.last_stats()["scene"]["instances"], 10)
        self.assertEqual(h.last_stats()["scene"]["triangles"], 10 * len(data.meshes[0].indices))

    def test_objects_with_materials_of_their_own_are_meshes_of_their_own(self):
        ob = h.add_plane(material=h.diffuse((1, 0, 0), "red"))
        copy = h.link(bpy.data.objects.new("copy", ob.data))
        copy.material_slots[0].link = "OBJECT"
        copy.material_slots[0].material = h.diffuse((0, 1, 0), "green")
        data, _ = collected()
        self.assertEqual(len(data.meshes), 2)
        names = {data.materials[mesh.material][0] for mesh in data.meshes}
        self.assertEqual(names, {"red", "green"})

    def test_collections_and_faces_instance(self):
        group = bpy.data.collections.new("Group")
        ball = h.add_sphere(segments=8)
        bpy.context.scene.collection.objects.unlink(ball)
        group.objects.link(ball)
        for i in range(3):
            empty = h.link(bpy.data.objects.new("empty", None))
            empty.instance_type, empty.instance_collection = "COLLECTION", group
            empty.location.x = 2 * i
        data, _ = collected()
        self.assertEqual([len(mesh.transforms) for mesh in data.meshes], [3])
        self.assertEqual(sorted(t[3] for t in data.meshes[0].transforms), [0, 2, 4])

    def test_particles_instance(self):
        plane = h.add_plane()
        ball = h.add_sphere(0.1, segments=8, name="Ball")
        plane.modifiers.new("particles", "PARTICLE_SYSTEM")
        settings = plane.particle_systems[0].settings
        settings.type, settings.count, settings.render_type, settings.instance_object = "HAIR", 25, "OBJECT", ball
        data, _ = collected()
        counts = {mesh.name: len(mesh.transforms) for mesh in data.meshes}
        self.assertEqual(counts, {"Plane": 1, "Ball": 26})

    def test_geometry_nodes_instance(self):
        plane = h.add_plane()
        ball = h.add_sphere(0.1, segments=8, name="Ball")
        tree = bpy.data.node_groups.new("points", "GeometryNodeTree")
        if hasattr(tree, "interface"):
            tree.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
            tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
        else:
            tree.inputs.new("NodeSocketGeometry", "Geometry")
            tree.outputs.new("NodeSocketGeometry", "Geometry")
        into, out = tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")
        place, info = tree.nodes.new("GeometryNodeInstanceOnPoints"), tree.nodes.new("GeometryNodeObjectInfo")
        info.inputs["Object"].default_value = ball
        info.inputs["As Instance"].default_value = True
        tree.links.new(into.outputs[0], place.inputs["Points"])
        tree.links.new(info.outputs["Geometry"], place.inputs["Instance"])
        tree.links.new(place.outputs[0], out.inputs[0])
        plane.modifiers.new("nodes", "NODES").node_group = tree
        data, _ = collected()
        self.assertEqual(sum(len(mesh.transforms) for mesh in data.meshes), 5)  # four corners, and the ball itself

    def test_curves_text_and_metaballs_are_meshes_once(self):
        curve = bpy.data.curves.new("circle", "CURVE")
        curve.dimensions, curve.bevel_depth = "3D", 0.1
        spline = curve.splines.new("BEZIER")
        spline.bezier_points.add(1)
        spline.bezier_points[1].co = (1, 0, 0)
        h.link(bpy.data.objects.new("circle", curve))
        text = bpy.data.curves.new("text", "FONT")
        text.body = "Lumicut"
        h.link(bpy.data.objects.new("text", text))
        ball = bpy.data.metaballs.new("ball")
        ball.elements.new()
        h.link(bpy.data.objects.new("ball", ball))
        data, _ = collected()
        self.assertEqual(sorted(mesh.name for mesh in data.meshes), ["ball", "circle", "text"])
        for mesh in data.meshes:
            self.assertEqual(len(mesh.transforms), 1)
            self.assertGreater(len(mesh.indices), 10)

    def test_modifiers_have_render_levels_in_f12_and_viewport_levels_in_views(self):
        cube = h.add_mesh("Cube", [(x, y, z) for z in (-1, 1) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))],
                          [(3, 2, 1, 0), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)])
        subdivision = cube.modifiers.new("subdivision", "SUBSURF")
        subdivision.levels, subdivision.render_levels = 1, 3
        data, _ = collected()
        self.assertEqual(data.triangles(), 6 * 4 * 2)
        with h.quiet():
            h.set_lumicut(vpls=100)
            h.render()
        self.assertEqual(h.last_stats()["scene"]["triangles"], 6 * 64 * 2)

    def test_normals_flat_smooth_mixed_and_split(self):
        for smooth, expanded in ((False, False), (True, False)):
            self.setUp()
            ball = h.add_sphere(segments=16, smooth=smooth)
            data, _ = collected()
            mesh = data.meshes[0]
            self.assertEqual(mesh.normals is not None, smooth)
            if smooth:
                radial = mesh.positions / np.linalg.norm(mesh.positions, axis=1)[:, None]
                self.assertGreater((radial * mesh.normals).sum(1).min(), 0.99)
        half = [p.center.z > 0 for p in ball.data.polygons]
        ball.data.polygons.foreach_set("use_smooth", half)
        ball.data.update()
        data, _ = collected()
        mesh = data.meshes[0]
        corners = mesh.positions[mesh.indices]
        face = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        face /= np.linalg.norm(face, axis=1)[:, None]
        below = corners[..., 2].mean(1) < -0.1
        np.testing.assert_allclose(mesh.normals[mesh.indices][below], np.repeat(face[below][:, None], 3, 1), atol=2e-3)
        above = corners[..., 2].mean(1) > 0.3
        self.assertGreater(np.abs(mesh.normals[mesh.indices][above] - face[above][:, None]).max(), 0.02)

    def test_a_mirrored_instance_is_lit_from_the_right_side(self):
        """One instance is baked: its winding and normals must turn with it, or the emitter would face away."""
        h.add_plane(material=h.diffuse(), z=-1)
        ball = h.add_sphere(0.5, segments=16, material=h.diffuse())
        h.add_light("POINT", (0.3, 0.2, 3), 100, shadow_soft_size=0)
        with h.quiet():
            h.set_lumicut(vpls=200, max_depth=0)
            straight = h.radiance(h.render())
            ball.scale = (-1, 1, 1)
            ball.data.flip_normals()
            mirrored = h.radiance(h.render())
        np.testing.assert_allclose(h.blocks(mirrored), h.blocks(straight), rtol=0.05, atol=0.01)

    def test_faces_of_several_materials_keep_theirs(self):
        ob = h.add_plane(material=h.diffuse((1, 0, 0), "red"))
        ob.data.materials.append(h.diffuse((0, 0, 1), "blue"))
        mesh = bpy.data.meshes.new("two")
        mesh.from_pydata([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (2, 0, 0), (2, 1, 0)], [], [(0, 1, 2, 3), (1, 4, 5, 2)])
        for m in ob.data.materials:
            mesh.materials.append(m)
        mesh.polygons[1].material_index = 1
        bpy.data.objects.remove(ob)
        h.link(bpy.data.objects.new("two", mesh))
        data, _ = collected()
        names = [data.materials[n][0] for n in data.meshes[0].materials]
        self.assertEqual(names, ["red", "red", "blue", "blue"])

    def test_empty_and_broken_meshes_are_survived(self):
        h.add_mesh("Nothing", [], [])
        h.add_mesh("Edge", [(0, 0, 0), (1, 0, 0)], [])
        h.add_mesh("Broken", [(0, 0, 0), (1, 0, 0), (0, float("nan"), 0)], [(0, 1, 2)])
        flat = h.add_plane(name="Flat")
        flat.scale = (1, 1, 0)
        gone = h.add_plane(name="Gone")
        gone.scale = (0, 0, 0)
        with h.quiet():
            h.set_lumicut(vpls=100)
            h.render()
        text = "\n".join(h.last_notes())
        self.assertIn("Broken", text)
        self.assertNotIn("Gone", text)
        self.assertEqual(h.last_stats()["scene"]["instances"], 2)  # of Broken and Flat: a point has nothing to show

    def test_hair_grows_from_root_to_tip_at_its_thickness(self):
        plane = h.add_plane(name="Meadow")
        plane.modifiers.new("grass", "PARTICLE_SYSTEM")
        settings = plane.particle_systems[0].settings
        settings.type, settings.count, settings.hair_length = "HAIR", 50, 1.0
        settings.root_radius, settings.tip_radius, settings.radius_scale, settings.use_close_tip = 1.0, 0.5, 0.04, False
        plane.location, plane.scale = (1, 2, 3), (2, 2, 2)
        data, notes = collected()
        hair = next(mesh for mesh in data.meshes if mesh.name.startswith("Meadow: "))
        low, high = hair.positions.min(0), hair.positions.max(0)
        self.assertGreater(high[2], 0.4)  # twice as long in the world
        self.assertAlmostEqual(low[2], 0, delta=0.03)
        self.assertEqual(len(hair.transforms), 1)
        keys = len(hair.positions) // 50 // 3
        rings = hair.positions.reshape(50, keys, 3, 3)
        radii = np.linalg.norm(rings - rings.mean(2, keepdims=True), axis=3).mean((0, 2))
        np.testing.assert_allclose(radii[[0, -1]], np.array([0.02, 0.01]) * np.pi / (3 * np.sin(np.pi / 3)), rtol=1e-3)
        self.assertFalse([note for note in notes if "Hair" in note])

    def test_volumes_and_motion_blur_are_reported_by_name(self):
        h.link(bpy.data.objects.new("Smoke", bpy.data.volumes.new("Smoke")))
        bpy.context.scene.render.use_motion_blur = True
        text = "\n".join(collected()[1])
        for words in ("Volumes left out: Smoke", "Motion blur left out"):
            self.assertIn(words, text)


class Strands(unittest.TestCase):
    """Shapes made of arrays alone."""

    def test_tubes_have_the_area_of_round_ones_from_the_average_side(self):
        rng = np.random.default_rng(1)
        places = np.stack([np.zeros(3), rng.normal(size=3)])[None]
        positions, _, indices = strands.tubes(places, np.array([0.01, 0.01]))
        a, b, c = (positions[indices[:, k]].astype(float) for k in range(3))
        area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
        # A convex body's mean projection is a quarter of its surface. [Cauchy]
        self.assertAlmostEqual(area / (2 * np.pi * 0.01 * np.linalg.norm(places[0, 1])), 1, delta=1e-4)

    def test_straight_strands_keep_their_ends_alone_and_bent_ones_their_bends(self):
        line = np.linspace(0, 1, 9)[None, :, None] * np.array([1.0, 2, 3])
        places, radii = strands.straightened(line, np.linspace(0.02, 0.01, 9))
        self.assertEqual(places.shape, (1, 2, 3))
        np.testing.assert_allclose(radii, [0.02, 0.01])
        bent = line.copy()
        bent[0, 4:, 0] = bent[0, 4, 0]
        self.assertEqual(strands.straightened(bent, np.full(9, 0.01))[0].shape, (1, 3, 3))

    def test_spheres_have_the_volume_of_balls(self):
        positions, indices = strands.unit_sphere()
        a, b, c = (positions[indices[:, k]].astype(float) for k in range(3))
        self.assertAlmostEqual((a * np.cross(b, c)).sum() / 6 / (4 / 3 * np.pi), 1, delta=1e-5)


class MaterialTrees(unittest.TestCase):
    def setUp(self):
        h.new_scene()

    def principled(self, **inputs):
        m = h.material("Stuff")
        node = h.shader(m, "ShaderNodeBsdfPrincipled")
        node.distribution = "MULTI_GGX"  # as the library has it
        for name, value in inputs.items():
            socket = next(s for s in (node.inputs.get(n) for n in name.split("|")) if s is not None)
            socket.default_value = value
        return m, node

    def test_principled_dielectric(self):
        m, _ = self.principled(**{"Base Color": (0.2, 0.4, 0.6, 1), "Roughness": 0.5, "Emission Strength": 0.0})
        out, notes, _ = the_material(m)
        np.testing.assert_allclose(out.diffuse, (0.2, 0.4, 0.6), rtol=1e-5)
        self.assertEqual(bool(out.flags & library.BURLEY), bpy.app.version < (4, 0, 0))
        self.assertEqual(notes, [])
        # 3.x: 0.08 specular 0.5; 4.x: ((1.45-1)/2.45)² or IOR 1.5's 4 %
        f0 = materials.normal_reflectance(out.ior)
        self.assertTrue(all(0.03 < s * f0 < 0.045 for s in out.specular), (list(out.specular), out.ior))
        self.assertTrue(out.flags & library.GGX)
        self.assertEqual((out.roughness, out.metallic, out.transmission), (0.5, 0, 0))

    def test_principled_metal_and_emission_and_alpha(self):
        m, _ = self.principled(**{"Base Color": (0.9, 0.6, 0.3, 1), "Metallic": 1.0, "Roughness": 0.3,
                                  "Emission|Emission Color": (1, 0.5, 0, 1), "Emission Strength": 4.0, "Alpha": 0.3})
        out, notes, _ = the_material(m)
        np.testing.assert_allclose(out.diffuse, (0.9, 0.6, 0.3), rtol=1e-6)
        self.assertEqual(out.metallic, 1)
        self.assertAlmostEqual(out.roughness, 0.3, places=6)
        np.testing.assert_allclose(out.emission, (4, 2, 0), rtol=1e-6)
        self.assertTrue(out.flags & library.EMIT_BOTH_SIDES)
        self.assertAlmostEqual(out.opacity, 0.3, places=6)
        self.assertEqual(notes, [])

    def test_the_gloss_limit_is_kept_and_reported(self):
        m, _ = self.principled(**{"Roughness": 0.12})
        out, notes, _ = the_material(m, 300.0)
        self.assertAlmostEqual(out.roughness, materials.roughness_of(300), places=6)
        self.assertTrue(any("gloss limit" in n and "Stuff" in n for n in notes))

    def test_normal_maps(self):
        m, node = self.principled()
        texture = m.node_tree.nodes.new("ShaderNodeTexImage")
        texture.image = self.image(srgb=False)
        mapped = m.node_tree.nodes.new("ShaderNodeNormalMap")
        mapped.inputs["Strength"].default_value = 0.5
        m.node_tree.links.new(texture.outputs["Color"], mapped.inputs["Color"])
        m.node_tree.links.new(mapped.outputs[0], node.inputs["Normal"])
        out, notes, data = the_material(m)
        self.assertEqual((out.normal_texture, out.normal_strength), (1, 0.5))
        self.assertEqual(data.images[0].flags & library.SRGB, 0)
        self.assertFalse(any("Normal" in n for n in notes), notes)

    def linked(self, m, node, socket, image=None):
        texture = m.node_tree.nodes.new("ShaderNodeTexImage")
        texture.image = image or self.image(srgb=False)
        m.node_tree.links.new(texture.outputs["Color"], node.inputs[socket])
        return texture

    def test_images_of_roughness_and_metallic_are_grey_textures(self):
        m, node = self.principled()
        self.linked(m, node, "Roughness")
        grey = self.image("grey", (0.5, 0.5, 0.5, 1), srgb=False)
        self.linked(m, node, "Metallic", grey)
        out, notes, data = the_material(m)
        self.assertEqual((out.roughness, out.metallic), (1, 1))
        rough, metal = (data.images[n - 1].pixels for n in (out.roughness_texture, out.metallic_texture))
        expected = np.array((128, 64, 255)) / 255 @ (0.2126, 0.7152, 0.0722)  # a colour's luminance is its number
        np.testing.assert_allclose(rough[0, 0], expected, atol=1e-3)
        self.assertEqual(list(metal[0, 0][:3]), [128] * 3)  # as it is: bytes
        self.assertFalse(any("their mean" in n for n in notes), notes)

    def test_a_factor_and_the_gloss_limit_work_on_a_texture_of_roughness(self):
        m, node = self.principled()
        texture = self.linked(m, node, "Roughness", self.image("grey", (0.24, 0.24, 0.24, 1), srgb=False))
        half = m.node_tree.nodes.new("ShaderNodeMath")
        half.operation = "MULTIPLY"
        half.inputs[1].default_value = 0.5
        m.node_tree.links.new(texture.outputs["Color"], half.inputs[0])
        m.node_tree.links.new(half.outputs[0], node.inputs["Roughness"])
        out, notes, data = the_material(m, 300.0)
        texels = data.images[out.roughness_texture - 1].pixels * out.roughness
        self.assertAlmostEqual(float(texels.max()), materials.roughness_of(300), places=5)
        self.assertEqual(float(texels.min()), 0.0)  # the mirror's part stays one
        self.assertTrue(any("gloss limit" in n for n in notes), notes)

    def test_a_mask_between_metal_and_paint(self):
        """Emission added keeps it by place, other shaders do not."""
        for add in (None, "ShaderNodeEmission", "ShaderNodeBsdfDiffuse"):
            with self.subTest(add=add):
                h.new_scene()
                m, node = self.principled(**{"Base Color": (0.4, 0.4, 0.4, 1)})
                self.linked(m, node, "Metallic", self.image("mask", (1, 1, 1, 1), srgb=False))
                if add:
                    sum_ = h.shader(m, "ShaderNodeAddShader")
                    m.node_tree.links.new(node.outputs[0], sum_.inputs[0])
                    m.node_tree.links.new(m.node_tree.nodes.new(add).outputs[0], sum_.inputs[1])
                out, notes, data = the_material(m)
                if add == "ShaderNodeBsdfDiffuse":
                    self.assertEqual(out.metallic_texture, 0)
                    self.assertTrue(any("metallic" in n for n in notes), notes)
                    continue
                self.assertGreater(out.metallic_texture, 0)
                self.assertAlmostEqual(sum(out.specular) / 3 * materials.normal_reflectance(out.ior), 0.04, delta=0.006)

    def test_bump_maps(self):
        m, node = self.principled()
        bump, mapped = (m.node_tree.nodes.new(k) for k in ("ShaderNodeBump", "ShaderNodeNormalMap"))
        bump.inputs["Distance"].default_value, bump.inputs["Strength"].default_value, bump.invert = 0.2, 0.7, True
        self.linked(m, bump, "Height", self.image("heights", (0.5, 0.5, 0.5, 1), srgb=False))
        self.linked(m, mapped, "Color", self.image("normals", (0.5, 0.5, 1, 1), srgb=False))
        m.node_tree.links.new(mapped.outputs[0], bump.inputs["Normal"])
        m.node_tree.links.new(bump.outputs[0], node.inputs["Normal"])
        out, notes, _ = the_material(m)
        self.assertNotEqual(out.height_texture, out.normal_texture)
        self.assertGreater(min(out.height_texture, out.normal_texture), 0)
        np.testing.assert_allclose((out.bump_distance, out.bump_strength), (-0.2, 0.7), rtol=1e-6)
        self.assertFalse(any("bump" in n.lower() for n in notes), notes)

    def test_bumps_of_what_is_no_image_are_programs(self):
        m, node = self.principled()
        bump = m.node_tree.nodes.new("ShaderNodeBump")
        m.node_tree.links.new(m.node_tree.nodes.new("ShaderNodeTexNoise").outputs[0], bump.inputs["Height"])
        m.node_tree.links.new(bump.outputs[0], node.inputs["Normal"])
        out, notes, _ = the_material(m)
        self.assertEqual((out.height_texture, out.normal_texture), (0, 1))
        self.assertEqual(notes, [])

    def test_clear_coats(self):
        m, node = self.principled(**{"Clearcoat|Coat Weight": 0.8, "Clearcoat Roughness|Coat Roughness": 0.09})
        out, notes, _ = the_material(m)
        if bpy.app.version < (4, 0, 0):  # a quarter, and a longer tailed distribution
            np.testing.assert_allclose((out.coat, out.coat_roughness, out.coat_ior), (0.2, 0.3, 1.5), rtol=1e-5)
            self.assertTrue(any("GTR1" in n for n in notes), notes)
        else:
            np.testing.assert_allclose((out.coat, out.coat_roughness, out.coat_ior), (0.8, 0.09, 1.5), rtol=1e-5)
            h.new_scene()
            m, node = self.principled(**{"Coat Weight": 1.0, "Base Color": (0.5, 0.5, 0.5, 1)})
            node.inputs["Coat Tint"].default_value = (1, 0.5, 0.5, 1)
            tinted = the_material(m)[0].diffuse
            self.assertAlmostEqual(tinted[0], 0.5, places=3)
            self.assertAlmostEqual(tinted[1], 0.5 * 0.5 ** 1.146, places=2)

    def test_rough_metal_of_single_scattering_loses_what_meets_other_facets(self):
        metals = {}
        for kind in ("GGX", "MULTI_GGX"):
            h.new_scene()
            m, node = self.principled(**{"Base Color": (0.9, 0.6, 0.3, 1), "Metallic": 1.0, "Roughness": 0.8})
            node.distribution = kind
            metals[kind] = the_material(m)[0]
        np.testing.assert_allclose(metals["MULTI_GGX"].diffuse, (0.9, 0.6, 0.3), rtol=1e-6)
        old = bpy.app.version < (4, 0, 0)
        self.assertEqual(metals["MULTI_GGX"].flags & FACETS, 0 if old else library.BRIGHT_LOBE)
        self.assertEqual(metals["GGX"].flags & FACETS, library.FACETS_ONCE)
        np.testing.assert_allclose(metals["GGX"].diffuse, (0.9, 0.6, 0.3), rtol=1e-6)

    def test_mirrors_stay_mirrors(self):
        m, _ = self.principled(**{"Roughness": 0.0, "Metallic": 1.0})
        out, _, _ = the_material(m)
        self.assertEqual((out.roughness, out.metallic), (0, 1))

    def test_glass(self):
        m = h.material("Bottle")
        node = h.shader(m, "ShaderNodeBsdfGlass")
        node.inputs["Color"].default_value, node.inputs["IOR"].default_value = (0.5, 0.8, 1, 1), 1.3
        node.inputs["Roughness"].default_value = 0.0
        out, notes, _ = the_material(m)
        np.testing.assert_allclose(out.diffuse, (0.25, 0.64, 1), rtol=1e-5)  # of both borders
        self.assertEqual((out.transmission, out.metallic, out.roughness), (1, 0, 0))
        self.assertAlmostEqual(out.ior, 1.3, places=5)
        np.testing.assert_allclose(out.specular_tint, (0.5, 0.8, 1), rtol=1e-5)  # Cycles' Glass colours that too
        self.assertFalse(any("Bottle" in n for n in notes))

    def test_light_goes_straight_through_panes_and_not_through_bodies(self):
        m = h.material("Bottle")
        h.shader(m, "ShaderNodeBsdfGlass")
        h.add_plane(material=m)
        ball = h.add_sphere(segments=8)
        ball.data.materials.append(m)
        flat = h.add_sphere(segments=8, name="Flat")
        flat.data.materials.append(m)
        flat.scale.z = 0.02
        data, notes = collected()
        passes = {mesh.name: bool(data.materials[mesh.material][1].flags & library.SHADOWS_PASS) for mesh in data.meshes}
        self.assertEqual(passes, {"Plane": True, ball.name: False, "Flat": True})
        self.assertTrue(any("Glass bodies" in n and "Bottle" in n for n in notes))

    def test_a_single_layer_of_glass_is_the_surface_of_a_body_and_two_sides_of_a_slab_are_not(self):
        m = h.material("Pane")
        h.shader(m, "ShaderNodeBsdfGlass")
        h.add_plane(material=m)
        mesh = bpy.data.meshes.new("Rimless")
        mesh.from_pydata([(x, y, z) for z in (0, 0.1) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))], [], [(3, 2, 1, 0), (4, 5, 6, 7)])
        mesh.materials.append(m)
        bpy.context.scene.collection.objects.link(bpy.data.objects.new("Rimless", mesh))
        data, _ = collected()
        flags = {mesh.name: data.materials[mesh.material][1].flags & ~FACETS for mesh in data.meshes}
        self.assertEqual(flags, {"Plane": library.GGX | library.SHADOWS_PASS | library.OPEN_GLASS, "Rimless": library.GGX | library.SHADOWS_PASS})

    def window(self, output, glass_first=True, kind="ShaderNodeBsdfGlass"):
        m = h.material("Window")
        mix = h.shader(m, "ShaderNodeMixShader")
        nodes, links = m.node_tree.nodes, m.node_tree.links
        glass, clear, path = nodes.new(kind), nodes.new("ShaderNodeBsdfTransparent"), nodes.new("ShaderNodeLightPath")
        links.new(path.outputs[output], mix.inputs[0])
        links.new(glass.outputs[0], mix.inputs[1 if glass_first else 2])
        links.new(clear.outputs[0], mix.inputs[2 if glass_first else 1])
        h.add_sphere(segments=8).data.materials.append(m)
        self.data, notes = collected()
        return dict(self.data.materials)["Window"], notes

    def test_glass_that_is_clear_to_shadow_rays_lets_light_pass(self):
        out, notes = self.window("Is Shadow Ray")
        self.assertEqual(out.flags & ~FACETS, library.GGX | library.SHADOWS_PASS)
        self.assertEqual((out.transmission, out.opacity), (1, 1))
        self.assertFalse(any("Window" in n for n in notes), notes)

    def test_other_mixes_by_the_ray_hide_from_it_what_is_clear_to_it(self):
        out, notes = self.window("Is Glossy Ray")
        self.assertEqual(out.flags & ~FACETS, library.GGX)
        self.assertEqual([mesh.mask for mesh in self.data.meshes], [library.ALL_RAYS & ~library.GLOSSY_RAYS])
        self.assertFalse(any("Light Path" in n for n in notes))

    def test_kinds_of_rays_that_see_alike_share_a_mesh(self):
        m = h.material("Window")
        mix = h.shader(m, "ShaderNodeMixShader")
        path, seen, other = (m.node_tree.nodes.new("ShaderNode" + kind) for kind in ("LightPath", "Emission", "BsdfDiffuse"))
        for source, target in ((path.outputs["Is Camera Ray"], 0), (other.outputs[0], 1), (seen.outputs[0], 2)):
            m.node_tree.links.new(source, mix.inputs[target])
        h.add_sphere(segments=8).data.materials.append(m)
        data, _ = collected()
        self.assertEqual([mesh.mask for mesh in data.meshes], [library.CAMERA_RAYS, library.ALL_RAYS & ~library.CAMERA_RAYS])
        self.assertEqual(len(data.materials), 2)

    def test_what_is_not_glass_and_clear_to_shadow_rays_is_hidden_from_them(self):
        out, notes = self.window("Is Shadow Ray", kind="ShaderNodeBsdfDiffuse")
        self.assertEqual(out.flags & library.SHADOWS_PASS, 0)
        self.assertEqual([mesh.mask for mesh in self.data.meshes], [library.ALL_RAYS & ~library.SHADOW_RAYS])
        self.assertFalse(any("Light Path" in n for n in notes))

    def test_principled_with_half_transmission(self):
        m, _ = self.principled(**{"Base Color": (0.6, 0.6, 0.6, 1), "Transmission|Transmission Weight": 0.5,
                                  "Roughness": 0.0})
        out, _, _ = the_material(m)
        self.assertAlmostEqual(out.transmission, 0.5, places=6)
        self.assertEqual(out.roughness, 0)

    def test_a_room_of_principled_walls_is_as_bright_as_in_cycles(self):
        """Light that bounces: an albedo that is 5 % off makes the mean 15 % and more off."""
        m, node = self.principled(**{"Base Color": (0.7, 0.7, 0.7, 1), "Specular|Specular IOR Level": 0.0, "Roughness": 1.0})
        h.add_mesh("Room", [(x, y, z) for z in (0, 3) for x, y in ((-2, -2), (2, -2), (2, 2), (-2, 2))],
                   [(0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0)], m)
        scene = bpy.context.scene
        scene.camera.location, scene.camera.rotation_euler = (0, -1.8, 1.5), (math.radians(90), 0, 0)
        scene.camera.data.lens = 18
        h.add_light("POINT", (0, 0, 1.5), 50, shadow_soft_size=0.1)
        with h.quiet():
            h.set_cycles(256, 32)
            cycles = h.radiance(h.render()).mean()
            h.set_lumicut("lightcuts", passes=8, vpls=20000)
            ours = h.radiance(h.render()).mean()
        self.assertAlmostEqual(ours / cycles, 1, delta=0.03)  # eight times 20,000 lights, half a percent; the clamp takes two

    def test_matt_principled_keeps_burleys_diffuse(self):
        m, _ = self.principled(**{"Specular|Specular IOR Level": 0.0, "Roughness": 0.8})
        out, _, _ = the_material(m)
        self.assertEqual(bool(out.flags & library.BURLEY), bpy.app.version < (4, 0, 0))
        if out.flags & library.BURLEY:
            self.assertAlmostEqual(out.roughness, 0.8, places=6)

    def test_specular_tints(self):
        if bpy.app.version < (4, 0, 0):  # towards the base colour's hue, of luminance 1
            m, _ = self.principled(**{"Base Color": (0.2, 0.4, 0.6, 1), "Specular Tint": 1.0})
            out, notes, _ = the_material(m)
            hue = np.array((0.2, 0.4, 0.6)) / (np.array((0.2, 0.4, 0.6)) @ (0.2126, 0.7152, 0.0722))
            f0 = np.array(out.specular) * materials.normal_reflectance(out.ior)
            np.testing.assert_allclose(f0, 0.04 * hue, rtol=1e-4)
        else:  # of dielectrics straight on, of metal at its edge
            m, _ = self.principled(**{"Specular Tint": (1, 0.5, 0.25, 1), "IOR": 1.5})
            out, notes, _ = the_material(m)
            np.testing.assert_allclose(np.array(out.specular) * materials.normal_reflectance(out.ior),
                                       0.04 * np.array((1, 0.5, 0.25)), rtol=1e-4)
            np.testing.assert_allclose(out.specular_tint, (1, 0.5, 0.25), rtol=1e-6)
        self.assertFalse(any("tint" in n for n in notes), notes)

    def test_what_depends_on_the_view_is_a_texture_by_view(self):
        m = h.material("Paint")
        mix = h.shader(m, "ShaderNodeMixShader")
        weight, a, b = (m.node_tree.nodes.new(f"ShaderNode{k}") for k in ("LayerWeight", "BsdfDiffuse", "BsdfGlossy"))
        weight.inputs["Blend"].default_value, b.distribution = 0.2, "GGX"
        a.inputs["Color"].default_value, b.inputs["Color"].default_value = (0.5, 0.25, 0, 1), (1, 1, 1, 1)
        for socket, to in ((weight.outputs["Fresnel"], mix.inputs[0]), (a.outputs[0], mix.inputs[1]), (b.outputs[0], mix.inputs[2])):
            m.node_tree.links.new(socket, to)
        out, notes, data = the_material(m)
        self.assertEqual((out.opacity, out.opacity_texture), (1, 0))
        diffuse, gloss = data.images[out.diffuse_texture - 1], data.images[out.specular_texture - 1]
        self.assertTrue(diffuse.flags & gloss.flags & library.BY_VIEW)
        texels = gloss.pixels[0, :, 0] * out.specular[0]
        half = len(texels) // 2
        self.assertAlmostEqual(float(texels[-1]), (0.25 / 2.25) ** 2, places=4)  # of index 1.25, straight on
        self.assertAlmostEqual(float(texels[half]), 1, places=4)
        self.assertAlmostEqual(float(texels[0]), (0.25 / 2.25) ** 2, places=4)
        self.assertEqual(float(texels[half // 4 * 3]), 1)  # from behind there is total reflection
        np.testing.assert_allclose(diffuse.pixels[0, :, 1] * out.diffuse[1], 0.25 * (1 - texels), atol=1e-5)
        self.assertFalse(any("view" in n for n in notes), notes)

    def test_sides_of_their_own_colours(self):
        m = h.material("Card")
        node = h.shader(m, "ShaderNodeBsdfDiffuse")
        mix, side = (m.node_tree.nodes.new(f"ShaderNode{k}") for k in ("MixRGB", "NewGeometry"))
        mix.inputs[1].default_value, mix.inputs[2].default_value = (1, 0, 0, 1), (0, 0, 1, 1)
        m.node_tree.links.new(side.outputs["Backfacing"], mix.inputs[0])
        m.node_tree.links.new(mix.outputs[0], node.inputs["Color"])
        out, _, data = the_material(m)
        row = data.images[out.diffuse_texture - 1].pixels[0] * np.array(out.diffuse)
        np.testing.assert_allclose(row[0, :3], (0, 0, 1), atol=1e-6)
        np.testing.assert_allclose(row[-1, :3], (1, 0, 0), atol=1e-6)

    def test_mix_of_diffuse_and_glossy(self):
        m = h.material("Mixed")
        mix = h.shader(m, "ShaderNodeMixShader")
        mix.inputs[0].default_value = 0.25
        a, b = m.node_tree.nodes.new("ShaderNodeBsdfDiffuse"), m.node_tree.nodes.new("ShaderNodeBsdfGlossy")
        a.inputs["Color"].default_value, b.inputs["Color"].default_value = (0.8, 0.4, 0, 1), (1, 1, 1, 1)
        b.inputs["Roughness"].default_value, b.distribution = 0.4, "MULTI_GGX"
        m.node_tree.links.new(a.outputs[0], mix.inputs[1])
        m.node_tree.links.new(b.outputs[0], mix.inputs[2])
        out, _, _ = the_material(m)
        self.assertEqual(out.flags, library.GGX | library.NO_FRESNEL)
        np.testing.assert_allclose(out.specular, (0.25, 0.25, 0.25), atol=1e-6)
        # White facets lose nothing: what one reflection loses comes back evenly.
        again = 0.25 * np.interp(0.4 ** 2, materials.ALPHAS, materials.LOSSES)
        np.testing.assert_allclose(out.diffuse, np.array((0.6, 0.3, 0)) + again, atol=1e-6)
        self.assertAlmostEqual(out.roughness, 0.4, places=6)

    def image(self, name="picture", colour=(0.5, 0.25, 1.0, 0.4), srgb=True, width=4, height=2):
        image = bpy.data.images.new(name, width, height, alpha=True)
        image.colorspace_settings.name = "sRGB" if srgb else "Non-Color"
        pixels = np.tile(np.array(colour, np.float32), width * height).reshape(height, width, 4)
        pixels[0, 0] = (0, 0, 0, 1)  # the lower left one
        image.pixels.foreach_set(pixels.reshape(-1))
        image.update()
        return image

    def with_image(self, image, socket="Base Color", output="Color"):
        m, node = self.principled()
        texture = m.node_tree.nodes.new("ShaderNodeTexImage")
        texture.image = image
        m.node_tree.links.new(texture.outputs[output], node.inputs[socket])
        return m, node, texture

    def test_an_srgb_image_stays_bytes_and_its_first_row_is_the_top(self):
        image = self.image(colour=(0.5, 0.25, 1.0, 1.0))
        m, _, _ = self.with_image(image)
        out, _, data = the_material(m)
        self.assertEqual(out.diffuse_texture, 1)
        self.assertEqual(out.diffuse[0], out.diffuse[2])
        texels = data.images[0]
        self.assertEqual(texels.pixels.dtype, np.uint8)
        self.assertTrue(texels.flags & library.SRGB)
        self.assertEqual(list(texels.pixels[1, 0]), [0, 0, 0])
        self.assertEqual(list(texels.pixels[0, 0]), [128, 64, 255])

    def test_a_non_color_image_is_linear_and_a_float_image_stays_float(self):
        m, _, _ = self.with_image(self.image(srgb=False))
        _, _, data = the_material(m)
        self.assertFalse(data.images[0].flags & library.SRGB)
        h.new_scene()
        image = bpy.data.images.new("hdr", 2, 2, float_buffer=True)
        image.pixels.foreach_set(np.full(16, 0.3, np.float32))
        m, _, _ = self.with_image(image)
        _, _, data = the_material(m)
        self.assertEqual(data.images[0].pixels.dtype, np.float32)
        self.assertAlmostEqual(float(data.images[0].pixels.max()), 0.3, places=5)

    def test_alpha_of_an_image_is_a_mask_of_one_channel(self):
        m, _, _ = self.with_image(self.image(), "Alpha", "Alpha")
        out, _, data = the_material(m)
        mask = data.images[out.opacity_texture - 1].pixels
        self.assertEqual(mask.shape[2], 1)
        self.assertEqual(mask[0, 0, 0], 102)

    def test_a_packed_image_renders_as_in_cycles(self):
        image = self.image(colour=(0.8, 0.3, 0.1, 1), width=8, height=8)
        image.pack()
        m = h.material("Flat")
        node = h.shader(m, "ShaderNodeBsdfDiffuse")
        texture = m.node_tree.nodes.new("ShaderNodeTexImage")
        texture.image, texture.interpolation = image, "Closest"
        m.node_tree.links.new(texture.outputs[0], node.inputs["Color"])
        plane = h.add_plane(3, material=m)
        layer = plane.data.uv_layers.new(name="Map")
        layer.data.foreach_set("uv", [0, 0, 1, 0, 1, 1, 0, 1])
        h.add_light("SUN", energy=3, angle=0.0)
        with h.quiet():
            h.set_cycles(16)
            cycles = h.radiance(h.render())
            h.set_lumicut(vpls=100, max_depth=0)
            ours = h.radiance(h.render())
        # Cycles' samples fall on several texels where ours, at the centre, falls on one.
        self.assertLess(np.median(np.abs(ours - cycles)[6:26, 6:26]), 0.002)
        self.assertLess(ours[27, 4].max(), 0.02)  # the black corner lies low and left

    def test_mapping_and_uv_maps_are_followed(self):
        image = self.image(width=16, height=16)
        pixels = np.ones((16, 16, 4), np.float32)
        pixels[..., 0], pixels[..., 1] = np.meshgrid(np.arange(16) / 15, np.arange(16) / 15)
        image.pixels.foreach_set(pixels.reshape(-1))
        m = h.material("Mapped")
        node = h.shader(m, "ShaderNodeBsdfDiffuse")
        texture, mapping, uv = (m.node_tree.nodes.new(k) for k in
                                ("ShaderNodeTexImage", "ShaderNodeMapping", "ShaderNodeUVMap"))
        texture.image, uv.uv_map = image, "Second"
        mapping.inputs["Scale"].default_value, mapping.inputs["Location"].default_value = (2, 1.5, 1), (0.2, 0.1, 0)
        mapping.inputs["Rotation"].default_value = (0, 0, 0.5)
        m.node_tree.links.new(uv.outputs[0], mapping.inputs[0])
        m.node_tree.links.new(mapping.outputs[0], texture.inputs[0])
        m.node_tree.links.new(texture.outputs[0], node.inputs["Color"])
        plane = h.add_plane(3, material=m)
        plane.data.uv_layers.new(name="First")
        second = plane.data.uv_layers.new(name="Second")
        second.data.foreach_set("uv", [0, 0, 1, 0, 1, 1, 0, 1])
        h.add_light("SUN", energy=3, angle=0.0)
        with h.quiet():
            h.set_cycles(64)
            cycles = h.radiance(h.render())
            h.set_lumicut("exhaustive", 16, vpls=100, max_depth=0)
            ours = h.radiance(h.render())
        # Where the picture repeats, a pixel holds both ends: means of blocks differ by the place of 16 samples.
        self.assertLess(np.abs(ours - cycles).mean(), 0.01)

    def test_colour_nodes_work_texel_by_texel_as_in_cycles(self):
        image = self.image(width=16, height=16, srgb=False)
        pixels = np.ones((16, 16, 4), np.float32)
        pixels[..., 0], pixels[..., 1] = np.meshgrid(np.arange(16) / 15, np.arange(16) / 15)
        pixels[..., 2] = 0.5
        image.pixels.foreach_set(pixels.reshape(-1))

        def chain(tree, socket):
            links = tree.links
            yield socket
            for kind, values in (("ShaderNodeHueSaturation", {"Hue": 0.6, "Saturation": 0.8, "Value": 0.9}),
                                 ("ShaderNodeBrightContrast", {"Bright": 0.1, "Contrast": 0.2}),
                                 ("ShaderNodeGamma", {"Gamma": 1.7}), ("ShaderNodeInvert", {"Fac": 0.7})):
                node = tree.nodes.new(kind)
                for name, value in values.items():
                    node.inputs[name].default_value = value
                links.new(socket, node.inputs["Color"])
                yield node.outputs[0]
            mix = tree.nodes.new("ShaderNodeMixRGB")
            mix.blend_type = "OVERLAY"
            mix.inputs[0].default_value, mix.inputs[2].default_value = 0.6, (0.3, 0.7, 0.2, 1)
            links.new(socket, mix.inputs[1])
            yield mix.outputs[0]
            ramp = tree.nodes.new("ShaderNodeValToRGB")
            ramp.color_ramp.elements[0].color, ramp.color_ramp.elements[1].color = (0.9, 0.1, 0.1, 1), (0.1, 0.2, 0.8, 1)
            links.new(socket, ramp.inputs[0])
            yield ramp.outputs[0]
            split, join = tree.nodes.new("ShaderNodeSeparateColor"), tree.nodes.new("ShaderNodeCombineColor")
            links.new(socket, split.inputs[0])
            for a, b in ((0, 1), (1, 2), (2, 0)):
                links.new(split.outputs[a], join.inputs[b])
            yield join.outputs[0]

        m = h.material("Chain")
        emission = h.shader(m, "ShaderNodeEmission")
        texture = m.node_tree.nodes.new("ShaderNodeTexImage")
        texture.image = image
        plane = h.add_plane(3, material=m)
        plane.data.uv_layers.new(name="Map").data.foreach_set("uv", [0, 0, 1, 0, 1, 1, 0, 1])
        for socket in chain(m.node_tree, texture.outputs[0]):
            with self.subTest(node=socket.node.bl_label), h.quiet():
                m.node_tree.links.new(socket, emission.inputs["Color"])
                h.set_cycles(16)
                cycles = h.radiance(h.render())
                h.set_lumicut("exhaustive", 16, vpls=100, max_depth=0)
                ours = h.radiance(h.render())
                # Nodes run on texels here and on filtered colours there: they differ by less than a step of the picture.
                inner = (slice(8, 24), slice(8, 24))
                self.assertLess(np.abs(ours - cycles)[inner].mean(), 0.02)

    def test_the_mix_node_of_many_types_blends_colours_and_numbers(self):
        m = h.material("Mixed")
        node = h.shader(m, "ShaderNodeBsdfDiffuse")
        mix = m.node_tree.nodes.new("ShaderNodeMix")
        mix.data_type, mix.blend_type = "RGBA", "ADD"
        values = {s.name: s for s in mix.inputs if s.enabled}
        values["Factor"].default_value = 0.5
        values["A"].default_value, values["B"].default_value = (0.1, 0.2, 0.3, 1), (0.4, 0.2, 0.0, 1)
        m.node_tree.links.new(next(s for s in mix.outputs if s.enabled), node.inputs["Color"])
        out, notes, _ = the_material(m)
        np.testing.assert_allclose(out.diffuse, (0.3, 0.3, 0.3), rtol=1e-5)
        self.assertEqual(notes, [])

    def test_groups_reroutes_and_muted_nodes_are_followed(self):
        group = bpy.data.node_groups.new("inner", "ShaderNodeTree")
        if hasattr(group, "interface"):
            group.interface.new_socket("Tint", in_out="INPUT", socket_type="NodeSocketColor")
            group.interface.new_socket("Out", in_out="OUTPUT", socket_type="NodeSocketColor")
        else:
            group.inputs.new("NodeSocketColor", "Tint")
            group.outputs.new("NodeSocketColor", "Out")
        into, out, mix = (group.nodes.new(k) for k in ("NodeGroupInput", "NodeGroupOutput", "ShaderNodeMixRGB"))
        mix.blend_type = "MULTIPLY"
        mix.inputs[0].default_value, mix.inputs[2].default_value = 1.0, (0.5, 0.5, 0.5, 1)
        group.links.new(into.outputs[0], mix.inputs[1])
        group.links.new(mix.outputs[0], out.inputs[0])
        m = h.material("Grouped")
        node = h.shader(m, "ShaderNodeBsdfDiffuse")
        outer, muted, reroute = (m.node_tree.nodes.new(k) for k in ("ShaderNodeGroup", "ShaderNodeGamma", "NodeReroute"))
        outer.node_tree = group
        outer.inputs[0].default_value = (0.8, 0.4, 0.2, 1)
        muted.mute = True
        muted.inputs[1].default_value = 3
        m.node_tree.links.new(outer.outputs[0], muted.inputs[0])
        m.node_tree.links.new(muted.outputs[0], reroute.inputs[0])
        m.node_tree.links.new(reroute.outputs[0], node.inputs["Color"])
        out, notes, _ = the_material(m)
        np.testing.assert_allclose(out.diffuse, (0.4, 0.2, 0.1), rtol=1e-5)
        self.assertEqual(notes, [])

    def test_cut_outs_by_a_mixed_transparent_shader(self):
        m = h.material("Leaf")
        mix = h.shader(m, "ShaderNodeMixShader")
        clear, leaf, texture = (m.node_tree.nodes.new(k) for k in
                                ("ShaderNodeBsdfTransparent", "ShaderNodeBsdfDiffuse", "ShaderNodeTexImage"))
        texture.image = self.image()
        leaf.inputs["Color"].default_value = (0.1, 0.6, 0.1, 1)
        m.node_tree.links.new(texture.outputs["Alpha"], mix.inputs[0])
        m.node_tree.links.new(clear.outputs[0], mix.inputs[1])
        m.node_tree.links.new(leaf.outputs[0], mix.inputs[2])
        out, _, data = the_material(m)
        np.testing.assert_allclose(out.diffuse, (0.1, 0.6, 0.1), rtol=1e-6)
        self.assertGreater(out.opacity_texture, 0)
        self.assertEqual(data.images[out.opacity_texture - 1].pixels.shape[2], 1)

    def test_what_is_not_followed_is_named(self):
        m, node = self.principled()
        occlusion, bump = m.node_tree.nodes.new("ShaderNodeAmbientOcclusion"), m.node_tree.nodes.new("ShaderNodeBump")
        m.node_tree.links.new(occlusion.outputs["Color"], node.inputs["Base Color"])
        m.node_tree.links.new(m.node_tree.nodes.new("ShaderNodeWireframe").outputs[0], bump.inputs["Height"])
        m.node_tree.links.new(bump.outputs[0], node.inputs["Normal"])
        sheen = node.inputs.get("Sheen") or node.inputs.get("Sheen Weight")
        sheen.default_value = 0.5
        glass = h.material("Pane")
        h.shader(glass, "ShaderNodeBsdfGlass")
        h.add_sphere(segments=8, name="Body").data.materials.append(glass)
        out, notes, _ = the_material(m)
        text = "\n".join(notes)
        for words in ("Ambient Occlusion", "Normal and bump maps left out: Stuff (Wireframe)", "sheen", "Pane", "Glass"):
            self.assertIn(words, text)
        self.assertEqual(len(notes), len(set(notes)), "each once")

    def test_emission_below_0_and_transparent_glass_of_films_are_named(self):
        m = h.material("Dark")
        h.shader(m, "ShaderNodeEmission", Strength=-1.0)
        h.add_plane(material=m)
        scene = bpy.context.scene
        scene.render.film_transparent = scene.cycles.film_transparent_glass = True
        with h.quiet():
            h.set_lumicut(vpls=10)
            h.render()
        text = "\n".join(h.last_notes())
        self.assertIn("Emission below 0 left out: Dark", text)
        self.assertIn("Transparent glass of the film left out", text)

    def test_missing_images_and_loops_do_not_stop_a_render(self):
        m, node, texture = self.with_image(None)
        missing = bpy.data.images.new("gone", 1, 1)
        missing.source, missing.filepath = "FILE", "//nowhere.png"
        other, _, texture = self.with_image(missing)
        h.add_plane(material=other, name="Other")
        h.add_plane(material=m)
        with h.quiet():
            h.set_lumicut(vpls=100)
            h.render()
        text = "\n".join(h.last_notes())
        self.assertIn("gone", text)
        self.assertIn("without an image", text)


class Speed(unittest.TestCase):
    def test_a_million_triangles_and_500_instances_are_not_read_one_by_one(self):
        """Counts, not seconds: foreach_get is called a few times a mesh, and each mesh is read once."""
        h.new_scene()
        ball = h.add_sphere(0.2, segments=32)
        for i in range(500):
            copy = h.link(bpy.data.objects.new("copy", ball.data))
            copy.location = (i % 25, i // 25, 0)
        calls = []
        original = collect.fetch
        collect.fetch = lambda *a: calls.append(a[1]) or original(*a)
        try:
            data, _ = collected()
        finally:
            collect.fetch = original
        self.assertEqual(len(data.meshes), 1)
        self.assertLess(len(calls), 10)


if __name__ == "__main__":
    unittest.main()
