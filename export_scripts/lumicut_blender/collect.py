# SPDX-License-Identifier: Apache-2.0
"""Collects a dependency graph into scene_data.SceneData: meshes, instances, materials, lamps, world, camera.

Arrays are filled by foreach_get in the type that Blender stores, which is a memory copy. A mesh is converted once for
each set of materials; its instances are transforms.
"""
import bpy
import numpy as np

from . import lights, linking, mesh_attributes, program_values, programs, strands, worlds
from .lumicut import library
from .cameras import pixel_width, rows
from .images import srgb_to_linear
from .materials import Materials
from .report import Report
from .scene_data import Mesh, Owner, SceneData, flattened, is_flat

LIT_RAYS = ("diffuse", "glossy", "transmission")  # kinds that lamps and worlds are hidden from
LIT = sum(library.RAYS[ray] for ray in LIT_RAYS)
AS_MESH = {"CURVE", "FONT", "META", "SURFACE"}  # a MESH item follows for each
LEFT_OUT = {"VOLUME": "Volumes left out", "GPENCIL": "Grease pencil left out", "GREASEPENCIL": "Grease pencil left out"}


class Cancelled(Exception):
    """The user asked to stop while Python was at work."""


def fetch(collection, attribute, count, width, dtype):
    out = np.empty(count * width, dtype)
    collection.foreach_get(attribute, out)
    return out.reshape(count, width) if width > 1 else out


def is_one_layer(mesh):
    """Whether the faces look the same way on the whole: not the two sides of a slab without a rim."""
    count = len(mesh.polygons)
    areas = fetch(mesh.polygons, "area", count, 1, np.float32)
    normals = fetch(mesh.polygons, "normal", count, 3, np.float32)
    return bool(np.linalg.norm(areas @ normals) > 0.5 * areas.sum())


def corner_vertices(mesh, count):
    attribute = mesh.attributes.get(".corner_vert")
    if attribute is not None:  # 3.6 and later
        return fetch(attribute.data, "value", count, 1, np.int32)
    return fetch(mesh.loops, "vertex_index", count, 1, np.int32)


def vertex_positions(mesh):
    attribute = mesh.attributes.get("position")
    if attribute is not None:  # 3.5 and later
        return fetch(attribute.data, "vector", len(mesh.vertices), 3, np.float32)
    return fetch(mesh.vertices, "co", len(mesh.vertices), 3, np.float32)


def normals_of(mesh, corners):
    """("flat", None), ("vertex", (n, 3)) or ("corner", (loops, 3))."""
    vertices, loops, polygons = len(mesh.vertices), len(corners), len(mesh.polygons)
    if hasattr(mesh, "normals_domain"):  # 4.1 and later
        domain = mesh.normals_domain
        if domain == "FACE":
            return "flat", None
        if domain == "POINT":
            return "vertex", fetch(mesh.vertex_normals, "vector", vertices, 3, np.float32)
        return "corner", fetch(mesh.corner_normals, "vector", loops, 3, np.float32)
    if mesh.has_custom_normals or mesh.use_auto_smooth:
        mesh.calc_normals_split()
        return "corner", fetch(mesh.loops, "normal", loops, 3, np.float32)
    smooth = fetch(mesh.polygons, "use_smooth", polygons, 1, bool)
    if not smooth.any():
        return "flat", None
    of_vertices = fetch(mesh.vertices, "normal", vertices, 3, np.float32)
    if smooth.all():
        return "vertex", of_vertices
    of_polygons = fetch(mesh.polygons, "normal", polygons, 3, np.float32)
    counts = fetch(mesh.polygons, "loop_total", polygons, 1, np.int32)
    flat_corners = np.repeat(~smooth, counts)
    return "corner", np.where(flat_corners[:, None], np.repeat(of_polygons, counts, 0), of_vertices[corners])


