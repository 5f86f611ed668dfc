"""Images from bytes, whole and cut short."""

import pytest

from vm_embedded.cameras.camera import BrokenFrameError
from vm_embedded.cameras.decoding import decode_frame
from vm_embedded.cameras.synthetic import SIZE


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.99])
def test_half_a_jpeg_is_no_picture(pictures, share):
    with pytest.raises(BrokenFrameError):
        decode_frame(pictures[0][: int(share * len(pictures[0]))])
    assert decode_frame(pictures[0] + bytes(100)).shape == (SIZE[1], SIZE[0], 3)
