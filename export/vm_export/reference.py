"""Networks of the reference implementation: its YAML files, read and written.

The file: `geometry: {shape, radius, intersections}`, `mesh`, optional `class_map`, and `network`, a list of
convolutions, each a list of `{weights [in][out], biases, activation}` of which the first gathers and further ones are
dense. Its networks read four channels; the fourth, alpha, has zero weights.
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

from vm_embedded.errors import InputError, VisualMeshError, one_line, unknown
from vm_embedded.files import atomic_write
from vm_embedded.mesh.models import MESH_MODELS
from vm_embedded.network.manifest import Manifest, ObjectClass

from .checkpoint import Checkpoint
from .network import Dense, GraphConvolution, Network, SeparableConvolution
from .network_shape import Layer, NetworkShape
from .second_look import SecondLook

DEFAULT_CLASSES = ("ball", "goal", "line", "field", "environment")
"""The order of the authors' own networks, for files without a class_map and five outputs."""

_MESHES = tuple(name for name in MESH_MODELS if name not in ("cap6", "wall6"))
"""The reference's own."""

_MAX_DISTANCE = 20.0
"""How far out [m] the reference's own configuration lets the mesh reach; its files don't say."""

KIND_OF = {
    "ball": "object",
    "goal": "upright",
    "robot": "upright",
    "line": "area",
    "field": "area",
    "environment": "background",
    "unlabelled": "background",
}
"""What classes with the field's usual names are."""


@dataclass(frozen=True, kw_only=True)
class Overrides:
    """What a user knows better than a reference file; None leaves the file's own entry. Lengths in [m]."""

    intersections: float | None = None
    radius: float | None = None
    object_radius: float | None = None
    max_distance: float | None = None
    edge: str | None = None
    classes: tuple[ObjectClass, ...] | None = None

    def applied(self, checkpoint: Checkpoint) -> Checkpoint:
        """A checkpoint with these entries in its manifest."""
        given = {each.name: getattr(self, each.name) for each in fields(self)}
        changed = {name: value for name, value in given.items() if value is not None}
        return replace(checkpoint, manifest=replace(checkpoint.manifest, **changed))


def named_class(name: str, kind: str | None = None) -> ObjectClass:
    """A class by name; its kind is known for the field's usual names. Raises InputError for others without a kind."""
    if kind is None and name not in KIND_OF:
        raise InputError(f"say what class {name!r} is, e.g. {name}:area (object, upright, area or background)")
    return ObjectClass(name, kind or KIND_OF[name])


def read_reference(path: str | Path, overrides: Overrides) -> Checkpoint:
    """A network that the reference implementation exported. Raises InputError saying what is wrong in the file."""
    path = Path(path)
    try:
        text = path.read_bytes()
        data = yaml.load(text, Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader))
    except OSError as error:
        raise InputError(f"can't read {path}: {error.strerror or error}") from error
    except (yaml.YAMLError, UnicodeDecodeError, RecursionError, ValueError) as error:
        raise InputError(f"{path} is not YAML: {one_line(error)}") from error
    try:
        return _checkpoint(data, overrides, {"made_from": path.name, "sha256": hashlib.sha256(text).hexdigest()})
    except (KeyError, TypeError, AttributeError) as error:
        raise InputError(f"{path} is not a network of the reference: {error!r}") from error
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
        raise InputError(f"intersections {intersections:g} in the file can't be right; give --intersections")
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
    return overrides.applied(Checkpoint(network.eval(), manifest))


def _classes(class_map: object, outputs: int) -> tuple[ObjectClass, ...]:
    """Classes of a file: its class_map, a list of names or a table of positions, else the authors' own order."""
    if class_map is None:
        if outputs != len(DEFAULT_CLASSES):
            raise InputError(f"the file names no classes and has {outputs} outputs; give --classes")
        return tuple(named_class(name) for name in DEFAULT_CLASSES)
    if isinstance(class_map, Mapping):
        named = {int(position): str(name) for name, position in class_map.items()}
        if sorted(named) != list(range(outputs)):
            raise InputError(
                f"class_map {dict(class_map)} does not number the {outputs} outputs from 0; give --classes"
            )
        return tuple(named_class(named[position]) for position in range(outputs))
    if isinstance(class_map, Sequence) and not isinstance(class_map, str):
        names = [str(each["name"] if isinstance(each, Mapping) else each) for each in class_map]
        return tuple(named_class(name) for name in names)
    raise InputError(f"class_map {class_map!r} can't be read; give --classes")


