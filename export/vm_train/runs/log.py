"""The log of a training: a line of JSON for each step and validation, and files for TensorBoard."""

from __future__ import annotations

import json
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any

from vm_embedded.errors import InputError
from vm_embedded.files import library_path, read_bytes, write_file


class TrainingLog:
    """log.jsonl and tensorboard/ in a folder. Each record has a round and a step; TensorBoard shows its numbers.

    A resumed training starts from a state of `step` steps and `validated` epochs; later records are removed. Only one
    of several processes writes. Raises InputError.
    """

    def __init__(self, folder: Path, training_round: int, step: int, validated: int, writes: bool = True) -> None:
        self._writes = writes
        if not writes:
            return
        from torch.utils.tensorboard import SummaryWriter

        self._path = folder / "log.jsonl"
        if self._path.exists():
            _cut(self._path, training_round, step, validated)
        self._round, self._open = training_round, ExitStack()
        try:
            self._file = self._path.open("a", encoding="utf-8")
            name = self._open.enter_context(library_path(folder))  # until the end: it is opened again and again
            self._board = SummaryWriter(f"{name}/tensorboard/round{training_round}", purge_step=step + 1)
        except OSError as error:
            raise InputError(f"can't write {self._path}: {error.strerror or error}") from error

    def write(self, step: int, record: dict[str, Any]) -> None:
        """Add a record of plain values."""
        if not self._writes:
            return
        try:
            self._file.write(json.dumps({"round": self._round, "step": step} | record) + "\n")
            self._file.flush()
        except OSError as error:
            raise InputError(f"can't write {self._path}: {error.strerror or error}") from error
        for name, value in _scalars(record):
            self._board.add_scalar(name, value, step)

    def __enter__(self) -> TrainingLog:
        return self

    def __exit__(self, *_: type[BaseException] | BaseException | TracebackType | None) -> None:
        if self._writes:
            self._file.close()
            self._board.close()
            self._open.close()


def _scalars(record: dict[str, Any], above: str = "") -> list[tuple[str, float]]:
    """All numbers of a record, each with its path in nested tables."""
    found = []
    for name, value in record.items():
        if isinstance(value, dict):
            found += _scalars(value, f"{above}{name}/")
        elif isinstance(value, int | float):
            found.append((above + name, float(value)))
    return found


def _cut(path: Path, training_round: int, step: int, validated: int) -> None:
    """Remove the records after a state, and everything from the first damaged line on."""

    def is_before(record: dict[str, Any]) -> bool:
        if record["round"] != training_round:
            return bool(record["round"] < training_round)
        return bool(record["epoch"] <= validated if "epoch" in record else record["step"] <= step)

    kept = [line for line, record in read_log(path) if is_before(record)]
    write_file(path, "".join(kept))


def read_log(path: Path) -> list[tuple[str, dict[str, Any]]]:
    """Lines of a log with their records, up to the first damaged one. Raises InputError if it can't be read."""
    lines = read_bytes(path).splitlines(keepends=True)
    found: list[tuple[str, dict[str, Any]]] = []
    for line in lines:
        try:
            found.append((line.decode("utf-8"), json.loads(line)))
        except (ValueError, RecursionError):
            break
        if not line.endswith(b"\n"):
            found.pop()
    return found
