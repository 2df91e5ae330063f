"""Manual pages and bash's completion, which tools/manual.py makes, beside what the programs say of themselves."""
import gzip
import re
import shutil
import subprocess
import sys
import unittest

import cli


def help_of(program, *words):
    return subprocess.run([program, *words, "--help"], check=True, capture_output=True, text=True).stdout


class Pages:
    """Of one program; the classes below are the tests."""
    program = None

    def setUp(self):
        super().setUp()
        self.name = self.program.name
        subprocess.run([sys.executable, cli.ROOT / "tools/manual.py", self.program, "1.2.3", self.folder], check=True)
        self.page = {path.name.removesuffix(".1.gz"): gzip.open(path, "rt").read() for path in (self.folder / "man1").iterdir()}
        self.commands = re.findall(r"^  ([a-z-]+) {2,}\S", help_of(self.program).partition("Subcommands:")[2], re.M)

    def options(self, command):
        return re.findall(r"(?:^  |,)(--?[a-z][a-z0-9-]*)", help_of(self.program, command), re.M)

    def complete(self, *words):
        script = (f'. "{self.folder}/completion/{self.name}"; COMP_WORDS=("$@") COMP_CWORD=$(($# - 1)); _{self.name.replace("-", "_")}; '
                  'printf "%s\\n" "${COMPREPLY[@]}"')
        return subprocess.run(["bash", "-c", script, "bash", *words], check=True, capture_output=True, text=True).stdout.split()

    def test_every_command_has_a_page_and_every_option_is_on_it(self):
        self.assertGreater(len(self.commands), 4)
        self.assertEqual(set(self.page), {self.name, *(f"{self.name}-{c}" for c in self.commands)})
        for command in self.commands:
            self.assertIn(f"{self.name}-{command}".replace("-", "\\-"), self.page[self.name])
            options = self.options(command)
            self.assertIn("--help", options)
            for option in options:
                self.assertIn(option.replace("-", "\\-"), self.page[f"{self.name}-{command}"], command)

    @unittest.skipUnless(shutil.which("man"), "man is not installed")
    def test_pages_are_read_without_a_warning(self):
        for path in (self.folder / "man1").iterdir():
            done = subprocess.run(["man", "--warnings", "-l", path], capture_output=True, text=True,
                                  env={"PATH": "/usr/bin:/bin", "LC_ALL": "C.UTF-8", "MANWIDTH": "100", "PAGER": "cat"})
            self.assertEqual((done.returncode, done.stderr), (0, ""), path.name)

    def test_completion_offers_the_commands_their_options_and_choices(self):
        self.assertEqual(set(self.complete(self.name, "")), {*self.commands, "--help"})
        for command in self.commands:
            self.assertEqual(set(self.complete(self.name, command, "-")), set(self.options(command)), command)
        self.assertEqual(self.complete(self.name, *self.choice[:-1], ""), self.choice[-1])
        (self.folder / "a scene.json").touch()
        self.assertEqual(self.complete(self.name, self.commands[0], f"{self.folder}/a")[0], f"{self.folder}/a")


class Lumicut(Pages, cli.Cli):
    program = cli.COMMAND
    choice = ("render", "--rays", ["robust", "fast"])


@unittest.skipUnless((cli.BUILD / "bin/lumicut-geometry").exists(), "lumicut-geometry was not built")
class Geometry(Pages, cli.Cli):
    program = cli.BUILD / "bin/lumicut-geometry"
    choice = ("recluster", "--method", ["kmeans", "tree"])


if __name__ == "__main__":
    unittest.main()