class MeshReader:
    """One evaluated mesh to arrays. `numbers`: the materials of its slots, in order. `check` raises to stop."""

    def __init__(self, name, mesh, numbers, materials, report, check=lambda: None, displacements=(), instance=None):
        """`displacements`: of each slot, Materials.displacements or None; `instance`: where they are looked up."""
        self.name, self.mesh, self.numbers, self.materials, self.report = name, mesh, numbers, materials, report
        self.check, self.displacements, self.instance = check, displacements, instance

    def read(self):
        """scene_data.Mesh without instances, or None for one without faces."""
        mesh = self.mesh
        mesh.calc_loop_triangles()
        triangles = len(mesh.loop_triangles)
        if triangles == 0:
            return None
        loops = len(mesh.loops)
        self.check()
        corners = corner_vertices(mesh, loops)
        self.check()
        tri_corners = fetch(mesh.loop_triangles, "loops", triangles, 3, np.int32)
        self.check()
        positions = vertex_positions(mesh)
        self.check()
        kind, normals = normals_of(mesh, corners)
        self.check()
        slot_of_triangle = self._slots(triangles)
        numbers = np.array(self.numbers, np.uint32)
        used = np.unique(slot_of_triangle) if slot_of_triangle is not None else np.array([0])
        out = Mesh(self.name, positions, tri_corners)
        if slot_of_triangle is None or len(used) == 1:
            out.material = int(numbers[used[0]])
        else:
            out.materials = numbers[slot_of_triangle]
        uvs = self._uvs(loops, corners, positions, tri_corners, slot_of_triangle, used)
        self.check()
        attributes = self._attributes(loops, used)
        self.check()
        if any(self.displacements):
            positions, normals = self._displaced(corners, tri_corners, slot_of_triangle, positions, kind, normals, loops)
            out.positions = positions
        bad = ~np.isfinite(positions).all(1)
        if bad.any():
            self.report.note(self.name, "Vertices that are not finite, moved to the origin")
            positions[bad] = 0
        self.check()
        if uvs is None and kind != "corner" and all(domain == "vertex" for _, domain, _ in attributes):
            out.indices = corners[tri_corners]
            out.normals = normals
            out.attributes = [(number, library.OF_VERTICES, values) for number, _, values in attributes]
        else:  # a vertex for each corner of a face
            out.positions = positions[corners]
            out.uvs = uvs
            out.normals = normals[corners] if kind == "vertex" else normals
            out.attributes = [(number, library.OF_VERTICES, values[corners] if domain == "vertex" else values)
                              for number, domain, values in attributes]
        return out

    def _displaced(self, corners, tri_corners, slot_of_triangle, positions, kind, normals, loops):
        """Positions moved along their normals by the materials' heights, and the normals of that shape."""
        mesh, to_world = self.mesh, np.array(self.instance.matrix_world, np.float64)
        triangles = corners[tri_corners]
        of_vertices = fetch(mesh.vertices, "normal", len(positions), 3, np.float32)
        places = (positions @ to_world[:3, :3].T + to_world[:3, 3]).astype(np.float32)
        facing = of_vertices @ np.linalg.inv(to_world[:3, :3])
        facing = (facing / np.maximum(np.linalg.norm(facing, axis=1, keepdims=True), 1e-30)).astype(np.float32)
        reader = mesh_attributes.AttributeReader(mesh, fetch, lambda text: self.report.note(self.name, text), self.check)
        moved = positions.astype(np.float64)
        for slot, displacement in enumerate(self.displacements):
            at = np.unique(triangles if slot_of_triangle is None else triangles[slot_of_triangle == slot])
            if displacement is None or not len(at):
                continue
            height, of_world = displacement
            attributes = {}
            for name in dict.fromkeys(programs.program_of("height", height).attributes()) if not height.constant() else ():
                self.check()
                if name[0] in {"world_to_object", "object_to_world"}:
                    continue
                if name[0] in mesh_attributes.OF_INSTANCE:
                    attributes[name] = np.tile(mesh_attributes.of_instance(name, self.instance), (len(at), 1))
                elif (read := reader.read(name, self._layer, loops)) is not None:
                    domain, values = read
                    if domain == "corner":  # one of a vertex's, as Cycles takes one
                        of_corner = np.zeros((len(positions), values.shape[1]), np.float32)
                        of_corner[corners[::-1]] = values[::-1]
                        values = of_corner
                    attributes[name] = values[at]
            heights = program_values.numbers_at(height, places[at], facing[at], attributes, to_world).astype(np.float64)[:, None]
            step = of_vertices[at] * heights
            if of_world:
                step = (facing[at] * heights) @ np.linalg.inv(to_world[:3, :3]).T
            moved[at] += step
        moved = moved.astype(np.float32)
        self.check()
        if kind == "flat":
            return moved, normals
        p = moved[triangles].astype(np.float64)
        across = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
        across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-30)
        smooth = np.zeros((len(moved), 3))
        for k in range(3):  # by the angle of each corner
            a, b = p[:, (k + 1) % 3] - p[:, k], p[:, (k + 2) % 3] - p[:, k]
            cosine = (a * b).sum(1) / np.maximum(np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1), 1e-30)
            np.add.at(smooth, triangles[:, k], across * np.arccos(np.clip(cosine, -1, 1))[:, None])
        smooth = (smooth / np.maximum(np.linalg.norm(smooth, axis=1, keepdims=True), 1e-30)).astype(np.float32)
        if kind == "vertex":
            return moved, smooth
        flat = np.zeros((loops, 3), np.float32)
        flat[tri_corners.ravel()] = np.repeat(across, 3, 0)
        was_flat = fetch(mesh.polygons, "use_smooth", len(mesh.polygons), 1, bool)
        counts = fetch(mesh.polygons, "loop_total", len(mesh.polygons), 1, np.int32)
        return moved, np.where(np.repeat(~was_flat, counts)[:, None], flat, smooth[corners])

    def _attributes(self, loops, used):
        """(number, "vertex" or "corner", values) of all that the programs of its materials ask for and that the mesh has."""
        wanted = dict.fromkeys(name for slot in used for name in self.materials.converted[self.numbers[slot]].attributes())
        reader = mesh_attributes.AttributeReader(self.mesh, fetch, lambda text: self.report.note(self.name, text), self.check)
        found = []
        for name in wanted:
            if name[0] not in mesh_attributes.OF_INSTANCE:
                self.check()
                read = reader.read(name, self._layer, loops)
                if read is not None:
                    found.append((self.materials.attribute_number(name), *read))
        return found

    def uv_map(self):
        """(triangles, 3, 2) of the map that renders use."""
        corners = fetch(self.mesh.loop_triangles, "loops", len(self.mesh.loop_triangles), 3, np.int32)
        return self._layer("", len(self.mesh.loops))[corners]

    def _slots(self, triangles):
        """Slot of each triangle; None: all the first."""
        mesh, count = self.mesh, len(self.numbers)
        if count < 2:
            return None
        attribute = mesh.attributes.get("material_index")  # 3.5 and later; absent: all 0
        if attribute is not None and attribute.domain == "FACE":
            of_polygon = fetch(attribute.data, "value", len(mesh.polygons), 1, np.int32)
        elif bpy.app.version >= (3, 5, 0):
            return None
        else:
            of_polygon = fetch(mesh.polygons, "material_index", len(mesh.polygons), 1, np.int32)
        if not of_polygon.any():
            return None
        if hasattr(mesh, "loop_triangle_polygons"):  # 4.1 and later
            polygon = fetch(mesh.loop_triangle_polygons, "value", triangles, 1, np.int32)
        else:
            polygon = fetch(mesh.loop_triangles, "polygon_index", triangles, 1, np.int32)
        return np.clip(of_polygon, 0, count - 1)[polygon]

    def _layer(self, name, loops):
        layers = self.mesh.uv_layers
        layer = layers.get(name) if name else next((l for l in layers if l.active_render), layers.active)
        if layer is None:
            self.report.note(self.name, f"Meshes without the UV map \"{name}\" that a texture wants"
                             if name else "Meshes without UV maps, under textures")
            return np.zeros((loops, 2), np.float32)
        if hasattr(layer, "uv"):  # 3.5 and later
            return fetch(layer.uv, "vector", loops, 2, np.float32)
        return fetch(layer.data, "uv", loops, 2, np.float32)

    def _uvs(self, loops, corners, positions, tri_corners, slot_of_triangle, used):
        """Texture coordinates a corner, each under the mapping of its face's material; None: no textures."""
        wanted = {}
        for slot in used:
            converted = self.materials.converted[self.numbers[slot]]
            if converted.plain_pictures():
                wanted.setdefault(converted.mapping, []).append(slot)
        if not wanted:
            return None
        out = np.zeros((loops, 2), np.float32)
        for mapping, slots in wanted.items():
            if mapping.source == "UV":
                base = self._layer(mapping.uv_map, loops)
            else:  # Generated: the bounding box, from 0 to 1
                low, high = positions.min(0), positions.max(0)
                base = ((positions - low) / np.where(high > low, high - low, 1))[corners][:, :2]
            m = np.array(mapping.matrix, np.float32)
            if not mapping.is_plain():
                base = base @ m[:, :2].T + m[:, 2]
            if len(wanted) == 1 or slot_of_triangle is None:
                return np.ascontiguousarray(base, np.float32)
            at = tri_corners[np.isin(slot_of_triangle, slots)].reshape(-1)
            out[at] = base[at]
        return out


