"""The status page in a real browser, without a screen."""

import socket
import time

import pytest

from tests.vm_embedded.live.running import running
from tests.vm_embedded.live.test_faults import QUICK, script

MARK = """
const picture = document.getElementById("picture"), canvas = document.createElement("canvas");
canvas.width = 64; canvas.height = 48;
const context = canvas.getContext("2d");
context.drawImage(picture, 0, 0, 64, 48);
const pixels = context.getImageData(0, 0, 64, 48).data;
return picture.naturalWidth + ":" + pixels.reduce((sum, each) => (sum * 31 + each) % 1000003, 7);
"""
"""A number that tells the shown picture from others, after its width."""


def wait(what, seconds=60.0):
    deadline = time.monotonic() + seconds
    while not what():
        assert time.monotonic() < deadline
        time.sleep(0.1)


@pytest.mark.slow
def test_the_page_shows_state_rates_and_a_moving_picture_and_survives_a_lost_camera(tmp_path, browser):
    with socket.socket() as made:
        made.bind(("127.0.0.1", 0))
        where = f"127.0.0.1:{made.getsockname()[1]}"
    source = script(tmp_path / "script.toml", 'faults = [{ kind = "unplug", at = 20.0, seconds = 3.0 }]\n')
    with running(tmp_path, *source, *QUICK, "--status-page", where) as found:
        found.wait_for_state("ok")
        browser.get(f"http://{where}/")

        def text(name):
            return browser.find_element("id", name).text

        def moves():
            marks = set()
            wait(lambda: marks.add(browser.execute_script(MARK)) or len(marks) > 3)
            return all(each.startswith("640:") for each in marks)

        wait(lambda: text("state") == "ok")
        assert moves()
        wait(lambda: "/s" in text("now"))
        rate = float(text("now").split("frames answered")[1].split("/s")[0])
        assert rate > 5.0
        wait(lambda: "ball" in text("found"))
        wait(lambda: browser.find_elements("css selector", "#map .ball"))
        assert browser.find_elements("css selector", "#map path.view")
        assert "in view" in text("legend")
        browser.save_screenshot(str(tmp_path / "page.png"))
        wait(lambda: text("state") == "camera_lost")
        wait(lambda: "unplugged" in text("reason"))  # on a busy machine, it may first say that no frame comes
        wait(lambda: text("state") == "ok")
        assert moves()
        found.stop()
        wait(lambda: text("state") == "no response")
