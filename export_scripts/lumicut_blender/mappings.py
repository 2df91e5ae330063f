# SPDX-License-Identifier: Apache-2.0
"""Where images lie on meshes, and images of several mappings laid out anew on one: a material has one to the library."""
import itertools

import numpy as np

from .images import Picture

LARGEST = 1 << 23  # texels of an image that is laid out anew
FINEST = 8         # periods of a mapping that make up one of the common one


class Mapping:
    """Coordinates (a UV map's name, "" the active one; or GENERATED), then an affine map."""

    def __init__(self, source="UV", uv_map="", matrix=((1, 0, 0), (0, 1, 0))):
        self.source, self.uv_map, self.matrix = source, uv_map, tuple(tuple(float(x) for x in row) for row in matrix)
        self.key = (source, uv_map, self.matrix)

    def __eq__(self, other):
        return isinstance(other, Mapping) and self.key == other.key

    def __hash__(self):
        return hash(self.key)

    def is_plain(self):
        return self.key == ("UV", "", ((1, 0, 0), (0, 1, 0)))

    def is_upright(self):
        """Whether the coordinates grow as those of the UV map do."""
        (a, b, _), (d, e, _) = self.matrix
        return self.source == "UV" and a > 0 and e > 0 and abs(b) < 1e-6 * a and abs(d) < 1e-6 * e


def whole(mapping):
    return np.vstack([mapping.matrix, [0, 0, 1]])


def common(mappings):
    """(mapping, {mapping: 2x3 matrix from its coordinates}) on which images of all of them repeat with the unit square:
    one of them, or one that some periods of it make up. None where there is none."""
    first = mappings[0]
    if any((m.source, m.uv_map) != (first.source, first.uv_map) for m in mappings):
        return None
    best = None
    for base in mappings:
        if abs(np.linalg.det(whole(base))) < 1e-9:
            return None
        back = np.linalg.inv(whole(base))
        for periods in itertools.product(range(1, FINEST + 1), repeat=2):
            if best is not None and np.prod(periods) >= best[0]:
                continue
            stretch = np.diag([*periods, 1.0])
            turned = {m: (whole(m) @ back @ stretch)[:2] for m in mappings}
            if all(np.abs(t[:, :2] - t[:, :2].round()).max() < 1e-3 for t in turned.values()):
                for t in turned.values():
                    t[:, :2] = t[:, :2].round()
                best = np.prod(periods), Mapping(first.source, first.uv_map, (np.linalg.inv(stretch) @ whole(base))[:2]), turned
    return None if best is None else best[1:]


def aligned(pictures, note=lambda name: None):
    """The same pictures, all on one mapping; None where they do not repeat together. `note`: of those that lose detail."""
    mappings = list(dict.fromkeys(p.mapping for p in pictures))
    if len(mappings) < 2:
        return list(pictures)
    if any(p.ends() for p in pictures):  # does not repeat
        return None
    found = common(mappings)
    if found is None:
        return None
    target, turned = found
    return [laid_out(p, target, turned[p.mapping], note) for p in pictures]


def laid_out(picture, target, matrix, note):
    linear = matrix[:, :2]
    if (linear == np.eye(2)).all() and not matrix[:, 2].any():
        return picture.moved(target, picture.key)
    height, width = picture.shape()
    # As many texels as its own along the new axes.
    columns, rows = (max(1, round(float(np.hypot(*(linear[:, k] * (width, height)))))) for k in (0, 1))
    if columns * rows > LARGEST:
        share = (LARGEST / (columns * rows)) ** 0.5
        columns, rows = max(1, int(columns * share)), max(1, int(rows * share))
        if share < 0.5:
            note(picture.name)
    result = []

    def texels():
        if not result:
            result.append(resampled(picture.texels(), matrix, columns, rows))
        return result[0], picture.is_srgb()

    return Picture(picture.name, (picture.key, "laid out", target.key), target, picture.flags, stored=texels)


def resampled(texels, matrix, columns, rows):
    """(rows, columns, channels) of an image that repeats, bilinear, as its texels are stored. Rows count from the top,
    v from the bottom."""
    height, width = texels.shape[:2]
    out = np.empty((rows, columns, texels.shape[2]), texels.dtype)
    s = (np.arange(columns) + 0.5) / columns
    slab = max(1, (1 << 18) // columns)
    for row in range(0, rows, slab):
        t = 1 - (np.arange(row, min(rows, row + slab)) + 0.5) / rows
        u = matrix[0, 0] * s[None] + matrix[0, 1] * t[:, None] + matrix[0, 2]
        v = matrix[1, 0] * s[None] + matrix[1, 1] * t[:, None] + matrix[1, 2]
        x, y = (u * width - 0.5).round(6), ((1 - v) * height - 0.5).round(6)
        x0, y0 = np.floor(x).astype(int), np.floor(y).astype(int)
        fx, fy = (x - x0)[..., None], (y - y0)[..., None]
        a, b = (texels[(y0 + k) % height, x0 % width] * (1 - fx) + texels[(y0 + k) % height, (x0 + 1) % width] * fx for k in (0, 1))
        mixed = a * (1 - fy) + b * fy
        out[row:row + slab] = np.rint(mixed) if texels.dtype == np.uint8 else mixed
    return out


def sized(texels, width, height, ends):
    """An image of that size: texels repeated where they go in evenly, else filtered."""
    if texels.shape[:2] == (height, width):
        return texels
    if height % texels.shape[0] == 0 and width % texels.shape[1] == 0 or ends:
        return texels[np.arange(height) * texels.shape[0] // height][:, np.arange(width) * texels.shape[1] // width]
    return resampled(texels, np.eye(3)[:2], width, height)
