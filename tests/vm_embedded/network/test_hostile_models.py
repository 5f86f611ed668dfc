"""Model files that were made to hang the runtime, or to show it another network than the one that was checked."""

import base64
import math
import random
import struct
import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper, numpy_helper

from tests.vm_embedded.cli.commands import one_complaint, run
from vm_embedded.errors import ModelError
from vm_embedded.network.bundled import model_path
from vm_embedded.network.look_contract import LOOK_KEY
from vm_embedded.network.model_file import SEAL_KEY, read_model, sealed
from vm_embedded.network.onnx_model import OnnxModel

from .protobuf import varint

onnxruntime = pytest.importorskip("onnxruntime")

LARGE = 0x01520028
"""Where the second network begins, in the file that is two [bytes]: the first bytes of the file are its address."""


def ball():
    return onnx.load(model_path("ball"))


def identity(inputs, outputs, kind):
    """An inner graph that passes its inputs on."""
    nodes = [helper.make_node("Identity", [a], [b]) for a, b in zip(inputs, outputs, strict=True)]
    described = [[helper.make_tensor_value_info(each, kind, None) for each in names] for names in (inputs, outputs)]
    return helper.make_graph(nodes, "inner", *described)


def endless_loop():
    """The last answer goes through a loop whose condition stays true."""
    made = ball()
    last = next(node for node in made.graph.node if "probabilities" in node.output)
    last.output[0] = "before"
    body = identity(["condition", "value"], ["condition_out", "value_out"], TensorProto.FLOAT)
    body.input.insert(0, helper.make_tensor_value_info("number", TensorProto.INT64, []))
    for each in (body.input[1], body.output[0]):
        each.CopyFrom(helper.make_tensor_value_info(each.name, TensorProto.BOOL, []))
    made.graph.initializer.append(numpy_helper.from_array(np.array(True), "yes"))
    made.graph.node.append(helper.make_node("Loop", ["", "yes", "before"], ["probabilities"], body=body))
    return made


def condition():
    made = ball()
    branch = helper.make_graph([], "branch", [], [])
    made.graph.node.append(helper.make_node("If", ["yes"], ["nothing"], then_branch=branch, else_branch=branch))
    return made


def scan():
    made = ball()
    body = identity(["a"], ["b"], TensorProto.FLOAT)
    made.graph.node.append(helper.make_node("Scan", ["points"], ["nothing"], body=body, num_scan_inputs=1))
    return made


def nested_functions():
    """Each function calls the next one twice, so the graph doubles at each of 40 levels."""
    made = ball()
    for level in range(40):
        inner = [helper.make_node(f"F{level + 1}", [a], [b], domain="own") for a, b in ("xy", "yz")]
        opsets = [helper.make_opsetid("own", 1)]
        made.functions.append(helper.make_function("own", f"F{level}", ["x"], ["z"], inner, opsets))
    return made


def training():
    made = ball()
    made.training_info.add()
    return made


@pytest.mark.parametrize(
    ("made", "says"),
    [
        (endless_loop, "inner graph"),
        (condition, "inner graph"),
        (scan, "inner graph"),
        (nested_functions, "functions"),
        (training, "training"),
    ],
)
def test_attack_3_models_that_never_end_are_refused_before_they_are_loaded(made, says, tmp_path):
    path = tmp_path / "model.onnx"
    onnx.save(made(), path)
    with pytest.raises(ModelError, match=rf"model\.onnx: contains .*{says}.*vm-export writes no such file"):
        read_model(path)


def test_attack_3_a_file_of_millions_of_tiny_fields_is_refused(tmp_path):
    path = tmp_path / "model.onnx"
    path.write_bytes(model_path("ball").read_bytes() + b"\x28\x01" * 4_000_000)
    with pytest.raises(ModelError, match="more than 500000 fields"):
        read_model(path)


def doubled(wanted, points):
    """A network of the mesh's kind that gives its points, times a number, as the answer."""
    graph = helper.make_graph(
        [helper.make_node("Mul", ["points", "factor"], ["probabilities"])],
        "test",
        [helper.make_tensor_value_info("points", TensorProto.FLOAT, ["n", points])],
        [helper.make_tensor_value_info("probabilities", TensorProto.FLOAT, ["n", points])],
        [numpy_helper.from_array(np.array(wanted, dtype=np.float32), "factor")],
    )
    made = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    return made.SerializeToString()


