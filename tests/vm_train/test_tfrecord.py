"""TFRecord files: the format to the bit, every fault by name, and what an import makes of them."""

import gzip
import json
import struct

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_embedded import Orientation, read_lens_file
from vm_embedded.errors import InputError
from vm_embedded.lens import Equisolid, Rectilinear
from vm_train.crc32c import crc32c
from vm_train.pictures import find_pictures
from vm_train.tfexample import BytesList, FloatList, Int64List, example_bytes, parse_example
from vm_train.tfrecord import read_records, write_records
from vm_train.tfrecord_import import import_records, parser, run


def part(tag, content):
    """A part of a message: its tag, its length and what it holds."""
    return bytes([tag, len(content)]) + content


def entry(name, feature):
    return part(0x0A, part(0x0A, name) + part(0x12, feature))


BUILT = part(
    0x0A,
    entry(b"count", part(0x1A, part(0x0A, b"\x07")))
    + entry(b"ratio", part(0x12, part(0x0A, struct.pack("<f", 0.5))))
    + entry(b"word", part(0x0A, part(0x0A, b"abc"))),
)
"""A serialized example of a number, a fraction and a text."""

FEATURES = st.one_of(
    st.lists(st.binary(max_size=300), max_size=4).map(lambda values: BytesList(tuple(values))),
    st.lists(st.floats(width=32, allow_nan=False), max_size=20).map(lambda values: FloatList(tuple(values))),
    st.lists(st.integers(-(2**63), 2**63 - 1), max_size=20).map(lambda values: Int64List(tuple(values))),
)
EXAMPLES = st.dictionaries(st.text(max_size=20), FEATURES, max_size=6)


def bitwise_crc32c(data):
    """The definition, bit by bit."""
    register = 0xFFFFFFFF
    for byte in data:
        register ^= byte
        for _ in range(8):
            register = register >> 1 ^ (0x82F63B78 if register & 1 else 0)
    return register ^ 0xFFFFFFFF


def masked(data):
    crc = bitwise_crc32c(data)
    return struct.pack("<I", (((crc >> 15) | (crc << 17)) + 0xA282EAD8) % 2**32)


def framed(payload):
    length = struct.pack("<Q", len(payload))
    return length + masked(length) + payload + masked(payload)


def payloads_of(path):
    found = []
    for record in read_records(path):
        record.check()
        found.append(record.payload)
    return found


# Checksums.


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        (b"", 0),
        (b"123456789", 0xE3069283),
        (bytes(32), 0x8A9136AA),
        (b"\xff" * 32, 0x62A8AB43),
        (bytes(range(32)), 0x46DD794E),
        (bytes(range(31, -1, -1)), 0x113FDB5C),
    ],
)
def test_checksums_are_those_of_rfc_3720(data, expected):
    assert crc32c(data) == expected


@given(st.integers(0, 3000), st.integers(0, 2**32 - 1))
def test_checksums_of_any_length_follow_the_definition(size, seed):
    data = np.random.default_rng(seed).bytes(size)
    assert crc32c(data) == bitwise_crc32c(data)


@pytest.mark.parametrize("size", [255, 256, 257, 258, 259, 260, 1020, 1024, 1028])
def test_checksums_follow_the_definition_where_the_method_changes(size):
    for data in (bytes(size), b"\xff" * size, np.random.default_rng(size).bytes(size)):
        assert crc32c(data) == bitwise_crc32c(data)


# Records.


def test_a_record_built_by_hand_is_read_and_written(tmp_path):
    # What TensorFlow begins an event file of the time 256.5 s with.
    payload = b"\x09" + struct.pack("<d", 256.5) + b"\x1a\x0dbrain.Event:2"
    known = bytes.fromhex("1800000000000000 a37f4b22") + payload + bytes.fromhex("bc98212b")
    (tmp_path / "known").write_bytes(known)
    assert payloads_of(tmp_path / "known") == [payload]
    write_records(tmp_path / "written", [payload])
    assert (tmp_path / "written").read_bytes() == known == framed(payload)


