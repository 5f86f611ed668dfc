"""What docs/ros.md says, done as a reader does it."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from vm_embedded.cameras.ros.message_fields import MESSAGES
from vm_embedded.cameras.ros.settings import DRAWN
from vm_embedded.output.ros.topics import TOPICS

from .loopback import running

PAGE = (Path(__file__).parents[2] / "docs" / "ros.md").read_text()


@pytest.mark.long
@pytest.mark.usefixtures("peer")  # a domain of its own
def test_the_example_prints_where_the_ball_is_and_the_state(tmp_path, monkeypatch):
    (uri,) = re.findall(r'^export CYCLONEDDS_URI="(.*)"$', PAGE, re.MULTILINE)
    monkeypatch.setenv("CYCLONEDDS_URI", uri)
    (command,) = re.findall(r"^python (docs/examples/.*) 10$", PAGE, re.MULTILINE)
    example = Path(__file__).parents[2] / command
    assert example.name == "ros_listener.py"
    with running(tmp_path, "--camera", "synthetic") as node:
        node.wait(lambda: node.frames)
        done = subprocess.run(
            [sys.executable, example, "5"], capture_output=True, text=True, env=os.environ, timeout=120, check=False
        )
        node.stop()
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    balls = [each for each in lines if re.fullmatch(r"ball at \(-?[\d.]+, -?[\d.]+\) m in base_footprint", each)]
    assert len(balls) > 3
    assert "state: ok" in lines
    assert all(each in balls or each.startswith("state: ") for each in lines), lines


def test_the_page_names_all_topics_and_messages():
    named = {**{name: kind for name, (kind, _) in TOPICS.items()}, **dict.fromkeys(DRAWN, "CompressedImage")}
    assert "`_in_image`" in PAGE
    for topic, message in {**named, "/diagnostics": "DiagnosticArray"}.items():
        single, name = topic.removesuffix("_in_image"), MESSAGES[message].split("/")[2]
        assert re.search(rf"^\| .*`(/vm_ros/)?{single}`.* \| `\w+/{name}` \|", PAGE, re.MULTILINE), topic
