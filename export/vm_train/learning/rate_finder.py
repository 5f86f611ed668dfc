"""vm-train rate: which learning rate suits, by a short training whose rate rises until the loss does too (L. Smith)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from vm_embedded.arrays import Floats
from vm_embedded.cli.progress import ProgressBar
from vm_embedded.errors import InputError
from vm_embedded.files import atomic_write, check_writable
from vm_export.network import Network

from ..graphs.loading import load_batches
from ..graphs.schedule import schedule
from .hardware import Hardware
from .run_folder import TrainingRun
from .selection import class_weights, selection_shares
from .trainer import Trainer

LOWEST, HIGHEST = 1e-5, 3.0
_SMOOTHING = 0.9  # of the loss's moving average
_DIVERGED = 3.0  # times the least loss


@dataclass(frozen=True)
class RateSearch:
    """Losses (m,), smoothed, at rising rates (m,), and the rate that is proposed."""

    rates: Floats
    losses: Floats

    @property
    def proposed(self) -> float:
        """A third of the rate at which the loss is least: beyond that one it rises."""
        return float(self.rates[self.losses.argmin()]) / 3.0


def find_rate(job: TrainingRun, hardware: Hardware, network: Network, steps: int) -> RateSearch:
    """Train for up to `steps` steps, each with a higher rate. The first round's selection counts."""
    recipe = replace(job.configuration.training, schedule="constant")
    epochs = -(-steps * recipe.batch // len(job.split.training))
    batches = list(schedule((recipe.seed, 0), epochs, recipe.batch, len(job.split.training), 0))[:steps]
    rule = recipe.selection_of(1)
    shares, weights = selection_shares(rule, job.counts, job.objects), class_weights(rule, job.counts, recipe.balance)
    training = Trainer(network, recipe, len(batches), shares, weights, device=hardware.device)
    rates = np.geomspace(LOWEST, HIGHEST, len(batches))
    bar = ProgressBar(len(batches), "vm-train")
    losses: list[float] = []
    average = 0.0
    found = load_batches(job.graphs(job.split.training), batches, hardware.workers)
    for number, (batch, graphs) in enumerate(zip(batches, found, strict=False), 1):
        training.set_rate(float(rates[number - 1]))
        average = _SMOOTHING * average + (1.0 - _SMOOTHING) * training.step(batch.items, graphs).loss
        losses.append(average / (1.0 - _SMOOTHING**number))
        bar.advance()
        if not np.isfinite(losses[-1]) or losses[-1] > _DIVERGED * min(losses):
            break
    bar.clear()
    kept = np.isfinite(losses)
    if not kept.any():
        raise InputError("the loss is no number from the first step on")
    return RateSearch(rates[: len(losses)][kept], np.array(losses)[kept])


def check_plot(path: Path) -> None:
    """Raise InputError if nothing can be plotted to that file."""
    if path.suffix.lower() not in (".png", ".svg"):
        raise InputError(f"can't plot to {path}: its suffix must be .png or .svg")
    check_writable(path)


def plot_rates(found: RateSearch, path: Path) -> None:
    """Draw loss over rate to a .png or .svg file. Raises InputError."""
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise InputError("plots need matplotlib: pip install 'vm-embedded[train]'") from error
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
