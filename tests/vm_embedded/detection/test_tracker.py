"""Tracks of simulated balls that roll, cross, vanish and are kicked, and of balls that the detector finds."""

import math

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.vm_embedded.detection.rolling import HEIGHT, RADIUS, Ball, any_ball, detection_at, detections_of
from vm_embedded import Detector, InputError, Orientation, Tracker, TrackSettings
from vm_embedded.cameras.camera import CameraSettings
from vm_embedded.cameras.synthetic import SyntheticCamera

FRAME = 1.0 / 30.0
"""Time between two frames [s]."""

RUNS = range(100)


def rms(errors):
    return math.sqrt(np.mean(np.square(errors)))


def frame_times(seconds, start=5.0):
    return start + FRAME * np.arange(round(seconds / FRAME))


@pytest.mark.long
def test_a_rolling_ball_is_where_the_track_says_more_than_where_single_detections_are():
    single, tracked, velocity = [], [], []
    for seed in RUNS:
        random = np.random.default_rng(seed)
        ball, tracker = any_ball(random), Tracker()
        for time in frame_times(2.0, 0.0):
            (found,) = tracker.update(detections_of([detection_at(ball.place(time), random)]), time)
            single.append(np.linalg.norm(found.position[:2] - ball.place(time)))
            tracked.append(np.linalg.norm(found.track.position[:2] - ball.place(time)))
        velocity.append(np.linalg.norm(found.track.velocity - ball.velocity_at(time)) / found.track.velocity_error)
    print(f"single {100 * rms(single):.1f} cm, tracked {100 * rms(tracked):.1f} cm: {rms(tracked) / rms(single):.2f}")
    assert rms(tracked) <= 0.7 * rms(single)
    assert np.median(tracked) <= 0.7 * np.median(single)
    assert np.median(velocity) < 2.0  # the error of the velocity is what it is said to be


def test_a_ball_that_the_detector_finds_is_where_its_track_says():
    """Drawn frames, the detector of the package, and poses with errors of 0.3 degrees and 1 cm."""
    camera, detector, tracker = (
        SyntheticCamera(CameraSettings(source="synthetic")),
        Detector.from_file("ball"),
        Tracker(),
    )
    random = np.random.default_rng(1)
    single, tracked, numbers = [], [], set()
    for time in frame_times(4.0, 100.0):
        exact = camera.motion.orientation(time)
        turned = cv2.Rodrigues(random.normal(0.0, math.radians(0.3), 3))[0]
        pose = Orientation(exact.height + random.normal(0.0, 0.01), exact.rotation @ turned)
        for found in tracker.update(detector.detect(camera.draw(time), pose, camera.lens), time):
            numbers.add(found.track.id)
            single.append(np.linalg.norm(found.position - camera.motion.ball(time)))
            tracked.append(np.linalg.norm(found.track.position - camera.motion.ball(time)))
    print(f"single {100 * rms(single):.1f} cm, tracked {100 * rms(tracked):.1f} cm: {rms(tracked) / rms(single):.2f}")
    assert len(single) > 100
    assert numbers == {1}
    assert rms(tracked) <= 0.7 * rms(single)


def test_the_smallest_errors_leave_the_tracks_finite():
    settings = TrackSettings(center_error=0.0, pixel_error=0.0, pose_error=1e-6, height_error=0.0, wander=0.0)
    tracker, random = Tracker(settings), np.random.default_rng(1)
    for time in (1.0, 1.0, 1.0, 1.1):
        found = tracker.update(detections_of([detection_at(np.array([2.0, 0.5]), random)]), time)
        assert all(np.isfinite(each.track.position).all() for each in found)
    with pytest.raises(InputError, match="pose_error must be an angle"):
        TrackSettings(pose_error=0.0)


@pytest.mark.long
def test_a_ball_keeps_its_number_when_it_is_hidden_for_a_third_of_a_second():
    kept = 0
    for seed in RUNS:
        random = np.random.default_rng(seed)
        ball, tracker = any_ball(random), Tracker()
        hidden = random.uniform(0.5, 1.5)
        numbers = set()
        for time in frame_times(2.5, 0.0):
            shown = [] if hidden <= time < hidden + 0.3 else [detection_at(ball.place(time), random)]
            numbers |= {each.track.id for each in tracker.update(detections_of(shown), time)}
        kept += numbers == {1}
    print(f"{kept} of {len(RUNS)} keep their number")
    assert kept >= 95


def crossing(random):
    """Two balls whose ways cross; one is a moment later at the crossing, so that they do not touch."""
    middle = np.array([random.uniform(1.2, 2.5), random.uniform(-0.5, 0.5)])
    ways = random.uniform(0.0, 2.0 * math.pi) + np.array([0.0, random.uniform(0.7, math.pi)])
    balls = []
    for way, late in zip(ways, (0.0, random.choice((-1.0, 1.0))), strict=True):
        velocity = random.uniform(0.8, 1.5) * np.array([math.cos(way), math.sin(way)])
        at_crossing = 0.7 + late * 3.0 * RADIUS / np.linalg.norm(velocity)
        balls.append(Ball(middle - Ball(np.zeros(2), velocity).place(at_crossing), velocity))
    one, other = ([each.place(time) for time in frame_times(1.4, 0.0)] for each in balls)
    touch = np.linalg.norm(np.subtract(one, other), axis=1).min() < 2.0 * RADIUS
    return crossing(random) if touch else balls


