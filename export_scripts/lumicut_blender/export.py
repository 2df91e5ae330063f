# SPDX-License-Identifier: Apache-2.0
"""A collected scene as files that `lumicut render` reads: scene.json, an OBJ a mesh, images as PNG and EXR.

Numbers are written so that they read back the same, bit for bit: the command renders what F12 renders.
"""
import json
import math
import os
import pathlib
import re
import shutil
import struct
import tempfile
import zlib

import numpy as np

from . import cameras, properties, shadow_catcher
from .lumicut import library
from .scene_data import Program


class ExportError(RuntimeError):
    pass


def pixel_filter(scene):
    kind, width = cameras.filter_of(scene)
    return {} if kind == library.BOX else {"filter": ("box", "gaussian", "blackman_harris")[kind], "filter_width": numbers([width])[0]}


def png(pixels):
    """Bytes of an 8-bit PNG: (h, w, 1 or 3), top row first."""
    height, width, channels = pixels.shape

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    rows = np.zeros((height, 1 + width * channels), np.uint8)  # each begins with its filter, 0: none
    rows[:, 1:] = pixels.reshape(height, -1)
    header = struct.pack(">IIBBBBB", width, height, 8, {1: 0, 3: 2}[channels], 0, 0, 0)
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows.tobytes(), 6)) +
            chunk(b"IEND", b""))


def exr(pixels):
    """Bytes of an uncompressed 32-bit OpenEXR: (h, w, 1 or 3), top row first."""
    height, width, channels = pixels.shape
    names = ["Y"] if channels == 1 else ["B", "G", "R"]  # in the file's order, by name

    def attribute(name, kind, data):
        return name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<I", len(data)) + data

    channel_list = b"".join(n.encode() + b"\0" + struct.pack("<iIii", 2, 0, 1, 1) for n in names) + b"\0"
    window = struct.pack("<4i", 0, 0, width - 1, height - 1)
    header = (struct.pack("<II", 20000630, 2) + attribute("channels", "chlist", channel_list) +
              attribute("compression", "compression", b"\0") + attribute("dataWindow", "box2i", window) +
              attribute("displayWindow", "box2i", window) + attribute("lineOrder", "lineOrder", b"\0") +
              attribute("pixelAspectRatio", "float", struct.pack("<f", 1)) +
              attribute("screenWindowCenter", "v2f", struct.pack("<2f", 0, 0)) +
              attribute("screenWindowWidth", "float", struct.pack("<f", 1)) + b"\0")
    line = 8 + 4 * channels * width
    first = len(header) + 8 * height
    offsets = first + line * np.arange(height, dtype="<u8")
    body = np.zeros((height, 2 + channels * width), "<f4")
    body[:, 2:] = pixels[..., ::-1].transpose(0, 2, 1).reshape(height, -1)
    raw = body.view("<i4")
    raw[:, 0], raw[:, 1] = np.arange(height), 4 * channels * width
    return header + offsets.tobytes() + body.tobytes()


def linear(image):
    """An image's texels as linear float32."""
    from .images import srgb_to_linear
    if image.pixels.dtype != np.uint8:
        return image.pixels
    table = np.arange(256, dtype=np.float32) / 255
    return (srgb_to_linear(table) if image.flags & library.SRGB else table)[image.pixels]


def plain_name(name, used, ending):
    """A file name of letters, digits, - and _ that is not in `used` yet."""
    stem = re.sub(r"[^A-Za-z0-9_-]+", "_", name).strip("_")[:60] or "unnamed"
    candidate, number = stem, 1
    while (candidate + ending).lower() in used:
        number += 1
        candidate = f"{stem}_{number}"
    used.add((candidate + ending).lower())
    return candidate + ending


def numbers(values):
    """JSON numbers that read back as the same single-precision values."""
    return [float(f"{float(v):.9g}") for v in values]


def degrees(radians):
    return math.degrees(radians)


CANDELA = 683.0  # of a W/sr, in scene files


def rotation_of(light):
    """Degrees that the scene file's horizontal angle 0 is turned by to lie at the lamp's tangent."""
    axis, tangent = np.array(light.direction, np.float64), np.array(light.tangent, np.float64)
    axis /= np.linalg.norm(axis)
    zero = np.array([1.0, 0, 0]) - axis * axis[0]
    if not np.linalg.norm(zero) > 1e-3:
        zero = np.array([0, 1.0, 0]) - axis * axis[1]
    zero /= np.linalg.norm(zero)
    return degrees(math.atan2(tangent @ np.cross(zero, axis), tangent @ zero))


