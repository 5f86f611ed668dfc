"""The size of an image, read from its headers: decoding may take gigabytes, so its size is checked before."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress

from ..errors import InputError
from ..geometry.lens import Size

MAX_MEGAPIXELS = 50.0
"""Largest image that is decoded if no setting says otherwise [Mpx]."""

PNG_START = b"\x89PNG\r\n\x1a\n"
_TIFF_STARTS = (b"II*\x00", b"MM\x00*")
_PNG_CHUNK = 12
"""Bytes of a chunk besides its content: length, kind and checksum."""

_STANDALONE = {0x01, *range(0xD0, 0xD9)}
"""Markers of a JPEG without a length: TEM, RST0 to RST7, SOI."""

_NOT_FRAMES = {0xC4, 0xC8, 0xCC}
"""Markers of a JPEG from 0xC0 to 0xCF that do not begin a frame."""


def check_size(content: bytes, max_megapixels: float = MAX_MEGAPIXELS) -> None:
    """Raise InputError for an image larger than this [Mpx], before it is decoded, and for other content."""
    check_pixels(*image_size(content), max_megapixels)


def check_pixels(width: int, height: int, max_megapixels: float) -> None:
    """Raise InputError for more pixels than this [Mpx]."""
    if width * height > 1e6 * max_megapixels:
        raise InputError(
            f"has {width} x {height} px, {1e-6 * width * height:.4g} Mpx; at most {max_megapixels:g} Mpx are decoded"
        )


def image_size(content: bytes) -> Size:
    """Width and height [px] of a JPEG, PNG, BMP, PGM, PPM, TIFF or WebP file.

    For a TIFF, at least the size of its tiles, which are also decoded as a whole. Raises InputError, without the
    name of the file, for other contents.
    """
    reader = next((each for start, each in _READERS.items() if content.startswith(start)), None)
    size = None
    if reader is not None:
        with suppress(struct.error, IndexError, ValueError):  # it ends within the header
            size = reader(content)
    if size is None:
        raise InputError("can't be decoded as an image")
    return size


def jpeg_segments(content: bytes) -> Iterator[tuple[int, int]]:
    """Marker and position of each segment of a JPEG that has a length, up to the data. The length is at the position.

    Bytes between two segments are skipped, as libjpeg does. Raises IndexError, ValueError or struct.error where the
    content ends.
    """
    at = 2
    while True:
        at = content.index(b"\xff", at) + 1
        while content[at] == 0xFF:
            at += 1
        marker = content[at]
        at += 1
        if marker == 0 or marker in _STANDALONE:
            continue
        yield marker, at
        if marker in (0xD9, 0xDA):  # the end, or the data
            return
        at += int(struct.unpack_from(">H", content, at)[0])


def png_chunks(content: bytes) -> Iterator[tuple[bytes, int, int]]:
    """Kind of each chunk of a PNG, and position and length of its content.

    Raises InputError if the content ends within a chunk: OpenCV allocates the length that a chunk declares.
    """
    at, kind = len(PNG_START), b""
    while kind != b"IEND":
        if at + _PNG_CHUNK > len(content):
            raise InputError("is cut short")
        length, kind = struct.unpack_from(">I4s", content, at)
        if at + _PNG_CHUNK + length > len(content):
            raise InputError("is cut short")
        yield kind, at + 8, length
        at += _PNG_CHUNK + length


def is_tiff(content: bytes) -> bool:
    """Whether this is a TIFF file, or has its form."""
    return content.startswith(_TIFF_STARTS)


def tiff_values(content: bytes, tags: Iterable[int]) -> dict[int, int]:
    """The whole numbers of these tags in the first directory of a TIFF; 0 for one that it lacks.

    Raises struct.error where the content ends.
    """
    order = "<" if content.startswith(b"II") else ">"
    (directory,) = struct.unpack_from(order + "I", content, 4)
    (count,) = struct.unpack_from(order + "H", content, directory)
    values = dict.fromkeys(tags, 0)
    for number in range(count):
        place = directory + 2 + 12 * number
        tag, kind = struct.unpack_from(order + "HH", content, place)
        if tag in values:
            (value,) = struct.unpack_from(order + ("H" if kind == 3 else "I"), content, place + 8)
            values[tag] = max(values[tag], value)
    return values


def _jpeg(content: bytes) -> Size | None:
    """The size in the first frame header."""
    for marker, at in jpeg_segments(content):
        if 0xC0 <= marker <= 0xCF and marker not in _NOT_FRAMES:
            _, _, height, width = struct.unpack_from(">HBHH", content, at)
            return width, height
    return None


def _png(content: bytes) -> Size | None:
    """The size of the image, or of a larger frame of its animation."""
    sizes: list[Size] = []
    for kind, at, _ in png_chunks(content):
        if not sizes and kind != b"IHDR":
            return None
        if kind in (b"IHDR", b"fcTL"):  # fcTL: a frame of an animation, with its number before its size
            sizes.append(struct.unpack_from(">II", content, at + (0 if kind == b"IHDR" else 4)))
    return max(width for width, _ in sizes), max(height for _, height in sizes)


def _bmp(content: bytes) -> Size:
    (header,) = struct.unpack_from("<I", content, 14)
    width, height = struct.unpack_from("<HH" if header == 12 else "<ii", content, 18)
    return abs(width), abs(height)


def _pnm(content: bytes) -> Size:
    lines = (line.partition(b"#")[0] for line in content[2:4096].split(b"\n"))
    width, height, largest = [int(word) for word in b" ".join(lines).split(maxsplit=3)[:3]]
    if largest not in (255, 65535):
        # OpenCV takes 255 or 65535 as white whatever the file says, so the picture would be dark.
        raise InputError(f"has values from 0 to {largest}; scale them to 255 or 65535")
    return width, height


def _tiff(content: bytes) -> Size:
    values = tiff_values(content, (256, 257, 322, 323))  # width and height of the image, and of a tile
    return max(values[256], values[322]), max(values[257], values[323])


def _webp(content: bytes) -> Size | None:
    kind = content[12:16]
    if kind == b"VP8X":
        fields = content[24:30]
        return 1 + int.from_bytes(fields[:3], "little"), 1 + int.from_bytes(fields[3:], "little")
    if kind == b"VP8L":
        (bits,) = struct.unpack_from("<I", content, 21)
        return 1 + (bits & 0x3FFF), 1 + (bits >> 14 & 0x3FFF)
    if kind == b"VP8 ":
        width, height = struct.unpack_from("<HH", content, 26)
        return width & 0x3FFF, height & 0x3FFF
    return None


_READERS: dict[bytes, Callable[[bytes], Size | None]] = {
    b"\xff\xd8\xff": _jpeg,
    PNG_START: _png,
    b"BM": _bmp,
    b"P5": _pnm,
    b"P6": _pnm,
    **dict.fromkeys(_TIFF_STARTS, _tiff),
    b"RIFF": _webp,
}
"""Functions that read the size, by the first bytes of the file."""
