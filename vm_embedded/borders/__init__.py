"""The borders to the system and its libraries: sockets, text that others wrote, OpenCV, and messages."""
