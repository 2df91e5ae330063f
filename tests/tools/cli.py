"""What tests of the command share: running it, a folder for its files, reading its pictures."""
import concurrent.futures
import os
import pathlib
import struct
import subprocess
import sys
import tempfile
import time
import unittest
import zlib

ROOT = pathlib.Path(os.environ.get("LUMICUT_SOURCE_DIR", pathlib.Path(__file__).resolve().parents[2]))
BUILD = pathlib.Path(os.environ.get("LUMICUT_BINARY_DIR", ROOT / "build/release"))
COMMAND = BUILD / "bin/lumicut"
SCENE = ROOT / "reference_images/cornell_box/cornell_box.json"
sys.path.insert(0, str(ROOT / "export_scripts/scenes"))
from scene_writer import write_exr  # noqa: E402, F401  # tests take it from here

OK, FAILED, USAGE, BAD_FILE, INTERRUPTED = 0, 1, 2, 3, 130


def lumicut(*arguments, env=None):
    return subprocess.run([COMMAND, *map(str, arguments)], capture_output=True, text=True, timeout=300,
                          errors="surrogateescape",  # paths are bytes
                          env={**os.environ, **(env or {})})


class Cli(unittest.TestCase):
    def setUp(self):
        temporary = tempfile.TemporaryDirectory()
        self.addCleanup(temporary.cleanup)
        self.folder = pathlib.Path(temporary.name)

    def files(self):
        return sorted(path.name for path in self.folder.iterdir())

    def assert_ends(self, result, code, *texts):
        self.assertEqual(result.returncode, code, result.stderr)
        for text in texts:
            self.assertIn(text, result.stderr)


def together(calls):
    """Results of calls that wait for processes, a few at a time, in order."""
    with concurrent.futures.ThreadPoolExecutor(3) as pool:
        return [future.result() for future in [pool.submit(call) for call in calls]]


def wait_until_busy(process, seconds):
    """Until the process has used so much processor time: loading libraries alone takes a tenth of a second at most."""
    tick, limit = os.sysconf("SC_CLK_TCK"), time.monotonic() + 60
    while process.poll() is None and time.monotonic() < limit:
        fields = pathlib.Path(f"/proc/{process.pid}/stat").read_text().rsplit(")", 1)[1].split()
        if (int(fields[11]) + int(fields[12])) / tick > seconds:
            return
        time.sleep(0.02)


def wait_until_caught(process, number):
    """Until the process has a handler for that signal."""
    limit = time.monotonic() + 60
    while process.poll() is None and time.monotonic() < limit:
        caught = next(line for line in pathlib.Path(f"/proc/{process.pid}/status").read_text().splitlines() if line.startswith("SigCgt"))
        if int(caught.split()[1], 16) >> (number - 1) & 1:
            return
        time.sleep(0.02)


def read_png(data):
    """(width, height, rows of (r, g, b)) of an RGB PNG of 8 bits, not interlaced."""
    assert data.startswith(b"\x89PNG\r\n\x1a\n")
    at, packed = 8, b""
    while at < len(data):
        length, kind = struct.unpack(">I4s", data[at:at + 8])
        body = data[at + 8:at + 8 + length]
        if kind == b"IHDR":
            width, height, depth, colour, _, _, interlace = struct.unpack(">IIBBBBB", body)
            assert (depth, colour, interlace) == (8, 2, 0)
        elif kind == b"IDAT":
            packed += body
        at += 12 + length
    raw, stride, rows = zlib.decompress(packed), 3 * width, []
    before = bytearray(stride)
    for y in range(height):
        kind, line = raw[y * (stride + 1)], bytearray(raw[y * (stride + 1) + 1:(y + 1) * (stride + 1)])
        for i in range(stride):
            left, up, corner = (line[i - 3] if i >= 3 else 0), before[i], (before[i - 3] if i >= 3 else 0)
            if kind == 4:
                guess = left + up - corner
                paeth = min((abs(guess - v), k, v) for k, v in enumerate((left, up, corner)))[2]
            line[i] = (line[i] + (0, left, up, (left + up) // 2, paeth if kind == 4 else 0)[kind]) % 256
        rows.append([tuple(line[i:i + 3]) for i in range(0, stride, 3)])
        before = line
    return width, height, rows
