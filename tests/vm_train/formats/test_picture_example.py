"""The picture of one record of the reference: lens numbers, units, names of features, and every fault by name."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_embedded import Orientation, read_lens_file
from vm_embedded.errors import InputError
from vm_embedded.geometry.radial_lenses import Equisolid, Rectilinear
from vm_train.data.pictures import find_pictures
from vm_train.formats.importing import import_pictures

from .tfrecord_writer import example_bytes, write_records

LENS = Equisolid(focal_length=90.25, fov=2.75, center=(1.5, -2.25), distortion=(2.0**-20, -(2.0**-42)))
"""Its numbers are the same in 32 bits."""


POSE = Orientation.from_roll_pitch(0.75, 0.1, 0.5, 0.3)


def encoded(suffix, picture, *options):
    return cv2.imencode(suffix, picture, list(options))[1].tobytes()


IMAGE = encoded(".jpg", np.random.default_rng(0).integers(0, 255, (24, 32, 3), dtype=np.uint8))


MASK = encoded(".png", np.full((24, 32, 4), 255, dtype=np.uint8))


def reference_example(**changes):
    """An example as the reference writes it; lens_k=None leaves lens/k out."""
    hoc = np.eye(4)
    hoc[:3, :3], hoc[2, 3], hoc[0, 3] = POSE.rotation, POSE.height, 7.0
    features = {
        "image": [IMAGE],
        "mask": [MASK],
        "Hoc": hoc.ravel().tolist(),
        "lens/projection": [b"EQUISOLID"],
        "lens/focal_length": [LENS.focal_length],
        "lens/fov": [LENS.fov],
        "lens/centre": LENS.center,
        "lens/k": LENS.distortion,
    }
    features |= {name.replace("lens_", "lens/"): feature for name, feature in changes.items()}
    return {name: feature for name, feature in features.items() if feature is not None}


def written(path, *examples, compressed=False):
    write_records(path, map(example_bytes, examples), compressed)
    return path


def imported(files, out, renaming=None, normalized=False, strict=False, report=lambda share: None):
    return import_pictures(list(map(str, files)), out, renaming or {}, normalized, strict, report)


@given(
    st.floats(10, 4000, width=32),
    st.floats(0.125, 3.0, width=32),
    st.tuples(*[st.floats(-100, 100, width=32)] * 2),
    st.tuples(*[st.floats(-(2**-10), 2**-10, width=32)] * 2),
    st.sampled_from([b"RECTILINEAR", b"EQUISOLID", b"EQUIDISTANT"]),
)
def test_the_lens_file_has_the_records_numbers_to_the_last_bit(
    tmp_path_factory, focal_length, fov, centre, k, projection
):
    folder = tmp_path_factory.mktemp("import")
    example = reference_example(
        lens_focal_length=[focal_length],
        lens_fov=[fov],
        lens_centre=centre,
        lens_k=k,
        lens_projection=[projection],
    )
    imported([written(folder / "a", example)], folder / "out", strict=True)
    lens = read_lens_file(folder / "out" / "lens0000000.yaml").lens
    assert (lens.focal_length, lens.fov, lens.center, lens.distortion) == (focal_length, fov, centre, k)
    assert type(lens).__name__.upper().encode() == projection


def test_a_file_without_k_has_no_distortion(tmp_path):
    imported([written(tmp_path / "a", reference_example(lens_k=None))], tmp_path / "out", strict=True)
    assert read_lens_file(tmp_path / "out" / "lens0000000.yaml").lens.distortion == (0.0, 0.0)


def test_features_of_other_names_are_found_by_renaming(tmp_path):
    example = reference_example()
    example["camera/fov"], example["img"] = example.pop("lens/fov"), example.pop("image")
    path = written(tmp_path / "a", example)
    made = imported([path], tmp_path / "out")
    assert made.count == 0
    assert "a: record 0: lacks image, lens/fov; it has 'Hoc', 'camera/fov', 'img'," in made.skipped[0]
    assert "--key OURS=THEIRS" in made.skipped[0]
    made = imported([path], tmp_path / "out", {"lens/fov": "camera/fov", "image": "img"})
    assert made.count == 1
    assert read_lens_file(tmp_path / "out" / "lens0000000.yaml").lens == LENS


def test_a_k_that_was_renamed_must_be_there(tmp_path):
    made = imported([written(tmp_path / "a", reference_example())], tmp_path / "out", {"lens/k": "lens/distortion"})
    assert "lacks lens/k (as 'lens/distortion')" in made.skipped[0]


def test_normalized_lenses_become_those_of_the_image_in_pixels(tmp_path):
    path = written(
        tmp_path / "a",
        reference_example(
            lens_projection=[b"RECTILINEAR"],
            lens_focal_length=[0.75],
            lens_centre=[0.125, -0.25],
            lens_k=[0.5, 0.25],
            lens_fov=[1.0],
        ),
    )
    imported([path], tmp_path / "out", normalized=True, strict=True)
    lens = read_lens_file(tmp_path / "out" / "lens0000000.yaml").lens
    assert lens == Rectilinear(focal_length=24.0, fov=1.0, center=(4.0, -8.0), distortion=(0.5 / 32**2, 0.25 / 32**4))
    unit = Rectilinear(focal_length=0.75, fov=1.0, center=(0.125, -0.25), distortion=(0.5, 0.25))
    scaled = unit.scaled(32.0, (32, 24))
    assert (scaled.focal_length, scaled.distortion) == (lens.focal_length, lens.distortion)


@pytest.mark.parametrize(("focal_length", "normalized", "hint"), [(0.8, False, "with"), (420.0, True, "without")])
def test_lenses_in_the_other_unit_stop_the_import_before_anything_is_written(tmp_path, focal_length, normalized, hint):
    path = written(tmp_path / "a", reference_example(lens_focal_length=[focal_length]))
    with pytest.raises(InputError, match=f"a: record 0: lens/focal_length is .*import {hint} --normalized"):
        imported([path], tmp_path / "out", normalized=normalized)
    assert imported([path], tmp_path / "out", normalized=not normalized).count == 1


FAULTS = {
    "lacks mask": {"mask": None},
    "image is neither a JPEG nor a PNG file": {"image": [b"GIF89a"]},
    "image is not one string of bytes": {"image": [IMAGE, IMAGE]},
    "image can't be decoded": {"image": [IMAGE[:20]]},
    "mask is cut short": {"mask": [MASK[:30]]},
    "mask is not a PNG file": {"mask": [IMAGE]},
    "mask is not an RGB or RGBA picture": {"mask": [encoded(".png", np.zeros((24, 32), np.uint8))]},
    "mask has 30 x 24 px, but the image has 32 x 24 px": {"mask": [encoded(".png", np.zeros((24, 30, 4), np.uint8))]},
    "Hoc is not 16 floats": {"Hoc": [1.0] * 12},
    "camera height must be": {"Hoc": np.eye(4).ravel().tolist()},
    "lens/fov is not 1 floats": {"lens_fov": [b"2"]},
    "lens fov must be": {"lens_fov": [20.0]},
    "focal length must be above 0": {"lens_focal_length": [-1.0]},
    "unknown lens projection 'FISHEYE'": {"lens_projection": [b"FISHEYE"]},
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_record_that_is_no_picture_is_named_and_leaves_a_gap(tmp_path, fault):
    path = written(tmp_path / "a", reference_example(), reference_example(**FAULTS[fault]), reference_example())
    made = imported([path], tmp_path / "out")
    assert made.count == 2
    assert len(made.skipped) == 1
    assert made.skipped[0].startswith(f"{path}: record 1: ")
    assert made.skipped[0].count("record 1") == 1
    assert fault in made.skipped[0]
    assert [each.number for each in find_pictures(tmp_path / "out")] == ["0000000", "0000002"]
    assert not (tmp_path / "out" / "lens0000001.yaml").exists()
    with pytest.raises(InputError, match="record 1"):
        imported([path], tmp_path / "strict", strict=True)
    assert [each.number for each in find_pictures(tmp_path / "strict")] == ["0000000"]
