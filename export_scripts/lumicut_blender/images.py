# SPDX-License-Identifier: Apache-2.0
"""Texels of Blender's images: packed, generated and on disk, UDIM tiles and the frames of sequences."""
import os
import re
import tempfile

import bpy
import numpy as np

from .lumicut import library
from .scene_data import Image

LINEAR_SPACES = {"Non-Color", "Raw", "Linear", "Linear Rec.709", "scene_linear"}
DATA_SPACES = {"Non-Color", "Raw"}


def srgb_to_linear(x):
    return np.where(x <= 0.04045, x / 12.92, ((np.maximum(x, 0) + 0.055) / 1.055) ** 2.4).astype(np.float32)


class Picture:
    """An image with its mapping. stored(): (texels as they are, flags). linear(): (h, w, 3) float32."""

    def __init__(self, name, key, mapping, flags, stored=None, linear=None):
        self.name, self.key, self.mapping, self.flags = name, key, mapping, flags
        self._stored, self._linear = stored, linear

    def stored(self):
        if self._stored is not None:
            pixels, srgb = self._stored()
            # As Cycles blends texels of 8 bits.
            stored = library.BLEND_STORED if srgb and pixels.dtype == np.uint8 else 0
            return np.ascontiguousarray(pixels), self.flags | (library.SRGB if srgb else 0) | stored
        return np.ascontiguousarray(self._linear, np.float32), self.flags

    def texels(self):
        """As stored, or linear where it was made by nodes."""
        return self._stored()[0] if self._stored is not None else self._linear

    def shape(self):
        return self.texels().shape[:2]

    def is_srgb(self):
        return self._stored is not None and self._stored()[1]

    def ends(self):
        """Whether it does not repeat."""
        return bool(self.flags & library.CLAMP)

    def is_by_view(self):
        return bool(self.flags & library.BY_VIEW)

    def mean(self):
        """Over the texels; by view over even directions in front."""
        if not self.is_by_view():
            return self.linear().mean((0, 1))
        half = self.linear().shape[1] // 2
        weights = np.arange(half, dtype=np.float32)
        return (self.linear()[0, half:] * weights[:, None]).sum(0) / weights.sum()

    def moved(self, mapping, key):
        return Picture(self.name, key, mapping, self.flags, self._stored, self._linear)

    def is_byte(self):
        return self._stored is not None and self._stored()[0].dtype == np.uint8

    def is_grey(self):
        texels = self.texels()
        return texels.shape[2] == 1 or (texels[..., :1] == texels[..., 1:3]).all()

    def linear(self):
        if self._linear is None:
            pixels, srgb = self._stored()
            if pixels.dtype == np.uint8:
                table = np.arange(256, dtype=np.float32) / 255
                pixels = (srgb_to_linear(table) if srgb else table)[pixels]
            self._linear = np.broadcast_to(pixels, pixels.shape[:2] + (3,)).astype(np.float32)
        return self._linear


def image_of(picture):
    pixels, flags = picture.stored()
    return Image(picture.name, pixels, flags)


SLAB = 1 << 22  # numbers between two looks at the stop button
LARGEST_ATLAS = 1 << 27  # texels of all UDIM tiles of an image


