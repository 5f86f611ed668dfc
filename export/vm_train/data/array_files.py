"""Files of numpy with several arrays, read without allocating what their headers claim."""

from __future__ import annotations

import math
import zipfile
import zlib
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from vm_embedded.errors import InputError, one_line
from vm_embedded.files import LARGEST, open_regular

_DAMAGE = (OSError, ValueError, KeyError, EOFError, OverflowError, RuntimeError, zipfile.BadZipFile, zlib.error)
"""What numpy and zipfile raise for a damaged file. RuntimeError: a part is encrypted, or packed in an unknown way."""


def read_arrays(path: Path) -> dict[str, npt.NDArray[Any]]:
    """The arrays of a .npz file by name. Raises InputError if it is missing or damaged, or packs more than it should:
    compressed arrays have at most LARGEST bytes together."""
    try:
        with open_regular(path) as file:
            _check_sizes(file)
            with np.load(file, allow_pickle=False) as arrays:
                return {name: arrays[name] for name in arrays.files}
    except _DAMAGE as error:
        raise InputError(f"can't read {path}: {one_line(error)}") from error


def _check_sizes(file: BinaryIO) -> None:
    """Raise ValueError if the arrays are larger than their parts of the file, or the parts too large."""
    with zipfile.ZipFile(file) as packed:
        parts = packed.infolist()
        if sum(each.file_size for each in parts if each.compress_type != zipfile.ZIP_STORED) > LARGEST:
            raise ValueError(f"its arrays are too large; at most {LARGEST} bytes are allowed")
        for part in parts:
            with packed.open(part) as opened:
                version = np.lib.format.read_magic(opened)
                read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
                shape, _, dtype = read(opened)
                if math.prod(shape) * dtype.itemsize > part.file_size:
                    raise ValueError(f"the array {part.filename} is cut short")
    file.seek(0)
