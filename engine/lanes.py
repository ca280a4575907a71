"""Sixteen numbers at once, or eight: short vectors for numba kernels, as wide on every machine.

A kernel written with them does the same elementwise arithmetic everywhere,
bit for bit; LLVM cuts the sixteen lanes to what the processor has (one AVX-512
register, two of AVX, four of SSE or NEON).  Lanes are added up in one order
only (`total`), so no result depends on the width.  Needed where numba's own vectoriser gives up: on
maxima of floats, on compaction and on many arrays at once.

Inside ``@njit``: ``+ - * /`` and comparisons between vectors, or of a vector
with a scalar on its right, and the functions below.  Vectors live in
registers: make them, use them, store them; they cannot leave the kernel.
Exponentials and angles of vectors are in `flockbrush.engine.lane_maths`.
"""

from __future__ import annotations

import operator

from flockbrush.engine.interpreted import EIGHT, LANES, intrinsic
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.errors import TypingError
from numba.core.typing.templates import ConcreteTemplate, infer_global, signature
from numba.extending import lower_builtin, models, register_model
from numba.np.arrayobj import make_array


class Lanes(types.Type):
    """Numba's type of sixteen numbers of one kind, or of eight."""

    def __init__(self, dtype, width=LANES):
        self.dtype, self.width = dtype, width
        super().__init__(name=f"Lanes({dtype} x {width})")


F32, F64, I32, MASK = (Lanes(dtype) for dtype in (types.float32, types.float64, types.int32, types.boolean))
F64X8, MASKX8 = Lanes(types.float64, EIGHT), Lanes(types.boolean, EIGHT)
_ELEMENT = {
    types.float32: ir.FloatType(), types.float64: ir.DoubleType(), types.int32: ir.IntType(32),
    types.boolean: ir.IntType(1),
}  # fmt: skip
_SUFFIX = {F32: "v16f32", F64: "v16f64", I32: "v16i32", F64X8: "v8f64"}
_BY_DTYPE = {vector.dtype: vector for vector in (F32, F64, I32)}


def _llvm(vector):
    return ir.VectorType(_ELEMENT[vector.dtype], vector.width)


@register_model(Lanes)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager, fe_type):
        super().__init__(manager, fe_type, _llvm(fe_type))


def _splat(builder, vector, value):
    return _splat_llvm(builder, _llvm(vector), value)


def _splat_llvm(builder, kind, value):
    lane0 = builder.insert_element(ir.Constant(kind, ir.Undefined), value, ir.Constant(ir.IntType(32), 0))
    everywhere = ir.Constant(ir.VectorType(ir.IntType(32), kind.count), [0] * kind.count)
    return builder.shuffle_vector(lane0, lane0, everywhere)


def _define(op, vector, result, build):
    """Let ``op`` take two vectors, or a vector and a scalar of its kind."""
    cases = [signature(result, vector, vector)]
    lower_builtin(op, vector, vector)(lambda context, builder, sig, args: build(builder, *args))
    if vector.dtype != types.boolean:
        cases.append(signature(result, vector, vector.dtype))
        lower_builtin(op, vector, vector.dtype)(
            lambda context, builder, sig, args: build(builder, args[0], _splat(builder, vector, args[1]))
        )
    infer_global(op)(type(f"{op.__name__}_{vector}", (ConcreteTemplate,), {"cases": cases}))


def _compare(sign, method):
    return lambda builder, a, b: getattr(builder, method)(sign, a, b)


for _vector in (F32, F64, F64X8):
    for _op, _name in (
        (operator.add, "fadd"),
        (operator.sub, "fsub"),
        (operator.mul, "fmul"),
        (operator.truediv, "fdiv"),
    ):
        _define(_op, _vector, _vector, lambda builder, a, b, name=_name: getattr(builder, name)(a, b))
for _op, _sign in (
    (operator.lt, "<"),
    (operator.le, "<="),
    (operator.gt, ">"),
    (operator.ge, ">="),
    (operator.ne, "!="),
):
    for _vector, _mask in ((F32, MASK), (F64, MASK), (F64X8, MASKX8)):
        _define(_op, _vector, _mask, _compare(_sign, "fcmp_ordered"))
    _define(_op, I32, MASK, _compare(_sign, "icmp_signed"))
_define(operator.add, I32, I32, lambda builder, a, b: builder.add(a, b))
_define(operator.and_, I32, I32, lambda builder, a, b: builder.and_(a, b))
for _mask in (MASK, MASKX8):
    _define(operator.and_, _mask, _mask, lambda builder, a, b: builder.and_(a, b))
    _define(operator.or_, _mask, _mask, lambda builder, a, b: builder.or_(a, b))


