"""make bundle: pack everything that a robot without internet needs for a release into one file.

The same inputs, target and commit give the same bytes on every machine: versions and hashes of packages come from
deploy/robot.txt, times from the commit, and versions of the packing tools from deploy/constraints.txt.
"""

from __future__ import annotations

import argparse
import contextlib
import gzip
import hashlib
import io
import json
import os
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
import tomllib
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

TOP = Path(__file__).parents[1]
sys.path.insert(0, str(TOP))

from vm_embedded import __version__  # noqa: E402
from vm_embedded.cameras.camera import CameraSettings  # noqa: E402
from vm_embedded.config.toml_writer import to_commented_toml  # noqa: E402
from vm_embedded.errors import InputError, VisualMeshError  # noqa: E402
from vm_embedded.files import atomic_folder, write_file  # noqa: E402
from vm_embedded.live.configuration import Configuration, read_configuration  # noqa: E402
from vm_embedded.network.bundled import DEFAULT, model_path  # noqa: E402
from vm_embedded.network.model_file import read_model  # noqa: E402
from vm_embedded.network.session import Session  # noqa: E402
from vm_embedded.output.channels import OutputSettings  # noqa: E402

NAME = "vm-embedded-robot"
LOCK = TOP / "deploy" / "robot.txt"
SCRIPTS = TOP / "deploy" / "robot"
PROGRAMS = ("vm-detect", "vm-doctor", "vm-bench", "vm-ros")
"""Programs of this project that run on robots; the others are for a workstation."""

OWN = ("vm_embedded", "export/vm_ros", "export/vm_programs", "pyproject.toml", "README.md", "LICENSE")
PACKED = (*OWN, "deploy")
"""Paths of the checkout in the project's wheel (OWN) and in the bundle."""

NETWORKS = ":!vm_embedded/models/*.onnx"
"""Not in the project's wheel: a robot uses the network in etc/."""

UNUSED = ("flatbuffers", "packaging", "protobuf")
"""Packages of deploy/robot.txt that are left out: ONNX Runtime imports them only in its tools that change models."""

DEFAULT_TARGET = "linux_x86_64-cp311"
DEFAULT_GLIBC = (2, 28)
"""glibc of targets that name none: that of Debian 10, Ubuntu 20.04 and later."""

OLDEST_GLIBC = 5
"""First minor version of glibc in the names of wheels (PEP 600)."""

MODEL, CONFIGURATION = "model.onnx", "vm.toml"

SIGNATURES = "vm-embedded-bundle"
"""ssh-keygen's namespace of a bundle's signature; deploy/robot/verify.sh has it, too."""


@dataclass(frozen=True)
class Target:
    """A kind of robot: linux_x86_64-cp311, or with a version of glibc manylinux_2_17_x86_64-cp311."""

    name: str
    glibc: tuple[int, int]
    machine: str
    python: str

    @classmethod
    def parse(cls, name: str) -> Target:
        """The target with a name. Raises InputError."""
        found = re.fullmatch(r"(?:linux|manylinux_2_(\d+))_(x86_64|aarch64)-(cp3(?:1[1-9]|[2-9]\d))", name)
        if not found:
            raise InputError(
                f"TARGET must be like {DEFAULT_TARGET}, linux_aarch64-cp312 or manylinux_2_17_x86_64-cp311 "
                f"(Python 3.11 or newer), not {name!r}"
            )
        glibc = (2, int(found[1])) if found[1] else DEFAULT_GLIBC
        return cls(name, glibc, found[2], found[3])

    def platforms(self) -> list[str]:
        """pip's names of the platforms whose wheels run there, newest glibc first."""
        numbered = [f"manylinux_2_{minor}_{self.machine}" for minor in range(self.glibc[1], OLDEST_GLIBC - 1, -1)]
        return [*numbered, f"manylinux2014_{self.machine}"] if self.glibc[1] >= 17 else numbered


@dataclass(frozen=True)
class Origin:
    """The commit to pack: its hash, with +changes for a modified checkout, and its time since 1970 [s]."""

    commit: str
    time: int

    @classmethod
    def of(cls, top: Path) -> Origin:
        """The commit of a checkout. Raises InputError outside of a git checkout."""
        commit, time = _git(top, "log", "-1", "--format=%H %ct").split()
        return cls(commit + ("+changes" if _git(top, "status", "--porcelain", "--", *PACKED) else ""), int(time))


def _git(top: Path, *words: str) -> str:
    try:
        return subprocess.run(["git", "-C", top, *words], check=True, capture_output=True, text=True).stdout
    except (OSError, subprocess.CalledProcessError) as error:
        raise InputError(f"{top} must be a git checkout, because a bundle names its commit") from error


