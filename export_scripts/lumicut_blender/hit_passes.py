# SPDX-License-Identifier: Apache-2.0
"""Passes of what the camera sees first, from the hits of the frame's own samples: indices of objects and materials, texture
coordinates, what is held out, and Cryptomatte. [Friedman and Jones 2015: Cryptomatte, specification 1.2]

As Cycles has them: indices are of a pixel's first sample, texture coordinates its mean, and Cryptomatte ranks by coverage
what a pixel's samples meet."""
import json

import numpy as np

from . import motion, scene_data
from .lumicut import library

MOST_PASSES = 64  # of a render, whose samples are looked at: coverage is known to a percent or two by then
BAND = 1 << 18    # hits at once
HELD_OUT = "Held out"  # a pass for Combined alone: the share of samples that meet holdouts
CRYPTOMATTES = {"object": "CryptoObject", "material": "CryptoMaterial", "asset": "CryptoAsset"}


def murmur3(data):
    """MurmurHash3 of 32 bits with seed 0, of bytes."""
    def mix(k):
        k = k * 0xcc9e2d51 & 0xffffffff
        return (k << 15 | k >> 17) * 0x1b873593 & 0xffffffff

    value, tail = 0, len(data) & ~3
    for i in range(0, tail, 4):
        value ^= mix(int.from_bytes(data[i:i + 4], "little"))
        value = ((value << 13 | value >> 19) & 0xffffffff) * 5 + 0xe6546b64 & 0xffffffff
    if len(data) & 3:
        value ^= mix(int.from_bytes(data[tail:], "little"))
    value ^= len(data)
    for shift, factor in ((16, 0x85ebca6b), (13, 0xc2b2ae35), (16, 1)):
        value = (value ^ value >> shift) * factor & 0xffffffff
    return value


def id_of(name):
    """The number that Cryptomatte has in place of a name, as a float's bits: no infinity, no denormal number."""
    value = murmur3(name.encode())
    exponent = min(max(value >> 23 & 0xff, 1), 254)
    return value & 0x807fffff | exponent << 23


def as_floats(ids):
    return np.array(ids, np.uint32).view(np.float32)


class Ids:
    """Names that pixels are of, numbered."""

    def __init__(self):
        self.numbers = {}

    def number(self, name):
        return self.numbers.setdefault(name, len(self.numbers))

    def floats(self):
        return as_floats([id_of(name) for name in self.numbers])

    def manifest(self):
        return json.dumps({name: f"{id_of(name):08x}" for name in self.numbers}, separators=(",", ":"), ensure_ascii=False)


def uv_map_of_hits(mesh):
    """As the library has the corners: a mirrored mesh that stands alone is turned over [scene_data.baked]."""
    if mesh.uv_map is not None and len(mesh.transforms) == 1 and scene_data.is_mirrored(mesh.transforms[0]):
        return mesh.uv_map[:, [0, 2, 1]]
    return mesh.uv_map


