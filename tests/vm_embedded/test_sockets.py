"""Connections to a socket that listens are accepted with pauses."""

import asyncio
import socket

from vm_embedded import sockets
from vm_embedded.sockets import Acceptor, UnixListener


def test_connections_of_a_flood_are_accepted_with_pauses(tmp_path, monkeypatch):
    """Without pauses, they would take the processor from the frames."""
    monkeypatch.setattr(sockets, "_PAUSE", 3600.0)
    served = []

    async def serve(reader, writer):
        served.append(await reader.readline())
        writer.close()

    async def flood():
        listener = UnixListener(tmp_path / "socket", "--option")
        clients = [socket.socket(socket.AF_UNIX) for _ in range(10)]
        for each in clients:
            each.connect(str(listener.path))
            each.sendall(b"x\n")
        acceptor = Acceptor(listener.socket, serve, 1024)
        while len(served) < 4:
            await asyncio.sleep(0.01)
        await asyncio.sleep(0.1)
        acceptor.close()
        listener.close()
        for each in clients:
            each.close()

    asyncio.run(flood())
    assert served == 4 * [b"x\n"]
