"""Reads and writes networks in the format of the reference implementation, a YAML file.

The file has `geometry: {shape, radius, intersections}`, `mesh`, optionally `class_map`, and `network`, a list of groups
of layers. A layer is `{weights [in][out], biases, activation}`. The first layer of a group is a graph convolution, and
the others are dense. The networks read four channels; the fourth one, alpha, has zero weights.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
import yaml
from torch import nn

from vm_embedded.borders.text import name_fault, printable
from vm_embedded.errors import InputError, VisualMeshError, one_line, unknown
from vm_embedded.files import atomic_write, read_bytes
from vm_embedded.mesh.models import MESH_MODELS
from vm_embedded.network.manifest import Manifest, ObjectClass

from .checkpoint import Checkpoint
from .network import Dense, GraphConvolution, Network, SeparableConvolution
from .network_shape import Layer, NetworkShape

DEFAULT_CLASSES = ("ball", "goal", "line", "field", "environment")
"""The classes of a file that has five outputs and no class_map: those of the reference's networks, in their order."""

_MESHES = tuple(name for name in MESH_MODELS if name not in ("cap6", "wall6"))
"""The mesh models of the reference."""

_MAX_DISTANCE = 20.0
"""The max_distance [m] in the reference's configuration; its network files do not have it."""

USUAL_KINDS = {
    "ball": "object",
    "goal": "upright",
    "robot": "upright",
    "line": "area",
    "field": "area",
    "environment": "background",
    "unlabelled": "background",
}
"""The kinds of classes with usual names."""


@dataclass(frozen=True, kw_only=True)
class Overrides:
    """Entries of a manifest that replace those of a file; None keeps the entry of the file. Lengths in [m]."""

    intersections: float | None = None
    radius: float | None = None
    object_radius: float | None = None
    max_distance: float | None = None
    edge: str | None = None
    classes: tuple[ObjectClass, ...] | None = None

    def apply_to(self, checkpoint: Checkpoint) -> Checkpoint:
        """The checkpoint with these entries in its manifest. Raises ModelError for wrong ones."""
        given = {each.name: getattr(self, each.name) for each in fields(self)}
        changed = {name: value for name, value in given.items() if value is not None}
        return replace(checkpoint, manifest=replace(checkpoint.manifest, **changed))


def named_class(name: str, kind: str | None = None) -> ObjectClass:
    """A class by name; without a kind the name must be one of USUAL_KINDS.

    Raises InputError, also for a name that can't be printed or is too long.
    """
    if fault := name_fault(name):
        raise InputError(f"the name of class {name!r} {fault}")
    if kind is None and name not in USUAL_KINDS:
        raise InputError(f"class {name!r} needs a kind: object, upright, area or background, as in {name}:area")
    return ObjectClass(name, kind or USUAL_KINDS[name])


def read_reference(path: str | Path, overrides: Overrides) -> Checkpoint:
    """Read a network that the reference implementation exported. Raises InputError."""
    path = Path(path)
    text = read_bytes(path)
    try:
        data = yaml.load(text, Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader))
    except (yaml.YAMLError, UnicodeDecodeError, RecursionError, ValueError) as error:
        raise InputError(f"{path} is not YAML: {one_line(error)}") from error
    lacking = [each for each in ("geometry", "mesh", "network") if not isinstance(data, Mapping) or each not in data]
    if lacking:
        raise InputError(f"{path} is not a network of the reference implementation: it lacks {', '.join(lacking)}")
    try:
        provenance = {"made_from": printable(path.name), "sha256": hashlib.sha256(text).hexdigest()}
        return _checkpoint(data, overrides, provenance)
    except KeyError as error:
        raise InputError(f"{path}: a part of the network lacks its {error.args[0]}; the file may be damaged") from error
    except (TypeError, AttributeError, ValueError, OverflowError) as error:
        raise InputError(f"{path} is damaged, or no network of the reference: {one_line(error)}") from error
    except VisualMeshError as error:
        raise InputError(f"{path}: {error}") from error


def _checkpoint(data: Mapping[str, Any], overrides: Overrides, provenance: dict[str, str]) -> Checkpoint:
    geometry, model = data["geometry"], str(data["mesh"]).lower()
    if model not in _MESHES:
        raise InputError(unknown("mesh", model, _MESHES))
    network = _network(data["network"], MESH_MODELS[model].neighbors)
    radius = float(geometry["radius"]) if overrides.radius is None else overrides.radius
    intersections = float(geometry["intersections"])
    if intersections < 1.0 and overrides.intersections is None:
        raise InputError(
            f"the file has {intersections:g} intersections, but at least 1 is needed; give --intersections"
        )
    manifest = Manifest(
        shape=str(geometry["shape"]).lower(),
        radius=radius,
        object_radius=radius,
        intersections=intersections,
        mesh=model,
        max_distance=_MAX_DISTANCE,
        edge="hard",
        classes=overrides.classes or _classes(data.get("class_map"), network.shape.classes),
        provenance=provenance,
    )
    return overrides.apply_to(Checkpoint(network.eval(), manifest))


def _classes(class_map: object, outputs: int) -> tuple[ObjectClass, ...]:
    """The classes of a file, from its class_map (a list of names or a table of positions) or DEFAULT_CLASSES."""
    if class_map is None:
        if outputs != len(DEFAULT_CLASSES):
            raise InputError(f"the file has {outputs} outputs but no names of classes; give --classes")
        return tuple(named_class(name) for name in DEFAULT_CLASSES)
    if isinstance(class_map, Mapping):
        named = {int(position): str(name) for name, position in class_map.items()}
        if sorted(named) != list(range(outputs)):
            raise InputError(f"class_map {dict(class_map)} must number the {outputs} outputs from 0; give --classes")
        return tuple(named_class(named[position]) for position in range(outputs))
    if isinstance(class_map, Sequence) and not isinstance(class_map, str):
        names = [str(each["name"] if isinstance(each, Mapping) else each) for each in class_map]
        return tuple(named_class(name) for name in names)
    raise InputError(f"class_map {class_map!r} must be a list of names or a table of positions; give --classes")


