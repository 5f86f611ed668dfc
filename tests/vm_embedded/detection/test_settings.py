import math
from dataclasses import FrozenInstanceError, fields

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_embedded.config.entries import checked
from vm_embedded.detection.pixel_formats import FORMATS
from vm_embedded.detection.settings import Settings
from vm_embedded.errors import InputError

KNOWN = {each.name: each for each in fields(Settings)}
RANGES = {name: each.metadata["limits"] for name, each in KNOWN.items() if "limits" in each.metadata}
CHOICES = {name: each.metadata["allowed"] for name, each in KNOWN.items() if "allowed" in each.metadata}
WHOLE = {"threads"}
ANGLES = {"pitch_step", "roll_step"}


def test_the_defaults_are_within_their_ranges():
    assert Settings() == Settings(**{name: each.default for name, each in KNOWN.items()})


def test_every_setting_says_what_it_is_for():
    for name, each in KNOWN.items():
        assert len(each.metadata["help"]) > 10, name
        assert isinstance(each.metadata["unit"], str), name
        kinds = ("limits" in each.metadata) + ("allowed" in each.metadata) + isinstance(each.default, bool)
        assert kinds == 1, name


def test_one_thread_that_does_not_spin_is_what_a_robot_gets_unless_it_asks():
    assert Settings().threads == 1
    assert Settings().spinning is False


@pytest.mark.parametrize("name", RANGES)
@given(st.floats(0.0, 1.0))
def test_every_value_of_a_range_is_accepted(name, share):
    low, high = RANGES[name]
    value = round(low + share * (high - low)) if name in WHOLE else min(low + share * (high - low), high)
    assert getattr(Settings(**{name: value}), name) == value


@pytest.mark.parametrize("name", RANGES)
@given(st.one_of(st.floats(1e-6, 1e6), st.just(math.inf)), st.booleans())
def test_every_value_out_of_a_range_is_refused_by_name_and_range(name, beyond, below):
    low, high = RANGES[name]
    value = low - beyond * max(abs(low), 1.0) if below else high + beyond * max(abs(high), 1.0)
    with pytest.raises(InputError) as caught:
        Settings(**{name: value})
    for part in (name, f"{low:g}", f"{high:g}", repr(value), KNOWN[name].metadata["unit"]):
        assert part in str(caught.value)


@pytest.mark.parametrize("name", RANGES)
@pytest.mark.parametrize("value", [math.nan, "1", "", True, [1.0], {}])
def test_what_is_no_number_of_the_range_is_refused_by_name(name, value):
    if name in ANGLES and value == "1":
        value = "1deg2"  # the text of an angle may be a number, as the option gives it
    with pytest.raises(InputError, match=name):
        Settings(**{name: value})


@pytest.mark.parametrize("name", sorted(ANGLES))
@given(st.floats(0.1, 50.0))
def test_an_angle_may_be_in_degrees(name, degrees):
    assert getattr(Settings(**{name: f"{degrees}deg"}), name) == math.radians(degrees)
    with pytest.raises(InputError, match=rf"{name} must be .*, not '60deg'"):
        Settings(**{name: "60deg"})


@pytest.mark.parametrize("name", ["threads", "threshold"])
def test_a_number_of_more_digits_than_a_float_has_is_refused_by_name(name):
    with pytest.raises(InputError, match=name):
        Settings(**{name: 10**400})


@pytest.mark.parametrize("name", sorted(set(RANGES) - {"object_radius", "max_distance"}))
def test_a_setting_with_a_value_can_not_have_none(name):
    with pytest.raises(InputError, match=name):
        Settings(**{name: None})


@pytest.mark.parametrize("name", ["object_radius", "max_distance"])
def test_what_the_model_knows_may_be_left_to_it(name):
    assert getattr(Settings(**{name: None}), name) is None
    assert getattr(Settings(**{name: 0.11}), name) == 0.11


@pytest.mark.parametrize("value", [1.5, 2.0])
def test_threads_are_a_whole_number(value):
    with pytest.raises(InputError, match=r"threads must be a whole number from 1 to 256"):
        Settings(threads=value)


@pytest.mark.parametrize("value", [0, 1, "true", None, "yes"])
def test_a_switch_is_true_or_false(value):
    with pytest.raises(InputError, match=r"spinning must be true or false"):
        Settings(spinning=value)


def test_the_only_choice_is_the_pixel_format():
    assert CHOICES == {"format": FORMATS}


@pytest.mark.parametrize(("name", "value"), [(name, value) for name, allowed in CHOICES.items() for value in allowed])
def test_every_choice_is_accepted(name, value):
    assert getattr(Settings(**{name: value}), name) == value


@pytest.mark.parametrize(
    ("name", "wrong", "near"),
    [("format", "grey", "gray"), ("format", "bayer_rgbg", "bayer_rggb")],
)
def test_an_unknown_choice_names_the_nearest(name, wrong, near):
    with pytest.raises(InputError, match=rf"{name} '{wrong}'.*'{near}'"):
        Settings(**{name: wrong})


@pytest.mark.parametrize("name", CHOICES)
@pytest.mark.parametrize("value", [None, 1, True, ["bgr"]])
def test_a_choice_is_one_of_the_allowed_texts(name, value):
    with pytest.raises(InputError, match=name):
        Settings(**{name: value})


@given(
    st.sampled_from(sorted(KNOWN)),
    st.one_of(
        st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=4), st.lists(st.none(), max_size=2)
    ),
)
def test_a_value_that_passes_the_check_makes_settings_and_no_other_does(name, value):
    try:
        kept = checked(KNOWN[name], value)
    except InputError:
        with pytest.raises(InputError):
            Settings(**{name: value})
    else:
        assert getattr(Settings(**{name: value}), name) == kept == value


def test_settings_can_not_be_changed():
    with pytest.raises(FrozenInstanceError):
        Settings().threads = 2
