# SPDX-License-Identifier: Apache-2.0
"""Hair particles and curve objects as tubes, point clouds as spheres. Places are the object's own.

A tube is a prism of three sides under smooth normals, as wide on the average of all views as a round one would be.
"""
import numpy as np

from .mesh_attributes import MASK, jenkins

SIDES = 3
WIDER = np.pi / (SIDES * np.sin(np.pi / SIDES))  # of a round tube's radius: a convex body's mean width goes by its perimeter
BEND = 0.25  # of its radius: how far a strand may lie off its tube's middle
DEFAULT_RADIUS = 0.005  # Cycles', of curves that have none


def taper(settings, steps):
    """Radius at each of `steps` keys of a hair, from root to tip, as Cycles has it."""
    rest = 1 - np.linspace(0, 1, steps)
    shape = settings.shape
    rest = rest ** (1 + shape) if shape < 0 else rest ** (1 / max(1e-6, 1 - shape))
    root, tip = settings.root_radius, settings.tip_radius
    radii = 0.5 * settings.radius_scale * (rest * (root - tip) + tip)
    if settings.use_close_tip:
        radii[-1] = 0
    return radii


def hair_of_particles(ob, system, viewport, check=lambda: None):
    """((strands, keys, 3) places in the object's space, (keys,) radii, numbers of the particles)."""
    settings = system.settings
    steps = (1 << (settings.display_step if viewport else settings.render_step)) + 1
    parents, children = len(system.particles), len(system.child_particles)
    if viewport:
        children = children * settings.display_percentage // 100
    numbers = range(parents if settings.child_type != "NONE" and children else 0, parents + children)
    places = np.empty((len(numbers), steps, 3))
    for i, number in enumerate(numbers):
        if i % 256 == 0:
            check()
        for step in range(steps):
            places[i, step] = system.co_hair(ob, particle_no=number, step=step)
    inverse = np.array(ob.matrix_world.inverted_safe())
    places = places @ inverse[:3, :3].T + inverse[:3, 3]
    kept = np.isfinite(places).all((1, 2)) & (np.ptp(places, axis=1).max(1) > 0)
    return places[kept], taper(settings, steps), np.array(numbers)[kept]


def straightened(places, radii):
    """With as few keys as still follow every strand within BEND of its radius."""
    strands, keys, _ = places.shape
    stride = keys - 1
    slack = np.maximum(BEND * radii.max(), 1e-6 * np.ptp(places, axis=(0, 1)).max()) if strands else 0
    while stride > 1:
        chosen = np.arange(0, keys, stride)
        if chosen[-1] == keys - 1:
            at = np.arange(keys)
            low = np.minimum(at // stride * stride, keys - 1 - stride)
            share = (at - low) / stride
            straight = places[:, low] * (1 - share)[None, :, None] + places[:, low + stride] * share[None, :, None]
            of_radii = radii[low] * (1 - share) + radii[low + stride] * share
            if np.abs(places - straight).max() <= slack and np.abs(radii - of_radii).max() <= slack:
                return places[:, chosen], radii[chosen]
        stride = stride // 2 if stride % 2 == 0 else 1
    return places, radii


def tubes(places, radii):
    """(positions, normals, indices) of strands of the same number of keys; radii: (keys,) or (strands, keys)."""
    strands, keys, _ = places.shape
    radii = np.broadcast_to(radii, (strands, keys))
    along = np.gradient(places, axis=1)
    along /= np.maximum(np.linalg.norm(along, axis=2, keepdims=True), 1e-30)
    # One direction for a whole strand, least along it, keeps the sides from twisting.
    axis = np.zeros((strands, 1, 3))
    axis[np.arange(strands), 0, np.abs(along).max(1).argmin(1)] = 1
    side = axis - (axis * along).sum(2, keepdims=True) * along
    side /= np.maximum(np.linalg.norm(side, axis=2, keepdims=True), 1e-30)
    other = np.cross(along, side)
    angle = 2 * np.pi * np.arange(SIDES) / SIDES
    normals = side[:, :, None] * np.cos(angle)[None, None, :, None] + other[:, :, None] * np.sin(angle)[None, None, :, None]
    positions = places[:, :, None] + normals * (radii * WIDER)[:, :, None, None]
    ring, turn = np.meshgrid(np.arange(keys - 1), np.arange(SIDES), indexing="ij")
    a, b = ring * SIDES + turn, ring * SIDES + (turn + 1) % SIDES
    faces = np.stack([a, b, b + SIDES, a, b + SIDES, a + SIDES], -1).reshape(-1, 3)
    indices = (faces[None] + (np.arange(strands) * keys * SIDES)[:, None, None]).reshape(-1, 3)
    corners = positions.reshape(-1, 3)[indices]
    wide = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) > 0
    return (positions.reshape(-1, 3).astype(np.float32), normals.reshape(-1, 3).astype(np.float32),
            indices[wide].astype(np.int32))


