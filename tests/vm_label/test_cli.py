"""vm-label as a user types it: its page's server, and the training data that it writes."""

import http.client
import json
import shutil
import signal
import subprocess
from functools import partial

import pytest

from tests.folders import contents
from tests.programs import BIN, limit_files, run_program
from vm_label.answers import AnswerFile
from vm_label.box_folder import read_box_folder

from .made import answer_lines, make_folder, run, serving


def judge(folder, answers):
    """Write answers to the crops, in the order of their images; None: no answer."""
    with AnswerFile(folder) as file:
        for crop, answer in zip(read_box_folder(folder).crops, answers, strict=True):
            if answer:
                file.append(crop, answer)


def request(address, method, path, body=None, **headers):
    connection = http.client.HTTPConnection(address.removeprefix("http://").strip("/"), timeout=20)
    connection.request(method, path, body, headers)
    response = connection.getresponse()
    content = response.read()
    connection.close()
    return response.status, content


def post(address, body, **headers):
    return request(address, "POST", "/answer", body, **({"Content-Type": "application/json"} | headers))


def test_only_fully_judged_images_become_training_data(tmp_path):
    folder = make_folder(tmp_path / "boxes", 6)
    (folder / "image0005.txt").unlink()
    kept = [line for line in (folder / "candidates.jsonl").read_text().splitlines() if "image0005" not in line]
    (folder / "candidates.jsonl").write_text("\n".join(kept) + "\n")
    (folder / "object.toml").write_text("radius = 0.11\n")
    judge(folder, ["yes", "no", "no", "no", "yes", "skip", "yes", None, "no", "yes"])
    done = run(folder, "--write", tmp_path / "out")
    assert done.stdout.splitlines() == [
        f"{tmp_path / 'out'}: 3 images, 1 of them background; boxes: 2 ball",
        "left out: 1 image with unanswered crops",
        "left out: 1 image with skipped crops",
        "left out: 1 image without any crop or answer (--empty writes them)",
        f"next: vm-train tune {tmp_path / 'out'} --from ball -o tuned",
    ]
    out = tmp_path / "out"
    assert sorted(path.name for path in out.iterdir()) == sorted(
        [
            "classes.txt",
            "object.toml",
            *(f"{kind}000{i}.{end}" for i in (0, 1, 4) for kind, end in [("image", "jpg"), ("image", "txt")]),
        ]
        + [f"lens000{i}.yaml" for i in (0, 1, 4)]
    )
    assert (out / "image0000.txt").read_text() == (folder / "image0000.txt").read_text()
    assert (out / "image0001.txt").read_text() == ""
    assert (out / "image0004.txt").read_text() == "0 0.500000 0.100000 0.100000 0.100000\n"
    assert (out / "classes.txt").read_text() == "ball\n"
    assert (out / "image0004.jpg").read_bytes() == (folder / "image0004.jpg").read_bytes()
    assert "4 images, 2 of them background" in run(folder, "--write", tmp_path / "more", "--empty").stdout
    assert not list(tmp_path.glob("*.part"))


def test_images_keep_their_folders_and_only_chosen_classes_count(tmp_path):
    for name in ("day1", "day2"):
        make_folder(tmp_path / "boxes" / name, 2, near=False, classes=("ball", "robot"))
        with (tmp_path / "boxes" / name / "image0001.txt").open("a") as file:
            file.write("1 0.8 0.8 0.1 0.1\n")
    folder = tmp_path / "boxes"
    judge(folder, ["yes", "yes", None, "yes", "yes", None])
    assert "2 images, 0 of them background; boxes: 2 ball" in run(folder, "--write", tmp_path / "all").stdout
    run(folder, "--write", tmp_path / "balls", "--class", "ball")
    found = read_box_folder(tmp_path / "balls")
    assert found.images == ("day1/image0000.jpg", "day1/image0001.jpg", "day2/image0000.jpg", "day2/image0001.jpg")
    assert len(found.crops) == 4
    assert found.classes == ("ball",)


def test_the_next_training_does_not_begin_with_the_ball_if_the_boxes_show_something_else(tmp_path):
    folder = make_folder(tmp_path / "boxes", 1, near=False, classes=("cup",))
    judge(folder, ["yes"])
    assert f"next: vm-train tune {tmp_path / 'out'} --from MODEL" in run(folder, "--write", tmp_path / "out").stdout


