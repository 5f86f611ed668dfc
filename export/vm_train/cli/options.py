"""The options of vm-train and its other commands."""

from __future__ import annotations

import argparse
from pathlib import Path

from vm_workstation.option_types import at_least

from .check import check_parser
from .import_pictures import import_parser
from .shards import shards_parser
from .stream_options import add_stream

DEVICES = ("auto", "cpu", "cuda")

_EPILOG = """\
other commands, each with a --help of its own:
  vm-train resume RUN          go on with a training that was stopped
  vm-train check DATA          what the pictures hold, and which are at fault
  vm-train preview DATA        a sheet of augmented pictures with the mesh on them
  vm-train rate DATA           find a learning rate
  vm-train config              all entries of train.toml with their meanings, units, limits and defaults
  vm-train import FILES OUT    TFRecord files of the reference implementation as a folder of pictures
  vm-train shards DATA OUT     a folder of pictures as tar files, for sets that outgrow a disk

With several GPUs, or machines: torchrun --nproc-per-node=N -m vm_train DATA -o RUN
Exit status: 0 done, 1 not (the reason is on standard error), 2 wrong usage, 130 stopped.
"""


def parser() -> argparse.ArgumentParser:
    """The options of vm-train DATA."""
    made = argparse.ArgumentParser(
        prog="vm-train",
        description="Train a network on a folder of pictures with masks, lenses and poses. All pictures are checked "
        "before it begins. It can be stopped or killed at any time: vm-train resume goes on, and the network is the "
        "same as without the stop.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    _add_data(made)
    made.add_argument("-o", "--output", type=Path, required=True, metavar="RUN", help="folder of the training; new")
    _add_configuration(made)
    made.add_argument(
        "--first",
        type=Path,
        metavar="MODEL",
        help="checkpoint (.pt) of a small network that looks first: the new one learns from, and is asked about, only "
        "what [second_look] says, and the model file holds both",
    )
    made.add_argument(
        "--teacher",
        type=Path,
        metavar="MODEL",
        help="checkpoint (.pt) of a larger network: the new one learns its answers, too, as training.distillation says",
    )
    made.add_argument("--strict", action="store_true", help="don't begin if any picture is at fault; default: skip it")
    add_stream(made)
    lists = made.add_argument_group(
        "lists of pictures", "A number or image name on each line; default: chosen as [data] of train.toml says."
    )
    for part in ("training", "validation", "test"):
        lists.add_argument(f"--{part}", type=Path, metavar="FILE", help=f"pictures for {part}")
    kept = made.add_mutually_exclusive_group()
    kept.add_argument(
        "--unpacked",
        type=Path,
        metavar="DIR",
        help="where decoded pictures are kept (1.3 MB for 640 x 512 px), so that each is decoded once; trainings may "
        "share it; default RUN/unpacked, which is removed at the end",
    )
    kept.add_argument("--no-unpacked", action="store_true", help="decode pictures each time; for slow or small disks")
    _add_hardware(made)
    return made


def resume_parser() -> argparse.ArgumentParser:
    """The options of vm-train resume."""
    made = argparse.ArgumentParser(
        prog="vm-train resume",
        description="Go on with a training that was stopped or killed, from its last state.",
    )
    made.add_argument("run", type=Path, metavar="RUN", help="folder of the training")
    made.add_argument("--data", type=Path, metavar="DATA", help="where the pictures are now, if they were moved")
    _add_hardware(made)
    return made


def preview_parser() -> argparse.ArgumentParser:
    """The options of vm-train preview."""
    made = argparse.ArgumentParser(
        prog="vm-train preview",
        description="Draw a sheet: pictures with the points of the mesh in the colors of their classes, as they are "
        "and augmented, and below what each kind of augmentation does by itself.",
    )
    _add_data(made)
    _add_configuration(made)
    made.add_argument("--count", type=at_least(1), default=4, metavar="N", help="pictures; default 4")
    made.add_argument("--versions", type=at_least(1), default=5, metavar="N", help="versions of each; default 5")
    made.add_argument("--seed", type=int, default=0, metavar="S", help="same seed, same sheet; default 0")
    made.add_argument("--width", type=at_least(1), default=320, metavar="PX", help="width of each; default 320")
    made.add_argument("-o", "--output", type=Path, default=Path("preview.jpg"), metavar="FILE", help="a .jpg or .png")
    return made


def rate_parser() -> argparse.ArgumentParser:
    """The options of vm-train rate."""
    made = argparse.ArgumentParser(
        prog="vm-train rate",
        description="Train for some steps with a rate that rises until the loss does too, and say which one suits.",
    )
    _add_data(made)
    _add_configuration(made)
    made.add_argument("--steps", type=at_least(20), default=200, metavar="N", help="steps of the search; default 200")
    made.add_argument("--plot", type=Path, metavar="FILE", help="loss over rate; a .png or .svg")
    _add_hardware(made)
    return made


def config_parser() -> argparse.ArgumentParser:
    """The options of vm-train config: none."""
    return argparse.ArgumentParser(
        prog="vm-train config",
        description="Write a train.toml with all entries, their meanings, units, limits and defaults.",
    )


def parsers() -> dict[str, argparse.ArgumentParser]:
    """All parsers, by what is typed."""
    made = (
        parser(),
        resume_parser(),
        check_parser(),
        preview_parser(),
        rate_parser(),
        config_parser(),
        import_parser(),
        shards_parser(),
    )
    return {each.prog: each for each in made}


def _add_data(made: argparse.ArgumentParser) -> None:
    made.add_argument("data", type=Path, metavar="DATA", help="folder of imageX.jpg or .png, maskX.png, lensX.yaml")


def _add_configuration(made: argparse.ArgumentParser) -> None:
    made.add_argument("--config", type=Path, metavar="FILE", help="train.toml; what it leaves out keeps its default")
    made.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="SECTION.ENTRY=VALUE",
        help="override an entry of the configuration, as in --set training.epochs=5; give it once for each",
    )


def _add_hardware(made: argparse.ArgumentParser) -> None:
    group = made.add_argument_group("hardware")
    group.add_argument("--device", choices=DEVICES, default="auto", help="default a GPU, if there is one")
    group.add_argument("--workers", type=at_least(0), metavar="N", help="processes that read; default half the cores")
    group.add_argument(
        "--threads",
        type=at_least(1),
        metavar="N",
        help="threads that compute; default 1; with more a resumed training is not the same to the last digit",
    )