@given(st.lists(st.binary(max_size=600), max_size=5), st.booleans())
def test_what_is_written_is_read(tmp_path_factory, payloads, compressed):
    path = tmp_path_factory.mktemp("records") / "file"
    write_records(path, iter(payloads), compressed)
    assert payloads_of(path) == payloads
    assert [record.number for record in read_records(path)] == list(range(len(payloads)))


def test_files_of_the_same_records_are_the_same_to_the_byte(tmp_path):
    for name in ("one", "other"):
        write_records(tmp_path / name, [b"a", b"b" * 1000], compressed=True)
    assert (tmp_path / "one").read_bytes() == (tmp_path / "other").read_bytes()


def test_a_plain_file_that_begins_like_gzip_is_read_as_it_is(tmp_path):
    payload = bytes(0x088B1F)
    write_records(tmp_path / "file", [payload])
    assert (tmp_path / "file").read_bytes()[:3] == b"\x1f\x8b\x08"
    assert payloads_of(tmp_path / "file") == [payload]


def test_an_empty_file_has_no_records(tmp_path):
    (tmp_path / "file").write_bytes(b"")
    assert payloads_of(tmp_path / "file") == []


def test_position_ends_at_the_size_of_the_file(tmp_path):
    write_records(tmp_path / "file", [b"a" * 100, b"b" * 50])
    assert [record.position for record in read_records(tmp_path / "file")] == [116, 116 + 66]


def test_records_are_read_one_at_a_time(tmp_path):
    (tmp_path / "file").write_bytes(framed(b"good") + b"rubbish that is no record")
    assert next(read_records(tmp_path / "file")).payload == b"good"


@pytest.mark.parametrize("size", [*range(1, 20), *range(21, 41)])
def test_a_file_that_breaks_off_is_named_with_the_record(tmp_path, size):
    path = tmp_path / "file"
    path.write_bytes((framed(b"good") + framed(b"lacks"))[:size])
    with pytest.raises(InputError) as error:
        payloads_of(path)
    fault = "is not a TFRecord file" if size < 12 else f"breaks off in record {int(size > 20)}"
    assert str(error.value).startswith(str(path))
    assert fault in str(error.value)


@given(st.integers(0, 19), st.integers(1, 255))
def test_any_damaged_byte_is_found(tmp_path_factory, place, change):
    path = tmp_path_factory.mktemp("records") / "file"
    data = bytearray(framed(b"good") + framed(b"next"))
    data[20 + place] ^= change
    path.write_bytes(data)
    with pytest.raises(InputError, match="record 1 is damaged"):
        payloads_of(path)


def test_what_follows_a_damaged_payload_can_still_be_read(tmp_path):
    data = bytearray(framed(b"good") + framed(b"next"))
    data[13] ^= 1
    (tmp_path / "file").write_bytes(data)
    first, second = read_records(tmp_path / "file")
    with pytest.raises(InputError, match="record 0 is damaged: the checksum of its content"):
        first.check()
    second.check()


def test_a_file_of_another_kind_is_told(tmp_path):
    for content in (b"\x89PNG\r\n\x1a\n" + bytes(100), b"short", gzip.compress(b"no record, only some text")):
        (tmp_path / "file").write_bytes(content)
        with pytest.raises(InputError, match="is not a TFRecord file"):
            payloads_of(tmp_path / "file")


def test_a_length_that_no_example_has_does_not_ask_for_memory(tmp_path):
    length = struct.pack("<Q", 2**62)
    (tmp_path / "file").write_bytes(length + masked(length))
    with pytest.raises(InputError, match="record 0 has 4611686018427387904 bytes"):
        payloads_of(tmp_path / "file")


def test_a_gzip_file_that_breaks_off_or_is_damaged_is_named(tmp_path):
    path = tmp_path / "file"
    write_records(path, [np.random.default_rng(1).bytes(1000), b"second"], compressed=True)
    whole = path.read_bytes()
    path.write_bytes(whole[:500])
    with pytest.raises(InputError, match="truncated: it breaks off in record 0"):
        payloads_of(path)
    path.write_bytes(whole[:-6] + b"\0\0" + whole[-4:])
    with pytest.raises(InputError, match=f"{path}: .*gzip file is damaged"):
        payloads_of(path)


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(InputError, match=r"can't read .*absent"):
        payloads_of(tmp_path / "absent")


