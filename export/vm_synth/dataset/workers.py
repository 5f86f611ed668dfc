"""Rendering with several processes, each on one core; which one renders a picture does not change it."""

from __future__ import annotations

import os
import resource
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from itertools import islice
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from vm_embedded.errors import VisualMeshError
from vm_workstation.worker_process import begin, shielded

from ..render.picture import render
from ..render.tracer import Tracer
from ..scene.configuration import SceneConfiguration
from ..scene.draw_scene import draw_scene
from ..scene.environment import Environment
from ..scene.scene import Scene
from .files import write_picture


class WorkerLost(VisualMeshError):
    """A worker process ended before its work was done."""


@dataclass(frozen=True)
class Job:
    """What every worker knows: where to write, the maps in their order, seed and ranges."""

    folder: Path
    maps: tuple[Path, ...]
    seed: int
    configuration: SceneConfiguration


@dataclass(frozen=True)
class Done:
    """A picture that was written, and the most memory [bytes] that its worker has used so far."""

    index: int
    memory: int


def scene_of(job: Job, index: int) -> tuple[Scene, Environment]:
    """The scene of a picture's number, from nothing but the job."""
    random = np.random.default_rng([job.seed, index])
    path = job.maps[random.integers(len(job.maps))]
    environment = Environment.read(path, job.configuration.maps)
    return draw_scene(random, job.configuration, environment), environment


def render_all(job: Job, indices: Sequence[int], workers: int, report: Callable[[Done], None]) -> None:
    """Render pictures with so many processes and report each.

    When interrupted, pictures in work are finished and no others begun. Raises WorkerLost, and what a worker raised.
    """
    _one_core_each()
    with ProcessPoolExecutor(
        min(workers, max(len(indices), 1)), mp_context=get_context("spawn"), initializer=_start, initargs=(job,)
    ) as pool:
        waiting = iter(indices)
        with shielded():
            running: set[Future[Done]] = {pool.submit(_render_one, index) for index in islice(waiting, 2 * workers)}
        try:
            while running:
                finished, running = wait(running, return_when=FIRST_COMPLETED)
                for each in finished:
                    report(each.result())
                running |= {pool.submit(_render_one, index) for index in islice(waiting, len(finished))}
        except BrokenProcessPool as error:
            raise WorkerLost("a worker was killed (out of memory?); all finished pictures are kept") from error
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


def _one_core_each() -> None:
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[name] = "1"


_worker: tuple[Job, Tracer] | None = None
"""What a worker process keeps between pictures."""


def _start(job: Job) -> None:
    global _worker
    begin()
    _worker = (job, Tracer())


def _render_one(index: int) -> Done:
    assert _worker is not None
    job, tracer = _worker
    scene, environment = scene_of(job, index)
    picture = render(scene, environment, tracer, job.configuration.ground)
    write_picture(job.folder, index, environment.name, scene, picture)
    return Done(index, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024)