class HitPasses:
    """Made from collected data that knows its objects. `kinds`: of CRYPTOMATTES; `levels`: how many a pixel has;
    `indices`: names of the passes of objects and materials; `uvs`: whether there is one of texture coordinates; `motions`:
    a motion.Motion, or None; `held`: of each material whether it is a holdout, or None."""

    def __init__(self, data, kinds, levels, indices, uvs, motions=None, held=None):
        self.motions, self._held = motions, None if held is None else np.array(held)
        self.kinds, self.levels, self.indices, self.uvs = kinds, levels, indices, uvs
        self.ids = {kind: Ids() for kind in kinds}
        self._first = np.cumsum([0] + [len(mesh.transforms) for mesh in data.meshes])
        owners = [data.objects[owner] for mesh in data.meshes for owner in mesh.owners]
        self._object_index = np.array([owner.index for owner in owners] or [0], np.float32)
        self._material_index = np.array([index for _, index in data.material_names] or [0], np.float32)
        of = {"object": [o.name for o in owners], "asset": [o.asset for o in owners],
              "material": [name or "default_surface" for name, _ in data.material_names]}
        self._numbers = {kind: np.array([self.ids[kind].number(name) for name in of[kind]] or [0], np.int64) for kind in kinds}
        self._uv_maps = [uv_map_of_hits(mesh) for mesh in data.meshes] if uvs else None

    def metadata(self, layer):
        """{field: text} of the image."""
        out = {}
        for kind, ids in self.ids.items():
            name = f"{layer}.{CRYPTOMATTES[kind]}"
            prefix = f"cryptomatte/{murmur3(name.encode()):08x}"[:len("cryptomatte/") + 7]
            out |= {f"{prefix}/name": name, f"{prefix}/hash": "MurmurHash3_32", f"{prefix}/conversion": "uint32_to_float32",
                    f"{prefix}/manifest": ids.manifest()}
        return out

    def trace(self, scene, frame, seed, passes_done, check, view=0):
        """{pass: (h, w, channels)} of the frame's crop. `frame`: a library.RenderDesc; `check` raises to stop; `view`: its number."""
        x0, y0, x1, y1 = frame.crop[:]
        width, samples, passes = x1 - x0, max(1, frame.samples), max(1, min(passes_done, MOST_PASSES))
        rows = max(1, BAND // (width * samples * passes))
        bands = []
        for top in range(y0, y1, rows):
            check()
            rect = (x0, top, x1, min(y1, top + rows))
            hits = np.stack([scene.first_hits(frame, seed, number, rect) for number in range(passes)], 1)
            hits = hits.reshape(-1, passes * samples)
            bands.append(self._of_band(hits, rect[3] - top, width))
            if self.motions is not None:
                bands[-1][motion.PASS] = self.motions.of_hits(hits, view, frame.width, frame.height).reshape(rect[3] - top, width, 4)
        return {name: np.concatenate([band[name] for band in bands]) for name in bands[0]} if bands else {}

    def _of_band(self, hits, height, width):
        """`hits`: (pixels, samples)."""
        seen = hits["mesh"] != library.NO_ID
        mesh = np.where(seen, hits["mesh"], 0)
        place = np.minimum(self._first[mesh] + hits["instance"], len(self._object_index) - 1)
        out = {}
        if self.indices:
            out[self.indices[0]] = np.where(seen, self._object_index[place], 0)[:, 0]
            out[self.indices[1]] = np.where(seen, self._material_index[hits["material"]], 0)[:, 0]
        if self._held is not None:
            out[HELD_OUT] = (seen & self._held[np.where(seen, hits["material"], 0)]).mean(1)
        if self.uvs:
            out["UV"] = self._uv(hits, seen)
        for kind in self.kinds:
            numbers = self._numbers[kind][hits["material"] if kind == "material" else place]
            out |= self._ranked(kind, np.where(seen, numbers, -1))
        return {name: values.reshape(height, width, -1).astype(np.float32) for name, values in out.items()}

    def _uv(self, hits, seen):
        total = np.zeros((*hits.shape, 3), np.float32)
        for number in np.unique(hits["mesh"][seen]):
            uvs = self._uv_maps[number]
            if uvs is None:
                continue
            at = hits["mesh"] == number
            total[at, 2] = 1
            found = hits[at]
            a, b, c = np.moveaxis(uvs[found["triangle"]], 1, 0)
            u, v = found["u"][:, None], found["v"][:, None]
            total[at, :2] = a * (1 - u - v) + b * u + c * v
        return total.mean(1)

    def _ranked(self, kind, numbers):
        """Of each pixel the names that most of its samples meet, with their shares, two in a pass."""
        pixels, samples = numbers.shape
        floats = self.ids[kind].floats()
        known = max(1, len(floats))
        keys = (np.arange(pixels)[:, None] * known + numbers)[numbers >= 0]
        keys, counts = np.unique(keys, return_counts=True)
        pixel, name = keys // known, keys % known
        order = np.lexsort((name, -counts, pixel))
        pixel, name, counts = pixel[order], name[order], counts[order]
        rank = np.arange(len(pixel)) - np.searchsorted(pixel, pixel)
        levels = (self.levels + 1) // 2 * 2
        table = np.zeros((pixels, levels, 2), np.float32)
        kept = rank < self.levels
        table[pixel[kept], rank[kept], 0] = floats[name[kept]]
        table[pixel[kept], rank[kept], 1] = counts[kept] / samples
        return {f"{CRYPTOMATTES[kind]}{i:02d}": table[:, 2 * i:2 * i + 2].reshape(pixels, 4) for i in range(levels // 2)}