@infer_global(operator.invert)
class _Invert(ConcreteTemplate):
    cases = [signature(MASK, MASK)]


@lower_builtin(operator.invert, MASK)
def _invert(context, builder, sig, args):
    return builder.xor(args[0], ir.Constant(_llvm(MASK), [1] * LANES))


def _address(builder, start, at, vector):
    return builder.bitcast(builder.gep(start, [at]), _llvm(vector).as_pointer())


def _part(builder, lanes, first, width):
    these = ir.Constant(ir.VectorType(ir.IntType(32), width), list(range(first, first + width)))
    return builder.shuffle_vector(lanes, lanes, these)


def _cut(builder, lanes, first, width):
    """Some of the lanes, a narrower vector."""
    return lanes if width == LANES else _part(builder, lanes, first, width)


def _call(builder, name, result, args):
    kind = ir.FunctionType(result, [a.type for a in args])
    return builder.call(cgutils.get_or_insert_function(builder.module, kind, name), args)


def _bytes(vector):
    return vector.dtype.bitwidth // 8


@intrinsic
def splat(typingctx, value):
    """The same number in all lanes."""
    vector = _BY_DTYPE[value]
    return vector(value), lambda context, builder, sig, args: _splat(builder, vector, args[0])


@intrinsic
def splat8(typingctx, value):
    """The same float64 in all of eight lanes."""
    return F64X8(value), lambda context, builder, sig, args: _splat(builder, F64X8, args[0])


@intrinsic
def lane_numbers(typingctx):
    """0 to 15, as int32."""
    return I32(), lambda *_: ir.Constant(_llvm(I32), list(range(LANES)))


@intrinsic
def pointer(typingctx, array):
    """Where the numbers of a contiguous array begin; ``p[k]`` reads and writes them, unchecked and uncounted.

    It does not keep the array alive: take pointers only of the arguments of a function, which its caller holds.
    """

    if array.layout != "C":
        raise TypingError(f"a pointer is taken of contiguous arrays only, got {array}")

    def build(context, builder, sig, args):
        return make_array(sig.args[0])(context, builder, args[0]).data

    return types.CPointer(array.dtype)(array), build


@intrinsic
def load(typingctx, start, at):
    """The numbers ``start[at:at + 16]``, which must exist."""
    return _loading(_BY_DTYPE[start.dtype], start)


@intrinsic
def load8(typingctx, start, at):
    """The float64 ``start[at:at + 8]``, which must exist."""
    return _loading(F64X8, start)


def _loading(vector, start):
    def build(context, builder, sig, args):
        value = builder.load(_address(builder, *args[:2], vector))
        value.align = _bytes(vector)
        return value

    return vector(start, types.intp), build


@intrinsic
def load_rows(typingctx, table, rows, at):
    """The rows ``rows[at:at + 8]`` of a table of eight float64 columns, as its columns."""

    def build(context, builder, sig, args):
        table, rows, at = args
        number, lines = ir.IntType(64), []
        for lane in range(EIGHT):
            row = builder.sext(builder.load(builder.gep(rows, [builder.add(at, number(lane))])), number)
            line = builder.load(_address(builder, table, builder.mul(row, number(EIGHT)), F64X8))
            line.align = _bytes(F64X8)
            lines.append(line)
        return context.make_tuple(builder, sig.return_type, _columns(builder, lines))

    return types.UniTuple(F64X8, EIGHT)(table, rows, types.intp), build


def _columns(builder, lines):
    """Eight vectors of eight across: halves, quarters and eighths of two are exchanged."""
    for far in (4, 2, 1):
        first = [k if not k & far else k - far + EIGHT for k in range(EIGHT)]
        second = [k + far if not k & far else k + EIGHT for k in range(EIGHT)]
        masks = [ir.Constant(ir.VectorType(ir.IntType(32), EIGHT), places) for places in (first, second)]
        for k in range(EIGHT):
            if not k & far:
                pair = lines[k], lines[k + far]
                lines[k], lines[k + far] = (builder.shuffle_vector(*pair, mask) for mask in masks)
    return lines


@intrinsic
def load_where(typingctx, start, at, mask):
    """As `load` where the mask is set, and 0 elsewhere; reads nothing there."""
    vector = _BY_DTYPE[start.dtype]

    def build(context, builder, sig, args):
        address = builder.gep(args[0], [args[1]])
        align, zero = ir.Constant(ir.IntType(32), _bytes(vector)), ir.Constant(_llvm(vector), [0] * LANES)
        return _call(builder, f"llvm.masked.load.{_SUFFIX[vector]}.p0", _llvm(vector), [address, align, args[2], zero])

    return vector(start, types.intp, mask), build


