"""Fine-tunes the close look of a model file on boxed frames.

It learns from the user's patches and from rendered ones, and the best epoch stays. Patches without
an object are drawn by the network's errors, which it learns at the beginning and in the middle.
"""

from __future__ import annotations

import copy
import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import count

import numpy as np
import torch

from vm_embedded import __version__
from vm_embedded.arrays import Floats
from vm_embedded.borders.text import printable
from vm_embedded.detection.settings import Settings
from vm_embedded.files import write_file
from vm_export.attach_look import attached
from vm_export.look_network import LookNetwork

from ..evaluation.box_report import box_page, found_of
from ..look.patch_set import PatchSet
from ..look.teacher import LookTeacher
from ..look.trainer import LookTrainer
from ..runs.hardware import Hardware
from ..runs.loop import Progress, Training, Validation, shown
from .box_finding import LOOK_ALONE, Search, Trial
from .boxed_objects import divided
from .collection import collect_windows
from .mixing import Mixer
from .rendered_patches import read_rendered
from .run import TuningRun, tuned_look

_RENDERED_VALIDATION = 5
"""One of so many rendered patches is for validation."""


@dataclass(frozen=True, eq=False)
class TuningPatches:
    """Patches of a fine-tuning: the user's own and rendered ones, each for training and for validation."""

    own: PatchSet
    rendered: PatchSet
    own_validation: PatchSet
    rendered_validation: PatchSet

    @classmethod
    def of(cls, run: TuningRun, own: PatchSet, rendered: PatchSet) -> TuningPatches:
        """Divide patches by the run's split."""
        validates = np.isin(own.pictures, np.array(run.split.validation, dtype=np.int64))
        shared = np.arange(len(rendered)) % _RENDERED_VALIDATION == 0
        return cls(own.part(~validates), rendered.part(~shared), own.part(validates), rendered.part(shared))

    def for_training(self, share: float) -> tuple[PatchSet, Floats]:
        """All training patches and their weights (n,), so that `share` of those drawn, of each kind, are own ones."""
        patches = PatchSet.joined(self.own.patches.shape[1], [self.own, self.rendered])
        weights = np.zeros(len(patches))
        is_own = np.arange(len(patches)) < len(self.own)
        for label in np.unique(patches.labels):
            for mine, part in ((True, share), (False, 1.0 - share)):
                rows = (patches.labels == label) & (is_own == mine)
                weights[rows] = part / max(int(rows.sum()), 1)
        return patches, weights


