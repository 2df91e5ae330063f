"""What the scene scripts share: writing OBJ, JSON and small EXR images without any library."""
import json
import math
import pathlib
import struct

import whole_file

ROOT = pathlib.Path(__file__).resolve().parents[2]


class Obj:
    """Quads, boxes and other polygons, by material."""

    def __init__(self):
        self.vertices, self.faces = [], {}

    def polygon(self, material, points):
        first = len(self.vertices) + 1
        self.vertices += points
        self.faces.setdefault(material, []).append([first + i for i in range(len(points))])

    def quad(self, material, corner, u, v):
        """Faces u x v."""
        add = lambda a, b: tuple(x + y for x, y in zip(a, b))
        self.polygon(material, [corner, add(corner, u), add(add(corner, u), v), add(corner, v)])

    def box(self, material, lower, upper, turn=0.0):
        """Faces outward; turned by `turn` degrees about the vertical (y) through its middle."""
        (x0, y0, z0), (x1, y1, z1) = lower, upper
        cx, cz, a = (x0 + x1) / 2, (z0 + z1) / 2, math.radians(turn)
        corners = [(x, y, z) for z in (z0, z1) for y in (y0, y1) for x in (x0, x1)]
        corners = [(cx + (x - cx) * math.cos(a) + (z - cz) * math.sin(a), y,
                    cz - (x - cx) * math.sin(a) + (z - cz) * math.cos(a)) for x, y, z in corners]
        for face in ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)):
            self.polygon(material, [corners[i] for i in face])

    def column(self, material, x, z, radius, y0, y1, sides=24):
        """Round, without caps."""
        ring = [(x + radius * math.cos(2 * math.pi * i / sides), z + radius * math.sin(2 * math.pi * i / sides))
                for i in range(sides)]
        for (ax, az), (bx, bz) in zip(ring, ring[1:] + ring[:1]):
            self.polygon(material, [(ax, y1, az), (bx, y1, bz), (bx, y0, bz), (ax, y0, az)])

    def write(self, path, materials):
        """`materials`: name -> (Kd, Ks, Ns)."""
        lines = [f"# Made by export_scripts/scenes/{path.stem}.py; metres, y up", f"mtllib {path.stem}.mtl"]
        lines += ["v " + " ".join(f"{x:.5g}" for x in v) for v in self.vertices]
        for material, faces in self.faces.items():
            lines.append(f"usemtl {material}")
            lines += ["f " + " ".join(map(str, face)) for face in faces]
        whole_file.write(path, "\n".join(lines) + "\n")
        text = [f"# Made by export_scripts/scenes/{path.stem}.py"]
        for name, (kd, ks, ns) in materials.items():
            text += ["", f"newmtl {name}", "Kd " + " ".join(map(str, kd)), "Ks " + " ".join(map(str, ks)), f"Ns {ns}", "illum 2"]
        whole_file.write(path.with_suffix(".mtl"), "\n".join(text) + "\n")


def write_scene(path, scene):
    """JSON, one line for each list of numbers."""
    def text(value, indent):
        pad = "  " * indent
        if isinstance(value, dict):
            if all(not isinstance(v, (dict, list)) or simple(v) for v in value.values()) and len(json.dumps(value)) < 110:
                return "{" + ", ".join(f"{json.dumps(k)}: {json.dumps(v)}" for k, v in value.items()) + "}"
            return "{\n" + ",\n".join(f"{pad}  {json.dumps(k)}: {text(v, indent + 1)}" for k, v in value.items()) + f"\n{pad}}}"
        if isinstance(value, list) and not simple(value):
            return "[\n" + ",\n".join(f"{pad}  {text(v, indent + 1)}" for v in value) + f"\n{pad}]"
        return json.dumps(value)

    def simple(value):
        return not isinstance(value, (dict, list)) or isinstance(value, list) and all(not isinstance(v, (dict, list)) for v in value)

    whole_file.write(path, text(scene, 0) + "\n")


def write_exr(path, width, height, pixel):
    """Uncompressed half-float scanlines; pixel(x, y) gives (r, g, b), row 0 on top."""
    def attribute(name, kind, value):
        return name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<i", len(value)) + value

    window = struct.pack("<4i", 0, 0, width - 1, height - 1)
    channels = b"".join(name + b"\0" + struct.pack("<iB3xii", 1, 0, 1, 1) for name in (b"B", b"G", b"R")) + b"\0"
    header = struct.pack("<II", 20000630, 2)
    for item in (("channels", "chlist", channels), ("compression", "compression", b"\0"), ("dataWindow", "box2i", window),
                 ("displayWindow", "box2i", window), ("lineOrder", "lineOrder", b"\0"),
                 ("pixelAspectRatio", "float", struct.pack("<f", 1)), ("screenWindowCenter", "v2f", struct.pack("<2f", 0, 0)),
                 ("screenWindowWidth", "float", struct.pack("<f", 1))):
        header += attribute(*item)
    header += b"\0"
    line_bytes = width * 3 * 2
    first = len(header) + 8 * height
    offsets = b"".join(struct.pack("<Q", first + y * (8 + line_bytes)) for y in range(height))
    body = b""
    for y in range(height):
        row = [pixel(x, y) for x in range(width)]
        planes = [c[k] for k in (2, 1, 0) for c in row]
        body += struct.pack("<ii", y, line_bytes) + struct.pack(f"<{len(planes)}e", *planes)
    whole_file.write(path, header + offsets + body)
