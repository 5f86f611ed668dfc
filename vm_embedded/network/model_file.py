"""Reads a model file without trusting it: finds its manifest, and refuses parts that vm-export never writes.

ONNX Runtime would follow a tensor's path to another file, and would run a loop that never ends. So this module looks
for external data and for inner graphs first. An .onnx file is one Protocol Buffers message; the walk below knows the
wire format and the few fields that matter here.
"""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from ..errors import ModelError
from ..files import read_regular
from .canary import CANARY_KEY, Canary
from .look_contract import LOOK_KEY
from .manifest import METADATA_KEY, Manifest

# Fields of a message that hold further messages, by the numbers of onnx.proto: every place that can hold a tensor.
_INNER: dict[str, dict[int, str]] = {
    "Model": {7: "Graph"},
    "Graph": {1: "Node", 5: "Tensor", 15: "SparseTensor"},
    "Node": {5: "Attribute"},
    "Attribute": {5: "Tensor", 10: "Tensor", 22: "SparseTensor", 23: "SparseTensor"},
    "SparseTensor": {1: "Tensor", 2: "Tensor"},
    "Tensor": {},
}

_INNER_GRAPH = "contains operators with an inner graph, such as Loop, If or Scan, which may never end"
_REFUSED = {
    ("Model", 20): "contains steps of a training",
    ("Model", 25): "contains functions, which may grow without limit",
    ("Attribute", 6): _INNER_GRAPH,
    ("Attribute", 11): _INNER_GRAPH,
}
"""Fields that make a model file unusable, and why. vm-export never writes them."""

SEAL_KEY = "visual_mesh_sha256"
"""Key of the seal in the metadata of a model file: the SHA-256 of everything else in the file."""

_ZIP = b"PK\x03\x04"
"""First bytes of a zip archive, which is what torch writes."""

_METADATA_PROPS = 14
_EXTERNAL_DATA, _DATA_LOCATION = 13, 14
_LARGEST = 64 * 2**20
"""Largest model file [bytes]; the networks of the package have less than 2 MiB."""

_MOST_FIELDS = 500_000
"""Most fields of a model file; the networks of the package have a few thousand."""

_Budget = Iterator[int]
"""Gives one number for each field that may still follow."""


@dataclass(frozen=True)
class ModelFile:
    """A model file's bytes, its manifest, and the SHA-256 of the bytes. look: the ONNX file of its close look, empty
    without one. canary: None if it has none."""

    path: Path
    content: bytes
    manifest: Manifest
    sha256: str
    look: bytes = b""
    canary: Canary | None = None


def read_model(path: str | Path) -> ModelFile:
    """Read and check a model file. Raises ModelError as the two steps do."""
    return parse_model(path, read_content(path))


def read_content(path: str | Path) -> bytes:
    """The bytes of a model file. Raises ModelError if it is missing, or larger than 64 MiB."""
    path = Path(path)
    try:
        return read_regular(path, _LARGEST)
    except OSError as error:
        raise ModelError(f"can't read the model {path}: {error.strerror or error}") from error


def parse_model(path: str | Path, content: bytes) -> ModelFile:
    """Check the content of a model file. path: for messages.

    Raises ModelError if it is not an ONNX file, refers to external data, contains inner graphs (control flow) or
    functions, lacks a manifest of this format, or is not what its seal says: a damaged network could still pass its
    self-test, and find nothing.
    """
    try:
        if content.startswith(_ZIP) or Path(path).suffix.lower() in (".yaml", ".yml"):
            raise ModelError(f"not an ONNX file; vm-export {path} writes one, if this is a trained network")
        metadata, digest = _read_fields(content)
        if METADATA_KEY not in metadata:
            raise ModelError("no Visual Mesh manifest in its metadata; was it written by vm-export?")
        manifest = Manifest.from_json(metadata[METADATA_KEY])
        look = _look_file(metadata, manifest)
        canary = Canary.from_json(metadata[CANARY_KEY]) if CANARY_KEY in metadata else None
        if SEAL_KEY not in metadata:
            raise ModelError("has no checksum: it was written by an older release; export it again with this release")
        if metadata[SEAL_KEY] != digest:
            raise ModelError("its checksum is wrong: it was damaged or changed; copy or export it again")
    except ModelError as error:
        raise ModelError(f"{path}: {error}") from error
    sha256 = hashlib.sha256(content).hexdigest()
    return ModelFile(Path(path), content, manifest, sha256, look, canary)


