"""No user, password or token of a camera's address appears in a text."""

from urllib.parse import quote

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vm_embedded.borders.credentials import password_hint, without_credentials, without_password
from vm_embedded.errors import InputError, one_line

SECRET = "hunter2"


@pytest.mark.parametrize(
    ("source", "shown"),
    [
        ("http://user:hunter2@10.0.0.7:80/a", "http://10.0.0.7:80/a"),
        ("rtsp://hunter2@10.0.0.7/1", "rtsp://10.0.0.7/1"),
        ("http://u:pa/hunter2@127.0.0.1:8810/plain", "http://***@127.0.0.1:8810/plain"),
        ("http://u:hunter2#x@host/", "http://***@host/"),
        ("http://u:hunter2?x@host/", "http://***@host/"),
        ("http://u:12/hunter2@host/", "http://***@host/"),
        ("http://us/er:hunter2@host/", "http://***@host/"),
        ("http://u:hunter2@x@host/", "http://host/"),
        ("http://u:my hunter2@host/", "http://host/"),
        ("http://u:hunter2'\"x@host/", "http://host/"),
        ("HTTPS://u:hunter2@[::1]:81/", "HTTPS://[::1]:81/"),
        ("http:/u:hunter2@host/", "http:/host/"),
        ("http//u:hunter2@host/", "***@host/"),
        ("u:hunter2@host:8080/stream", "***@host:8080/stream"),
        ("http://host/cgi?user=hunter2&pwd=hunter2&size=1", "http://host/cgi?user=***&pwd=***&size=1"),
        ("http://host/cgi?loginpas=hunter2", "http://host/cgi?loginpas=***"),
        ("http://host/?access_token=hunter2#x", "http://host/?access_token=***"),
        ("http://host/?a=1;API-Key=hunter2", "http://host/?a=1;API-Key=***"),
        ("rtsp://host:554/user=hunter2&password=hunter2&channel=1", "rtsp://host:554/user=***&password=***&channel=1"),
        (
            "gstreamer:rtspsrc location=rtsp://u:hunter2@h/ user-pw=hunter2 user-id='hunter2 x' ! appsink",
            "gstreamer:rtspsrc location=rtsp://h/ user-pw=*** user-id=*** ! appsink",
        ),
    ],
)
def test_the_address_is_shown_without_its_secrets(source, shown):
    assert without_password(source) == shown
    assert str(InputError(shown)) == shown  # errors look for secrets again


@pytest.mark.parametrize(
    "source",
    ["http://host:80/stream?size=1", "http://host/people@home", "http://host/?mail=me", "film@home.mp4", "/dev/video0"],
)
def test_an_address_without_secrets_stays(source):
    assert without_password(source) == source


@given(
    st.text(st.characters(exclude_categories=["Cs", "Cc"]), min_size=1), st.sampled_from(["/", "?", "#", "@", "%", " "])
)
def test_no_password_is_shown_whatever_its_characters(around, odd):
    for secret in (SECRET + odd + around, around + odd + SECRET):
        shown = without_password(f"http://user:{secret}@127.0.0.1:8810/plain")
        assert SECRET not in shown
        assert shown.endswith("@127.0.0.1:8810/plain") or shown == "http://127.0.0.1:8810/plain"


@given(st.text(st.characters(codec="ascii", exclude_categories=["Cc"]), min_size=1))
def test_a_hint_comes_exactly_if_the_address_needs_it(password):
    """Written as the hint says, each password gives an address without a hint."""
    assert password_hint(f"http://user:{quote(password, safe='')}@host:80/stream") == ""
    if set(password) & set("/?#"):
        assert "%23" in password_hint(f"http://user:{password}@host:80/stream")


def test_errors_and_messages_of_other_libraries_show_no_secret():
    text = f"can't open 'http://u:{SECRET}@h/x', then rtsp://a:{SECRET}@h/?token={SECRET}"
    assert SECRET not in str(InputError(text)) + one_line(OSError(text)) + without_credentials(text)
    assert "'http://h/x'" in str(InputError(text))
