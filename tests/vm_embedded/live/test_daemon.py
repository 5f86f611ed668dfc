"""vm-detect on a live camera: a real process, its messages, states, sockets and signals."""

import json
import signal
import socket
import stat
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest

from tests.vm_embedded.live.running import COMMAND, arguments, running
from vm_embedded.cameras.synthetic import Motion
from vm_embedded.live.control import ask

DEMO = Path(__file__).parents[2] / "fixtures" / "demo"


def counts(tmp_path):
    """What the running detector counts."""
    return json.loads(ask(tmp_path / "control", "status"))["counts"]


def test_a_drawn_camera_is_watched_and_its_ball_is_where_it_is(tmp_path):
    with running(tmp_path, "--camera", "synthetic") as found:
        found.wait_for_state("ok")
        found.wait(lambda: sum(len(each["detections"]) for each in found.frames) > 10)
        status, seconds = found.stop()
    assert status == 0
    assert seconds < 1.0
    assert found.states[0] == "starting"
    assert found.states[-1] == "stopping"
    errors = []
    for each in found.frames:
        assert 0.0 < each["age_ms"] < 250.0
        for ball in each["detections"][:1]:
            truth = Motion().ball(each["t"])
            errors.append(np.linalg.norm(ball["position"] - truth) / np.linalg.norm(truth))
    assert np.median(errors) < 0.05
    numbers = [each["frame"] for each in found.frames]
    assert numbers == list(range(1, len(numbers) + 1))


def test_state_messages_have_no_detections_and_frames_have_a_state(tmp_path):
    with running(tmp_path, "--camera", "synthetic") as found:
        found.wait_for_state("ok")
        found.wait(lambda: len(found.frames) > 3)
        found.stop()
    for each in found.messages:
        assert ("detections" in each) == (each["type"] == "frame")
        assert each["state"] in ("starting", "ok", "degraded", "stopping")


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_ends_it_and_its_sockets_are_gone(tmp_path, number):
    with running(tmp_path, "--camera", "synthetic", "--output-unix", tmp_path / "lines") as found:
        found.wait_for_state("ok")
        for name in ("lines", "control"):
            assert stat.S_IMODE((tmp_path / name).stat().st_mode) == 0o660
        status, seconds = found.stop(number)
    assert status == 0
    assert seconds < 1.0
    assert list(tmp_path.iterdir()) == []


def test_systemd_hears_that_it_is_ready_how_it_is_and_that_it_lives(tmp_path):
    path = tmp_path / "notify"
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listening:
        listening.bind(str(path))
        listening.settimeout(30.0)
        env = {"NOTIFY_SOCKET": str(path), "WATCHDOG_USEC": "400000"}
        with running(tmp_path, "--camera", "synthetic", env=env) as found:
            heard = []
            while heard.count("WATCHDOG=1") < 5 or "STATUS=ok" not in heard:
                heard += listening.recv(4096).decode().split("\n")
            found.stop()
            listening.settimeout(1.0)
            while "STOPPING=1" not in heard:
                heard += listening.recv(4096).decode().split("\n")
    assert heard.count("READY=1") == 1
    assert heard.index("READY=1") < heard.index("STATUS=ok")


def test_many_read_the_socket_and_one_that_sleeps_holds_nobody_up(tmp_path):
    path = tmp_path / "lines"
    options = ("--camera", "synthetic", "--output-unix", path, "--output-backlog-kib", 8, "--no-output-stdout")
    with running(tmp_path, *options) as found:
        found.wait_for_state("ok")
        readers = [socket.socket(socket.AF_UNIX) for _ in range(3)]
        sleeper = socket.socket(socket.AF_UNIX)
        sleeper.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
        for each in (*readers, sleeper):
            each.connect(str(path))
        heard = [each.makefile() for each in readers]
        # As many lines as the sleeper's buffers can't hold.
        lines = [[json.loads(file.readline()) for _ in range(20)] for file in heard]
        for each in lines[1:]:
            assert {one["frame"] for one in each if "frame" in one} & {
                one["frame"] for one in lines[0] if "frame" in one
            }
        found.wait(
            lambda: (
                json.loads(ask(tmp_path / "control", "status"))["counts"]["dropped"] > 0 or heard[0].readline() == ""
            )
        )
        for each in (*heard, *readers, sleeper):
            each.close()
        found.stop()


