"""lumicut compare: images of any program and format; HDR-FLIP against an implementation of its own."""
import json
import struct
import unittest
import zlib

from cli import BAD_FILE, OK, Cli as Base, lumicut

try:
    import numpy as np

    import flip_oracle
except ImportError:
    np = None


def png(pixels, width, height, channels):
    """8 bits a channel."""
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    rows = b"".join(b"\0" + bytes(pixels[y * width * channels:(y + 1) * width * channels]) for y in range(height))
    kind = {1: 0, 3: 2, 4: 6}[channels]
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, kind, 0, 0, 0))
            + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b""))


def tiff(pixels, width, height):
    """RGB of 32-bit floats, uncompressed, in one strip."""
    entries = [(256, 4, 1, width), (257, 4, 1, height), (258, 3, 3, 10), (259, 3, 1, 1), (262, 3, 1, 2), (273, 4, 1, 16), (277, 3, 1, 3),
               (278, 4, 1, height), (279, 4, 1, 4 * len(pixels)), (284, 3, 1, 1), (339, 3, 3, 0)]
    data = struct.pack(f"<{len(pixels)}f", *pixels)
    arrays = 16 + len(data)  # three bits a sample, then three formats
    values = {258: arrays, 339: arrays + 6}
    folder = struct.pack("<H", len(entries)) + b"".join(
        struct.pack("<HHI", tag, kind, count) + struct.pack("<I", values.get(tag, value)) for tag, kind, count, value in entries)
    return (b"II*\0" + struct.pack("<I", arrays + 12) + bytes(8) + data + struct.pack("<6H", 32, 32, 32, 3, 3, 3) + folder + bytes(4))


def exr(parts, width, height):
    """Uncompressed, of 32-bit floats: a list of (part's name, {channel: values})."""
    several = len(parts) > 1

    def attribute(name, kind, data):
        return name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<i", len(data)) + data
    headers = []
    for name, channels in parts:
        names = b"".join(c.encode() + b"\0" + struct.pack("<iBBBBii", 2, 0, 0, 0, 0, 1, 1) for c in sorted(channels)) + b"\0"
        box = struct.pack("<iiii", 0, 0, width - 1, height - 1)
        header = (attribute("channels", "chlist", names) + attribute("compression", "compression", b"\0")
                  + attribute("dataWindow", "box2i", box) + attribute("displayWindow", "box2i", box)
                  + attribute("lineOrder", "lineOrder", b"\0") + attribute("pixelAspectRatio", "float", struct.pack("<f", 1))
                  + attribute("screenWindowCenter", "v2f", struct.pack("<ff", 0, 0))
                  + attribute("screenWindowWidth", "float", struct.pack("<f", 1)))
        if several:
            header += (attribute("name", "string", name.encode()) + attribute("type", "string", b"scanlineimage")
                       + attribute("chunkCount", "int", struct.pack("<i", height)))
        headers.append(header + b"\0")
    start = struct.pack("<ii", 20000630, 2 | (0x1000 if several else 0)) + b"".join(headers) + (b"\0" if several else b"")
    chunks = []
    for part, (_, channels) in enumerate(parts):
        for y in range(height):
            data = b"".join(struct.pack(f"<{width}f", *channels[c][y * width:(y + 1) * width]) for c in sorted(channels))
            chunks.append((struct.pack("<i", part) if several else b"") + struct.pack("<ii", y, len(data)) + data)
    offset, table = len(start) + 8 * len(chunks), b""
    for chunk in chunks:
        table += struct.pack("<Q", offset)
        offset += len(chunk)
    return start + table + b"".join(chunks)


W, H = 4, 3
RED, GREEN, BLUE = ([scale * (i + 1) / (W * H) for i in range(W * H)] for scale in (1, 0.5, 0.25))