def _network(convolutions: Sequence[Sequence[Mapping[str, Any]]], neighbors: int) -> Network:
    """The network of a file, with its weights, for a mesh of `neighbors` neighbors."""
    layers: list[Layer] = []
    kernels: list[tuple[np.ndarray, np.ndarray]] = []
    for group in convolutions:
        for position, entry in enumerate(group):
            kernel, bias = (_numbers(entry, part, len(layers)) for part in ("weights", "biases"))
            if kernel.ndim != 2 or bias.shape != kernel.shape[1:] or not np.isfinite(kernel).all():
                raise InputError(f"layer {len(layers)}: weights and biases do not fit each other, or are not finite")
            if not layers:
                kernel = _without_alpha(kernel, neighbors)
            kind = "dense" if position else "convolution"
            inputs = layers[-1].width if layers else 3
            rows = inputs * (1 if position else neighbors + 1)
            if kernel.shape[0] != rows:
                raise InputError(f"layer {len(layers)} has {kernel.shape[0]} rows of weights, but needs {rows}")
            layers.append(Layer(kind, kernel.shape[1], str(entry["activation"]).lower()))
            kernels.append((kernel, bias))
    network = Network(NetworkShape(tuple(layers), neighbors))
    with torch.no_grad():
        for layer, (kernel, bias) in zip(network.layers, kernels, strict=True):
            assert isinstance(layer, GraphConvolution | Dense)
            layer.linear.weight.copy_(torch.from_numpy(kernel.T))
            layer.linear.bias.copy_(torch.from_numpy(bias))
    return network


def _numbers(entry: Mapping[str, Any], part: str, layer: int) -> np.ndarray:
    """The weights or biases of a layer. Raises InputError for rows of different lengths, and for text."""
    try:
        return np.array(entry[part], dtype=np.float64)
    except ValueError as error:
        raise InputError(f"the {part} of layer {layer} must be numbers, in rows of equal length") from error


def _without_alpha(kernel: np.ndarray, neighbors: int) -> np.ndarray:
    """The kernel of the first layer for three channels. Raises InputError if it has weights for the fourth."""
    if kernel.shape[0] == 3 * (neighbors + 1):
        return kernel
    if kernel.shape[0] != 4 * (neighbors + 1):
        raise InputError(f"layer 0 has {kernel.shape[0]} rows of weights, which fit neither 3 nor 4 channels")
    channels = kernel.reshape(neighbors + 1, 4, -1)
    if np.abs(channels[:, 3]).max() > 1e-6:
        raise InputError(
            "layer 0 has weights for the fourth input channel; only networks for three channels are supported"
        )
    return channels[:, :3].reshape(3 * (neighbors + 1), -1)


def write_reference(checkpoint: Checkpoint, path: str | Path) -> None:
    """Write a checkpoint in the reference's format.

    Separable convolutions become full ones, and the fourth channel gets zero weights. Raises InputError for a network
    that the format can't describe, or if the file can't be written.
    """
    network, manifest = checkpoint.network, checkpoint.manifest
    if (manifest.sampling, manifest.colors) != ("bilinear", "absolute"):
        kind = f"{manifest.sampling} points and {manifest.colors} colors"
        raise InputError(f"networks of the reference take bilinear points and absolute colors; this one takes {kind}")
    if manifest.object_height or manifest.mesh not in _MESHES:
        raise InputError(
            f"the format of the reference has no shape {manifest.shape} with mesh {manifest.mesh}; it has circles and "
            f"spheres with one of the meshes {', '.join(_MESHES)}"
        )
    assert isinstance(network, Network)  # other meshes are refused above
    neighbors = network.shape.neighbors
    groups: list[list[dict[str, Any]]] = []
    for spec, layer in zip(network.shape.layers, network.layers, strict=True):
        kernel, bias = _kernel(layer)
        if not groups:
            colors = kernel.reshape(neighbors + 1, 3, -1)
            kernel = np.concatenate([colors, np.zeros_like(colors[:, :1])], axis=1).reshape(4 * (neighbors + 1), -1)
        entry = {"weights": kernel.tolist(), "biases": bias.tolist(), "activation": spec.activation}
        if spec.kind == "dense":
            groups[-1].append(entry)
        else:
            groups.append([entry])
    data = {
        "geometry": {
            "shape": manifest.shape.upper(),
            "radius": manifest.radius,
            "intersections": manifest.intersections,
        },
        "mesh": manifest.mesh.upper(),
        "class_map": {each.name: position for position, each in enumerate(manifest.classes)},
        "network": groups,
    }
    with atomic_write(Path(path)) as part, part.open("w") as file:
        yaml.dump(data, file, Dumper=getattr(yaml, "CSafeDumper", yaml.SafeDumper), width=10**6)


def _kernel(layer: nn.Module) -> tuple[np.ndarray, np.ndarray]:
    """Kernel (inputs, outputs) and bias (outputs,) of a layer; a separable convolution becomes a full one."""
    assert isinstance(layer, GraphConvolution | SeparableConvolution | Dense)
    kernel = layer.linear.weight.detach().double().numpy().T
    if isinstance(layer, SeparableConvolution):
        full = layer.depthwise.detach().double().numpy()[:, :, None] * kernel
        kernel = full.reshape(-1, full.shape[2])
    return kernel, layer.linear.bias.detach().double().numpy()
