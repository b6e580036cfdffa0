"""A part of a sweep as one file.

The file holds, in this order: a line with the format and its version; a line with the length of the header;
the header as JSON (keys, schema, codes, messages, texts); the numbers of each column; the crc32 of all bytes
before.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hybrid.sweep.outcome import DTYPES, Part, Schema

MAGIC = b"hybrid-sweep-part 1\n"


class DamagedError(Exception):
    """The file does not hold what was written."""


def written(part: Part, keys: Sequence[bytes]) -> bytes:
    """The bytes of a part, of which each point has a key."""
    texts: dict[str, int] = {}
    header: dict[str, Any] = {
        "keys": [key.hex() for key in keys],
        "codes": part.codes.tolist(),
        "messages": [texts.setdefault(text, len(texts)) for text in part.messages],
        "columns": None if part.schema is None else part.schema.columns,
        "labels": "" if part.schema is None else part.schema.labels,
        "strings": {},
    }
    numbers = []
    for i, column in enumerate(part.columns):
        if column.dtype.kind == "O":
            header["strings"][str(i)] = [
                texts.setdefault(text, len(texts)) for text in column.ravel().tolist()
            ]
        else:
            numbers.append(np.ascontiguousarray(column).tobytes())
    header["texts"] = list(texts)
    line = json.dumps(header).encode("utf-8")
    content = b"".join([MAGIC, b"%d\n" % len(line), line, *numbers])
    return content + zlib.crc32(content).to_bytes(4, "little")


def read_part(path: Path) -> tuple[list[bytes], Part]:
    """The keys and results of a file; the rows count from zero."""
    content = path.read_bytes()
    body, check = content[:-4], content[-4:]
    if not body.startswith(MAGIC):
        raise DamagedError("it does not begin as it should")
    if zlib.crc32(body).to_bytes(4, "little") != check:
        raise DamagedError("its checksum does not match")
    length, _, rest = body[len(MAGIC) :].partition(b"\n")
    header, numbers = json.loads(rest[: int(length)]), rest[int(length) :]
    keys, texts = [bytes.fromhex(key) for key in header["keys"]], header["texts"]
    schema, columns, offset = None, [], 0
    if header["columns"] is not None:
        described = tuple((name, tuple(shape), kind) for name, shape, kind in header["columns"])
        schema = Schema(described, header["labels"])
        for i, (_, shape, kind) in enumerate(described):
            full = (len(keys), *shape)
            if kind == "s":
                column = np.empty(int(np.prod(full)), dtype=object)
                column[:] = [texts[index] for index in header["strings"][str(i)]]
                columns.append(column.reshape(full))
                continue
            count = int(np.prod(full))
            column = np.frombuffer(numbers, dtype=DTYPES[kind], count=count, offset=offset)
            offset += column.nbytes
            columns.append(column.reshape(full))
    part = Part(
        rows=np.arange(len(keys)),
        schema=schema,
        columns=columns,
        codes=np.array(header["codes"], dtype=np.int16),
        messages=[texts[index] for index in header["messages"]],
    )
    return keys, part
