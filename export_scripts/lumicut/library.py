# SPDX-License-Identifier: Apache-2.0
"""The library from Python: lumicut.h in ctypes, whole, and handles that release themselves.

A test compares every structure, function and constant with plugin/include/lumicut/lumicut.h. Knows nothing of Blender, so that it runs in any Python with numpy.
All functions have their signatures (a missing one truncates pointers); ctypes releases the GIL while a call works.
"""
import ctypes
import ctypes.util
import json
import math
import os
import pathlib
import sys
import typing
from ctypes import POINTER, Structure, c_char_p, c_double, c_float, c_int32, c_uint32, c_uint64, c_void_p

import numpy as np

ABI_MAJOR, ABI_MINOR = 1, 4
OK, INVALID_ARGUMENT, INVALID_STATE, UNSUPPORTED, OUT_OF_MEMORY, CANCELLED, INTERNAL = range(7)
IDLE, RUNNING, DONE, STOPPED, FAILED = range(5)
FLOAT, INT, BOOL, CHOICE = range(4)
UINT8, FLOAT32 = 0, 1
ROBUST, FAST = 1, 2  # of SceneDesc.robust
SRGB, CLAMP, NEAREST, BY_VIEW, BLEND_STORED = 1, 2, 4, 8, 16
EMIT_BOTH_SIDES, PHONG, GGX, NO_FRESNEL, BURLEY, SHADOWS_PASS, HOLDOUT, BUMP_SHADOWS = 1, 2, 4, 8, 16, 32, 64, 128
OREN_NAYAR, FACETS_ONCE, OPEN_GLASS, BRIGHT_LOBE, DIFFUSE_ONCE = 256, 512, 1024, 2048, 4096
POINT, SPOT, RECTANGLE, DISK, SUN = range(5)
FACING_DISK, NO_SHADOWS = 1, 2  # of Light.flags
EQUIRECTANGULAR, FISHEYE_EQUIDISTANT, FISHEYE_EQUISOLID, MIRROR_BALL, EQUIANGULAR_CUBE = 1, 2, 3, 4, 5  # of Camera.panorama
BOX, GAUSSIAN, BLACKMAN_HARRIS = range(3)  # of RenderDesc.filter
RADIOMETRIC, WATT = 0, 1
HIDDEN = 1  # of Environment.flags
CAMERA_RAYS, DIFFUSE_RAYS, GLOSSY_RAYS, TRANSMISSION_RAYS, SHADOW_RAYS = 1, 2, 4, 8, 16  # of Mesh.mask, Light.mask, Environment.mask
RAYS = {"camera": CAMERA_RAYS, "diffuse": DIFFUSE_RAYS, "glossy": GLOSSY_RAYS, "transmission": TRANSMISSION_RAYS, "shadow": SHADOW_RAYS}
ALL_RAYS = sum(RAYS.values())
CHECKPOINTS, ILLUMINANCE, GROUPS, DENOISE, KEEP_FIREFLIES, DIRECT = 1, 2, 4, 8, 16, 32  # of RenderDesc.flags
VIRTUAL_LIGHTS, LIGHT_GROUPS, COMPENSATION, SAVED_STATE, VIEW_INDEPENDENT, ALL_LIGHTS = 1, 2, 4, 8, 16, 32  # traits
SOURCE_PATH, SOURCE_POINT, SOURCE_AREA = range(3)  # of VplOrigin.source
VPL_OMNI, VPL_ORIENTED, VPL_DIRECTIONAL, VPL_SPOT, VPL_SPHERE = range(5)
FOREVER = NO_ID = 0xFFFFFFFF
# Operations of texture programs, LUMICUT_OP_..., from 0 on; and the domains of attributes.
PROGRAM_OPS = ("uv attribute position normal to_viewer behind camera transform math vector grey separate combine clamp map_range "
               "mapping rotate mix color ramp curves fresnel bump normal_map noise musgrave voronoi wave magic brick checker "
               "gradient white_noise project image").split()
PROGRAM_INPUTS = (0, 0, 0, 0, 0, 0, 0, 1, 3, 3, 1, 1, 3, 3, 6, 4, 4, 3, 4, 1, 2, 2, 5, 2, 8, 7, 5, 6, 2, 6, 1, 1, 2, 1, 3)
OF_VERTICES, OF_TRIANGLES, OF_INSTANCES = range(3)


class Error(RuntimeError):
    """A call failed; the text is the library's own and names field and value."""

    def __init__(self, code, text):
        super().__init__(text)
        self.code = code


class Cancelled(Error):
    pass


class LibraryMissing(RuntimeError):
    """No usable library; the text says what was tried, and why each was refused."""


class Descriptor(Structure):
    """Fills struct_size, the growth rule's first field."""

    def __init__(self, **fields):
        super().__init__(**fields)
        self.struct_size = ctypes.sizeof(self)


LOG_FUNCTION = ctypes.CFUNCTYPE(None, c_void_p, c_int32, c_char_p)


class Ray(Structure):
    _fields_ = [("org_x", c_float), ("org_y", c_float), ("org_z", c_float), ("tnear", c_float), ("dir_x", c_float),
                ("dir_y", c_float), ("dir_z", c_float), ("time", c_float), ("tfar", c_float), ("mask", c_uint32),
                ("id", c_uint32), ("flags", c_uint32)]


class Hit(Structure):
    _fields_ = [("ng_x", c_float), ("ng_y", c_float), ("ng_z", c_float), ("u", c_float), ("v", c_float),
                ("prim_id", c_uint32), ("geom_id", c_uint32), ("inst_id", c_uint32)]