def test_images_with_unreadable_boxes_are_left_out(tmp_path):
    folder = make_folder(tmp_path / "boxes", 2, near=False)
    (folder / "image0001.txt").write_text("0 0.5 0.5 0.1 0.1\nbroken\n")
    judge(folder, ["yes", "yes"])
    done = run(folder, "--write", tmp_path / "out")
    assert "left out: 1 image with boxes that can't be read" in done.stdout
    assert "image0001.txt line 2: 'broken' has 1 values" in done.stderr


def test_nothing_is_overwritten(tmp_path):
    folder = make_folder(tmp_path / "boxes", 1, near=False)
    assert "judge them on the page first" in run(folder, "--write", tmp_path / "out", code=1).stderr
    judge(folder, ["yes"])
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "mine.txt").write_text("mine")
    assert "not empty" in run(folder, "--write", tmp_path / "full", code=1).stderr
    assert "lies in the folder of boxes" in run(folder, "--write", folder / "out", code=1).stderr
    assert "lies in the folder of boxes" in run(folder, "--write", folder, code=1).stderr
    (tmp_path / "file").write_text("mine")
    assert "can't write" in run(folder, "--write", tmp_path / "file", code=1).stderr
    (tmp_path / "empty").mkdir()
    run(folder, "--write", tmp_path / "empty")
    assert (tmp_path / "empty" / "image0000.txt").exists()


@pytest.mark.parametrize("name", ["day1.part", ".day1.part", "day1.part.part"])
def test_training_data_beside_its_source_leaves_the_source_as_it_is(name, tmp_path):
    """Also if the source is called like an unfinished recording of the same day."""
    source = make_folder(tmp_path / name, 2)
    judge(source, ["yes", "no", "yes", "no"])
    before = contents(source)
    run(source, "--write", tmp_path / "day1")
    assert contents(source) == before
    assert len(read_box_folder(tmp_path / "day1").images) == 2
    assert {each.name for each in tmp_path.iterdir()} == {name, "day1"}


def test_an_unrelated_folder_beside_the_training_data_stays(tmp_path):
    source = make_folder(tmp_path / "boxes", 1, near=False)
    judge(source, ["yes"])
    (tmp_path / "out.part").mkdir()
    (tmp_path / "out.part" / "thesis.tex").write_text("years of work")
    before = contents(tmp_path / "out.part")
    run(source, "--write", tmp_path / "out")
    assert contents(tmp_path / "out.part") == before


def test_training_data_that_can_not_be_written_leaves_nothing(tmp_path):
    source = make_folder(tmp_path / "boxes", 2)
    judge(source, ["yes", "no", "yes", "no"])
    before = contents(tmp_path)
    done = run_program("vm-label", source, "--write", tmp_path / "out", code=1, preexec_fn=partial(limit_files, 1000))
    assert str(tmp_path / "out") in done.stderr
    assert contents(tmp_path) == before
    assert not list(tmp_path.glob("*.part"))
    (tmp_path / "loop").symlink_to("loop")
    assert "can't write" in run(source, "--write", tmp_path / "loop", code=1).stderr


@pytest.mark.long
def test_of_two_that_write_the_same_training_data_at_once_one_wins(tmp_path):
    source = make_folder(tmp_path / "boxes", 30, near=False)
    judge(source, ["yes"] * 30)
    command = [BIN / "vm-label", source, "--write", tmp_path / "out"]
    started = [subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE) for _ in range(2)]
    codes = [(each.communicate(timeout=120), each.returncode)[1] for each in started]
    assert sorted(codes) == [0, 1]
    assert len(read_box_folder(tmp_path / "out").images) == 30
    assert {each.name for each in tmp_path.iterdir()} == {"boxes", "out"}


@pytest.mark.parametrize(
    ("options", "part", "code"),
    [
        (("--port", "70000"), "'70000' is not a port, from 0 to 65535", 2),
        (("--host", "localhost"), "'localhost' is not an IPv4 address, such as 127.0.0.1", 2),
        (("--host", "192.0.2.1"), "can't listen at 192.0.2.1:8090", 1),
        (("--empty",), "--empty needs --write", 1),
        (("--class", "bal"), "did you mean 'ball'?", 1),
    ],
)
def test_wrong_options_are_named(tmp_path, options, part, code):
    folder = make_folder(tmp_path / "boxes", 1)
    assert part in run(folder, *options, "--no-browser", code=code).stderr


