import hashlib
import json

import numpy as np
import onnx
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from onnx import TensorProto, helper, numpy_helper

from tests.manifests import ball_manifest
from vm_embedded.errors import ModelError
from vm_embedded.network.manifest import METADATA_KEY, Manifest, ObjectClass
from vm_embedded.network.model_file import read_content, read_model, sealed

from ..strategies import attempt
from .protobuf import varint

MANIFEST = ball_manifest(provenance={"made by": "a test"})

FLOAT = TensorProto.FLOAT


def inside(name="weight"):
    return numpy_helper.from_array(np.ones(3, dtype=np.float32), name)


def outside(name="weight", location="secret.bin"):
    """A tensor whose numbers are in another file."""
    tensor = TensorProto(name=name, data_type=FLOAT, dims=[3], data_location=TensorProto.EXTERNAL)
    tensor.external_data.add(key="location", value=location)
    return tensor


def model(nodes=None, initializers=(), metadata=None, **parts):
    """A small model that adds a weight to the points."""
    graph = helper.make_graph(
        nodes or [helper.make_node("Add", ["points", "weight"], ["probabilities"])],
        "test",
        [helper.make_tensor_value_info("points", FLOAT, ["n", 3])],
        [helper.make_tensor_value_info("probabilities", FLOAT, ["n", 3])],
        initializers,
    )
    made = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8, **parts)
    helper.set_model_props(made, {METADATA_KEY: MANIFEST.as_json()} if metadata is None else metadata)
    return made


VALID = sealed(model(initializers=[inside()]).SerializeToString())


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("models")


@pytest.fixture
def write(folder):
    def written(content):
        path = folder / "model.onnx"
        path.write_bytes(content if isinstance(content, bytes) else content.SerializeToString())
        return path

    return written


def test_a_model_is_read_with_its_manifest_and_checksum(write):
    path = write(VALID)
    found = read_model(path)
    assert found.path == path
    assert found.content == VALID
    assert found.manifest == MANIFEST
    assert found.sha256 == hashlib.sha256(VALID).hexdigest()
    assert read_model(str(path)).manifest == MANIFEST


def test_the_model_of_these_tests_is_valid_onnx():
    onnx.checker.check_model(onnx.load_from_string(VALID), full_check=True)


def test_other_metadata_does_not_matter(write):
    metadata = {"author": "somebody", METADATA_KEY: MANIFEST.as_json(), "zzz": "ü"}
    content = sealed(model(initializers=[inside()], metadata=metadata).SerializeToString())
    assert read_model(write(content)).manifest == MANIFEST


def test_a_model_of_an_older_release_without_a_checksum_is_refused_with_advice(write):
    with pytest.raises(ModelError, match=r"model\.onnx: has no checksum.*export it again"):
        read_model(write(model(initializers=[inside()])))


def test_a_model_of_the_exporter_is_read(write):
    torch = pytest.importorskip("torch")
    from vm_export.export import onnx_model
    from vm_export.network import Network
    from vm_export.network_shape import NetworkShape

    torch.manual_seed(0)
    network = Network(NetworkShape.uniform(depth=2, width=4, classes=2)).eval()
    classes = (ObjectClass("ball", "object"), ObjectClass("other", "background"))
    manifest = Manifest.from_json(
        json.dumps(json.loads(MANIFEST.as_json()) | {"classes": [vars(each) for each in classes]})
    )
    content = onnx_model(network, manifest)
    assert read_model(write(content)).manifest == manifest


def test_a_missing_file_is_named(folder):
    with pytest.raises(ModelError, match=r"none\.onnx.*No such file"):
        read_model(folder / "none.onnx")


def test_a_folder_is_no_model(folder):
    with pytest.raises(ModelError, match="can't read"):
        read_model(folder)


def test_a_checkpoint_comes_with_the_command_that_exports_it(write):
    with pytest.raises(ModelError, match=r"not an ONNX file; vm-export .*model\.onnx writes one, if this is a trained"):
        read_model(write(b"PK\x03\x04 a file of torch"))
    yaml = write(b"").with_suffix(".yaml")
    yaml.write_bytes(b"network: []")
    with pytest.raises(ModelError, match=r"not an ONNX file; vm-export .*model\.yaml writes one"):
        read_model(yaml)


