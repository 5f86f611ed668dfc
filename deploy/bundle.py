"""make bundle: all that a robot without internet needs for a release, in one file.

The same inputs, target and commit give the same bytes, whoever packs, and where: versions and hashes of packages are
those of deploy/robot.txt, times are the commit's, and the tools that pack are those of deploy/constraints.txt.
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
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

TOP = Path(__file__).parents[1]
sys.path.insert(0, str(TOP))

from vm_embedded import __version__  # noqa: E402
from vm_embedded.cameras.camera import CameraSettings  # noqa: E402
from vm_embedded.config.toml_writer import to_commented_toml  # noqa: E402
from vm_embedded.errors import InputError, VisualMeshError  # noqa: E402
from vm_embedded.files import atomic_write  # noqa: E402
from vm_embedded.live.configuration import Configuration, read_configuration  # noqa: E402
from vm_embedded.network.bundled import DEFAULT, model_path  # noqa: E402
from vm_embedded.network.model_file import read_model  # noqa: E402
from vm_embedded.network.session import Session  # noqa: E402
from vm_embedded.output.channels import OutputSettings  # noqa: E402

NAME = "vm-embedded-robot"
LOCK = TOP / "deploy" / "robot.txt"
SCRIPTS = TOP / "deploy" / "robot"
OWN = ("vm_embedded", "export", "pyproject.toml", "README.md", "LICENSE")
PACKED = (*OWN, "deploy")
"""What of the checkout is in the project's wheel, and in the bundle."""

USUAL = "linux_x86_64-cp311"
USUAL_GLIBC = (2, 28)
"""Of a target that names none: the C library of Debian 10, Ubuntu 20.04 and everything since."""

OLDEST_GLIBC = 5
"""Minor version of the C library from which wheels have been named by it (PEP 600)."""

MODEL, CONFIGURATION = "model.onnx", "vm.toml"


@dataclass(frozen=True)
class Target:
    """A kind of robot: linux_x86_64-cp311, or with the C library's version manylinux_2_17_x86_64-cp311."""

    name: str
    glibc: tuple[int, int]
    machine: str
    python: str

    @classmethod
    def named(cls, name: str) -> Target:
        """Raises InputError."""
        found = re.fullmatch(r"(?:linux|manylinux_2_(\d+))_(x86_64|aarch64)-(cp3(?:1[1-9]|[2-9]\d))", name)
        if not found:
            raise InputError(
                f"TARGET must be like {USUAL}, linux_aarch64-cp312 or manylinux_2_17_x86_64-cp311 (Python 3.11 or "
                f"newer), not {name!r}"
            )
        glibc = (2, int(found[1])) if found[1] else USUAL_GLIBC
        return cls(name, glibc, found[2], found[3])

    def platforms(self) -> list[str]:
        """What pip calls wheels that run there, the newest C library first."""
        numbered = [f"manylinux_2_{minor}_{self.machine}" for minor in range(self.glibc[1], OLDEST_GLIBC - 1, -1)]
        return [*numbered, f"manylinux2014_{self.machine}"] if self.glibc[1] >= 17 else numbered


@dataclass(frozen=True)
class Origin:
    """The commit that is packed: its name, which ends in +changes if there are any, and its time [s]."""

    commit: str
    time: int

    @classmethod
    def of(cls, top: Path) -> Origin:
        """Raises InputError outside of a git checkout."""
        commit, time = _git(top, "log", "-1", "--format=%H %ct").split()
        return cls(commit + ("+changes" if _git(top, "status", "--porcelain", "--", *PACKED) else ""), int(time))


def _git(top: Path, *words: str) -> str:
    try:
        return subprocess.run(["git", "-C", top, *words], check=True, capture_output=True, text=True).stdout
    except (OSError, subprocess.CalledProcessError) as error:
        raise InputError(f"{top} must be a git checkout: a bundle says which commit it is of") from error