def in_both_formats(checked, hidden, folder):
    """A file that is the network `checked` as ONNX, and `hidden` in ONNX Runtime's own format.

    That format begins with the address of its data and the letters ORTM. As ONNX these are unknown fields.
    """
    options = onnxruntime.SessionOptions()
    options.optimized_model_filepath = str(folder / "hidden.ort")
    options.add_session_config_entry("session.save_model_format", "ORT")
    onnxruntime.InferenceSession(hidden, options, providers=["CPUExecutionProvider"])
    data = (folder / "hidden.ort").read_bytes()
    root = struct.unpack("<I", data[:4])[0]
    head = struct.pack("<I", LARGE) + b"ORT" + b"M" + bytes(83)
    start = LARGE - root  # where the data must begin
    # The rest of the file after the ONNX fields is one more unknown field, padded to that place.
    before = len(head) + len(checked) + 1
    length = next(n for n in range(2, 6) if len(varint(start - before - n + len(data))) == n)
    content = bytes(start - before - length) + data
    return head + checked + b"\x7a" + varint(len(content)) + content


def test_attack_7_the_model_that_was_checked_is_the_one_that_runs(tmp_path):
    content = in_both_formats(doubled(1.0, 3), doubled(2.0, 3), tmp_path)
    points = np.ones((2, 3), dtype=np.float32)
    as_before = onnxruntime.InferenceSession(content, providers=["CPUExecutionProvider"])
    assert as_before.run(None, {"points": points})[0][0, 0] == 2.0  # the attack works without the setting
    interface = {"points": ("tensor(float)", [3]), "probabilities": ("tensor(float)", [3])}
    model = OnnxModel("both", content, interface, "probabilities", threads=1, spinning=False)
    assert model.run({"points": points})[0, 0] == 1.0


def test_attack_10_a_damaged_model_prints_nothing_to_standard_output(capfd):
    whole, chance = model_path("ball").read_bytes(), random.Random(3)
    refused = 0
    for _ in range(200):
        content = bytearray(whole)
        content[chance.randrange(4000)] ^= 1 << chance.randrange(8)
        try:
            OnnxModel("damaged", bytes(content), {}, "probabilities", threads=1, spinning=False)
        except ModelError:
            refused += 1
    assert refused == 200  # also the readable ones: they have other inputs than {}
    assert capfd.readouterr() == ("", "")


def test_threads_that_load_models_leave_standard_output_alone():
    content, before, during = model_path("ball").read_bytes(), sys.stdout, set()

    def load():
        for _ in range(3):
            with pytest.raises(ModelError, match="its manifest asks for"):
                OnnxModel("ball", content, {}, "probabilities", threads=1, spinning=False)

    with ThreadPoolExecutor(3) as threads:
        loads = [threads.submit(load) for _ in range(3)]
        while not all(each.done() for each in loads):
            during.add(sys.stdout)
    for each in loads:
        each.result()
    assert {*during, sys.stdout} == {before}


def weights_of(model, key):
    """A network of a model file, by its key in the metadata; None: the mesh network itself."""
    if key is None:
        return model, lambda: None
    entry = next(each for each in model.metadata_props if each.key == key)
    inner = onnx.load_from_string(base64.b64decode(entry.value))

    def store():
        entry.value = base64.b64encode(inner.SerializeToString()).decode()

    return inner, store


@pytest.mark.parametrize("value", [0.0, math.nan, None], ids=["zero", "NaN", "random"])
@pytest.mark.parametrize("key", [None, LOOK_KEY])
def test_attack_1_a_network_with_other_weights_is_refused_by_vm_detect(key, value, tmp_path):
    made = ball()
    network, store = weights_of(made, key)
    for each in network.graph.initializer:
        if each.data_type == TensorProto.FLOAT and "kernel" in each.name:
            shape = numpy_helper.to_array(each).shape
            new = np.random.default_rng(0).random(shape) if value is None else np.full(shape, value)
            each.CopyFrom(numpy_helper.from_array(new.astype(np.float32), each.name))
    store()
    path = tmp_path / "model.onnx"
    onnx.save(made, path)
    one_complaint(run("--check-config", "--model", path, code=1), str(path), "its checksum is wrong")


def test_a_file_is_sealed_once_and_its_seal_covers_all_else():
    content = model_path("ball").read_bytes()
    model = onnx.load_from_string(content)
    seal = model.metadata_props.pop()
    assert seal.key == SEAL_KEY
    assert sealed(model.SerializeToString(deterministic=True)) == content
