"""Reads the OpenEXR files that Lumbre writes: one part of tiles or scan lines with R, G and B, and
layers in further channels, as 32-bit floats, compressed by ZIP or not at all. For other files use a
library such as OpenEXR."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path
from typing import Dict, Sequence, Tuple, Union

import numpy as np

_MAGIC = 20000630
#: Compression by its number in the file: rows in a block.
_ROWS = {0: 1, 2: 1, 3: 16}
_FLOAT = 2


def read_exr(
    path: Union[str, Path], channels: Sequence[str] = ("R", "G", "B")
) -> "np.ndarray":
    """Returns the picture in a file as an array of ``float32``, ``[row, column, channel]`` with the
    first row at the top. Without ``channels`` these are red, green and blue in linear radiance.

    Raises:
        ValueError: The file is not an OpenEXR file as Lumbre writes it, or lacks a channel.
    """
    return _decode(Path(path), channels)[0]


def read_metadata(path: Union[str, Path]) -> Dict[str, str]:
    """Returns the text attributes of a file: the run, its plan, samples, seed and device.

    Raises:
        ValueError: The file is not an OpenEXR file as Lumbre writes it.
    """
    return _decode(Path(path), ())[1]


def _decode(path: Path, channels: Sequence[str]) -> Tuple["np.ndarray", Dict[str, str]]:
    data = path.read_bytes()
    try:
        attributes, start = _header(data)
        picture = _pixels(data, attributes, start, channels) if channels else np.empty(0)
    except (struct.error, IndexError, KeyError, zlib.error) as error:
        raise ValueError(f"{path} is not an OpenEXR file as Lumbre writes it: {error}") from error
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error
    texts = {
        name[len("lumbre."):] if name.startswith("lumbre.") else name: value.decode("utf-8", "replace")
        for name, (kind, value) in attributes.items()
        if kind == "string"
    }
    return picture, texts


def _header(data: bytes) -> Tuple[Dict[str, Tuple[str, bytes]], int]:
    """Returns the attributes by name, as type and bytes, and where they end."""
    magic, version = struct.unpack_from("<II", data, 0)
    if magic != _MAGIC or version & 0xFF != 2 or version & 0x1800:
        raise ValueError("no OpenEXR file of one part")
    attributes: Dict[str, Tuple[str, bytes]] = {}
    at = 8
    while data[at] != 0:
        name_end = data.index(b"\0", at)
        kind_end = data.index(b"\0", name_end + 1)
        (size,) = struct.unpack_from("<i", data, kind_end + 1)
        value = data[kind_end + 5 : kind_end + 5 + size]
        attributes[data[at:name_end].decode()] = (data[name_end + 1 : kind_end].decode(), value)
        at = kind_end + 5 + size
    return attributes, at + 1


def _channels(value: bytes) -> Tuple[str, ...]:
    names = []
    at = 0
    while value[at] != 0:
        end = value.index(b"\0", at)
        kind, _, x, y = struct.unpack_from("<iiii", value, end + 1)
        if kind != _FLOAT or (x, y) != (1, 1):
            raise ValueError("a channel has another type than 32-bit float")
        names.append(value[at:end].decode())
        at = end + 17
    return tuple(names)


def _pixels(
    data: bytes, attributes: Dict[str, Tuple[str, bytes]], start: int, channels: Sequence[str]
) -> "np.ndarray":
    left, top, right, bottom = struct.unpack("<iiii", attributes["dataWindow"][1])
    width, height = right - left + 1, bottom - top + 1
    names = _channels(attributes["channels"][1])
    compression = attributes["compression"][1][0]
    if compression not in _ROWS:
        raise ValueError("another compression than ZIP")
    tiled = "tiles" in attributes
    if tiled:
        columns, rows, mode = struct.unpack("<IIB", attributes["tiles"][1])
        if mode & 0xF:
            raise ValueError("several levels of resolution")
    else:
        columns, rows = width, _ROWS[compression]
    blocks = -(-height // rows) * -(-width // columns)
    planes = np.empty((height, len(names), width), dtype="<f4")
    for offset in struct.unpack_from(f"<{blocks}Q", data, start):
        if tiled:
            column, row, _, _, size = struct.unpack_from("<iiiii", data, offset)
            x, y, offset = column * columns, row * rows, offset + 20
        else:
            row, size = struct.unpack_from("<ii", data, offset)
            x, y, offset = 0, row - top, offset + 8
        shape = (min(rows, height - y), len(names), min(columns, width - x))
        raw = data[offset : offset + size]
        expected = 4 * shape[0] * shape[1] * shape[2]
        if compression and size < expected:
            raw = _unzip(raw)
        if min(shape) < 1 or len(raw) != expected:
            raise ValueError("a block of pixels has the wrong size")
        planes[y : y + shape[0], :, x : x + shape[2]] = np.frombuffer(raw, "<f4").reshape(shape)
    order = [names.index(channel) for channel in channels]
    return np.ascontiguousarray(planes[:, order, :].transpose(0, 2, 1), dtype=np.float32)


def _unzip(raw: bytes) -> bytes:
    """Undoes ZIP compression: inflates, sums the differences of bytes, and interleaves the halves."""
    inflated = np.frombuffer(zlib.decompress(raw), np.uint8).astype(np.int64)
    inflated[1:] -= 128
    summed = (np.cumsum(inflated) & 0xFF).astype(np.uint8)
    half = (len(summed) + 1) // 2
    out = np.empty_like(summed)
    out[0::2] = summed[:half]
    out[1::2] = summed[half:]
    return out.tobytes()