def wheelhouse(target: Target, folder: Path) -> list[Path]:
    """The wheels of deploy/robot.txt for a target, downloaded unless they are there. Raises InputError."""
    made = folder / target.name
    stamp, lock = made / "lock", hashlib.sha256(LOCK.read_bytes()).hexdigest()
    if not stamp.exists() or stamp.read_text() != lock:
        shutil.rmtree(made, ignore_errors=True)
        part = made.with_name(f".{target.name}.part")
        shutil.rmtree(part, ignore_errors=True)
        part.mkdir(parents=True)
        platforms = [word for each in target.platforms() for word in ("--platform", each)]
        _pip(
            f"there is no wheel for {target.name} of a package in {LOCK.relative_to(TOP)}, or no way to it",
            *["download", "--no-deps", "--require-hashes", "--only-binary=:all:", "--dest", part, *platforms],
            *["--python-version", target.python[2] + "." + target.python[3:], "--implementation", "cp"],
            *["--abi", target.python, "--abi", "abi3", "--abi", "none", "--requirement", LOCK],
        )
        (part / "lock").write_text(lock)
        part.rename(made)
    return sorted(made.glob("*.whl"))


def own_wheel(top: Path, origin: Origin, folder: Path) -> Path:
    """The wheel of this project, from what is in the checkout and git does not ignore. Raises InputError."""
    with tempfile.TemporaryDirectory() as name:
        source = Path(name)
        listed = _git(top, "ls-files", "-z", "--cached", "--others", "--exclude-standard", "--", *OWN)
        for each in filter(None, listed.split("\0")):
            copy = source / each
            copy.parent.mkdir(parents=True, exist_ok=True)
            with contextlib.suppress(FileNotFoundError):  # removed, and not committed yet
                copy.write_bytes((top / each).read_bytes())
                copy.chmod(0o644)
        words: list[str | Path] = ["wheel", "--no-deps", "--no-build-isolation", "--wheel-dir", folder, source]
        _pip("the project's own wheel can't be built", *words, env={"SOURCE_DATE_EPOCH": str(origin.time)})
    (wheel,) = folder.glob("vm_embedded-*.whl")
    return wheel


def _pip(what: str, *words: str | Path, env: Mapping[str, str] | None = None) -> None:
    command = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--quiet", *words]
    # Modes of files go into a wheel.
    ran = subprocess.run(command, capture_output=True, text=True, env={**os.environ, **(env or {})}, umask=0o022)
    if ran.returncode:
        raise InputError(f"{what}:\n{ran.stderr.strip()}")


def configured(configuration: Path | None, model: str | None) -> dict[str, bytes]:
    """Files of the folder etc/: vm.toml, model and lens, which refer to each other. Raises VisualMeshError."""
    if configuration is None:
        shown = Configuration(
            model=MODEL,
            camera=CameraSettings(source="synthetic"),
            output=OutputSettings(stdout=False, unix="/run/vm-detect/lines.sock"),
        )
        return {CONFIGURATION: to_commented_toml(shown).encode(), MODEL: _model(model or DEFAULT)}
    given = read_configuration(configuration)
    text = configuration.read_text(encoding="utf-8")
    table = tomllib.loads(text)
    files = {MODEL: _model(model or given.model)}
    text = _renamed(text, "model", MODEL)
    if isinstance(table.get("lens"), str):
        lens = configuration.parent / table["lens"]
        if lens.name in (CONFIGURATION, MODEL):
            raise InputError(f"the lens file {lens} can't be called {lens.name} in a bundle")
        files[lens.name] = lens.read_bytes()
        text = _renamed(text, "lens", lens.name)
    return {CONFIGURATION: text.encode(), **files}


def _model(model: str) -> bytes:
    """The bytes of a network that passes its self-test. Raises VisualMeshError."""
    read = read_model(model_path(model))
    Session(read)
    return read.content


def _renamed(text: str, key: str, value: str) -> str:
    """vm.toml with another value of an entry that stands before all sections. Raises InputError."""
    table, line = tomllib.loads(text), f"{key} = {json.dumps(value)}"
    found = re.compile(rf"^{key}\s*=.*$", re.MULTILINE)
    text = found.sub(lambda _: line, text, count=1) if key in table else f"{line}\n{text}"
    if tomllib.loads(text) != table | {key: value}:
        raise InputError(f"the configuration's {key} must be on a line of its own, as {line}")
    return text


