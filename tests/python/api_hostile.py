"""What the API fuzzer puts in place of a right argument: values that are nearly right, and objects that mean harm."""

from __future__ import annotations

import array
import decimal
import fractions
import itertools
import math
import pathlib
import random
from collections.abc import Callable
from typing import Any

import numpy as np

RAISED = (ValueError, TypeError, OSError, ZeroDivisionError, RecursionError, StopIteration, AttributeError)
PASSED = (KeyboardInterrupt, SystemExit, GeneratorExit, MemoryError)
MARK = "raised on purpose"
WATCHED = ("__array__", "__float__", "__index__", "__iter__", "__dlpack__", "__fspath__", "__repr__")
"""Methods that nobody but us may swallow an interrupt of; NumPy does of others, such as `__len__`."""
interrupts: list[type[BaseException]] = []
"""What of `PASSED` methods of `WATCHED` raised in the running call."""
PROTOCOLS = (
    "__array__",
    "__float__",
    "__index__",
    "__int__",
    "__iter__",
    "__len__",
    "__getitem__",
    "__bool__",
    "__dlpack__",
    "__dlpack_device__",
    "__array_interface__",
    "__array_struct__",
    "__fspath__",
    "__str__",
    "__repr__",
    "__hash__",
    "__eq__",
    "keys",
    "points",
)
DTYPES = "bool i1 u1 i2 u2 i4 u4 i8 u8 f2 f4 f8 g F D G O S3 U3 V4 M8[s] m8[s] >u2 >i4 >f4 >f8 i1,f4 (2,)f4,u1".split()
NUMBERS: tuple[Any, ...] = (
    *(0, -0.0, 1, -1, 2, 3, 7, 0.5, 1.5, 100, 255, 256, 2**15, 2**31 - 1, 2**31, 2**32, 2**63, 2**64, 2**127, 2**128),
    *(10**400, -(10**400), 10**5000, math.nan, math.inf, -math.inf, 1e308, -1e308, 1e-308, 5e-324, 1e18, 1e-18),
    *(True, False, "3", b"3", 3j, None, fractions.Fraction(1, 3), decimal.Decimal("0.1"), decimal.Decimal("nan")),
    *(np.float16(2), np.float32("nan"), np.float64(3), np.int8(-3), np.uint64(2**64 - 1), np.bool_(True), np.array(3)),
    *(np.array([3]), np.array([3.0, 4]), np.longdouble(1) / 3, np.ma.masked, np.datetime64("2020-01-01"), np.str_("3")),
)
WORDS: tuple[Any, ...] = (
    *("", "x", "\ud800", "a\0b", "\udcff", "é", "BILINEAR", "bilinear ", "nearest\n", "x" * 10_000, "None", "..", "."),
    *(b"bilinear", bytearray(b"HWC"), np.str_("HWC"), type("Word", (str,), {})("area"), ["HWC"], 3, None, object()),
)
WRONG: tuple[Any, ...] = (
    *(None, True, 0, -1, 1.5, math.nan, "text", "\ud800", b"bytes", (), [], {}, set(), object(), object, len, ...),
    *([None], [[]], [[1, 2], [3]], {"a": 1}, {1, 2}, range(3), slice(3), np.array(None), np.ma.masked, np.zeros(0)),
    *(
        pathlib.Path("nowhere"),
        memoryview(b"abcd"),
        array.array("d", [1, 2, 3]),
        NotImplemented,
        10**400,
        np.dtype("f4"),
    ),
)


COUNTS: tuple[Any, ...] = (
    *(0, -1, 1, 2, 8, True, 1.5, math.nan, math.inf, "2", b"2", None, 2j, [1], 2**128, -(2**128), 10**400, 10**5000),
    *(
        np.int8(2),
        np.uint64(3),
        np.float64(2),
        np.bool_(True),
        np.array(2),
        np.ma.masked,
        object(),
        fractions.Fraction(2),
    ),
)
"""Numbers of threads: none is right and large, for that would only starve the machine."""


def mutated_count(rng: random.Random, arrays: list[np.ndarray]) -> tuple[str, Any]:
    """Something else in the place of a number of threads, and its name."""
    if rng.random() < 0.3:
        return _hostile(rng, 1, arrays, (*COUNTS,))
    return _picked(rng, "count", COUNTS)


