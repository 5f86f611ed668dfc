"""Loads Mitsuba 3 and finds the LLVM library that it compiles with."""

from __future__ import annotations

import os
import re
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

from vm_embedded.errors import InputError, install_extra

VARIANT = "llvm_ad_rgb"

_VERSIONS = (19, 20, 18, 17, 16)
"""Versions of LLVM, best tested first. Mitsuba rejects 14; 15 crashes on processors with AVX-512."""

_PLACES = (
    "/usr/lib/*/libLLVM*.so*",
    "/usr/lib/llvm-*/lib/libLLVM*.so*",
    "/usr/lib64/libLLVM*.so*",
    "/usr/local/lib/libLLVM*.so*",
)
_VERSION = re.compile(r"libLLVM(?:-|\.so\.)(\d+)")


def load_mitsuba() -> ModuleType:
    """Import mitsuba and limit it to one processor core. Raises InputError that says what to install."""
    library = find_llvm()
    os.environ["DRJIT_LIBLLVM_PATH"] = str(library)
    with _deferred_interrupt():
        try:
            import drjit
            import mitsuba
        except ImportError as error:
            raise InputError(f"rendering needs Mitsuba 3; {install_extra('synth')}") from error
    try:
        mitsuba.set_variant(VARIANT)
    except ImportError as error:
        raise InputError(f"Mitsuba can't use {library}; {_ADVICE}") from error
    drjit.set_thread_count(1)
    return mitsuba


@contextmanager
def _deferred_interrupt() -> Iterator[None]:
    """Delay Ctrl-C until the end: an interrupted import would report misleading errors."""
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
    """The LLVM library of DRJIT_LIBLLVM_PATH, or else the best installed one. Raises InputError if there is none."""
    named = os.environ.get("DRJIT_LIBLLVM_PATH")
    if named:
        if not Path(named).is_file():
            raise InputError(f"DRJIT_LIBLLVM_PATH is {named}, but there is no such file; {_ADVICE}")
        return Path(named)
    found: dict[int, Path] = {}
    for pattern in _PLACES:
        for path in sorted(Path("/").glob(pattern.lstrip("/"))):
            named_version = _VERSION.search(path.name)
            if named_version and path.is_file():
                found.setdefault(int(named_version.group(1)), path)
    for version in _VERSIONS:
        if version in found:
            return found[version]
    seen = f"found only LLVM {', '.join(map(str, sorted(found)))}" if found else "found none"
    raise InputError(f"Mitsuba needs LLVM 16 to 20 ({seen}); {_ADVICE}")