def bundle(target: Target, configuration: Path | None, model: str | None, wheels: Path, dist: Path) -> Path:
    """Write a bundle, and return its path. Raises VisualMeshError."""
    origin = Origin.of(TOP)
    files = {f"etc/{name}": content for name, content in configured(configuration, model).items()}
    packages = wheelhouse(target, wheels)
    with tempfile.TemporaryDirectory() as folder:
        packages = sorted([*packages, own_wheel(TOP, origin, Path(folder))], key=lambda each: each.name)
        files |= {f"wheels/{each.name}": each.read_bytes() for each in packages}
    files["requirements.txt"] = "".join(_required(files)).encode()
    for each in sorted(SCRIPTS.iterdir()):
        files[each.name] = each.read_bytes()
    files["README.md"] = (TOP / "deploy" / "README.md").read_bytes()
    release = f"{__version__}-{hashlib.sha256(_sums(files)).hexdigest()[:8]}"
    files["manifest.json"] = (json.dumps(_manifest(target, origin, release, files), indent=1) + "\n").encode()
    files["SHA256SUMS"] = _sums(files)
    path = dist / f"{NAME}-{__version__}-{target.name}.tar.gz"
    dist.mkdir(parents=True, exist_ok=True)
    with atomic_write(path) as part:
        part.write_bytes(_packed(f"{NAME}-{release}-{target.name}", files, origin.time))
    return path


def _required(files: dict[str, bytes]) -> Iterator[str]:
    """Lines of requirements.txt: each wheel but pip's, with its hash."""
    for name, content in files.items():
        if name.startswith("wheels/") and not name.startswith("wheels/pip-"):
            project, version, *_ = Path(name).name.split("-")
            yield f"{project}=={version} --hash=sha256:{hashlib.sha256(content).hexdigest()}\n"


def _sums(files: dict[str, bytes]) -> bytes:
    return "".join(f"{hashlib.sha256(files[name]).hexdigest()}  {name}\n" for name in sorted(files)).encode()


def _manifest(target: Target, origin: Origin, release: str, files: dict[str, bytes]) -> dict[str, object]:
    wheels = {name: content for name, content in files.items() if name.endswith(".whl")}
    sizes = [each.file_size for content in wheels.values() for each in zipfile.ZipFile(io.BytesIO(content)).infolist()]
    return {
        "release": release,
        "commit": origin.commit,
        "machine": target.machine,
        "glibc": ".".join(map(str, target.glibc)),
        "python": target.python,
        "disk_mib": round(1.15 * sum(sizes) / 2**20) + 16,  # and what Python compiles
        "model_sha256": hashlib.sha256(files[f"etc/{MODEL}"]).hexdigest(),
        "packages": {name.split("/")[1].split("-")[0]: name.split("-")[1] for name in sorted(wheels)},
    }


def _packed(name: str, files: dict[str, bytes], time: int) -> bytes:
    """A .tar.gz that is the same whenever and wherever it is made."""
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
    parser.add_argument("--target", default=USUAL, help="default %(default)s")
    parser.add_argument("--model", help="network (.onnx), or one of the package; default: as the configuration says")
    parser.add_argument("--config", type=Path, help="vm.toml; default: a drawn field, to try it out")
    parser.add_argument("--wheels", type=Path, default=TOP / "build" / "wheels", help="where downloads are kept")
    parser.add_argument("--dist", type=Path, default=TOP / "dist", help="where the bundle goes")
    parser.add_argument("--download", action="store_true", help="only download what a bundle needs")
    options = parser.parse_args()
    try:
        if options.download:
            wheelhouse(Target.named(options.target), options.wheels)
            return 0
        path = bundle(Target.named(options.target), options.config, options.model, options.wheels, options.dist)
    except VisualMeshError as error:
        print(f"make bundle: {error}", file=sys.stderr)
        return 1
    print(f"{path}  {path.stat().st_size / 2**20:.0f} MiB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
