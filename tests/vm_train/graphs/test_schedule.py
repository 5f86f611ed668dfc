"""What a training looks at, and when."""

from hypothesis import given
from hypothesis import strategies as st

from vm_train.graphs.schedule import schedule

plans = st.builds(
    lambda seed, *rest: (seed, *rest),
    st.tuples(st.integers(0, 9), st.integers(1, 3)),
    st.integers(1, 4),
    st.integers(1, 9),
    st.integers(1, 30),
    st.integers(0, 20),
    st.integers(1, 3),
)


@given(plans)
def test_every_epoch_looks_at_every_picture_so_often_and_then_at_all_of_the_validation(plan):
    _, epochs, batch, training, validation, repeats = plan
    batches = list(schedule(*plan))
    for epoch in range(epochs):
        own = [each for each in batches if each.epoch == epoch]
        learned = [item.position for each in own if not each.validates for item in each.items]
        checked = [item.position for each in own if each.validates for item in each.items]
        assert sorted(learned) == [each for each in range(training) for _ in range(repeats)]
        assert checked == list(range(training, training + validation))
        assert [each.validates for each in own] == sorted(each.validates for each in own)
        assert sum(each.last for each in own) == 1 + (validation > 0)
    steps = [each.step for each in batches if not each.validates]
    assert steps == list(range(1, epochs * -(-repeats * training // batch) + 1))


@given(plans, st.integers(1, 4))
def test_processes_share_every_batch(plan, size):
    for batch in schedule(*plan):
        parts = [batch.part(rank, size).items for rank in range(size)]
        assert sorted(item.position for part in parts for item in part) == sorted(each.position for each in batch.items)


@given(plans)
def test_the_same_seed_gives_the_same_plan_and_each_look_has_a_seed_of_its_own(plan):
    batches = list(schedule(*plan))
    assert batches == list(schedule(*plan))
    seeds = [item.seed for each in batches for item in each.items if item.seed is not None]
    assert len(set(seeds)) == len(seeds) == plan[1] * plan[3] * plan[5]