class Images:
    """Texels of Blender's images, read once: packed, generated, byte and float alike.

    `check` is called between steps of what takes long, and raises to stop. `frame`: of the scene, for sequences.
    """

    def __init__(self, report, check=lambda: None, frame=1):
        self.report, self.check, self.frame = report, check, frame
        self._read, self._colours = {}, {}

    def pixels(self, image, user=None):
        """((h, w, 4) texels top row first as stored, whether they are sRGB), or None where there is no picture.

        `user`: the node's, which says what frame of a sequence is meant."""
        key = self.key(image, user)
        if key not in self._read:
            self._read[key] = result = self._pixels(image, key[1])
            if result is None:
                self.report.note(image.name, "Images without data, shown pink")
        return self._read[key]

    def colours(self, image, user, alpha_linked):
        """(h, w, 3) of an image that pixels() has read, as a node shows it whose Alpha is linked or not."""
        key = self.key(image, user), alpha_linked
        if key not in self._colours:
            self._colours[key] = associated(image, self.pixels(image, user)[0], alpha_linked)
        return self._colours[key]

    def key(self, image, user=None):
        """What tells pictures of one image apart."""
        sequence = image.source == "SEQUENCE" and user is not None
        return image.name_full, frame_of(user, self.frame) if sequence else None

    def _pixels(self, image, frame):
        self.check()
        if image.source == "TILED" and len(image.tiles) > 1:
            return self._atlas(image)
        if frame is not None:
            path = frame_path(path_of(image), frame)
            return self._file(image, path) if path else self._texels(image, image)
        if image.source in {"SEQUENCE", "MOVIE"}:
            self.report.note(f"{image.name} ({image.source.lower()})", "Images of which the first picture is used")
        return self._texels(image, image)

    def _file(self, image, path, packed=None):
        """Texels of another file of the image, or of a packed one, in a place of its own: nothing of the user's changes."""
        with bpy.data.temp_data() as data:
            try:
                if packed is not None:
                    other = data.images.new("tile", 1, 1)
                    other.source = "FILE"
                    other.pack(data=packed, data_len=len(packed))
                else:
                    other = data.images.load(path)
                return self._texels(other, image)
            except RuntimeError:
                return None

    def _texels(self, image, described):
        """`described`: the image that says what the texels of `image` mean."""
        width, height = image.size
        if not (width > 0 and height > 0 and image.channels > 0):
            return None
        flat = np.empty(width * height * image.channels, np.float32)
        try:
            image.pixels.foreach_get(flat)
        except RuntimeError:
            return None
        texels = flat.reshape(height, width, image.channels)[::-1]
        if image.channels < 3:  # grey, grey and alpha
            alpha = texels[..., 1:] if image.channels == 2 else np.ones_like(texels)
            texels = np.concatenate([np.repeat(texels[..., :1], 3, 2), alpha], 2)
        elif image.channels == 3:
            texels = np.concatenate([texels, np.ones_like(texels[..., :1])], 2)
        if image.is_float:
            return np.ascontiguousarray(np.nan_to_num(texels, nan=0, posinf=65504, neginf=0)), False
        space = described.colorspace_settings.name
        srgb = space not in LINEAR_SPACES
        if srgb and space != "sRGB":
            colours = scene_linear(texels[..., :3], space)
            if colours is not None:
                alpha = texels[..., 3:]
                return np.concatenate([colours if described.alpha_mode != "STRAIGHT" else colours * alpha, alpha], 2), False
            self.report.note(f"{described.name} ({space})", "Colour spaces of images taken as sRGB")
        return self._bytes(texels), srgb

    def _bytes(self, texels):
        out = np.empty(texels.shape, np.uint8)
        rows = max(1, SLAB // (texels.shape[1] * texels.shape[2]))
        for row in range(0, len(texels), rows):
            self.check()
            out[row:row + rows] = np.rint(np.clip(texels[row:row + rows], 0, 1) * 255)
        return out

    # ---- UDIM tiles ---------------------------------------------------------------------------------------------

    @staticmethod
    def grid(image):
        """(columns, rows) of UDIM tiles that an image spans from (0, 0) on; (1, 1) for others."""
        if image.source != "TILED" or len(image.tiles) < 2:
            return 1, 1
        numbers = [tile.number - 1001 for tile in image.tiles]
        return 1 + max(n % 10 for n in numbers), 1 + max(n // 10 for n in numbers)

    def _atlas(self, image):
        """All tiles of an image in one, pink where there is none. Tiles of other sizes are stretched by repeating texels."""
        found = {}
        for tile in image.tiles:
            self.check()
            path = tile_path(path_of(image), tile.number)
            packed = next((bytes(p.packed_file.data) for p in getattr(image, "packed_files", ())
                           if str(tile.number) in bpy.path.basename(p.filepath)), None)
            read = self._file(image, path, packed)
            if read is None:
                self.report.note(f"{image.name} ({tile.number})", "Images without data, shown pink")
            else:
                found[tile.number - 1001] = read
        if not found:
            return None
        columns, rows = self.grid(image)
        height, width = (max(texels.shape[k] for texels, _ in found.values()) for k in (0, 1))
        while width > 1 and height > 1 and columns * rows * width * height > LARGEST_ATLAS:
            width, height = width // 2, height // 2
        if any(texels.shape[0] > height for texels, _ in found.values()):
            self.report.note(image.name, "UDIM tiles read at a lower resolution")
        as_float = any(texels.dtype != np.uint8 for texels, _ in found.values())
        whole = np.empty((rows * height, columns * width, 4), np.float32 if as_float else np.uint8)
        whole[:] = np.array([1, 0, 1, 1]) * (1 if as_float else 255)
        for number, (texels, srgb) in found.items():
            self.check()
            if as_float and texels.dtype == np.uint8:
                table = np.arange(256, dtype=np.float32) / 255
                texels = np.concatenate([(srgb_to_linear(table) if srgb else table)[texels[..., :3]], table[texels[..., 3:]]], 2)
            y, x = (np.arange(n) * texels.shape[k] // n for k, n in ((0, height), (1, width)))
            top, left = (rows - 1 - number // 10) * height, number % 10 * width
            whole[top:top + height, left:left + width] = texels[y][:, x]
        return whole, not as_float and next(iter(found.values()))[1]


def scene_linear(colours, space):
    """(h, w, 3) of stored colours, by what Blender makes of a file of floats in that space; None where it cannot."""
    height, width = colours.shape[:2]
    texels = np.ones((height, width, 4), np.float32)
    texels[..., :3] = colours
    with tempfile.TemporaryDirectory() as folder, bpy.data.temp_data() as data:
        try:
            made = data.images.new("stored", width, height, alpha=True, float_buffer=True)
            made.colorspace_settings.name, made.file_format = "Non-Color", "OPEN_EXR"
            made.pixels.foreach_set(texels.ravel())
            made.filepath_raw = os.path.join(folder, "stored.exr")
            made.save()
            read = data.images.load(made.filepath_raw)
            read.colorspace_settings.name = space
            read.pixels.foreach_get(texels.reshape(-1))
        except (RuntimeError, TypeError):
            return None
    return texels[..., :3]


def path_of(image):
    return bpy.path.abspath(image.filepath, library=image.library)


def tile_path(path, number):
    u, v = (number - 1001) % 10, (number - 1001) // 10
    return path.replace("<UDIM>", str(number)).replace("<UVTILE>", f"u{u + 1}_v{v + 1}")


def frame_of(user, frame):
    """Number in the file name that a sequence has at a frame of the scene, as Blender counts."""
    length = user.frame_duration
    at = frame - user.frame_start + 1
    if length > 0:
        at = (at - 1) % length + 1 if user.use_cyclic else min(max(at, 1), length)
    return max(0, at + user.frame_offset)


def frame_path(path, frame):
    """The file of a sequence for a number; None where the name has none."""
    match = re.match(r"(.*?)(\d+)(\D*)$", path)
    return None if match is None else f"{match[1]}{frame:0{len(match[2])}d}{match[3]}"


def associated(image, texels, alpha_linked):
    """Colours of (h, w, 4) texels as a node shows them whose Alpha is linked or not.

    Cycles keeps colours multiplied by alpha, for bytes as they are stored, sRGB and all; it divides again where the
    node's Alpha is used. Blender's own bytes are not multiplied, its floats are.
    """
    colours = texels[..., :3]
    if image.alpha_mode in {"CHANNEL_PACKED", "NONE"} or image.colorspace_settings.name in DATA_SPACES:
        return colours
    alpha = texels[..., 3:]
    if texels.dtype == np.uint8:
        if alpha_linked or (alpha == 255).all():
            return colours
        return (colours.astype(np.uint16) * alpha // 255).astype(np.uint8)
    if not alpha_linked or (alpha == 1).all():
        return colours
    return colours / np.where((alpha > 0) & (alpha < 1), alpha, 1)
