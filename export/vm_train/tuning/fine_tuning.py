"""Fine-tunes the close look of a model file on boxed frames, stage by stage. It can be resumed at any step."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import replace

from vm_embedded import __version__
from vm_embedded.borders.text import printable
from vm_embedded.cli.progress import ProgressBar
from vm_embedded.files import write_file
from vm_embedded.network.close_look import CloseLook
from vm_embedded.network.model_file import read_model
from vm_export.attach_look import attached
from vm_export.look_checkpoint import LookCheckpoint

from ..look.patch_set import PatchSet
from .collection import collect_windows
from .rendered_patches import read_rendered
from .report import REPORT, write_report
from .run_folder import TuningRun
from .stage_training import StagePatches, train_stage
from .stages import LOOK, network_before, stages_of
from .window_scores import WindowScores, score_frames


def fine_tune(run: TuningRun, workers: int, stop_requested: Callable[[], bool]) -> bool:
    """Fine-tune until the end, or until `stop_requested` returns True. Returns whether it is finished.

    workers: processes that collect patches. The network is the same however often the training was stopped or killed.
    Raises InputError, ModelError and VisualMeshError.
    """
    if (run.folder / REPORT).exists():
        print(f"{run.model_path}: the fine-tuning was finished already")
        return True
    for stage in stages_of(run):
        if run.stage_path(stage).exists():
            continue
        own = _collect(run, stage, workers, stop_requested)
        before = network_before(run, stage)
        rendered = read_rendered(run.rendered_path, before.contract.size)
        network = train_stage(run, stage, before, StagePatches.of(run, own, rendered), stop_requested)
        if network is None:
            return False
        if stage == LOOK:
            before = replace(before, contract=replace(before.contract, provenance=_provenance(run, before, own)))
        replace(before, network=network).save(run.stage_path(stage))
        run.state_path.unlink(missing_ok=True)
    return _finish(run, stop_requested)


def _collect(run: TuningRun, stage: str, workers: int, stop_requested: Callable[[], bool]) -> PatchSet:
    """The patches of a stage. Raises KeyboardInterrupt for a stop: the finished files of patches stay."""
    bar = ProgressBar(len(run.pictures), "vm-train")

    def report(done: int) -> None:
        bar.show(done)
        if stop_requested():
            raise KeyboardInterrupt

    try:
        return collect_windows(run, stage, workers, report)
    finally:
        bar.clear()


def _provenance(run: TuningRun, before: LookCheckpoint, own: PatchSet) -> Mapping[str, str]:
    """Where the network comes from, for its contract."""
    return dict(before.contract.provenance) | {
        "fine_tuned_by": f"vm-train {__version__}",
        "fine_tuned_on": printable(run.boxes.folder.name),
        "fine_tuned_frames": str(len(run.split.training)),
        "fine_tuned_patches_sha256": own.sha256(),
        "fine_tuned_from_sha256": run.before.sha256,
        "fine_tuned_seed": str(run.configuration.training.seed),
    }


def _finish(run: TuningRun, stop_requested: Callable[[], bool]) -> bool:
    """Write the model file and the report. Returns False after a stop."""
    look = LookCheckpoint.load(run.stage_path(LOOK))
    content, _ = attached(run.before.content, run.before.manifest, look)
    write_file(run.model_path, content)
    frames = run.part(run.split.validation)
    scores: list[WindowScores] = []
    bar = ProgressBar(2 * len(frames), "vm-train")
    for model in (run.before, read_model(run.model_path)):
        judge = CloseLook.of(model)
        assert judge is not None
        score = score_frames(judge, frames, run.object_class, run.is_round, run.radii, bar.advance, stop_requested)
        if score is None:
            bar.clear()
            return False
        scores.append(score)
    bar.clear()
    before, after = scores
    both = {"before": before.as_dict(), "after": after.as_dict()}
    write_file(run.folder / "result.json", json.dumps(both, indent=1) + "\n")
    write_report(run, before, after)
    if frames:
        print(f"{run.model_path}: in {len(frames)} frames for validation, it finds {after.found_of()}")
        print(f"before the fine-tuning: {before.found_of()}")
    else:
        print(f"{run.model_path}: not measured, because no frames are for validation")
    return True
