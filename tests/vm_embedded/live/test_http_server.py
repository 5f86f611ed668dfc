"""The metrics of a real vm-detect over HTTP."""

import asyncio
import json
import select
import socket
import time

import pytest

from tests.vm_embedded.live.running import running
from vm_embedded.borders.sockets import datagram_socket, is_open_to_network
from vm_embedded.errors import InputError, NetworkError
from vm_embedded.live.http_server import HttpServer, Response


def test_a_busy_port_and_an_unknown_host_are_named_once():
    with socket.socket() as busy:
        busy.bind(("127.0.0.1", 0))
        busy.listen()
        where = f"127.0.0.1:{busy.getsockname()[1]}"
        with pytest.raises(InputError, match=rf"^can't listen at {where}: Address already in use$"):
            asyncio.run(HttpServer(where, "--status-page", {}).open())
    with pytest.raises(InputError, match=r"^can't listen at host\.invalid:1: (?!Unknown error)"):
        asyncio.run(HttpServer("host.invalid:1", "--status-page", {}).open())
    for host in ("a..b", "a" * 64):
        with pytest.raises(InputError, match="can't be the name of a host"):
            asyncio.run(HttpServer(f"{host}:1", "--status-page", {}).open())
        with pytest.raises(InputError, match="can't be the name of a host"):
            datagram_socket(host, 1, "can't send to")


