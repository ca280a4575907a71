"""Kernels that Python runs, as under NUMBA_DISABLE_JIT=1, give the bits that compiled ones give."""

import ast
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from flockbrush.engine import interpreted, lanes, maths
from numba import njit

from flockbrush.render import blocks

HOUSE = Path(__file__).parents[2]
SPECIAL = [0.0, -0.0, 1.0, -1.5, np.inf, -np.inf, np.nan, 5e-324, 1e-310, 1.7e308, 3.4e38, 1e-45]


def numbers(kind, seed):
    """Many numbers of a kind, special ones among them, in groups of sixteen."""
    chance = np.random.default_rng(seed)
    if kind == "int32":
        return chance.integers(-100, 100, 160).astype(np.int32)
    values = np.concatenate([chance.normal(size=100) * 10.0 ** chance.integers(-30, 30, 100), SPECIAL * 5])
    with np.errstate(over="ignore", under="ignore"):
        return chance.permutation(values).astype(kind)


def intrinsics_of(module):
    """Names of the functions of a module that numba knows as intrinsics."""
    tree = ast.parse(Path(module.__file__).read_text(encoding="utf-8"))
    found = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
    return [node.name for node in found if "intrinsic" in map(ast.unparse, node.decorator_list)]


def test_every_intrinsic_of_the_house_has_a_form_in_python():
    rooms = ("engine", "components", "behaviours", "systems", "levels", "flockbrush")
    for path in (path for room in rooms for path in (HOUSE / room).rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        assert "numba.extending import intrinsic" not in text or path.name == "interpreted.py", path
    names = intrinsics_of(maths) + intrinsics_of(lanes)
    assert len(names) > 15 and [name for name in names if not callable(getattr(interpreted, name, None))] == []


def test_the_bits_of_numbers():
    of, back = njit(lambda x: maths.bits_of_(x)), njit(lambda bits: maths.float_of_(bits))
    for x in numbers("float64", 1):
        assert interpreted.bits_of_(x) == of(x)
        assert np.array(interpreted.float_of_(of(x))).tobytes() == np.array(back(of(x))).tobytes()


@njit
def _compiled(name, a, b, c, k, out):
    """One function of `lanes` over three arrays."""
    pa, pb, pc, po = lanes.pointer(a), lanes.pointer(b), lanes.pointer(c), lanes.pointer(out)
    x, y, z = lanes.load(pa, k), lanes.load(pb, k), lanes.load(pc, k)
    if name == 0:
        lanes.store(po, k, lanes.fused(x, y, z))
    elif name == 1:
        lanes.store(po, k, lanes.largest(x, y))
    elif name == 2:
        lanes.store(po, k, lanes.where(x < y, y, z))
    elif name == 3:
        lanes.store(po, k, lanes.root(x))
    elif name == 4:
        lanes.pack(po, k, x, (x > y) | (y <= z))
    elif name == 5:
        lanes.store(po, k, lanes.load_where(pa, k, ~(x >= y)))
    elif name == 6:
        lanes.store(po, k, x * y + z / lanes.splat(b[k]) - x)


def in_python(kernel):
    """A compiled kernel as Python runs it, with the functions of `interpreted` in the place of numba's."""
    code = kernel.py_func
    return type(code)(code.__code__, dict(code.__globals__, lanes=interpreted))


@pytest.mark.parametrize("kind", ["float32", "float64"])
@pytest.mark.parametrize("name", range(7))
def test_functions_of_lanes_give_the_same_bits(name, kind):
    with np.errstate(all="ignore"):
        for seed in range(20):
            a, b, c = (numbers(kind, 3 * seed + k) for k in range(3))
            one, other = np.zeros(len(a), kind), np.zeros(len(a), kind)
            for k in range(0, len(a), 16):
                _compiled(name, a, b, c, k, one)
                in_python(_compiled)(name, a, b, c, k, other)
                if name == 4:  # what lies behind the packed lanes is anything
                    x, y, z = (v[k : k + 16] for v in (a, b, c))
                    kept = k + np.count_nonzero((x > y) | (y <= z))
                    one[kept : k + 16] = other[kept : k + 16] = 0
            nan = np.isnan(one)
            assert (nan == np.isnan(other)).all()
            assert np.where(nan, 0, one).tobytes() == np.where(nan, 0, other).tobytes()


def test_masks_give_the_same_numbers():
    @njit
    def compiled(a, b, out):
        x, y = lanes.load(lanes.pointer(a), 0), lanes.load(lanes.pointer(b), 0)
        mask = x < y
        out[0], out[1] = lanes.bits(mask), lanes.count(mask)
        out[2] = lanes.bits(lanes.mask_of(out[0]) & (lanes.lane_numbers() < np.int32(9)))
        out[3] = lanes.lowest(out[0])
        lanes.store(lanes.pointer(a), 0, x + y)

    for seed in range(50):
        a, b = numbers("int32", seed)[:16], numbers("int32", seed + 100)[:16]
        b[seed % 16] = 200  # one lane at least
        sums, found = [], []
        for kernel in (compiled, in_python(compiled)):
            mine, out = a.copy(), np.zeros(4, np.int64)
            kernel(mine, b, out)
            sums.append(mine.tolist())
            found.append(out.tolist())
        assert sums[0] == sums[1] and found[0] == found[1]


def test_blocks_of_pictures_are_laid_in_the_same_way():
    chance = np.random.default_rng(4)
    compiled = njit(lambda frame, at, block, source: blocks.lay16(frame, at, block, source))
    for _ in range(200):
        block, frame = chance.integers(0, 256, 64).astype(np.uint8), chance.integers(0, 256, 50).astype(np.uint8)
        other, at, source = frame.copy(), int(chance.integers(35)), int(chance.integers(33))
        compiled(frame, at, block, source)
        blocks.interpreted_lay16(other, at, block, source)
        assert (frame == other).all()


LIVES = """
import sys
from flockbrush.engine.interpreted import INTERPRETED
from flockbrush.engine.state import state_hash
from flockbrush.runs.run import start
for name in sys.argv[1:]:
    simulation = start(name, None, 16)
    simulation.run(2)
    print(name, INTERPRETED, state_hash(simulation.world))
"""


def test_herds_of_python_are_those_of_the_compiler():
    names = ("crowded", "elephants", "geese", "river")
    told = []
    for disabled in ("1", "0"):
        done = subprocess.run(
            [sys.executable, "-c", LIVES, *names],
            env=os.environ | {"NUMBA_DISABLE_JIT": disabled}, capture_output=True, text=True, timeout=500, check=False,
        )  # fmt: skip
        assert done.returncode == 0 and done.stderr == "", done.stderr
        told.append([line.split() for line in done.stdout.splitlines()])
    assert [line[1] for line in told[0]] == ["True"] * 4 and [line[1] for line in told[1]] == ["False"] * 4
    assert [line[2] for line in told[0]] == [line[2] for line in told[1]]


def test_a_debugger_can_go_through_a_command():
    command = [sys.executable, "-m", "pdb", "-m", "flockbrush", "--version"]
    done = subprocess.run(command, input="c\nq\n", capture_output=True, text=True, timeout=120, check=False)
    assert "flockbrush 0." in done.stdout and "detached" not in done.stdout + done.stderr
    assert "The program exited via sys.exit()" in done.stdout