@intrinsic
def gather(typingctx, start, at, mask):
    """``start[at]`` lane by lane where the mask is set, and 0 elsewhere."""
    vector = _BY_DTYPE[start.dtype]

    def build(context, builder, sig, args):
        start, at, mask = args
        wide = ir.VectorType(ir.IntType(64), LANES)
        base = _splat_llvm(builder, wide, builder.ptrtoint(start, ir.IntType(64)))
        step = builder.mul(builder.sext(at, wide), ir.Constant(wide, [_bytes(vector)] * LANES))
        address = builder.inttoptr(builder.add(base, step), ir.VectorType(start.type, LANES))
        align, zero = ir.Constant(ir.IntType(32), _bytes(vector)), ir.Constant(_llvm(vector), [0] * LANES)
        name = f"llvm.masked.gather.{_SUFFIX[vector]}.v16p0"
        return _call(builder, name, _llvm(vector), [address, align, mask, zero])

    return vector(start, at, mask), build


@intrinsic
def store(typingctx, start, at, value):
    """Write ``start[at:at + 16]``, or eight, which must exist."""

    def build(context, builder, sig, args):
        place = builder.store(args[2], _address(builder, *args[:2], value))
        place.align = _bytes(value)
        return context.get_dummy_value()

    return types.void(start, types.intp, value), build


@intrinsic
def pack(typingctx, start, at, value, mask):
    """Write the lanes that the mask names side by side from ``start[at]`` on; ``start[at:at + 16]`` is overwritten."""

    def build(context, builder, sig, args):
        start, at, lanes, chosen = args
        place = builder.gep(start, [at])
        width, write = _packing(context.codegen().magic_tuple()[2], value.dtype.bitwidth)
        for lane in range(0, LANES, width):
            one, written = write(builder, place, lanes, chosen, value, lane, width)
            one.align = _bytes(value)
            place = builder.gep(place, [written])
        return context.get_dummy_value()

    return types.void(start, types.intp, value, mask), build


def _packing(features, bits):
    """How many lanes are packed in one go, and by what: a register, else lane by lane, without a branch."""
    if "+avx512f" in features:
        return 512 // bits, _write_packed
    if "+avx2" in features:
        return 256 // bits, _write_permuted
    return 1, _write_lane


def _write_lane(builder, place, lanes, chosen, vector, lane, width):
    number = ir.Constant(ir.IntType(32), lane)
    written = builder.zext(builder.extract_element(chosen, number), ir.IntType(64))
    return builder.store(builder.extract_element(lanes, number), place), written


def _write_packed(builder, place, lanes, chosen, vector, lane, width):
    part, mask = _cut(builder, lanes, lane, width), _cut(builder, chosen, lane, width)
    kind, number = part.type, ir.IntType(width)
    name = f"llvm.experimental.vector.compress.v{width}{_SUFFIX[vector][3:]}"
    packed = _call(builder, name, kind, [part, mask, ir.Constant(kind, ir.Undefined)])
    written = _call(builder, f"llvm.ctpop.i{width}", number, [builder.bitcast(mask, number)])
    written = builder.zext(written, ir.IntType(64))
    return builder.store(packed, builder.bitcast(place, kind.as_pointer())), written


def _write_permuted(builder, place, lanes, chosen, vector, lane, width):
    """AVX2 has no compression, but a permutation of eight words: which, a table says for each mask."""
    part, number = _cut(builder, lanes, lane, width), ir.IntType(64)
    mask = builder.zext(builder.bitcast(chosen, ir.IntType(LANES)), number)
    mask = builder.and_(builder.lshr(mask, number(lane)), number((1 << width) - 1))
    words = ir.VectorType(ir.IntType(32), 8)
    entry = builder.gep(_permutations(builder.module, width), [number(0), mask])
    order = builder.zext(builder.load(entry), words)
    packed = _call(builder, "llvm.x86.avx2.permd", words, [builder.bitcast(part, words), order])
    written = _call(builder, "llvm.ctpop.i64", number, [mask])
    return builder.store(builder.bitcast(packed, part.type), builder.bitcast(place, part.type.as_pointer())), written


