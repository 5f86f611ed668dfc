"""Pictures of cameras and files: decoded to BGR and with their own channels."""

from vm_embedded.cameras.decoding import decode
from vm_embedded.cameras.library_messages import silence_opencv
from vm_embedded.errors import VisualMeshError

silence_opencv()  # as vm-detect does

MEGAPIXELS = 12.0
"""Largest picture [Mpx]. A header may claim any size up to it, and decoding takes 9 to 20 bytes a pixel: in all fewer
than the memory that is a finding."""


def run(data: bytes) -> None:
    refusal = None
    try:
        decode(data, max_megapixels=MEGAPIXELS)
    except VisualMeshError as error:
        refusal = error
    decode(data, raw=True, max_megapixels=MEGAPIXELS)
    if refusal:
        raise refusal
