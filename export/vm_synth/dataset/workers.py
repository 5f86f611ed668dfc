"""Renders pictures in several processes, one core each. The number of processes does not change the pictures."""

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
from .picture_writer import write_picture


class WorkerLost(VisualMeshError):
    """A worker process ended early."""


@dataclass(frozen=True)
class Job:
    """What all workers share: output folder, sorted maps, seed and configuration."""

    folder: Path
    maps: tuple[Path, ...]
    seed: int
    configuration: SceneConfiguration


@dataclass(frozen=True)
class FinishedPicture:
    """A picture that was written, and the peak memory [bytes] of its worker."""

    index: int
    memory: int


def scene_of(job: Job, index: int) -> tuple[Scene, Environment]:
    """Draw the scene of a picture. It depends only on the job and the picture's number."""
    random = np.random.default_rng([job.seed, index])
    path = job.maps[random.integers(len(job.maps))]
    environment = Environment.read(path, job.configuration.maps)
    return draw_scene(random, job.configuration, environment), environment


def render_all(job: Job, indices: Sequence[int], workers: int, report: Callable[[FinishedPicture], None]) -> None:
    """Render the pictures in this many processes and report each.

    An interrupt waits for the pictures in progress. Raises WorkerLost if a worker ends early, and errors of workers.
    """
    _limit_threads()
    with ProcessPoolExecutor(
        min(workers, max(len(indices), 1)), mp_context=get_context("spawn"), initializer=_start, initargs=(job,)
    ) as pool:
        waiting = iter(indices)
        with shielded():
            running: set[Future[FinishedPicture]] = {
                pool.submit(_render_one, index) for index in islice(waiting, 2 * workers)
            }
        try:
            while running:
                finished, running = wait(running, return_when=FIRST_COMPLETED)
                for each in finished:
                    report(each.result())
                running |= {pool.submit(_render_one, index) for index in islice(waiting, len(finished))}
        except BrokenProcessPool as error:
            raise WorkerLost(
                "a worker process was killed (out of memory?); finished pictures are kept: "
                "repeat the command, perhaps with fewer --workers"
            ) from error
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


def _limit_threads() -> None:
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[name] = "1"


_worker: tuple[Job, Tracer] | None = None
"""Kept by a worker process between pictures."""


def _start(job: Job) -> None:
    global _worker
    begin()
    _worker = (job, Tracer())


def _render_one(index: int) -> FinishedPicture:
    assert _worker is not None
    job, tracer = _worker
    scene, environment = scene_of(job, index)
    picture = render(scene, environment, tracer, job.configuration.ground)
    write_picture(job.folder, index, environment.name, scene, picture)
    return FinishedPicture(index, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024)
