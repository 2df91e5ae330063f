"""Texture programs beside Cycles: each node's outputs as emission, at the centres of pixels, with random parameters.

Both pictures sample the centre of each pixel, so that they show the same places: what differs is the node's function.
"""
import random
import unittest

import bpy
import numpy as np

import helpers as h

SIZE = 16  # pixels along an edge: 256 places
SEAMS = 0.02  # of places, next to a border of the grid


def any_input(node, name):
    """Also one that the node's settings hide, which later Blenders do not find by name."""
    return next(socket for socket in node.inputs if socket.name == name)


class Board(unittest.TestCase):
    """A tilted square that shows one socket as emission."""

    def setUp(self):
        self.case, self.wrong = "", []
        self.board()

    def tearDown(self):
        self.assertEqual(self.wrong, [])

    def board(self):
        self.scene = h.new_scene(SIZE, SIZE)
        self.scene.camera.data.type, self.scene.camera.data.ortho_scale = "ORTHO", 2
        self.m = h.material("Board")
        self.ob = h.add_plane(4, material=self.m, name="Board")
        self.ob.rotation_euler, self.ob.location = (0.3, -0.2, 0.1), (0.1, 0.2, -0.3)
        self.ob.data.uv_layers.new(name="Map").data.foreach_set("uv", [0, 0, 1, 0, 1, 1, 0, 1])
        self.out = next(n for n in self.m.node_tree.nodes if n.type == "OUTPUT_MATERIAL")
        self.random = random.Random(7)

    def node(self, kind, settings=None, **links):
        node = self.m.node_tree.nodes.new("ShaderNode" + kind)
        for name, value in (settings or {}).items():
            setattr(node, name, value)
        for name, value in links.items():
            socket = next(s for s in node.inputs if s.name == name.replace("_", " ") and s.enabled)
            if hasattr(value, "is_linked"):
                self.link(value, socket)
            else:
                try:
                    socket.default_value = value
                except (TypeError, ValueError):
                    socket.default_value = (*value, 1)
        return node

    def link(self, output, socket):
        self.m.node_tree.links.new(output, socket)

    def both(self):
        """(ours, Cycles'), one sample in the middle of each pixel."""
        with h.quiet():
            h.set_lumicut("exhaustive", samples=1, vpls=10)
            ours = h.radiance(h.render())
            h.set_cycles(1, 0)
            self.scene.cycles.pixel_filter_type, self.scene.cycles.filter_width = "BOX", 0.01
            theirs = h.radiance(h.render())
        return ours, theirs

    def show(self, output):
        """Both pictures of an output, shifted and scaled so that negative values show."""
        shown = self.node("VectorMath", {"operation": "MULTIPLY_ADD"})
        self.link(output, shown.inputs[0])
        shown.inputs[1].default_value, shown.inputs[2].default_value = (0.125,) * 3, (2,) * 3
        emission = self.node("Emission")
        self.link(shown.outputs[0], emission.inputs["Color"])
        self.link(emission.outputs[0], self.out.inputs["Surface"])
        ours, theirs = self.both()
        return (ours - 2) * 8, (theirs - 2) * 8

    def compare(self, output, most=SEAMS, tolerance=1e-3, name=""):
        """`most`: share of places that may differ: those on a border of the grid, or of a function's steps."""
        ours, theirs = self.show(output)
        notes = h.last_notes()
        name = f"{self.case} {name}"
        if any("constant" in n for n in notes):
            self.wrong.append(f"{name}: {notes}")
        scale = np.maximum(1, np.abs(theirs))
        apart = (np.abs(ours - theirs) / scale).max(-1)
        if not np.ptp(theirs) > 0.01:
            self.wrong.append(f"{name}: shows nothing")
        share = (apart > tolerance).mean()
        if share > most:
            self.wrong.append(f"{name}: {share:.3f} of places differ, by up to {apart.max():.4f}, {np.median(apart):.5f} in the middle")

    def coordinates(self, output="Object"):
        """Places of a grid, each about a pixel wide, with a third dimension: Cycles' samples lie off the pixels' centres by
        up to 1/200 of a pixel, which steep functions would show."""
        grid = self.node("VectorMath", {"operation": "SNAP"})
        lifted = self.node("VectorMath", {"operation": "ADD"})  # the board lies on a border
        self.link(self.node("TexCoord").outputs[output], lifted.inputs[0])
        lifted.inputs[1].default_value = (0.005, 0.007, 0.05)
        self.link(lifted.outputs[0], grid.inputs[0])
        grid.inputs[1].default_value = (0.131, 0.137, 0.113)
        turned = self.node("VectorRotate", {"rotation_type": "AXIS_ANGLE"}, Angle=0.4)
        turned.inputs["Axis"].default_value = (1, 0.7, 0.2)
        self.link(grid.outputs[0], turned.inputs["Vector"])
        moved = self.node("VectorMath", {"operation": "ADD"})
        self.link(turned.outputs[0], moved.inputs[0])
        moved.inputs[1].default_value = (0.013, 0.027, 0.231)
        return moved.outputs[0]

    def number(self, low, high):
        return self.random.uniform(low, high)

    def each(self, cases):
        """Each of the cases, on a fresh board."""
        for case in cases:
            self.board()
            self.case, self.random = case, random.Random(str(case))
            yield case