class Rayhit(Structure):
    _fields_ = [("ray", Ray), ("hit", Hit)]


class Vpl(Structure):
    _fields_ = [("position", c_float * 3), ("kind", c_uint32), ("normal", c_float * 3), ("group", c_uint32),
                ("intensity", c_float * 3), ("cos_outer", c_float), ("blend", c_float), ("spot_cosine", c_float),
                ("spread_tan", c_float), ("profile", c_uint32)]


class Point(Structure):
    _fields_ = [("position", c_float * 3), ("material", c_uint32), ("normal", c_float * 3), ("u", c_float),
                ("geometric_normal", c_float * 3), ("v", c_float), ("to_viewer", c_float * 3), ("pixel", c_uint32)]


INTERSECT_FUNCTION = ctypes.CFUNCTYPE(None, c_void_p, POINTER(Rayhit), c_uint64)
OCCLUDED_FUNCTION = ctypes.CFUNCTYPE(None, c_void_p, POINTER(Ray), c_uint64)


class DeviceDesc(Descriptor):
    _fields_ = [("struct_size", c_uint32), ("abi_major", c_uint32), ("threads", c_int32), ("verbosity", c_int32),
                ("log", LOG_FUNCTION), ("user", c_void_p)]


class Status(Descriptor):
    _fields_ = [("struct_size", c_uint32), ("state", c_int32), ("phase", c_char_p), ("fraction", c_double),
                ("seconds", c_double), ("tiles_done", c_uint64), ("tiles_total", c_uint64), ("passes_done", c_uint32),
                ("passes_total", c_uint32), ("error", c_double)]


class AccelDesc(Descriptor):
    _fields_ = [("struct_size", c_uint32), ("robust", c_uint32), ("kind", c_char_p), ("builder", c_char_p),
                ("positions", c_void_p), ("position_count", c_uint64), ("position_stride", c_uint64),
                ("indices", c_void_p), ("triangle_count", c_uint64), ("boxes", c_void_p), ("box_count", c_uint64)]


class AccelInfo(Descriptor):
    _fields_ = [("struct_size", c_uint32), ("node_count", c_uint32), ("primitive_count", c_uint64),
                ("bytes", c_uint64), ("build_seconds", c_double), ("expected_boxes", c_double),
                ("expected_primitives", c_double), ("expected_cost", c_double), ("lower", c_float * 3),
                ("upper", c_float * 3)]


class AccelNodeInfo(Descriptor):
    _fields_ = [("struct_size", c_uint32), ("left", c_uint32), ("right", c_uint32), ("first", c_uint32),
                ("count", c_uint32), ("lower", c_float * 3), ("upper", c_float * 3)]


class Trace(Descriptor):
    _fields_ = [("struct_size", c_uint32), ("batch", c_uint32), ("intersect", INTERSECT_FUNCTION),
                ("occluded", OCCLUDED_FUNCTION), ("user", c_void_p)]


class SceneDesc(Descriptor):
    _fields_ = [("struct_size", c_uint32), ("robust", c_uint32), ("accel", c_char_p), ("builder", c_char_p)]


class Texture(Descriptor):
    _fields_ = [("struct_size", c_uint32), ("width", c_uint32), ("height", c_uint32), ("channels", c_uint32),
                ("format", c_uint32), ("flags", c_uint32), ("pixels", c_void_p), ("program", c_void_p)]


class Program(Descriptor):
    _fields_ = [("struct_size", c_uint32), ("instruction_count", c_uint32), ("constant_count", c_uint32),
                ("table_count", c_uint32), ("instructions", c_void_p), ("constants", c_void_p), ("table", c_void_p)]


class Attribute(Descriptor):
    _fields_ = [("struct_size", c_uint32), ("id", c_uint32), ("components", c_uint32), ("domain", c_uint32),
                ("values", c_void_p)]


class Material(Descriptor):
    _fields_ = [("struct_size", c_uint32), ("flags", c_uint32), ("diffuse", c_float * 3), ("shininess", c_float),
                ("specular", c_float * 3), ("opacity", c_float), ("emission", c_float * 3),
                ("diffuse_texture", c_int32), ("specular_texture", c_int32), ("opacity_texture", c_int32),
                ("emission_texture", c_int32), ("roughness", c_float), ("metallic", c_float), ("ior", c_float),
                ("transmission", c_float), ("normal_texture", c_int32), ("normal_strength", c_float),
                ("height_texture", c_int32), ("bump_distance", c_float), ("bump_strength", c_float),
                ("roughness_texture", c_int32), ("metallic_texture", c_int32), ("coat", c_float),
                ("coat_roughness", c_float), ("coat_ior", c_float), ("translucency", c_float * 3),
                ("translucency_texture", c_int32), ("specular_tint", c_float * 3),
                ("absorption", c_float * 3), ("diffuse_roughness", c_float), ("diffuse_roughness_texture", c_int32)]


class Mesh(Descriptor):
    _fields_ = [("struct_size", c_uint32), ("mask", c_uint32), ("positions", c_void_p), ("normals", c_void_p),
                ("uvs", c_void_p), ("vertex_count", c_uint64), ("indices", c_void_p), ("triangle_count", c_uint64),
                ("materials", c_void_p), ("transforms", c_void_p), ("transform_count", c_uint64),
                ("material", c_uint32), ("group", c_uint32), ("attributes", c_void_p), ("attribute_count", c_uint64),
                ("not_lit_by", c_uint32), ("not_blocking", c_uint32), ("receivers", c_uint32), ("blockers", c_uint32)]


