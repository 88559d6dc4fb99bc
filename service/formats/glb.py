"""The container of binary glTF files (.glb): a header, and chunks of which the first is JSON."""

from __future__ import annotations

import struct

MAGIC = b"glTF"


def split_glb(content: bytes) -> tuple[bytes, bytes]:
    """Return the JSON, and the chunks behind it."""
    (length,) = struct.unpack_from("<I", content, 12)
    return content[20 : 20 + length], content[20 + length :]


def pack_glb(text: bytes, chunks: bytes) -> bytes:
    """Return the file of this JSON, and of the chunks behind it."""
    text += b" " * (-len(text) % 4)
    content = struct.pack("<I4s", len(text), b"JSON") + text + chunks
    return MAGIC + struct.pack("<II", 2, 12 + len(content)) + content


def binary_chunk(data: bytes) -> bytes:
    """Return the chunk of binary data, whose length is a multiple of 4."""
    return struct.pack("<I4s", len(data), b"BIN\0") + data
