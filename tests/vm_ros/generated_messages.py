"""Packages of messages that have no wheel, made as ROS makes them: with its generators and a C++ compiler.

python -m tests.vm_ros.generated_messages FOLDER makes them in a folder for PYTHONPATH.
"""

import os
import subprocess
import sys
import sysconfig
from pathlib import Path

import numpy as np
from rosidl_adapter.msg import convert_msg_to_idl
from rosidl_generator_c.cli import GenerateC
from rosidl_generator_py.cli import GeneratePython
from rosidl_generator_type_description.cli import HashTypeDescription
from rosidl_typesupport_c.cli import GenerateCTypesupport
from rosidl_typesupport_fastrtps_c.cli import GenerateFastRTPSCTypesupport

from vm_embedded.cameras.ros.bag_types import definition
from vm_embedded.cameras.ros.message_fields import FIELDS
from vm_ros.rclpy_middleware import message_classes

SHARE, INCLUDE, LIBRARIES = (Path(sys.prefix) / each for each in ("share", "include", "lib"))
DEPENDENCIES = "builtin_interfaces", "std_msgs", "geometry_msgs"
SUPPORT = "rosidl_typesupport_fastrtps_c"


def generate(folder):
    """Make all packages that are missing here in a folder."""
    os.environ["AMENT_PREFIX_PATH"] = sys.prefix  # where the templates are
    packages = sorted(message_classes()[1], key=list(dict.fromkeys(each.split("/")[0] for each in FIELDS)).index)
    for package in packages:
        _write_sources(folder, package)
    _compile(folder, packages)


def _write_sources(folder, package):
    own, found = folder / package, folder / "share" / package
    files = []
    for full in FIELDS:
        if full.startswith(f"{package}/"):
            message = Path(f"msg/{full.split('/')[2]}.msg")
            (found / "msg").mkdir(parents=True, exist_ok=True)
            (found / message).write_text(definition(full) + "\n")
            convert_msg_to_idl(found, package, message, found / "msg")
            files.append(f"{found}:{message.with_suffix('.idl')}")
    given = (package, files, [str(SHARE), str(folder / "share")])
    hashes = HashTypeDescription("").generate_type_hashes(*given, found)
    GenerateC("").generate(*given, own, type_description_files=hashes)
    GenerateFastRTPSCTypesupport("").generate(*given, own)
    GenerateCTypesupport("", typesupport_implementations=[SUPPORT]).generate(*given, own)
    GeneratePython("", typesupport_implementations=["rosidl_typesupport_c"]).generate(*given, own)
    (own / "__init__.py").touch()


def _compile(folder, packages):
    """One library with all messages, and a small module of Python for each package."""
    headers = [folder, INCLUDE, *INCLUDE.iterdir(), sysconfig.get_path("include"), np.get_include()]
    kinds = ("generator_c", "generator_py", "typesupport_c", "typesupport_fastrtps_c")
    linked = [f"{each}__rosidl_{kind}" for each in DEPENDENCIES for kind in kinds]
    linked += ["rosidl_runtime_c", "rosidl_typesupport_c", "rosidl_typesupport_fastrtps_cpp", "fastcdr", "stdc++"]
    paths = [f"-L{LIBRARIES}", f"-L{folder}", f"-Wl,-rpath,{LIBRARIES}:{folder}"]
    command = ["gcc", "-O0", "-w", "-fPIC", "-shared", *(f"-I{each}" for each in headers), *paths]

    def link(sources, target, names):
        subprocess.run([*command, *sources, "-o", target, *(f"-l{each}" for each in names)], check=True)

    found = [each for package in packages for each in (folder / package).rglob("*.c*")]
    modules = [each for each in found if ".ep." in each.name]
    link([each for each in found if each not in modules], folder / "libgenerated.so", linked)
    for each in modules:
        target = each.with_name(each.name[1:].replace(".ep.", "__")).with_suffix(".so")
        link([each], target, ["generated", *linked])


if __name__ == "__main__":
    generate(Path(sys.argv[1]).resolve())