class Light(Descriptor):
    _fields_ = [("struct_size", c_uint32), ("type", c_uint32), ("unit", c_uint32), ("group", c_uint32),
                ("color", c_float * 3), ("value", c_float), ("position", c_float * 3), ("radius", c_float),
                ("direction", c_float * 3), ("angle", c_float), ("u", c_float * 3), ("blend", c_float),
                ("v", c_float * 3), ("spread", c_float), ("spot_cosine", c_uint32), ("profile", c_uint32),
                ("tangent", c_float * 3), ("flags", c_uint32), ("mask", c_uint32), ("receivers", c_uint32),
                ("blockers", c_uint32), ("texture", c_int32)]


class Profile(Descriptor):
    _fields_ = [("struct_size", c_uint32), ("vertical_count", c_uint32), ("horizontal_count", c_uint32),
                ("reserved", c_uint32), ("vertical", c_void_p), ("horizontal", c_void_p), ("values", c_void_p)]


class Environment(Descriptor):
    _fields_ = [("struct_size", c_uint32), ("group", c_uint32), ("color", c_float * 3), ("texture", c_int32),
                ("world_to_map", c_float * 9), ("flags", c_uint32), ("mask", c_uint32)]


class Camera(Descriptor):
    _fields_ = [("struct_size", c_uint32), ("orthographic", c_uint32), ("to_world", c_float * 12),
                ("fov_y", c_float), ("height", c_float), ("shift", c_float * 2), ("near_clip", c_float),
                ("far_clip", c_float), ("pixel_aspect", c_float), ("lens_radius", c_float),
                ("focus_distance", c_float), ("panorama", c_uint32), ("fisheye_fov", c_float), ("fisheye_lens", c_float),
                ("sensor", c_float * 2), ("longitude", c_float * 2), ("latitude", c_float * 2)]


class IntegratorInfo(Descriptor):
    _fields_ = [("struct_size", c_uint32), ("param_count", c_uint32), ("id", c_char_p), ("label", c_char_p),
                ("description", c_char_p), ("source", c_char_p), ("traits", c_uint32), ("reserved", c_uint32),
                ("interactive", c_char_p), ("preview", c_char_p), ("draft", c_char_p), ("good", c_char_p),
                ("reference", c_char_p)]


class ParamInfo(Descriptor):
    _fields_ = [("struct_size", c_uint32), ("type", c_uint32), ("id", c_char_p), ("label", c_char_p),
                ("description", c_char_p), ("unit", c_char_p), ("choices", c_char_p), ("default_text", c_char_p),
                ("minimum", c_double), ("maximum", c_double)]


class RenderDesc(Descriptor):
    _fields_ = [("struct_size", c_uint32), ("width", c_uint32), ("height", c_uint32), ("samples", c_uint32),
                ("crop", c_uint32 * 4), ("tile_size", c_uint32), ("passes", c_uint32), ("max_seconds", c_float),
                ("target_error", c_float), ("confidence", c_float), ("flags", c_uint32), ("checkpoint", c_void_p),
                ("checkpoint_size", c_uint64), ("filter", c_uint32), ("filter_width", c_float),
                ("lobes", c_uint32), ("occlusion", c_float)]


class Tile(Descriptor):
    _fields_ = [("struct_size", c_uint32), ("x0", c_uint32), ("y0", c_uint32), ("x1", c_uint32), ("y1", c_uint32)]


class ChannelInfo(Descriptor):
    _fields_ = [("struct_size", c_uint32), ("components", c_uint32), ("name", c_char_p), ("description", c_char_p)]


# ---- lumicut_lights.h


class VplOrigin(Structure):
    _fields_ = [("source", c_uint32), ("offset", c_float), ("area", c_float), ("mirror", c_float * 3), ("slope", c_float),
                ("again", c_float), ("retro", c_float), ("dim", c_float), ("falloff", c_float), ("lobe_mean", c_float)]


class VplSet(Descriptor):
    _fields_ = [("struct_size", c_uint32), ("reserved", c_uint32), ("count", c_uint64), ("lights", c_void_p),
                ("origins", c_void_p), ("light_paths", c_uint64), ("emitter_samples", c_uint64)]


class LightsExtension(Structure):
    _fields_ = [("struct_size", c_uint32), ("reserved", c_uint32),
                ("get", ctypes.CFUNCTYPE(c_int32, c_void_p, POINTER(VplSet))),
                ("set", ctypes.CFUNCTYPE(c_int32, c_void_p, POINTER(VplSet)))]


# ---- lumicut_hits.h


class FirstHit(Structure):
    _fields_ = [("mesh", c_uint32), ("instance", c_uint32), ("triangle", c_uint32), ("material", c_uint32), ("u", c_float),
                ("v", c_float)]


class HitsExtension(Structure):
    _fields_ = [("struct_size", c_uint32), ("reserved", c_uint32),
                ("trace", ctypes.CFUNCTYPE(c_int32, c_void_p, POINTER(RenderDesc), c_uint64, c_uint64, POINTER(Tile), c_void_p))]


# ---- lumicut_presets.h


class PresetInfo(Structure):
    _fields_ = [("id", c_char_p), ("label", c_char_p), ("description", c_char_p), ("integrator", c_char_p), ("parameters", c_char_p),
                ("samples", c_uint32), ("passes", c_uint32), ("flags", c_uint32), ("target_error", c_float)]


class PresetsExtension(Structure):
    _fields_ = [("struct_size", c_uint32), ("count", c_uint32), ("presets", POINTER(PresetInfo)), ("usual", c_uint32),
                ("reserved", c_uint32)]