def test_lines_also_go_to_a_file_and_by_udp(tmp_path):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listening:
        listening.bind(("127.0.0.1", 0))
        listening.settimeout(30.0)
        port = listening.getsockname()[1]
        where = ("--output-udp", f"127.0.0.1:{port}", "--output-file", tmp_path / "lines.jsonl")
        with running(tmp_path, "--camera", "synthetic", *where, "--output-format", "ros") as found:
            message = {"detections": {"detections": []}}
            while not message["detections"]["detections"]:
                message = json.loads(listening.recv(65536))
            found.process.send_signal(signal.SIGTERM)
            assert found.process.wait(30) == 0
    detection = message["detections"]["detections"][0]
    assert detection["results"][0]["hypothesis"]["class_id"] == "ball"
    assert message["points"][0]["point"] == detection["results"][0]["pose"]["pose"]["position"]
    assert message["detections"]["header"]["frame_id"] == "base_footprint"
    kept = [json.loads(line) for line in (tmp_path / "lines.jsonl").read_text().splitlines()]
    assert message in kept


def test_a_socket_that_was_left_behind_is_replaced_and_one_in_use_is_not(tmp_path):
    left = socket.socket(socket.AF_UNIX)
    left.bind(str(tmp_path / "control"))
    left.close()
    with running(tmp_path, "--camera", "synthetic") as found:
        found.wait_for_state("ok")
        other = subprocess.run(
            arguments(tmp_path, "--camera", "synthetic"), capture_output=True, text=True, timeout=60, check=False
        )
        assert other.returncode == 78
        assert "another process" in other.stderr
        assert json.loads(ask(tmp_path / "control", "status"))["state"] == "ok"
        found.stop()


def test_what_can_never_work_ends_it_at_the_start_with_a_status_of_its_own(tmp_path):
    for options, says in (
        (("--camera", "synthetic:fast"), "synthetic:TURN"),
        (("--camera", "synthetic", "--camera-fps", -1), "fps must be a number"),
        (("--camera", "synthetic", "--format", "grey"), "bgr"),
        (("--camera", "synthetic", "--recorder-trigger-class", "bal"), "'bal'"),
        (("--camera", "synthetic", "--explain"), "--explain is for files"),
        (("--camera", "/dev/video-none"), "needs a lens"),
        (("--config", tmp_path / "none.toml"), "none.toml"),
        (("--camera", "fault:none.toml"), "none.toml"),
        (("--camera", "http://"), "not a valid address"),
        (("--camera", "synthetic", "--pose-source", "udp:nowhere"), "127.0.0.1:5600"),
        (("--camera", "synthetic", "--pose-source", "radio"), "radio"),
        (("--camera", "synthetic", "--output-udp", "here"), "here"),
        (("--camera", "synthetic", "--output-unix", tmp_path / "no" / "folder"), "No such file"),
        (("--camera", "synthetic", "--output-file", tmp_path), "directory"),
        (("--camera", "synthetic", "--status-page", "127.0.0.1:0"), "127.0.0.1:0"),
        (("--camera", "synthetic", "--model", tmp_path / "none.onnx"), "none.onnx"),
        (("--camera", "synthetic", "--camera-pixel-format", "MJPEG", "--camera", "9"), "four letters"),
    ):
        done = subprocess.run(arguments(tmp_path, *options), capture_output=True, text=True, timeout=60, check=False)
        assert done.returncode == 78, (options, done.stderr)
        assert says in done.stderr
        assert "Traceback" not in done.stderr
        assert (tmp_path / "control").exists() is False


