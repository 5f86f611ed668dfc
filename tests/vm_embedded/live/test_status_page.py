"""The status page in a real browser, without a screen, and pauses between its previews."""

import asyncio
import re
import socket
import time
from pathlib import Path
from types import SimpleNamespace
from urllib.request import Request, urlopen

import pytest

from tests.soak.failing_camera import Fault
from tests.soak.faults import QUICK
from tests.vm_embedded.live.running import running
from tests.waiting import wait
from vm_embedded.live import status_page

DAEMON = Path(__file__).parents[3] / "docs" / "daemon.md"

MARK = """
const picture = document.getElementById("picture"), canvas = document.createElement("canvas");
canvas.width = 64; canvas.height = 48;
const context = canvas.getContext("2d");
context.drawImage(picture, 0, 0, 64, 48);
const pixels = context.getImageData(0, 0, 64, 48).data;
return picture.naturalWidth + ":" + pixels.reduce((sum, each) => (sum * 31 + each) % 1000003, 7);
"""
"""A number that tells the shown picture from others, after its width."""


BOTTOM = "return document.querySelector(arguments[0]).getBoundingClientRect().bottom"
SAME = """
const ball = document.querySelector("#map text.ball");
return ball && [ball.textContent, document.getElementById("found").textContent];
"""
RIGHT = BOTTOM.replace("bottom", "right")


def free_address():
    with socket.socket() as made:
        made.bind(("127.0.0.1", 0))
        return f"127.0.0.1:{made.getsockname()[1]}"


@pytest.mark.long
def test_the_page_previews_a_threshold_uses_it_and_records_with_the_token_of_the_log(tmp_path, browser):
    where, kept = free_address(), tmp_path / "recordings"
    options = ("--camera", "synthetic", "--status-page", where, "--recorder-folder", kept, "--recorder-seconds", 0.5)
    with running(tmp_path, *options) as found:
        found.wait_for_state("ok")
        (token,) = [each["token"] for each in found.events if each["event"] == "status page"]
        browser.set_window_size(1700, 1000)
        browser.get(f"http://{where}/")

        def text(name):
            return browser.find_element("id", name).text

        def slide(value):
            move = "const slider = document.getElementById('threshold'); slider.value = arguments[0]; slider.oninput();"
            browser.execute_script(move, value)

        def shown(name):
            return browser.find_element("id", name).is_displayed()

        wait(lambda: "pose from fixed" in text("runs"))
        for each in ("model ball", "camera synthetic", "camera height 0.", "pitch, roll ", "temperature"):
            assert each in text("runs")
        wait(lambda: text("threshold-value") == "0.30")
        slide(1.0)
        wait(lambda: shown("preview") and "0 found" in text("effect"))
        assert not shown("picture")
        browser.save_screenshot(str(tmp_path / "preview.png"))
        assert any(each["detections"] for each in found.frames[-20:])  # a preview changes nothing
        browser.find_element("id", "use").click()
        wait(lambda: "token" in text("answer"))
        browser.find_element("id", "token").send_keys("wrong")
        browser.find_element("id", "use").click()
        wait(lambda: "wrong token" in text("answer"))
        browser.find_element("id", "token").clear()
        browser.find_element("id", "token").send_keys(token)
        browser.find_element("id", "use").click()
        wait(lambda: "min_confidence = 1" in text("answer"))
        wait(lambda: shown("picture"))
        seen = len(found.frames)
        found.wait(lambda: len(found.frames) > seen + 20)
        assert not any(each["detections"] for each in found.frames[seen + 1 :])
        slide(0.3)
        wait(lambda: shown("preview"))
        browser.find_element("id", "back").click()
        wait(lambda: shown("picture") and text("threshold-value") == "1.00")
        browser.find_element("id", "record").click()
        wait(lambda: "recording" in text("answer"))
        found.wait(lambda: [each for each in found.events if each["event"] == "recorded"])
        found.stop()
    (folder,) = kept.iterdir()
    assert "\nmin_confidence = 1\n" in (folder / "vm.toml").read_text()