def wheelhouse(target: Target, folder: Path) -> list[Path]:
    """The wheels of deploy/robot.txt for a target, downloaded if they are missing. Raises InputError."""
    made = folder / target.name
    stamp, lock = made / "lock", hashlib.sha256(LOCK.read_bytes()).hexdigest()
    if not stamp.exists() or stamp.read_text() != lock:
        if made.exists() and not stamp.exists():
            raise InputError(f"{made} holds other files than this program's downloads: give another folder to --wheels")
        platforms = [word for each in target.platforms() for word in ("--platform", each)]
        with atomic_folder(made) as part:
            _pip(
                f"a package of {LOCK.relative_to(TOP)} has no wheel for {target.name}, or can't be downloaded",
                *["download", "--no-deps", "--require-hashes", "--only-binary=:all:", "--dest", part, *platforms],
                *["--python-version", target.python[2] + "." + target.python[3:], "--implementation", "cp"],
                *["--abi", target.python, "--abi", "abi3", "--abi", "none", "--requirement", LOCK],
            )
            (part / "lock").write_text(lock)
            if stamp.exists():  # of an earlier list
                shutil.rmtree(made)
    return sorted(made.glob("*.whl"))


def project_wheel(top: Path, origin: Origin, folder: Path) -> Path:
    """Build the robot's wheel of this project from the files of the checkout that git does not ignore.

    Raises InputError.
    """
    with tempfile.TemporaryDirectory() as name:
        source = Path(name)
        listed = _git(top, "ls-files", "-z", "--cached", "--others", "--exclude-standard", "--", *OWN, NETWORKS)
        for each in filter(None, listed.split("\0")):
            copy = source / each
            copy.parent.mkdir(parents=True, exist_ok=True)
            with contextlib.suppress(FileNotFoundError):  # a removed file that is still in git's index
                copy.write_bytes((top / each).read_bytes())
                copy.chmod(0o644)
        project = source / "pyproject.toml"
        project.write_text(_with_programs(PROGRAMS, project.read_text()))
        words: list[str | Path] = ["wheel", "--no-deps", "--no-build-isolation", "--wheel-dir", folder, source]
        _pip("the project's own wheel can't be built", *words, env={"SOURCE_DATE_EPOCH": str(origin.time)})
    (wheel,) = folder.glob("vm_embedded-*.whl")
    return wheel


def _with_programs(names: tuple[str, ...], project: str) -> str:
    """A pyproject.toml without the other programs, which would only print a traceback."""
    programs = re.compile(r"^(vm-\w+) = .*\n", re.MULTILINE)
    return programs.sub(lambda found: found[0] if found[1] in names else "", project)


def _pip(what: str, *words: str | Path, env: Mapping[str, str] | None = None) -> None:
    command = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--quiet", *words]
    # The umask, because wheels contain file modes.
    ran = subprocess.run(command, capture_output=True, text=True, env={**os.environ, **(env or {})}, umask=0o022)
    if ran.returncode:
        sys.stderr.write(ran.stderr)
        raise InputError(what)


def configuration_files(configuration: Path | None, model: str | None) -> dict[str, bytes]:
    """Content of the files in etc/ by name: vm.toml, and the model and lens it names. Raises VisualMeshError."""
    if configuration is None:
        shown = Configuration(
            model=MODEL,
            camera=CameraSettings(source="synthetic"),
            output=OutputSettings(stdout=False, unix="lines.sock"),
        )
        return {CONFIGURATION: to_commented_toml(shown).encode(), MODEL: _model(model or DEFAULT)}
    given = read_configuration(configuration)
    if not given.camera.source:
        print(f"make bundle: {configuration} names no camera; the robot needs [camera] source", file=sys.stderr)
    text = configuration.read_text(encoding="utf-8-sig")
    table = tomllib.loads(text)
    files = {MODEL: _model(model or given.model)}
    text = _with_entry(text, "model", MODEL)
    if isinstance(table.get("lens"), str):
        lens = configuration.parent / table["lens"]
        if lens.name in (CONFIGURATION, MODEL):
            raise InputError(f"the lens file {lens} can't be called {lens.name} in a bundle")
        files[lens.name] = lens.read_bytes()
        text = _with_entry(text, "lens", lens.name)
    return {CONFIGURATION: text.encode(), **files}


def _model(model: str) -> bytes:
    """The bytes of a network, after its self-test. Raises VisualMeshError."""
    read = read_model(model_path(model))
    Session(read)
    return read.content


def _with_entry(text: str, key: str, value: str) -> str:
    """vm.toml with another value for an entry before all sections. Raises InputError."""
    table, line = tomllib.loads(text), f"{key} = {json.dumps(value)}"
    found = re.compile(rf"^{key}\s*=.*$", re.MULTILINE)
    text = found.sub(lambda _: line, text, count=1) if key in table else f"{line}\n{text}"
    if tomllib.loads(text) != table | {key: value}:
        raise InputError(f"the configuration's {key} must be on a separate line, like: {line}")
    return text


