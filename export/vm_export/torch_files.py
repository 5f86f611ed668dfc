"""Files of plain values and tensors, written and read by torch."""

from __future__ import annotations

import io
import pickle
import warnings
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch

from vm_embedded.errors import InputError, one_line
from vm_embedded.files import read_bytes, write_file


def save_values(path: str | Path, content: Mapping[str, Any]) -> None:
    """Write plain values and tensors. Raises InputError if the file can't be written."""
    file = io.BytesIO()  # torch reports a full disk in its own way; write_bytes raises OSError
    torch.save(dict(content), file)
    write_file(Path(path), file.getvalue())


def load_values(path: str | Path, what: str) -> Any:
    """Read a file of `save_values` without executing anything in it. Raises InputError if it is not `what`.

    torch's own message advises to load the file without this protection, so it is not passed on. Neither are its
    warnings about parts of a damaged file.
    """
    content = read_bytes(Path(path))
    try:
        _check_packed(content)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return torch.load(io.BytesIO(content), map_location="cpu", weights_only=True)
    except zipfile.BadZipFile as error:
        raise InputError(f"{path} is not {what}: it is damaged or cut short") from error
    except pickle.UnpicklingError as error:
        reason = "it is damaged, or contains more than plain values and tensors; use only files that you trust"
        raise InputError(f"{path} is not {what}: {reason}") from error
    except Exception as error:  # a damaged file makes torch raise errors of many types
        raise InputError(f"{path} is not {what}: {_first_sentence(error)}") from error


def _check_packed(content: bytes) -> None:
    """Raise BadZipFile unless this is an archive as torch writes it, with parts as large as they claim: a compressed
    part of kilobytes would be unpacked to gigabytes."""
    with zipfile.ZipFile(io.BytesIO(content)) as packed:
        parts = packed.infolist()
    is_stored = all(each.compress_type == zipfile.ZIP_STORED for each in parts)
    if not is_stored or sum(each.file_size for each in parts) > len(content):
        raise zipfile.BadZipFile


def _first_sentence(error: Exception) -> str:
    """What torch says is wrong, without its advice."""
    return one_line(error).partition(". ")[0]