def hidden_from(mask):
    return [ray for ray, bit in library.RAYS.items() if not mask & bit]


def links(of_mesh):
    """Light linking, as scene files have it."""
    out = {}
    for key, bits in zip(("not_lit_by", "not_blocking"), of_mesh):
        if bits:
            out[key] = [1 + i for i in range(32) if bits >> i & 1]
    return out | {key: number for key, number in zip(("receivers", "blockers"), of_mesh[2:]) if number}


def obj(mesh, mtl, material_names):
    """Text of an OBJ: as many vertices, normals and texture coordinates as the mesh has, in its order."""
    def lines(key, array):
        if array is None:
            return ""
        form = key + " " + " ".join(["%.9g"] * array.shape[1]) + "\n"
        return (form * len(array)) % tuple(array.astype(np.float64).reshape(-1))

    parts = [f"mtllib {mtl}\n", lines("v", mesh.positions), lines("vt", mesh.uvs), lines("vn", mesh.normals)]
    corner = "%d" if mesh.uvs is None and mesh.normals is None else "%d/%d" if mesh.normals is None else \
        "%d//%d" if mesh.uvs is None else "%d/%d/%d"
    form = "f " + " ".join([corner] * 3) + "\n"

    def faces(indices):
        return (form * len(indices)) % tuple(np.repeat(indices.reshape(-1).astype(np.int64) + 1, corner.count("%d")))

    if mesh.materials is None:
        parts += [f"usemtl {material_names[mesh.material]}\n", faces(mesh.indices)]
    else:  # runs of faces, in their order
        starts = np.concatenate([[0], np.nonzero(np.diff(mesh.materials))[0] + 1, [len(mesh.materials)]])
        for a, b in zip(starts[:-1], starts[1:]):
            parts += [f"usemtl {material_names[mesh.materials[a]]}\n", faces(mesh.indices[a:b])]
    return "".join(parts)


