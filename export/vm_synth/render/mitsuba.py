"""Mitsuba 3, and the LLVM library that it compiles its programs with."""

from __future__ import annotations

import os
import re
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

from vm_embedded.errors import InputError

VARIANT = "llvm_ad_rgb"

_GOOD = (19, 20, 18, 17, 16)
"""Versions of LLVM by how well they are tried with Mitsuba; 14 is refused, 15 crashes on processors with AVX-512."""

_PLACES = (
    "/usr/lib/*/libLLVM*.so*",
    "/usr/lib/llvm-*/lib/libLLVM*.so*",
    "/usr/lib64/libLLVM*.so*",
    "/usr/local/lib/libLLVM*.so*",
)
_VERSION = re.compile(r"libLLVM(?:-|\.so\.)(\d+)")


def load_mitsuba() -> ModuleType:
    """The module mitsuba, on one processor core. Raises InputError naming what is missing and how to get it."""
    library = find_llvm()
    os.environ["DRJIT_LIBLLVM_PATH"] = str(library)
    with _interrupted_afterwards():
        try:
            import drjit
            import mitsuba
        except ImportError as error:
            raise InputError("rendering needs Mitsuba 3: pip install 'vm-embedded[synth]'") from error
    try:
        mitsuba.set_variant(VARIANT)
    except ImportError as error:
        raise InputError(f"Mitsuba can't use {library}; {_ADVICE}") from error
    drjit.set_thread_count(1)
    return mitsuba


@contextmanager
def _interrupted_afterwards() -> Iterator[None]:
    """Ctrl-C waits until the end: an import that is torn apart tells of other faults."""
    if signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return
    seen: list[int] = []
    signal.signal(signal.SIGINT, lambda number, frame: seen.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if seen:
        raise KeyboardInterrupt


_ADVICE = "install LLVM 19 (Debian, Ubuntu: apt install libllvm19) or set DRJIT_LIBLLVM_PATH to its libLLVM.so"


def find_llvm() -> Path:
    """The LLVM library that DRJIT_LIBLLVM_PATH names, or the best one installed. Raises InputError."""
    named = os.environ.get("DRJIT_LIBLLVM_PATH")
    if named:
        if not Path(named).is_file():
            raise InputError(f"DRJIT_LIBLLVM_PATH is {named}, where there is no file; {_ADVICE}")
        return Path(named)
    found: dict[int, Path] = {}
    for pattern in _PLACES:
        for path in sorted(Path("/").glob(pattern.lstrip("/"))):
            named_version = _VERSION.search(path.name)
            if named_version and path.is_file():
                found.setdefault(int(named_version.group(1)), path)
    for version in _GOOD:
        if version in found:
            return found[version]
    seen = f"found only LLVM {', '.join(map(str, sorted(found)))}" if found else "found none"
    raise InputError(f"Mitsuba needs LLVM 16 to 20 ({seen}); {_ADVICE}")
