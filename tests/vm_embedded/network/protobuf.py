"""Bytes of protobuf messages, for files that no library writes."""


def varint(value):
    """A whole number in the wire format, seven bits a byte."""
    encoded = b""
    while value > 127:
        encoded += bytes([value & 127 | 128])
        value >>= 7
    return encoded + bytes([value])