class Writer:
    def __init__(self, folder, data, stem):
        self.folder, self.data, self.stem = folder, data, stem
        self.files, self.used = {}, set()

    def write(self, name, content):
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return name

    def image(self, number, use):
        """File of the 1-based image for "colour" (PNGs are sRGB), "mask" or "radiance" (EXR)."""
        image = self.data.images[number - 1]
        byte = image.pixels.dtype == np.uint8
        as_png = byte and (use == "mask" or (use == "vectors" and not image.flags & library.SRGB) or (use == "colour" and image.flags & library.SRGB))
        key = number, as_png
        if key not in self.files:
            name = "textures/" + plain_name(os.path.splitext(image.name)[0], self.used, ".png" if as_png else ".exr")
            pixels = image.pixels if as_png else np.maximum(linear(image), 0)
            self.files[key] = self.write(name, png(pixels) if as_png else exr(pixels))
        return self.files[key]

    def program(self, number, p):
        """The 1-based image's program, images among its instructions as files."""
        steps = []
        for row in p.instructions.tolist():
            op, mode, inputs, data, count = row[0], row[1], row[2:10], row[10], row[11]
            step = {"op": library.PROGRAM_OPS[op]}
            if mode:
                step["mode"] = mode
            taken = library.PROGRAM_INPUTS[op]
            if taken:
                step["inputs"] = [i if i >= 0 else numbers(p.constants[-1 - i]) for i in inputs[:taken]]
            if count:
                step["table"] = numbers(p.table[data:data + count])
            elif step["op"] in ("attribute", "normal_map", "transform"):
                step["attribute"] = str(data)
            elif step["op"] == "image":
                image = self.data.images[data - 1]
                use = "color" if image.pixels.dtype != np.uint8 or image.flags & library.SRGB else "numbers"
                step["image"] = {"file": self.image(data, "colour" if use == "color" else "vectors"), "use": use,
                                 **{key: True for key, bit in (("clamp", library.CLAMP), ("nearest", library.NEAREST), ("blend_stored", library.BLEND_STORED)) if image.flags & bit}}
            steps.append(step)
        return {"name": f"program {number}", "steps": steps}

    def attributes(self, mesh, file):
        """Values in files of 32-bit floats beside the mesh."""
        out = []
        for number, domain, values in mesh.all_attributes():
            name = self.write(f"{file}.{number}.f32", np.ascontiguousarray(values, "<f4").tobytes())
            out.append({"name": str(number), "domain": ("vertices", "triangles", "instances")[domain],
                        "components": values.shape[1], "file": name})
        return {"attributes": out} if out else {}

    def texture(self, number, use):
        if isinstance(self.data.images[number - 1], Program):
            return {"program": f"program {number}"}
        name, flags = self.image(number, use), self.data.images[number - 1].flags
        options = {key: True for key, bit in (("clamp", library.CLAMP), ("nearest", library.NEAREST), ("blend_stored", library.BLEND_STORED),
                                                ("by_view", library.BY_VIEW)) if flags & bit}
        return {"file": name, **options} if options else name

    def material(self, name, m):
        out = {"name": name, "diffuse": numbers(m.diffuse), "specular": numbers(m.specular)}
        if m.flags & library.GGX:
            out["model"] = "ggx"
            if m.flags & library.NO_FRESNEL:
                out["fresnel"] = False
            if m.flags & library.BURLEY:
                out["burley"] = True
            if m.flags & (library.BRIGHT_LOBE | library.FACETS_ONCE):
                out["multiple_scattering"] = "lobe" if m.flags & library.BRIGHT_LOBE else "none"
            if m.flags & library.SHADOWS_PASS:
                out["shadows_pass"] = True
            if m.flags & library.OPEN_GLASS:
                out["open_glass"] = True
            if any(m.specular_tint):
                out["specular_tint"] = numbers(m.specular_tint)
            if any(m.absorption):
                out["absorption"] = numbers(m.absorption)
            for key in ("roughness", "metallic", "ior", "transmission"):
                out[key] = numbers([getattr(m, key)])[0]
            if m.coat > 0:
                for key in ("coat", "coat_roughness", "coat_ior"):
                    out[key] = numbers([getattr(m, key)])[0]
            if m.diffuse_roughness > 0:
                out["diffuse_roughness"] = numbers([m.diffuse_roughness])[0]
            if m.flags & library.DIFFUSE_ONCE:
                out["diffuse_facets"] = "once"
            for key in ("roughness_texture", "metallic_texture", "diffuse_roughness_texture"):
                if getattr(m, key):
                    out[key] = self.texture(getattr(m, key), "vectors")
        else:
            out["shininess"] = numbers([m.shininess])[0]
            if m.flags & library.OREN_NAYAR:
                out["oren_nayar"] = "once" if m.flags & library.FACETS_ONCE else "often"
                out["roughness"] = numbers([m.roughness])[0]
        if m.flags & library.BUMP_SHADOWS:
            out["bump_shadows"] = True
        if m.flags & library.HOLDOUT:
            out["holdout"] = True
        if m.flags & library.PHONG:
            out["model"] = "phong"
        if m.opacity not in (0.0, 1.0):
            out["opacity"] = numbers([m.opacity])[0]
        if any(m.emission):
            out["emission"] = numbers(m.emission)
            out["emit_both_sides"] = bool(m.flags & library.EMIT_BOTH_SIDES)
        if m.normal_texture:
            out["normal_texture"] = self.texture(m.normal_texture, "vectors")
            out["normal_strength"] = numbers([m.normal_strength])[0]
        if m.height_texture:
            out["height_texture"] = self.texture(m.height_texture, "vectors")
            for key in ("bump_distance", "bump_strength"):
                out[key] = numbers([getattr(m, key)])[0]
        if any(m.translucency):
            out["translucency"] = numbers(m.translucency)
        for slot, use in (("diffuse", "colour"), ("specular", "colour"), ("translucency", "colour"), ("emission", "colour"),
                          ("opacity", "mask")):
            number = getattr(m, slot + "_texture")
            if number:
                out[slot + "_texture"] = self.texture(number, use)
        return out

    def profile(self, number):
        """File of the 1-based table: W/sr there, candela here."""
        key = "profile", number
        if key not in self.files:
            table = self.data.profiles[number - 1]
            angles, rows = [degrees(v) for v in table.vertical], table.values.astype(np.float64) * CANDELA
            if angles[-1] < 90 - 1e-4:  # the standard wants the table to end at 90 or 180 degrees
                angles, rows = angles + [min(angles[-1] + 1e-3, 89.9999), 90.0], np.pad(rows, ((0, 0), (0, 2)))
            elif angles[-1] not in (90.0, 180.0):
                last = 90.0 if angles[-1] < 90.001 else 180.0
                if angles[-1] < last - 1e-3:
                    angles, rows = angles + [angles[-1] + 1e-3, last], np.pad(rows, ((0, 0), (0, 2)))
                angles[-1] = last
            around = [degrees(h) for h in table.horizontal]
            around[-1] = 360.0 if len(around) > 1 else 0.0
            text = ["IESNA:LM-63-1995", "[OTHER] Exported from Blender by the Lumicut add-on", "TILT=NONE",
                    f"1 -1 1 {len(angles)} {len(around)} 1 2 0 0 0", "1 1 0"]
            text += [" ".join(f"{v:.9g}" for v in row) for row in (angles, around, *rows)]
            stem = os.path.splitext(os.path.basename(table.name))[0]
            self.files[key] = self.write("profiles/" + plain_name(stem, self.used, ".ies"), "\n".join(text) + "\n")
        return self.files[key]

    def light(self, light):
        kind = ("point", "spot", "rectangle", "disk", "sun")[light.type]
        out = {"type": kind, "unit": "watt", "value": numbers([light.value])[0], "color": numbers(light.color)}
        if light.group:
            out["group"] = light.group
        if light.flags & library.NO_SHADOWS:
            out["shadows"] = False
        if light.mask:
            out["hidden_from"] = hidden_from(light.mask | library.SHADOW_RAYS)
        out |= {key: getattr(light, key) for key in ("receivers", "blockers") if getattr(light, key)}
        if kind != "sun":
            out["position"] = numbers(light.position)
        if kind in ("point", "spot"):
            out["radius"] = numbers([light.radius])[0]
            if light.flags & library.FACING_DISK:
                out["facing_disk"] = True
        if light.profile:
            out |= {"ies": self.profile(light.profile), "direction": numbers(light.direction), "rotation": rotation_of(light)}
        if kind in ("spot", "sun"):
            out["direction"] = numbers(light.direction)
        if kind == "spot":
            out |= {"angle": degrees(light.angle), "blend": numbers([light.blend])[0], "cosine": bool(light.spot_cosine)}
        if kind == "sun":
            out["angular_radius"] = degrees(light.radius)
        if kind in ("rectangle", "disk"):
            out |= {"u": numbers(light.u), "v": numbers(light.v), "spread": min(180.0, degrees(light.spread or math.pi))}
            if light.texture:
                out["texture"] = self.image(light.texture, "radiance")
        return out

    @staticmethod
    def panorama(c):
        kind = ("equirectangular", "fisheye_equidistant", "fisheye_equisolid", "mirror_ball", "equiangular_cube")[c.panorama - 1]
        out = {"type": kind, "matrix": numbers(c.to_world), "near": numbers([c.near_clip])[0], "far": numbers([c.far_clip])[0]}
        if any(c.shift):
            out["shift"] = numbers(c.shift)
        if c.panorama in {library.MIRROR_BALL, library.EQUIANGULAR_CUBE}:
            return out
        if c.panorama == library.EQUIRECTANGULAR:
            return out | {"longitude": [max(-180.0, min(180.0, degrees(a))) for a in c.longitude],
                          "latitude": [max(-90.0, min(90.0, degrees(a))) for a in c.latitude]}
        out["fov"] = min(360.0, degrees(c.fisheye_fov))
        if c.panorama == library.FISHEYE_EQUISOLID:
            out |= {"lens": numbers([c.fisheye_lens])[0], "sensor": numbers(c.sensor)}
        return out

    @staticmethod
    def camera(c):
        if c.panorama:
            return Writer.panorama(c)
        out = {"type": "orthographic" if c.orthographic else "perspective", "matrix": numbers(c.to_world),
               "shift": numbers(c.shift), "near": numbers([c.near_clip])[0], "far": numbers([c.far_clip])[0],
               "pixel_aspect": numbers([c.pixel_aspect])[0]}
        out |= {"height": numbers([c.height])[0]} if c.orthographic else {"fov_y": degrees(c.fov_y)}
        if c.lens_radius > 0:
            out |= {"lens_radius": numbers([c.lens_radius])[0], "focus_distance": numbers([c.focus_distance])[0]}
        return out

    def environment(self, e):
        out = {"color": numbers(e.color)}
        if e.texture:
            out |= {"image": self.image(e.texture, "radiance"), "world_to_map": numbers(e.world_to_map)}
        if e.flags & library.HIDDEN:
            out["hidden"] = True
        if e.mask:
            out["hidden_from"] = hidden_from(e.mask | library.SHADOW_RAYS | library.CAMERA_RAYS)
        if e.group:
            out["group"] = e.group
        return out

    def scene(self, width, height, settings):
        names, taken = [], set()
        for name, _ in self.data.materials:
            names.append(plain_name(name, taken, ""))
        mtl = f"{self.stem}.mtl"
        self.write(f"meshes/{mtl}", "".join(f"newmtl {n}\n" for n in names))
        out = {"description": "Exported from Blender by the Lumicut add-on", "up": "z",
               "image": {"size": [width, height], "samples": settings.samples, **pixel_filter(settings.id_data)},
               "camera": self.camera(self.data.camera),
               "materials": [self.material(n, m) for n, (_, m) in zip(names, self.data.materials)],
               "lights": [self.light(light) for _, light in self.data.lights], "meshes": []}
        if shadow_catcher.is_needed(self.data):
            for (name, _), light in zip(self.data.lights, out["lights"]):
                if name not in self.data.added_lamps:
                    light["shadow_catcher"] = True
        programs = [self.program(1 + i, p) for i, p in enumerate(self.data.images) if isinstance(p, Program)]
        if programs:
            out["programs"] = programs
        if self.data.environment is not None:
            out["environment"] = self.environment(self.data.environment)
        for mesh in self.data.meshes:
            if not mesh.transforms:
                continue
            file = "meshes/" + plain_name(mesh.name, self.used, ".obj")
            self.write(file, obj(mesh, mtl, names))
            out["meshes"].append({"name": mesh.name, "obj": file, "materials": {n: n for n in names},
                                  "instances": [numbers(t) for t in mesh.transforms],
                                  **self.attributes(mesh, file),
                                  **({"group": mesh.group} if mesh.group else {}),
                                  **({"hidden_from": hidden_from(mesh.mask)} if mesh.mask else {}),
                                  **({"shadow_catcher": True} if mesh.catcher else {}),
                                  **links(mesh.links)})
        if not out["meshes"]:
            raise ExportError("the scene has no mesh to export")
        return out


