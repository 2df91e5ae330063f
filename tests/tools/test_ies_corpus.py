"""The add-on's reader of photometric files against the corpus that the command's is tested with."""
import importlib.util
import json
import os
import pathlib
import unittest

try:
    import numpy as np
except ImportError:
    np = None

ROOT = pathlib.Path(os.environ.get("LUMICUT_SOURCE_DIR", pathlib.Path(__file__).resolve().parents[2]))
if np:
    SPEC = importlib.util.spec_from_file_location("ies", ROOT / "export_scripts/lumicut_blender/ies.py")
    ies = importlib.util.module_from_spec(SPEC)
    SPEC.loader.exec_module(ies)


def interpolated(table, v, h):
    vertical, horizontal, candela = table
    rows = [np.interp(v, vertical, row) for row in candela]
    return np.interp(h, horizontal, rows)


@unittest.skipUnless(np, "this Python has no numpy")
class Corpus(unittest.TestCase):
    def test_what_the_command_reads_and_refuses_the_add_on_does_too(self):
        for case in json.loads((ROOT / "tests/io/ies_corpus.json").read_text()):
            with self.subTest(case["name"]):
                if "error" in case:
                    with self.assertRaises(ies.IesError):
                        ies.parse(case["text"])
                    continue
                remarks = []
                table = ies.parse(case["text"], remarks.append)
                self.assertEqual((table[1][0], table[1][-1]), (0, 360))
                for v, h, candela in case["samples"]:
                    self.assertAlmostEqual(interpolated(table, v, h), candela, delta=case["tolerance"] * table[2].max())
                self.assertEqual(bool(remarks), bool(case["warnings"]), remarks)
                for words in case["warnings"]:
                    self.assertIn(words, " ".join(remarks))

    def test_a_byte_order_mark_read_as_latin_1_is_passed_over(self):
        text = "TILT=NONE\n1 1 1 2 1 1 2 0 0 0\n1 1 0\n0 90\n0\n5 5\n"
        self.assertEqual(ies.parse(text.encode("utf-8-sig").decode("latin-1"))[2][0, 0], 5)


if __name__ == "__main__":
    unittest.main()