class MeshCache:
    """Converted meshes between two updates of a viewport, so that moving one object does not read all again."""

    def __init__(self):
        self.meshes = {}  # key -> Mesh without instances

    def forget(self, names):
        self.meshes = {key: mesh for key, mesh in self.meshes.items() if not names & key[2]}


class Collector:
    def __init__(self, depsgraph, report=None, check=lambda: None, cache=None, images=None, max_shininess=1000.0, bake=None,
                 hits=False, uv_maps=False, aov=None):
        """`check` is called between meshes and instances and raises to stop. `bake`: sky.bake or the like, for worlds
        that cannot be read. `hits`, `uv_maps`: whether passes ask whose a hit is, and where on the UV map it lies. `aov`: (name, type) of an
        output whose values materials emit, in place of what they are."""
        self.hits, self.uv_maps, self._owners = hits, uv_maps, {}
        self.depsgraph, self.check, self.cache, self.bake = depsgraph, check, cache, bake
        self.report = report if report is not None else Report()
        self.materials = Materials(self.report, max_shininess, images, check)
        render = depsgraph.scene_eval.render
        self.materials.aspect = (render.resolution_x * render.pixel_aspect_x) / max(1e-9, render.resolution_y * render.pixel_aspect_y)
        self.materials.pixel = pixel_width(depsgraph.scene_eval.camera, render)
        self.materials.aov = aov
        self.materials.images.frame = depsgraph.scene_eval.frame_current
        self.scene = SceneData()
        self.profiles = lights.Profiles(self.report)
        self._meshes, self._flat = {}, []  # by what they are made from; those of flat instances
        self._shapes = {}  # lists of meshes of hair, curves and points, likewise
        self._looked_at = set()
        self._sheets = {}  # by mesh: whether it is open, one layer, and its extents
        self.instances = 0
        self.linking = linking.Linking(depsgraph, self.report)
        # Light groups by name: 0 holds all that is in none.
        names = getattr(depsgraph.view_layer_eval, "lightgroups", ())
        self.groups = {group.name: 1 + i for i, group in enumerate(names)}

    def collect(self):
        layer = self.depsgraph.view_layer_eval
        override = layer.material_override
        for count, instance in enumerate(self.depsgraph.object_instances):
            if count % 64 == 0:
                self.check()
            ob = instance.object
            if instance.show_particles and layer.use_strand and ob.type == "MESH":
                self._add_hair(instance, ob, override)
            if not instance.show_self:
                continue
            if ob.type == "MESH":
                if layer.use_solid:
                    self._add_mesh(instance, ob, override)
            elif ob.type == "CURVES":
                if layer.use_strand:
                    self._add_curves(instance, ob, override)
            elif ob.type == "POINTCLOUD":
                if layer.use_solid:
                    self._add_points(instance, ob, override)
            elif ob.type == "LIGHT":
                for light in lights.convert_light(ob.name, ob.data, instance.matrix_world, self.materials.images, self.report,
                                                  self.profiles, self.materials.picture_number):
                    light.group = self._group(ob)
                    self._limit_light(ob, light)
                    self.scene.lights.append((ob.name, light))
                    if not ob.is_shadow_catcher:
                        self.scene.added_lamps.add(ob.name)
            elif ob.type in LEFT_OUT:
                self.report.note(ob.name, LEFT_OUT[ob.type])
        self.check()
        self.scene.meshes = [mesh for mesh in self._meshes.values() if mesh is not None and mesh.transforms] + self._flat
        self.scene.meshes += [mesh for made in self._shapes.values() for mesh in made if mesh.transforms]
        if self.profiles.later:
            self.scene.lights = lights.settled(self.scene.lights, self.profiles, self.scene.meshes, self.check)
        scene = self.depsgraph.scene_eval
        bake = (lambda world: self.bake(world, scene.frame_current, self.check)) if self.bake is not None else None
        world = (getattr(layer, "world_override", None) or scene.world) if layer.use_sky else None
        self.scene.environment, suns, backdrop = worlds.convert_world(world, self.materials, self.report, bake)
        for name, sun in suns:
            sun.group = self._group(world)
            self.scene.lights.append((name, sun))
        self.scene.lamps, self.scene.world_suns = len(self.scene.lights), len(suns)
        if self.scene.environment is not None:
            self.scene.environment.group = self._group(world)
        self.scene.transparent = scene.render.film_transparent
        self.scene.backdrop = None if self.scene.transparent else backdrop
        seen = getattr(world, "cycles_visibility", None)
        hidden = seen is not None and not seen.camera
        if hidden:
            self.scene.backdrop = None
        mask = sum(library.RAYS[ray] for ray in LIT_RAYS if seen is None or getattr(seen, ray))
        if mask != LIT:
            for light in suns:
                light[1].mask = mask | library.SHADOW_RAYS
            if self.scene.environment is not None:
                self.scene.environment.mask = mask | library.CAMERA_RAYS
        if self.scene.environment is not None and (self.scene.transparent or backdrop is not None or hidden):
            self.scene.environment.flags |= library.HIDDEN
        if scene.render.use_motion_blur:
            self.report.note(scene.name, "Motion blur left out")
        if self.scene.transparent and getattr(getattr(scene, "cycles", None), "film_transparent_glass", False):
            self.report.note(scene.name, "Transparent glass of the film left out: what is seen through glass is opaque")
        if scene.render.use_freestyle:
            self.report.note(scene.name, "Freestyle lines left out")
        if any(mesh.catcher for mesh in self.scene.meshes):
            used = {int(n) for mesh in self.scene.meshes for n in mesh.numbers()}
            self.scene.held_out = {n: self.materials.held_out(n) for n in sorted(used)}
        # Materials at last: the world's image has been numbered by now.
        self.scene.materials = self.materials.items() or [("default", library.Material())]
        if self.hits:
            self.scene.material_names = [converted.source for converted in self.materials.converted]
        self.scene.images = self.materials.image_items()
        self.scene.profiles = self.profiles.items
        self.scene.groups = list(self.groups)
        return self.scene

    def _group(self, owner):
        return self.groups.get(getattr(owner, "lightgroup", ""), 0)

    def _group_of_light(self, ob, numbers):
        """Light group of an object with these materials, if they shine."""
        return self._group(ob) if any(any(self.materials.converted[n].values.emission) for n in numbers) else 0

    def _slots(self, ob, override):
        if override is not None:
            return [override]
        return [slot.material for slot in ob.material_slots] or [None]

    def _variants(self, ob, slots, pane):
        """(materials by slot, mask): one for each set of materials that some kinds of rays see alike."""
        held_out = ob.is_holdout or ob.holdout_get(view_layer=self.depsgraph.view_layer_eval)  # its own, or its collection's
        bare = ob.type == "MESH" and not len(ob.data.uv_layers)
        of_slots = [self.materials.numbers(material, pane, bare) for material in slots]
        if ob.as_pointer() not in self._looked_at:
            self._looked_at.add(ob.as_pointer())
            self._check_flags(ob)
        masks = {}
        hidden = self._hidden_from(ob)
        for (ray, bit), numbers in zip(library.RAYS.items(), zip(*of_slots)):
            if held_out and ray == "camera":
                numbers = tuple(self.materials.held_out(n) for n in numbers)
            if ray not in hidden:
                masks[numbers] = masks.get(numbers, 0) | bit
        return [(numbers, 0 if mask == library.ALL_RAYS else mask) for numbers, mask in masks.items()]

    def _add_mesh(self, instance, ob, override):
        mesh = ob.data
        slots = self._slots(ob, override)
        for numbers, mask in self._variants(ob, slots, lambda: self._pane(mesh, instance.matrix_world)):
            self._add_variant(instance, ob, mesh, slots, numbers, mask)

    def _add_hair(self, instance, ob, override):
        for system in ob.particle_systems:
            settings = system.settings
            if settings.render_type in {"HALO", "LINE"}:
                self.report.note(f"{ob.name}: {system.name}", "Particles without an object left out")
            if settings.type != "HAIR" or settings.render_type != "PATH":
                continue
            slots = self._slots(ob, override)
            slot = slots[min(settings.material, len(slots)) - 1]

            def shape(textured, names, system=system):
                places, radii, numbers = strands.hair_of_particles(ob, system, self.depsgraph.mode == "VIEWPORT", self.check)
                places, radii = strands.straightened(places, radii)
                uvs = self._at_roots(ob, system, numbers, places.shape[1]) if textured else None
                told = strands.info(places, radii, range(len(places))) if any(name[0] == "strand" for name in names) else {}
                found = {name: strands.on_tubes(told[name[1]]) for name in names if name[0] == "strand"}
                for name in names:
                    if name[0] in {"uv", "layer"} and (at_roots := self._at_roots(ob, system, numbers, places.shape[1], name)) is not None:
                        found[name] = at_roots
                return [(*strands.tubes(places, radii), uvs, found)]

            self._add_shapes(instance, ob, slot, ("hair", ob.as_pointer(), system.name), f"{ob.name}: {system.name}", shape)

    def _at_roots(self, ob, system, numbers, keys, name=("uv", "")):
        """Texture coordinates, or a colour, where each hair grows, for all of its vertices; None without any."""
        modifier = next((m for m in ob.modifiers if m.type == "PARTICLE_SYSTEM" and m.particle_system.name == system.name), None)
        layers, colours = ob.data.uv_layers, ob.data.vertex_colors
        of_colour = name[0] == "layer" and name[1] not in layers
        if of_colour:
            layer = colours.find(name[1]) if name[1] else colours.active_index
        else:
            layer = layers.find(name[1]) if name[1] else next((i for i, l in enumerate(layers) if l.active_render), 0)
        if modifier is None or not 0 <= layer < len(colours if of_colour else layers):
            return None
        parents = len(system.particles)
        values = np.empty((len(numbers), 3 if of_colour else 2), np.float32)
        for i, number in enumerate(numbers.tolist()):
            if i % 1024 == 0:
                self.check()
            particle = system.particles[number] if number < parents else system.particles[0]
            if of_colour:
                values[i] = system.mcol_on_emitter(modifier, particle=particle, particle_no=number, vcol_no=layer)
            else:
                values[i] = system.uv_on_emitter(modifier, particle=particle, particle_no=number, uv_no=layer)
        return np.repeat(srgb_to_linear(values) if of_colour else values, keys * strands.SIDES, axis=0)

    def _add_curves(self, instance, ob, override):
        def shape(_, names):
            made = []
            for places, radii, points, numbers in strands.curve_strands(ob.data, fetch):
                told = strands.info(places, radii, numbers, even=True)
                found = {name: strands.on_tubes(told[name[1]]) for name in names if name[0] == "strand"}
                found |= {name: strands.on_tubes(values) for name in names if name[0] == "layer"
                          and (values := self._of_curves(ob, name[1], points, numbers)) is not None}
                made.append((*strands.tubes(places, radii), None, found))
            return made

        self._add_shapes(instance, ob, self._slots(ob, override)[0], ("curves", ob.data.as_pointer()), ob.name, shape)

    def _of_curves(self, ob, name, points, numbers):
        """(strands, keys, components) of an attribute of a curves object; None: it has none of that name."""
        attribute = ob.data.attributes.get(name)
        if attribute is None or attribute.data_type not in mesh_attributes.WIDTHS:
            self.report.note(ob.name, f"Meshes without the attribute \"{name}\" that a material wants")
            return None
        values = mesh_attributes.numbers_of(attribute, fetch)
        return values[points] if attribute.domain == "POINT" else np.repeat(values[numbers][:, None], points.shape[1], 1)

    def _add_shapes(self, instance, ob, material, key, name, shape):
        """Adds meshes that are made here, once for all instances. `shape`, told whether its material has textures and which
        attributes its programs ask for, gives [(positions, normals, indices, uvs, {attribute: values})]."""
        for numbers, mask in self._variants(ob, [material], lambda: False):
            number, group = numbers[0], self._group_of_light(ob, numbers)
            if self.materials.converted[number].is_hole():
                continue
            links = self.linking.of(ob)
            made = key, number, group, mask, ob.is_shadow_catcher, links
            names = list(dict.fromkeys(self.materials.converted[number].attributes()))
            if made not in self._shapes:
                self.check()
                self._shapes[made] = [Mesh(name, positions, indices, normals, uvs, None, number, [], group, mask,
                                           [(self.materials.attribute_number(of), library.OF_VERTICES, values)
                                            for of, values in found.items()],
                                           catcher=ob.is_shadow_catcher, links=links)
                                      for positions, normals, indices, uvs, found
                                      in shape(bool(self.materials.converted[number].plain_pictures()), names) if len(indices)]
            for mesh in self._shapes[made]:
                mesh.transforms.append(rows(instance.matrix_world))
                for of in names:
                    if of[0] in mesh_attributes.OF_INSTANCE:
                        mesh.of_instances.setdefault(self.materials.attribute_number(of), []).append(self._of_instance(of, instance))
                self._own(mesh, ob)
                self.instances += 1

    def _of_instance(self, name, instance):
        if name[0] == "instancer" and mesh_attributes.is_of_nodes(instance):
            self.report.note(f"{instance.parent.name} ({name[1]})", "Attributes of instances by geometry nodes, taken as properties of the object")
        return mesh_attributes.of_instance(name, instance)

    def _add_points(self, instance, ob, override):
        cloud = ob.data
        count = len(cloud.points)
        places = fetch(cloud.attributes["position"].data, "vector", count, 3, np.float32)
        radius = cloud.attributes.get("radius")
        radii = fetch(radius.data, "value", count, 1, np.float32) if radius is not None else np.full(count, 0.01, np.float32)
        transforms = strands.spheres(places, radii, np.array(instance.matrix_world))
        for numbers, mask in self._variants(ob, [self._slots(ob, override)[0]], lambda: False):
            number, group = numbers[0], self._group_of_light(ob, numbers)
            if self.materials.converted[number].is_hole():
                continue
            links = self.linking.of(ob)
            own = any(of[0] == "layer" for of in self.materials.converted[number].attributes())
            made = "sphere", ob.name_full if own else None, number, group, mask, ob.is_shadow_catcher, links
            if made not in self._shapes:
                positions, indices = strands.unit_sphere()
                self._shapes[made] = [Mesh("spheres of points", positions, indices, positions, None, None, number, [], group, mask,
                                           catcher=ob.is_shadow_catcher, links=links)]
            mesh = self._shapes[made][0]
            mesh.transforms += transforms
            for of in dict.fromkeys(self.materials.converted[number].attributes()):
                values = None
                if of[0] in mesh_attributes.OF_INSTANCE:
                    values = [self._of_instance(of, instance)] * len(transforms)
                elif of[0] == "layer":
                    values = self._of_points(ob, of[1], radii > 0)
                if values is not None:
                    mesh.of_instances.setdefault(self.materials.attribute_number(of), []).extend(values)
            self._own(self._shapes[made][0], ob, len(transforms))
            self.instances += len(transforms)

    def _of_points(self, ob, name, kept):
        """[numbers] of an attribute of a point cloud, of points that are kept; None: it has none of that name."""
        attribute = ob.data.attributes.get(name)
        if attribute is None or attribute.data_type not in mesh_attributes.WIDTHS:
            self.report.note(ob.name, f"Meshes without the attribute \"{name}\" that a material wants")
            return None
        return mesh_attributes.numbers_of(attribute, fetch)[kept].tolist()

    def _add_variant(self, instance, ob, mesh, slots, numbers, mask):
        """`numbers`: materials by slot; `mask`: of the rays that see them."""
        group = self._group_of_light(ob, numbers)
        links = self.linking.of(ob)
        key = (mesh.as_pointer(), numbers, group, mask, ob.is_shadow_catcher, links)
        if key not in self._meshes:
            self.check()
            found = self._read(ob, mesh, slots, numbers, instance)
            if found is not None:
                found.group, found.mask, found.catcher, found.links = group, mask, ob.is_shadow_catcher, links
                if all(self.materials.converted[n].is_hole() for n in found.numbers()):
                    found = None
            self._meshes[key] = found
        target = self._meshes[key]
        if target is not None:
            transform = rows(instance.matrix_world)
            own = {self.materials.attribute_number(name): self._of_instance(name, instance)
                   for name in dict.fromkeys(a for n in numbers for a in self.materials.converted[n].attributes())
                   if name[0] in mesh_attributes.OF_INSTANCE}
            if is_flat(transform):
                target = flattened(target, transform)
                if target is not None:
                    target.of_instances = {number: [values] for number, values in own.items()}
                    target.owners = []
                    self._own(target, ob)
                    self._flat.append(target)
                    self.instances += 1
                return
            for number, values in own.items():
                target.of_instances.setdefault(number, []).append(values)
            target.transforms.append(transform)
            self._own(target, ob)
            self.instances += 1

    def _own(self, mesh, ob, count=1):
        """Notes for passes whose the newest transforms of a mesh are."""
        if not self.hits:
            return
        if ob.name not in self._owners:
            top = ob
            while top.parent is not None:
                top = top.parent
            self._owners[ob.name] = len(self.scene.objects)
            self.scene.objects.append(Owner(ob.name, top.name, ob.pass_index))
        mesh.owners += [self._owners[ob.name]] * count

    def _pane(self, mesh, matrix):
        """Flags of glass on a mesh that is a pane: open (has edges of a single face), or flat (at most a tenth as thick as
        wide). An open one of a single layer is the surface of a body that it does not close; 0 where it is none."""
        key = mesh.as_pointer()
        if key not in self._sheets:
            faces = np.bincount(fetch(mesh.loops, "edge_index", len(mesh.loops), 1, np.int32).ravel())
            places = vertex_positions(mesh)
            self._sheets[key] = bool((faces == 1).any()), is_one_layer(mesh), np.ptp(places, axis=0) if len(places) else np.zeros(3)
        is_open, one_layer, extents = self._sheets[key]
        if is_open:
            return library.SHADOWS_PASS | (library.OPEN_GLASS if one_layer else 0)
        thickness, width, _ = sorted(extents * np.abs(matrix.to_scale()))
        return library.SHADOWS_PASS if thickness <= 0.1 * width else 0

    def _hidden_from(self, ob):
        """Kinds of rays that do not see an object: its own setting, and its collection's Indirect Only."""
        hidden = {ray for ray in library.RAYS if not getattr(ob, "visible_" + ray)}
        if ob.indirect_only_get(view_layer=self.depsgraph.view_layer_eval):
            hidden.add("camera")
        return hidden

    def _limit_light(self, ob, light):
        """A lamp's ray visibility, and what it is linked to."""
        mask = sum(library.RAYS[ray] for ray in LIT_RAYS if getattr(ob, "visible_" + ray))
        if ob.visible_camera:
            if light.type in {library.RECTANGLE, library.DISK} or (light.type != library.SUN and light.radius > 0):
                mask |= library.CAMERA_RAYS
            elif light.type == library.SUN and light.radius > 0:
                self.report.note(ob.name, "Suns that the camera should see, which it does not")
        light.mask = 0 if mask == LIT else mask or library.SHADOW_RAYS
        links = self.linking.of(ob)
        light.receivers, light.blockers = links.receivers, links.blockers

    def _check_flags(self, ob):
        of_cycles = getattr(self.depsgraph.scene, "cycles", None)
        if getattr(of_cycles, "feature_set", "") == "EXPERIMENTAL" and getattr(getattr(ob, "cycles", None), "use_adaptive_subdivision", False):
            self.report.note(ob.name, "Adaptive subdivision, taken as the modifier's levels")

    def _displacements(self, slots):
        return [None if material is None else self.materials.displacements.get(material.name_full) for material in slots]

    def _read(self, ob, mesh, slots, numbers, instance):
        displacements = self._displacements(slots)
        if self.cache is None or any(displacements):
            return self._convert(ob, mesh, numbers, displacements, instance)
        # Evaluated data move in memory; the originals' names say what they came from.
        converted = [self.materials.converted[n] for n in numbers]
        mappings = (tuple(c.mapping if c.plain_pictures() else None for c in converted),
                    tuple((name, self.materials.attribute_number(name)) for c in converted for name in c.attributes()))
        names = frozenset({ob.name_full, mesh.name_full})
        key = (mesh.as_pointer(), mappings, names, tuple(numbers), len(mesh.vertices), len(mesh.loops))
        found = self.cache.meshes.get(key)
        if found is None:
            found = self._convert(ob, mesh, numbers, displacements, instance)
            if found is None:
                return None
            self.cache.meshes[key] = found
        return Mesh(found.name, found.positions, found.indices, found.normals, found.uvs, found.materials, found.material, [],
                    attributes=found.attributes)

    def _convert(self, ob, mesh, numbers, displacements, instance):
        edited = mesh.is_editmode  # its faces are with the editor, the mesh is empty
        if edited:
            mesh = ob.to_mesh(preserve_all_data_layers=True, depsgraph=self.depsgraph)
        try:
            reader = MeshReader(ob.name, mesh, numbers, self.materials, self.report, self.check, displacements, instance)
            found = reader.read()
            if self.uv_maps and found is not None and mesh.uv_layers:
                found.uv_map = reader.uv_map()
            return found
        finally:
            if edited:
                ob.to_mesh_clear()
