# SPDX-License-Identifier: Apache-2.0
"""Values of texture programs outside of renders: the library shows them as emission, in a small scene of their own."""
import math

import numpy as np

from . import programs, runtime
from .images import image_of
from .lumicut import library
from .programs import NORMAL, POSITION
from .scene_data import Program

PLACE, FACING = ("at", "place"), ("at", "normal")


def evaluated(expr, positions, attributes, camera, width, height):
    """(height, width, 3) of a program, at least 0, on quads of four positions each (or triangles, with attributes by
    triangle) that a camera sees."""
    pictures, names = [], list(attributes)

    def picture_number(picture):
        pictures.append(picture)
        return 1 + len(pictures)

    program = programs.ProgramPicture("values", expr).compiled(picture_number, lambda name: names.index(name) if name in names else len(names))
    items = [program, *(image_of(p) for p in pictures)]
    whole = len(positions) // 3 if attributes and len(next(iter(attributes.values()))) * 3 == len(positions) else 0
    corners = np.arange(len(positions), dtype=np.uint32)
    quads = corners.reshape(-1, 4) if not whole else None
    indices = corners.reshape(-1, 3) if whole else np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    domain = library.OF_TRIANGLES if whole else library.OF_VERTICES
    with library.Scene(library.Device(runtime.require(), 1)) as scene, library.Integrator(scene.device, "exhaustive") as integrator:
        scene.set_textures([(i.instructions, i.constants, i.table) if isinstance(i, Program) else (i.pixels, i.flags) for i in items])
        material = library.Material(opacity=1.0, flags=library.EMIT_BOTH_SIDES, emission_texture=1)
        material.emission[:] = [1.0] * 3
        scene.set_materials([material])
        scene.add_mesh(positions, indices, mask=library.CAMERA_RAYS,
                       attributes=[(number, domain, np.asarray(values, np.float32).reshape(len(values), -1))
                                   for number, values in enumerate(attributes.values())])
        scene.set_camera(camera)
        scene.commit()
        integrator.set("vpls", "1")
        with library.Render(integrator, scene, width, height) as render:
            while render.wait(1000).state == library.RUNNING:
                pass
            return render.read("radiance")


def numbers_at(expr, places, normals, attributes, to_world):
    """A program's number, of any sign, at points: their world positions and normals, {name: (points, components)} of what else
    it asks for, and the object's matrix, 4x4."""
    count = len(places)
    if expr.constant():
        return np.full(count, expr.mean[0], np.float32)
    matrices = {("object_to_world",): to_world, ("world_to_object",): np.linalg.inv(to_world)}
    expr = programs.replaced(expr, {POSITION.key: programs.attribute(PLACE), NORMAL.key: programs.attribute(FACING)},
                    {name: tuple(np.float32(m[:3]).ravel().tolist()) for name, m in matrices.items()})
    both = programs.combine(expr, programs.number_math("MULTIPLY", expr, programs.const(-1)), programs.ZERO)
    columns = math.ceil(math.sqrt(count))
    rows = math.ceil(count / columns)
    x, y = np.arange(count) % columns, np.arange(count) // columns
    shape = np.array([(0.1, 0.1), (0.9, 0.1), (0.5, 0.9)], np.float32)
    corners = np.zeros((count, 3, 3), np.float32)
    corners[..., :2] = np.stack([x, y], 1)[:, None] + shape
    camera = library.Camera(orthographic=1, height=float(rows))
    camera.to_world[:] = [1.0, 0, 0, columns / 2, 0, 1.0, 0, rows / 2, 0, 0, 1.0, 1.0]
    image = evaluated(both, corners.reshape(-1, 3), {PLACE: places, FACING: normals, **attributes}, camera, columns, rows)
    values = image[::-1].reshape(-1, 3)[:count]
    return values[:, 0] - values[:, 1]
