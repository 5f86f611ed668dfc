"""Follow objects over the frames of a camera: each gets a number, a smoothed position and a velocity.

`follow` is the whole method, a pure function; a Tracker keeps the tracks between two calls of it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from ..arrays import Floats, numbers_or_nan, one_number
from ..errors import InputError
from ..geometry.orientation import rotation_z
from .detection import Detection
from .detections import Detections
from .observation import Stopwatch
from .track import Track
from .track_settings import TrackSettings

Move = tuple[float, float, float]
"""How the origin of the plane's frame has moved: x, y [m] and the turn around z [rad], in the old frame."""

_KICK = 0.15
"""A track may change its velocity at once while its last detection is not older than this [s]. Later, an object that
appears somewhere near is more likely another one."""


class Tracker:
    """Gives each detected object a track: a number, a smoothed position and a velocity.

        tracker = Tracker()
        for time, image in frames:
            for ball in tracker.update(detector.detect(image, orientation, lens), time):
                print(ball.track.id, ball.track.position, ball.track.velocity)

    A Kalman filter with constant velocity smooths the places. The uncertainty of each detection follows from its
    bearing and distance. All places are in the plane's frame, whose origin is below the camera. So objects that lie
    still have a velocity while the robot walks, unless `update` is told how the robot has moved. The frame must not
    turn with the camera: give orientations with their yaw.
    """

    def __init__(self, settings: TrackSettings | None = None) -> None:
        self.settings = settings or TrackSettings()
        self._tracks: tuple[Track, ...] = ()
        self._used = 0  # the largest number of a track so far

    @property
    def tracks(self) -> tuple[Track, ...]:
        """The current tracks, also of objects that the last frame did not show, each at its last detection."""
        return self._tracks

    def update(self, detections: Detections, time: float, moved: npt.ArrayLike | None = None) -> Detections:
        """The same detections, each object with its track.

        time: of the frame [s], on any clock; if it jumps by more than `forget`, all tracks start anew. moved: how the
        robot has moved since the last call, by its odometry: x and y [m], and the turn [rad] (counterclockwise), in the
        plane's frame of the last call.

        Raises InputError if a number is not finite, or if `moved` is not three numbers.
        """
        time = one_number(time, "time")
        if not math.isfinite(time):
            raise InputError(f"time must be finite [s], not {time}")
        move = None if moved is None else _checked_move(moved)
        watch = Stopwatch()
        tracks = [each if move is None else _seen_from(each, move) for each in self._tracks]
        found, rest = follow(tracks, detections.objects, time, self.settings, self._used + 1)
        self._tracks = (*found, *rest)
        self._used = max([self._used, *(each.id for each in found)])
        objects = tuple(replace(each, track=track) for each, track in zip(detections.objects, found, strict=True))
        watch.lap("track")
        timing = {**detections.timing_ms, **watch.stages}
        timing["total"] = timing.pop("total", 0.0) + watch.stages["track"]  # the total stays the last
        return replace(detections, objects=objects, timing_ms=timing)


