"""Renders pictures in several processes, one core each. The number of processes does not change the pictures."""

from __future__ import annotations

import os
import resource
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from vm_workstation.worker_process import interrupts_blocked, start_worker, use_one_thread, worker_pool

from ..render.picture import render
from ..render.tracer import Tracer
from ..scene.configuration import SceneConfiguration
from ..scene.draw_scene import draw_scene
from ..scene.environment import Environment
from ..scene.own_object import NO_ASSETS, Assets
from ..scene.rooms import furnish_room
from ..scene.scene import Scene
from .assets import read_assets
from .picture_writer import write_picture


@dataclass(frozen=True)
class Job:
    """What all workers share: output folder, sorted maps, seed and configuration.

    rooms: numbers of the built-in rooms that light the scenes if there are no maps.
    """

    folder: Path
    maps: tuple[Path, ...]
    seed: int
    configuration: SceneConfiguration
    rooms: tuple[int, ...] = ()


@dataclass(frozen=True)
class FinishedPicture:
    """A picture that was written, and the peak memory [bytes] of its worker."""

    index: int
    memory: int


def scene_of(job: Job, index: int, assets: Assets = NO_ASSETS) -> tuple[Scene, Environment]:
    """Draw the scene of a picture. It depends only on the job, its files and the picture's number."""
    random = np.random.default_rng([job.seed, index])
    if job.maps:
        environment = Environment.read(job.maps[random.integers(len(job.maps))], job.configuration.maps)
    else:
        environment = furnish_room(job.rooms[random.integers(len(job.rooms))])
    return draw_scene(random, job.configuration, environment, assets), environment


def render_all(job: Job, indices: Sequence[int], workers: int, report: Callable[[FinishedPicture], None]) -> None:
    """Render the pictures in this many processes and report each.

    An interrupt waits for the pictures in progress. Raises VisualMeshError if a worker is killed, and errors of
    workers.
    """
    _set_environment()
    with worker_pool(min(workers, max(len(indices), 1)), _start, (job,)) as pool:
        waiting = iter(indices)
        # The pool starts its processes during these submits, with Ctrl-C blocked. Otherwise Ctrl-C could end a worker
        # before `_start` makes the worker ignore Ctrl-C.
        with interrupts_blocked():
            running: set[Future[FinishedPicture]] = {
                pool.submit(_render_one, index) for index in islice(waiting, 2 * workers)
            }
        while running:
            finished, running = wait(running, return_when=FIRST_COMPLETED)
            for each in finished:
                report(each.result())
            running |= {pool.submit(_render_one, index) for index in islice(waiting, len(finished))}


def _set_environment() -> None:
    """Make workers use one thread each, and keep freed memory: getting it from the system again takes time."""
    use_one_thread()
    os.environ["MALLOC_MMAP_THRESHOLD_"] = str(32 << 20)
    os.environ["MALLOC_TRIM_THRESHOLD_"] = str(1 << 30)


_worker: tuple[Job, Tracer, Assets] | None = None
"""Kept by a worker process between pictures."""


def _start(job: Job) -> None:
    global _worker
    start_worker()
    _worker = (job, Tracer(), read_assets(job.configuration))


def _render_one(index: int) -> FinishedPicture:
    assert _worker is not None
    job, tracer, assets = _worker
    scene, environment = scene_of(job, index, assets)
    picture = render(scene, environment, tracer, job.configuration.ground)
    write_picture(job.folder, index, environment.name, scene, picture)
    return FinishedPicture(index, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024)
