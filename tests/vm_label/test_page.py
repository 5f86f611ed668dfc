"""The labeling page in a real browser, without a screen."""

import random

import pytest

from tests.waiting import wait
from vm_label.answers import read_answers
from vm_label.box_folder import read_box_folder
from vm_label.crops import most_doubtful_first

from .made import make_folder, run, serving

KEYS = {"yes": "y", "no": "n", "skip": "s"}


class Page:
    def __init__(self, browser, address):
        self._browser = browser
        browser.get(address)
        wait(lambda: " of " in self.text("progress"))

    def text(self, name):
        return self._browser.find_element("id", name).text

    def press(self, keys):
        from selenium.webdriver.common.action_chains import ActionChains

        ActionChains(self._browser).send_keys(keys).perform()

    def wait_for_progress(self, text):
        wait(lambda: self.text("progress") == text)

    def reload(self):
        self._browser.refresh()
        wait(lambda: " of " in self.text("progress"))

    def count(self, selector):
        return len(self._browser.find_elements("css selector", selector))


def port_of(address):
    return address.rstrip("/").rpartition(":")[2]


@pytest.mark.long
def test_200_crops_judged_by_keys_survive_a_reload_and_a_killed_server(tmp_path, browser):
    folder = make_folder(tmp_path / "boxes", 100)
    crops = most_doubtful_first(read_box_folder(folder).crops)
    draw = random.Random(1)
    wanted = {crop.id: draw.choice(list(KEYS)) for crop in crops}
    keys = [KEYS[wanted[crop.id]] for crop in crops]

    with serving(folder) as (_, address):
        page = Page(browser, address)
        assert page.text("progress") == "0 of 200"
        assert page.count(".tile") == 200
        page.press(keys[:60])
        page.wait_for_progress("60 of 200")
        assert len(read_answers(folder)[0]) == 60
        page.reload()
        assert page.text("progress") == "60 of 200"
        page.press(keys[60:110])
        page.wait_for_progress("110 of 200")
        browser.save_screenshot(str(tmp_path / "page.png"))

    # The server was killed. The page keeps what it can't save, also over a reload of its own.
    page.press(keys[110:120])
    wait(lambda: "10 answers not saved yet" in page.text("trouble"))
    assert page.text("progress") == "110 of 200"
    assert page.count(".tile.pending") == 10
    with serving(folder, port=port_of(address)):
        page.wait_for_progress("120 of 200")
        wait(lambda: page.text("trouble") == "")
        page.press(keys[120:])
        page.wait_for_progress("200 of 200")
        assert "All 200 crops are answered" in page.text("question")
    answers, faults = read_answers(folder)
    assert answers == wanted
    assert faults == []


def test_undo_selection_and_the_whole_picture(tmp_path, browser):
    folder = make_folder(tmp_path / "boxes", 6, near=False)
    crops = most_doubtful_first(read_box_folder(folder).crops)
    with serving(folder) as (_, address):
        page = Page(browser, address)
        assert page.text("question") == "Is this a ball?"
        assert crops[0].image in page.text("about")
        page.press("yn")
        page.wait_for_progress("2 of 6")
        page.press("u")
        page.wait_for_progress("1 of 6")
        assert crops[1].image in page.text("about")
        page.press("\ue014\ue014s")  # right, right
        page.wait_for_progress("2 of 6")
        page.reload()  # the answers that are taken back come from the file
        page.press("uu")
        page.wait_for_progress("0 of 6")
        assert crops[0].image in page.text("about")
        page.press("\ue007")  # enter
        wait(lambda: browser.execute_script("return document.querySelector('#whole img').naturalWidth") == 160)
        page.press("n\ue00c")  # answers, goes on, and escape closes
        page.wait_for_progress("1 of 6")
        assert page.count("#whole[hidden]") == 1
        page.press("\ue012")  # left
        assert "answered no" in page.text("about")
        wait(lambda: browser.execute_script("return document.getElementById('large').naturalWidth") == 480)
        browser.find_element("css selector", "#buttons .yes").click()
        page.wait_for_progress("1 of 6")
    assert read_answers(folder)[0] == {crops[0].id: "yes"}
    out = run(folder, "--write", tmp_path / "out").stdout
    assert "1 images" in out
    assert "left out: 5 images with unanswered crops" in out


def test_a_reload_without_a_server_loses_nothing(tmp_path, browser):
    folder = make_folder(tmp_path / "boxes", 4, near=False)
    with serving(folder) as (_, address):
        page = Page(browser, address)
    page.press("yn")
    wait(lambda: "2 answers not saved yet" in page.text("trouble"))
    with serving(folder, port=port_of(address)):
        page.reload()
        page.wait_for_progress("2 of 4")
    assert sorted(read_answers(folder)[0].values()) == ["no", "yes"]
