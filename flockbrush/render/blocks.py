"""Sixteen bytes at a time: laying small blocks of a picture over a frame, the innermost step of all drawing.

A block's row is stored in pairs of sixteen bytes: how much of what is there stays (0 to 255), then what is added.
Rows are filled up with bytes that change nothing (255, 0).  Written as vector code because compilers do not find
vectors in loops as short as an animal is wide; it is eight times faster for it.
"""

from __future__ import annotations

import numpy as np
from llvmlite import ir
from numba import types

from flockbrush.engine.interpreted import interpretable

LANES = 16


def interpreted_lay16(frame, at, block, source):
    """`lay16` for kernels that Python runs."""
    ground, (stays, added) = frame[at : at + LANES], block[source : source + 2 * LANES].reshape(2, LANES)
    ground[:] = (ground.astype(np.uint16) * stays + np.uint16(255) >> 8).astype(np.uint8) + added


@interpretable(interpreted_lay16)
def lay16(typing, frame, at, block, source):
    """``frame[at + j] = (frame[at + j] * block[source + j] + 255 >> 8) + block[source + 16 + j]`` for sixteen j.

    Both arrays are flat, contiguous uint8.  Nothing is checked: a place outside the arrays is somebody else's memory.
    """

    def generate(context, builder, signature, arguments):
        bytes16, words16 = ir.VectorType(ir.IntType(8), LANES), ir.VectorType(ir.IntType(16), LANES)

        def pointer(array, offset):
            base = context.make_array(signature.args[array])(context, builder, arguments[array]).data
            return builder.bitcast(builder.gep(base, [offset]), bytes16.as_pointer())

        def load(place):
            value = builder.load(place)
            value.align = 1
            return value

        ground = pointer(0, arguments[1])
        stays = builder.zext(load(pointer(2, arguments[3])), words16)
        added = load(pointer(2, builder.add(arguments[3], ir.Constant(ir.IntType(64), LANES))))
        product = builder.mul(builder.zext(load(ground), words16), stays)
        rounded = builder.add(product, ir.Constant(words16, [255] * LANES))
        kept = builder.trunc(builder.lshr(rounded, ir.Constant(words16, [8] * LANES)), bytes16)
        builder.store(builder.add(kept, added), ground).align = 1
        return context.get_dummy_value()

    return types.void(frame, types.intp, block, types.intp), generate


def pack(stays: np.ndarray, added: np.ndarray) -> np.ndarray:
    """Blocks as `lay16` takes them: of (n, h, w, 3) uint8 twice, (n, h, chunks, 2, 16)."""
    count, tall, wide, _ = stays.shape
    chunks = -(-3 * wide // LANES)
    block = np.zeros((count, tall, 2, chunks * LANES), np.uint8)
    block[:, :, 0] = 255
    block[:, :, 0, : 3 * wide] = stays.reshape(count, tall, -1)
    block[:, :, 1, : 3 * wide] = added.reshape(count, tall, -1)
    return np.ascontiguousarray(block.reshape(count, tall, 2, chunks, LANES).transpose(0, 1, 3, 2, 4))
