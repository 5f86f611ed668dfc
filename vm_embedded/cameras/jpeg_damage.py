"""Whether a JPEG has lost pixels: damage is what changes pixels, not bytes that a decoder skips.

Cameras put bytes between the parts of a JPEG or behind its end, or leave out its end marker. libjpeg skips these bytes
with a warning. It prints only the first warning about a picture, so a harmless one hides those of real damage.
"""

from __future__ import annotations

import math
import re
import struct
from bisect import bisect_left
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import cv2
import numpy as np
import numpy.typing as npt

from ..errors import InputError
from .library_messages import library_messages

_START, _END = b"\xff\xd8", b"\xff\xd9"
"""The markers of the start and the end of an image."""

_END_MARKER, _SCAN, _QUANTIZATION, _INTERVAL = 0xD9, 0xDA, 0xDB, 0xDD
"""Markers of the end, of a scan, of tables of quantization, and of the interval between restarts."""

_STEPS = bytes([16] * 63)
"""Steps of quantization, besides that of the mean, which are visible in 8 bits."""

_FRAMES = {*range(0xC0, 0xD0)} - {0xC4, 0xC8, 0xCC}
"""Markers that begin a frame."""

_PROGRESSIVE = {0xC2, 0xC6, 0xCA, 0xCE}
"""Markers that begin a progressive frame."""

_WHOLE_SCAN = b"\x00\x3f\x00"
"""What the header of a scan that is not progressive must end with; decoders ignore it."""

_REMARKS = {*range(0xE0, 0xF0), 0xFE}
"""Markers of remarks, about colors for example. libjpeg warns of those that it does not know."""

_SEGMENT = re.compile(rb"\xff+([^\x00\xff\x01\xd0-\xd8])", re.DOTALL)
"""The marker of a segment, and the fill bytes before it."""

_RESTART = re.compile(rb"\xff+([\xd0-\xd7])")

_HARMLESS = re.compile(
    r"Corrupt JPEG data: (?:\d+ extraneous bytes|bad ICC marker)|Invalid SOS parameters|Unknown Adobe|"
    r"Warning: unknown JFIF"
)
"""Warnings about bytes that change no pixel."""

_BEFORE_END = re.compile(r"Corrupt JPEG data: (\d+) extraneous bytes before marker 0xd9")
"""The harmless warning that no other one follows."""

_BUFFERED = 8
"""Extraneous bytes that libjpeg has read already, and does not count."""

_WIDEST = 65500
"""Largest width and height of a JPEG that libjpeg reads [px]."""


def complete(content: bytes) -> tuple[bytes, bool]:
    """A JPEG up to its end marker, and whether it had one; if not, one is added.

    What follows the end marker belongs to another picture or to none. A thumbnail's own end marker lies in a segment.
    """
    at = len(_START)
    while (found := _SEGMENT.search(content, at)) is not None:
        if found[1][0] == _END_MARKER:
            return content[: found.end()], True
        at = found.end() + _length(content, found.end())
    return content + _END, False


def is_progressive(content: bytes) -> bool:
    """Whether a JPEG shows a coarse picture first: one that is cut short may lack its details only."""
    return any(each.marker in _PROGRESSIVE for each in _segments(content))


def check_damage(content: bytes, warning: str) -> None:
    """Raise InputError for a JPEG with an end marker that has lost pixels.

    warning: libjpeg's first one about the whole. If it is harmless, but others may follow, the parts are decoded again.
    """
    if _BEFORE_END.match(warning):
        return
    if not _HARMLESS.match(warning):
        raise _lost_pixels(warning)
    segments = [_with_visible_steps(each) for each in _segments(content) if each.marker not in _REMARKS]
    scans = [each for each in segments if each.marker == _SCAN]
    interval = next((_length(each.header, 4) for each in segments[::-1] if each.marker == _INTERVAL), 0)
    try:
        if len(scans) == 1 and interval:
            _check_between_restarts(segments, scans[0], interval)
        else:
            _check_scans(segments)
    except (struct.error, IndexError, ValueError, ZeroDivisionError, StopIteration) as error:
        raise _lost_pixels(warning) from error  # a header is damaged


def _lost_pixels(warning: str) -> InputError:
    return InputError(f"is cut short or damaged ({warning})")


@dataclass(frozen=True)
class _Segment:
    """A marker, its header with the marker itself, and the compressed data behind the header of a scan."""

    marker: int
    header: bytes
    data: bytes = b""


def _segments(content: bytes) -> Iterator[_Segment]:
    """The segments of a JPEG up to its end marker, without the bytes between them."""
    at, progressive = len(_START), False
    while (found := _SEGMENT.search(content, at)) is not None and found[1][0] != _END_MARKER:
        start, marker = found.end() - 2, found[1][0]
        at = found.end() + _length(content, found.end())
        header = content[start:at]
        if marker in _FRAMES:
            progressive = marker in _PROGRESSIVE
        if marker != _SCAN:
            yield _Segment(marker, header)
            continue
        following = _SEGMENT.search(content, at)
        data = content[at : len(content) if following is None else following.start()]
        yield _Segment(marker, header if progressive else header[:-3] + _WHOLE_SCAN, data)