class Compare(Base):
    def file(self, name, data):
        (self.folder / name).write_bytes(data)
        return self.folder / name

    def setUp(self):
        super().setUp()
        self.reference = self.file("reference.exr", exr([("", {"R": RED, "G": GREEN, "B": BLUE})], W, H))

    def measures(self, image, *arguments, reference=None):
        result = lumicut("compare", image, reference or self.reference, "--json", "--no-flip", *arguments)
        self.assert_ends(result, OK)
        return json.loads(result.stdout)

    def assert_same(self, image, *arguments, reference=None):
        self.assertEqual(self.measures(image, *arguments, reference=reference)["rmse"], 0)

    def test_channels_of_any_case_and_layer_are_colours(self):
        for names in ("rgb", ("red", "green", "blue"), ("Red", "Green", "Blue"),
                      ("ViewLayer.Combined.R", "ViewLayer.Combined.G", "ViewLayer.Combined.B")):
            channels = dict(zip(names, (RED, GREEN, BLUE)))
            self.assert_same(self.file("other.exr", exr([("", channels)], W, H)))
        more = {**channels, "ViewLayer.Combined.A": [1.0] * 12, "ViewLayer.DiffDir.R": BLUE, "ViewLayer.DiffDir.G": BLUE,
                "ViewLayer.DiffDir.B": BLUE, "ViewLayer.Depth.Z": RED}
        image = self.file("blender.exr", exr([("", more)], W, H))
        self.assert_same(image)
        self.assertGreater(self.measures(image, "--layer", "DiffDir", "--reference-layer", "radiance")["rmse"], 0.1)
        self.assert_same(image, "--layer", "ViewLayer.Combined", "--reference-layer", "radiance")

    def test_parts_of_an_exr_are_layers(self):
        image = self.file("parts.exr", exr([("beauty", {"R": BLUE, "G": BLUE, "B": BLUE}),
                                           ("diffuse", {"R": RED, "G": GREEN, "B": BLUE}),
                                           ("ViewLayer.Combined", {"ViewLayer.Combined.R": RED, "ViewLayer.Combined.G": GREEN,
                                                                   "ViewLayer.Combined.B": BLUE})], W, H))
        self.assertGreater(self.measures(image)["rmse"], 0.1)
        for name in ("diffuse", "Combined"):
            self.assert_same(image, "--layer", name, "--reference-layer", "radiance")
        result = lumicut("compare", image, self.reference, "--layer", "gloss")
        self.assert_ends(result, BAD_FILE, "parts.exr", "gloss", "diffuse")

    def test_a_grey_channel_stands_against_three(self):
        grey = self.file("grey.exr", exr([("", {"R": RED, "G": RED, "B": RED})], W, H))
        for name in ("Y", "luminance", "V", "grey"):
            self.assert_same(self.file("one.exr", exr([("", {name: RED})], W, H)), reference=grey)

    def test_a_png_is_decoded_to_linear(self):
        codes = [7, 100, 200, 0, 255, 33] * 6
        linear = [(c / 255 / 12.92 if c / 255 <= 0.04045 else ((c / 255 + 0.055) / 1.055) ** 2.4) for c in codes]
        reference = self.file("linear.exr", exr([("", {"R": linear[0::3], "G": linear[1::3], "B": linear[2::3]})], W, H))
        with_alpha = [c for i in range(0, 36, 3) for c in (*codes[i:i + 3], 128)]
        for image in (png(codes, W, H, 3), png(with_alpha, W, H, 4)):
            self.assertLess(self.measures(self.file("8 bits ä.png", image), reference=reference)["max_relative_error"], 1e-5)
        grey = self.file("grey.png", png(codes[:12], W, H, 1))
        self.assertLess(self.measures(grey, reference=self.file("grey3.png", png(
            [c for c in codes[:12] for _ in range(3)], W, H, 3)))["rmse"], 1e-7)

    def test_a_broken_image_is_named(self):
        for name, data in (("cut.png", png([i * i % 256 for i in range(36)], W, H, 3)[:60]), ("text.tif", b"no image"), ("empty.hdr", b"")):
            self.assert_ends(lumicut("compare", self.file(name, data), self.reference), BAD_FILE, name)
        huge = png([], 0, 0, 3).replace(struct.pack(">II", 0, 0), struct.pack(">II", 16384, 16384))
        self.assert_ends(lumicut("compare", self.file("huge.png", huge), self.reference), BAD_FILE, "huge.png")

    def test_a_radiance_file_is_read(self):
        flat = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 3 +X 4\n" + bytes([128, 64, 32, 129]) * 12
        same = self.file("same.exr", exr([("", {c: [v / 128] * 12 for c, v in (("R", 128), ("G", 64), ("B", 32))})], W, H))
        self.assertLess(self.measures(self.file("flat.hdr", flat), reference=same)["max_relative_error"], 0.01)

    def test_a_tiff_of_floats_keeps_its_values(self):
        values = [0.01 * i * i for i in range(36)]
        same = self.file("same.exr", exr([("", {"R": values[0::3], "G": values[1::3], "B": values[2::3]})], W, H))
        self.assertEqual(self.measures(self.file("floats.tif", tiff(values, W, H)), reference=same)["rmse"], 0)

    @unittest.skipUnless(np, "this Python has no numpy")
    def test_flip_and_hdr_flip_are_what_the_papers_define(self):
        random = np.random.default_rng(1)
        width, height = 40, 30
        y, x = np.mgrid[0:height, 0:width]
        reference = np.stack([0.2 + np.exp(0.2 * x - 3), 0.1 + 0.01 * y, 0.3 + 0.2 * np.sin(x / 3)], -1)
        image = reference * random.uniform(0.6, 1.5, reference.shape)
        image[5:9, 5:9] += 3
        files = [self.file(name, exr([("", {c: pixels[..., k].ravel().tolist() for k, c in enumerate("RGB")})], width, height))
                 for name, pixels in (("a.exr", image), ("b.exr", reference))]
        image, reference = (p.astype(np.float32).astype(float) for p in (image, reference))
        result = lumicut("compare", *files, "--json", "--hdr-flip", "--exposure", "1")
        self.assert_ends(result, OK)
        found = json.loads(result.stdout)
        # The papers print the matrix of RGB to XYZ rounded.
        self.assertAlmostEqual(found["flip"], flip_oracle.ldr(np.clip(image, 0, 1), np.clip(reference, 0, 1)).mean(), delta=2e-4)
        errors, exposures = flip_oracle.hdr(image, reference)
        self.assertGreater(exposures, 4)
        self.assertAlmostEqual(found["hdr_flip"], errors.mean(), delta=2e-4)
        self.assertGreater(found["hdr_flip"], found["flip"])


if __name__ == "__main__":
    unittest.main()