def command_of(path, settings):
    """The command that renders the exported scene as F12 does."""
    words = ["lumicut", "render", str(path), "-i", settings.integrator, "--accel", settings.accel]
    tracing = properties.tracing_of(settings)
    if tracing["builder"]:
        words += ["--builder", tracing["builder"]]
    if not tracing["robust"]:
        words += ["--rays", "fast"]
    if settings.passes > 1:
        words += ["--passes", str(settings.passes)]
    for name, option, default in (("max_seconds", "--seconds", 0), ("target_error", "--target-error", 0),
                                  ("confidence", "--confidence", 0.95)):
        value = properties.text_of(getattr(settings, name))
        if float(value) != default:
            words += [option, value]
    for name, value in properties.parameters_of(settings).items():
        words += ["-p", f"{name}={value}"]
    return words + ["-o", str(path.with_suffix(".exr"))]


def write_scene(path, data, width, height, settings):
    """Writes NAME.json and NAME_files with meshes and textures. Files are written beside their place and moved there
    under names that are free; the scene file, which takes the place of the earlier one at once, is the only file that
    is replaced. So an export that fails or is killed leaves the earlier one whole. Then goes what the earlier export
    wrote, as far as its manifest has it and it is unchanged; other files in NAME_files stay.
    """
    import fcntl

    manifest_name = ".lumicut-export.json"
    path = pathlib.Path(path)
    if path.suffix.lower() != ".json":
        path = path.with_suffix(".json")
    if not path.parent.is_dir():
        raise ExportError(f"{path.parent} is no folder")
    files = path.parent / f"{path.stem}_files"
    target = pathlib.Path(os.path.realpath(path))  # a link stays
    if target.exists() and not target.is_file():
        raise ExportError(f"{path} is no plain file")
    try:
        made = not files.exists()
        files.mkdir(exist_ok=True)
    except FileExistsError:
        raise ExportError(f"{files} stands already and is no folder") from None

    def lock(folder):
        """A descriptor that holds the folder's lock, or None: another export is at work in it."""
        descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return descriptor
        except OSError:
            os.close(descriptor)
            return None

    def stamp(file):
        found = os.lstat(file)
        return [found.st_size, found.st_mtime_ns]

    def remove_earlier(kept):
        """What earlier exports wrote, but for that in the folder `kept`."""
        for manifest in [files / manifest_name, *files.glob(f"*/{manifest_name}")]:
            folder = manifest.parent
            if folder == kept or folder.is_symlink() or not manifest.is_file():
                continue
            try:
                written = json.loads(manifest.read_text())["files"].items()
                for name, old in written:
                    file = folder / name
                    inside = os.path.realpath(file).startswith(os.path.realpath(folder) + os.sep)
                    if inside and file.is_file() and not file.is_symlink() and stamp(file) == old:
                        file.unlink()
                    for parent in list(file.parents)[:-1]:
                        if inside and parent != folder and folder in parent.parents and not any(parent.iterdir()):
                            parent.rmdir()
                manifest.unlink()
                if folder != files and not any(folder.iterdir()):
                    folder.rmdir()
            except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
                continue  # no manifest of ours: nothing in it is taken for ours

    def remove_killed():
        for folder in files.glob(".lumicut-*.part"):
            held = lock(folder) if folder.is_dir() and not folder.is_symlink() else None
            if held is not None:
                shutil.rmtree(folder, ignore_errors=True)
                os.close(held)

    remove_killed()
    beside = pathlib.Path(tempfile.mkdtemp(prefix=".lumicut-", suffix=".part", dir=files))
    held, placed = lock(beside), []
    try:
        content = beside / "content"
        content.mkdir()
        scene = Writer(content, data, path.stem).scene(width, height, settings)
        names = sorted(entry.name for entry in content.iterdir())
        # In NAME_files itself, or in its first free numbered folder where an earlier export or another file stands.
        place = files
        if any(os.path.lexists(files / name) for name in [*names, manifest_name]):
            number = 2
            while os.path.lexists(files / str(number)):
                number += 1
            place = files / str(number)
        prefix = place.relative_to(path.parent).as_posix()

        def moved(name):
            return f"{prefix}/{name}"

        for mesh in scene["meshes"]:
            mesh["obj"] = moved(mesh["obj"])
            for attribute in mesh.get("attributes", ()):
                attribute["file"] = moved(attribute["file"])
        for program in scene.get("programs", ()):
            for step in program["steps"]:
                if "image" in step:
                    step["image"]["file"] = moved(step["image"]["file"])
        for material in scene["materials"]:
            for key in [k for k in material if k.endswith("_texture")]:
                t = material[key]
                if "program" not in t:
                    material[key] = moved(t) if isinstance(t, str) else {**t, "file": moved(t["file"])}
        for light in scene["lights"]:
            if "ies" in light:
                light["ies"] = moved(light["ies"])
        if "image" in scene.get("environment", {}):
            scene["environment"]["image"] = moved(scene["environment"]["image"])
        scene["description"] += ". As F12 renders it: " + " ".join(command_of(pathlib.Path(path.name), settings)[:8])
        fresh = beside / "scene.json"
        fresh.write_text(json.dumps(scene, indent=1) + "\n", encoding="utf-8")
        if target.exists():
            os.chmod(fresh, target.stat().st_mode & 0o777)
        written = sorted(file for file in content.rglob("*") if file.is_file())
        (content / manifest_name).write_text(json.dumps(
            {"files": {file.relative_to(content).as_posix(): stamp(file) for file in written}}, indent=1) + "\n")
        for file in [*written, content / manifest_name, fresh]:  # on the disk before the scene file names them
            with open(file, "rb") as stream:
                os.fsync(stream.fileno())
        if place != files:
            placed.append(place)
            content.rename(place)
        else:
            for name in [*names, manifest_name]:
                placed.append(files / name)
                (content / name).rename(files / name)
        os.replace(fresh, target)
        placed = []
        remove_earlier(place)
    finally:
        for entry in placed:  # the scene file did not come to name them
            shutil.rmtree(entry, ignore_errors=True) if entry.is_dir() else entry.unlink(missing_ok=True)
        shutil.rmtree(beside, ignore_errors=True)
        if held is not None:
            os.close(held)
        if made and not any(files.iterdir()):
            files.rmdir()
    return path