def test_a_name_may_have_an_address_that_the_machine_lacks(monkeypatch):
    """As localhost in /etc/hosts where IPv6 is switched off. Python 3.13 has another error without a number."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    here, elsewhere = (
        socket.getaddrinfo(each, port, type=socket.SOCK_STREAM)[0] for each in ("127.0.0.1", "192.0.2.1")
    )

    async def begun(*found):
        monkeypatch.setattr(socket, "getaddrinfo", lambda *_, **__: found)
        server = HttpServer(f"localhost:{port}", "--status-page", {})
        await server.open()
        connection = socket.socket()
        connection.connect(here[4])
        reader, writer = await asyncio.open_connection(sock=connection)
        writer.write(b"GET / HTTP/1.1\r\n\r\n")
        answer = await reader.read()
        writer.close()
        await server.close()
        return answer

    for found in ((here, elsewhere), (elsewhere, here)):
        assert asyncio.run(begun(*found)).startswith(b"HTTP/1.1 404")
    with pytest.raises(NetworkError, match=f"can't listen at localhost:{port}: Cannot assign requested address"):
        asyncio.run(begun(elsewhere))


@pytest.mark.parametrize("steps", range(6))
def test_a_server_ends_a_stream_that_is_about_to_send(tmp_path, steps):
    """Whatever the stream does in the step of the loop in which it is canceled."""

    async def close_while_it_streams():
        fresh = asyncio.Event()

        async def stream(write):
            while True:
                await write(b"picture")
                await asyncio.wait_for(fresh.wait(), 10.0)
                fresh.clear()

        server = HttpServer(f"unix:{tmp_path / 'page'}", "--status-page", {}, {"/stream": stream})
        await server.open()
        reader, writer = await asyncio.open_unix_connection(tmp_path / "page")
        writer.write(b"GET /stream HTTP/1.1\r\n\r\n")
        assert await reader.readexactly(7) == b"picture"
        await asyncio.sleep(0.05)
        fresh.set()
        for _ in range(steps):
            await asyncio.sleep(0)
        await asyncio.wait_for(server.close(), 5.0)
        assert await reader.read() in (b"", b"picture")
        writer.close()

    asyncio.run(close_while_it_streams())


@pytest.mark.parametrize("address", ["/page", "/stream"])
def test_a_browser_that_reads_nothing_is_disconnected(tmp_path, monkeypatch, address):
    monkeypatch.setattr("vm_embedded.live.http_server._TIMEOUT", 0.2)
    content = bytes(1_000_000)

    async def serve():
        async def stream(write):
            while True:
                await write(content)

        pages, streams = {"/page": lambda _: Response("text/plain", content)}, {"/stream": stream}
        server = HttpServer(f"unix:{tmp_path / 'page'}", "--status-page", pages, streams)
        await server.open()
        with socket.socket(socket.AF_UNIX) as browser:
            browser.connect(str(tmp_path / "page"))
            browser.sendall(f"GET {address} HTTP/1.1\r\n\r\n".encode())
            ended = select.poll()
            ended.register(browser, select.POLLHUP)
            deadline = time.monotonic() + 5.0
            while not ended.poll(0):
                assert time.monotonic() < deadline
                await asyncio.sleep(0.02)
        await server.close()

    asyncio.run(serve())


@pytest.mark.long
def test_orientations_beside_the_camera_s_are_prepared_between_frames(tmp_path):
    local = ("--status-metrics", f"unix:{tmp_path / 'figures'}")
    with running(tmp_path, "--camera", "synthetic", *local) as found:

        def prepared():
            with socket.socket(socket.AF_UNIX) as connection:
                connection.settimeout(10.0)
                connection.connect(str(tmp_path / "figures"))
                connection.sendall(b"GET /metrics HTTP/1.1\r\nHost: localhost\r\n\r\n")
                text = b"".join(iter(lambda: connection.recv(65536), b"")).decode()
            return int(text.split("\nvm_cache_prepared_total ")[1].split("\n")[0])

        found.wait_for_state("ok")
        found.wait(lambda: prepared() >= 4)
        found.stop()


@pytest.mark.long
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
        assert 'vm_pose{pose="unknown"} 1' in text
        figures = dict(line.rsplit(" ", 1) for line in text.splitlines() if line.startswith("vm_"))
        assert float(figures["vm_frames_total"]) >= 5
        assert float(figures['vm_stage_seconds_count{stage="infer"}']) == float(figures["vm_frames_total"])
        assert float(figures['vm_stage_seconds_bucket{stage="age",le="+Inf"}']) == float(figures["vm_frames_total"])
        assert float(figures["vm_resident_bytes"]) > 2e7
        overhead = json.loads(asked(b"GET /map HTTP/1.1\r\nHost: localhost\r\n\r\n").split("\r\n\r\n")[1])
        assert overhead["view"][0][0]
        assert overhead["field"] is None
        assert asked(b"GET /metrics HTTP/1.1\r\nHost: robot.example\r\n\r\n").startswith("HTTP/1.1 403")
        assert asked(b"POST / HTTP/1.1\r\nHost: localhost\r\n\r\n").startswith("HTTP/1.1 405")
        assert asked(b"GET /etc/passwd HTTP/1.1\r\nHost: [::1]:1\r\n\r\n").startswith("HTTP/1.1 404")
        assert asked(b"\r\n\r\n").startswith("HTTP/1.1 405")
        (token,) = [each["token"].encode() for each in found.events if each["event"] == "status page"]
        assert '"accepted": ' in asked(b"GET /preview?value=0.3 HTTP/1.1\r\nHost: localhost\r\n\r\n")
        for value in (b"", b"?value=nan", b"?value=2", b"?value=x"):
            answer = asked(b"GET /preview" + value + b" HTTP/1.1\r\nHost: localhost\r\n\r\n")
            assert answer.startswith("HTTP/1.1 400")
            assert "from 0 to 1" in answer
        change, right = b" /threshold?value=0.9 HTTP/1.1\r\nHost: ", b"\r\nX-Token: " + token
        for refused in (b"localhost", b"localhost\r\nX-Token: ", b"localhost\r\nX-Token: x", b"a.example" + right):
            assert asked(b"POST" + change + refused + b"\r\n\r\n").startswith("HTTP/1.1 403")
        assert asked(b"GET" + change + b"localhost" + right + b"\r\n\r\n").startswith("HTTP/1.1 404")
        assert asked(b"OPTIONS" + change + b"localhost\r\n\r\n").startswith("HTTP/1.1 405")
        assert not [each for each in found.events if each["event"] == "threshold changed"]
        answer = asked(b"POST /record HTTP/1.1\r\nHost: [::1]" + right + b"\r\n\r\n")
        assert answer.startswith("HTTP/1.1 400")
        assert answer.endswith("recording is off: set [recorder] folder\n")
        assert asked(b"POST" + change + b"localhost" + right + b"\r\n\r\n").startswith("HTTP/1.1 200")
        found.wait(lambda: [each for each in found.events if each["event"] == "threshold changed"])
        with socket.socket(socket.AF_UNIX) as connection:
            connection.connect(str(tmp_path / "figures"))
            connection.sendall(b"GET /metrics HTTP/1.1\r\n\r\n")
            assert "vm_frames_total" in b"".join(iter(lambda: connection.recv(65536), b"")).decode()
        found.stop()


@pytest.mark.long
def test_attack_12_a_page_that_the_network_can_reach_is_warned_about(tmp_path):
    with socket.socket() as one, socket.socket() as other:
        for each in (one, other):
            each.bind(("127.0.0.1", 0))
        page, metrics = f"0.0.0.0:{one.getsockname()[1]}", f"127.0.0.1:{other.getsockname()[1]}"
    with running(tmp_path, "--camera", "synthetic", "--status-page", page, "--status-metrics", metrics) as found:
        found.wait_for_state("ok")
        found.stop()
    (warning,) = [each for each in found.events if each["event"] == "open to the network"]
    assert (warning["level"], warning["entry"], warning["address"]) == ("warning", "[status] page", page)


@pytest.mark.parametrize(
    ("address", "is_open"),
    [
        ("127.0.0.1:80", False),
        ("127.1.2.3:80", False),
        ("[::1]:80", False),
        ("localhost:80", False),
        ("unix:/tmp/page", False),
        ("0.0.0.0:80", True),
        ("[::]:80", True),
        ("192.168.0.20:80", True),
        ("robot:80", True),
    ],
)
def test_which_addresses_the_network_can_reach(address, is_open):
    assert is_open_to_network(address) == is_open
