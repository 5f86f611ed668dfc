"""The tests of the runtime with other versions of Python and numpy: `make matrix`.

For each interpreter from 3.10 to 3.14 that is on the PATH or in ~/.pyenv/versions, the wheel is installed into a new
environment in build/matrix, with the newest numpy and, where it exists, with numpy 1.26. Then the tests run that need
only the runtime. Versions that are not here are named.
"""

from __future__ import annotations

import ast
import shutil
import subprocess
import sys
from pathlib import Path

CHECKOUT = Path(__file__).resolve().parents[1]
FOLDER = CHECKOUT / "build" / "matrix"
VERSIONS = ("3.10", "3.11", "3.12", "3.13", "3.14")
NUMPY_1 = ("3.10", "3.11", "3.12")
"""Versions of Python that numpy 1.26 has wheels for."""

TOOLS = ("pytest>=8,<10", "hypothesis>=6.100,<7")
_RUNTIME = {"numpy", "cv2", "pytest", "hypothesis", "vm_embedded", "tests", *sys.stdlib_module_names} - {"tomllib"}


def interpreter(version: str) -> str | None:
    """An interpreter of a version, if there is one."""
    installed = sorted(Path.home().glob(f".pyenv/versions/{version}.*/bin/python"))
    candidates = [*map(str, installed), shutil.which(f"python{version}")]
    return next((each for each in candidates if each and _runs(each, version)), None)


def _runs(python: str, version: str) -> bool:
    program = f"import sys, venv; sys.exit('%d.%d' % sys.version_info[:2] != {version!r})"
    return subprocess.run([python, "-c", program], capture_output=True).returncode == 0


def runtime_tests() -> list[Path]:
    """Files of tests/vm_embedded that need only the runtime, with all that they import of tests."""
    return [each for each in sorted((CHECKOUT / "tests/vm_embedded").rglob("test_*.py")) if _needs(each) <= _RUNTIME]


def _needs(path: Path, seen: frozenset[Path] = frozenset()) -> set[str]:
    """The top-level packages that a file of tests imports, also through other files of tests."""
    found: set[str] = set()
    package = path.relative_to(CHECKOUT).parent.parts
    for node in ast.walk(ast.parse(path.read_text())):
        names = [each.name for each in node.names] if isinstance(node, ast.Import) else []
        if isinstance(node, ast.ImportFrom):
            above = package[: len(package) - node.level + 1] if node.level else ()
            module = ".".join([*above, *filter(None, [node.module])])
            names = [module, *(f"{module}.{each.name}" for each in node.names)]
        for name in names:
            found.add(name.split(".")[0])
            other = CHECKOUT / Path(*name.split(".")).with_suffix(".py")
            if name.startswith("tests.") and other.exists() and other not in seen:
                found |= _needs(other, seen | {path})
    return found


def run(version: str, numpy: str, wheel: Path, tests: list[Path]) -> bool | None:
    """Whether the tests pass with a Python and a numpy ("numpy<2"); None without this Python."""
    python = interpreter(version)
    if python is None:
        return None
    folder = FOLDER / f"{version}-{numpy.strip('numpy=<>.*') or 'newest'}"
    shutil.rmtree(folder, ignore_errors=True)
    subprocess.run([python, "-m", "venv", folder], check=True)
    install = [folder / "bin/pip", "install", "--quiet", "--disable-pip-version-check", wheel, numpy, *TOOLS]
    if subprocess.run(install).returncode:
        return False
    command = [folder / "bin/python", "-m", "pytest", "-q", "-p", "no:cacheprovider", "-m", "not long", *tests]
    return subprocess.run(command, cwd=CHECKOUT).returncode == 0


def main() -> int:
    """Run the matrix, print what passed, and return the exit status."""
    chosen = sys.argv[1:] or VERSIONS
    shutil.rmtree(FOLDER / "wheel", ignore_errors=True)
    build = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", FOLDER / "wheel", CHECKOUT]
    subprocess.run(build, check=True, stdout=subprocess.DEVNULL)
    (wheel,) = (FOLDER / "wheel").glob("*.whl")
    results = {}
    for version in chosen:
        for numpy in ("numpy", "numpy==1.26.*") if version in NUMPY_1 else ("numpy",):
            results[version, numpy] = run(version, numpy, wheel, runtime_tests())
    words = {None: "no such Python here", True: "passed", False: "FAILED"}
    for (version, numpy), passed in results.items():
        print(f"Python {version}, {numpy}: {words[passed]}")
    return int(False in results.values())


if __name__ == "__main__":
    sys.exit(main())