# The same records as NumPy has them.
VPL, VPL_ORIGIN, POINT_TO_SHADE, RAY, RAYHIT, FIRST_HIT = map(np.dtype, (Vpl, VplOrigin, Point, Ray, Rayhit, FirstHit))

# Bytes that the C compiler gives each structure; load() refuses to go on where ctypes lays one out differently.
SIZES = {Ray: 48, Hit: 32, Rayhit: 80, Vpl: 64, Point: 64, DeviceDesc: 32, Status: 64, AccelDesc: 80, AccelInfo: 80,
         AccelNodeInfo: 44, Trace: 32, SceneDesc: 24, Texture: 40, Material: 172, Mesh: 120, Light: 136, Profile: 40,
         Environment: 68, Camera: 128, IntegratorInfo: 88, ParamInfo: 72, RenderDesc: 88, Tile: 20, ChannelInfo: 24}

RESULT = c_int32
HANDLE = c_void_p
FUNCTIONS = {
    "version": (c_char_p, [POINTER(c_uint32), POINTER(c_uint32)]),
    "last_error": (c_char_p, []),
    "device_create": (RESULT, [POINTER(DeviceDesc), POINTER(HANDLE)]),
    "retain": (None, [HANDLE]),
    "release": (None, [HANDLE]),
    "scene_create": (RESULT, [HANDLE, POINTER(SceneDesc), POINTER(HANDLE)]),
    "scene_set_materials": (RESULT, [HANDLE, POINTER(Material), c_uint64]),
    "scene_add_mesh": (RESULT, [HANDLE, POINTER(Mesh), POINTER(c_uint32)]),
    "scene_set_lights": (RESULT, [HANDLE, POINTER(Light), c_uint64]),
    "scene_set_camera": (RESULT, [HANDLE, POINTER(Camera)]),
    "scene_commit": (RESULT, [HANDLE]),
    "integrator_create": (RESULT, [HANDLE, c_char_p, POINTER(HANDLE)]),
    "integrator_set": (RESULT, [HANDLE, c_char_p, c_char_p]),
    "integrator_get": (c_char_p, [HANDLE, c_char_p]),
    "render_start": (RESULT, [HANDLE, HANDLE, POINTER(RenderDesc), POINTER(HANDLE)]),
    "render_wait": (RESULT, [HANDLE, c_uint32, POINTER(Status)]),
    "render_read": (RESULT, [HANDLE, c_char_p, POINTER(Tile), c_void_p]),
    "render_next_tile": (RESULT, [HANDLE, POINTER(Tile)]),
    "render_groups": (RESULT, [HANDLE, POINTER(POINTER(c_uint32)), POINTER(c_uint64)]),
    "render_checkpoint": (RESULT, [HANDLE, POINTER(c_void_p), POINTER(c_uint64)]),
    "get_status": (RESULT, [HANDLE, POINTER(Status)]),
    "cancel": (RESULT, [HANDLE]),
    "stats_json": (c_char_p, [HANDLE]),
    "scene_set_textures": (RESULT, [HANDLE, POINTER(Texture), c_uint64]),
    "scene_set_profiles": (RESULT, [HANDLE, POINTER(Profile), c_uint64]),
    "scene_set_environment": (RESULT, [HANDLE, POINTER(Environment)]),
    "scene_update_mesh": (RESULT, [HANDLE, c_uint32, c_void_p, c_void_p, c_void_p]),
    "get_integrator_info": (RESULT, [c_uint32, POINTER(IntegratorInfo)]),
    "get_param_info": (RESULT, [c_char_p, c_uint32, POINTER(ParamInfo)]),
    "get_channel_info": (RESULT, [c_uint32, POINTER(ChannelInfo)]),
    "get_extension": (c_void_p, [c_char_p]),
    "integrator_set_lights": (RESULT, [HANDLE, POINTER(Vpl), c_uint64]),
    "integrator_prepare": (RESULT, [HANDLE, HANDLE]),
    "integrator_get_lights": (RESULT, [HANDLE, POINTER(POINTER(Vpl)), POINTER(c_uint64)]),
    "integrator_shade": (RESULT, [HANDLE, POINTER(Point), c_uint64, c_void_p]),
    "scene_set_trace": (RESULT, [HANDLE, POINTER(Trace)]),
    "accel_build": (RESULT, [HANDLE, POINTER(AccelDesc), POINTER(HANDLE)]),
    "accel_get_info": (RESULT, [HANDLE, POINTER(AccelInfo)]),
    "accel_get_node": (RESULT, [HANDLE, c_uint32, POINTER(AccelNodeInfo)]),
    "accel_get_primitives": (RESULT, [HANDLE, POINTER(POINTER(c_uint32)), POINTER(c_uint64)]),
    "accel_intersect": (RESULT, [HANDLE, POINTER(Rayhit), c_uint64]),
    "accel_occluded": (RESULT, [HANDLE, POINTER(Ray), c_uint64]),
}


def library_name():
    if sys.platform == "darwin":
        return "liblumicut.dylib"
    return "lumicut.dll" if os.name == "nt" else "liblumicut.so.1"


def candidates(preference="", folder=None):
    """(origin, path) to try in order: the one in the add-on's folder, the preference's, the system's."""
    found = []
    bundled = pathlib.Path(folder) / library_name() if folder else None
    if bundled is not None and bundled.exists():
        found.append(("bundled with the add-on", str(bundled)))
    if preference:
        path = pathlib.Path(preference)
        found.append(("preference", str(path / library_name() if path.is_dir() else path)))
    if os.environ.get("LUMICUT_LIBRARY"):
        found.append(("environment variable LUMICUT_LIBRARY", os.environ["LUMICUT_LIBRARY"]))
    found.append(("system", library_name()))
    return found


