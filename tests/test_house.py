"""The house stands: data flows one way, and the plug-in carries no other library than it says."""
import os
import pathlib
import re
import subprocess
import unittest

ROOT = pathlib.Path(os.environ.get("LUMICUT_SOURCE_DIR", pathlib.Path(__file__).resolve().parents[1]))
BUILD = pathlib.Path(os.environ.get("LUMICUT_BINARY_DIR", ROOT / "build/release"))

# From the roof down; a folder may include from itself and from folders further down.
ORDER = ["tools", "io", "plugin", "render", "integrators", "clusters", "vpl", "film", "scene", "bsdf", "geometry", "accel", "core"]
# tools and io are hosts: of the library they know the public header and the metrics alone.
HOSTS_MAY = {"tools": {"tools", "io", "film", "plugin"}, "io": {"io", "film", "plugin"}}
READS_FILES = {"geometry/command"}  # a host of geometry/, which may include io/ too
INCLUDE = re.compile(r'^\s*#\s*include\s+["<]([a-z_]+)/([^">]+)[">]')


def upward_includes(root):
    found = []
    for folder in ORDER:
        allowed = HOSTS_MAY.get(folder, set(ORDER[ORDER.index(folder):]))
        for path in sorted((root / folder).rglob("*")):
            if path.suffix not in {".h", ".hpp", ".cpp", ".c", ".inc"}:
                continue
            if path.parent.relative_to(root).as_posix() in READS_FILES:
                may = {*allowed, "io"}
            else:
                may = allowed
            for number, line in enumerate(path.read_text().splitlines(), 1):
                match = INCLUDE.match(line)
                if match and match[1] in ORDER and match[1] not in may:
                    found.append(f"{path.relative_to(root)}:{number}: {folder}/ includes {match[1]}/{match[2]}")
                elif match and folder in HOSTS_MAY and match[1] == "film" and match[2] != "metrics.h":
                    found.append(f"{path.relative_to(root)}:{number}: a host includes film/{match[2]}")
    return found


class House(unittest.TestCase):
    def test_no_include_points_upward(self):
        self.assertEqual(upward_includes(ROOT), [])

    def test_library_links_embree_tbb_highway_and_the_c_and_cxx_runtimes_alone(self):
        library = BUILD / "lib/liblumicut.so"
        if not library.exists():
            self.skipTest(f"{library} is not built")
        needed = re.findall(r"\(NEEDED\).*\[(.+?)\]",
                            subprocess.run(["readelf", "-d", library], check=True, capture_output=True, text=True).stdout)
        # Sanitizer runtimes appear in sanitizer builds alone.
        allowed = re.compile(r"^(libembree[34]|libtbb|libhwy|libstdc\+\+|libm|libgcc_s|libc|ld-linux-x86-64|libasan|libubsan|libtsan)\.so")
        self.assertEqual([name for name in needed if not allowed.match(name)], [])


if __name__ == "__main__":
    unittest.main()