class Tuning(Training):
    """See runs.loop.Training. `kept` is the network of its best epoch."""

    run: TuningRun
    learner: LookTrainer

    def __init__(self, run: TuningRun, hardware: Hardware) -> None:
        self.run, self._workers, recipe = run, hardware.workers, run.configuration.training
        super().__init__()
        self.epochs, self.steps, self.patience = recipe.epochs, recipe.steps, recipe.patience

    def begin(self, progress: Progress, stopped: Callable[[], bool]) -> None:
        """Collect the patches, and prepare the network."""
        run, settings, recipe = self.run, self.run.configuration, self.run.configuration.training
        self._progress, self._stopped = progress, stopped
        self._before = before = tuned_look(run.before)
        names = before.contract.names
        self._kind = names.index(run.object_class)
        with shown(len(run.pictures), stopped) as report:
            own = collect_windows(run, self._workers, report)
        self._patches = patches = TuningPatches.of(
            run, own, read_rendered(run.rendered_path, before.contract.size, names)
        )
        self._digest = own.sha256()
        training, weights = patches.for_training(recipe.own)
        network, old = copy.deepcopy(before.network), before.network.eval()
        self._mixer = Mixer(old, patches.rendered_validation, recipe.forgetting)
        is_rendered = torch.arange(len(training)) >= len(patches.own)
        teacher = LookTeacher(old, recipe.distillation * is_rendered)
        self.learner = LookTrainer(
            network,
            training,
            before.contract.extent,
            recipe.as_look_recipe(),
            settings.augmentation,
            recipe.epochs * recipe.steps,
            weights,
            teacher,
        )
        self.kept = _copy(network)
        mine = patches.own
        print(f"{len(mine)} patches of your frames, {mine.objects} of them show the object", flush=True)

    def step(self) -> dict[str, float]:
        """Learn from the next batch."""
        if self.learner.done in (0, self.epochs // 2 * self.steps):
            self.learner.grade()
        return self.learner.step()

    def validate(self) -> Validation:
        """Keep the network, mixed with the one before, if it is better on the user's frames than those so far.

        Without frames for validation, the last one stays.
        """
        mixture = self._mixer.mix(self.learner.network)
        own = mixture.loss_of(self._patches.own_validation, self._kind)
        if self._progress.is_best(-own):
            self.kept = _copy(mixture.network)
            self._progress.take(-own)
        yours = "" if np.isnan(own) else f"{own:.3f} for your frames, "
        return Validation(
            {"own": own, "rendered": mixture.loss, "share": mixture.share},
            f"validation loss {yours}{mixture.loss:.3f} for rendered patches",
            f", with {mixture.share:.0%} of the new weights",
        )

    def finish(self) -> None:
        """Write the network of the best epoch, the model file and the report."""
        before, network = self._before, self.learner.network.eval()
        network.load_state_dict(self.kept)
        contract = replace(before.contract, provenance=self._provenance())
        look = replace(before, network=network, contract=contract)
        look.save(self.run.look_path)
        content, _ = attached(self.run.before.content, self.run.before.manifest, look)
        write_file(self.run.result_path, content)
        self._measure()

    def _provenance(self) -> dict[str, str]:
        """Where the network comes from, for its contract."""
        run = self.run
        return dict(self._before.contract.provenance) | {
            "fine_tuned_by": f"vm-train {__version__}",
            "fine_tuned_on": printable(run.boxes.folder.name),
            "fine_tuned_frames": str(len(run.split.training)),
            "fine_tuned_patches_sha256": self._digest,
            "fine_tuned_from_sha256": run.before.sha256,
            "fine_tuned_seed": str(run.configuration.training.seed),
        }

    def _measure(self) -> None:
        """Write and print what the networks before and after find in the held-out frames."""
        run, frames = self.run, self.run.part(self.run.held_out)
        search = Search.of(run.pictures, run.object_class, run.is_round)
        models, done = {"before": run.before.path, "after": run.result_path}, count(1)
        with shown(2 * len(frames), self._stopped) as report:
            scores = [
                Trial(name, path, Settings(), search).scores(
                    frames, run.object_class, self._workers, lambda: report(next(done))
                )
                for name, path in models.items()
            ]
        tables = {each.name: each.as_dict() for each in scores}
        write_file(run.folder / "result.json", json.dumps(tables, indent=1) + "\n")
        title = f"{run.boxes.folder.name}: {run.object_class}"
        write_file(run.folder / "report.html", box_page(title, _about(run), scores))
        if not frames:
            print(f"{run.result_path}: not measured, because no frames were held out")
            return
        part = "the test" if run.split.test else "validation"
        print(f"{run.result_path}: in {len(frames)} frames for {part}, the look alone finds {found_of(scores[1])}")
        print(f"before the fine-tuning: {found_of(scores[0])}")


def _about(run: TuningRun) -> list[str]:
    """What the report measures."""
    learned = f"The close look of {run.model} learned from {len(run.split.training)} frames of {run.boxes.folder.name}."
    frames = run.part(run.held_out)
    if not frames:
        return [learned, "No other frames were held out, so nothing was measured."]
    if divided(run.pictures, map(int, run.held_out)):
        others = f"{len(frames)} later frames of the same recordings"
    else:
        others = f"{len(frames)} frames of other recordings"
    measured = f"{learned} These scores are of {others}."
    if not run.split.test:
        measured += " They chose the best epoch, so the scores after it may be a little too good."
    return [measured, LOOK_ALONE]


def _copy(network: LookNetwork) -> dict[str, torch.Tensor]:
    return {name: value.detach().clone() for name, value in network.state_dict().items()}