def load_file(path):
    """The library in a file, all signatures declared. OSError, or LibraryMissing with what does not fit."""
    dll = ctypes.CDLL(path)
    missing = [name for name in FUNCTIONS if not hasattr(dll, "lumicut_" + name)]
    if missing:
        raise LibraryMissing("lacks the functions " + ", ".join("lumicut_" + name for name in missing))
    for name, (result, arguments) in FUNCTIONS.items():
        function = getattr(dll, "lumicut_" + name)
        function.restype, function.argtypes = result, arguments
    major, minor = c_uint32(), c_uint32()
    version = dll.lumicut_version(ctypes.byref(major), ctypes.byref(minor)).decode()
    if major.value != ABI_MAJOR:
        raise LibraryMissing(f"Lumicut {version} speaks ABI {major.value}.{minor.value}, "
                             f"this add-on ABI {ABI_MAJOR}: install the add-on and the library of one release")
    wrong = [f"{cls.__name__} has {ctypes.sizeof(cls)} bytes instead of {size}"
             for cls, size in SIZES.items() if ctypes.sizeof(cls) != size]
    if wrong:
        raise LibraryMissing("this Python lays structures out differently: " + "; ".join(wrong))
    return dll, version, (major.value, minor.value)


QUALITIES = ("interactive", "preview", "draft", "good", "reference")  # fields of IntegratorInfo
ANY_TRAIT = VIRTUAL_LIGHTS | LIGHT_GROUPS | COMPENSATION  # of libraries before ABI 1.4, which do not tell


class IntegratorRow(typing.NamedTuple):
    """All texts str. `traits`: VIRTUAL_LIGHTS ...; `presets`: {quality: {parameter: text}}, empty without a suggestion."""
    id: str
    label: str
    description: str
    source: str
    parameters: list
    traits: int
    presets: dict


class PresetRow(typing.NamedTuple):
    """All texts str. `parameters`: {name: text} of the integrator; the rest as in lumicut_render_desc."""
    id: str
    label: str
    description: str
    integrator: str
    parameters: dict
    samples: int
    passes: int
    target_error: float
    flags: int


def _pairs(text):
    return dict(pair.split("=", 1) for pair in (text or b"").decode().split())


class Library:
    """The loaded library and its tables. Raises Error where a call fails, Cancelled where it was cancelled."""

    def __init__(self, preference="", folder=None):
        """`preference`: a file or folder to look in. `folder`: where a host has its own, looked in first."""
        tried = []
        for origin, path in candidates(preference, folder):
            try:
                self.dll, self.version, self.abi = load_file(path)
            except (OSError, LibraryMissing) as reason:
                tried.append(f"{origin}: {path}: {reason}")
                continue
            self.origin, self.path = origin, path
            return
        bundled = any(line.startswith("bundled") for line in tried)
        cure = ("Restart Blender if the add-on was just updated. Otherwise install the zip that build_zip.sh makes, whose library needs "
                "nothing of the machine," if bundled else "Install it,")
        raise LibraryMissing("no usable Lumicut library. Tried " + " | ".join(tried) + f". {cure} or name its file in LUMICUT_LIBRARY or in the add-on's preferences")

    def check(self, code):
        if code == OK:
            return
        text = (self.dll.lumicut_last_error() or b"").decode(errors="replace")
        raise (Cancelled if code == CANCELLED else Error)(code, text or f"error {code}")

    def presets(self):
        """([PresetRow] from the quickest on, id of the one to take when nobody chose); ([], None): the library has none."""
        table = self.dll.lumicut_get_extension(b"lumicut.presets/1")
        if not table:
            return [], None
        table = ctypes.cast(table, POINTER(PresetsExtension))[0]
        rows = [PresetRow(p.id.decode(), p.label.decode(), p.description.decode(), p.integrator.decode(), _pairs(p.parameters),
                          p.samples, p.passes, p.target_error, p.flags) for p in table.presets[:table.count]]
        return rows, rows[table.usual].id

    def integrators(self):
        """[IntegratorRow] as the library declares them."""
        result = []
        while True:
            info = IntegratorInfo()
            if self.dll.lumicut_get_integrator_info(len(result), ctypes.byref(info)) != OK:
                return result
            parameters = []
            for i in range(info.param_count):
                p = ParamInfo()
                self.check(self.dll.lumicut_get_param_info(info.id, i, ctypes.byref(p)))
                parameters.append({name: getattr(p, name).decode() for name in
                                   ("id", "label", "description", "unit", "choices", "default_text")} |
                                  {"type": p.type, "minimum": p.minimum, "maximum": p.maximum})
            presets = {name: _pairs(getattr(info, name)) for name in QUALITIES}
            result.append(IntegratorRow(info.id.decode(), info.label.decode(), info.description.decode(),
                                        info.source.decode(), parameters, info.traits or ANY_TRAIT, presets))

    def channels(self):
        """{name: components}"""
        result = {}
        while True:
            info = ChannelInfo()
            if self.dll.lumicut_get_channel_info(len(result), ctypes.byref(info)) != OK:
                return result
            result[info.name.decode()] = info.components


