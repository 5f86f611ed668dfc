"""Makes a release: version, changelog, commit and tag, then sdist, wheel and their checksums in dist/.

`make release VERSION=0.2.0 [URL=https://HOST/OWNER/NAME]` runs it. It publishes nothing: push the tag and upload the
files yourself. The files are made from the tag. In them, the README's links and pictures are addresses below URL, which
a package index can follow, and URL is in the metadata. Without URL, it is the address of the git remote `origin`.
"""

from __future__ import annotations

import argparse
import hashlib
import io
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
import time
from pathlib import Path

from vm_embedded.errors import InputError

VERSION_FILE, CHANGELOG, README, PROJECT = "vm_embedded/__init__.py", "CHANGELOG.md", "README.md", "pyproject.toml"
ROS_PACKAGE, USE = "deploy/ros/package.xml", "docs/use.md"

_VERSION = re.compile(r"\d+\.\d+\.\d+((a|b|rc)\d+)?")
_LINK = re.compile(r"(!?\[[^\]]*\])\((?!https?://|#|mailto:)([^)\s]+)\)")


def main(arguments: list[str] | None = None) -> int:
    """Make a release and return the exit status."""
    parser = argparse.ArgumentParser(prog="release.py", description="Make a release: version, tag, files, checksums.")
    parser.add_argument("version", help="such as 0.2.0")
    parser.add_argument("--url", help="home of the project; default: the address of the remote origin")
    parser.add_argument("--top", type=Path, default=Path(__file__).parents[1], help="the checkout")
    options = parser.parse_args(arguments)
    try:
        _release(options.top, options.version, options.url)
    except InputError as error:
        print(f"release: {error}", file=sys.stderr)
        return 1
    return 0


def _release(top: Path, version: str, url: str | None) -> None:
    if not _VERSION.fullmatch(version):
        raise InputError(f"{version!r} is not a version; write it as in 0.2.0 or 0.2.0rc1")
    home, tag = home_of(url or _git(top, "remote", "get-url", "origin", check=False)), f"v{version}"
    if _git(top, "status", "--porcelain"):
        raise InputError("the checkout has changes: commit or undo them first")
    if _git(top, "tag", "--list", tag):
        raise InputError(f"the tag {tag} exists; choose another version")
    _git(top, "var", "GIT_COMMITTER_IDENT")  # fails before any file changes
    changes = {CHANGELOG: dated, VERSION_FILE: with_version, ROS_PACKAGE: with_ros_version, USE: with_wheel_version}
    for name, change in changes.items():
        path = top / name
        path.write_text(change(path.read_text(encoding="utf-8"), version), encoding="utf-8")
    if _git(top, "status", "--porcelain"):
        _git(top, "commit", "--all", "--message", f"Release {version}")
    _git(top, "tag", "--annotate", tag, "--message", f"vm-embedded {version}")
    files = build(top, tag, home, top / "dist")
    sums = "".join(f"{hashlib.sha256(each.read_bytes()).hexdigest()}  {each.name}\n" for each in files)
    (top / "dist" / "SHA256SUMS").write_text(sums, encoding="utf-8")
    print(
        sums + f"dist/: {version} is tagged {tag}; publish with: git push origin {tag} && twine upload dist/*{version}*"
    )


def home_of(url: str) -> str:
    """The address of the project as a browser opens it, from one that git knows. Raises InputError."""
    url = re.sub(r"^(?:ssh://)?git@([^:/]+)[:/]", r"https://\1/", url.strip()).removesuffix(".git").rstrip("/")
    if not re.fullmatch(r"https?://[^/\s]+/\S+", url):
        raise InputError(f"{url!r} is not the address of a project: give URL=https://HOST/OWNER/NAME")
    return url


def dated(changelog: str, version: str) -> str:
    """The changelog with today's date at the version, instead of "unreleased". Raises InputError."""
    heading = f"## {version} ({time.strftime('%Y-%m-%d', time.gmtime())})"
    text, count = re.subn(rf"^## {re.escape(version)} \(unreleased\)$", heading, changelog, flags=re.MULTILINE)
    if count != 1:
        raise InputError(f"{CHANGELOG} needs one heading '## {version} (unreleased)' with the changes below it")
    return text


def with_version(module: str, version: str) -> str:
    """The text of vm_embedded/__init__.py with this version."""
    return re.sub(r'^__version__ = ".*"$', f'__version__ = "{version}"', module, flags=re.MULTILINE)


def with_ros_version(package: str, version: str) -> str:
    """The text of package.xml with the numbers of this version: ROS knows no release candidates."""
    numbers = re.sub(r"(a|b|rc)\d+$", "", version)
    return re.sub("<version>.*</version>", f"<version>{numbers}</version>", package)


def with_wheel_version(page: str, version: str) -> str:
    """The text of use.md with the name of this version's wheel."""
    return re.sub(r"(dist/vm_embedded-)[^-]+", rf"\g<1>{version}", page)


def published_readme(text: str, home: str, tag: str) -> str:
    """The README with addresses instead of paths: pictures as files, pages as the code host shows them."""

    def address(link: re.Match[str]) -> str:
        kind = "raw" if link[1].startswith("!") else "blob"
        return f"{link[1]}({home}/{kind}/{tag}/{link[2]})"

    return _LINK.sub(address, text)


def project_with_urls(text: str, home: str, tag: str) -> str:
    """The pyproject.toml with the addresses of the project."""
    urls = {
        "Homepage": home,
        "Documentation": f"{home}/blob/{tag}/docs/index.md",
        "Changelog": f"{home}/blob/{tag}/{CHANGELOG}",
        "Issues": f"{home}/issues",
    }
    table = "".join(f'{name} = "{url}"\n' for name, url in urls.items())
    return text.replace("[project.scripts]\n", f"[project.urls]\n{table}\n[project.scripts]\n", 1)


def build(top: Path, tag: str, home: str, dist: Path) -> list[Path]:
    """Build and check sdist and wheel of a tag. Raises InputError."""
    dist.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as name:
        source = Path(name) / "source"
        archive = subprocess.run(["git", "-C", top, "archive", tag], capture_output=True, check=True).stdout
        with tarfile.open(fileobj=io.BytesIO(archive)) as tar:
            tar.extractall(source, filter="data")
        for path, text in (
            (README, published_readme((source / README).read_text(encoding="utf-8"), home, tag)),
            (PROJECT, project_with_urls((source / PROJECT).read_text(encoding="utf-8"), home, tag)),
        ):
            (source / path).write_text(text, encoding="utf-8")
        made = Path(name) / "made"
        _run(sys.executable, "-m", "build", "--no-isolation", "--outdir", str(made), str(source))
        files = sorted(made.iterdir())
        _run(sys.executable, "-m", "twine", "check", "--strict", *map(str, files))
        return [Path(shutil.copy(each, dist)) for each in files]


def _run(*command: str) -> None:
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        sys.stderr.write(done.stdout + done.stderr)
        raise InputError(f"{' '.join(command[1:4])} failed")


def _git(top: Path, *words: str, check: bool = True) -> str:
    done = subprocess.run(["git", "-C", str(top), *words], capture_output=True, text=True)
    if done.returncode and check:
        raise InputError(f"git {words[0]} failed: {done.stderr.strip()}")
    return done.stdout.strip()


if __name__ == "__main__":
    sys.exit(main())
