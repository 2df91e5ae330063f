"""`kill -9` at any moment of a render with a checkpoint: it can be read, and the render goes on to the unbroken image.

LUMICUT_KILLS: how many (8 unless told otherwise); LUMICUT_KILLS_SEED: of the moments."""
import json
import os
import random
import subprocess
import time
import unittest

from cli import COMMAND, OK, SCENE, Cli, lumicut

KILLS = int(os.environ.get("LUMICUT_KILLS", "8"))
SEED = int(os.environ.get("LUMICUT_KILLS_SEED", "1"))
RENDER = ["render", SCENE, "--passes", "24", "--size", "48x36", "--vpls", "150", "-p", "compensate=true", "--layers",
          "radiance,error,depth", "--threads", "2", "-q"]


class Kills(Cli):
    def run_until(self, arguments, moment):
        """Exit code, or None where it was killed: `moment` seconds after its start, or (below 0) after its first write."""
        kept = self.folder / "render.checkpoint"
        before = kept.stat().st_mtime_ns if kept.exists() else 0
        with subprocess.Popen([COMMAND, *map(str, arguments)], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE) as process:
            if moment < 0:
                while process.poll() is None and (kept.stat().st_mtime_ns if kept.exists() else 0) == before:
                    time.sleep(0.0005)
            try:
                process.wait(abs(moment))
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
                return None
            self.assertEqual(process.returncode, OK, process.stderr.read().decode())
            return OK

    def assert_same(self, image, whole):
        for layer in ("radiance", "error", "depth"):
            result = lumicut("compare", image, whole, "--json", "--no-flip", "--layer", layer)
            self.assert_ends(result, OK)
            self.assertEqual(json.loads(result.stdout)["rmse"], 0, layer)

    def test_a_killed_render_loses_nothing(self):
        whole, image, kept = (self.folder / name for name in ("whole.exr", "image.exr", "render.checkpoint"))
        start = time.monotonic()
        self.assert_ends(lumicut(*RENDER, "-o", whole), OK)
        seconds = time.monotonic() - start
        chance = random.Random(SEED)
        kills = unread = finished = 0
        arguments = [*RENDER, "--checkpoint", kept, "--resume", "-o", image]
        while kills < KILLS or finished == 0:
            if kills >= KILLS:
                moment = 3600
            elif chance.random() < 0.5:
                moment = chance.uniform(0, seconds)
            else:
                moment = -chance.uniform(0, 0.1 * seconds)
            if self.run_until(arguments, moment) is None:
                kills += 1
                unread += not kept.exists()
                if image.exists():  # killed between its last file and its end
                    self.assert_same(image, whole)
                    image.unlink()
                continue
            # Went on to its end: the next ones begin anew.
            self.assert_same(image, whole)
            finished += 1
            image.unlink(), kept.unlink()
        print(f"{kills} kills, {unread} of them before the first checkpoint; {finished} renders ended, all as the unbroken "
              "one")
        self.assertLess(unread, kills)


if __name__ == "__main__":
    unittest.main()