class Handle:
    """One reference to an object of the library; released when it is closed or collected."""

    def __init__(self, library):
        self.library, self.pointer = library, c_void_p()

    def _create(self, name, *arguments):
        self.library.check(getattr(self.library.dll, "lumicut_" + name)(*arguments, ctypes.byref(self.pointer)))

    def _call(self, name, *arguments):
        self.library.check(getattr(self.library.dll, "lumicut_" + name)(self.pointer, *arguments))

    def cancel(self):
        if self.pointer:
            self.library.dll.lumicut_cancel(self.pointer)

    def status(self):
        status = Status()
        self._call("get_status", ctypes.byref(status))
        return status

    def stats(self):
        text = self.library.dll.lumicut_stats_json(self.pointer)
        return json.loads(text) if text else {}

    def close(self):
        if self.pointer:
            self.library.dll.lumicut_release(self.pointer)
            self.pointer = c_void_p()

    def __del__(self):
        self.close()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()


class Device(Handle):
    def __init__(self, library, threads=0, log=None, verbosity=1):
        """log(level, text) is called from any thread."""
        super().__init__(library)
        self._log = LOG_FUNCTION((lambda _, level, text: log(level, text.decode(errors="replace"))) if log else 0)
        self._create("device_create", ctypes.byref(
            DeviceDesc(abi_major=ABI_MAJOR, threads=threads, verbosity=verbosity, log=self._log)))


def _array(cls, items):
    return (cls * len(items))(*items), len(items)


def _rows(name, a, dtype, width):
    """The array as the library wants it: packed, of this type, `width` columns. None stays None. What would become another
    array is refused: other shapes than (n, width), flat, and (n, 3, 4) for 12; indices that are not whole or beyond 32 bits."""
    if a is None:
        return None
    a = np.asarray(a)
    flat, rows = a.ndim == 1 and a.size % width == 0, a.ndim == 2 and a.shape[1] == width
    if not (flat or rows or a.size == 0 or width == 12 and a.ndim == 3 and a.shape[1:] == (3, 4)):
        raise Error(INVALID_ARGUMENT, f"{name}: has the shape {a.shape}, not (n, {width})")
    if dtype == np.uint32 and a.size and (a.dtype.kind not in "iu" or a.min() < 0 or a.max() > NO_ID):
        raise Error(INVALID_ARGUMENT, f"{name}: whole numbers from 0 to {NO_ID} are wanted")
    if a.size and a.dtype.kind not in "fiu":
        raise Error(INVALID_ARGUMENT, f"{name}: are of the type {a.dtype}, not numbers")
    a = np.ascontiguousarray(a, dtype)
    return a.reshape(-1, width) if width > 1 else a.reshape(-1)


class Scene(Handle):
    def __init__(self, device, accel="bvh", builder=None, robust=True):
        super().__init__(device.library)
        self.device = device
        self._create("scene_create", device.pointer, ctypes.byref(SceneDesc(
            robust=ROBUST if robust else FAST, accel=accel.encode(), builder=builder.encode() if builder else None)))

    def set_textures(self, textures):
        """(pixels, flags) each: pixels (h, w, channels) of uint8 or float32, top row first. Or a program: (instructions
        (n, 12) of int32, constants (k, 3) and table of float32)."""
        items, kept = [], []
        for texture in textures:
            if len(texture) == 3:
                instructions, constants, table = kept_arrays = (_rows("instructions", texture[0], np.int32, 12), _rows("constants", texture[1], np.float32, 3),
                                                                _rows("table", texture[2], np.float32, 1))
                program = Program(instruction_count=len(instructions), constant_count=len(constants), table_count=len(table),
                                  instructions=instructions.ctypes.data, constants=constants.ctypes.data, table=table.ctypes.data)
                kept.append((program, kept_arrays))
                items.append(Texture(program=ctypes.addressof(program)))
                continue
            pixels, flags = texture
            if pixels.ndim != 3:
                raise Error(INVALID_ARGUMENT, f"textures[{len(items)}]: have the shape {pixels.shape}, not (h, w, channels)")
            height, width, channels = pixels.shape
            if pixels.dtype not in (np.uint8, np.float32):
                raise Error(INVALID_ARGUMENT, f"textures[{len(items)}]: are of the type {pixels.dtype}, not uint8 or float32")
            pixels = np.ascontiguousarray(pixels)
            kept.append(pixels)
            items.append(Texture(width=width, height=height, channels=channels, flags=flags, pixels=pixels.ctypes.data,
                                 format=UINT8 if pixels.dtype == np.uint8 else FLOAT32))
        self._call("scene_set_textures", *_array(Texture, items))

    def set_materials(self, materials):
        self._call("scene_set_materials", *_array(Material, materials))

    def set_lights(self, lights):
        self._call("scene_set_lights", *_array(Light, lights))

    def first_hits(self, frame, seed, number, rect):
        """(pixels of the rectangle, samples) of dtype FIRST_HIT: what the rays of pass `number` meet of a frame that a
        RenderDesc describes."""
        table = self.library.dll.lumicut_get_extension(b"lumicut.hits/1")
        if not table:
            raise Error(UNSUPPORTED, "the library lacks the extension lumicut.hits/1")
        x0, y0, x1, y1 = rect
        out = np.empty(((x1 - x0) * (y1 - y0), max(1, frame.samples)), FIRST_HIT)
        tile = Tile(x0=x0, y0=y0, x1=x1, y1=y1)
        trace = ctypes.cast(table, POINTER(HitsExtension))[0].trace
        self.library.check(trace(self.pointer, ctypes.byref(frame), seed, number, ctypes.byref(tile), out.ctypes.data))
        return out

    def set_profiles(self, profiles):
        """(vertical, horizontal, values) each, before the lights that name them: radians and W/sr, a row of `values` for
        each horizontal angle."""
        arrays = [[np.ascontiguousarray(a, np.float32) for a in profile] for profile in profiles]
        items = [Profile(vertical_count=v.size, horizontal_count=h.size, vertical=v.ctypes.data,
                         horizontal=h.ctypes.data, values=w.ctypes.data) for v, h, w in arrays]
        for v, h, w in arrays:
            if w.size != v.size * h.size:
                raise Error(INVALID_ARGUMENT, f"profile: {w.size} values for {v.size} x {h.size} angles")
        self._call("scene_set_profiles", *_array(Profile, items))

    def add_mesh(self, positions, indices, normals=None, uvs=None, materials=None, material=0, transforms=None, group=0, mask=0,
                 attributes=(), links=(0, 0, 0, 0)):
        """`attributes`: (id, domain, values) each, a row of `values` for each place. `links`: Mesh.not_lit_by, not_blocking,
        receivers, blockers."""
        positions, normals = _rows("positions", positions, np.float32, 3), _rows("normals", normals, np.float32, 3)
        uvs, transforms = _rows("uvs", uvs, np.float32, 2), _rows("transforms", transforms, np.float32, 12)
        indices, materials = _rows("indices", indices, np.uint32, 3), _rows("materials", materials, np.uint32, 1)
        for name, a in (("normals", normals), ("uvs", uvs)):
            if a is not None and len(a) != len(positions):
                raise Error(INVALID_ARGUMENT, f"{name}: {len(a)} for {len(positions)} vertices")
        if materials is not None and len(materials) != len(indices):
            raise Error(INVALID_ARGUMENT, f"materials: {len(materials)} for {len(indices)} triangles")

        def address(a):
            return None if a is None else a.ctypes.data

        counts = {OF_VERTICES: len(positions), OF_TRIANGLES: len(indices), OF_INSTANCES: 1 if transforms is None else len(transforms)}
        arrays = []
        for number, domain, values in attributes:
            values = np.ascontiguousarray(values, np.float32)
            if values.ndim != 2 or len(values) != counts[domain]:
                raise Error(INVALID_ARGUMENT, f"attribute {number}: {values.shape} values for {counts[domain]} places")
            arrays.append((number, domain, values))
        described = (Attribute * len(arrays))(*(Attribute(id=number, components=values.shape[1], domain=domain, values=values.ctypes.data)
                                                for number, domain, values in arrays))
        mesh = Mesh(positions=address(positions), normals=address(normals), uvs=address(uvs),
                    vertex_count=len(positions), indices=address(indices), triangle_count=len(indices),
                    materials=address(materials), material=material, transforms=address(transforms),
                    transform_count=0 if transforms is None else len(transforms), group=group, mask=mask,
                    attributes=ctypes.addressof(described) if arrays else None, attribute_count=len(arrays))
        mesh.not_lit_by, mesh.not_blocking, mesh.receivers, mesh.blockers = links
        self._call("scene_add_mesh", ctypes.byref(mesh), ctypes.byref(c_uint32()))

    def set_environment(self, environment):
        self._call("scene_set_environment", None if environment is None else ctypes.byref(environment))

    def set_camera(self, camera):
        self._call("scene_set_camera", ctypes.byref(camera))

    def commit(self):
        self._call("scene_commit")


