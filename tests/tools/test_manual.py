"""Manual pages and bash's completion, which tools/manual.py makes, beside what the command says of itself."""
import gzip
import re
import shutil
import subprocess
import sys
import unittest

import cli

COMMANDS = re.findall(r"^  ([a-z]+) {2,}\S", cli.lumicut("--help").stdout.partition("Subcommands:")[2], re.M)


class Manual(cli.Cli):
    def setUp(self):
        super().setUp()
        subprocess.run([sys.executable, cli.ROOT / "tools/manual.py", cli.COMMAND, "1.2.3", self.folder], check=True)
        self.page = {path.name.removesuffix(".1.gz"): gzip.open(path, "rt").read() for path in (self.folder / "man1").iterdir()}

    def options(self, command):
        return re.findall(r"(?:^  |,)(--?[a-z][a-z-]*)", cli.lumicut(command, "--help").stdout, re.M)

    def complete(self, *words):
        script = (f'. "{self.folder}/completion/lumicut"; COMP_WORDS=("$@") COMP_CWORD=$(($# - 1)); _lumicut; '
                  'printf "%s\\n" "${COMPREPLY[@]}"')
        return subprocess.run(["bash", "-c", script, "bash", *words], check=True, capture_output=True, text=True).stdout.split()

    def test_every_command_has_a_page_and_every_option_is_on_it(self):
        self.assertGreater(len(COMMANDS), 6)
        self.assertEqual(set(self.page), {"lumicut", *(f"lumicut-{c}" for c in COMMANDS)})
        for command in COMMANDS:
            self.assertIn(f"lumicut\\-{command}", self.page["lumicut"])
            options = self.options(command)
            self.assertIn("--help", options)
            for option in options:
                self.assertIn(option.replace("-", "\\-"), self.page[f"lumicut-{command}"], command)

    @unittest.skipUnless(shutil.which("man"), "man is not installed")
    def test_pages_are_read_without_a_warning(self):
        for path in (self.folder / "man1").iterdir():
            done = subprocess.run(["man", "--warnings", "-l", path], capture_output=True, text=True,
                                  env={"PATH": "/usr/bin:/bin", "LC_ALL": "C.UTF-8", "MANWIDTH": "100", "PAGER": "cat"})
            self.assertEqual((done.returncode, done.stderr), (0, ""), path.name)

    def test_completion_offers_the_commands_their_options_and_choices(self):
        self.assertEqual(set(self.complete("lumicut", "")), {*COMMANDS, "--help"})
        for command in COMMANDS:
            self.assertEqual(set(self.complete("lumicut", command, "-")), set(self.options(command)), command)
        self.assertEqual(self.complete("lumicut", "render", "--rays", ""), ["robust", "fast"])
        (self.folder / "a scene.json").touch()
        self.assertEqual(self.complete("lumicut", "render", f"{self.folder}/a")[0], f"{self.folder}/a")


if __name__ == "__main__":
    unittest.main()
