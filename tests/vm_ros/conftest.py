import pytest

from .loopback import Peer, own_domain


@pytest.fixture
def peer(monkeypatch):
    """Another node, in a domain of its own."""
    with own_domain(monkeypatch):
        peer = Peer()
        yield peer
        peer.middleware.close()