def test_an_empty_file_is_refused(write):
    with pytest.raises(ModelError, match=r"model\.onnx: not an ONNX file"):
        read_model(write(b""))


def test_a_large_file_is_refused_with_both_sizes_before_it_is_read(folder):
    path = folder / "large.onnx"
    with path.open("wb") as file:
        file.truncate(65 * 2**20)
    with pytest.raises(ModelError, match=rf"large\.onnx: it is too large: {65 * 2**20} bytes; at most {64 * 2**20} "):
        read_model(path)


def test_the_size_limit_itself_is_allowed(folder):
    path = folder / "large.onnx"
    with path.open("wb") as file:
        file.truncate(64 * 2**20)
    assert len(read_content(path)) == 64 * 2**20


def test_a_model_without_a_manifest_is_refused(write):
    for metadata in ({}, {"author": "somebody"}):
        with pytest.raises(ModelError, match=r"model\.onnx: no Visual Mesh manifest.*vm-export"):
            read_model(write(model(initializers=[inside()], metadata=metadata)))


@pytest.mark.parametrize(
    ("manifest", "says"),
    [
        ("", "not JSON"),
        ("{}", "version"),
        ("[]", "not a JSON object"),
        (MANIFEST.as_json().replace("ring6", "ring5"), "ring5"),
    ],
)
def test_a_model_with_a_wrong_manifest_is_refused_by_file_and_fault(write, manifest, says):
    with pytest.raises(ModelError, match=rf"model\.onnx: .*{says}"):
        read_model(write(model(initializers=[inside()], metadata={METADATA_KEY: manifest})))


def test_metadata_that_is_not_text_is_refused(write):
    content = VALID.replace(b"visual_mesh", b"visual\xff\xfe\xfdsh")
    with pytest.raises(ModelError, match="not text"):
        read_model(write(content))


@given(st.binary(max_size=300))
def test_random_bytes_are_refused(folder, content):
    path = folder / "random.onnx"
    path.write_bytes(content)
    with pytest.raises(ModelError, match=r"random\.onnx"):
        read_model(path)


@pytest.mark.parametrize("content", [b"\x89PNG\r\n\x1a\n" + bytes(64), b"PK\x03\x04" + bytes(64), b"model: ball\n" * 9])
def test_files_of_other_kinds_are_refused(write, content):
    with pytest.raises(ModelError, match="not an ONNX file"):
        read_model(write(content))


def test_a_model_cut_short_anywhere_is_refused(folder):
    path = folder / "short.onnx"
    for length in range(len(VALID)):
        path.write_bytes(VALID[:length])
        with pytest.raises(ModelError, match=r"short\.onnx"):
            read_model(path)


ADD = helper.make_node("Add", ["points", "weight"], ["probabilities"])


def in_sparse(tensor):
    made = model(initializers=[inside()])
    sparse = made.graph.sparse_initializer.add(dims=[9])
    sparse.values.CopyFrom(tensor)
    sparse.indices.CopyFrom(numpy_helper.from_array(np.arange(3), "indices"))
    return made


def in_sparse_indices(tensor):
    made = in_sparse(inside())
    made.graph.sparse_initializer[0].indices.CopyFrom(tensor)
    return made


def in_attribute(name):
    def made(tensor):
        node = helper.make_node("Own", ["points"], ["probabilities"], domain="own")
        attribute = node.attribute.add(name="hidden")
        if name == "tensors":
            attribute.tensors.append(tensor)
        elif name == "sparse_tensor":
            attribute.sparse_tensor.values.CopyFrom(tensor)
        else:
            attribute.sparse_tensors.add().indices.CopyFrom(tensor)
        return model([node])

    return made


PLACES = {
    "initializer": lambda tensor: model(initializers=[inside("other"), tensor]),
    "constant": lambda tensor: model([helper.make_node("Constant", [], ["weight"], value=tensor), ADD]),
    "sparse initializer": in_sparse,
    "sparse indices": in_sparse_indices,
    **{f"attribute {name}": in_attribute(name) for name in ("tensors", "sparse_tensor", "sparse_tensors")},
}


@pytest.mark.parametrize("place", PLACES.values(), ids=PLACES)
def test_external_data_is_refused_wherever_it_hides(write, place):
    with pytest.raises(ModelError, match=r"model\.onnx: .*external data.*one file"):
        read_model(write(place(outside())))


