"""Files taken apart and put together again with right checksums, whatever is in them."""

import hashlib
import json
import struct
import zlib

from flockbrush.engine import recording_format


def records_of(data):
    """[(kind, tick, content)] of a recording that is whole; snapshots are unpacked as well."""
    at, found = recording_format.BEGINNING.size, []
    while at < len(data):
        kind, packed, _, stored, _, tick, _ = recording_format.RECORD.unpack_from(data, at)
        at += recording_format.RECORD.size
        body = data[at : at + stored]
        found.append((kind, tick, zlib.decompress(body) if packed else body))
        at += stored
    return found


def record(kind, tick, data, claimed=None, pack=True):
    """One record with a right checksum; ``claimed`` bytes, where it shall lie."""
    stored = zlib.compress(data, 1) if pack else data
    packed = pack and len(stored) < len(data)
    stored = stored if packed else data
    size = len(data) if claimed is None else claimed
    head = recording_format.RECORD.pack(kind, packed, 0, len(stored), size, tick, 0)[:-4]
    return head + struct.pack("<I", zlib.crc32(stored, zlib.crc32(head))) + stored


def recording_of(records):
    """The file of these (kind, tick, content), whatever they say."""
    return recording_format.file_header(recording_format.FORMAT) + b"".join(record(*r) for r in records)


def with_header(records, **changes):
    """The records with some of the header changed."""
    header = json.loads(records[0][2]) | changes
    return [(b"H", 0, json.dumps(header).encode()), *records[1:]]


def with_true_assets(records):
    """The records with a header that promises exactly the files that follow."""
    header, table = json.loads(records[0][2]), {}
    for kind, _, content in records:
        if kind == b"A":
            name, _, data = content.partition(b"\0")
            table[name.decode(errors="replace")] = {"sha256": hashlib.sha256(data).hexdigest(), "bytes": len(data)}
    return [(b"H", 0, json.dumps(header | {"assets": table}).encode()), *records[1:]]


def png_chunks(data):
    """[(kind, content)] of a PNG."""
    at, found = 8, []
    while at + 12 <= len(data):
        (size,), kind = struct.unpack_from(">I", data, at), data[at + 4 : at + 8]
        found.append((kind, data[at + 8 : at + 8 + size]))
        at += 12 + size
    return found


def png_of(chunks):
    """The PNG of these chunks, with right checksums."""
    parts = [b"\x89PNG\r\n\x1a\n"]
    for kind, content in chunks:
        parts += [struct.pack(">I", len(content)), kind, content, struct.pack(">I", zlib.crc32(kind + content))]
    return b"".join(parts)


def plain_png(width, height, depth=1, colour=0, lines=None):
    """A PNG that claims this size; all black, in a few hundred kilobytes, where its lines are not given."""
    bits = depth * {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}[colour]
    line = b"\0" * (1 + (width * bits + 7) // 8)
    stream, packed = zlib.compressobj(9), []
    for _ in range(height if lines is None else lines):
        packed.append(stream.compress(line))
    packed.append(stream.flush())
    head = struct.pack(">IIBBBBB", width, height, depth, colour, 0, 0, 0)
    return png_of([(b"IHDR", head), (b"IDAT", b"".join(packed)), (b"IEND", b"")])