# Examples.


def test_an_example_built_by_hand_is_read_and_written():
    example = parse_example(BUILT)
    assert example == {"count": Int64List((7,)), "ratio": FloatList((0.5,)), "word": BytesList((b"abc",))}
    assert example_bytes(example) == BUILT


@given(EXAMPLES)
def test_an_example_that_is_written_is_read(example):
    assert parse_example(example_bytes(example)) == example


@pytest.fixture(scope="module")
def example_type():
    """The Example of the protobuf package."""
    descriptor_pb2 = pytest.importorskip("google.protobuf.descriptor_pb2")
    from google.protobuf import descriptor_pool, message_factory

    file = descriptor_pb2.FileDescriptorProto(name="example.proto", package="t", syntax="proto3")

    def message(name, *fields):
        made = file.message_type.add(name=name)
        for number, (label, kind, field) in enumerate(fields, start=1):
            simple = {"bytes": 12, "float": 2, "int64": 3}.get(kind)
            made.field.add(
                name=field, number=number, label=label, type=simple or 11, type_name=None if simple else f".t.{kind}"
            )
        return made

    for name, kind in (("BytesList", "bytes"), ("FloatList", "float"), ("Int64List", "int64")):
        message(name, (3, kind, "value"))
    feature = message("Feature", (1, "BytesList", "bytes"), (1, "FloatList", "floats"), (1, "Int64List", "ints"))
    feature.oneof_decl.add(name="kind")
    for field in feature.field:
        field.oneof_index = 0
    features = message("Features", (3, "Features.FeatureEntry", "feature"))
    entry = features.nested_type.add(name="FeatureEntry")
    entry.options.map_entry = True
    entry.field.add(name="key", number=1, label=1, type=9)
    entry.field.add(name="value", number=2, label=1, type=11, type_name=".t.Feature")
    message("Example", (1, "Features", "features"))
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName("t.Example"))


@given(example=EXAMPLES)
def test_protobuf_reads_and_writes_the_same(example_type, example):
    read = example_type.FromString(example_bytes(example))
    names = {BytesList: "bytes", FloatList: "floats", Int64List: "ints"}
    assert set(read.features.feature) == set(example)
    for name, feature in example.items():
        assert read.features.feature[name].HasField(names[type(feature)])
        assert tuple(getattr(read.features.feature[name], names[type(feature)]).value) == feature.values
    assert parse_example(read.SerializeToString()) == example


def in_feature(content):
    """A payload with one feature, `x`, of these bytes."""
    entry = b"\n\x01x\x12" + bytes([len(content)]) + content
    features = b"\n" + bytes([len(entry)]) + entry
    return b"\n" + bytes([len(features)]) + features


@given(st.lists(st.floats(width=32, allow_nan=False), max_size=10), st.lists(st.integers(0, 127), max_size=10))
def test_lists_that_are_not_packed_are_read(floats, integers):
    loose = b"".join(b"\x0d" + struct.pack("<f", each) for each in floats)
    assert parse_example(in_feature(b"\x12" + bytes([len(loose)]) + loose)) == {"x": FloatList(tuple(floats))}
    loose = b"".join(b"\x08" + bytes([each]) for each in integers)
    assert parse_example(in_feature(b"\x1a" + bytes([len(loose)]) + loose)) == {"x": Int64List(tuple(integers))}


def test_a_list_partly_packed_is_read_in_order():
    one, two, three = (struct.pack("<f", each) for each in (1, 2, 3))
    content = b"\x0d" + one + b"\n\x08" + two + three
    assert parse_example(in_feature(b"\x12" + bytes([len(content)]) + content)) == {"x": FloatList((1.0, 2.0, 3.0))}


def test_fields_of_later_versions_are_passed_over():
    later = b"\x78\x96\x01" + b"\x7a\x02hi" + b"\x7d\0\0\0\0" + b"\x79" + bytes(8)
    assert parse_example(later + BUILT + later) == parse_example(BUILT)


