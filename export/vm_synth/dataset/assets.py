"""The files of a configuration: the mesh of the object, and textures."""

from __future__ import annotations

from pathlib import Path

from ..bodies.targets import unit_sized
from ..render.mesh_file import read_mesh
from ..scene.configuration import SceneConfiguration
from ..scene.own_object import Assets
from ..scene.textures import read_textures, texture_files


def read_assets(configuration: SceneConfiguration) -> Assets:
    """Read all files that a configuration names. Raises InputError that names the file and what is wrong with it."""
    own, ground = configuration.object, configuration.ground
    if own.is_ball:
        return Assets()
    return Assets(
        solid=unit_sized(read_mesh(Path(own.file), own.up)) if own.file else None,
        textures=read_textures(Path(own.textures)) if own.textures else (),
        ground=read_textures(Path(ground.textures)) if ground.textures else (),
    )


def asset_files(configuration: SceneConfiguration) -> list[Path]:
    """All files that `read_assets` reads."""
    own, ground = configuration.object, configuration.ground
    folders = [Path(each) for each in (own.textures, ground.textures) if each and not own.is_ball]
    return [*([Path(own.file)] if own.file else []), *(path for folder in folders for path in texture_files(folder))]
