"""Packs the extension, with the wheels of the Python package `linpred` that are given, into linpred-VERSION.zip.

    python build.py [--output FOLDER] linpred-*.whl

The same files make the same bytes. Without wheels the extension works where `linpred` can be imported already, as with `bpy` of PyPI in an
environment that has it. Where Blender is on the PATH or `bpy` is installed, their own `extension validate` looks at the result.
"""

from __future__ import annotations

import argparse
import importlib.util
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

HERE = Path(__file__).parent
SOURCE = HERE / "extension"
LICENCES = ("LICENSE-MIT", "LICENSE-APACHE")
# Blender's names of platforms by how the platform tag of a wheel begins and ends
PLATFORMS = {
    ("manylinux", "x86_64"): "linux-x64",
    ("linux", "x86_64"): "linux-x64",
    ("macosx", "arm64"): "macos-arm64",
    ("macosx", "x86_64"): "macos-x64",
    ("win", "amd64"): "windows-x64",
    ("win", "arm64"): "windows-arm64",
}
# the oldest time that a zip can hold: the archive does not tell when it was made
TIME = (1980, 1, 1, 0, 0, 0)


def platform_of(wheel: Path) -> str:
    """Blender's name of the platform that a wheel is for."""
    tag = wheel.stem.split("-")[-1]
    for (start, end), platform in PLATFORMS.items():
        if tag.startswith(start) and tag.endswith(end):
            return platform
    sys.exit(f"{wheel.name}: Blender has no platform {tag}")


def manifest(wheels: list[Path]) -> str:
    """The manifest with the wheels in it, and the platforms that they are for. Keys must stand above its first table."""
    text = (SOURCE / "blender_manifest.toml").read_text()
    if not wheels:
        return text
    platforms = sorted({platform_of(wheel) for wheel in wheels})
    names = [f"./wheels/{wheel.name}" for wheel in wheels]
    lines = "".join(f"{key} = {values}\n".replace("'", '"') for key, values in (("platforms", platforms), ("wheels", names)))
    above, table, below = text.partition("[permissions]")
    return above + lines + "\n" + table + below


def build(wheels: list[Path], output: Path) -> Path:
    """Writes the archive, and returns its path."""
    wheels = sorted(wheels, key=lambda wheel: wheel.name)
    root = HERE.parents[2]
    text = manifest(wheels)
    files = {"blender_manifest.toml": text.encode()}
    files |= {file.name: file.read_bytes() for file in SOURCE.glob("*.py")}
    files |= {name: (root / name).read_bytes() for name in LICENCES}
    files |= {f"wheels/{wheel.name}": wheel.read_bytes() for wheel in wheels}
    version = re.search(r'^version = "(.*)"', text, re.MULTILINE)[1]
    for wheel in wheels:
        if wheel.name.split("-")[1] != version:
            sys.exit(f"{wheel.name} is not of version {version}, which blender_manifest.toml states")
    path = output / f"linpred-{version}.zip"
    # stored: wheels are compressed already, and compressors differ in their bytes
    with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED) as archive:
        for name, content in sorted(files.items()):
            entry = zipfile.ZipInfo(name, TIME)
            entry.create_system = 3  # Unix, wherever this runs
            entry.external_attr = 0o644 << 16
            archive.writestr(entry, content)
    return path


def validator() -> list[str] | None:
    """The command of Blender that looks at an extension, or the script of `bpy` that this command runs."""
    if blender := shutil.which("blender"):
        return [blender, "--command", "extension", "validate"]
    if (bpy := importlib.util.find_spec("bpy")) and bpy.origin:
        for script in Path(bpy.origin).parent.glob("*/scripts/addons_core/bl_pkg/cli/blender_ext.py"):
            return [sys.executable, str(script), "validate"]
    return None


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description="Packs the Blender extension.")
    parser.add_argument("wheels", nargs="*", type=Path, metavar="WHEEL", help="wheels of the package linpred, one for each platform")
    parser.add_argument("--output", type=Path, default=Path(), metavar="FOLDER", help="where to put the archive [default: this folder]")
    arguments = parser.parse_args()
    path = build(arguments.wheels, arguments.output)
    print(path)
    if command := validator():
        sys.exit(subprocess.run([*command, str(path)], check=False).returncode)
    print("not validated: neither Blender nor bpy is there", file=sys.stderr)


if __name__ == "__main__":
    main()