@pytest.mark.parametrize("place", PLACES.values(), ids=PLACES)
def test_data_inside_of_the_file_is_accepted_in_the_same_places(write, place):
    assert read_model(write(sealed(place(inside()).SerializeToString()))).manifest == MANIFEST


def test_external_data_as_the_onnx_package_saves_it_is_refused(folder):
    path = folder / "saved.onnx"
    large = numpy_helper.from_array(np.ones(3000, dtype=np.float32), "weight")
    onnx.save(model(initializers=[large]), path, save_as_external_data=True, location="saved.bin", size_threshold=10)
    assert (folder / "saved.bin").stat().st_size >= 12000
    with pytest.raises(ModelError, match="external data"):
        read_model(path)


def test_a_place_alone_or_a_mark_alone_is_refused(write):
    """Readers differ in which of the two they go by."""
    marked = inside()
    marked.data_location = TensorProto.EXTERNAL
    placed = inside()
    placed.external_data.add(key="location", value="secret.bin")
    for tensor in (marked, placed):
        with pytest.raises(ModelError, match="external data"):
            read_model(write(model(initializers=[tensor])))


def field(number, content, tag_offset=0):
    """A field of a message: bytes, or a whole number."""
    if isinstance(content, int):
        return varint((number << 3) + tag_offset) + varint(content)
    return varint((number << 3 | 2) + tag_offset) + varint(len(content)) + content


def hidden_by(tag_offset):
    """A model whose weight is external, the two fields that say so written with other numbers."""
    entry = field(1, b"location") + field(2, b"secret.bin")
    tensor = field(1, 3) + field(2, FLOAT) + field(8, b"weight")
    tensor += field(13, entry, tag_offset) + field(14, TensorProto.EXTERNAL, tag_offset)
    made = model()
    graph = made.graph.SerializeToString() + field(5, tensor)
    made.ClearField("graph")
    return made.SerializeToString() + field(7, graph)


@pytest.mark.parametrize("bits", [32, 33, 34])
def test_field_numbers_of_more_than_32_bits_are_refused(write, bits):
    """Other readers of the format cut them to 32 bits, so they would see external data where none seems to be."""
    with pytest.raises(ModelError):
        read_model(write(hidden_by(1 << bits)))


def test_external_data_in_the_same_words_is_refused(write):
    with pytest.raises(ModelError, match="external data"):
        read_model(write(hidden_by(0)))


def test_a_graph_in_two_pieces_is_looked_through_in_both(write):
    """A message that comes twice is put together by its readers."""
    second = onnx.GraphProto(initializer=[outside("late")]).SerializeToString()
    with pytest.raises(ModelError, match="external data"):
        read_model(write(VALID + field(7, second)))


@pytest.mark.parametrize(
    "tail", [b"\x3a", b"\x3a\xff\xff\xff\xff\xff\xff\xff\xff\xff\x01", b"\xff" * 20, b"\x3b", b"\x3a\x05ab"]
)
def test_a_damaged_tail_is_refused(write, tail):
    with pytest.raises(ModelError, match="not an ONNX file"):
        read_model(write(VALID + tail))


@st.composite
def mutations(draw):
    """VALID with some bytes changed, taken out, put in or doubled."""
    content = bytearray(VALID)
    for _ in range(draw(st.integers(1, 4))):
        at = draw(st.integers(0, max(len(content) - 1, 0)))
        length = draw(st.integers(1, 40))
        kind = draw(st.sampled_from(["change", "take out", "put in", "double"]))
        if kind == "change" and content:
            content[at] = draw(st.integers(0, 255))
        elif kind == "take out":
            del content[at : at + length]
        elif kind == "put in":
            content[at:at] = draw(st.binary(min_size=1, max_size=8))
        else:
            content[at:at] = content[at : at + length]
    return bytes(content)


@given(mutations())
@example(VALID.replace(b'"name": "ball"', b'"name": [9999]'))
@example(VALID.replace(b'"radius": 0.1', b'"radius":   []'))
def test_a_damaged_model_raises_nothing_but_model_error(folder, content):
    path = folder / "damaged.onnx"
    path.write_bytes(content)
    found = attempt(ModelError, read_model, path)
    if isinstance(found, ModelError):
        assert str(path) in str(found)
    else:
        assert found.content == content
        assert found.manifest.neighbors in (4, 6, 8)
