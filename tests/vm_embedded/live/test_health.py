"""What state a detector says that it is in, over made-up times."""

import math

from hypothesis import given
from hypothesis import strategies as st

from vm_embedded.live.health import Health


def answered(health, latencies, now=100.0):
    """State after frames that took so long, one each 30th of a second."""
    for number, latency in enumerate(latencies):
        health.add_answer(now - (len(latencies) - 1 - number) / 30.0, latency)
    return health.state(now, False, "")


@given(latencies=st.lists(st.floats(0.0, 1.0), min_size=15, max_size=60), budget=st.floats(1e-4, 1.0))
def test_frames_over_budget_at_the_median_of_fifteen_degrade_it(latencies, budget):
    over = sum(each > budget for each in latencies[-15:]) >= 8
    state, reason = answered(Health(1.0, budget), latencies)
    assert state == ("degraded" if over else "ok")
    assert ("budget" in reason) == over


@given(latencies=st.lists(st.floats(0.0, 1.0), min_size=1, max_size=14))
def test_a_few_frames_say_nothing_of_a_budget(latencies):
    for budget in (1e-9, 2.0):
        assert answered(Health(1.0, budget), latencies) == ("starting", "timing the first 15 frames")
    assert answered(Health(1.0), latencies) == ("ok", "")


def test_without_a_budget_frames_may_take_any_time():
    assert answered(Health(1.0), [math.inf] * 30) == ("ok", "")


def test_fast_frames_make_it_ok_again():
    health = Health(1.0, 0.01)
    assert answered(health, [0.02] * 15)[0] == "degraded"
    assert answered(health, [0.005] * 8, 101.0)[0] == "ok"


def test_no_frames_are_worse_than_slow_ones():
    health = Health(1.0, 0.01)
    answered(health, [0.02] * 15)
    assert health.state(105.0, True, "unplugged") == ("camera_lost", "unplugged")