def test_a_folder_without_boxes_is_named(tmp_path):
    assert "no images in" in run(tmp_path, code=1).stderr
    make_folder(tmp_path, 1, near=False)
    (tmp_path / "candidates.jsonl").unlink()
    (tmp_path / "image0000.txt").unlink()
    (tmp_path / "classes.txt").unlink()
    complaint = run(tmp_path, code=1).stderr
    assert "vm-detect --save-boxes makes boxes" in complaint
    assert str(tmp_path / "classes.txt") in complaint


def test_a_stopped_server_says_how_far_it_came(tmp_path):
    folder = make_folder(tmp_path / "boxes", 2)
    with serving(folder) as (process, address):
        state = json.loads(request(address, "GET", "/state")[1])
        body = {"session": state["session"], "crop": state["crops"][0]["id"], "answer": "yes"}
        assert post(address, json.dumps(body))[0] == 200
        assert "another vm-label" in run(folder, "--no-browser", "--port", "0", code=1).stderr
        port = address.strip("/").rpartition(":")[2]
        other = make_folder(tmp_path / "other", 1)
        assert "--port takes another port" in run(other, "--no-browser", "--port", port, code=1).stderr
        process.send_signal(signal.SIGTERM)
        assert "1 of 4 crops answered" in process.stdout.read()
        assert process.wait(20) == 0
    (line,) = answer_lines(folder)
    assert line["answer"] == "yes"
    assert line["image"] == state["crops"][0]["image"]


def test_the_server_refuses_what_its_page_does_not_send(tmp_path):
    folder = make_folder(tmp_path / "boxes", 1)
    (folder / "image0000.jpg").write_bytes(b"broken")
    with serving(folder) as (_, address):
        state = json.loads(request(address, "GET", "/state")[1])
        good = {"session": state["session"], "crop": state["crops"][0]["id"], "answer": "yes"}
        assert post(address, json.dumps(good), Host="evil.example")[0] == 403
        assert request(address, "GET", "/state", Host="evil.example")[0] == 403
        assert request(address, "POST", "/answer", json.dumps(good), **{"Content-Type": "text/plain"})[0] == 403
        for wrong in ("", "[]", "{", json.dumps(good | {"answer": "maybe"}), json.dumps(good | {"crop": []})):
            assert post(address, wrong)[0] == 400
        assert post(address, "x" * 10_000)[0] == 400
        assert post(address, json.dumps(good | {"crop": "0"}))[0] == 409
        assert post(address, json.dumps(good | {"session": "0"}))[0] == 409
        assert request(address, "GET", "/picture/../../classes.txt")[0] == 404
        status, reason = request(address, "GET", f"/picture/{good['crop']}")
        assert status == 500
        assert b"image0000.jpg" in reason
        assert not answer_lines(folder)
        shutil.rmtree(folder)


def test_answers_of_a_disk_that_is_full_are_refused_and_come_later(tmp_path):
    folder = make_folder(tmp_path / "boxes", 1)
    with serving(folder) as (process, address):
        state = json.loads(request(address, "GET", "/state")[1])
        body = json.dumps({"session": state["session"], "crop": state["crops"][0]["id"], "answer": "no"})
        limit = run_prlimit(process.pid, 10)
        assert post(address, body)[0] == 507
        assert (folder / "answers.jsonl").read_text() == ""
        run_prlimit(process.pid, limit)
        assert post(address, body)[0] == 200
    assert [line["answer"] for line in answer_lines(folder)] == ["no"]


def run_prlimit(pid, size):
    """Set the largest file that a process may write [bytes], and return the limit before. Python ignores SIGXFSZ."""
    import resource

    before = resource.prlimit(pid, resource.RLIMIT_FSIZE)
    resource.prlimit(pid, resource.RLIMIT_FSIZE, (size, before[1]))
    return before[0]


def test_lens_files_of_all_names_are_copied_also_to_the_working_folder(tmp_path):
    folder = make_folder(tmp_path / "boxes", 2, near=False)
    for number, name in enumerate(("frame0.yaml", "lensframe1.yaml")):
        for suffix in (".jpg", ".txt"):
            (folder / f"image000{number}{suffix}").rename(folder / f"frame{number}{suffix}")
        (folder / f"lens000{number}.yaml").rename(folder / name)
    judge(folder, ["yes", "yes"])
    (tmp_path / "new").mkdir()
    run(folder, "--write", ".", cwd=tmp_path / "new")
    written = {path.name for path in (tmp_path / "new").iterdir()}
    assert written > {"frame0.jpg", "frame0.yaml", "frame1.jpg", "lensframe1.yaml"}
