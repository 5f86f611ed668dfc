"""Writes docs/command-line.md from the parsers, and docs/vm.toml, scene.toml and train.toml from the entries of
configurations, so that they and the programs can't drift apart.

python docs/help_pages.py writes them; a test checks that they are what this would write.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from vm_embedded.cli import bench, detect, doctor
from vm_embedded.config.sections import documented
from vm_embedded.live.configuration import Configuration
from vm_export import cli as export
from vm_mesh import cli as mesh
from vm_synth import cli as synth
from vm_synth.scene.configuration import SceneConfiguration
from vm_train.cli import evaluate
from vm_train.cli import options as train
from vm_train.learning.configuration import TrainConfiguration

PAGE = Path(__file__).parent / "command-line.md"
SCENE = Path(__file__).parent / "scene.toml"
ROBOT = Path(__file__).parent / "vm.toml"
TRAIN = Path(__file__).parent / "train.toml"


def page() -> str:
    """The page's text."""
    parts = [
        "# Command line\n\nMade from the programs' own help texts; every program also prints them with `--help`.\n"
    ]
    robot = (detect.parser(), doctor.parser(), bench.parser(), export.parser())
    workstation = (each for program in (synth, train, evaluate, mesh) for each in program.parsers().values())
    for parser in (*robot, *workstation):
        parts.append(f"## {parser.prog}\n\n{parser.description}\n")
        for group in parser._action_groups:
            rows = [_row(action) for action in group._group_actions if not isinstance(action, argparse._HelpAction)]
            if rows:
                note = f" ({group.description})" if group.description else ""
                title = (group.title or "").capitalize()
                parts.append(f"**{title}**{note}\n\n| option | meaning |\n| --- | --- |\n" + "\n".join(rows) + "\n")
        if parser.epilog:
            parts.append(f"{parser.epilog}\n")
    return "\n".join(parts)


def robot_configuration() -> str:
    """All entries of a vm.toml with their meanings and defaults."""
    return "\n".join(documented(Configuration()))


def scene() -> str:
    """All entries of a scene.toml with their meanings and defaults."""
    return "\n".join(documented(SceneConfiguration()))


def training() -> str:
    """All entries of a train.toml with their meanings and defaults."""
    return "\n".join(documented(TrainConfiguration()))


def _row(action: argparse.Action) -> str:
    names = ", ".join(f"`{name}`" for name in action.option_strings) or f"`{action.dest}`"
    if action.choices:
        names += " " + " \\| ".join(f"`{choice}`" for choice in action.choices)
    elif action.option_strings and action.nargs != 0:
        names += f" `{action.metavar or action.dest.upper()}`"
    return f"| {names} | {action.help} |"


if __name__ == "__main__":
    PAGE.write_text(page())
    ROBOT.write_text(robot_configuration())
    SCENE.write_text(scene())
    TRAIN.write_text(training())
