"""Packages of messages that have no wheel, made as ROS makes them: by its generators and a C++ compiler."""

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
from rosidl_typesupport_introspection_c.cli import GenerateIntrospectionCTypesupport

from vm_embedded.cameras.ros.bag_types import definition
from vm_embedded.cameras.ros.message_fields import FIELDS

SHARE, INCLUDE, LIBRARIES = (Path(sys.prefix) / each for each in ("share", "include", "lib"))
DEPENDENCIES = "builtin_interfaces", "std_msgs", "geometry_msgs"
"""Packages with a wheel whose messages are in those without."""

SUPPORTS = ["rosidl_typesupport_fastrtps_c", "rosidl_typesupport_introspection_c"]


def generate(folder, missing):
    """Make packages in a folder for PYTHONPATH."""
    packages = [each for each in dict.fromkeys(full.split("/")[0] for full in FIELDS) if each in missing]
    for package in packages:
        _write_sources(folder, package)
    _compile(folder, packages)


def _write_sources(folder, package):
    own, found = folder / package, folder / "share" / package
    (found / "msg").mkdir(parents=True)
    files = []
    for full in FIELDS:
        if full.startswith(f"{package}/"):
            message = Path(f"msg/{full.split('/')[2]}.msg")
            (found / message).write_text(definition(full) + "\n")
            convert_msg_to_idl(found, package, message, found / "msg")
            files.append(f"{found}:{message.with_suffix('.idl')}")
    given = package, files, [str(SHARE), str(folder / "share")]
    hashes = HashTypeDescription("").generate_type_hashes(*given, found)
    GenerateC("").generate(*given, own, type_description_files=hashes)
    GenerateFastRTPSCTypesupport("").generate(*given, own)
    GenerateIntrospectionCTypesupport("").generate(*given, own)
    GenerateCTypesupport("", typesupport_implementations=SUPPORTS).generate(*given, own)
    GeneratePython("", typesupport_implementations=["rosidl_typesupport_c"]).generate(*given, own)
    (own / "__init__.py").touch()


def _compile(folder, packages):
    """One library with all messages; for each package, a module of Python, and the libraries that ROS looks for."""
    headers = [folder, INCLUDE, *INCLUDE.iterdir(), sysconfig.get_path("include"), np.get_include()]
    kinds = ["rosidl_generator_c", "rosidl_generator_py", "rosidl_typesupport_c", *SUPPORTS]
    linked = [f"{each}__{kind}" for each in DEPENDENCIES for kind in kinds]
    linked += ["rosidl_runtime_c", "rosidl_typesupport_c", "rosidl_typesupport_fastrtps_cpp", "fastcdr", "stdc++"]
    paths = [f"-L{LIBRARIES}", f"-L{folder}", f"-Wl,-rpath,{LIBRARIES}:{folder}", "-Wl,--no-as-needed"]
    command = ["gcc", "-O0", "-w", "-fPIC", "-shared", *(f"-I{each}" for each in headers), *paths]

    def link(sources, target, names):
        subprocess.run([*command, *sources, "-o", target, *(f"-l{each}" for each in names)], check=True)

    for package in packages:
        sources = [each for each in (folder / package).rglob("*.c*") if ".ep." not in each.name]
        own = f"{package}__messages"
        link(sources, folder / f"lib{own}.so", linked)
        linked.append(own)
        supports = [f"{package}__{each}" for each in SUPPORTS]
        for each in supports:
            link([], folder / f"lib{each}.so", [own])
        (module,) = (folder / package).glob("*.ep.*")
        target = module.with_name(f"{package}_s__rosidl_typesupport_c.so")
        link([module], target, [*supports, *linked])
