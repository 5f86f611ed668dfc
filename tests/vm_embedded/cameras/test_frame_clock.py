"""Laws of the time of a frame, over streams that stall."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vm_embedded.cameras.frame_clock import FrameClock

RATES = st.sampled_from([10.0, 15.0, 30.0, 60.0, 120.0])
STALLS = st.lists(st.tuples(st.floats(1.0, 3.0), st.floats(0.1, 2.0)), min_size=1, max_size=4)
LATENCY = 0.02
JITTER = 0.004


def stream(rate, stalls, seconds=20.0, seed=0):
    """Times when the frames of a stream were taken, and when they arrived. stalls: pauses before them, and lengths [s].

    What waits during a stall arrives in a burst at its end.
    """
    random = np.random.default_rng(seed)
    taken = np.arange(0.0, seconds, 1.0 / rate)
    arrived = taken + LATENCY + random.uniform(0.0, JITTER, len(taken))
    at = 0.0
    for pause, length in stalls:
        at += pause
        held = (arrived >= at) & (arrived < at + length)
        arrived[held] = at + length + 1e-4 * np.arange(held.sum())
        at += length
    return taken, np.maximum.accumulate(arrived)


@settings(max_examples=60)
@given(RATES, STALLS, st.integers(0, 99), st.one_of(st.none(), st.floats(-1e9, 1e9)))
def test_no_frame_of_a_stream_that_stalls_is_said_to_be_newer_than_it_is(rate, stalls, seed, ahead):
    taken, arrived = stream(rate, stalls, seed=seed)
    clock = FrameClock()
    stamps = [None] * len(taken) if ahead is None else (taken + ahead).tolist()
    said = np.array([clock.taken(*each) for each in zip(arrived.tolist(), stamps, strict=True)])
    assert (said <= arrived + 1e-6).all()
    # A stall shorter than the jitter that is allowed may go unnoticed.
    assert (said - taken).max() < LATENCY + JITTER + 0.05 + 0.02


@settings(max_examples=60)
@given(RATES, STALLS, st.integers(0, 99))
def test_a_second_after_a_stall_all_frames_are_as_new_as_before(rate, stalls, seed):
    taken, arrived = stream(rate, stalls, seed=seed)
    end = sum(map(sum, stalls))
    clock = FrameClock()
    said = np.array([clock.taken(each) for each in arrived.tolist()])
    after = taken > end + 1.0
    np.testing.assert_array_equal(said[after], arrived[after])


@pytest.mark.parametrize("opening", [0.02, 0.3, 0.8, 3.0])
@pytest.mark.parametrize("rate", [10.0, 30.0, 60.0])
def test_frames_that_waited_while_a_stream_was_opened_are_old(rate, opening):
    taken = np.arange(0.0, 6.0, 1.0 / rate)
    arrived = np.maximum(taken + LATENCY, opening + 5e-3 * np.arange(len(taken)))
    clock = FrameClock(0.0)
    said = np.array([clock.taken(each) for each in arrived.tolist()])
    assert (said - taken).max() < LATENCY + 0.05
    np.testing.assert_array_equal(said[taken > 5.0], arrived[taken > 5.0])


def test_frames_that_are_ready_after_a_stall_are_old_also_for_a_slow_reader():
    """Frames come every 66 ms; after a second without one, the reader takes 60 ms for each of those that waited."""
    taken, at, clock = np.arange(0.0, 6.0, 1 / 15), 0.0, FrameClock()
    for each in taken.tolist():
        asked, at = at, max(at, each + LATENCY, 3.0 if each > 2.0 else 0.0)
        assert clock.taken(at, waited=at - asked) <= each + LATENCY + 1e-9
        at += 0.06


@pytest.mark.parametrize("stamped", [False, True])
def test_after_a_pause_of_the_camera_without_a_burst_few_frames_count_as_old(stamped):
    taken = np.concatenate([np.arange(0.0, 3.0, 1 / 30), np.arange(4.0, 7.0, 1 / 30)])
    clock = FrameClock()
    said = np.array([clock.taken(each + LATENCY, each if stamped else None) for each in taken.tolist()])
    assert (np.abs(said - taken - LATENCY) > 0.01).sum() == (0 if stamped else 2)


def test_another_rate_is_learned():
    taken = np.concatenate([np.arange(0.0, 2.0, 1 / 30), np.arange(2.0, 6.0, 0.2), np.arange(6.0, 8.0, 1 / 60)])
    clock = FrameClock()
    said = np.array([clock.taken(each) for each in taken.tolist()])
    for begin, end in ((0.0, 2.0), (4.0, 8.0)):
        within = (taken >= begin) & (taken < end)
        np.testing.assert_array_equal(said[within], taken[within])


@pytest.mark.parametrize("jump", [-3600.0, -1.0, 1.0, 3600.0])
def test_a_server_whose_clock_is_set_is_still_believed(jump):
    taken = np.arange(0.0, 4.0, 1 / 30)
    stamps = np.where(taken < 2.0, taken, taken + jump)
    clock = FrameClock()
    said = np.array([clock.taken(*each) for each in zip((taken + LATENCY).tolist(), stamps.tolist(), strict=True)])
    assert np.abs(said - taken - LATENCY).max() < 0.01


@given(st.lists(st.one_of(st.none(), st.floats()), max_size=30))
def test_stamps_that_make_no_sense_never_give_a_time_in_the_future(stamps):
    clock = FrameClock()
    for number, stamp in enumerate(stamps):
        said = clock.taken(100.0 + number, stamp)
        assert math.isfinite(said)
        assert said <= 100.0 + number
