# SPDX-License-Identifier: Apache-2.0
"""A scene as plain arrays: what collecting makes, the library takes and the exporter writes. Nothing of Blender in it."""
import dataclasses

import numpy as np

from .lumicut import library


@dataclasses.dataclass
class Image:
    """Texels as they are stored: (h, w, channels) of uint8 or float32, top row first. A colour has 1 or 3, a mask 1."""
    name: str
    pixels: np.ndarray
    flags: int = 0  # library.SRGB | CLAMP | NEAREST | BY_VIEW | BLEND_STORED


@dataclasses.dataclass
class Program:
    """What stands in an image's place, as lumicut_program has it."""
    name: str
    instructions: np.ndarray  # (n, 12) of int32: op, mode, eight inputs, data, count
    constants: np.ndarray     # (k, 3)
    table: np.ndarray


@dataclasses.dataclass
class Mesh:
    name: str
    positions: np.ndarray                # (n, 3)
    indices: np.ndarray                  # (t, 3)
    normals: np.ndarray | None = None    # (n, 3); None: flat
    uvs: np.ndarray | None = None        # (n, 2)
    materials: np.ndarray | None = None  # (t,) indices into the scene's; None: `material` for all
    material: int = 0
    transforms: list = dataclasses.field(default_factory=list)  # 3x4 each, one an instance
    group: int = 0                       # light group of what it emits
    mask: int = 0                        # library.RAYS that see it; 0: all
    attributes: list = dataclasses.field(default_factory=list)   # (number, library.OF_VERTICES ..., (places, components))
    of_instances: dict = dataclasses.field(default_factory=dict)  # number: values of each transform, for OF_INSTANCES
    catcher: bool = False                # a shadow catcher [shadow_catcher.py]
    links: tuple = (0, 0, 0, 0)          # linking.Links
    owners: list = dataclasses.field(default_factory=list)  # of each transform, into SceneData.objects, where passes ask for it
    uv_map: np.ndarray | None = None     # (t, 3, 2) as the mesh has it, where a pass asks for it

    def all_attributes(self):
        return [*self.attributes, *((number, library.OF_INSTANCES, np.array(values, np.float32).reshape(len(values), -1))
                                    for number, values in self.of_instances.items())]

    def numbers(self):
        """Of all materials in use."""
        return [self.material] if self.materials is None else np.unique(self.materials)


@dataclasses.dataclass(frozen=True)
class Owner:
    """An object, as passes tell it apart."""
    name: str
    asset: str  # the topmost of its parents
    index: int


@dataclasses.dataclass
class Profile:
    """Intensity of a lamp by direction, as lumicut_profile has it."""
    name: str
    vertical: np.ndarray    # radians from the lamp's direction, rising
    horizontal: np.ndarray  # radians about it, from 0 to 2π
    values: np.ndarray      # (horizontal, vertical), W/sr


def is_mirrored(transform):
    m = np.array(transform, np.float32).astype(np.float64).reshape(3, 4)
    return np.cross(m[:, 0], m[:, 1]) @ m[:, 2] < 0


def baked(mesh, check=lambda: None):
    """(positions, normals, indices) of a mesh with one instance, in the world: no tree of trees for what stands alone.

    In double precision, as io/scene_json.cpp has it, so that an exported scene is the same one.
    """
    m = np.array(mesh.transforms[0], np.float32).astype(np.float64).reshape(3, 4)
    p = mesh.positions.astype(np.float64)
    positions = np.stack([m[r, 0] * p[:, 0] + m[r, 1] * p[:, 1] + m[r, 2] * p[:, 2] + m[r, 3] for r in range(3)], 1)
    c = m[:, 0], m[:, 1], m[:, 2]
    check()
    determinant = np.cross(c[0], c[1]) @ c[2]
    sign = -1.0 if determinant < 0 else 1.0
    normals, indices = mesh.normals, mesh.indices
    if normals is not None:  # by the cofactors: the inverse transpose up to the determinant
        n = normals.astype(np.float64)
        check()
        turned = sum(np.outer(n[:, k], np.cross(c[(k + 1) % 3], c[(k + 2) % 3]) * sign) for k in range(3))
        check()
        length = np.linalg.norm(turned, axis=1)
        check()
        normals = np.where((length > 0)[:, None], turned / np.where(length > 0, length, 1)[:, None], n).astype(np.float32)
    if determinant < 0:
        indices = indices[:, [0, 2, 1]]
    return positions.astype(np.float32), normals, indices


