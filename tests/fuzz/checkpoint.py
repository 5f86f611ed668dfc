"""Checkpoints, as vm-export reads them: whole files, and pickles put into a file whose checksums are right."""

import io
import zipfile
from contextlib import suppress

from vm_embedded.errors import VisualMeshError
from vm_export.checkpoint import Checkpoint
from vm_export.look_checkpoint import LookCheckpoint

from .scratch import scratch

_MOST_STORAGES, _STORAGE = 24, bytes(4096)


def run(data: bytes) -> None:
    path = scratch("model.pt")
    path.write_bytes(data if data.startswith(b"PK") else _packed(data))
    with suppress(VisualMeshError):
        LookCheckpoint.load(path)
    Checkpoint.load(path)


def _packed(pickled: bytes) -> bytes:
    """A file of torch with this pickle, and storages of zeros for the tensors that it names."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as packed:
        packed.writestr("model/data.pkl", pickled)
        packed.writestr("model/byteorder", b"little")
        for number in range(_MOST_STORAGES):
            packed.writestr(f"model/data/{number}", _STORAGE)
        packed.writestr("model/version", b"3\n")
    return file.getvalue()
