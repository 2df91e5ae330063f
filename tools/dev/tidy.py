#!/usr/bin/env python3
"""clang-tidy over the library's and the command's sources, each file once: what passed is remembered.

    tools/dev/tidy.py BUILD_FOLDER [PART_OF_A_PATH ...]

A file passes again unseen when its preprocessed text, .clang-tidy and clang-tidy's version are what they were.
"""
import concurrent.futures
import hashlib
import json
import os
import pathlib
import shlex
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
# Beside the compiler's cache, which is kept between runs where anything is.
CACHE = pathlib.Path(os.environ.get("CCACHE_DIR") or
                     pathlib.Path(os.environ.get("XDG_CACHE_HOME") or pathlib.Path.home() / ".cache") / "ccache") / "tidy"
SKIPPED = ("tests/", "bench/", "geometry/command/")


def output(command, folder):
    return subprocess.run(command, cwd=folder, capture_output=True, check=True).stdout


def findings(entry, build, salt):
    """What clang-tidy says of one file; None where it finds nothing."""
    source = entry["file"]
    command = [word for word in shlex.split(entry["command"]) if not word.endswith("ccache")]
    # GCC's words that clang does not know; no object is made.
    flags = [word for word in command[1:] if word not in ("-c", source, "-Wno-restrict")]
    if "-o" in flags:
        del flags[flags.index("-o"):flags.index("-o") + 2]
    key = hashlib.sha256(salt)
    # The copy's place does not count; comments do, for they switch checks off.
    key.update(output(["clang++", *flags, "-w", "-E", "-C", source], entry["directory"]).replace(str(ROOT).encode(), b""))
    known = CACHE / key.hexdigest()
    if known.exists():
        return None
    run = subprocess.run(["clang-tidy", "--quiet", "-p", build, "--extra-arg=-Wno-unknown-warning-option", source],
                         capture_output=True, text=True)
    if run.returncode:
        return run.stdout or run.stderr
    try:
        CACHE.mkdir(parents=True, exist_ok=True)
        known.touch()
    except OSError:
        pass  # a cache that cannot be written is none
    return None


def main():
    build = pathlib.Path(sys.argv[1]).resolve()
    entries = json.loads((build / "compile_commands.json").read_text())
    entries = [entry for entry in entries
               if (path := os.path.relpath(entry["file"], ROOT)).endswith(".cpp") and not path.startswith(SKIPPED)
               and any(part in path for part in sys.argv[2:] or [""])]
    salt = (ROOT / ".clang-tidy").read_bytes() + output(["clang-tidy", "--version"], ROOT)
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        found = 0
        for run in concurrent.futures.as_completed([pool.submit(findings, entry, build, salt) for entry in entries]):
            if text := run.result():
                found += 1
                print(text, flush=True)
    print(f"tidy: {len(entries)} files, {found} with findings")
    return found > 0 or not entries


if __name__ == "__main__":
    sys.exit(main())
