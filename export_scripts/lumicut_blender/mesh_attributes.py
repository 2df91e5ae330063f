# SPDX-License-Identifier: Apache-2.0
"""What texture programs ask of meshes and objects: coordinates, colour and other attributes, random numbers.

An attribute is named by a tuple: ("uv", map), ("tangent", map), what tangents follow, ("layer", name), ("generated",), ("undisplaced",), ("island",) are of meshes; ("strand", output) of
hair and curves; ("object", output), ("property", name), ("instancer", name), ("world_to_object",) and ("object_to_world",)
of instances.
"""
import bpy
import numpy as np

OF_INSTANCE = {"object", "property", "instancer", "world_to_object", "object_to_world"}
WIDTHS = {"FLOAT": ("value", 1), "INT": ("value", 1), "INT8": ("value", 1), "BOOLEAN": ("value", 1), "FLOAT_VECTOR": ("vector", 3),
          "FLOAT2": ("vector", 2), "FLOAT_COLOR": ("color", 4), "BYTE_COLOR": ("color", 4)}
MASK = 0xFFFFFFFF


def jenkins(*words):
    """Jenkins' lookup3 of one or two words, as Cycles hashes."""
    a = b = c = (0xDEADBEEF + (len(words) << 2) + 13) & MASK
    a = (a + words[0]) & MASK
    if len(words) > 1:
        b = (b + words[1]) & MASK
    parts = {"a": a, "b": b, "c": c}
    for to, of, k in (("c", "b", 14), ("a", "c", 11), ("b", "a", 25), ("c", "b", 16), ("a", "c", 4), ("b", "a", 14), ("c", "b", 24)):
        x = parts[of]
        parts[to] = ((parts[to] ^ x) - (((x << k) | (x >> (32 - k))) & MASK)) & MASK
    return parts["c"]


def hash_of_name(name):
    h = 0
    for byte in name.encode():
        h = (h * 37 + (byte if byte < 128 else byte - 256)) & MASK
    return h


def random_of(instance):
    number = instance.random_id & MASK if instance.is_instance else jenkins(hash_of_name(instance.object.name), 0)
    return number / MASK


def property_of(owners, name):
    """A custom or built-in property of the first owner that has it: up to four numbers."""
    plain = name.strip("[]\"'")
    for owner in owners:
        if owner is None:
            continue
        value = owner.get(plain) if isinstance(owner, bpy.types.ID) else None
        if value is None and "." not in plain:
            value = getattr(owner, plain, None)
        try:
            numbers = [float(value)] if isinstance(value, (int, float)) else [float(x) for x in value]
        except (TypeError, ValueError):
            continue
        if 1 <= len(numbers) <= 4:
            return numbers
    return None


def is_of_nodes(instance):
    """Whether geometry nodes make it, whose own attributes Python does not tell."""
    return instance.is_instance and instance.particle_system is None and instance.parent.instance_type == "NONE"


def owners_of(instance, instancer):
    """Whose properties an instance shows, first those of what makes it where that is asked for."""
    makers = []
    if instancer and instance.is_instance:
        system = instance.particle_system
        makers = [system, system.settings] if system is not None else []
        makers.append(instance.parent)
    return [*makers, instance.object, instance.object.data]


def of_instance(name, instance):
    """Numbers of one instance."""
    ob = instance.object
    kind = name[0]
    if kind in ("world_to_object", "object_to_world"):
        m = instance.matrix_world
        m = m.inverted_safe() if kind == "world_to_object" else m
        return [x for row in m[:3] for x in row]
    if kind in ("property", "instancer"):
        found = property_of(owners_of(instance, kind == "instancer"), name[1]) or [0.0]
        return (found * 3 if len(found) == 1 else found + [0.0] * (3 - len(found)))[:4] + [1.0] * (len(found) < 4)
    what = name[1]
    if what == "Location":
        return list(instance.matrix_world.translation)
    if what == "Color":
        return list(ob.color)
    return [float(ob.pass_index) if what == "Object Index" else random_of(instance)]


def islands(edges, vertices):
    """Number of each vertex's island: of the vertex that joining edge after edge leaves as its root, as Cycles finds it."""
    parents, ranks = list(range(vertices)), [0] * vertices

    def root(x):
        r = x
        while parents[r] != r:
            r = parents[r]
        while parents[x] != r:
            parents[x], x = r, parents[x]
        return r

    for a, b in edges:
        a, b = root(a), root(b)
        if a == b:
            continue
        if ranks[a] < ranks[b]:
            a, b = b, a
        parents[b] = a
        if ranks[a] == ranks[b]:
            ranks[a] += 1
    return [root(x) for x in range(vertices)]


