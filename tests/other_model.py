"""Another model file than those of the package, which finds the same."""

import tempfile
from pathlib import Path

from vm_embedded.network.bundled import model_path
from vm_export.metadata import with_metadata

_FOLDER = tempfile.TemporaryDirectory()

OTHER = Path(_FOLDER.name) / "other.onnx"
OTHER.write_bytes(with_metadata(model_path("ball").read_bytes(), {"author": "a test"}))
"""`ball` with another entry of metadata."""
