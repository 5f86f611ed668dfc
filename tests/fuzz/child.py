"""The process that is fuzzed: python -m tests.fuzz.child MODULE SHARED CORPUS FLAGS-OF-LIBFUZZER...

It runs all files of the corpus, then what atheris makes of them. A finding ends it with status 77.
"""

import importlib
import os
import sys
from pathlib import Path

import atheris

FOUND = 77

with atheris.instrument_imports(include=["vm_embedded", "vm_export", "vm_train", "vm_label", "vm_workstation"]):
    target = importlib.import_module(sys.argv[1])

from .inputs import Watch, peak_memory  # noqa: E402
from .shared_input import SharedInput  # noqa: E402


def main(shared_file: str, corpus: str, flags: list[str]) -> None:
    shared, watch = SharedInput(Path(shared_file)), Watch(target.run)

    def one(data: bytes) -> None:
        shared.begin(data)
        found = watch.finding(data, shared.memory)
        if found:
            print(found, file=sys.stderr, flush=True)
            os._exit(FOUND)  # before libFuzzer writes the input to a file of its own

    for path in sorted(Path(corpus).iterdir()):
        one(path.read_bytes())
    shared.memory = peak_memory()
    atheris.Setup([sys.argv[0], *flags], one)
    atheris.Fuzz()


if __name__ == "__main__":
    main(sys.argv[2], sys.argv[3], sys.argv[4:])
