"""Packs the Blender add-on with the library into a zip that Blender installs. The same input gives the same bytes."""
import argparse
import pathlib
import re
import sys
import zipfile

NAME = "lumicut_blender"
STAMP = (2020, 1, 1, 0, 0, 0)  # files' times would make each zip another


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    for name in ("addon", "library", "license", "output"):
        parser.add_argument(f"--{name}", type=pathlib.Path, required=True)
    parser.add_argument("--version", required=True)
    parser.add_argument("--notice", action="append", default=[], help="NAME=FILE, the licence of what is linked in")
    options = parser.parse_args()
    manifest = (options.addon / "blender_manifest.toml").read_text()
    found = re.search(r'^version = "(.+)"$', manifest, re.M)[1]
    info = re.search(r'"version": \((\d+), (\d+), (\d+)\)', (options.addon / "__init__.py").read_text())
    for where, version in (("blender_manifest.toml", found), ("bl_info", ".".join(info.groups()))):
        if version != options.version:
            sys.exit(f"{options.addon}: {where} says version {version}, the project {options.version}")
    files = {f"{NAME}/{path.relative_to(options.addon)}": path.read_bytes()
             for folder in (options.addon, options.addon / "lumicut") for path in sorted(folder.iterdir()) if path.suffix in {".py", ".toml"}}
    files[f"{NAME}/LICENSE"] = options.license.read_bytes()
    for name, _, path in (notice.partition("=") for notice in options.notice):
        files[f"{NAME}/licenses/{name}.txt"] = pathlib.Path(path).read_bytes()
    files[f"{NAME}/lib/liblumicut.so.1"] = options.library.read_bytes()
    beside = options.output.with_suffix(".zip.new")
    folders = sorted({f"{parent}/" for name in files for parent in pathlib.PurePosixPath(name).parents if parent.name})
    with zipfile.ZipFile(beside, "w", zipfile.ZIP_DEFLATED) as out:
        # Blender removes an older add-on by these entries. Without them it writes over the old library, which the process
        # has in memory, and dies.
        for name in folders:
            entry = zipfile.ZipInfo(name, STAMP)
            entry.external_attr = 0o40755 << 16 | 0x10
            out.writestr(entry, b"")
        for name, content in files.items():
            entry = zipfile.ZipInfo(name, STAMP)
            entry.compress_type, entry.external_attr = zipfile.ZIP_DEFLATED, 0o644 << 16
            out.writestr(entry, content)
    beside.replace(options.output)
    print(f"{options.output}: {options.output.stat().st_size >> 10} KiB")


if __name__ == "__main__":
    main()