def numbers_of(attribute, fetch):
    """(places, components) of an attribute of a type among WIDTHS."""
    field, width = WIDTHS[attribute.data_type]
    dtype = {"INT": np.int32, "INT8": np.int32, "BOOLEAN": bool}.get(attribute.data_type, np.float32)
    return fetch(attribute.data, field, len(attribute.data), width, dtype).reshape(-1, width).astype(np.float32)


class AttributeReader:
    """Attributes of one evaluated mesh. `fetch`: collect.fetch; `note(text)`: of what is missing."""

    def __init__(self, mesh, fetch, note, check):
        self.mesh, self.fetch, self.note, self.check = mesh, fetch, note, check

    def read(self, name, layer, loops):
        """("vertex", "corner", (n, components)), or None: not there. `layer(name, loops)`: a UV map."""
        kind = name[0]
        if kind == "uv":
            return "corner", layer(name[1], loops)
        if kind == "tangent":
            return self.tangents(name[1], layer, loops)
        if kind == "strand":
            return None  # 0, as of what is none
        if kind == "generated":
            return "vertex", self.generated()
        if kind == "undisplaced":
            return "vertex", self.fetch(self.mesh.vertices, "co", len(self.mesh.vertices), 3, np.float32)
        if kind == "island":
            return "vertex", self.island()
        return self.layer(name[1], layer, loops)

    def generated(self):
        count = len(self.mesh.vertices)
        places = self.fetch(self.mesh.vertices, "undeformed_co", count, 3, np.float32)
        low = np.array(self.mesh.texspace_location) - np.array(self.mesh.texspace_size)
        size = 2 * np.array(self.mesh.texspace_size)
        return ((places - low) / np.where(size != 0, size, 1)).astype(np.float32)

    def tangents(self, name, layer, loops):
        """As Cycles has them: of a UV map; of none by that name there are none; without any they go around the object's z axis,
        and along x where that says nothing."""
        layers = self.mesh.uv_layers
        if name or len(layers):
            return ("corner", layer(name, loops)) if not name or name in layers else None
        at = self.fetch(self.mesh.vertices, "undeformed_co", len(self.mesh.vertices), 3, np.float32)
        cosine = at[:, 2] / np.maximum(np.linalg.norm(at, axis=1), 1e-30)
        if np.ptp(cosine) < 1e-6:
            return "vertex", at[:, :2] * np.float32((1, -1))
        turn = 0.5 - np.arctan2(at[:, 0], at[:, 1]) / (2 * np.pi)
        return "vertex", np.stack([turn, 1 - np.arccos(np.clip(cosine, -1, 1)) / np.pi], 1).astype(np.float32)

    def island(self):
        count = len(self.mesh.vertices)
        edges = self.fetch(self.mesh.edges, "vertices", len(self.mesh.edges), 2, np.int32)
        self.check()
        roots = islands(edges.tolist(), count)
        numbers = {r: jenkins(r) / MASK for r in set(roots)}
        return np.array([numbers[r] for r in roots], np.float32)[:, None]

    def layer(self, name, layer, loops):
        mesh = self.mesh
        if not name:
            colours = mesh.color_attributes
            index = getattr(colours, "render_color_index", -1)
            if not len(colours):
                self.note("Meshes without the colour attribute that a material wants")
                return None
            name = colours[index if 0 <= index < len(colours) else 0].name
        if name in mesh.uv_layers:
            return "corner", layer(name, loops)
        attribute = mesh.attributes.get(name)
        if attribute is None or attribute.data_type not in WIDTHS:
            self.note(f"Meshes without the attribute \"{name}\" that a material wants")
            return None
        values, width = numbers_of(attribute, self.fetch), WIDTHS[attribute.data_type][1]
        if attribute.domain == "POINT":
            return "vertex", values
        if attribute.domain == "CORNER":
            return "corner", values
        if attribute.domain == "FACE":
            return "corner", np.repeat(values, self.fetch(mesh.polygons, "loop_total", len(mesh.polygons), 1, np.int32), 0)
        sums = np.zeros((len(mesh.vertices), width), np.float32)  # edges: the mean of a vertex's
        ends = self.fetch(mesh.edges, "vertices", len(mesh.edges), 2, np.int32)
        for k in (0, 1):
            np.add.at(sums, ends[:, k], values)
        return "vertex", sums / np.maximum(np.bincount(ends.ravel(), minlength=len(sums)), 1)[:, None]