def mutated(rng: random.Random, value: Any, arrays: list[np.ndarray]) -> tuple[str, Any]:
    """Something else in the place of `value`, and its name; `arrays` are the other arguments, which it may change."""
    choice = rng.random()
    if choice < 0.12:
        return _picked(rng, "wrong", WRONG)
    if choice < 0.3:
        return _hostile(rng, value, arrays)
    if isinstance(value, np.ndarray):
        if choice < 0.36 and arrays:
            return "alias of another argument", rng.choice(arrays)
        name = rng.choice(list(ARRAYS))
        # of a copy: resizing an array pulls the memory from under its views, which NumPy itself cannot survive
        return name, ARRAYS[name](rng, value.copy())
    if isinstance(value, bool) or value is None:
        return _picked(rng, "wrong", WRONG)
    if isinstance(value, (int, float)):
        return _picked(rng, "number", NUMBERS)
    if isinstance(value, (str, pathlib.Path)):
        if isinstance(value, pathlib.Path) and rng.random() < 0.6:
            return _damaged(rng, value)
        return _picked(rng, "word", WORDS)
    if isinstance(value, (tuple, list)) and value:
        return _sequence(rng, value, arrays)
    if isinstance(value, dict) and value:
        return _mapping(rng, value, arrays)
    return _picked(rng, "wrong", WRONG)


def _picked(rng: random.Random, kind: str, values: tuple[Any, ...]) -> tuple[str, Any]:
    index = rng.randrange(len(values))
    return f"{kind} {index}", values[index]


# ---------------------------------------------------------------------------------------------------------------------
# Arrays


def _packed(a: np.ndarray) -> np.ndarray:
    row = np.zeros(1, [("tag", "u1"), ("value", a.dtype, a.shape)])
    row["value"] = a
    return row["value"][0]


def _records(a: np.ndarray) -> np.ndarray:
    records = np.zeros(a.shape, [("tag", "u1"), ("value", a.dtype)])
    records["value"] = a
    return records["value"]


def _cast(rng: random.Random, a: np.ndarray) -> np.ndarray:
    dtype = np.dtype(rng.choice(DTYPES))
    with np.errstate(all="ignore"):
        try:
            return a.astype(dtype)
        except (TypeError, ValueError):
            return np.zeros(a.shape, dtype)


def _filled(rng: random.Random, a: np.ndarray) -> np.ndarray:
    a = a.copy()
    number = rng.choice([math.nan, math.inf, -math.inf, 1e300, -1e300, 1e-300, 1e38, 0, -1, 255, 2**62, 1e6])
    where = (..., rng.randrange(a.shape[-1])) if a.ndim and a.shape[-1] and rng.random() < 0.5 else ...
    with np.errstate(all="ignore"):
        try:
            a[where] = number
        except (OverflowError, ValueError, TypeError):
            pass
    return a


def _one_filled(rng: random.Random, a: np.ndarray) -> np.ndarray:
    b = a.copy()
    if b.size:
        index = rng.randrange(b.size)
        b.flat[index] = _filled(rng, b.reshape(-1)[index : index + 1])[0]
    return b


def _masked(rng: random.Random, a: np.ndarray) -> np.ndarray:
    masked = np.ma.MaskedArray(a, mask=rng.choice([False, True]))
    if a.size and rng.random() < 0.5:
        masked = np.ma.masked_equal(a, a.flat[rng.randrange(a.size)])
    if rng.random() < 0.3:
        masked.harden_mask()
    return masked


class Overriding(np.ndarray):
    """A subclass that says something else of itself than its memory does."""

    shape = property(lambda self: (3, 10**9))  # type: ignore[assignment]
    strides = property(lambda self: (1, 1))  # type: ignore[assignment]
    dtype = property(lambda self: np.dtype("u1"))  # type: ignore[assignment]
    flags = property(lambda self: None)  # type: ignore[assignment]

    def __array_function__(self, *args, **options):
        raise ValueError(MARK)

    def __array_ufunc__(self, *args, **options):
        raise ValueError(MARK)

    def __getitem__(self, item):
        raise ValueError(MARK)

    def copy(self, *args):
        raise ValueError(MARK)


def _huge(rng: random.Random, a: np.ndarray) -> np.ndarray:
    shape = rng.choice([(2**30, 2**20), (2**40, 2), (2**40, 3), (2, 2**40), (2**50,), (2**20, 2**20, 3), (3, 2**30, 2)])
    return np.broadcast_to(a.reshape(-1)[:1] if a.size else np.zeros(1, a.dtype), shape)