@given(EXAMPLES, EXAMPLES)
def test_a_message_in_parts_is_the_sum_of_its_parts(first, second):
    assert parse_example(example_bytes(first) + example_bytes(second)) == {**first, **second}


def test_a_feature_without_a_list_is_left_out():
    assert parse_example(in_feature(b"")) == {}


def fault_of(payload):
    """What is wrong with a payload; None if it is an Example."""
    try:
        parse_example(payload)
    except InputError as error:
        return str(error)
    return None


@given(st.binary(max_size=60))
def test_any_bytes_are_an_example_or_a_named_fault(data):
    fault = fault_of(data)
    assert fault is None or "not an Example: " in fault


@given(st.integers(0, len(BUILT) - 1), st.integers(0, 255))
def test_an_example_with_any_wrong_byte_is_an_example_or_a_named_fault(place, value):
    fault = fault_of(BUILT[:place] + bytes([value]) + BUILT[place + 1 :])
    assert fault is None or "not an Example: " in fault


def test_a_record_that_is_no_example_is_named_with_file_and_number(tmp_path):
    write_records(tmp_path / "file", [BUILT, b"\x0b"])
    first, second = read_records(tmp_path / "file")
    assert first.example() == first.example(checked=False) == parse_example(BUILT)
    with pytest.raises(InputError, match="file: record 1: not an Example: wire type 3"):
        second.example()


def test_numbers_that_a_list_can_not_hold_are_refused():
    for feature in (FloatList((1e300,)), Int64List((2**63,))):
        with pytest.raises(OverflowError):
            example_bytes({"x": feature})


# Import.

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
        "image": BytesList((IMAGE,)),
        "mask": BytesList((MASK,)),
        "Hoc": FloatList(tuple(hoc.ravel().tolist())),
        "lens/projection": BytesList((b"EQUISOLID",)),
        "lens/focal_length": FloatList((LENS.focal_length,)),
        "lens/fov": FloatList((LENS.fov,)),
        "lens/centre": FloatList(LENS.center),
        "lens/k": FloatList(LENS.distortion),
    }
    features |= {name.replace("lens_", "lens/"): feature for name, feature in changes.items()}
    return {name: feature for name, feature in features.items() if feature is not None}


def written(path, *examples, compressed=False):
    write_records(path, map(example_bytes, examples), compressed)
    return path


def imported(files, out, renaming=None, normalised=False, strict=False, report=lambda share: None):
    return import_records(files, out, renaming or {}, normalised, strict, report)


@pytest.mark.parametrize("compressed", [False, True])
def test_an_import_is_a_folder_of_pictures_with_the_same_bytes_and_lenses(tmp_path, compressed):
    png = encoded(".png", np.zeros((24, 32, 3), dtype=np.uint8))
    path = written(
        tmp_path / "a", reference_example(), reference_example(image=BytesList((png,))), compressed=compressed
    )
    shares = []
    made = imported([path], tmp_path / "out", report=shares.append)
    assert (made.count, made.skipped, made.there) == (2, (), 0)
    first, second = find_pictures(tmp_path / "out")
    assert (first.image.name, second.image.name) == ("image0000000.jpg", "image0000001.png")
    assert (first.image.read_bytes(), second.image.read_bytes()) == (IMAGE, png)
    assert first.mask.read_bytes() == second.mask.read_bytes() == MASK
    read = read_lens_file(first.lens)
    assert read.lens == LENS
    assert read.orientation.height == POSE.height
    assert np.array_equal(read.orientation.rotation, POSE.rotation.astype(np.float32))
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


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
        lens_focal_length=FloatList((focal_length,)),
        lens_fov=FloatList((fov,)),
        lens_centre=FloatList(centre),
        lens_k=FloatList(k),
        lens_projection=BytesList((projection,)),
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


def test_renaming_what_nobody_needs_is_refused(tmp_path):
    with pytest.raises(InputError, match="unknown key 'lens/foo'"):
        imported([written(tmp_path / "a", reference_example())], tmp_path / "out", {"lens/foo": "x"})


