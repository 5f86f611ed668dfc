"""Fine-tunes the close look of a model file on boxed frames. It can be resumed at any step."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import replace

from vm_embedded import __version__
from vm_embedded.borders.text import printable
from vm_embedded.cli.progress import ProgressBar
from vm_embedded.detection.settings import Settings
from vm_embedded.files import write_file
from vm_export.attach_look import attached
from vm_export.look_checkpoint import LookCheckpoint

from ..evaluation.box_report import box_page, found_of
from ..look.patch_set import PatchSet
from .box_finding import LOOK_ALONE, Search, Trial
from .boxed_objects import divided
from .collection import collect_windows
from .rendered_patches import read_rendered
from .run_folder import REPORT, TuningRun, tuned_look
from .training import TuningPatches, train_tuned


def fine_tune(run: TuningRun, workers: int, stop_requested: Callable[[], bool]) -> bool:
    """Fine-tune until the end, or until `stop_requested` returns True. Returns whether it is finished.

    workers: processes that collect patches. The network is the same however often the training was stopped or killed.
    Raises InputError, ModelError and VisualMeshError.
    """
    if (run.folder / REPORT).exists():
        print(f"{run.model_path}: the fine-tuning was finished already")
        return True
    if not run.look_path.exists():
        own, before = _collect(run, workers, stop_requested), tuned_look(run.before)
        rendered = read_rendered(run.rendered_path, before.contract.size)
        network = train_tuned(run, before, TuningPatches.of(run, own, rendered), stop_requested)
        if network is None:
            return False
        contract = replace(before.contract, provenance=_provenance(run, before, own))
        replace(before, network=network, contract=contract).save(run.look_path)
        run.state_path.unlink(missing_ok=True)
    _finish(run, workers, stop_requested)
    return True


def _collect(run: TuningRun, workers: int, stop_requested: Callable[[], bool]) -> PatchSet:
    """The patches of the frames. Raises KeyboardInterrupt for a stop: the finished files of patches stay."""
    bar = ProgressBar(len(run.pictures), "vm-train")

    def report(done: int) -> None:
        bar.show(done)
        if stop_requested():
            raise KeyboardInterrupt

    try:
        return collect_windows(run, workers, report)
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


def _finish(run: TuningRun, workers: int, stop_requested: Callable[[], bool]) -> None:
    """Write the model file and the report. Raises KeyboardInterrupt for a stop."""
    look = LookCheckpoint.load(run.look_path)
    content, _ = attached(run.before.content, run.before.manifest, look)
    write_file(run.model_path, content)
    frames = run.part(run.held_out)
    bar = ProgressBar(2 * len(frames), "vm-train")

    def report() -> None:
        bar.advance()
        if stop_requested():
            raise KeyboardInterrupt

    search = Search.of(run.pictures, run.object_class, run.is_round)
    models = {"before": run.before.path, "after": run.model_path}
    try:
        scores = [
            Trial(name, path, Settings(), search).scores(frames, run.object_class, workers, report)
            for name, path in models.items()
        ]
    finally:
        bar.clear()
    tables = {each.name: each.as_dict() for each in scores}
    write_file(run.folder / "result.json", json.dumps(tables, indent=1) + "\n")
    write_file(run.folder / REPORT, box_page(f"{run.boxes.folder.name}: {run.object_class}", _about(run), scores))
    if not frames:
        print(f"{run.model_path}: not measured, because no frames were held out")
        return
    part = "the test" if run.split.test else "validation"
    print(f"{run.model_path}: in {len(frames)} frames for {part}, it finds {found_of(scores[1])}")
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