def visible(balls, time):
    """The numbers of the balls that no nearer one hides by more than half."""
    places = [each.place(time) for each in balls]
    near = min((0, 1), key=lambda each: np.linalg.norm(places[each]))
    bearings = [math.atan2(y, x) for x, y in places]
    hidden = abs(bearings[0] - bearings[1]) < math.asin(RADIUS / np.linalg.norm([*places[near], HEIGHT - RADIUS]))
    return [near] if hidden else [0, 1]


@pytest.mark.long
def test_two_balls_that_cross_keep_their_numbers():
    """One passes just behind the other, or hides it for a while."""
    kept = hidden = 0
    for seed in RUNS:
        random = np.random.default_rng(seed)
        balls, tracker, numbers = crossing(random), Tracker(), ([], [])
        for time in frame_times(1.4, 0.0):
            shown = visible(balls, time)
            found = tracker.update(
                detections_of([detection_at(balls[each].place(time), random) for each in shown]), time
            )
            for each, one in zip(shown, found, strict=True):
                numbers[each].append(one.track.id)
            hidden += len(shown) == 1
        kept += sorted(map(set, numbers), key=min) == [{1}, {2}]
    print(f"{kept} of {len(RUNS)} pairs keep their numbers; {hidden} balls are hidden")
    assert hidden > 100
    assert kept >= 95


def test_a_ball_that_vanishes_is_forgotten_and_the_next_one_is_another():
    random, tracker = np.random.default_rng(0), Tracker(TrackSettings(forget=0.5))
    for time in frame_times(1.0, 0.0):
        tracker.update(detections_of([detection_at((2.0, 0.5), random)]), time)
    assert [each.id for each in tracker.tracks] == [1]
    assert len(tracker.update(detections_of([]), 1.4)) == 0
    (gone,) = tracker.tracks
    assert (gone.id, gone.count, gone.time) == (1, 30, pytest.approx(29 * FRAME))
    np.testing.assert_allclose(gone.position_at(gone.time + 2.0), gone.position + 2.0 * np.append(gone.velocity, 0.0))
    tracker.update(detections_of([]), 1.5)
    assert tracker.tracks == ()
    (other,) = tracker.update(detections_of([detection_at((2.0, 0.5), random)]), 1.6)
    assert other.track.id == 2


def test_a_ball_elsewhere_is_another_ball():
    tracker = Tracker()
    for time in frame_times(0.5, 0.0):
        tracker.update(detections_of([detection_at((2.0, 0.5))]), time)
    (other,) = tracker.update(detections_of([detection_at((1.0, -1.0))]), 0.9)
    assert other.track.id == 2
    (again,) = tracker.update(detections_of([detection_at((2.0, 0.5))]), 0.95)
    assert again.track.id == 1


@pytest.mark.long
def test_a_ball_that_is_kicked_keeps_its_number_and_gets_its_velocity():
    kept, early, late = 0, [], []
    for seed in RUNS:
        random, tracker = np.random.default_rng(seed), Tracker()
        heading, speed = random.uniform(-0.6, 0.6), random.uniform(1.0, 4.0)
        kicked = Ball(np.array([1.0, 0.1]), speed * np.array([math.cos(heading), math.sin(heading)]))
        kick, numbers, off = random.uniform(0.8, 1.0), set(), []
        for time in frame_times(1.6, 0.0):
            (found,) = tracker.update(detections_of([detection_at(kicked.place(max(time - kick, 0.0)), random)]), time)
            numbers.add(found.track.id)
            off.append(np.linalg.norm(found.track.velocity - kicked.velocity_at(max(time - kick, 0.0))))
        kept += numbers == {1}
        early.append(off[round((kick + 0.2) / FRAME)])
        late.append(off[round((kick + 0.5) / FRAME)])
    print(f"{kept} keep; median error of the velocity {np.median(early):.2f} and {np.median(late):.2f} m/s")
    assert kept >= 95
    assert np.median(early) < 0.5
    assert np.median(late) < 0.3


def test_tracks_of_several_classes_and_false_alarms_do_not_mix():
    random, tracker = np.random.default_rng(0), Tracker()
    balls, cups = set(), set()
    for number, time in enumerate(frame_times(2.0, 0.0)):
        shown = [detection_at((2.0, 0.0), random), detection_at((2.05, 0.0), random, "cup")]
        if number % 3 == 0:
            shown.insert(0, detection_at(random.uniform((1.0, 0.6), (3.0, 1.5)), random))
        found = tracker.update(detections_of(shown), time)
        balls.add(found[-2].track.id)
        cups.add(found[-1].track.id)
    assert len(balls) == len(cups) == 1
    assert {each.class_name for each in tracker.tracks if each.id in cups} == {"cup"}