def test_normalised_lenses_become_those_of_the_image_in_pixels(tmp_path):
    path = written(
        tmp_path / "a",
        reference_example(
            lens_projection=BytesList((b"RECTILINEAR",)),
            lens_focal_length=FloatList((0.75,)),
            lens_centre=FloatList((0.125, -0.25)),
            lens_k=FloatList((0.5, 0.25)),
            lens_fov=FloatList((1.0,)),
        ),
    )
    imported([path], tmp_path / "out", normalised=True, strict=True)
    lens = read_lens_file(tmp_path / "out" / "lens0000000.yaml").lens
    assert lens == Rectilinear(focal_length=24.0, fov=1.0, center=(4.0, -8.0), distortion=(0.5 / 32**2, 0.25 / 32**4))
    unit = Rectilinear(focal_length=0.75, fov=1.0, center=(0.125, -0.25), distortion=(0.5, 0.25))
    scaled = unit.scaled(32.0, (32, 24))
    assert (scaled.focal_length, scaled.distortion) == (lens.focal_length, lens.distortion)


@pytest.mark.parametrize(("focal_length", "normalised", "hint"), [(0.8, False, "with"), (420.0, True, "without")])
def test_lenses_in_the_other_unit_stop_the_import_before_anything_is_written(tmp_path, focal_length, normalised, hint):
    path = written(tmp_path / "a", reference_example(lens_focal_length=FloatList((focal_length,))))
    with pytest.raises(InputError, match=f"a: record 0: lens/focal_length is .*import {hint} --normalised"):
        imported([path], tmp_path / "out", normalised=normalised)
    assert imported([path], tmp_path / "out", normalised=not normalised).count == 1