class Integrator(Handle):
    def __init__(self, device, name):
        super().__init__(device.library)
        self._create("integrator_create", device.pointer, name.encode())

    def set(self, name, value):
        self._call("integrator_set", name.encode(), str(value).encode())
        return self

    def get(self, name):
        text = self.library.dll.lumicut_integrator_get(self.pointer, name.encode())
        if text is None:
            self.library.check(INVALID_ARGUMENT)
        return text.decode()

    def prepare(self, scene):
        """Traces the virtual lights and builds what the method needs of them."""
        self._call("integrator_prepare", scene.pointer)

    def set_lights(self, lights, origins=None):
        """Virtual lights in place of those traced: an array of dtype VPL, none to trace again. With `origins`, as lights()
        gives them, the image is the one that they came from."""
        lights = np.ascontiguousarray(lights, VPL)
        if origins is None:
            self._call("integrator_set_lights", lights.ctypes.data_as(POINTER(Vpl)), lights.size)
            return
        drawn, origins = getattr(origins, "emitter_samples", 0), np.ascontiguousarray(origins, VPL_ORIGIN)
        if origins.size != lights.size:
            raise Error(INVALID_ARGUMENT, f"origins: {origins.size} for {lights.size} lights")
        samples = max(drawn, int((origins["source"] == SOURCE_AREA).sum()))
        vpls = VplSet(count=lights.size, lights=lights.ctypes.data, origins=origins.ctypes.data, emitter_samples=samples)
        self.library.check(self._extension().set(self.pointer, ctypes.byref(vpls)))

    def lights(self):
        """(lights, origins) after prepare: copies, of dtypes VPL and VPL_ORIGIN."""
        vpls = VplSet()
        self.library.check(self._extension().get(self.pointer, ctypes.byref(vpls)))
        lights = _copied(vpls.lights, vpls.count, VPL)
        origins = _copied(vpls.origins, vpls.count, VPL_ORIGIN).view(Origins)
        origins.emitter_samples = vpls.emitter_samples
        return lights, origins

    def shade(self, points):
        """(n, 3) radiance towards the viewer of an array of dtype POINT_TO_SHADE, after prepare."""
        points = np.ascontiguousarray(points, POINT_TO_SHADE)
        out = np.empty((points.size, 3), np.float32)
        self._call("integrator_shade", points.ctypes.data_as(POINTER(Point)), points.size, out.ctypes.data)
        return out

    def _extension(self):
        table = self.library.dll.lumicut_get_extension(b"lumicut.lights/1")
        if not table:
            raise Error(UNSUPPORTED, "the library lacks the extension lumicut.lights/1")
        return ctypes.cast(table, POINTER(LightsExtension))[0]


