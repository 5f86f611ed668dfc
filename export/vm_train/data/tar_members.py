"""The members of tar archives from outside, one by one: memory does not grow with what headers claim."""

from __future__ import annotations

import io
import tarfile
from collections.abc import Iterator
from typing import IO

from .picture_files import LARGEST_FILE

_LARGEST_HEADERS = 20 * 2**10
"""Most bytes of the headers of one member: long names take a few hundred. The time of tarfile grows with the square."""

_MOST_ENDS = 8  # reads that give nothing

DAMAGE = (tarfile.TarError, OSError, EOFError, ValueError, OverflowError, RecursionError)
"""What tarfile raises for a damaged archive."""


class TarSource(io.RawIOBase):
    """The bytes of an archive, for tarfile. It counts them and keeps the last 512 of them.

    Until `members` gives the first member, and between two members, only so many bytes can be read as headers may have:
    tarfile itself reads as much as a header claims. It also goes on reading after the end, until a size is reached.
    """

    def __init__(self, source: IO[bytes]) -> None:
        self._source, self.count, self.last, self._ends = source, 0, b"", 0
        self.limit: int | None = _LARGEST_HEADERS

    def read(self, size: int = -1) -> bytes:
        """The next bytes. Raises ReadError beyond the limit, and EOFError if there were none again and again."""
        if self.limit is not None and not 0 <= size <= self.limit - self.count:
            raise tarfile.ReadError(f"the headers of a member have more than {_LARGEST_HEADERS} bytes")
        data = self._source.read(size)
        self._ends = 0 if data else self._ends + 1
        if self._ends > _MOST_ENDS:
            raise EOFError("it is cut short")
        self.count += len(data)
        self.last = (self.last + data)[-512:] if len(data) < 512 else data[-512:]
        return data

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        """Go to a position of a file."""
        self.count, self.last = self._source.seek(offset, whence), b""
        return self.count

    def tell(self) -> int:
        """The position."""
        return self.count


def members(tar: tarfile.TarFile, source: TarSource) -> Iterator[tarfile.TarInfo]:
    """The members of an archive. source: its fileobj. Raises one of DAMAGE."""
    place = -1
    while (member := tar.next()) is not None:
        if member.size < 0 or tar.offset <= place:
            raise tarfile.ReadError(f"the size of {member.name} leads back to an earlier member")
        place, source.limit = tar.offset, None
        tar.members.clear()  # type: ignore[attr-defined]  # they are no longer needed, and an archive may have millions
        yield member
        source.limit = place + _LARGEST_HEADERS
    source.limit = None


def check_readable(member: tarfile.TarInfo) -> None:
    """Raise ReadError for a file that is larger than LARGEST_FILE, or sparse: then a few bytes may stand for many."""
    if member.issparse():
        raise tarfile.ReadError(f"{member.name} is a sparse file; write the archive without them")
    if not 0 <= member.size <= LARGEST_FILE:
        raise tarfile.ReadError(f"{member.name} has {member.size} bytes; at most {LARGEST_FILE} are allowed")