def test_a_camera_that_is_not_there_yet_is_waited_for(tmp_path):
    pose = ("--lens", DEMO / "lens0000000.yaml", "--height", 0.6)
    with running(tmp_path, "--camera", "/dev/video-none", "--camera-retry-ms", "20", *pose) as found:
        found.wait_for_state("camera_lost")
        found.wait(lambda: any(each.get("reason", "").startswith("there is no camera") for each in found.messages))
        found.wait(lambda: counts(tmp_path)["reconnects"] > 2)
        asked = subprocess.run(arguments(tmp_path, "--status"), capture_output=True, text=True, timeout=60, check=False)
        assert asked.returncode == 1
        assert json.loads(asked.stdout)["state"] == "camera_lost"
        assert found.stop()[0] == 0
    assert found.frames == []


def test_hangup_reads_the_configuration_again_and_keeps_the_old_one_if_it_is_bad(tmp_path):
    path = tmp_path / "vm.toml"
    path.write_text('[camera]\nsource = "synthetic"\n[detector]\nthreshold = 0.5\n')
    with running(tmp_path, "--config", path) as found:
        found.wait_for_state("ok")
        path.write_text("[detector]\ntreshold = 0.6\n")
        found.process.send_signal(signal.SIGHUP)
        refused = found.wait(lambda: [each for each in found.events if each["event"] == "reload refused"])
        assert "line 2" in refused[0]["reason"]
        before = len(found.frames)
        found.wait(lambda: len(found.frames) > before + 5)
        path.write_text('model = "ball-5x4"\n[camera]\nsource = "synthetic"\n')
        found.process.send_signal(signal.SIGHUP)
        found.wait(lambda: [each for each in found.events if each["event"] == "reloaded"])
        before = len(found.frames)
        found.wait(lambda: len(found.frames) > before + 5)
        found.stop()


def test_a_recording_is_detected_in_again_bit_by_bit(tmp_path):
    kept = tmp_path / "recordings"
    options = ("--camera", "synthetic", "--recorder-folder", kept, "--recorder-seconds", 0.5)
    with running(tmp_path, *options) as found:
        found.wait(lambda: len(found.frames) > 20)
        done = subprocess.run(arguments(tmp_path, "--record"), capture_output=True, text=True, timeout=60, check=True)
        assert "frames to" in done.stdout
        found.wait(lambda: [each for each in found.events if each["event"] == "recorded"])
        found.stop()
    (folder,) = kept.iterdir()
    recorded = [json.loads(line) for line in (folder / "recording.jsonl").read_text().splitlines()]
    assert len(recorded) > 3
    done = subprocess.run([COMMAND, "--camera", folder], capture_output=True, text=True, timeout=60, check=True)
    again = [json.loads(line) for line in done.stdout.splitlines()]
    assert [each["detections"] for each in again] == [each["detections"] for each in recorded]
    assert any(each["detections"] for each in again)


def test_the_printed_configuration_is_one_and_says_what_the_defaults_are(tmp_path):
    path = tmp_path / "vm.toml"
    printed = subprocess.run([COMMAND, "--print-config"], capture_output=True, text=True, timeout=60, check=True).stdout
    path.write_text(printed)
    again = [COMMAND, "--config", path, "--print-config"]
    assert subprocess.run(again, capture_output=True, text=True, timeout=60, check=True).stdout.count(
        "\n"
    ) == printed.count("\n")
    checked = [COMMAND, "--config", path, "--check-config", "--camera", "synthetic"]
    assert "self-test passed" in subprocess.run(checked, capture_output=True, text=True, timeout=60, check=True).stdout


