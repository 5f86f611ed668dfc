"""The stages of a fine-tuning: first the glance, which sees every proposal, then the look itself."""

from __future__ import annotations

from dataclasses import replace

from vm_export.look_checkpoint import LookCheckpoint

from .run_folder import TuningRun, tuned_look

GLANCE, LOOK = "glance", "look"


def stages_of(run: TuningRun) -> tuple[str, ...]:
    """The networks to train, in order."""
    return (LOOK,) if run.contract.glance is None else (GLANCE, LOOK)


def network_before(run: TuningRun, stage: str) -> LookCheckpoint:
    """The network that a stage begins with: the glance; or the look, behind the glance that is fine-tuned.

    Raises InputError or ModelError.
    """
    before = tuned_look(run.before)
    if before.glance is None:
        return before
    if stage == GLANCE:
        return before.glance
    glance = LookCheckpoint.load(run.stage_path(GLANCE))
    return replace(before, contract=replace(before.contract, glance=glance.contract), glance=glance)