def write_bundle(
    target: Target, configuration: Path | None, model: str | None, wheels: Path, dist: Path, key: Path | None
) -> Path:
    """Write a bundle and return its path. key: signs its listing. Raises VisualMeshError."""
    origin = Origin.of(TOP)
    files = {f"etc/{name}": content for name, content in configuration_files(configuration, model).items()}
    packages = [each for each in wheelhouse(target, wheels) if each.name.split("-")[0] not in UNUSED]
    with tempfile.TemporaryDirectory() as folder:
        packages = sorted([*packages, project_wheel(TOP, origin, Path(folder))], key=lambda each: each.name)
        files |= {f"wheels/{each.name}": each.read_bytes() for each in packages}
    for each in sorted(SCRIPTS.iterdir()):
        files[each.name] = each.read_bytes()
    files["README.md"] = (TOP / "deploy" / "README.md").read_bytes()
    release = f"{__version__}-{hashlib.sha256(_sums(files)).hexdigest()[:8]}"
    files["manifest.json"] = (json.dumps(_manifest(target, origin, release, files), indent=1) + "\n").encode()
    files["SHA256SUMS"] = _sums(files)
    if key is not None:
        files["SHA256SUMS.sig"] = _signature(files["SHA256SUMS"], key)
    path = dist / f"{NAME}-{__version__}-{target.name}.tar.gz"
    dist.mkdir(parents=True, exist_ok=True)
    write_file(path, _pack(f"{NAME}-{release}-{target.name}", files, origin.time))
    return path


def _sums(files: dict[str, bytes]) -> bytes:
    return "".join(f"{hashlib.sha256(files[name]).hexdigest()}  {name}\n" for name in sorted(files)).encode()


def _signature(listing: bytes, key: Path) -> bytes:
    """The signature of a listing with an Ed25519 key, the same each time. Raises InputError."""
    command = ["ssh-keygen", "-q", "-Y", "sign", "-f", key, "-n", SIGNATURES]
    try:
        ran = subprocess.run(command, input=listing, capture_output=True)
    except OSError as error:
        raise InputError(f"can't run ssh-keygen, which signs the bundle: {error.strerror}") from error
    if ran.returncode:
        why = "; ".join(ran.stderr.decode(errors="replace").split("\n")).strip("; ")
        raise InputError(f"can't sign the bundle with the key {key}: {why}")
    return ran.stdout


def _manifest(target: Target, origin: Origin, release: str, files: dict[str, bytes]) -> dict[str, object]:
    wheels = {name: content for name, content in files.items() if name.endswith(".whl")}
    sizes = [each.file_size for content in wheels.values() for each in zipfile.ZipFile(io.BytesIO(content)).infolist()]
    return {
        "release": release,
        "commit": origin.commit,
        "time": datetime.fromtimestamp(origin.time, UTC).strftime("%Y-%m-%dT%H:%M:%SZ"),
        "machine": target.machine,
        "glibc": ".".join(map(str, target.glibc)),
        "python": target.python,
        "disk_mib": round(1.15 * sum(sizes) / 2**20) + 16,  # 15 % and 16 MiB for the files that Python compiles
        "model_sha256": hashlib.sha256(files[f"etc/{MODEL}"]).hexdigest(),
        "packages": {name.split("/")[1].split("-")[0]: name.split("-")[1] for name in sorted(wheels)},
    }


def _pack(name: str, files: dict[str, bytes], time: int) -> bytes:
    """A .tar.gz whose bytes depend only on its files and the time."""
    packed = io.BytesIO()
    with (
        gzip.GzipFile(filename="", mode="wb", fileobj=packed, compresslevel=1, mtime=time) as zipped,
        tarfile.open(mode="w", fileobj=zipped, format=tarfile.USTAR_FORMAT) as tar,
    ):
        for each in sorted(files):
            entry = tarfile.TarInfo(f"{name}/{each}")
            entry.size, entry.mtime = len(files[each]), time
            entry.mode = 0o755 if files[each].startswith(b"#!") else 0o644
            tar.addfile(entry, io.BytesIO(files[each]))
    return packed.getvalue()


def main() -> int:
    parser = argparse.ArgumentParser(prog="make bundle", description=__doc__)
    parser.add_argument("--target", default=DEFAULT_TARGET, help="default %(default)s")
    parser.add_argument(
        "--model", help="network (.onnx file, or one of the package); default: that of the configuration"
    )
    parser.add_argument("--config", type=Path, help="vm.toml; default: a synthetic camera, to try it out")
    parser.add_argument("--key", type=Path, help="private Ed25519 key of ssh-keygen that signs the bundle")
    parser.add_argument("--wheels", type=Path, default=TOP / "build" / "wheels", help="folder for downloads")
    parser.add_argument("--dist", type=Path, default=TOP / "dist", help="folder for the bundle")
    parser.add_argument("--download", action="store_true", help="only download the packages")
    options = parser.parse_args()
    try:
        if options.download:
            wheelhouse(Target.parse(options.target), options.wheels)
            return 0
        target = Target.parse(options.target)
        path = write_bundle(target, options.config, options.model, options.wheels, options.dist, options.key)
    except VisualMeshError as error:
        print(f"make bundle: {error}", file=sys.stderr)
        return 1
    print(f"{path}  {path.stat().st_size / 2**20:.0f} MiB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