def _look_file(metadata: dict[str, str], manifest: Manifest) -> bytes:
    """The ONNX file of the close look; empty without one. Raises ModelError."""
    if (LOOK_KEY in metadata) != (manifest.look is not None):
        one, other = ("metadata", "manifest") if LOOK_KEY in metadata else ("manifest", "metadata")
        raise ModelError(f"its {one} has a close look, its {other} has none")
    if manifest.look is None:
        return b""
    try:
        content = base64.b64decode(metadata[LOOK_KEY], validate=True)
        _read_fields(content)
    except (ModelError, ValueError) as error:
        raise ModelError(f"its close look can't be read: {error}") from error
    return content


def sealed(content: bytes) -> bytes:
    """An ONNX file without a seal, with its seal. Raises ModelError for other content."""
    _, digest = _read_fields(content)
    entry = b"".join(_field(number, text.encode()) for number, text in ((1, SEAL_KEY), (2, digest)))
    return content + _field(_METADATA_PROPS, entry)


def _field(number: int, content: bytes) -> bytes:
    """A field of a Protocol Buffers message, of at most 127 bytes."""
    return bytes([number << 3 | 2, len(content)]) + content


def _read_fields(content: bytes) -> tuple[dict[str, str], str]:
    """The metadata of an ONNX file, and the SHA-256 of all its fields except the seal.

    Raises ModelError for other files and for parts that are refused.
    """
    metadata: dict[str, str] = {}
    digest = hashlib.sha256()
    graphs = 0
    budget: _Budget = iter(range(_MOST_FIELDS))
    for number, value in _fields(memoryview(content), budget):
        if number == _METADATA_PROPS and isinstance(value, memoryview):
            entry = {key: bytes(text) for key, text in _fields(value, budget) if isinstance(text, memoryview)}
            key = _text(entry.get(1, b""))
            metadata[key] = _text(entry.get(2, b""))
            if key == SEAL_KEY:
                continue
        graphs += number == 7
        length = len(value) if isinstance(value, memoryview) else value
        digest.update(f"{number}:{type(value).__name__}:{length};".encode())
        digest.update(value if isinstance(value, memoryview) else b"")
    if not graphs:
        raise ModelError("not an ONNX file")
    _refuse_parts("Model", memoryview(content), budget)
    return metadata, digest.hexdigest()


def _refuse_parts(message: str, data: memoryview, budget: _Budget) -> None:
    for number, value in _fields(data, budget):
        if message == "Tensor" and (number == _EXTERNAL_DATA or (number == _DATA_LOCATION and value != 0)):
            raise ModelError("refers to external data; a model must be one file")
        if (message, number) in _REFUSED:
            raise ModelError(f"{_REFUSED[message, number]}; vm-export writes no such file")
        inner = _INNER[message].get(number)
        if inner and isinstance(value, memoryview):
            _refuse_parts(inner, value, budget)


def _fields(data: memoryview, budget: _Budget) -> Iterator[tuple[int, int | memoryview]]:
    """Fields of a Protocol Buffers message as (number, whole number or bytes). Raises ModelError."""
    position = 0
    while position < len(data):
        if next(budget, None) is None:
            raise ModelError(f"not a model file: it has more than {_MOST_FIELDS} fields")
        tag, position = _varint(data, position)
        if tag >> 32:  # other readers would truncate it to another field's number
            raise ModelError("not an ONNX file")
        number, wire = tag >> 3, tag & 7
        if wire == 0:
            value, position = _varint(data, position)
            yield number, value
            continue
        if wire == 2:
            length, position = _varint(data, position)
        elif wire in (1, 5):
            length = 8 if wire == 1 else 4
        else:
            raise ModelError("not an ONNX file")
        if position + length > len(data):
            raise ModelError("not an ONNX file, or cut short")
        yield number, data[position : position + length]
        position += length


def _varint(data: memoryview, position: int) -> tuple[int, int]:
    value = shift = 0
    while True:
        if position >= len(data) or shift > 63:
            raise ModelError("not an ONNX file, or cut short")
        byte = data[position]
        value |= (byte & 0x7F) << shift
        position += 1
        shift += 7
        if byte < 0x80:
            return value, position


def _text(raw: bytes) -> str:
    try:
        return raw.decode()
    except UnicodeDecodeError as error:
        raise ModelError(f"metadata is not text: {error}") from error