def _longer(rng: random.Random, a: np.ndarray) -> np.ndarray:
    axis = rng.randrange(a.ndim) if a.ndim else 0
    return np.concatenate([np.atleast_1d(a)] * 2, axis=axis)


def _shorter(rng: random.Random, a: np.ndarray) -> np.ndarray:
    if not a.ndim:
        return a
    axis = rng.randrange(a.ndim)
    return np.delete(a, -1, axis=axis) if a.shape[axis] else a


def _nested(rng: random.Random, a: np.ndarray) -> Any:
    if a.size > 20_000:
        return [[1.0, 2.0]]
    items = a.tolist()
    if isinstance(items, list) and items and rng.random() < 0.5:
        items[rng.randrange(len(items))] = rng.choice([None, "x", [], [1], math.nan, 10**400, np.ma.masked, items])
    return items


ARRAYS: dict[str, Callable[[random.Random, np.ndarray], Any]] = {
    "another dtype": _cast,
    "packed": lambda rng, a: _packed(a),
    "packed records": lambda rng, a: _records(a),
    "byte-swapped": lambda rng, a: a.astype(a.dtype.newbyteorder()),
    "packed and byte-swapped": lambda rng, a: _packed(a.astype(a.dtype.newbyteorder())),
    "fortran": lambda rng, a: np.asfortranarray(a),
    "transposed": lambda rng, a: a.T,
    "flipped": lambda rng, a: np.flip(a, rng.randrange(a.ndim)) if a.ndim else a,
    "every second": lambda rng, a: np.repeat(a, 2, axis=-1)[..., ::2] if a.ndim else a,
    "gaps between rows": lambda rng, a: np.concatenate([a, a], axis=-1)[..., : a.shape[-1]] if a.ndim else a,
    "one element": lambda rng, a: np.broadcast_to(a.reshape(-1)[:1].reshape((1,) * a.ndim), a.shape) if a.size else a,
    "one row": lambda rng, a: np.broadcast_to(a[:1], a.shape) if a.ndim and len(a) else a,
    "overlapping windows": lambda rng, a: np.lib.stride_tricks.as_strided(a, strides=(a.itemsize,) * a.ndim),
    "huge": _huge,
    "empty": lambda rng, a: a[:0] if a.ndim else a,
    "no columns": lambda rng, a: a[..., :0] if a.ndim else a,
    "one": lambda rng, a: a[:1] if a.ndim else a,
    "0-d": lambda rng, a: a.reshape(-1)[0] if a.size else np.array(0.0),
    "another axis": lambda rng, a: a[None] if rng.random() < 0.5 else a[..., None],
    "an axis less": lambda rng, a: a[0] if a.ndim and len(a) else a,
    "longer": _longer,
    "shorter": _shorter,
    "another last axis": lambda rng, a: np.concatenate([a, a], axis=-1) if a.ndim else a,
    "read-only": lambda rng, a: np.frombuffer(a.tobytes(), a.dtype).reshape(a.shape) if a.size else a,
    "masked": _masked,
    "subclass": lambda rng, a: a.view(type("Sub", (np.ndarray,), {})),
    "overriding subclass": lambda rng, a: a.view(Overriding),
    "matrix": lambda rng, a: np.asmatrix(a) if a.ndim == 2 else a,
    "odd number": _one_filled,
    "odd numbers": _filled,
    "nested list": _nested,
    "list of arrays": lambda rng, a: list(a[:1000]) if a.ndim else [a],
    "memory": lambda rng, a: memoryview(a) if a.dtype.kind in "biufc" else a,
    "bytes": lambda rng, a: a.tobytes(),
    "record array": lambda rng, a: np.rec.fromarrays([a, a], names="x,y"),
}

# ---------------------------------------------------------------------------------------------------------------------
# Python code in arguments


