"""The token of the status page: kept for the next start, and only for the user of the daemon."""

import re
import threading

import pytest

from vm_embedded.live.page_token import TOKEN_FILE, kept_token


@pytest.fixture(params=["STATE_DIRECTORY", "XDG_STATE_HOME", "HOME"])
def place(tmp_path, monkeypatch, request):
    """The file of the token, whose folder comes from one of three variables."""
    for name in ("STATE_DIRECTORY", "XDG_STATE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv(request.param, str(tmp_path / "state"))
    below = {"STATE_DIRECTORY": "", "XDG_STATE_HOME": "vm-detect", "HOME": ".local/state/vm-detect"}
    return tmp_path / "state" / below[request.param] / TOKEN_FILE


def test_the_token_is_kept_where_only_its_user_reads_it(place):
    token, not_kept = kept_token()
    assert re.fullmatch("[A-Za-z0-9_-]{12}", token)
    assert not_kept == ""
    assert kept_token() == (token, "")
    assert place.stat().st_mode & 0o777 == 0o600
    assert [each.name for each in place.parent.iterdir()] == [TOKEN_FILE]
    place.write_text("a-token-of-my-own\n")
    assert kept_token() == ("a-token-of-my-own", "")


@pytest.mark.parametrize("content", ["", "short\n", "two tokens-in-a-line\n", "x" * 2000, "\udcff" * 20])
def test_a_file_without_a_token_is_replaced(tmp_path, monkeypatch, content):
    monkeypatch.setenv("STATE_DIRECTORY", f"{tmp_path}:/elsewhere")
    path = tmp_path / TOKEN_FILE
    path.touch(0o600)
    path.write_bytes(content.encode("utf-8", "surrogateescape"))
    token, not_kept = kept_token()
    assert (path.read_text().strip(), not_kept) == (token, "")
    assert kept_token()[0] == token


def test_a_token_that_others_could_read_is_replaced(tmp_path, monkeypatch):
    monkeypatch.setenv("STATE_DIRECTORY", str(tmp_path))
    (tmp_path / TOKEN_FILE).write_text("seen-by-all-others\n")
    (tmp_path / TOKEN_FILE).chmod(0o644)
    token, _ = kept_token()
    assert token != "seen-by-all-others"
    (tmp_path / TOKEN_FILE).unlink()
    (tmp_path / "elsewhere").write_text("seen-by-all-others\n")
    (tmp_path / "elsewhere").chmod(0o600)
    (tmp_path / TOKEN_FILE).symlink_to("elsewhere")
    assert kept_token()[0] != "seen-by-all-others"
    assert (tmp_path / "elsewhere").read_text() == "seen-by-all-others\n"
    assert (tmp_path / TOKEN_FILE).stat().st_mode & 0o777 == 0o600


def test_without_a_state_folder_the_token_is_new_and_the_reason_is_told(tmp_path, monkeypatch):
    (tmp_path / "file").touch()
    monkeypatch.setenv("STATE_DIRECTORY", str(tmp_path / "file" / "state"))
    (one, reason), (two, _) = kept_token(), kept_token()
    assert one != two
    assert "can't keep the token" in reason
    assert str(tmp_path / "file") in reason


def test_daemons_that_start_together_have_one_token(tmp_path, monkeypatch):
    monkeypatch.setenv("STATE_DIRECTORY", str(tmp_path / "state"))
    found = []
    threads = [threading.Thread(target=lambda: found.append(kept_token())) for _ in range(8)]
    for each in threads:
        each.start()
    for each in threads:
        each.join()
    assert len(found) == 8
    assert len(set(found)) == 1
