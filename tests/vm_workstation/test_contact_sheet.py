"""Contact sheets: which pictures they choose."""

from vm_workstation.contact_sheet import choose_indices


def test_which_pictures_are_choose_indices():
    numbers = [0, 1, 4, 5, 6, 9, 12]
    assert choose_indices(numbers, 3) == [0, 5, 12]
    assert choose_indices(numbers, 99) == numbers
    assert choose_indices(numbers, 1) == [0]
    assert choose_indices([], 5) == []
    assert choose_indices(numbers, 3, first=2) == [4, 5, 6]
    assert choose_indices(numbers, 3, first=13) == []
    assert (
        choose_indices(numbers, 4, seed=1)
        == choose_indices(numbers, 4, seed=1)
        == sorted(set(choose_indices(numbers, 4, seed=1)))
    )
    assert len({tuple(choose_indices(numbers, 3, seed=seed)) for seed in range(20)}) > 5
