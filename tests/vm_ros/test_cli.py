"""The command line of vm-ros, and what starts it from ROS."""

import json
import os
import re
import shlex
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest

from vm_embedded import __version__
from vm_embedded.cameras.ros.message_fields import FIELDS
from vm_embedded.errors import InputError
from vm_ros.cli import configuration, parser

from .loopback import COMMAND

PACKAGE = Path(__file__).parents[2] / "deploy" / "ros"


def run(*words, **environment):
    done = subprocess.run(
        [COMMAND, *words], capture_output=True, text=True, env={**os.environ, **environment}, timeout=120, check=False
    )
    assert "Traceback" not in done.stderr
    return done


def reason(done):
    """Why it did not start, from the last line of the log."""
    assert done.returncode == 78, done
    return json.loads(done.stderr.splitlines()[-1])["reason"]


def test_arguments_of_ros_need_ros():
    done = run("--ros-middleware", "cyclonedds", "--ros-args", "-r", "__node:=eye")
    assert reason(done).startswith("--ros-args works only with rclpy")


@pytest.mark.long
@pytest.mark.parametrize("domain", ["233", "-1", "one"])
def test_a_wrong_domain_is_named(domain):
    assert reason(run(ROS_DOMAIN_ID=domain)) == f"ROS_DOMAIN_ID must be a number from 0 to 232, not {domain!r}"


def test_a_wrong_configuration_of_dds_is_named():
    assert "DDS can't start; check the network and CYCLONEDDS_URI" in reason(run(CYCLONEDDS_URI="<Wrong/>"))


@pytest.mark.parametrize(
    ("words", "camera", "pose"),
    [
        ([], "ros", "tf"),
        (["--height", "0.8"], "ros", "fixed"),
        (["--pose-source", "topic:/pose"], "ros", "topic:/pose"),
        (["--camera", "synthetic"], "synthetic", "fixed"),
        (["--camera", "/dev/video0", "--pose-source", "tf"], "/dev/video0", "tf"),
    ],
)
def test_images_come_from_ros_and_poses_from_tf_unless_given(words, camera, pose):
    given = configuration(parser().parse_args(words))
    assert (given.camera.source, given.pose.source) == (camera, pose)


@pytest.mark.parametrize("name", ["/bad name", "/camera//image_raw", "/camera/image_raw/", "/4", "/a-b", "/"])
@pytest.mark.parametrize("option", ["--ros-image", "--ros-camera-info", "--pose-source"])
def test_a_topic_that_ros_can_not_have_is_named(option, name):
    value = f"topic:{name}" if option == "--pose-source" else name
    with pytest.raises(InputError, match=f"{option}.* must be a name of letters.* not '{name}'"):
        configuration(parser().parse_args([option, value]))


@pytest.mark.parametrize("namespace", ["", "/", "/vm_ros", "/robot1/vm_ros/", "vm_ros"])
def test_topics_of_ros_are_accepted(namespace):
    words = ["--ros-namespace", namespace, "--ros-image", "left/image_raw/compressed", "--pose-source", "topic:/a1/_b"]
    assert configuration(parser().parse_args(words)).ros.namespace == namespace


@pytest.mark.long
def test_vm_detect_names_vm_ros_for_topics():
    command = [COMMAND.with_name("vm-detect"), "--camera"]
    tf = "pose source tf works only with vm-ros and bags; give fixed, stdin, udp: or unix:"
    for words, expected in (
        (["ros"], "camera ros, a topic of ROS, works only with vm-ros"),
        (["synthetic", "--pose-source", "tf"], tf),
    ):
        done = subprocess.run([*command, *words], capture_output=True, text=True, timeout=120, check=False)
        assert reason(done) == expected


@pytest.mark.long
@pytest.mark.parametrize(
    "words", [["--camera", "ros"], ["--camera", "/dev/video0", "--fov", "1.0", "--pose-source", "tf"]]
)
def test_a_configuration_for_vm_ros_is_checked_by_vm_ros(words, tmp_path):
    """vm-detect could not run it."""
    command = ["--status-socket", tmp_path / "control", "--check-config", *words]
    done = run(*command)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.endswith("; the configuration is good\n")
    refused = subprocess.run(
        [COMMAND.with_name("vm-detect"), *command], capture_output=True, text=True, timeout=120, check=False
    )
    assert refused.returncode == 1
    assert "works only with vm-ros" in refused.stderr


def test_a_wrong_configuration_for_vm_ros_is_one_line(tmp_path):
    done = run("--status-socket", tmp_path / "control", "--check-config", "--camera", "/dev/video0")
    assert (done.returncode, done.stderr) == (
        1,
        "vm-ros: camera /dev/video0 needs a lens: give --lens or --fov\n",
    )


@pytest.mark.parametrize(("words", "prints"), [([], False), (["--output-stdout"], True)])
def test_lines_are_printed_only_if_asked_for(words, prints, tmp_path):
    (tmp_path / "vm.toml").write_text("[output]\nstdout = true\n")
    for config in ([], ["--config", str(tmp_path / "vm.toml")]):
        assert configuration(parser().parse_args([*config, *words])).output.stdout is prints


def test_the_package_of_ros_has_this_version_and_depends_on_all_messages():
    package = ElementTree.parse(PACKAGE / "package.xml").getroot()
    assert package.findtext("version") == re.sub(r"(a|b|rc)\d+$", "", __version__)
    needed = {each.text for each in package.findall("exec_depend")}
    assert {full.split("/")[0] for full in FIELDS} <= needed


def test_the_launch_file_gives_options_that_vm_ros_takes():
    launch = ElementTree.parse(PACKAGE / "launch" / "vm_ros.launch.xml").getroot()
    defaults = {each.get("name"): each.get("default") for each in launch.findall("arg")}
    (node,) = launch.findall("node")
    words = re.sub(r"\$\(var (\w+)\)", lambda found: defaults[found[1]], node.get("args"))
    given = configuration(parser().parse_args(shlex.split(words)))
    assert (given.ros.image, given.pose.source, given.output.stdout) == ("/camera/image_raw", "tf", False)
    package = ElementTree.parse(PACKAGE / "package.xml").getroot()
    assert node.get("pkg") == package.findtext("name") == "vm_ros"
    assert f"PROGRAMS {node.get('exec')} " in (PACKAGE / "CMakeLists.txt").read_text()


def test_the_program_of_the_package_is_vm_ros():
    done = subprocess.run(
        [sys.executable, PACKAGE / "vm-ros", "--version"], capture_output=True, text=True, timeout=120, check=False
    )
    assert done.stdout == f"vm-ros {__version__}\n"
