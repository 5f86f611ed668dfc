"""Detecting in the frames of images and video files, each frame once."""

from __future__ import annotations

import argparse
import json
from collections import Counter
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace

from ..arrays import Image
from ..cameras.frame_source import Frame, Source, joined
from ..cameras.image_files import check_read_format, open_source, open_sources
from ..cameras.ros.bags import BagReading, is_bag, open_bag
from ..detection.detections import Detections
from ..detection.detector import Detector
from ..detection.pose_check import PoseCheck
from ..detection.tracker import Tracker
from ..errors import InputError, VisualMeshError
from ..files import check_not_input
from ..live.configuration import Configuration
from ..output.box_files import BoxWriter
from ..output.messages import file_message
from ..output.readable_line import to_readable_line
from ..output.result_files import FrameNames, make_folder, save_map, save_overlay, save_points
from ..output.ros.mcap_file import McapFile
from ..output.video_file import VideoFile
from .closing_remarks import ClosingRemarks
from .default_pose import DefaultPose
from .program import complain
from .progress import ProgressBar

_ANY_SIZE = (640, 480)

_IMAGES_RATE = 10.0
"""Frame rate of a video of images [1/s]."""


def detect_in_files(options: argparse.Namespace, given: Configuration) -> int:
    """Process each frame of the source, print its line, and return the number of processed frames.

    A frame that can't be processed is reported on standard error and skipped. Raises VisualMeshError for errors that
    concern all frames.
    """
    format = given.detector.format
    pose = DefaultPose(given, given.fixed_orientation())
    detector = Detector.from_file(given.model, given.detector)
    emit_points = [name.strip() for name in options.emit_points.split(",")] if options.emit_points else []
    for name in emit_points:
        detector.manifest.column(name)
    check_read_format(format)
    source = open_frames(options.files or [given.camera.source], given)
    _check_overlays(options, source)
    for folder in (options.save_overlay, options.save_map, options.save_points):
        if folder is not None:
            make_folder(folder)
    tracker = _TimedTracker(Tracker(given.track), given.camera.fps) if given.track.on else None

    with ExitStack() as stack:
        mcap = video = boxes = None
        if options.save_mcap is not None:
            mcap = stack.enter_context(McapFile(options.save_mcap, given.ros.plane_frame, source.files))
        if options.save_video is not None:
            video = stack.enter_context(VideoFile(options.save_video, source.rate or _IMAGES_RATE, source.files))
        if options.save_boxes is not None:
            boxes = BoxWriter(options.save_boxes, detector.manifest)
        work = _Pass(detector, pose, tracker, options, emit_points, boxes, mcap, video, ClosingRemarks(detector))
        _process_all(source, work)
    for remark in filter(None, (*source.remarks(), work.replaced, *work.remarks.lines())):
        complain("vm-detect", remark)
    return work.processed


def _check_overlays(options: argparse.Namespace, source: Source) -> None:
    """Raise InputError if an overlay would replace an image that is read, or one of --save-boxes."""
    if options.save_overlay is None:
        return
    for each in source.files:
        check_not_input(options.save_overlay / f"{each.stem}.jpg", [each])
    if options.save_boxes is not None and options.save_boxes.resolve() == options.save_overlay.resolve():
        raise InputError(
            f"--save-overlay would draw into the images of --save-boxes {options.save_boxes}: give another folder"
        )


def _process_all(source: Source, work: _Pass) -> None:
    """Process each frame, and print its line or what is wrong with it.

    What is wrong with several frames is printed for the first one, and at the end with their number.
    """
    bar, reasons = ProgressBar(source.count, unit="frames"), Counter[str]()
    for frame in source.frames:
        if work.tracker is not None and frame.index == 0:
            work.tracker.time(frame)  # without times, no frame can be processed
        try:
            line = work.process(frame)
        except VisualMeshError as error:
            bar.clear()
            reason = str(error).removeprefix(f"{frame.source}: ")
            if reason not in reasons:
                complain("vm-detect", str(error))
            reasons[reason] += 1
            if work.mcap is not None:
                work.mcap.write_state(frame, "degraded", str(error))
            continue
        bar.clear()
        print(line, flush=True)
        bar.show(frame.index + 1)
    bar.clear()
    for reason, count in reasons.items():
        if count > 1:
            complain("vm-detect", f"{count} frames could not be processed: {reason}")


