"""What the check of a folder finds: faults and remarks, each of a kind, and their lines for a terminal."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

BAD_FILE = "annotation files that can't be used"
BAD_IMAGE = "images that can't be used"
BAD_BOX = "boxes that can't be used, nor can their images"
BAD_LENS = "lens files that can't be used"
NO_IMAGE = "annotations without a clear image"
NO_ANNOTATION = "images without an annotation"
SEVERAL = "images with several annotations"
SAME_IMAGE = "images that are the same as another"
SAME_BOX = "boxes that are the same as another"
NO_NAME = "names of classes that don't fit"
LONG_BOX = "boxes too long for a round object in full view"
TURNED = "images turned by their EXIF orientation"
NO_BOX = "places without a box that look like an object"


@dataclass(frozen=True)
class Finding:
    """A line about an image, a file or a box.

    kind: one of the above, or another text in the plural, for counts. text: names the file, the place in it and the
    value, and says what is not used. is_fault: something is not used, or must be changed; a remark is no fault.
    """

    kind: str
    text: str
    is_fault: bool = True


def texts(findings: Iterable[Finding], are_faults: bool) -> tuple[str, ...]:
    """The lines of the faults, or of the remarks."""
    return tuple(each.text for each in findings if each.is_fault == are_faults)


def finding_lines(findings: Iterable[Finding], verbose: bool, more: str) -> list[str]:
    """All findings, by kind, faults first; without `verbose`, one line for each kind: its number and its first text.

    more: how to see all lines; it is the last line if some are left out.
    """
    groups: dict[tuple[bool, str], list[str]] = {}
    for each in findings:
        groups.setdefault((not each.is_fault, each.kind), []).append(each.text)
    lines = []
    for (_, kind), some in sorted(groups.items(), key=lambda group: group[0][0]):
        lines += some if verbose or len(some) == 1 else [f"{len(some)} {kind}; the first: {some[0]}"]
    return [*lines, *([more] if len(lines) < sum(map(len, groups.values())) else [])]
