"""Bags whose recorder was killed: what is whole is read, and a line says that the recording was not finished."""

import pytest
from rosbags.rosbag2 import StoragePlugin

from tests.vm_embedded.cli.commands import lines, one_complaint, run
from tests.vm_embedded.strategies import attempt
from vm_embedded.cameras.ros.bags import BagReading, is_bag, open_bag
from vm_embedded.errors import InputError
from vm_embedded.geometry.calibrated_lenses import BrownLens
from vm_embedded.geometry.lens_files import format_lens_file

from .rolling_ball import Scene, write_messages


def stamps(path, **reading):
    """The stamps of the frames of a bag, all of which can be read, and the remarks."""
    source = open_bag(str(path), BagReading(**reading))
    found = []
    for frame in source.frames:
        frame.read()
        found.append(frame.stamp)
    return found, [each for each in source.remarks() if each]


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """A finished bag in a folder, its file, and the stamps of its frames."""
    folder = tmp_path_factory.mktemp("recorded") / "bag"
    file = Scene(count=6).write_bag(folder)
    return folder, file, stamps(folder)[0]


def killed(recorded, folder, share=1.0):
    """The folder of a recorder that was killed: without metadata.yaml, and with a share of the file."""
    _, file, _ = recorded
    folder.mkdir()
    content = file.read_bytes()
    (folder / file.name).write_bytes(content[: int(share * len(content))])
    return folder


def test_a_finished_bag_has_no_remark(recorded):
    folder, file, whole = recorded
    assert len(whole) == 6
    assert stamps(folder) == stamps(file) == (whole, [])


def test_a_whole_file_without_metadata_is_read(recorded, tmp_path):
    folder = killed(recorded, tmp_path / "bag")
    found, remarks = stamps(folder)
    assert found == recorded[2]
    assert len(remarks) == 1
    assert "not finished" in remarks[0]
    assert "metadata.yaml" in remarks[0]
    done = run("--camera", folder)
    assert len(lines(done)) == 6
    assert "the recording bag was not finished" in done.stderr


@pytest.mark.parametrize("share", [0.3, 0.6, 0.95, 0.9999])
def test_a_cut_file_is_read_as_far_as_it_is_whole(recorded, tmp_path, share):
    folder = killed(recorded, tmp_path / "bag", share)
    found, remarks = stamps(folder)
    assert found == recorded[2][: len(found)]
    assert len(found) >= int(6 * share) - 1
    assert len(remarks) == 1
    assert "not finished" in remarks[0]
    (file,) = folder.iterdir()
    assert stamps(file)[0] == found  # also the file alone
    assert file.stat().st_size == int(share * recorded[1].stat().st_size)


def test_each_cut_gives_frames_or_one_line(recorded, tmp_path):
    content = recorded[1].read_bytes()
    file = tmp_path / "cut.mcap"
    for size in (0, 5, 8, 9, 20, 60, 500, 3000, *range(4000, len(content), len(content) // 15), len(content) - 1):
        file.write_bytes(content[:size])
        result = attempt(InputError, stamps, file)
        if isinstance(result, InputError):
            assert "cut.mcap" in str(result)
            assert size < 0.3 * len(content)
        else:
            found, (remark,) = result
            assert found == recorded[2][: len(found)]
            assert "not finished" in remark


def test_a_recording_in_several_files_is_read_in_their_order(tmp_path):
    """The recorder began a new file again and again, and was killed in the last one."""
    whole, folder = list(Scene(count=9).messages()), tmp_path / "bag"
    folder.mkdir()
    for number, part in ((9, whole[: len(whole) // 2]), (10, whole[len(whole) // 2 :])):
        file = write_messages(tmp_path / f"part{number}", part)
        content = next((tmp_path / f"part{number}").glob("*.mcap")).read_bytes() if file is None else file.read_bytes()
        (folder / f"bag_{number}.mcap").write_bytes(content[:-30] if number == 10 else content)
    (folder / "bag_11.mcap").write_bytes(b"")
    (folder / "metadata.yaml").write_text("")
    found, remarks = stamps(folder)
    assert len(found) == 9
    assert found == sorted(found)
    assert "not finished" in remarks[0]


def test_an_empty_file_is_one_line(tmp_path):
    (tmp_path / "bag").mkdir()
    (tmp_path / "bag/bag_0.mcap").write_bytes(b"")
    one_complaint(run("--camera", tmp_path / "bag", code=1), "bag", "empty")


def test_a_database_without_metadata_is_read(tmp_path):
    file = Scene(count=2).write_bag(tmp_path / "bag", StoragePlugin.SQLITE3)
    (tmp_path / "bag/metadata.yaml").unlink()
    assert file.suffix == ".db3"
    found, remarks = stamps(tmp_path / "bag")
    assert len(found) == 2
    assert "not finished" in remarks[0]


def test_images_beside_a_recording_stay_images(recorded, tmp_path):
    folder = killed(recorded, tmp_path / "frames")
    assert is_bag(str(folder))
    (folder / "image0000000.png").write_bytes(b"")
    assert not is_bag(str(folder))


def renamed(scene, name):
    return [(time, topic.replace("image_raw", name), kind, message) for time, topic, kind, message in scene.messages()]


@pytest.mark.parametrize("name", ["image_rect", "image_rect_color"])
def test_a_raw_lens_for_rectified_images_is_remarked(tmp_path, name):
    write_messages(tmp_path / "bag", renamed(Scene(count=2), name))
    straight = BrownLens(fov=2.0, focal_lengths=(300.0, 300.0), optical_center=(320.0, 256.0))
    bent = BrownLens(fov=2.0, focal_lengths=(300.0, 300.0), optical_center=(320.0, 256.0), coefficients=(-0.1, 0, 0, 0))
    for lens, is_doubtful in ((None, False), (bent, True), (straight, False)):
        remarks = stamps(tmp_path / "bag", own_lens=lens)[1]
        assert any("rectified" in each for each in remarks) == is_doubtful
    (tmp_path / "lens.yaml").write_text(format_lens_file(bent, None))
    assert "are rectified" in run("--camera", tmp_path / "bag", "--lens", tmp_path / "lens.yaml").stderr