def open_frames(names: Sequence[str], given: Configuration) -> Source:
    """The frames of images, folders, videos and bags. Raises InputError."""
    raw, largest = given.detector.format != "bgr", given.camera.max_megapixels
    if not any(map(is_bag, names)):
        return open_sources(names, raw, largest)
    reading = BagReading(
        ros=given.ros,
        pose=given.pose,
        own_lens=given.lens_for(_ANY_SIZE),
        orientation=given.fixed_orientation(),
        raw=raw,
        max_megapixels=largest,
    )
    return joined([open_bag(each, reading) if is_bag(each) else open_source(each, raw, largest) for each in names])


@dataclass(frozen=True)
class _TimedTracker:
    """A tracker for frames of files. rate: frame rate of images without times [1/s]; 0: unknown."""

    tracker: Tracker
    rate: float

    def update(self, detections: Detections, frame: Frame) -> Detections:
        """The detections of the next frame, with their tracks. Raises InputError if its time is not known."""
        return self.tracker.update(detections, self.time(frame))

    def time(self, frame: Frame) -> float:
        """The time of a frame [s]. Raises InputError if it is not known."""
        if frame.stamp is None and not self.rate:
            raise InputError(
                "--track needs the time of each frame: give --camera-fps, the frame rate of the images, or --no-track"
            )
        return frame.index / self.rate if frame.stamp is None else frame.stamp


@dataclass(eq=False)
class _Pass:
    """All that a pass over the frames needs.

    boxes, mcap, video: the files that the options ask for. remarks: collects what is strange. pose_check: collects what
    the frames say about the pose. processed: number of frames so far. replaced: the first remark about what a lens file
    replaces.
    """

    detector: Detector
    pose: DefaultPose
    tracker: _TimedTracker | None
    options: argparse.Namespace
    emit_points: Sequence[str]
    boxes: BoxWriter | None
    mcap: McapFile | None
    video: VideoFile | None
    remarks: ClosingRemarks
    pose_check: PoseCheck = field(default_factory=PoseCheck)
    names: FrameNames = field(default_factory=FrameNames)
    processed: int = 0
    replaced: str = ""

    def process(self, frame: Frame) -> str:
        """Detect in a frame, save the files that the options ask for, and return its line: JSON, or for people.

        Raises InputError that names the frame.
        """
        image = frame.read()  # its errors name the file
        try:
            line = self._detect(image, frame)
        except VisualMeshError as error:
            raise InputError(f"{frame.source}: {error}") from error
        self.replaced = self.replaced or self.pose.replaced_beside(frame)
        self.processed += 1
        return line

    def _detect(self, image: Image, frame: Frame) -> str:
        options, name = self.options, self.names.of(frame)
        size = image.shape[1], image.shape[0]
        lens, orientation = self.pose.of(frame, size)
        explain = options.explain or self.boxes is not None
        detections = self.pose_check.update(self.detector.detect(image, orientation, lens, explain=explain))
        self.remarks.add(frame.source, image, lens, orientation, detections, orientation is self.pose.orientation)
        if self.tracker is not None:
            detections = self.tracker.update(detections, frame)
        if self.boxes is not None:
            self.boxes.write(frame, image, lens, orientation, detections)
            if not options.explain:
                detections = replace(detections, rejected=())
        if options.save_points is not None:
            save_points(options.save_points / f"{name}.npz", detections)
        if options.save_overlay is not None:
            save_overlay(options.save_overlay / f"{name}.jpg", frame, detections)
        if options.save_map is not None:
            save_map(options.save_map / f"{name}-map.png", frame, detections)
        if self.mcap is not None:
            self.mcap.write(frame, lens, orientation, detections)
        if self.video is not None:
            self.video.write(detections.draw())
        message = file_message(frame, detections, self.emit_points, options.explain)
        return json.dumps(message, allow_nan=False) if options.json else to_readable_line(message)