def is_flat(transform):
    """Whether an instance is scaled to nothing along an axis: it has no inverse, and is no instance to the library."""
    m = np.array(transform, np.float64).reshape(3, 4)[:, :3]
    return not abs(np.linalg.det(m)) > 1e-12 * np.abs(m).max() ** 3


def flattened(mesh, transform):
    """A mesh of its own in place of a flat instance; None where nothing but a line or a point remains."""
    m = np.array(transform, np.float64).reshape(3, 4)[:, :3]
    sizes = np.linalg.svd(m, compute_uv=False)
    if not sizes[1] > 1e-6 * sizes[0]:
        return None
    alone = dataclasses.replace(mesh, transforms=[transform])
    positions, normals, indices = baked(alone)
    return dataclasses.replace(alone, positions=positions, normals=normals, indices=indices, transforms=[IDENTITY])


IDENTITY = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0]


@dataclasses.dataclass
class SceneData:
    meshes: list = dataclasses.field(default_factory=list)
    materials: list = dataclasses.field(default_factory=list)  # (name, library.Material)
    images: list = dataclasses.field(default_factory=list)     # of materials' and environment's 1-based numbers
    profiles: list = dataclasses.field(default_factory=list)   # of lights' 1-based numbers
    lights: list = dataclasses.field(default_factory=list)     # (name, library.Light)
    lamps: int = 0                                             # that these come from
    world_suns: int = 0                                        # the last of lights: of the world
    environment: library.Environment | None = None
    backdrop: object = None  # worlds.Backdrop that the camera sees in place of the environment
    transparent: bool = False  # whether the film is
    camera: library.Camera | None = None
    groups: list = dataclasses.field(default_factory=list)     # names of light groups, from number 1; 0: in none
    objects: list = dataclasses.field(default_factory=list)    # Owners, where passes ask for them
    material_names: list = dataclasses.field(default_factory=list)  # (name or None, pass index) of each material
    added_lamps: set = dataclasses.field(default_factory=set)  # names of those that do not shine where shadow catchers are alone
    held_out: dict = dataclasses.field(default_factory=dict)   # where there are shadow catchers: the same material as a hole to the camera

    def triangles(self):
        return sum(len(mesh.indices) * len(mesh.transforms) for mesh in self.meshes)

    def upload(self, scene, check=lambda: None):
        """Describes itself to a library.Scene. `check` is called between meshes, and may raise."""
        scene.set_textures([(image.instructions, image.constants, image.table) if isinstance(image, Program) else
                            (image.pixels, image.flags) for image in self.images])
        scene.set_materials([material for _, material in self.materials])
        for mesh in self.meshes:
            check()
            if len(mesh.transforms) == 1:
                positions, normals, indices = baked(mesh, check)
                check()
                scene.add_mesh(positions, indices, normals, mesh.uvs, mesh.materials, mesh.material, group=mesh.group,
                               mask=mesh.mask, attributes=mesh.all_attributes(), links=mesh.links)
            else:
                scene.add_mesh(mesh.positions, mesh.indices, mesh.normals, mesh.uvs, mesh.materials, mesh.material,
                               np.array(mesh.transforms, np.float32), mesh.group, mesh.mask, mesh.all_attributes(),
                               mesh.links)
        scene.set_profiles([(p.vertical, p.horizontal, p.values) for p in self.profiles])
        scene.set_lights([light for _, light in self.lights])
        scene.set_environment(self.environment)
        scene.set_camera(self.camera)
