"""vm-train rate: find a learning rate by a short training whose rate rises until the loss does (L. Smith, 2017)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from vm_embedded.arrays import Floats
from vm_embedded.cli.progress import ProgressBar
from vm_embedded.errors import InputError, install_extra
from vm_embedded.files import atomic_write, check_writable
from vm_export.mesh_networks import MeshNetwork

from ..graphs.loading import load_batches
from ..graphs.schedule import schedule
from ..runs.hardware import Hardware
from .run import MeshRun
from .trainer import Trainer

LOWEST, HIGHEST = 1e-5, 3.0
_SMOOTHING = 0.9  # of the loss's moving average
_DIVERGED = 3.0  # times the smallest loss


@dataclass(frozen=True)
class RateSearch:
    """Smoothed losses (m,) at rising learning rates (m,)."""

    rates: Floats
    losses: Floats

    @property
    def proposed(self) -> float:
        """A third of the rate with the smallest loss; beyond that rate the loss rises."""
        return float(self.rates[self.losses.argmin()]) / 3.0


def find_rate(run: MeshRun, hardware: Hardware, network: MeshNetwork, steps: int) -> RateSearch:
    """Train for up to `steps` steps, each with a higher rate, and with the point selection of the first round.

    Stops early when the loss diverges. Raises InputError if it is NaN or infinite.
    """
    recipe = replace(run.configuration.training, schedule="constant")
    training = run.split.training
    epochs = -(-steps * recipe.batch // len(training))
    batches = list(schedule((recipe.seed, 0), epochs, recipe.batch, len(training), 0))[:steps]
    peaks = run.configuration.peak_numbers
    trainer = Trainer(network, recipe, len(batches), *run.shares_and_weights(1), device=hardware.device, peaks=peaks)
    rates = np.geomspace(LOWEST, HIGHEST, len(batches))
    bar = ProgressBar(len(batches), "vm-train", unit="steps")
    losses: list[float] = []
    average = 0.0
    loaded = load_batches(run.graphs(training), batches, hardware.workers)
    for number, (batch, graphs) in enumerate(zip(batches, loaded, strict=False), 1):
        trainer.rate = float(rates[number - 1])
        average = _SMOOTHING * average + (1.0 - _SMOOTHING) * trainer.step(batch.items, graphs)["loss"]
        losses.append(average / (1.0 - _SMOOTHING**number))
        bar.advance()
        if not np.isfinite(losses[-1]) or losses[-1] > _DIVERGED * min(losses):
            break
    bar.clear()
    kept = np.isfinite(losses)
    if not kept.any():
        raise InputError("the loss is NaN or infinite from the first step on: check the pictures and [mesh]")
    return RateSearch(rates[: len(losses)][kept], np.array(losses)[kept])


def check_plot(path: Path, inputs: Iterable[Path | None]) -> None:
    """Raise InputError unless the file is a .png or .svg that can be written, and none of the inputs."""
    if path.suffix.lower() not in (".png", ".svg"):
        raise InputError(f"can't plot to {path}: its suffix must be .png or .svg")
    check_writable(path, inputs)


def plot_rates(found: RateSearch, path: Path) -> None:
    """Draw loss over rate to a .png or .svg file. Raises InputError."""
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise InputError(f"plots need matplotlib; {install_extra('train')}") from error
    figure = Figure(figsize=(7.0, 4.0), layout="constrained")
    axes: Any = figure.subplots()
    axes.semilogx(found.rates, found.losses, color="#1b9e77")
    axes.axvline(found.proposed, color="#d95f02", linestyle="--")
    axes.annotate(f" {found.proposed:.2g}", (found.proposed, found.losses.max()), color="#d95f02", va="top")
    axes.set_xlabel("learning rate")
    axes.set_ylabel("loss, moving average")
    axes.set_ylim(top=min(found.losses.max(), 1.5 * found.losses[0]))
    axes.spines[["top", "right"]].set_visible(False)
    with atomic_write(path) as part:
        figure.savefig(part, dpi=110, format=path.suffix[1:].lower())