class Inputs(Board):
    def test_texture_coordinates(self):
        for name in self.each(["Generated", "Normal", "UV", "Object", "Camera", "Window", "Reflection"]):
            self.ob.data.polygons[0].use_smooth = True
            output = self.node("TexCoord").outputs[name]
            if name in ("Normal", "Reflection"):  # the same everywhere: a ball shows it
                self.ob.hide_render = True
                ball = h.add_sphere(0.9, (0.1, 0, 0), self.m, 32)
                ball.rotation_euler = (0.4, 0.2, 0)
                ball.scale = (1, 0.9, 1.1)
            self.compare(output, name=name)

    def test_coordinates_of_another_object(self):
        other = h.link(bpy.data.objects.new("other", None))
        other.location, other.rotation_euler, other.scale = (0.3, -0.4, 1), (0.4, 0.5, -1), (2, 0.5, 1)
        self.compare(self.node("TexCoord", {"object": other}).outputs["Object"])

    def test_geometry_and_camera(self):
        cases = [("NewGeometry", n) for n in ("Position", "Normal", "True Normal", "Incoming")]
        for kind, name in self.each(cases + [("CameraData", n) for n in ("View Vector", "View Z Depth", "View Distance")]):
            if name in ("Normal", "True Normal", "Incoming"):
                self.scene.camera.data.type = "PERSP"
                self.ob.hide_render = True
                h.add_sphere(1.4, (0.1, 0, 0), self.m, 32).rotation_euler = (0.4, 0.2, 0)
            self.compare(self.node(kind).outputs[name], name=name)

    def test_object_info_tells_objects_apart(self):
        for name in self.each(["Location", "Color", "Object Index", "Material Index", "Random"]):
            self.ob.hide_render = True
            for i in range(4):
                ob = h.add_plane(0.9, material=self.m, name=f"leaf {i}")
                ob.location, ob.pass_index = ((i % 2) - 0.5, (i // 2) - 0.5, 0.1 * i), i
                ob.color = (0.1 * i, 0.5, 1 - 0.2 * i, 1)
            self.m.pass_index = 3
            output = self.node("ObjectInfo").outputs[name]
            if name == "Material Index":  # one number: beside another
                output = self.node("Math", {"operation": "MULTIPLY"}, Value=output).outputs[0]
                self.link(self.node("ObjectInfo").outputs["Object Index"], output.node.inputs[1])
            self.compare(output, name=name)

    def test_objects_of_one_mesh_are_told_apart(self):
        self.ob.hide_render = True
        leaf = h.add_plane(0.9, material=self.m, name="leaf")
        leaf.location = (-0.5, -0.5, 0)
        for i in range(1, 4):
            ob = h.link(bpy.data.objects.new(f"leaf {i}", leaf.data))
            ob.location, ob.scale = ((i % 2) - 0.5, (i // 2) - 0.5, 0.1 * i), (1, -0.5, 1)
        both = self.node("VectorMath", {"operation": "ADD"})
        self.link(self.node("ObjectInfo").outputs["Random"], both.inputs[0])
        self.link(self.coordinates(), both.inputs[1])
        self.compare(both.outputs[0])

    def test_islands_have_numbers_of_their_own(self):
        self.ob.hide_render = True
        places = [(x + dx, y + dy, 0) for x in (-0.9, 0.1) for y in (-0.9, 0.1) for dx, dy in ((0, 0), (0.8, 0), (0.8, 0.8), (0, 0.8))]
        h.add_mesh("islands", places, [tuple(range(4 * i, 4 * i + 4)) for i in range(4)], self.m)
        self.compare(self.node("NewGeometry").outputs["Random Per Island"])

    def test_attributes_of_every_domain(self):
        kinds = [(t, d) for t in ("FLOAT", "FLOAT_VECTOR", "FLOAT_COLOR", "BYTE_COLOR", "INT") for d in ("POINT", "CORNER", "FACE")
                 if not (t == "BYTE_COLOR" and d == "FACE") and not (t == "FLOAT_COLOR" and d == "FACE")]
        for kind, domain in self.each(kinds):
            self.ob.hide_render = True
            grid = h.add_mesh("grid", [(x, y, 0) for y in (-1, 0, 1) for x in (-1, 0, 1)],
                              [(0, 1, 4, 3), (1, 2, 5, 4), (3, 4, 7, 6), (4, 5, 8, 7)], self.m)
            attribute = grid.data.attributes.new("stuff", kind, domain)
            field, width = {"FLOAT": ("value", 1), "INT": ("value", 1), "FLOAT_VECTOR": ("vector", 3)}.get(kind, ("color", 4))
            numbers = [self.number(0, 1) if kind != "INT" else self.random.randint(0, 5) for _ in range(width * len(attribute.data))]
            attribute.data.foreach_set(field, numbers)
            for output in ("Color", "Vector", "Fac"):
                self.compare(self.node("Attribute", {"attribute_name": "stuff"}).outputs[output], name=output)

    def test_custom_properties_of_objects(self):
        self.ob["glow"] = 0.37
        node = self.node("Attribute", {"attribute_type": "OBJECT", "attribute_name": "glow"})
        product = self.node("VectorMath", {"operation": "MULTIPLY"})
        self.link(node.outputs["Fac"], product.inputs[0])
        self.link(self.coordinates(), product.inputs[1])
        self.compare(product.outputs[0])

    def made_by_collection(self):
        tiles = bpy.data.collections.new("Tiles")
        tiles.objects.link(self.ob)
        self.scene.collection.objects.unlink(self.ob)
        for place, tone in ((-0.6, (0.9, 0.3, 0.1)), (0.6, (0.1, 0.7, 0.4))):
            maker = h.link(bpy.data.objects.new("maker", None))
            maker.instance_type, maker.instance_collection = "COLLECTION", tiles
            maker.location.x, maker.scale = place, (0.2, 0.2, 0.2)
            maker["tone"] = tone

    def made_by_vertices(self):
        maker = h.add_plane(1, name="maker")
        maker["tone"], maker.data["glow"] = (0.9, 0.3, 0.1), 0.9  # of which Cycles does not ask the mesh
        maker.instance_type = "VERTS"
        self.ob.parent, self.ob.scale = maker, (0.1, 0.1, 0.1)

    def test_custom_properties_of_what_makes_instances(self):
        """Of the object itself where that has none, and of objects that nothing makes."""
        for make, kind, name in self.each([(make, kind, name)
                                           for make in (None, self.made_by_collection, self.made_by_vertices)
                                           for kind in ("INSTANCER", "OBJECT")
                                           for name in (("tone", "glow") if make else ("tone",))]):
            self.ob["tone"], self.ob["glow"] = (0.2, 0.3, 0.8), 0.37
            if make is not None:
                make()
            self.compare(self.node("Attribute", {"attribute_type": kind, "attribute_name": name}).outputs["Color"])

    def test_fresnel_and_layer_weight_with_normals(self):
        for kind, name, socket, value in self.each([("Fresnel", 0, "IOR", 1.4), ("LayerWeight", "Fresnel", "Blend", 0.3),
                                                    ("LayerWeight", "Facing", "Blend", 0.7)]):
            self.scene.camera.data.type = "PERSP"
            self.ob.hide_render = True
            h.add_sphere(1.4, (0.1, 0, 0), self.m, 32)
            node = self.node(kind, **{socket: value})
            turned = self.node("VectorMath", {"operation": "NORMALIZE"})
            tilted = self.node("VectorMath", {"operation": "ADD"})
            self.link(self.node("NewGeometry").outputs["Normal"], tilted.inputs[0])
            tilted.inputs[1].default_value = (0.2, 0, 0.1)
            self.link(tilted.outputs[0], turned.inputs[0])
            self.link(turned.outputs[0], node.inputs["Normal"])
            self.compare(node.outputs[name], name=name)


    def test_emission_that_depends_on_the_view(self):
        self.scene.camera.data.type = "PERSP"
        self.ob.hide_render = True
        h.add_sphere(1.4, (0.1, 0, 0), self.m, 32)
        self.compare(self.node("LayerWeight", Blend=0.4).outputs["Facing"], name="plain")
        emission = self.node("Emission", Color=self.node("Fresnel", IOR=1.6).outputs[0], Strength=3.0)
        self.link(emission.outputs[0], self.out.inputs["Surface"])
        ours, theirs = self.both()
        # From a table of 64 entries, linear between them.
        self.assertLess(np.abs(ours - theirs).max(), 0.05)


class Normals(Board):
    """Slopes are taken over a two-thousandth of the distance here, and over a pixel in Cycles: small pieces are shown."""

    def pieces(self, fn):
        """fn's output seen in small views here and there."""
        for place in self.each([(0, 0), (0.5, -0.4), (-0.7, 0.2), (0.3, 0.6), (-0.4, -0.8)]):
            self.scene.camera.location.x, self.scene.camera.location.y = place
            self.scene.camera.data.ortho_scale = 0.08
            self.compare(fn(), tolerance=0.01)

    def height(self, scale):
        return self.node("TexNoise", Scale=scale, Detail=0.0, Vector=self.node("TexCoord").outputs["Object"]).outputs["Fac"]

    def test_bumps_of_any_height(self):
        for invert in (False, True):
            self.pieces(lambda invert=invert: self.node("Bump", {"invert": invert}, Height=self.height(0.8), Strength=0.7, Distance=0.8).outputs[0])

    def test_bumps_upon_bumps(self):
        def second():
            first = self.node("Bump", Height=self.height(0.6), Strength=0.9, Distance=0.6)
            return self.node("Bump", Height=self.height(0.9), Strength=0.6, Distance=0.5, Normal=first.outputs[0]).outputs[0]

        self.pieces(second)

    def test_normal_maps_of_every_space(self):
        for space in self.each(["TANGENT", "OBJECT", "WORLD", "BLENDER_OBJECT", "BLENDER_WORLD"]):
            colour = self.node("CombineColor")
            for k in range(3):
                self.link(self.node("MapRange", Value=self.node("SeparateXYZ", Vector=self.coordinates()).outputs[k % 2]).outputs[0], colour.inputs[k])
                colour.inputs[k].links[0].from_node.inputs["From Min"].default_value = -2
                colour.inputs[k].links[0].from_node.inputs["To Min"].default_value = 0.55 if k == 2 else 0.2
            self.compare(self.node("NormalMap", {"space": space}, Color=colour.outputs[0], Strength=0.8).outputs[0])


class Textures(Board):
    def test_noise(self):
        for dimensions in self.each(["1D", "2D", "3D", "4D"]):
            for output in ("Fac", "Color"):
                node = self.node("TexNoise", {"noise_dimensions": dimensions}, Scale=self.number(1, 5), Detail=self.number(0, 6),
                                 Roughness=self.number(0, 1), Distortion=self.number(0, 2))
                self.place(node)
                self.compare(node.outputs[output], name=output)

    def place(self, node):
        """Links places, and a number that varies with them."""
        if node.inputs.get("Vector") is not None and node.inputs["Vector"].enabled:
            self.link(self.coordinates(), node.inputs["Vector"])
        if node.inputs.get("W") is not None and node.inputs["W"].enabled:
            self.link(self.node("SeparateXYZ", Vector=self.coordinates()).outputs[1], node.inputs["W"])

    @unittest.skipIf(bpy.app.version >= (4, 1, 0), "part of Noise there")
    def test_musgrave(self):
        for kind, dimensions in self.each([(k, d) for k in ("FBM", "MULTIFRACTAL", "HYBRID_MULTIFRACTAL", "RIDGED_MULTIFRACTAL", "HETERO_TERRAIN")
                                           for d in ("1D", "2D", "3D", "4D")]):
            names = {n: self.number(a, b) for n, a, b in (("Scale", 1, 5), ("Detail", 0, 6), ("Dimension", 0.2, 2), ("Lacunarity", 1.5, 3),
                                                          ("Offset", 0, 1), ("Gain", 0.5, 3))}
            node = self.node("TexMusgrave", {"musgrave_type": kind, "musgrave_dimensions": dimensions})
            for name, value in names.items():
                node.inputs[name].default_value = value
            self.place(node)
            self.compare(node.outputs[0])

    def test_voronoi(self):
        cases = [(f, d, "EUCLIDEAN") for f in ("F1", "F2", "SMOOTH_F1", "DISTANCE_TO_EDGE", "N_SPHERE_RADIUS") for d in ("1D", "2D", "3D", "4D")]
        cases += [("F1", "3D", m) for m in ("MANHATTAN", "CHEBYCHEV", "MINKOWSKI")] + [("SMOOTH_F1", "2D", "MINKOWSKI")]
        for feature, dimensions, metric in self.each(cases):
            node = self.node("TexVoronoi", {"feature": feature, "voronoi_dimensions": dimensions})
            if metric != "EUCLIDEAN":
                node.distance = metric
            for name, a, b in (("Scale", 1, 5), ("Smoothness", 0.1, 1), ("Exponent", 0.5, 3), ("Randomness", 0.3, 1)):
                any_input(node, name).default_value = self.number(a, b)
            self.place(node)
            for output in node.outputs:
                if output.enabled:
                    # Cells end with a step.
                    self.compare(output, name=output.name)

    @unittest.skipIf(bpy.app.version < (4, 0, 0), "Voronoi has no octaves there")
    def test_voronoi_octaves(self):
        cases = [(f, d, "EUCLIDEAN") for f in ("F1", "F2", "SMOOTH_F1", "DISTANCE_TO_EDGE") for d in ("1D", "2D", "3D", "4D")]
        cases += [("F1", "3D", m) for m in ("MANHATTAN", "CHEBYCHEV", "MINKOWSKI")]
        for feature, dimensions, metric in self.each(cases):
            for normalize in (False, True):
                node = self.node("TexVoronoi", {"feature": feature, "voronoi_dimensions": dimensions, "normalize": normalize})
                if metric != "EUCLIDEAN":
                    node.distance = metric
                for name, a, b in (("Scale", 1, 3), ("Detail", 0, 4), ("Roughness", 0, 1), ("Lacunarity", 1.5, 3), ("Smoothness", 0.1, 1),
                                   ("Exponent", 0.5, 3), ("Randomness", 0.3, 1)):
                    any_input(node, name).default_value = self.number(a, b)
                self.place(node)
                for output in node.outputs:
                    if output.enabled:
                        self.compare(output, name=f"{output.name} {normalize}")

    def test_wave(self):
        cases = [("BANDS", "bands_direction", d) for d in ("X", "Y", "Z", "DIAGONAL")]
        cases += [("RINGS", "rings_direction", d) for d in ("X", "Y", "Z", "SPHERICAL")]
        for kind, key, direction in self.each(cases):
            for profile in ("SIN", "SAW", "TRI"):
                node = self.node("TexWave", {"wave_type": kind, key: direction, "wave_profile": profile},
                                 **{"Scale": self.number(0.5, 2), "Distortion": self.number(0, 3), "Detail": self.number(0, 3),
                                    "Detail_Scale": self.number(0.5, 2), "Detail_Roughness": self.number(0, 1), "Phase_Offset": self.number(0, 3)})
                self.place(node)
                self.compare(node.outputs["Fac"], name=profile)

    def test_magic(self):
        for depth in self.each(range(11)):
            node = self.node("TexMagic", {"turbulence_depth": depth}, Scale=self.number(0.5, 3), Distortion=self.number(0.2, 2))
            self.place(node)
            self.compare(node.outputs["Color"], name="Color")
            self.compare(node.outputs["Fac"], name="Fac")

    def test_brick(self):
        for case in self.each(range(4)):
            node = self.node("TexBrick", {"offset": self.number(0, 1), "squash": self.number(0.5, 2), "offset_frequency": 1 + case, "squash_frequency": 4 - case},
                             Color1=(0.9, 0.2, 0.1), Color2=(0.1, 0.3, 0.8), Mortar=(0.4, 0.4, 0.3), Scale=self.number(2, 5))
            for name, a, b in (("Mortar Size", 0.01, 0.1), ("Mortar Smooth", 0, 1), ("Bias", -0.5, 0.5), ("Brick Width", 0.3, 0.8), ("Row Height", 0.2, 0.5)):
                any_input(node, name).default_value = self.number(a, b)
            self.place(node)
            for output in ("Color", "Fac"):
                self.compare(node.outputs[output], name=output)

    def test_checker(self):
        node = self.node("TexChecker", Color1=(0.9, 0.2, 0.1), Color2=(0.1, 0.3, 0.8), Scale=3.3)
        self.place(node)
        self.compare(node.outputs["Color"])
        self.compare(node.outputs["Fac"])

    def test_gradient(self):
        for kind in self.each(["LINEAR", "QUADRATIC", "EASING", "DIAGONAL", "SPHERICAL", "QUADRATIC_SPHERE", "RADIAL"]):
            node = self.node("TexGradient", {"gradient_type": kind})
            self.place(node)
            self.compare(node.outputs["Color"])

    def test_white_noise(self):
        for dimensions in self.each(["1D", "2D", "3D", "4D"]):
            node = self.node("TexWhiteNoise", {"noise_dimensions": dimensions})
            # Of whole numbers: the last bits of places differ.
            cells = self.node("VectorMath", {"operation": "FLOOR"})
            scaled = self.node("VectorMath", {"operation": "SCALE"}, Scale=4.0)
            self.link(self.coordinates(), scaled.inputs[0])
            self.link(scaled.outputs[0], cells.inputs[0])
            if dimensions != "1D":
                self.link(cells.outputs[0], node.inputs["Vector"])
            if dimensions in ("1D", "4D"):
                self.link(self.node("SeparateXYZ", Vector=cells.outputs[0]).outputs[0], node.inputs["W"])
            for output in ("Value", "Color"):
                self.compare(node.outputs[output], name=output)

    def picture(self):
        y, x = np.mgrid[0:8, 0:8] / 7
        image = bpy.data.images.new("ramp", 8, 8, float_buffer=True)
        image.colorspace_settings.name = "Non-Color"
        image.pixels.foreach_set(np.stack([x, y, 0.5 + 0 * x, 1 + 0 * x], -1).astype(np.float32).ravel())
        image.update()
        image.pack()
        return image

    def test_images_on_any_coordinates(self):
        for projection, extension in self.each([(p, e) for p in ("FLAT", "BOX", "SPHERE", "TUBE") for e in ("REPEAT", "EXTEND", "CLIP")]):
            self.ob.hide_render = True
            h.add_sphere(0.9, (0.1, 0, 0), self.m, 32).rotation_euler = (0.4, 0.2, 0)
            node = self.node("TexImage", {"image": self.picture(), "projection": projection, "extension": extension})
            node.projection_blend = 0.3
            self.link(self.coordinates(), node.inputs["Vector"])
            self.compare(node.outputs["Color"])

    def test_environment_textures_on_surfaces(self):
        for projection in self.each(["EQUIRECTANGULAR", "MIRROR_BALL"]):
            node = self.node("TexEnvironment", {"image": self.picture(), "projection": projection})
            self.place(node)
            self.compare(node.outputs["Color"])


class Converters(Board):
    def test_math(self):
        operations = bpy.types.ShaderNodeMath.bl_rna.properties["operation"].enum_items.keys()
        for operation in self.each(operations):
            node = self.node("Math", {"operation": operation, "use_clamp": operation == "SUBTRACT"})
            parts = self.node("SeparateXYZ", Vector=self.coordinates())
            self.link(parts.outputs[0], node.inputs[0])
            node.inputs[1].default_value, node.inputs[2].default_value = self.number(0.2, 1), self.number(0.1, 0.5)
            small = self.node("Math", {"operation": "MULTIPLY"})  # degrees are many
            self.link(node.outputs[0], small.inputs[0])
            small.inputs[1].default_value = 0.1 if operation == "DEGREES" else 1
            self.compare(small.outputs[0])

    def test_vector_math(self):
        operations = bpy.types.ShaderNodeVectorMath.bl_rna.properties["operation"].enum_items.keys()
        for operation in self.each(operations):
            node = self.node("VectorMath", {"operation": operation})
            self.link(self.coordinates(), node.inputs[0])
            for k in (1, 2):
                node.inputs[k].default_value = [self.number(0.2, 1) for _ in range(3)]
            if operation in ("SCALE", "REFRACT"):
                node.inputs["Scale"].default_value = self.number(0.5, 0.9)
            if operation == "FACEFORWARD":
                self.link(self.coordinates(), node.inputs[2])
            self.compare(next(o for o in node.outputs if o.enabled))

    def colours(self):
        """A colour of each place, from 0 to 1."""
        node = self.node("MapRange", {"data_type": "FLOAT_VECTOR"})
        self.link(self.coordinates(), next(s for s in node.inputs if s.type == "VECTOR" and s.enabled))
        vectors = [s for s in node.inputs if s.type == "VECTOR" and s.enabled]
        vectors[1].default_value, vectors[2].default_value = (-1.5, -1.5, -0.6), (1.5, 1.5, 0.6)
        return next(o for o in node.outputs if o.enabled)

    def other_colours(self):
        node = self.node("VectorRotate", {"rotation_type": "AXIS_ANGLE"}, Angle=1.0)
        node.inputs["Center"].default_value, node.inputs["Axis"].default_value = (0.5, 0.5, 0.5), (1, 1, 1)
        self.link(self.colours(), node.inputs["Vector"])
        return node.outputs[0]

    def test_blends(self):
        modes = bpy.types.ShaderNodeMixRGB.bl_rna.properties["blend_type"].enum_items.keys()
        for mode in self.each(modes):
            node = self.node("MixRGB", {"blend_type": mode, "use_clamp": mode == "ADD"})
            node.inputs[0].default_value = self.number(0.3, 1)
            self.link(self.colours(), node.inputs[1])
            self.link(self.other_colours(), node.inputs[2])
            self.compare(node.outputs[0])

    def test_mix_of_every_type(self):
        for kind, mode in self.each([("FLOAT", "UNIFORM"), ("VECTOR", "UNIFORM"), ("VECTOR", "NON_UNIFORM"), ("RGBA", "UNIFORM")]):
            node = self.node("Mix", {"data_type": kind, "factor_mode": mode})
            sockets = {name: next(s for s in node.inputs if s.name == name and s.enabled) for name in ("Factor", "A", "B")}
            self.link(self.colours(), sockets["Factor"] if kind == "VECTOR" and mode != "UNIFORM" else sockets["A"])
            self.link(self.other_colours(), sockets["B"])
            if mode == "UNIFORM":
                sockets["Factor"].default_value = 0.3
            self.compare(next(o for o in node.outputs if o.enabled))

    def test_map_range(self):
        for kind, data in self.each([(k, d) for k in ("LINEAR", "STEPPED", "SMOOTHSTEP", "SMOOTHERSTEP") for d in ("FLOAT", "FLOAT_VECTOR")]):
            node = self.node("MapRange", {"interpolation_type": kind, "data_type": data, "clamp": True})
            wanted = "VALUE" if data == "FLOAT" else "VECTOR"
            sockets = [s for s in node.inputs if s.type == wanted and s.enabled]
            self.link(self.coordinates(), sockets[0])
            for s, v in zip(sockets[1:], (-0.7, 0.9, 0.2, 1.5, 4.0)):
                s.default_value = v if data == "FLOAT" else (v, v + 0.1, v - 0.05)
            self.compare(next(o for o in node.outputs if o.enabled))

    def test_mapping_and_rotation(self):
        for kind in self.each(["POINT", "TEXTURE", "VECTOR", "NORMAL"]):
            node = self.node("Mapping", {"vector_type": kind}, Vector=self.coordinates())
            for name in ("Location", "Rotation", "Scale"):
                if name in node.inputs:
                    node.inputs[name].default_value = [self.number(0.3, 2) for _ in range(3)]
            self.compare(node.outputs[0])
        for kind, invert in self.each([(k, i) for k in ("AXIS_ANGLE", "X_AXIS", "Y_AXIS", "Z_AXIS", "EULER_XYZ") for i in (False, True)]):
            node = self.node("VectorRotate", {"rotation_type": kind, "invert": invert}, Vector=self.coordinates())
            for name, value in (("Center", (0.1, 0.2, 0.3)), ("Axis", (1, 2, 0.5)), ("Angle", 0.7), ("Rotation", (0.3, -0.5, 0.8))):
                any_input(node, name).default_value = value
            self.compare(node.outputs[0])

    def test_vector_transforms_of_objects(self):
        for kind, way in self.each([(k, w) for k in ("POINT", "VECTOR", "NORMAL") for w in (("WORLD", "OBJECT"), ("OBJECT", "WORLD"))]):
            self.ob.scale = (1, 1.2, 1.5)
            node = self.node("VectorTransform", {"vector_type": kind, "convert_from": way[0], "convert_to": way[1]})
            self.link(self.coordinates(), node.inputs[0])
            self.compare(node.outputs[0])

    def test_colours_and_ramps(self):
        def curves(node, count):
            node.mapping.extend = "EXTRAPOLATED"
            for k in range(count):
                node.mapping.curves[k].points.new(0.3 + 0.1 * k, 0.6 - 0.1 * k)
            node.mapping.update()

        def ramp(node, interpolation):
            node.color_ramp.interpolation = interpolation
            node.color_ramp.elements.new(0.4).color = (0.9, 0.2, 0.1, 0.5)

        cases = {
            "HSV": lambda: self.node("HueSaturation", Hue=0.7, Saturation=1.3, Value=0.8, Fac=0.9, Color=self.colours()).outputs[0],
            "gamma": lambda: self.node("Gamma", Color=self.colours(), Gamma=1.7).outputs[0],
            "contrast": lambda: self.node("BrightContrast", Color=self.colours(), Bright=0.1, Contrast=0.5).outputs[0],
            "invert": lambda: self.node("Invert", Color=self.colours(), Fac=0.8).outputs[0],
            "grey": lambda: self.node("RGBToBW", Color=self.colours()).outputs[0],
            "clamp": lambda: self.node("Clamp", {"clamp_type": "RANGE"}, Value=self.colours(), Min=0.7, Max=0.3).outputs[0],
            **{f"separate {m}": lambda m=m: self.node("SeparateColor", {"mode": m}, Color=self.colours()).outputs[1] for m in ("RGB", "HSV", "HSL")},
            **{f"hue {m}": lambda m=m: self.node("SeparateColor", {"mode": m}, Color=self.colours()).outputs[0] for m in ("HSV", "HSL")},
        }

        def combined(mode):
            parts = self.node("SeparateColor", Color=self.colours())
            node = self.node("CombineColor", {"mode": mode})
            for k in range(3):
                self.link(parts.outputs[k], node.inputs[k])
            return node.outputs[0]

        def curved(kind, count):
            node = self.node(kind)
            curves(node, count)
            node.inputs[0].default_value = 0.8
            self.link(self.colours(), node.inputs[1])
            return node.outputs[0]

        def ramped(interpolation, output):
            node = self.node("ValToRGB")
            ramp(node, interpolation)
            self.link(self.colours(), node.inputs[0])
            return node.outputs[output]

        cases |= {f"combine {m}": lambda m=m: combined(m) for m in ("RGB", "HSV", "HSL")}
        cases |= {kind: lambda kind=kind, n=n: curved(kind, n) for kind, n in (("RGBCurve", 4), ("VectorCurve", 3), ("FloatCurve", 1))}
        cases |= {f"ramp {i} {o}": lambda i=i, o=o: ramped(i, o) for i in ("LINEAR", "CONSTANT", "EASE", "CARDINAL", "B_SPLINE") for o in ("Color", "Alpha")}
        for name in self.each(cases):
            self.compare(cases[name](), name=name)

    def test_groups_reroutes_and_muted_nodes(self):
        group = bpy.data.node_groups.new("inner", "ShaderNodeTree")
        if hasattr(group, "interface"):
            group.interface.new_socket("In", in_out="INPUT", socket_type="NodeSocketVector")
            group.interface.new_socket("Out", in_out="OUTPUT", socket_type="NodeSocketColor")
        else:
            group.inputs.new("NodeSocketVector", "In")
            group.outputs.new("NodeSocketColor", "Out")
        into, noise, out = (group.nodes.new(kind) for kind in ("NodeGroupInput", "ShaderNodeTexNoise", "NodeGroupOutput"))
        group.links.new(into.outputs[0], noise.inputs["Vector"])
        group.links.new(noise.outputs["Color"], out.inputs[0])
        used = self.node("Group", {"node_tree": group})
        reroute = self.m.node_tree.nodes.new("NodeReroute")
        muted = self.node("Invert")
        muted.mute = True
        self.link(self.coordinates(), used.inputs[0])
        self.link(used.outputs[0], reroute.inputs[0])
        self.link(reroute.outputs[0], muted.inputs["Color"])
        self.compare(muted.outputs[0])


class Shaders(Board):
    """Programs in what is not emission."""

    def test_a_mask_of_emission_lights_what_is_around_it(self):
        self.scene.camera.data.type, self.scene.camera.location = "PERSP", (0, 0, 4)
        self.ob.rotation_euler, self.ob.location = (0, 0, 0), (0, 0, 0)
        checker = self.node("TexChecker", Color1=(1, 1, 1), Color2=(0, 0, 0), Scale=2.0)
        self.link(self.coordinates(), checker.inputs["Vector"])
        mix, glow = self.node("MixShader"), self.node("Emission", Color=(1, 0.5, 0.2), Strength=4.0)
        self.link(checker.outputs["Fac"], mix.inputs[0])
        self.link(self.node("BsdfDiffuse", Color=(0, 0, 0)).outputs[0], mix.inputs[1])
        self.link(glow.outputs[0], mix.inputs[2])
        self.link(mix.outputs[0], self.out.inputs["Surface"])
        wall = h.add_plane(3, 0, h.diffuse((0.8, 0.8, 0.8), "Wall"), "Wall")
        wall.location, wall.rotation_euler = (1, 0, 1), (0, -1.2, 0)
        for integrator in ("exhaustive", "path_tracer"):
            with self.subTest(integrator):
                ours, theirs = self.lit(integrator)
                # 2 % of noise in Cycles, as much here.
                self.assertLess(abs(ours[:, 10:].mean() / theirs[:, 10:].mean() - 1), 0.05)

    def lit(self, integrator):
        with h.quiet():
            h.set_lumicut(integrator, samples=64, **({"vpls": 4000} if integrator == "exhaustive" else {}))
            ours = h.radiance(h.render())
            h.set_cycles(512, 1)
            theirs = h.radiance(h.render())
        return ours, theirs
