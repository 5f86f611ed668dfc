"""Pictures of cameras and files: decoded to BGR and with their own channels."""

from vm_embedded.cameras.decoding import decode
from vm_embedded.cameras.library_messages import silence_opencv
from vm_embedded.errors import VisualMeshError

silence_opencv()  # as vm-detect does


def run(data: bytes) -> None:
    refusal = None
    try:
        decode(data)
    except VisualMeshError as error:
        refusal = error
    decode(data, raw=True)
    if refusal:
        raise refusal