def test_files_may_be_played_as_a_camera_gives_them_and_end(tmp_path):
    lens = ("--lens", DEMO / "lens0000000.yaml", "--height", "0.6")
    options = ("--camera", DEMO, "--live", "--camera-fps", "20", *lens)
    started = time.monotonic()
    done = subprocess.run(arguments(tmp_path, *options), capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    assert time.monotonic() - started > 12 / 20
    frames = [json.loads(line) for line in done.stdout.splitlines()]
    assert 0 < sum(each["type"] == "frame" for each in frames) <= 12


def test_figures_are_given_by_address_only_and_nothing_else_is(tmp_path):
    with socket.socket() as made:
        made.bind(("127.0.0.1", 0))
        port = made.getsockname()[1]

    def asked(request):
        with socket.create_connection(("127.0.0.1", port), 10.0) as connection:
            connection.sendall(request)
            return b"".join(iter(lambda: connection.recv(65536), b"")).decode()

    local = ("--status-metrics", f"unix:{tmp_path / 'figures'}", "--status-page", f"127.0.0.1:{port}")
    with running(tmp_path, "--camera", "synthetic", *local) as found:
        found.wait_for_state("ok")
        found.wait(lambda: len(found.frames) > 5)
        text = asked(b"GET /metrics HTTP/1.1\r\nHost: 127.0.0.1:1\r\n\r\n")
        assert text.startswith("HTTP/1.1 200 OK")
        assert 'vm_state{state="ok"} 1' in text
        figures = dict(line.rsplit(" ", 1) for line in text.splitlines() if line.startswith("vm_"))
        assert float(figures["vm_frames_total"]) >= 5
        assert float(figures['vm_stage_seconds_count{stage="infer"}']) == float(figures["vm_frames_total"])
        assert float(figures['vm_stage_seconds_bucket{stage="age",le="+Inf"}']) == float(figures["vm_frames_total"])
        assert float(figures["vm_resident_bytes"]) > 2e7
        assert asked(b"GET /metrics HTTP/1.1\r\nHost: robot.example\r\n\r\n").startswith("HTTP/1.1 403")
        assert asked(b"POST / HTTP/1.1\r\nHost: localhost\r\n\r\n").startswith("HTTP/1.1 405")
        assert asked(b"GET /etc/passwd HTTP/1.1\r\nHost: [::1]:1\r\n\r\n").startswith("HTTP/1.1 404")
        assert asked(b"\r\n\r\n").startswith("HTTP/1.1 405")
        with socket.socket(socket.AF_UNIX) as connection:
            connection.connect(str(tmp_path / "figures"))
            connection.sendall(b"GET /metrics HTTP/1.1\r\n\r\n")
            assert "vm_frames_total" in b"".join(iter(lambda: connection.recv(65536), b"")).decode()
        found.stop()


def test_the_sight_of_a_class_and_a_signal_make_recordings(tmp_path):
    kept = tmp_path / "recordings"
    options = ("--recorder-folder", kept, "--recorder-trigger-class", "ball", "--recorder-seconds", 0.3)
    with running(tmp_path, "--camera", "synthetic", *options) as found:
        found.wait(lambda: [each for each in found.events if each["event"] == "recorded"])
        time.sleep(1.1)  # folders have the second in their name
        found.process.send_signal(signal.SIGUSR1)
        found.wait(lambda: len([each for each in found.events if each["event"] == "recorded"]) == 2)
        found.stop()
    assert len(list(kept.iterdir())) == 2


def test_a_second_signal_ends_it_at_once(tmp_path):
    kept = tmp_path / "recordings"
    source = tmp_path / "script.toml"
    source.write_text('faults = [{ kind = "hang", at = 1.0, seconds = 60.0 }]\n')
    with running(tmp_path, "--camera", f"fault:{source}", "--recorder-folder", kept) as found:
        found.wait_for_state("camera_lost")
        for _ in range(2):
            found.process.send_signal(signal.SIGTERM)
        started = time.monotonic()
        assert found.process.wait(30) in (0, 1)
        assert time.monotonic() - started < 1.0


def test_what_is_wrong_with_an_output_shows_in_the_state(tmp_path):
    with running(tmp_path, "--camera", "synthetic", "--output-file", "/dev/full") as found:
        found.wait_for_state("degraded")
        found.wait(lambda: "No space left" in json.loads(ask(tmp_path / "control", "status"))["reason"])
        found.stop()


def test_a_recording_that_is_being_written_and_reads_that_hang_do_not_delay_the_end(tmp_path):
    source, kept = tmp_path / "script.toml", tmp_path / "recordings"
    source.write_text('faults = [{ kind = "hang", at = 8.0, seconds = 100.0 }]\n')
    large = ("--camera-width", 1280, "--camera-height", 960, "--recorder-folder", kept)
    retry = ("--camera-lost-ms", 500, "--camera-open-ms", 5000, "--camera-retry-ms", 10)
    with running(tmp_path, "--camera", f"fault:{source}", *large, *retry) as found:
        found.wait(lambda: len(found.frames) > 3)
        found.wait_for_state("camera_lost")
        done = subprocess.run(arguments(tmp_path, "--record"), capture_output=True, text=True, timeout=60, check=False)
        found.process.send_signal(signal.SIGTERM)
        started = time.monotonic()
        found.process.wait(60)
        assert time.monotonic() - started < 1.5
    assert done.returncode == 0, done.stderr


def test_a_long_line_on_standard_input_is_left_out_and_the_next_one_is_read(tmp_path):
    with running(tmp_path, "--camera", "synthetic", "--pose-source", "stdin", stdin=subprocess.PIPE) as found:
        found.wait_for_state("pose_stale")
        found.process.stdin.write(b"x" * 9000 + b"\n")
        for _ in range(200):
            pose = {"t": time.monotonic(), "height": 0.8, "quaternion": [0.98, 0.0, 0.199, 0.0]}
            found.process.stdin.write(json.dumps(pose).encode() + b"\n")
            found.process.stdin.flush()
            time.sleep(0.01)
        found.wait_for_state("ok")
        found.stop()


def test_what_can_not_be_read_or_written_is_said_without_a_traceback(tmp_path):
    command = arguments(tmp_path, "--camera", "synthetic")
    for more, says in (
        ("--pose-source stdin </dev/null", "stdin need a pipe"),
        ("--pose-source stdin <&-", "stdin need a pipe"),
        (">&-", "standard output is closed"),
    ):
        line = f"{' '.join(command)} {more}"
        done = subprocess.run(line, shell=True, capture_output=True, text=True, timeout=60, check=False)
        assert done.returncode == 78, (more, done.stderr)
        assert says in done.stderr
        assert "Traceback" not in done.stderr


def test_a_client_that_says_nothing_is_let_go_of_at_the_end(tmp_path):
    with running(tmp_path, "--camera", "synthetic") as found:
        found.wait_for_state("ok")
        with socket.socket(socket.AF_UNIX) as silent:
            silent.connect(str(tmp_path / "control"))
            assert found.stop()[0] == 0


def test_asking_what_is_no_detector_ends(tmp_path):
    path = tmp_path / "other"
    with socket.socket(socket.AF_UNIX) as other:
        other.bind(str(path))
        other.listen()
        command = [COMMAND, "--status", "--status-socket", path]
        done = subprocess.run(command, capture_output=True, text=True, timeout=30, check=False)
    assert done.returncode == 1
    assert "no detector replies" in done.stderr


def test_passwords_of_cameras_are_not_shown(tmp_path):
    pose = ("--lens", DEMO / "lens0000000.yaml", "--height", 0.6)
    with running(tmp_path, "--camera", "http://user:secret@127.0.0.1:9/x", *pose) as found:
        found.wait_for_state("camera_lost")
        found.stop()
    assert "secret" not in json.dumps([found.messages, found.events])
    assert "no response from http://127.0.0.1:9/x" in json.dumps(found.messages)