def info(places, radii, numbers, even=False):
    """{output of Curves Info: (strands, keys)} of strands of these numbers. `even`: Intercept goes by keys, else by length."""
    steps = np.linalg.norm(np.diff(places, axis=1), axis=2)
    along = np.concatenate([np.zeros((len(places), 1)), np.cumsum(steps, 1)], 1)
    length = along[:, -1:]
    shape = along.shape
    share = np.broadcast_to(np.linspace(0, 1, shape[1]), shape) if even else along / np.maximum(length, 1e-30)
    random = np.array([jenkins(int(number), 0) / MASK for number in numbers])
    return {"Is Strand": np.ones(shape), "Intercept": share, "Length": np.broadcast_to(length, shape),
            "Thickness": np.broadcast_to(2 * radii, shape), "Random": np.broadcast_to(random[:, None], shape)}


def on_tubes(values):
    """(strands, keys) or (strands, keys, components) as the tubes' vertices have them."""
    values = np.asarray(values, np.float32)
    return np.repeat(values.reshape(*values.shape[:2], 1, -1), SIDES, 2).reshape(values.shape[0] * values.shape[1] * SIDES, -1)


def curve_strands(curves, fetch):
    """Of a curves object: groups of strands with as many keys, as (places, radii, numbers of points, of curves). `fetch`:
    collect.fetch."""
    count = len(curves.points)
    places = fetch(curves.attributes["position"].data, "vector", count, 3, np.float32).astype(np.float64)
    radius = curves.attributes.get("radius")
    known = radius is not None and radius.domain == "POINT"
    radii = fetch(radius.data, "value", count, 1, np.float32) if known else np.full(count, DEFAULT_RADIUS)
    first = np.array([curve.first_point_index for curve in curves.curves], np.int64)
    lengths = np.array([curve.points_length for curve in curves.curves], np.int64)
    for keys in np.unique(lengths[lengths > 1]):
        at = first[lengths == keys][:, None] + np.arange(keys)
        yield places[at], radii[at], at, np.flatnonzero(lengths == keys)


def spheres(places, radii, matrix):
    """3x4 transforms of a unit sphere to the world, one a point; `matrix`: the object's, 4x4."""
    kept = radii > 0
    out = np.empty((kept.sum(), 3, 4))
    out[:, :, :3] = matrix[:3, :3] * radii[kept, None, None]
    out[:, :, 3] = places[kept] @ matrix[:3, :3].T + matrix[:3, 3]
    return out.reshape(-1, 12).tolist()


def unit_sphere(subdivisions=2):
    """(positions, indices) of an icosphere that has the volume of the ball."""
    golden = (1 + 5 ** 0.5) / 2
    points = [(-1, golden, 0), (1, golden, 0), (-1, -golden, 0), (1, -golden, 0), (0, -1, golden), (0, 1, golden),
              (0, -1, -golden), (0, 1, -golden), (golden, 0, -1), (golden, 0, 1), (-golden, 0, -1), (-golden, 0, 1)]
    faces = [(0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4), (11, 10, 2), (10, 7, 6),
             (7, 1, 8), (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8), (3, 8, 9), (4, 9, 5), (2, 4, 11), (6, 2, 10),
             (8, 6, 7), (9, 8, 1)]
    points = [np.array(p) / np.linalg.norm(p) for p in points]
    for _ in range(subdivisions):
        middles, finer = {}, []

        def middle(i, j):
            key = min(i, j), max(i, j)
            if key not in middles:
                p = points[i] + points[j]
                points.append(p / np.linalg.norm(p))
                middles[key] = len(points) - 1
            return middles[key]

        for a, b, c in faces:
            ab, bc, ca = middle(a, b), middle(b, c), middle(c, a)
            finer += [(a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)]
        faces = finer
    positions, indices = np.array(points), np.array(faces, np.int32)
    a, b, c = (positions[indices[:, k]] for k in range(3))
    volume = np.abs((a * np.cross(b, c)).sum(1)).sum() / 6
    return (positions * (4 / 3 * np.pi / volume) ** (1 / 3)).astype(np.float32), indices