def follow(
    tracks: Sequence[Track], objects: Sequence[Detection], time: float, settings: TrackSettings, first_id: int
) -> tuple[list[Track], list[Track]]:
    """The track of each object of a frame at a time [s], and the tracks without an object that are not forgotten yet.

    first_id: number of the first new track. Objects continue tracks of the same class in three steps:

    1. Each track predicts where its object is now. An object within the gate continues the track; the likeliest pairs
       are chosen first.
    2. The other tracks that were seen a moment ago may have been kicked: their velocity becomes unknown, up to
       `max_speed`, and they get a second chance.
    3. Each of the remaining objects starts a track of unknown velocity.
    """
    rest = [each for each in tracks if abs(time - each.time) <= settings.forget]
    places, errors = np.array([each.position[:2] for each in objects]).reshape(-1, 2), place_errors(objects, settings)
    found: dict[int, Track] = {}
    for kicked in (False, True):
        waiting = [each for each in rest if not kicked or time - each.time <= _KICK]
        expected = [_expected(_kicked(each, settings) if kicked else each, time, settings) for each in waiting]
        costs = np.full((len(waiting), len(objects)), math.inf)
        for row, track in enumerate(waiting):
            squares, costs[row] = squared_distances(*expected[row], places, errors)
            costs[row, squares > settings.gate**2] = math.inf
            other = [each for each, one in enumerate(objects) if one.class_name != track.class_name]
            costs[row, [*other, *found]] = math.inf
        for row, column in _cheapest_pairs(costs):
            now = correct(*expected[row], places[column], errors[column])
            found[column] = _continued(waiting[row], objects[column], time, *now)
            rest.remove(waiting[row])
    fresh = [each for each in range(len(objects)) if each not in found]
    for number, column in enumerate(fresh, start=first_id):
        found[column] = _started(number, objects[column], time, errors[column], settings)
    return [found[column] for column in range(len(objects))], rest


def _cheapest_pairs(costs: Floats) -> Iterator[tuple[int, int]]:
    """Pairs of a row and a column of costs (n, m), the cheapest first, each row and column at most once; inf: never."""
    costs = costs.copy()
    while costs.size and math.isfinite(costs.min()):
        row, column = divmod(int(costs.argmin()), costs.shape[1])
        costs[row], costs[:, column] = math.inf, math.inf
        yield row, column


def _expected(track: Track, time: float, settings: TrackSettings) -> tuple[Floats, Floats]:
    """State (4,) and covariance (4, 4) of a track's object at a time [s]."""
    elapsed = max(time - track.time, 0.0)  # a camera's clock may go back by some milliseconds
    return predict(np.append(track.position[:2], track.velocity), track.covariance, elapsed, settings.wander)


def _kicked(track: Track, settings: TrackSettings) -> Track:
    """The track with an unknown velocity."""
    return replace(track, velocity=np.zeros(2), covariance=_unknown_velocity(track.covariance[:2, :2], settings))


def _unknown_velocity(error: Floats, settings: TrackSettings) -> Floats:
    """The covariance (4, 4) of a place with this covariance (2, 2) and a velocity of up to `max_speed`."""
    covariance = (settings.max_speed / settings.gate) ** 2 * np.eye(4)
    covariance[:2, :2] = error
    return covariance


def _started(number: int, detection: Detection, time: float, error: Floats, settings: TrackSettings) -> Track:
    covariance = _unknown_velocity(error, settings)
    return Track(number, detection.class_name, time, detection.position, np.zeros(2), covariance, 1)


def _continued(track: Track, detection: Detection, time: float, state: Floats, covariance: Floats) -> Track:
    return replace(
        track,
        time=max(time, track.time),
        position=np.append(state[:2], detection.position[2]),
        velocity=state[2:],
        covariance=covariance,
        count=track.count + 1,
    )


def _checked_move(moved: npt.ArrayLike) -> Move:
    """The three numbers of a move. Raises InputError."""
    numbers = numbers_or_nan(moved)
    if numbers.shape != (3,) or not np.isfinite(numbers).all():
        raise InputError(f"moved must be finite x, y [m] and turn [rad], not {moved!r}")
    x, y, turn = numbers.tolist()
    return x, y, turn


def _seen_from(track: Track, moved: Move) -> Track:
    """The track in the plane's frame after the robot has moved."""
    x, y, turn = moved
    back = rotation_z(-turn)
    both = np.kron(np.eye(2), back[:2, :2])
    return replace(
        track,
        position=back @ (track.position - (x, y, 0.0)),
        velocity=back[:2, :2] @ track.velocity,
        covariance=both @ track.covariance @ both.T,
    )


