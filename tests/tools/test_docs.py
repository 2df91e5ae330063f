"""The pages hold what they say: links lead somewhere, parameter tables are the library's, quoted commands parse."""
import html
import json
import re
import shlex
import unittest

from cli import ROOT, lumicut

PAGES = [*sorted(ROOT.glob("*.md")), *sorted((ROOT / "docs").rglob("*.md"))]
CODE_BLOCK = re.compile(r"^ *```.*?^ *```", re.MULTILINE | re.DOTALL)
INDENTED = re.compile(r"^(?:    .+\n)+", re.MULTILINE)


def name_of(page):
    return str(page.relative_to(ROOT))


def without_code(text):
    return re.sub(r"`[^`\n]*`", "", CODE_BLOCK.sub("", text))


def anchors(page):
    """Of the headings, as GitHub names them."""
    found = set()
    for heading in re.findall(r"^#+ +(.*)$", CODE_BLOCK.sub("", page.read_text()), re.MULTILINE):
        heading = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).replace("`", "").strip().lower()
        found.add(re.sub(r"[^\w\- ]", "", heading).replace(" ", "-"))
    return found


def table_rows(text):
    """Cells of all rows of all tables, with the header's first cell."""
    header = None
    for line in text.splitlines():
        if not line.startswith("|"):
            header = None
            continue
        cells = [cell.strip().replace("\\|", "|") for cell in re.split(r"(?<!\\)\|", line.strip().strip("|"))]
        if header is None:
            header = cells[0]
        elif not re.fullmatch(r"[-: ]+", cells[0]):
            yield header, cells


def same_value(parameter, written):
    default = parameter["default"]
    if parameter["type"] == "bool":
        return written == ("true" if default == "1" else "false")
    if parameter["type"] == "choice":
        return written == default
    return float(written) == float(default)


def commands(text):
    """Calls of lumicut in code blocks, continued lines joined, and in the text."""
    yield from re.findall(r"`lumicut ([a-z][^`\n]*)`", CODE_BLOCK.sub("", text))
    for block in [*CODE_BLOCK.findall(text), *INDENTED.findall(text)]:
        for line in re.sub(r"\s*\\\n\s*", " ", block).splitlines():
            match = re.match(r"^(?:\$ )?(?:[A-Z_]+=\S+ )*(?:build/release/bin/)?lumicut ([a-z].*)$", line.strip())
            if match:
                yield re.split(r"\s{3,}|\s# ", match[1])[0]