def _permutations(module, width):
    """For every mask of so many lanes, in a register of eight words, the words of those that it names."""
    eight = ir.VectorType(ir.IntType(8), 8)
    name = f"flockbrush.permutations.{width}"
    if name in module.globals:
        return module.globals[name]
    part = 8 // width  # words to a lane
    rows = []
    for mask in range(1 << width):
        words = [part * lane + word for lane in range(width) if mask >> lane & 1 for word in range(part)]
        rows.append(ir.Constant(eight, words + [0] * (8 - len(words))))
    kind = ir.ArrayType(eight, len(rows))
    return cgutils.global_constant(module, name, ir.Constant(kind, rows))


@intrinsic
def bits(typingctx, mask):
    """The mask as an integer, lane 0 in the lowest bit."""

    def build(context, builder, sig, args):
        return builder.zext(builder.bitcast(args[0], ir.IntType(LANES)), ir.IntType(64))

    return types.int64(mask), build


@intrinsic
def mask_of(typingctx, number):
    """The mask of which `bits` gives this number."""

    def build(context, builder, sig, args):
        return builder.bitcast(builder.trunc(args[0], ir.IntType(LANES)), _llvm(MASK))

    return MASK(types.int64), build


@intrinsic
def count(typingctx, mask):
    """How many lanes are set."""

    def build(context, builder, sig, args):
        few = builder.bitcast(args[0], ir.IntType(LANES))
        return builder.zext(_call(builder, "llvm.ctpop.i16", ir.IntType(LANES), [few]), ir.IntType(64))

    return types.int64(mask), build


@intrinsic
def lowest(typingctx, number):
    """The place of the lowest bit that is set."""

    def build(context, builder, sig, args):
        return _call(builder, "llvm.cttz.i64", ir.IntType(64), [args[0], ir.Constant(ir.IntType(1), 1)])

    return types.int64(types.int64), build


@intrinsic
def where(typingctx, mask, yes, no):
    """``yes`` where the mask is set, else ``no``."""
    return yes(mask, yes, no), lambda context, builder, sig, args: builder.select(*args)


@intrinsic
def largest(typingctx, a, b):
    """The larger of two, lane by lane; b where they are equal or a is not a number."""
    return a(a, b), lambda context, builder, sig, args: builder.select(builder.fcmp_ordered(">", *args), *args)


@intrinsic
def fused(typingctx, a, b, c):
    """``a * b + c`` rounded once."""

    def build(context, builder, sig, args):
        return _call(builder, f"llvm.fma.{_SUFFIX[a]}", _llvm(a), list(args))

    return a(a, b, c), build


@intrinsic
def total(typingctx, a):
    """The sum of the lanes: each of the first half and its partner in the second, and so on until one is left."""

    def build(context, builder, sig, args):
        lanes, width = args[0], a.width
        while width > 1:
            width //= 2
            lanes = builder.fadd(_part(builder, lanes, 0, width), _part(builder, lanes, width, width))
        return builder.extract_element(lanes, ir.Constant(ir.IntType(32), 0))

    return a.dtype(a), build


@intrinsic
def totals(typingctx, vectors):
    """The `total` of each of eight vectors of eight, as a vector."""

    def build(context, builder, sig, args):
        lanes, width = cgutils.unpack_tuple(builder, args[0]), EIGHT
        while width > 1:
            width //= 2
            first = [k + of for of in (0, EIGHT) for k in range(EIGHT) if not k & width]  # of halves, of both vectors
            masks = [ir.Constant(ir.VectorType(ir.IntType(32), EIGHT), [k + w for k in first]) for w in (0, width)]
            pairs = zip(lanes[::2], lanes[1::2], strict=True)
            lanes = [builder.fadd(*(builder.shuffle_vector(a, b, mask) for mask in masks)) for a, b in pairs]
        return lanes[0]

    return F64X8(vectors), build


@intrinsic
def times_power(typingctx, a, shifted):
    """``a * 2**n`` in float64, n being what `maths.ROUNDER` was added to; neither may leave the normal numbers."""

    def build(context, builder, sig, args):
        wide = ir.VectorType(ir.IntType(64), a.width)
        number, power = (builder.bitcast(arg, wide) for arg in args)
        power = builder.shl(power, ir.Constant(wide, [52] * a.width))
        return builder.bitcast(builder.add(number, power), _llvm(a))

    return a(a, a), build


@intrinsic
def root(typingctx, a):
    """The square root."""

    def build(context, builder, sig, args):
        return _call(builder, f"llvm.sqrt.{_SUFFIX[a]}", _llvm(a), list(args))

    return a(a), build


@intrinsic
def narrow(typingctx, a):
    """float64 to float32."""
    return F32(F64), lambda context, builder, sig, args: builder.fptrunc(args[0], _llvm(F32))