FAULTS = {
    "lacks mask": {"mask": None},
    "image is neither a JPEG nor a PNG file": {"image": BytesList((b"GIF89a",))},
    "image is not one string of bytes": {"image": BytesList((IMAGE, IMAGE))},
    "image can't be decoded": {"image": BytesList((IMAGE[:20],))},
    "mask can't be decoded": {"mask": BytesList((MASK[:30],))},
    "mask is not a PNG file": {"mask": BytesList((IMAGE,))},
    "mask is not an RGB or RGBA picture": {"mask": BytesList((encoded(".png", np.zeros((24, 32), np.uint8)),))},
    "mask has 30 x 24 px, but the image has 32 x 24 px": {
        "mask": BytesList((encoded(".png", np.zeros((24, 30, 4), np.uint8)),))
    },
    "Hoc is not 16 floats": {"Hoc": FloatList((1.0,) * 12)},
    "camera height must be": {"Hoc": FloatList(tuple(np.eye(4).ravel().tolist()))},
    "lens/fov is not 1 floats": {"lens_fov": Int64List((2,))},
    "lens fov must be": {"lens_fov": FloatList((20.0,))},
    "focal length must be above 0": {"lens_focal_length": FloatList((-1.0,))},
    "unknown lens projection 'FISHEYE'": {"lens_projection": BytesList((b"FISHEYE",))},
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


def test_a_damaged_payload_is_skipped_and_a_file_that_breaks_off_stops_the_import(tmp_path):
    path = written(tmp_path / "a", reference_example(), reference_example(), reference_example())
    data = bytearray(path.read_bytes())
    data[40] ^= 1
    path.write_bytes(data)
    made = imported([path], tmp_path / "out")
    assert made.count == 2
    assert "record 0 is damaged" in made.skipped[0]
    path.write_bytes(data[:-10])
    with pytest.raises(InputError, match="breaks off in record 2"):
        imported([path], tmp_path / "other")
    assert len(find_pictures(tmp_path / "other")) == 1


def test_numbers_go_on_over_all_files(tmp_path):
    files = [written(tmp_path / name, reference_example(), reference_example()) for name in "ab"]
    assert imported(files, tmp_path / "out").count == 4
    numbers = [int(each.number) for each in find_pictures(tmp_path / "out")]
    assert numbers == [0, 1, 2, 3]


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


class Stop(Exception):
    pass


@pytest.mark.parametrize("after", [1, 2, 3, 4])
def test_an_import_that_was_stopped_goes_on(tmp_path, after):
    broken = reference_example(mask=None)
    files = [written(tmp_path / name, reference_example(), broken, reference_example()) for name in "ab"]
    seen = []

    def stop(share):
        seen.append(share)
        if len(seen) == after:
            raise Stop

    with pytest.raises(Stop):
        imported(files, tmp_path / "out", report=stop)
    before = len(find_pictures(tmp_path / "out"))
    made = imported(files, tmp_path / "out")
    assert (made.count, made.there, len(made.skipped)) == (4 - before, before, 2)
    imported(files, tmp_path / "whole")
    assert contents(tmp_path / "out") == contents(tmp_path / "whole")


def test_a_picture_without_one_of_its_files_is_written_again(tmp_path):
    path = written(tmp_path / "a", reference_example(), reference_example())
    imported([path], tmp_path / "out")
    whole = contents(tmp_path / "out")
    for name in ("image0000000.jpg", "lens0000001.yaml"):
        (tmp_path / "out" / name).unlink()
    assert imported([path], tmp_path / "out").count == 2
    assert contents(tmp_path / "out") == whole


def test_files_may_be_appended_to_an_import_but_others_not_put_in_their_place(tmp_path):
    first = written(tmp_path / "first", reference_example())
    second = written(tmp_path / "second", reference_example(), reference_example())
    out = tmp_path / "out"
    assert imported([first], out).count == 1
    made = imported([first, second], out)
    assert (made.count, made.there) == (2, 1)
    assert imported([first], out).there == 1
    assert [each["name"] for each in json.loads((out / "import.json").read_text())["files"]] == ["first", "second"]
    for files, options in (([second], {}), ([second, first], {}), ([first], {"renaming": {"mask": "m"}})):
        with pytest.raises(InputError, match=r"holds an import of other files, or with other options"):
            imported(files, out, **options)


def test_a_folder_of_other_pictures_is_left_alone(tmp_path):
    (tmp_path / "image0000000.jpg").write_bytes(IMAGE)
    with pytest.raises(InputError, match="holds pictures that are of no import"):
        imported([written(tmp_path / "a", reference_example())], tmp_path)


def test_a_damaged_import_json_is_named(tmp_path):
    path = written(tmp_path / "a", reference_example())
    for text in ("{", "[]", "{}", '{"format": 1, "renaming": {}, "normalised": false, "files": 3}'):
        (tmp_path / "import.json").write_text(text)
        with pytest.raises(InputError, match=r"import\.json is damaged"):
            imported([path], tmp_path)


def test_files_that_are_not_there_and_a_folder_that_is_a_file_are_named(tmp_path):
    path = written(tmp_path / "a", reference_example())
    with pytest.raises(InputError, match=r"can't read .*absent"):
        imported([path, tmp_path / "absent"], tmp_path / "out")
    with pytest.raises(InputError, match=r"can't use folder .*a: "):
        imported([path], path)


# The command.


def test_the_command_imports_and_names_what_it_skipped(tmp_path, capsys):
    example = reference_example()
    example["theirs"] = example.pop("lens/fov")
    path = written(tmp_path / "a", example, reference_example(mask=None))
    out = str(tmp_path / "out")
    assert run(parser().parse_args([str(path), out, "--key", "lens/fov=theirs"])) == 0
    said = capsys.readouterr()
    assert said.out == f"{out}: 1 pictures imported, 1 records skipped\n"
    assert said.err.startswith(f"vm-train: skipped {path}: record 1: lacks mask, lens/fov (as 'theirs'); it has 'Hoc'")


def test_the_command_shows_the_first_faults_only_and_fails_if_nothing_was_imported(tmp_path, capsys):
    path = written(tmp_path / "a", *[reference_example(mask=None)] * 23)
    with pytest.raises(InputError, match="no picture could be imported"):
        run(parser().parse_args([str(path), str(tmp_path / "out")]))
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 21
    assert said[-1] == "vm-train: skipped 3 more records"


@pytest.mark.parametrize("key", ["lens/fov", "lens/fov=", "fov=x"])
def test_a_renaming_that_is_none_is_wrong_usage(key, capsys):
    with pytest.raises(SystemExit):
        parser().parse_args(["a", "out", "--key", key])
    assert "OURS=THEIRS" in capsys.readouterr().err