def _network(convolutions: Sequence[Sequence[Mapping[str, Any]]], neighbors: int) -> Network:
    """The network with its weights."""
    layers: list[Layer] = []
    kernels: list[tuple[np.ndarray, np.ndarray]] = []
    for group in convolutions:
        for position, entry in enumerate(group):
            kernel = np.array(entry["weights"], dtype=np.float64)
            bias = np.array(entry["biases"], dtype=np.float64)
            if kernel.ndim != 2 or bias.shape != kernel.shape[1:] or not np.isfinite(kernel).all():
                raise InputError(f"layer {len(layers)}: weights and biases do not fit, or are not finite")
            if not layers:
                kernel = _without_alpha(kernel, neighbors)
            kind = "dense" if position else "convolution"
            inputs = layers[-1].width if layers else 3
            rows = inputs * (1 if position else neighbors + 1)
            if kernel.shape[0] != rows:
                raise InputError(f"layer {len(layers)}: {kernel.shape[0]} rows of weights, should be {rows}")
            layers.append(Layer(kind, kernel.shape[1], str(entry["activation"]).lower()))
            kernels.append((kernel, bias))
    network = Network(NetworkShape(tuple(layers), neighbors))
    with torch.no_grad():
        for layer, (kernel, bias) in zip(network.layers, kernels, strict=True):
            assert isinstance(layer, GraphConvolution | Dense)
            layer.linear.weight.copy_(torch.from_numpy(kernel.T))
            layer.linear.bias.copy_(torch.from_numpy(bias))
    return network


def _without_alpha(kernel: np.ndarray, neighbors: int) -> np.ndarray:
    """The first layer's kernel for three channels. Raises InputError if it needs the fourth."""
    if kernel.shape[0] == 3 * (neighbors + 1):
        return kernel
    if kernel.shape[0] != 4 * (neighbors + 1):
        raise InputError(f"layer 0: {kernel.shape[0]} rows of weights fit neither 3 nor 4 channels")
    channels = kernel.reshape(neighbors + 1, 4, -1)
    if np.abs(channels[:, 3]).max() > 1e-6:
        raise InputError("layer 0: the fourth input channel has weights; only networks that read colors are supported")
    return channels[:, :3].reshape(3 * (neighbors + 1), -1)


def write_reference(checkpoint: Checkpoint, path: str | Path) -> None:
    """Write a checkpoint in the reference's format.

    Separable convolutions are multiplied out, and the fourth channel gets its zero weights back. Raises InputError.
    """
    network, manifest = checkpoint.network, checkpoint.manifest
    if isinstance(network, SecondLook):
        raise InputError("the reference's format is for one network; this one has a second look")
    if (manifest.sampling, manifest.colors) != ("bilinear", "absolute"):
        kind = f"{manifest.sampling} points and {manifest.colors} colors"
        raise InputError(f"the reference's networks take bilinear points and absolute colors; this one takes {kind}")
    if manifest.object_height or manifest.mesh not in _MESHES:
        raise InputError(
            f"the reference's format has no cylinders and no meshes but its own; this network is for {manifest.mesh}, "
            f"shape {manifest.shape}"
        )
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
    """A layer's kernel (inputs, outputs) and bias (outputs,), of separable ones multiplied out."""
    assert isinstance(layer, GraphConvolution | SeparableConvolution | Dense)
    kernel = layer.linear.weight.detach().double().numpy().T
    if isinstance(layer, SeparableConvolution):
        full = layer.depthwise.detach().double().numpy()[:, :, None] * kernel
        kernel = full.reshape(-1, full.shape[2])
    return kernel, layer.linear.bias.detach().double().numpy()
