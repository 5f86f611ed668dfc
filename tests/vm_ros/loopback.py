"""DDS between processes of this machine, without a network: each test has a domain of its own."""

import os

URI = (
    "<CycloneDDS><Domain><General><Interfaces><NetworkInterface name='lo' multicast='false'/></Interfaces>"
    "<AllowMulticast>false</AllowMulticast></General><Discovery><ParticipantIndex>auto</ParticipantIndex>"
    "<MaxAutoParticipantIndex>30</MaxAutoParticipantIndex><Peers><Peer address='127.0.0.1'/></Peers></Discovery>"
    "</Domain></CycloneDDS>"
)


def loopback(domain):
    """The environment of a process."""
    return {**os.environ, "CYCLONEDDS_URI": URI, "ROS_DOMAIN_ID": str(domain)}
