"""Configurations: vm.toml and train.toml."""

from vm_embedded.config.sections import read_sections
from vm_embedded.errors import VisualMeshError
from vm_embedded.live.configuration import read_configuration
from vm_train.learning.configuration import TrainConfiguration

from .scratch import scratch


def run(data: bytes) -> None:
    path = scratch("vm.toml")
    path.write_bytes(data)
    refusal = None
    try:
        read_configuration(path).fixed_orientation()
    except VisualMeshError as error:
        refusal = error
    _ = read_sections(TrainConfiguration, path).manifest
    if refusal:
        raise refusal