def _with_visible_steps(segment: _Segment) -> _Segment:
    """A segment whose tables of quantization, if they have 8 bits, make a coefficient visible but not too bright."""
    start, table = 4, 1 + 64  # a number and its steps, of which the first one is for the mean
    tables = [segment.header[at : at + table] for at in range(start, len(segment.header), table)]
    if segment.marker != _QUANTIZATION or any(each[0] > 3 or len(each) < table for each in tables):
        return segment
    return replace(segment, header=segment.header[:start] + b"".join(each[:2] + _STEPS for each in tables))


def _length(content: bytes, at: int) -> int:
    """A number of two bytes."""
    return int.from_bytes(content[at : at + 2], "big")


def _check_scans(segments: Sequence[_Segment]) -> None:
    """Raise InputError for a scan with damage. A scan may need those before it."""
    picture = _START
    for each in segments:
        picture += each.header
        if each.marker == _SCAN:
            picture += _needed(picture, each.data)


def _check_between_restarts(segments: Sequence[_Segment], scan: _Segment, interval: int) -> None:
    """Raise InputError for damage in a part of the only scan, from one restart to the next.

    interval: units of compressed data (MCU) of each part but the last. A decoder starts anew at a restart, so a part is
    decoded as a picture of so many units.
    """
    frame = next(each.header for each in segments if each.marker in _FRAMES)
    height, width, components = struct.unpack_from(">HHB", frame, 5)
    factors = [0x11] if components == 1 else [frame[11 + 3 * each] for each in range(components)]
    across, down = 8 * max(each >> 4 for each in factors), 8 * max(each & 15 for each in factors)
    units = math.ceil(width / across) * math.ceil(height / down)
    counts = [min(interval, units - start) for start in range(0, units, interval)]
    first, *others = _RESTART.split(scan.data)
    parts, markers = [first, *others[1::2]], b"".join(others[::2])
    if len(parts) != len(counts) or any(each != 0xD0 + at % 8 for at, each in enumerate(markers)):
        raise _lost_pixels(f"{len(parts)} parts between restarts instead of {len(counts)}, or in another order")
    for part, count in zip(parts, counts, strict=True):
        rows = next(each for each in range(1, count + 1) if count % each == 0 and count // each * across <= _WIDEST)
        of_part = frame[:5] + struct.pack(">HH", rows * down, count // rows * across) + frame[9:]
        headers = [of_part if each.header is frame else each.header for each in segments if each.marker != _INTERVAL]
        _needed(b"".join((_START, *headers)), part)


def _needed(start: bytes, data: bytes) -> bytes:
    """The data of a scan without the bytes behind it that a decoder skips. start: the picture up to this data.

    Raises InputError for lost pixels.
    """
    image, warning = _decoded(start + data)
    extraneous = _BEFORE_END.match(warning)
    if extraneous is None:
        if warning:
            raise _lost_pixels(warning)
        return data

    def suffices(length: int) -> bool:
        """Whether a decoder needs no more bytes."""
        warning = _decoded(start + data[:length])[1]
        return not warning or _BEFORE_END.match(warning) is not None

    most = max(len(data) - int(extraneous[1]), 0)
    least = max(most - _BUFFERED, 0)
    needed = data[: least + bisect_left(range(least, most), True, key=suffices)].rstrip(b"\xff")
    if not _is_padded(start, needed, image):
        raise _lost_pixels(f"{len(data) - len(needed)} bytes left over")
    return needed


def _is_padded(start: bytes, data: bytes, image: npt.NDArray[np.generic] | None) -> bool:
    """Whether only ones follow the bits that a decoder needs, as an encoder fills up its last byte.

    Otherwise these bits are part of a picture whose pixels got lost, and the bytes behind them, too. image: decoded.
    """
    if not data or data.endswith(b"\xff\x00"):
        return True
    last = data[-1] | (data[-1] + 1)  # its lowest zero becomes a one
    changed, warning = _decoded(start + data[:-1] + bytes([last]) + (b"\0" if last == 0xFF else b""))
    return bool(warning) or image is None or changed is None or not np.array_equal(image, changed)


def _decoded(picture: bytes) -> tuple[npt.NDArray[np.generic] | None, str]:
    """A picture without its end marker as OpenCV decodes it, and libjpeg's first warning about it; empty for none."""
    image = None
    with library_messages() as warnings, suppress(cv2.error):
        image = cv2.imdecode(np.frombuffer(picture + _END, dtype=np.uint8), cv2.IMREAD_COLOR)
    return image, warnings[0] if warnings else ""