def test_a_number_is_used_once():
    random, tracker, seen = np.random.default_rng(0), Tracker(TrackSettings(forget=0.1)), []
    for time in frame_times(20.0, 0.0):
        shown = [detection_at(random.uniform((0.5, -3.0), (6.0, 3.0))) for _ in range(random.integers(0, 3))]
        seen.append({each.track.id for each in tracker.update(detections_of(shown), time)})
    last = {number: frame for frame, numbers in enumerate(seen) for number in numbers}
    first = {number: frame for frame, numbers in reversed(list(enumerate(seen))) for number in numbers}
    assert sorted(last) == list(range(1, max(last) + 1))
    assert sorted(first, key=lambda number: (first[number], number)) == sorted(first)


@given(st.integers(0, 2**32 - 1))
def test_with_odometry_tracks_are_those_of_a_robot_that_stands(seed):
    """The same world, seen by a robot that walks and turns, and by one that stands."""
    random = np.random.default_rng(seed)
    standing, walking = Tracker(), Tracker(TrackSettings())
    place, heading = np.zeros(2), 0.0
    ball = any_ball(random)
    for time in frame_times(0.5, 0.0):
        moved = (*random.uniform(-0.05, 0.05, 2), random.uniform(-0.2, 0.2))
        place = place + turn(heading) @ moved[:2]
        heading += moved[2]
        # The place in the walking robot's frame; errors grow with the distance, so they are those of the other robot.
        (one,) = standing.update(detections_of([detection_at(ball.place(time))]), time)
        other = detection_at(turn(-heading) @ (ball.place(time) - place))
        (other,) = walking.update(detections_of([other]), time, moved)
    there = place + turn(heading) @ other.track.position[:2]
    assert np.linalg.norm(there - one.track.position[:2]) < 0.02
    assert np.linalg.norm(turn(heading) @ other.track.velocity - one.track.velocity) < 0.15


def turn(angle):
    return np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])


def test_the_walk_of_a_robot_moves_a_ball_that_lies_unless_odometry_is_told():
    for told, expected in ((False, -0.5), (True, 0.0)):
        tracker = Tracker()
        for time in frame_times(2.0, 0.0):
            ball = detection_at((3.0 - 0.5 * time, 0.2))
            (found,) = tracker.update(detections_of([ball]), time, (0.5 * FRAME, 0.0, 0.0) if told and time else None)
        np.testing.assert_allclose(found.track.velocity, (expected, 0.0), atol=0.01)


def test_a_clock_that_goes_back_a_little_keeps_tracks_and_a_new_film_starts_anew():
    tracker = Tracker()
    for time, number in ((50.0, 1), (50.1, 1), (50.095, 1), (50.2, 1), (0.0, 2), (0.1, 2), (80.0, 3)):
        (found,) = tracker.update(detections_of([detection_at((2.0, 0.0))]), time)
        assert found.track.id == number, time
        assert np.isfinite(found.track.covariance).all()


def test_settings_may_change_while_tracks_go_on():
    tracker = Tracker(TrackSettings(forget=5.0))
    tracker.update(detections_of([detection_at((2.0, 0.0))]), 0.0)
    tracker.settings = TrackSettings(forget=6.0)
    (found,) = tracker.update(detections_of([detection_at((2.0, 0.0))]), 5.5)
    assert found.track.id == 1


@pytest.mark.parametrize(("time", "moved"), [(math.nan, None), (math.inf, None), (1.0, (0.0, math.nan, 0.0))])
def test_numbers_that_are_not_finite_are_refused(time, moved):
    with pytest.raises(InputError, match="must be finite"):
        Tracker().update(detections_of([]), time, moved)


@pytest.mark.parametrize("moved", [(0.0, 0.0), (0.0, 0.0, 0.0, 0.0), 0.1, "left"])
def test_a_move_that_is_not_three_numbers_is_refused(moved):
    with pytest.raises(InputError, match=r"moved must be finite x, y \[m\] and turn \[rad\], not "):
        Tracker().update(detections_of([]), 0.0, moved)


@pytest.mark.parametrize("kind", [tuple, list, np.array])
def test_a_move_is_any_three_numbers(kind):
    tracker = Tracker()
    tracker.update(detections_of([detection_at((2.0, 0.0))]), 0.0)
    tracker.update(detections_of([]), 0.1, kind([0.5, 0.0, 0.0]))
    np.testing.assert_allclose(tracker.tracks[0].position[:2], (1.5, 0.0))


def test_detections_keep_all_but_their_tracks_and_times():
    before = detections_of([detection_at((2.0, 0.1)), detection_at((3.0, 0.1))])
    after = Tracker().update(before, 0.0)
    assert [each.as_dict() | {"track": None} for each in after] == [each.as_dict() | {"track": None} for each in before]
    assert [each.as_dict()["track"]["id"] for each in after] == [1, 2]
    assert list(after.timing_ms) == ["track", "total"]
    assert after.timing_ms["total"] == pytest.approx(1.0 + after.timing_ms["track"])
