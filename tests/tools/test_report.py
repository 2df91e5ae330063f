"""lumicut report: a page that needs nothing else; in a browser its slider moves and nothing complains."""
import html.parser
import json
import pathlib
import re
import shutil
import subprocess
import tempfile
import unittest

from cli import BAD_FILE, OK, SCENE, Cli, lumicut

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
RUNS = [{"name": "LC <1 & 2>", "integrator": "lightcuts", "parameters": {"error": [0.02, 0.2]}},
        {"name": "IC", "integrator": "illumination_cut",
         "match": {"measure": "rmse", "to": "LC <1 & 2> error=0.2", "vary": "error", "range": [0.01, 0.9], "steps": 2}}]


class Elements(html.parser.HTMLParser):
    """Tags with their attributes, and that every one is closed."""
    EMPTY = {"meta", "link", "img", "input", "br"}

    def __init__(self, text):
        super().__init__()
        self.found, self.open = [], []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.found.append((tag, dict(attributes)))
        if tag not in self.EMPTY:
            self.open.append(tag)

    def handle_startendtag(self, tag, attributes):
        self.found.append((tag, dict(attributes)))

    def handle_endtag(self, tag):
        assert self.open.pop() == tag, tag

    def all(self, tag, **having):
        return [a for t, a in self.found if t == tag and all(a.get(k) == v for k, v in having.items())]


class Report(Cli):
    @classmethod
    def setUpClass(cls):
        temporary = tempfile.TemporaryDirectory()
        cls.addClassCleanup(temporary.cleanup)
        cls.out = pathlib.Path(temporary.name)
        plan = cls.out / "plan.json"
        plan.write_text(json.dumps({"name": "a <b>", "size": [48, 40], "vpls": [150, 450], "scenes": [str(SCENE)], "runs": RUNS}))
        for arguments in (("bench", plan, "-o", cls.out, "-q"), ("report", cls.out / "results.json", "-o", cls.out / "page.html")):
            result = lumicut(*arguments)
            assert result.returncode == OK, result.stderr
        cls.text = (cls.out / "page.html").read_text()
        cls.page = Elements(cls.text)

    def test_the_page_is_whole_and_loads_nothing(self):
        self.assertEqual(self.page.open, [])
        for tag, attributes in self.page.found:
            for name in ("src", "href", "data", "action"):
                if attributes.get(name):
                    self.assertRegex(attributes[name], r"^(data:|#)", f"{tag} {name}")
        self.assertIsNone(re.search(r"https?://|@import|url\((?!#)", self.text))
        self.assertEqual(len(self.page.all("html", lang="en")), 1)
        for attributes in self.page.all("img"):
            self.assertIn("alt", attributes)
        ids = [a["id"] for _, a in self.page.found if a.get("id")]
        self.assertEqual(len(ids), len(set(ids)))

    def test_names_are_text_and_not_tags(self):
        self.assertIn("Lumicut: a &lt;b&gt;", self.text)
        self.assertIn("LC &lt;1 &amp; 2&gt; error=0.2", self.text)
        self.assertNotIn("LC <1", self.text)

    def test_tables_plots_and_pictures_need_no_script(self):
        tables = self.page.all("table")
        # Two numbers of lights, four tables of how things grow with them, and every run.
        self.assertEqual(len(tables), 2 + 4 + 1)
        self.assertEqual(len(self.page.all("caption")), len(tables))
        results = json.loads((self.out / "results.json").read_text())
        for row in results["rows"]:
            self.assertIn(f"{row['rmse']:.5f}", self.text)
        plots = self.page.all("figure", **{"class": "plot"})
        self.assertEqual([p["id"] for p in plots], [f"error-{g}-{m}" for g in (0, 1) for m in ("mean_relative_error", "rmse")] + ["scaling-0"])
        self.assertEqual(len(self.page.all("line", **{"class": "guide"})), 1)
        for kind, count in (("image", 4), ("error", 3), ("signed", 3), ("bounds", 3), ("cut_size", 3), ("rays", 3)):
            self.assertEqual(len(self.page.all("figure", **{"data-kind": kind})), 2 * count, kind)
        # Without scripts the slider, which could not move, is not there.
        self.assertTrue(all("hidden" in a for a in self.page.all("div", **{"class": "viewer"})))

    def test_pictures_can_be_made_smaller(self):
        self.assert_ends(lumicut("report", self.out / "results.json", "-o", self.folder / "s.html", "--max-size", "24"), OK)
        small = Elements((self.folder / "s.html").read_text())
        self.assertEqual({(a["width"], a["height"]) for a in small.all("img") if a.get("width")}, {("24", "20")})

    def test_results_that_are_none_are_refused(self):
        results = json.loads((self.out / "results.json").read_text())
        bad, page = self.folder / "bad.json", self.folder / "page.html"
        no_key = {**results, "rows": [{k: v for k, v in results["rows"][0].items() if k != "group"}]}
        for text in ("", "[]", "{}", '{"format": "other"}', json.dumps({"format": results["format"]}), json.dumps(no_key),
                     json.dumps({**results, "rows": 7}), json.dumps({**results, "machine": None})):
            bad.write_text(text)
            self.assert_ends(lumicut("report", bad, "-o", page), BAD_FILE, "bad.json")
        self.assert_ends(lumicut("report", self.folder / "none.json", "-o", page), BAD_FILE, "none.json")
        self.assert_ends(lumicut("report", self.out / "results.json", "-o", self.folder / "no/page.html"), BAD_FILE, "no/page.html")
        self.assertEqual(self.files(), ["bad.json"])

    def test_results_without_their_images_still_give_tables(self):
        shutil.copy(self.out / "results.json", self.folder)
        self.assert_ends(lumicut("report", self.folder / "results.json"), OK)
        text = (self.folder / "report.html").read_text()
        self.assertIn("Not there:", text)
        self.assertEqual(len(Elements(text).all("table")), 7)


