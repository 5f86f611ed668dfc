"""The size of an image, read from its headers: decoding may take gigabytes, so its size is checked before."""

from __future__ import annotations

import struct
from collections.abc import Callable
from contextlib import suppress

from ..errors import InputError
from ..geometry.lens import Size

MAX_MEGAPIXELS = 50.0
"""Largest image that is decoded if no setting says otherwise [Mpx]."""

_PNG_START = b"\x89PNG\r\n\x1a\n"
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


def _jpeg(content: bytes) -> Size | None:
    """The size in the first frame header. Bytes between two segments are skipped, as libjpeg does."""
    at = 2
    while True:
        at = content.index(b"\xff", at) + 1
        while content[at] == 0xFF:
            at += 1
        marker = content[at]
        at += 1
        if marker == 0 or marker in _STANDALONE:
            continue
        length, _, height, width = struct.unpack_from(">HBHH", content, at)
        if 0xC0 <= marker <= 0xCF and marker not in _NOT_FRAMES:
            return width, height
        if marker in (0xD9, 0xDA):  # the end, or the data: there is no frame
            return None
        at += length


def _png(content: bytes) -> Size | None:
    """The size of the image, or of a larger frame of its animation.

    Raises InputError if the content ends within a chunk: OpenCV allocates the length that a chunk declares.
    """
    sizes: list[Size] = []
    at, kind = len(_PNG_START), b""
    while kind != b"IEND":
        if at + _PNG_CHUNK > len(content):
            raise InputError("is cut short")
        length, kind = struct.unpack_from(">I4s", content, at)
        if at + _PNG_CHUNK + length > len(content):
            raise InputError("is cut short")
        if not sizes and kind != b"IHDR":
            return None
        if kind in (b"IHDR", b"fcTL"):  # fcTL: a frame of an animation, with its number before its size
            sizes.append(struct.unpack_from(">II", content, at + (8 if kind == b"IHDR" else 12)))
        at += _PNG_CHUNK + length
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
    order = "<" if content.startswith(b"II") else ">"
    (directory,) = struct.unpack_from(order + "I", content, 4)
    (count,) = struct.unpack_from(order + "H", content, directory)
    values = dict.fromkeys((256, 257, 322, 323), 0)  # width and height of the image, and of a tile
    for number in range(count):
        place = directory + 2 + 12 * number
        tag, kind = struct.unpack_from(order + "HH", content, place)
        if tag in values:
            (value,) = struct.unpack_from(order + ("H" if kind == 3 else "I"), content, place + 8)
            values[tag] = max(values[tag], value)
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
    _PNG_START: _png,
    b"BM": _bmp,
    b"P5": _pnm,
    b"P6": _pnm,
    b"II*\x00": _tiff,
    b"MM\x00*": _tiff,
    b"RIFF": _webp,
}
"""Functions that read the size, by the first bytes of the file."""
