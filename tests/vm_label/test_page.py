"""The labeling page in a real browser, without a screen."""

import random

import numpy as np
import pytest

from tests.waiting import wait
from vm_embedded.geometry.lens_files import format_lens_file
from vm_embedded.geometry.orientation import Orientation
from vm_embedded.geometry.radial_lenses import Equidistant
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

    def wait_for_picture(self):
        script = "const i = document.querySelector('#stage img'); return i.complete && i.naturalWidth"
        wait(lambda: self._browser.execute_script(script))

    def drag(self, *places):
        """Press at the first place of the whole picture, in shares of its size, and let go at the last one."""
        from selenium.webdriver.common.action_chains import ActionChains

        self.wait_for_picture()
        image = self._browser.find_element("css selector", "#stage img")
        script = "const r = arguments[0].getBoundingClientRect(); return [r.x, r.y, r.width, r.height]"
        left, top, width, height = self._browser.execute_script(script, image)
        chain = ActionChains(self._browser, duration=0)
        pointer = chain.w3c_actions.pointer_action
        for number, (x, y) in enumerate(places):
            pointer.move_to_location(round(left + x * width), round(top + y * height))
            if not number:
                pointer.pointer_down()
        pointer.pointer_up()
        chain.perform()

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
    answers, _, faults = read_answers(folder)
    assert answers == wanted
    assert faults == []


@pytest.mark.long
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


@pytest.mark.long
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


def test_missed_objects_are_drawn_or_clicked_and_pictures_without_any_are_answered(tmp_path, browser):
    folder = make_folder(tmp_path / "boxes", 4, near=False, classes=("ball", "robot"))
    for number in (1, 3):
        (folder / f"image000{number}.txt").write_text("")
    lens = format_lens_file(Equidistant(focal_length=80.0, fov=3.0), Orientation.from_roll_pitch(1.0, 0.0, 0.5))
    (folder / "lens0001.yaml").write_text(lens)
    (folder / "object.toml").write_text("radius = 0.1\n")
    with serving(folder) as (_, address):
        page = Page(browser, address)
        assert page.text("progress") == "0 of 2"
        assert "2 pictures without a box" in page.text("look")
        page.press("e")
        assert "image0001.jpg (2 of 4): no box" in page.text("note")
        page.drag((0.5, 0.6))  # a click: the size follows
        page.wait_for_progress("1 of 3")
        page.press("2")  # the second class
        page.drag((0.2, 0.6), (0.1, 0.5), (-0.2, 0.9))  # beyond the border
        page.wait_for_progress("2 of 4")
        page.drag((0.7, 0.7), (0.8, 0.8))
        page.wait_for_progress("3 of 5")
        page.press("u")
        page.wait_for_progress("2 of 4")
        assert page.count("#stage .box") == 2
        page.drag((0.5, 0.5), (0.505, 0.6))  # too narrow to be a box
        wait(lambda: "too small" in page.text("note"))
        page.press("e")
        assert "image0003.jpg (4 of 4): no box" in page.text("note")
        page.drag((0.5, 0.5))
        wait(lambda: "Drag to draw" in page.text("note"))  # this picture has no pose
        page.press("y")  # there is no box to accept
        page.press("n")
        wait(lambda: "Each picture without a box is answered" in page.text("note"))
        browser.save_screenshot(str(tmp_path / "whole.png"))
        page.press("uaaad")
        assert "image0001.jpg" in page.text("note")
        page.reload()
        assert page.text("progress") == "2 of 4"
        assert "1 picture without a box" in page.text("look")
        page.press("e")
        page.press("n\ue00c")  # escape: back to the crops
        wait(lambda: not page.text("look"))
        page.press("yy")
        page.wait_for_progress("4 of 4")
    assert "boxes: 3 ball, 1 robot" in run(folder, "--write", tmp_path / "out").stdout
    clicked, robot = (line.split() for line in (tmp_path / "out" / "image0001.txt").read_text().splitlines())
    assert clicked[0] == "0"
    assert [float(each) for each in clicked[1:3]] == pytest.approx((0.5, 0.6), abs=0.02)
    assert robot[0] == "1"
    assert [float(each) for each in robot[1:]] == pytest.approx((0.1, 0.75, 0.2, 0.3), abs=0.02)
    assert (tmp_path / "out" / "image0003.txt").read_text() == ""


@pytest.mark.long
def test_a_better_box_replaces_a_bad_one(tmp_path, browser):
    folder = make_folder(tmp_path / "boxes", 1, near=False)
    x, y, width, height = read_box_folder(folder).crops[0].shares
    with serving(folder) as (_, address):
        page = Page(browser, address)
        page.press("\ue007")
        page.drag((x - width / 2, y - height / 2), (x + width / 2, y + 0.6 * height))
        page.wait_for_progress("1 of 1")
        assert page.count(".tile.replaced") == page.count(".box.replaced") == 1
        page.press("u")
        page.wait_for_progress("0 of 1")
        assert page.count(".tile.replaced") == 0
        page.drag((x - width / 2, y - height / 2), (x + width / 2, y + 0.6 * height))
        page.wait_for_progress("1 of 1")
    assert "boxes: 1 ball" in run(folder, "--write", tmp_path / "out").stdout


@pytest.mark.long
def test_two_pages_show_what_either_draws_and_a_lost_connection_keeps_drawn_boxes(tmp_path, browser):
    folder = make_folder(tmp_path / "boxes", 2, near=False)
    with serving(folder) as (_, address):
        first, page = browser.current_window_handle, Page(browser, address)
        browser.switch_to.new_window("tab")
        page = Page(browser, address)
        page.press("\ue007")
        page.drag((0.7, 0.7), (0.9, 0.9))
        page.wait_for_progress("1 of 3")
        second = browser.current_window_handle
        browser.switch_to.window(first)
        page.wait_for_progress("1 of 3")
        page.press("y")
        page.wait_for_progress("2 of 3")
        browser.switch_to.window(second)
        page.wait_for_progress("2 of 3")
    page.drag((0.1, 0.7), (0.3, 0.9))
    wait(lambda: "1 answer not saved yet" in page.text("trouble"))
    with serving(folder, port=port_of(address)):
        page.reload()
        page.wait_for_progress("3 of 4")
        wait(lambda: not page.count("img[data-broken]") and not page.count(".tile.pending"))
    drawn = [crop.shares for crop in read_answers(folder)[1]]
    assert np.array(drawn) == pytest.approx(np.array([(0.8, 0.8, 0.2, 0.2), (0.2, 0.8, 0.2, 0.2)]), abs=0.02)
