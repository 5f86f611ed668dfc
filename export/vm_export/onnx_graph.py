"""An ONNX graph that grows node by node, and the model file made from it."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import onnx
from onnx import TensorProto, helper, numpy_helper

from vm_embedded.network.model_file import sealed

_OPSET = 17
_IR_VERSION = 8
"""ONNX Runtime reads this version since 1.12: a robot may have an older one than the workstation."""

FLOAT, UINT8, INT32, BOOL = TensorProto.FLOAT, TensorProto.UINT8, TensorProto.INT32, TensorProto.BOOL

Tensors = dict[str, tuple[int, list[int | str]]]
"""Inputs or outputs of a model by name: element type and shape; a text in a shape names a free dimension."""


class OnnxGraph:
    """The nodes and constants written so far. Each node has one output, and the node is named after it."""

    def __init__(self) -> None:
        self._nodes: list[onnx.NodeProto] = []
        self._constants: dict[str, onnx.TensorProto] = {}

    def constant(self, name: str, value: npt.ArrayLike) -> str:
        """Add a constant, truths and int8 as they are, other integers as int64, other numbers as float32; return its
        name."""
        array = np.asarray(value)
        if array.dtype not in (np.bool_, np.int8):
            array = array.astype(np.int64 if np.issubdtype(array.dtype, np.integer) else np.float32)
        self._constants[name] = numpy_helper.from_array(np.ascontiguousarray(array), name)
        return name

    def node(self, operator: str, inputs: list[str], output: str, **attributes: Any) -> str:
        """Add a node; return the name of its output."""
        self._nodes.append(helper.make_node(operator, inputs, [output], name=output, **attributes))
        return output

    def model(self, inputs: Tensors, outputs: Tensors, metadata: dict[str, str], doc: str) -> bytes:
        """The bytes of a model file with this graph, sealed if it has metadata. The same graph gives the same bytes."""
        takes, gives = (
            [helper.make_tensor_value_info(name, kind, shape) for name, (kind, shape) in each.items()]
            for each in (inputs, outputs)
        )
        model = helper.make_model(
            helper.make_graph(self._nodes, "visual_mesh", takes, gives, list(self._constants.values())),
            opset_imports=[helper.make_opsetid("", _OPSET)],
            ir_version=_IR_VERSION,
            producer_name="vm-export",
            doc_string=doc,
        )
        helper.set_model_props(model, metadata)
        onnx.checker.check_model(model, full_check=True)
        content = bytes(model.SerializeToString(deterministic=True))
        return sealed(content) if metadata else content