@pytest.mark.long
def test_the_addresses_of_the_documentation_answer(tmp_path):
    addresses = re.findall(r"^\| `(GET|POST) (\S+)`", DAEMON.read_text(), re.MULTILINE)
    assert len(addresses) == 9
    where = free_address()
    options = ("--camera", "synthetic", "--status-page", where, "--recorder-folder", tmp_path / "recordings")
    with running(tmp_path, *options) as found:
        found.wait_for_state("ok")
        (token,) = [each["token"] for each in found.events if each["event"] == "status page"]
        for method, address in addresses:
            seen = len(found.frames)  # after a changed threshold, a recording begins anew
            found.wait(lambda seen=seen: len(found.frames) > seen + 3)
            request = Request(f"http://{where}{address}", method=method, headers={"X-Token": token})
            with urlopen(request, timeout=60.0) as answer:
                assert answer.status == 200
                content = answer.read(300)
            if address in ("/state", "/map", "/view?after=0"):
                assert content.startswith(b'{"'), address
            if method == "POST":
                assert content.endswith(b"\n"), address  # so that a shell's prompt begins a line
        found.stop()


@pytest.mark.long
def test_the_page_shows_state_rates_and_a_moving_picture_and_survives_a_lost_camera(tmp_path, browser):
    where = free_address()
    unplugged = Fault("unplug", at=20.0, seconds=3.0)
    with running(tmp_path, *QUICK, "--status-page", where, faults=[unplugged]) as found:
        found.wait_for_state("ok")
        browser.get(f"http://{where}/")

        def text(name):
            return browser.find_element("id", name).text

        def bottom(selector):
            return browser.execute_script(BOTTOM, selector)

        def moves():
            marks = set()
            wait(lambda: marks.add(browser.execute_script(MARK)) or len(marks) > 3)
            return all(each.startswith("640:") for each in marks)

        wait(lambda: text("state") == "ok")
        wait(lambda: browser.execute_script(MARK).startswith("640:"))
        assert moves()
        wait(lambda: "/s" in text("now") and float(text("now").split("frame rate")[1].split("/s")[0]) > 5.0)
        wait(lambda: "ball" in text("found"))
        wait(lambda: browser.find_elements("css selector", "#map .ball"))
        assert browser.find_elements("css selector", "#map path.view")
        for _ in range(5):  # the map and the list are of one frame
            on_map, in_list = wait(lambda: browser.execute_script(SAME))  # a frame may have no ball
            assert on_map in in_list
        for size in ((1700, 1000), (1200, 800)):
            browser.set_window_size(*size)
            wait(lambda: abs(bottom("#overhead") - bottom("#picture")) < 2)
            assert bottom("#picture") - bottom("header") > 0.5 * size[1]
            assert bottom("#map") > 0.85 * bottom("#picture")
            assert browser.execute_script(RIGHT, "#overhead") > 0.95 * size[0]
        assert "in view" in text("legend")
        browser.save_screenshot(str(tmp_path / "page.png"))
        wait(lambda: text("state") == "camera_lost")
        wait(lambda: "unplugged" in text("reason"))  # on a busy machine, it may first say that no frame comes
        wait(lambda: text("state") == "ok")
        assert moves()
        found.stop()
        wait(lambda: text("state") == "no response")


@pytest.mark.long
def test_the_token_survives_a_restart_and_others_can_not_read_it(tmp_path):
    tokens = []
    for _ in range(2):
        options = ("--camera", "synthetic", "--status-page", free_address())
        with running(tmp_path, *options, env={"STATE_DIRECTORY": str(tmp_path / "state")}) as found:
            found.wait(lambda found=found: any(each["event"] == "status page" for each in found.events))
            tokens += [each["token"] for each in found.events if each["event"] == "status page"]
            found.stop()
    assert tokens[0] == tokens[1]
    (kept,) = (tmp_path / "state").iterdir()
    assert kept.read_text().strip() == tokens[0]
    assert kept.stat().st_mode & 0o777 == 0o600


def test_frames_get_four_times_the_time_of_previews(monkeypatch):
    """Many browsers, or a program, may ask for many previews at once."""
    now, begun, yielded = [1000.0], [], asyncio.sleep

    async def sleep(seconds):
        now[0] += seconds
        await yielded(0)

    def compute(*_):
        begun.append(now[0])
        now[0] += 0.05

    async def send(_):
        return None

    answerer = SimpleNamespace(configuration=SimpleNamespace(status=SimpleNamespace(page="")), detector=None)
    page = status_page.StatusPage(answerer, *4 * (dict,))
    page._views = SimpleNamespace(latest="a frame", preview=send)

    async def ask():
        await asyncio.gather(*(page._preview({"value": "0.4"}) for _ in range(5)))

    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    monkeypatch.setattr(asyncio, "sleep", sleep)
    monkeypatch.setattr(status_page, "with_settings", compute)
    monkeypatch.setattr(status_page, "with_threshold", lambda *_: None)
    asyncio.run(ask())
    assert begun == pytest.approx([1000.0 + 0.25 * index for index in range(5)])
