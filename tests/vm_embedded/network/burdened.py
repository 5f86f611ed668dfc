"""Model files that pass every check of their content, but take much time or memory to run."""

from itertools import pairwise

import onnx
from onnx import helper

from tests.fixtures.make_drawn import FOLDER
from vm_embedded.network.canary import CANARY_KEY
from vm_embedded.network.model_file import SEAL_KEY, sealed


def burdened(nodes, initializers=()):
    """The drawn network, with nodes whose result `burden`, a scalar, is added to its answers."""
    model = onnx.load(FOLDER / "ball.onnx")
    graph = model.graph
    for node in graph.node:
        node.output[:] = ["clean" if each == "probabilities" else each for each in node.output]
    graph.node.extend(nodes)
    graph.node.append(helper.make_node("Add", ["clean", "burden"], ["probabilities"]))
    graph.initializer.extend(initializers)
    kept = {each.key: each.value for each in model.metadata_props if each.key not in (SEAL_KEY, CANARY_KEY)}
    helper.set_model_props(model, kept)
    return sealed(model.SerializeToString())


def _product(square, count):
    """Nodes that multiply a matrix with itself again and again, and turn the result to 0."""
    names = [square, *(f"power{number}" for number in range(count))]
    nodes = [helper.make_node("MatMul", [name, square], [after]) for name, after in pairwise(names)]
    zero = helper.make_tensor("zero", onnx.TensorProto.FLOAT, [], [0.0])
    nodes += [
        helper.make_node("ReduceMax", [names[-1]], ["largest"], keepdims=0),
        helper.make_node("Mul", ["largest", "zero"], ["burden"]),
    ]
    return nodes, zero


def endless_on_many_points(count=200):
    """Quick for the points of the self-test, and endless for those of a frame: n x n matrices of n points."""
    nodes, zero = _product("square", count)
    return burdened(
        [
            helper.make_node("Transpose", ["points"], ["transposed"], perm=[1, 0]),
            helper.make_node("MatMul", ["transposed", "points"], ["square_big"]),
            helper.make_node("Mul", ["square_big", "zero"], ["square"]),
            *nodes,
        ],
        [zero],
    )


def endless(side=3000, count=2000):
    """Endless at once."""
    nodes, zero = _product("square", count)
    shape = helper.make_tensor("side", onnx.TensorProto.INT64, [2], [side, side])
    return burdened(
        [
            helper.make_node("ReduceMax", ["points"], ["color"], keepdims=0),
            helper.make_node("Mul", ["color", "zero"], ["nothing"]),
            helper.make_node("Expand", ["nothing", "side"], ["square"]),
            *nodes,
        ],
        [zero, shape],
    )


def huge(mib=3000):
    """Needs so much memory."""
    shape = helper.make_tensor("side", onnx.TensorProto.INT64, [1], [mib * 2**18])
    zero = helper.make_tensor("zero", onnx.TensorProto.FLOAT, [], [0.0])
    return burdened(
        [
            helper.make_node("ReduceMax", ["points"], ["color"], keepdims=0),
            helper.make_node("Expand", ["color", "side"], ["wide"]),
            helper.make_node("ReduceMax", ["wide"], ["largest"], keepdims=0),
            helper.make_node("Mul", ["largest", "zero"], ["burden"]),
        ],
        [shape, zero],
    )
