"""An ONNX graph that is written node by node."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import onnx
from onnx import TensorProto, helper, numpy_helper

_OPSETS = {"": 17, "ai.onnx.ml": 3}
_IR_VERSION = 8
"""What ONNX Runtime has read since 1.12: a robot's may be older than the workstation's."""

FLOAT, INT32, INT64, BOOL = TensorProto.FLOAT, TensorProto.INT32, TensorProto.INT64, TensorProto.BOOL


class Graph:
    """Nodes and constants so far. Each node has one output, and its output's name."""

    def __init__(self) -> None:
        self._nodes: list[onnx.NodeProto] = []
        self._constants: dict[str, onnx.TensorProto] = {}

    def constant(self, name: str, value: npt.ArrayLike) -> str:
        """Name of a constant. Whole numbers become int64, all others float32."""
        array = np.asarray(value)
        kind = np.int64 if np.issubdtype(array.dtype, np.integer) else np.float32
        self._constants[name] = numpy_helper.from_array(np.ascontiguousarray(array, dtype=kind), name)
        return name

    def node(self, operator: str, inputs: list[str], output: str, domain: str = "", **attributes: Any) -> str:
        """Name of a new node's output."""
        self._nodes.append(helper.make_node(operator, inputs, [output], name=output, domain=domain, **attributes))
        return output

    def model(
        self,
        inputs: dict[str, tuple[int, list[int | str]]],
        outputs: dict[str, tuple[int, list[int | str]]],
        metadata: dict[str, str],
        doc: str,
    ) -> bytes:
        """The bytes of a model file, the same for the same graph; inputs and outputs by name: type and shape."""
        takes, gives = (
            [helper.make_tensor_value_info(name, kind, shape) for name, (kind, shape) in each.items()]
            for each in (inputs, outputs)
        )
        domains = sorted({node.domain for node in self._nodes})
        model = helper.make_model(
            helper.make_graph(self._nodes, "visual_mesh", takes, gives, list(self._constants.values())),
            opset_imports=[helper.make_opsetid(domain, _OPSETS[domain]) for domain in domains],
            ir_version=_IR_VERSION,
            producer_name="vm-export",
            doc_string=doc,
        )
        helper.set_model_props(model, metadata)
        onnx.checker.check_model(model, full_check=True)
        return bytes(model.SerializeToString(deterministic=True))