def predict(state: Floats, covariance: Floats, elapsed: float, wander: float) -> tuple[Floats, Floats]:
    """State and covariance after a time [s].

    The velocity changes by independent random steps (white noise of the acceleration), in a second by `wander` [m/s].
    """
    move, noise = np.eye(4), np.zeros((4, 4))
    for axis in (0, 1):
        move[axis, axis + 2] = elapsed
        noise[axis::2, axis::2] = ((elapsed**3 / 3.0, elapsed**2 / 2.0), (elapsed**2 / 2.0, elapsed))
    return move @ state, move @ covariance @ move.T + wander**2 * noise


def squared_distances(state: Floats, covariance: Floats, places: Floats, errors: Floats) -> tuple[Floats, Floats]:
    """How far m measured places (m, 2) with covariances (m, 2, 2) are from a predicted state.

    Returns squared Mahalanobis distances (m,), which have the chi-squared distribution with two degrees of freedom for
    the right object, and twice the negative logarithms (m,) of the likelihoods, but for a constant.
    """
    off = places - state[:2]
    spread = covariance[:2, :2] + errors
    squares = (off[:, None] @ np.linalg.solve(spread, off[..., None])).reshape(-1)
    return squares, squares + np.log(np.linalg.det(spread))


def correct(state: Floats, covariance: Floats, place: Floats, error: Floats) -> tuple[Floats, Floats]:
    """State and covariance after a measurement of the place (2,) with a covariance (2, 2)."""
    gain = np.linalg.solve(covariance[:2, :2] + error, covariance[:2]).T
    rest = np.eye(4)
    rest[:, :2] -= gain
    # Joseph's form stays symmetric and positive.
    return state + gain @ (place - state[:2]), rest @ covariance @ rest.T + gain @ error @ gain.T


_LEVEL = 1e-3
"""Smallest sine of the angle between a bearing and the plane: a bearing along the plane never meets it."""


def place_errors(detections: Sequence[Detection], settings: TrackSettings) -> Floats:
    """Covariances (m, 2, 2) [m²] of the places of m detections on the plane, in its frame.

    A detection's place is where its bearing meets the plane at the height of its center. With the distance D from the
    camera to the center, and the angle a of the bearing below the horizon, errors move the place so:

    - An angle e between the true and the measured bearing: by D e across the bearing, and by D e / sin(a) along it.
    - An error g of the camera's height: by g / tan(a) along the bearing.

    The angle e has three independent causes, which are added as squares: the center that the network found is off by a
    share of the angular radius (`center_error`) and by a part of a pixel (`pixel_error`), and the camera's orientation
    is not exact (`pose_error`). With a camera 0.8 m above the ground and the default settings, a ball at 3 m is
    uncertain by 2 cm across the bearing and by 8 cm along it, a ball at 6 m by 3 cm and 29 cm.
    """
    bearings = np.array([each.bearing for each in detections]).reshape(-1, 3)
    distances = np.array([each.distance for each in detections])
    radii = np.array([each.angular_radius for each in detections])
    pixels = np.array([each.radius for each in detections])
    pixel = np.divide(radii, pixels, out=np.zeros_like(radii), where=pixels > 0.0)  # angle of a pixel [rad]
    angle = np.sqrt((settings.center_error * radii) ** 2 + (settings.pixel_error * pixel) ** 2 + settings.pose_error**2)
    sine = np.maximum(-bearings[:, 2], _LEVEL)
    level = np.hypot(bearings[:, 0], bearings[:, 1])
    ahead = bearings[:, :2] / np.maximum(level, 1e-9)[:, None]
    ahead[level < 1e-9] = (1.0, 0.0)  # straight below the camera, both errors are alike
    beside = np.column_stack([-ahead[:, 1], ahead[:, 0]])
    along = (distances * angle / sine) ** 2 + (settings.height_error * level / sine) ** 2
    across = (distances * angle) ** 2
    return np.asarray(along[:, None, None] * _squares(ahead) + across[:, None, None] * _squares(beside))


def _squares(directions: Floats) -> Floats:
    """The outer products (m, 2, 2) of unit vectors (m, 2) with themselves."""
    return directions[:, :, None] * directions[:, None, :]