class Origins(np.ndarray):
    """An array of VPL_ORIGIN. `emitter_samples`: how many places were drawn on emitters with extent."""

    emitter_samples = 0

    def __array_finalize__(self, other):
        self.emitter_samples = getattr(other, "emitter_samples", 0)


def _copied(address, count, dtype):
    if not count:
        return np.empty(0, dtype)
    return np.frombuffer((ctypes.c_char * (count * dtype.itemsize)).from_address(address), dtype).copy()


class Accel(Handle):
    """Rays against triangles: positions (n, 3), indices (m, 3). `kind`, `builder` and `robust` as of a scene."""

    def __init__(self, device, positions, indices, kind=None, builder=None, robust=True):
        super().__init__(device.library)
        positions, indices = _rows("positions", positions, np.float32, 3), _rows("indices", indices, np.uint32, 3)
        self._create("accel_build", device.pointer, ctypes.byref(AccelDesc(
            robust=ROBUST if robust else FAST, kind=kind.encode() if kind else None, builder=builder.encode() if builder else None,
            positions=positions.ctypes.data, position_count=len(positions), indices=indices.ctypes.data, triangle_count=len(indices))))

    def info(self):
        info = AccelInfo()
        self._call("accel_get_info", ctypes.byref(info))
        return info

    def intersect(self, origins, directions, near=0.0, far=math.inf):
        """(distance, triangle, u, v, normal) of the closest hit of each ray: infinity and NO_ID where there is none.
        Distances are in units of the direction's length; normals are geometric and not of unit length."""
        rays = np.zeros(len(origins), RAYHIT)
        _fill(rays["ray"], origins, directions, near, far)
        rays["hit"]["geom_id"] = NO_ID
        self._call("accel_intersect", rays.ctypes.data_as(POINTER(Rayhit)), rays.size)
        hit, missed = rays["hit"], rays["hit"]["geom_id"] == NO_ID
        return (np.where(missed, np.float32(np.inf), rays["ray"]["tfar"]), np.where(missed, np.uint32(NO_ID), hit["prim_id"]),
                hit["u"].copy(), hit["v"].copy(), np.stack([hit["ng_x"], hit["ng_y"], hit["ng_z"]], -1))

    def occluded(self, origins, directions, near=0.0, far=math.inf):
        """Whether anything lies on each ray between near and far."""
        rays = np.zeros(len(origins), RAY)
        _fill(rays, origins, directions, near, far)
        self._call("accel_occluded", rays.ctypes.data_as(POINTER(Ray)), rays.size)
        return rays["tfar"] == -np.inf


def _fill(rays, origins, directions, near, far):
    for name, values in (("org", origins), ("dir", directions)):
        values = np.asarray(values, np.float32)
        if values.shape != (rays.size, 3):
            raise Error(INVALID_ARGUMENT, f"rays: {name} has the shape {values.shape}, not ({rays.size}, 3)")
        for axis, column in zip("xyz", values.T):
            rays[f"{name}_{axis}"] = column
    rays["tnear"], rays["tfar"], rays["mask"] = near, far, 0xFFFFFFFF


class Render(Handle):
    """A frame that renders in the background. Tiles and crop count rows from the top.

    `passes`, `max_seconds`, `target_error`, `confidence`, `flags`, filter, `lobes` and
    `occlusion` as in lumicut_render_desc."""

    def __init__(self, integrator, scene, width, height, samples=1, crop=None, tile_size=0, passes=1, max_seconds=0.0,
                 target_error=0.0, confidence=0.0, flags=0, pixel_filter=BOX, filter_width=0.0, lobes=0, occlusion=0.0):
        super().__init__(integrator.library)
        self.crop = tuple(crop) if crop else (0, 0, width, height)
        desc = RenderDesc(width=width, height=height, samples=samples, tile_size=tile_size, passes=passes,
                          max_seconds=max_seconds, target_error=target_error, confidence=confidence, flags=flags, filter=pixel_filter,
                          filter_width=filter_width, lobes=lobes, occlusion=occlusion)
        desc.crop[:] = self.crop
        self.components = self.library.channels()
        self._create("render_start", integrator.pointer, scene.pointer, ctypes.byref(desc))

    def wait(self, milliseconds):
        """Status after at most that time. Raises the render's own error once it failed, Cancelled once it stopped."""
        status = Status()
        self._call("render_wait", milliseconds, ctypes.byref(status))
        return status

    def next_tile(self):
        """(x0, y0, x1, y1) of a finished tile, each once; None: none now."""
        tile = Tile()
        self._call("render_next_tile", ctypes.byref(tile))
        return (tile.x0, tile.y0, tile.x1, tile.y1) if tile.x1 else None

    def groups(self):
        """Light groups that have a channel "radiance.GROUP", rising."""
        numbers, count = POINTER(c_uint32)(), c_uint64()
        self._call("render_groups", ctypes.byref(numbers), ctypes.byref(count))
        return [numbers[i] for i in range(count.value)]

    def read(self, channel, rect=None):
        """(height, width, components) float32, top row first."""
        x0, y0, x1, y1 = rect or self.crop
        out = np.empty((y1 - y0, x1 - x0, self.components[channel.partition(".")[0]]), np.float32)
        self._call("render_read", channel.encode(), ctypes.byref(Tile(x0=x0, y0=y0, x1=x1, y1=y1)), out.ctypes.data)
        return out
