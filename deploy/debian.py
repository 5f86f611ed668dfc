"""make deb: pack a bundle as a Debian package, for teams that build images of their robots.

The package contains the bundle, and its scripts run install.sh and uninstall.sh: releases, checks and rollback are the
same. The same bundle always gives the same bytes.
"""

from __future__ import annotations

import gzip
import hashlib
import json
import os
import shutil
import subprocess
import sys
import tarfile
import tempfile
from datetime import UTC, datetime
from email.utils import formatdate
from pathlib import Path

NAME = "vm-embedded-robot"
ARCHITECTURES = {"x86_64": "amd64", "aarch64": "arm64"}
MAINTAINER = "The vm-embedded team <vm-embedded@example.org>"
LIBRARY = f"usr/lib/{NAME}"

POSTINST = f"""#!/bin/sh
set -e
if [ "$1" = configure ]; then /{LIBRARY}/install.sh; fi
"""
PRERM = f"""#!/bin/sh
set -e
if [ "$1" = remove ] && [ -e /opt/vm-embedded/supervisor ]; then
    /{LIBRARY}/uninstall.sh --prefix /opt/vm-embedded
fi
"""
POSTRM = """#!/bin/sh
set -e
if [ "$1" = purge ]; then
    rm -rf /opt/vm-embedded/left /opt/vm-embedded/.lock
    rmdir /opt/vm-embedded 2>/dev/null || true
fi
"""


def package(bundle: Path) -> Path:
    """Write the package of a bundle beside it, and return its path."""
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder) / "root"
        with tarfile.open(bundle) as tar:
            time = int(tar.getmembers()[0].mtime)
            tar.extractall(Path(folder) / "bundle", filter="data")
        (unpacked,) = (Path(folder) / "bundle").iterdir()
        (root / "usr/lib").mkdir(parents=True)
        shutil.move(unpacked, root / LIBRARY)
        manifest = json.loads((root / LIBRARY / "manifest.json").read_text())
        number, content_hash = manifest["release"].split("-")
        version = f"{number}+{datetime.fromtimestamp(time, UTC):%Y%m%d%H%M%S}.{content_hash}"
        _documents(root / "usr/share/doc" / NAME, version, time)
        content = sorted(each for each in root.rglob("*") if each.is_file())
        sums = [f"{hashlib.md5(each.read_bytes()).hexdigest()}  {each.relative_to(root)}\n" for each in content]
        control = root / "DEBIAN"
        control.mkdir()
        size = sum(each.stat().st_size for each in content) // 1024
        (control / "control").write_text(_control(manifest, version, size))
        (control / "md5sums").write_text("".join(sums))
        for name, script in (("postinst", POSTINST), ("prerm", PRERM), ("postrm", POSTRM)):
            (control / name).write_text(script)
            (control / name).chmod(0o755)
        for each in (root, *root.rglob("*")):
            if each.is_dir():
                each.chmod(0o755)
            elif each.parent != control:
                each.chmod(0o755 if each.read_bytes()[:2] == b"#!" else 0o644)
        path = bundle.with_name(f"{NAME}_{version}_{ARCHITECTURES[manifest['machine']]}.deb")
        subprocess.run(
            ["dpkg-deb", "--root-owner-group", "-Zgzip", "-z1", "--build", root, path],
            check=True,
            stdout=subprocess.DEVNULL,
            env={**os.environ, "SOURCE_DATE_EPOCH": str(time)},
        )
    return path


def _control(manifest: dict[str, str], version: str, size: int) -> str:
    minor = int(manifest["python"].removeprefix("cp3"))
    return f"""Package: {NAME}
Version: {version}
Architecture: {ARCHITECTURES[manifest["machine"]]}
Maintainer: {MAINTAINER}
Installed-Size: {size}
Depends: python3 (>= 3.{minor}), python3 (<< 3.{minor + 1}), libc6 (>= {manifest["glibc"]})
Section: science
Priority: optional
Description: Visual Mesh detector for robots, as a supervised service
 Finds balls and the other classes of its network in the images of a camera
 whose height and orientation are known, on one processor core.
 .
 Releases go to /opt/vm-embedded, each with its own Python environment. A new
 release that does not become healthy is rolled back.
"""


def _documents(folder: Path, version: str, time: int) -> None:
    """Write copyright and changelog, which Debian requires."""
    folder.mkdir(parents=True)
    license = (Path(__file__).parents[1] / "LICENSE").read_text()
    text = "".join(f" {line}\n" if line else " .\n" for line in license.splitlines())
    (folder / "copyright").write_text(
        "Format: https://www.debian.org/doc/packaging-manuals/copyright-format/1.0/\n\n"
        f"Files: *\nCopyright: the authors of vm-embedded\nLicense: Expat\n{text}"
    )
    changes = (
        f"{NAME} ({version}) unstable; urgency=medium\n\n  * See the project's history.\n\n"
        f" -- {MAINTAINER}  {formatdate(time)}\n"
    )
    (folder / "changelog.gz").write_bytes(gzip.compress(changes.encode(), 9, mtime=time))


if __name__ == "__main__":
    print(package(Path(sys.argv[1])))