def _hostile(
    rng: random.Random, value: Any, arrays: list[np.ndarray], answers: tuple[Any, ...] = WRONG + NUMBERS
) -> tuple[str, Any]:
    """An object whose methods raise, answer nonsense, or change the other arguments before they answer right."""
    methods = rng.sample(PROTOCOLS, rng.choice([1, 1, 2, 5]))
    kind = rng.choice(["raises", "passes", "nonsense", "right", "right", "changing"])
    error = rng.choice(PASSED if kind == "passes" else RAISED)
    nonsense, calls, answers_given = rng.choice(answers), itertools.count(), itertools.count()
    resized = arrays if rng.random() < 0.7 else []
    size = rng.choice([0, 1, 1, 2])

    def answer(method: str) -> Any:
        if next(answers_given) > 10_000:  # a sequence without an end hangs NumPy, and any loop of Python
            raise IndexError
        for other in resized:
            try:
                other.resize((size,) * other.ndim, refcheck=False)
            except ValueError:  # it does not own its memory
                pass
        if kind in ("raises", "passes"):
            if kind == "passes" and method in WATCHED:
                interrupts.append(error)
            raise error(MARK)
        return nonsense

    def right(method: str) -> Callable[..., Any]:
        def call(self: Any, *args: Any, **options: Any) -> Any:
            if kind == "changing" and next(calls) % 2:
                return nonsense
            if kind in ("right", "changing"):
                answer(method)
                own = value if isinstance(value, np.ndarray) else np.asarray(value)
                return getattr(own, method)(*args, **options) if hasattr(own, method) else value
            return answer(method)

        return call

    members: dict[str, Any] = {method: right(method) for method in methods}
    for name in ("__array_interface__", "__array_struct__", "points"):
        if name in members:
            members[name] = property(members[name])
    if "__array_interface__" in members and kind in ("right", "changing"):
        memory = np.ones((4, 3))
        members["__array_interface__"] = property(
            lambda self: (answer("__array_interface__"), memory.__array_interface__)[1]
        )
        members.pop("__array_struct__", None)
    return f"{kind} {error.__name__ if 's' == kind[-1] else ''} in {methods}", type("Hostile", (), members)()


# ---------------------------------------------------------------------------------------------------------------------
# Sequences, mappings, files


def _sequence(rng: random.Random, value: Any, arrays: list[np.ndarray]) -> tuple[str, Any]:
    items = list(value)
    index = rng.randrange(len(items))
    forms: dict[str, Callable[[], Any]] = {
        "shorter": lambda: value[:-1],
        "longer": lambda: (*items, *items),
        "reversed": lambda: items[::-1],
        "endless": lambda: itertools.cycle(items),
        "set": lambda: {str(item) for item in items},
        "generator": lambda: (item for item in items),
        "array": lambda: np.asarray(items) if all(isinstance(item, (int, float)) for item in items) else items,
        "text": lambda: str(value),
    }
    if rng.random() < 0.6:
        name, items[index] = mutated(rng, items[index], arrays)
        return f"item {index}: {name}", type(value)(items)
    name = rng.choice(list(forms))
    return name, forms[name]()


def _mapping(rng: random.Random, value: dict[Any, Any], arrays: list[np.ndarray]) -> tuple[str, Any]:
    key = rng.choice(list(value))
    copied = dict(value)
    choice = rng.random()
    if choice < 0.15:
        del copied[key]
        return f"without {key!r}", copied
    if choice < 0.25:
        copied[rng.choice([3, "\ud800", None, "a\0b", key * 2 if isinstance(key, str) else 1])] = copied.pop(key)
        return f"another key than {key!r}", copied
    name, copied[key] = mutated(rng, value[key], arrays)
    return f"{key!r}: {name}", copied


def _damaged(rng: random.Random, path: pathlib.Path) -> tuple[str, Any]:
    """A copy of the file with a few bytes changed, cut or repeated; other files are named, not written to."""
    if not path.is_file():
        return "another path", rng.choice(
            [path / "x", path.parent, path.with_name("missing"), str(path), str(path) + "\0"]
        )
    data = bytearray(path.read_bytes()[:100_000])
    for _ in range(rng.choice([1, 1, 2, 8])):
        at = rng.randrange(len(data) + 1)
        what = rng.random()
        if what < 0.4 and at < len(data):
            data[at] = rng.randrange(256)
        elif what < 0.6:
            del data[at : at + rng.choice([1, 4, 100, 10**6])]
        elif what < 0.8:
            data[at:at] = rng.choice(
                [b"9", b"-", b"1e400", b"nan", b"\0", b"\n", b"[", b"}", b'"', b"\xff\xfe", b"\xed\xa0\x80"]
            )
        else:
            data[at:at] = data[: rng.choice([1, 10, 200])]
    damaged = path.parent / f"damaged-{path.name}"
    damaged.write_bytes(data)
    return "damaged file", damaged