# Runs in the page: moves the slider as a user's keyboard and mouse do, and writes down what came of it.
WATCH = """<script>
window.complaints = [];
window.onerror = text => { complaints.push(text); };
console.error = console.warn = (...texts) => { complaints.push(texts.join(" ")); };
</script>"""
DRIVE = """<script>
addEventListener("load", () => {
  const seen = {};
  const viewer = document.querySelector(".viewer"), stage = viewer.querySelector(".stage");
  const range = viewer.querySelector("input"), [left, right] = viewer.querySelectorAll("select");
  const [under, over] = stage.querySelectorAll("img");
  const edge = () => getComputedStyle(over).clipPath;
  seen.viewers = [...document.querySelectorAll(".viewer")].map(v => v.hidden);
  seen.edges = [edge()];
  range.value = 20; range.dispatchEvent(new Event("input")); seen.edges.push(edge());
  const box = stage.getBoundingClientRect();
  stage.setPointerCapture = () => {};
  stage.dispatchEvent(new PointerEvent("pointerdown", {clientX: box.left + box.width * .75, clientY: box.top + 5, buttons: 1}));
  seen.edges.push(edge()); seen.range = range.value;
  seen.pictures = left.options.length;
  seen.first = [under.alt, over.alt];
  right.value = 4; right.dispatchEvent(new Event("change"));
  seen.other = [under.alt, over.alt, over.src === document.querySelectorAll("#gallery0 img")[4].src];
  seen.sizes = [under, over].map(i => [i.getBoundingClientRect().width, i.getBoundingClientRect().height, i.naturalWidth > 0]);
  seen.plots = [...document.querySelectorAll(".plot > svg")].map(s => [s.getBoundingClientRect().width, s.querySelectorAll(".mark").length]);
  seen.overflow = document.documentElement.scrollWidth - innerWidth;
  seen.complaints = complaints;
  document.body.dataset.seen = JSON.stringify(seen);
});
</script>"""


@unittest.skipUnless(CHROMIUM, "chromium is not installed: ./setup.sh installs it")
class Browser(Cli):
    setUpClass = Report.__dict__["setUpClass"]

    def test_the_slider_moves_and_nothing_complains(self):
        page = self.folder / "page.html"
        page.write_text(self.text.replace("<head>", "<head>" + WATCH, 1).replace("</body>", DRIVE + "</body>"))
        result = subprocess.run([CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--no-first-run",
                                 "--window-size=900,900", f"--user-data-dir={self.folder / 'profile'}", "--virtual-time-budget=5000",
                                 "--enable-logging=stderr", "--dump-dom", page.as_uri()], capture_output=True, text=True, timeout=120)
        found = re.search(r'data-seen="([^"]*)"', result.stdout)
        self.assertTrue(found, result.stderr[-2000:])
        seen = json.loads(found[1].replace("&quot;", '"').replace("&lt;", "<").replace("&gt;", ">").replace("&amp;", "&"))
        self.assertEqual(seen["complaints"], [])
        self.assertNotIn(":CONSOLE", result.stderr)
        self.assertEqual(seen["viewers"], [False, False])
        self.assertEqual(seen["edges"], [f"inset(0px 0px 0px {percent}%)" for percent in (50, 20, 75)])
        self.assertEqual(float(seen["range"]), 75)
        self.assertEqual(seen["pictures"], 19)
        self.assertEqual(seen["first"], ["reference", "LC <1 & 2> error=0.02"])
        self.assertEqual(seen["other"], ["reference", "LC <1 & 2> error=0.02: relative error", True])
        self.assertEqual(seen["sizes"][0], seen["sizes"][1], "the pictures lie on each other")
        self.assertTrue(seen["sizes"][0][2])
        self.assertEqual(len(seen["plots"]), 5)
        for width, marks in seen["plots"]:
            self.assertGreater(width, 200)
            self.assertGreaterEqual(marks, 4)
        self.assertLessEqual(seen["overflow"], 0, "the page does not scroll sideways")


if __name__ == "__main__":
    unittest.main()
