"""A release as a maintainer makes it, in a clone: version, changelog, tag, and the files for a package index."""

import hashlib
import os
import re
import shutil
import subprocess
import sys
import tarfile
import zipfile

import pytest

from .bundles import CHECKOUT

pytestmark = pytest.mark.long

URL = "https://code.example.org/robots/vm-embedded"
IDENTITY = {f"GIT_{who}_{what}": "a@b.example" for who in ("AUTHOR", "COMMITTER") for what in ("NAME", "EMAIL")}
LARGEST_WHEEL = 6_000_000
"""With the networks and all programs [bytes]; test_bundle.py has the limit of the robot's wheel."""

LARGEST_CODE = 1_000_000
"""Without the networks and without the patches that vm-train mixes into fine-tuning [bytes]."""


def git(folder, *words):
    command = ["git", "-C", str(folder), *words]
    return subprocess.run(command, capture_output=True, text=True, check=True, env=os.environ | IDENTITY).stdout.strip()


def release(folder, *words, identity=IDENTITY):
    command = [sys.executable, folder / "deploy" / "release.py", *words]
    return subprocess.run(command, capture_output=True, text=True, env=os.environ | identity)


@pytest.fixture(scope="module")
def clone(tmp_path_factory):
    """A clone with the files of this checkout, as they are now."""
    if subprocess.run(["git", "-C", CHECKOUT, "rev-parse"], capture_output=True).returncode:
        pytest.skip("not a git checkout")
    folder = tmp_path_factory.mktemp("release") / "clone"
    git(CHECKOUT, "clone", "--quiet", "--shared", str(CHECKOUT), str(folder))
    for name in git(CHECKOUT, "ls-files", "--modified", "--others", "--exclude-standard").splitlines():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).unlink(missing_ok=True)
        if (CHECKOUT / name).exists():
            shutil.copy(CHECKOUT / name, folder / name)
    git(folder, "add", "--all")
    git(folder, "commit", "--quiet", "--allow-empty", "--message", "as it is")
    return folder


@pytest.fixture(scope="module")
def released(clone):
    """The folder of the files of a release, by its clone."""
    changelog = clone / "CHANGELOG.md"
    changelog.write_text(
        re.sub(r"^## \S+ \(.*\)$", "## 9.8.7 (unreleased)", changelog.read_text(), count=1, flags=re.MULTILINE)
    )
    git(clone, "commit", "--quiet", "--all", "--message", "Changelog")
    done = release(clone, "9.8.7", "--url", URL)
    assert done.returncode == 0, done.stderr
    return clone / "dist"


def test_a_release_is_tagged_and_its_files_have_checksums(clone, released):
    assert git(clone, "describe") == "v9.8.7"
    assert not git(clone, "status", "--porcelain")
    assert re.search(r"^## 9\.8\.7 \(\d{4}-\d\d-\d\d\)$", git(clone, "show", "v9.8.7:CHANGELOG.md"), re.MULTILINE)
    assert "<version>9.8.7</version>" in git(clone, "show", "v9.8.7:deploy/ros/package.xml")
    assert "dist/vm_embedded-9.8.7-py3-none-any.whl[train]" in git(clone, "show", "v9.8.7:docs/use.md")
    files = {each.name for each in released.iterdir()}
    assert files == {"vm_embedded-9.8.7.tar.gz", "vm_embedded-9.8.7-py3-none-any.whl", "SHA256SUMS"}
    sums = dict(line.split()[::-1] for line in (released / "SHA256SUMS").read_text().splitlines())
    assert sums == {each: hashlib.sha256((released / each).read_bytes()).hexdigest() for each in files - {"SHA256SUMS"}}
    assert "exists" in release(clone, "9.8.7", "--url", URL).stderr


def test_the_wheel_is_complete_and_small_and_its_page_has_pictures(clone, released):
    path = released / "vm_embedded-9.8.7-py3-none-any.whl"
    assert path.stat().st_size < LARGEST_WHEEL
    with zipfile.ZipFile(path) as wheel:
        metadata = wheel.read("vm_embedded-9.8.7.dist-info/METADATA").decode()
        sizes = {each.filename: each.compress_size for each in wheel.infolist()}
    wanted = [
        each.removeprefix("export/") for each in git(clone, "ls-files", "vm_embedded", "export/vm_*").splitlines()
    ]
    assert len(wanted) > 400
    assert set(wanted) == {each for each in sizes if ".dist-info/" not in each}
    data = [each for each in sizes if each.endswith((".onnx", ".npz"))]
    assert sum(sizes.values()) - sum(sizes[each] for each in data) < LARGEST_CODE
    assert f"Project-URL: Homepage, {URL}" in metadata
    assert "Author: vm-embedded contributors" in metadata
    assert "Requires-Python: >=3.10" in metadata
    assert f"({URL}/raw/v9.8.7/docs/demo.jpg)" in metadata
    links = re.findall(r"\]\((?!#)([^)]*)\)", metadata)
    assert len(links) > 15
    assert all(each.startswith("http") for each in links), links


def test_the_source_distribution_runs_its_tests(released, tmp_path):
    with tarfile.open(released / "vm_embedded-9.8.7.tar.gz") as tar:
        tar.extractall(tmp_path, filter="data")
    top = tmp_path / "vm_embedded-9.8.7"
    tests = ["tests/test_pyproject.py", "tests/test_rooms.py", "tests/vm_embedded/detection/test_detections.py"]
    tests += ["tests/test_docs.py::test_generated_pages_are_current", "tests/vm_export/test_export.py"]
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *tests]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(top), str(top / "export")])}
    done = subprocess.run(command, cwd=top, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout
    assert re.search(r"^\d\d+ passed", done.stdout.splitlines()[-1]), done.stdout


@pytest.mark.parametrize(
    ("words", "said"),
    [(["1.2"], "not a version"), (["1.2.3"], "URL="), (["1.2.3", "--url", URL], "## 1.2.3 (unreleased)")],
)
def test_what_is_missing_is_said_before_anything_changes(clone, words, said):
    git(clone, "remote", "set-url", "origin", "/srv/clone")
    done = release(clone, *words)
    assert done.returncode == 1
    assert said in done.stderr
    assert not git(clone, "status", "--porcelain")


def test_without_a_git_identity_nothing_changes(clone):
    unknown = {"GIT_CONFIG_GLOBAL": os.devnull, "GIT_CONFIG_COUNT": "1"}
    unknown |= {"GIT_CONFIG_KEY_0": "user.useConfigOnly", "GIT_CONFIG_VALUE_0": "true"}
    done = release(clone, "1.2.3", "--url", URL, identity=unknown)
    assert done.returncode == 1
    assert "Please tell me who you are" in done.stderr
    assert not git(clone, "status", "--porcelain")