class Docs(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        info = json.loads(lumicut("info", "--json").stdout)
        cls.integrators = {i["id"]: {p["id"]: p for p in i["parameters"]} for i in info["integrators"]}

    def test_every_relative_link_leads_to_a_file_and_a_heading(self):
        broken = []
        for page in PAGES:
            for target in re.findall(r"\]\(([^)\s]+)\)", without_code(page.read_text())):
                if re.match(r"[a-z]+:", target):
                    continue
                path, _, anchor = html.unescape(target).partition("#")
                file = (page.parent / path).resolve() if path else page
                if not file.exists() or (anchor and anchor not in anchors(file)):
                    broken.append(f"{name_of(page)}: {target}")
        self.assertEqual(broken, [])

    def test_paths_in_the_text_exist(self):
        folders = "|".join(sorted(p.name for p in ROOT.iterdir() if p.is_dir() and p.name not in {"build", "out"} and p.name[0] != "."))
        missing = []
        for page in PAGES:
            for path in re.findall(rf"`((?:{folders})/[\w./-]+)`", page.read_text()):
                if not (ROOT / path).exists():
                    missing.append(f"{name_of(page)}: {path}")
        self.assertEqual(missing, [])

    def test_parameter_tables_are_the_librarys(self):
        shared = set.intersection(*(set(p) for name, p in self.integrators.items() if name != "path_tracer"))
        for name, parameters in self.integrators.items():
            page = ROOT / "docs/integrators" / f"{name}.md"
            self.assertTrue(page.exists(), f"{name} has no page")
            written = {cells[0].strip("`"): cells[1].strip("`") for header, cells in table_rows(page.read_text())
                       if header in {"parameter", "name"}}
            own = set(parameters) if name in {"exhaustive", "path_tracer"} else set(parameters) - shared
            self.assertEqual(set(written), own, f"parameters on the page of {name}")
            for parameter, value in written.items():
                self.assertTrue(same_value(parameters[parameter], value),
                                f"{name}: {parameter} is {parameters[parameter]['default']}, the page says {value}")

    def test_the_table_of_integrators_has_each_of_them(self):
        text = (ROOT / "docs/integrators/README.md").read_text()
        listed = {m for _, cells in table_rows(text) for m in re.findall(r"\[`(\w+)`\]\(\w+\.md\)", cells[0])}
        self.assertEqual(listed, set(self.integrators))
        for name in self.integrators:
            self.assertIn("(README.md)", (ROOT / "docs/integrators" / f"{name}.md").read_text(), name)

    def test_quoted_commands_have_known_options_integrators_and_parameters(self):
        options, wrong, seen = {}, [], 0
        for page in PAGES:
            for line in commands(page.read_text()):
                words = shlex.split(line)
                sub = words[0]
                if sub not in options:
                    options[sub] = set(re.findall(r"(?<![\w-])--?[a-z][\w-]*", lumicut(sub, "--help").stdout))
                seen += 1
                integrator = words[words.index("-i") + 1] if "-i" in words else None
                if integrator == "METHOD":
                    integrator = None
                if integrator and integrator not in self.integrators:
                    wrong.append(f"{name_of(page)}: {integrator}: {line}")
                known = self.integrators.get(integrator) or {p for of in self.integrators.values() for p in of}
                for i, word in enumerate(words):
                    if word.startswith("-") and word not in options[sub]:
                        wrong.append(f"{name_of(page)}: {word}: {line}")
                    if word == "-p" and words[i + 1].partition("=")[0] not in known:
                        wrong.append(f"{name_of(page)}: {words[i + 1]}: {line}")
                    if word == "--run":
                        run = words[i + 1].split()
                        wrong += [f"{name_of(page)}: {p}: {line}" for p in run[1:]
                                  if p.partition("=")[0] not in self.integrators.get(run[0], {})]
        self.assertEqual(wrong, [])
        self.assertGreater(seen, 30)

    def test_names_of_the_c_abi_are_in_its_headers(self):
        headers = "".join(p.read_text() for folder in ("plugin/include/lumicut", "geometry/c_api/include/lumicut")
                          for p in (ROOT / folder).iterdir())
        known = set(re.findall(r"\b(?:lumicut|LUMICUT)_\w+", headers))
        # Upper case also names variables of the environment and options of the build.
        for top in {p.name for p in ROOT.iterdir()} - {"build", "out", "docs", "README.md", ".git"}:
            for path in [ROOT / top] if (ROOT / top).is_file() else (ROOT / top).rglob("*"):
                if path.suffix in {".cpp", ".h", ".py", ".sh", ".json"} or path.name == "CMakeLists.txt":
                    known |= set(re.findall(r"\bLUMICUT_[A-Z_]+\b", path.read_text()))
        unknown = []
        for page in PAGES:
            for name in re.findall(r"(?<![\w/])(?:lumicut|LUMICUT)_[A-Za-z0-9_]+", page.read_text()):
                if name not in known and not name.startswith(("lumicut_blender", "lumicut_geometry")):
                    unknown.append(f"{name_of(page)}: {name}")
        self.assertEqual(unknown, [])

    def test_every_key_of_scene_files_is_described(self):
        source = (ROOT / "io/scene_json.cpp").read_text()
        keys = set(re.findall(r'\.(?:need|find|has|text|number|integer|boolean|vector3)\("([a-z_]+)"', source))
        self.assertGreater(len(keys), 60)
        page = (ROOT / "docs/scene_format.md").read_text()
        self.assertEqual(sorted(k for k in keys if not re.search(rf'[`"]{k}[`"]', page)), [])

    def test_notes_in_the_tables_of_blenders_nodes_are_the_add_ons(self):
        # The tables themselves are compared where Blender is: tests/blender/in_status.py.
        source = "".join(p.read_text() for p in sorted((ROOT / "export_scripts/lumicut_blender").glob("*.py")))
        for path in sorted((ROOT / "docs").glob("blender_nodes*.md")):
            with self.subTest(page=path.name):
                page = path.read_text()
                notes = {text for cell in re.findall(r"(?:by name|nuance): ([^|]*[^| ]) *\|", page) for text in cell.split("; ")}
                self.assertGreater(len(notes), 12)
                self.assertEqual(sorted(text for text in notes if text not in source), [])
                features = set(re.findall(r"^\| ([^|:]*): [^|]* \| [^|]* \| (?:followed|exact)", page, re.MULTILINE))
                self.assertGreater(len(features), 40)


if __name__ == "__main__":
    unittest.main()
