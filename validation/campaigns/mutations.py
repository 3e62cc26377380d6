"""Damaged and hostile variants of texts, binary files and HDF5 files, each determined by a random generator."""

import json
import re
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

import h5py
import numpy as np

Random = np.random.Generator

HOSTILE: Final = (
    *(
        "nan",
        "-nan",
        "inf",
        "-inf",
        "0",
        "-0.0",
        "-1",
        "1e-320",
        "1e308",
        "-1e60",
        "1e60",
        "9" * 30,
        "9" * 5000,
        "0x7f",
    ),
    *("true", '""', '"\\u0000"', '"5 mm"', '"-3 GPa"', '"inf m"', '"1e999 m"', '"0.1 mm^2"', '"%s%n"', '"[/b]"'),
    *("[]", "{}", "[[]]", "[1, 2]", "[nan, 1, 2]", '["free", 1, 0]', "{name = 1}", '{file = "/dev/zero"}'),
    *('"../../etc/passwd"', '"/dev/zero"', '"heights.txt"', '"' + "x" * 10_000 + '"', "1979-05-27", "[" * 200),
)
NUMBER: Final = re.compile(r"(?<![\w.])-?\d+\.?\d*(?:e[+-]?\d+)?(?![\w.])")
GARBAGE: Final = ("\x00", "\ufeff", "\u202e", "\x1b[2J", "]]", "[[", "= =", '"""', "\r", "\U0001f600", "#")


def text(content: str, random: Random) -> str:
    """Return a text with one to three changes of lines, values, numbers or characters."""
    for _ in range(int(random.choice([1, 1, 1, 2, 3]))):
        lines = content.split("\n")
        change = _TEXT_CHANGES[int(random.integers(len(_TEXT_CHANGES)))]
        content = "\n".join(change(lines, random))
    return content


def _any(lines: list[str], random: Random) -> int:
    return int(random.integers(len(lines)))


def _delete(lines: list[str], random: Random) -> list[str]:
    first = _any(lines, random)
    return lines[:first] + lines[first + int(random.integers(1, 3)) :] or [""]


def _double(lines: list[str], random: Random) -> list[str]:
    first = _any(lines, random)
    return [*lines[: first + 1], *lines[first:]]


def _exchange(lines: list[str], random: Random) -> list[str]:
    one, other = _any(lines, random), _any(lines, random)
    lines[one], lines[other] = lines[other], lines[one]
    return lines


def _set_value(lines: list[str], random: Random) -> list[str]:
    chosen = [number for number, line in enumerate(lines) if "=" in line]
    if chosen:
        number = chosen[int(random.integers(len(chosen)))]
        key = lines[number].partition("=")[0]
        lines[number] = f"{key}= {random.choice(HOSTILE)}"
    return lines


def _set_token(lines: list[str], random: Random) -> list[str]:
    number = _any(lines, random)
    tokens = lines[number].split(" ")
    tokens[int(random.integers(len(tokens)))] = str(random.choice(HOSTILE))
    lines[number] = " ".join(tokens)
    return lines


def _scale(lines: list[str], random: Random) -> list[str]:
    """Multiply a number by a power of ten, change its sign, or replace it by another number or name of the file."""
    numbers = [(number, match) for number, line in enumerate(lines) for match in NUMBER.finditer(line)]
    if not numbers:
        return lines
    number, match = numbers[int(random.integers(len(numbers)))]
    value = float(match[0])
    other = numbers[int(random.integers(len(numbers)))][1][0]
    texts = [f"{value * 10.0 ** random.integers(-12, 13):g}", f"{-value:g}", f"{value:.0f}", f"{value * 1.5:g}", other]
    text = texts[int(random.integers(len(texts)))]
    lines[number] = lines[number][: match.start()] + text + lines[number][match.end() :]
    return lines


def _misspell(lines: list[str], random: Random) -> list[str]:
    number = _any(lines, random)
    line = lines[number]
    if line:
        start = int(random.integers(len(line)))
        lines[number] = line[:start] + chr(int(random.integers(32, 127))) + line[start + int(random.integers(2)) :]
    return lines


def _insert(lines: list[str], random: Random) -> list[str]:
    number = _any(lines, random)
    start = int(random.integers(len(lines[number]) + 1))
    lines[number] = lines[number][:start] + str(random.choice(GARBAGE)) + lines[number][start:]
    return lines


def _add_key(lines: list[str], random: Random) -> list[str]:
    name = random.choice(["name", "unit", "file", "x", "mu", "kappa", "group", "increments", "steps", "material"])
    lines.insert(_any(lines, random), f"{name} = {random.choice(HOSTILE)}")
    return lines


def _cut(lines: list[str], random: Random) -> list[str]:
    content = "\n".join(lines)
    return content[: int(random.integers(len(content) + 1))].split("\n")


_TEXT_CHANGES: Final[tuple[Callable[[list[str], Random], list[str]], ...]] = (
    *(
        _delete,
        _double,
        _exchange,
        _set_value,
        _set_value,
        _scale,
        _scale,
        _scale,
        _set_token,
        _misspell,
        _insert,
        _add_key,
        _cut,
    ),
)


def binary(content: bytes, random: Random) -> bytes:
    """Return bytes that are cut, flipped, overwritten, moved or lengthened, most often near the beginning."""
    data = bytearray(content)
    for _ in range(int(random.integers(1, 4))):
        if not data:
            break
        reach = len(data) if random.random() < 0.5 else min(len(data), 2048)
        start, length = int(random.integers(reach)), int(2 ** random.integers(0, 8))
        kind = int(random.integers(6))
        if kind == 0:
            data[start] ^= 1 << int(random.integers(8))
        elif kind == 1:
            data[start : start + length] = random.bytes(min(length, len(data) - start))
        elif kind == 2:
            data[start : start + length] = bytes([int(random.choice([0, 255, 127]))]) * min(length, len(data) - start)
        elif kind == 3:
            del data[start:]
        elif kind == 4:
            del data[start : start + length]
        else:
            data[start:start] = data[start : start + length]
    return bytes(data)


def hdf5(path: Path, random: Random) -> None:
    """Change an HDF5 file in its structure: types, shapes, values, links and attributes."""
    with h5py.File(path, "r+") as file:
        names: list[str] = []
        file.visit(names.append)
        for _ in range(int(random.integers(1, 3))):
            name = names[int(random.integers(len(names)))] if names else "/"
            # an earlier change removed, hid or enlarged it, or made it what NumPy has no type for
            with suppress(KeyError, OSError, RuntimeError, MemoryError, TypeError):
                change = _HDF5_CHANGES[int(random.integers(len(_HDF5_CHANGES)))]
                change(file, name, random)


def _replace(file: Any, name: str, values: Any, **options: Any) -> None:
    del file[name]
    file.create_dataset(name, data=values, **options)


def _as_array(file: Any, name: str) -> Any:
    return np.asarray(file[name][()]) if isinstance(file[name], h5py.Dataset) else np.zeros(3)


def _wrong_shape(file: Any, name: str, random: Random) -> None:
    values = _as_array(file, name)
    shapes = [values[:-1] if values.ndim else values, values[None], values.ravel(), np.zeros((0, 3)), np.zeros(())]
    _replace(file, name, shapes[int(random.integers(len(shapes)))])


def _wrong_values(file: Any, name: str, random: Random) -> None:
    values = _as_array(file, name)
    if values.dtype.kind in "fiu" and values.size:
        values = values.astype(float if random.random() < 0.6 else values.dtype)
        limits = [np.nan, np.inf, 1e308, -1.0] if values.dtype.kind == "f" else [-1, 2**30, 0]
        limit = np.asarray(limits[int(random.integers(len(limits)))])
        values.flat[int(random.integers(values.size))] = limit.astype(values.dtype)  # regions have one byte
    _replace(file, name, values)


def _wrong_type(file: Any, name: str, random: Random) -> None:
    text_type, compound = h5py.string_dtype(), np.zeros(3, [("x", float), ("y", "i4")])
    kinds: list[Any] = ["text", b"bytes", np.array(["a", "b"], object), 1 + 2j, True, compound]
    kinds += [np.zeros(3, "S4"), h5py.Empty("f")]
    values = kinds[int(random.integers(len(kinds)))]
    options = {"dtype": text_type} if isinstance(values, np.ndarray) and values.dtype == object else {}
    _replace(file, name, values, **options)


def _link(file: Any, name: str, random: Random) -> None:
    targets = [
        h5py.ExternalLink("/etc/passwd", "/"),
        h5py.ExternalLink("other.h5", "/x"),
        h5py.SoftLink("/nowhere"),
        h5py.SoftLink(f"/{name}"),
    ]
    del file[name]
    file[name] = targets[int(random.integers(len(targets)))]


def _group(file: Any, name: str, _random: Random) -> None:
    del file[name]
    file.create_group(name)


def _remove(file: Any, name: str, _random: Random) -> None:
    del file[name]


def _huge(file: Any, name: str, _random: Random) -> None:
    del file[name]
    file.create_dataset(name, shape=(10**6, 10**5), dtype="f8", chunks=(1000, 100))


def _virtual(file: Any, name: str, _random: Random) -> None:
    layout = h5py.VirtualLayout((3,), "f8")
    layout[:] = h5py.VirtualSource("/etc/passwd", "x", shape=(3,))
    del file[name]
    file.create_virtual_dataset(name, layout)


def _attribute(file: Any, name: str, random: Random) -> None:
    owner = file if random.random() < 0.5 else file[name]
    if not len(owner.attrs):
        owner = file
    keys = list(owner.attrs)
    if not keys:
        return
    key = keys[int(random.integers(len(keys)))]
    values: list[Any] = [
        "",
        "x",
        "{",
        "[]",
        json.dumps({"a": [1]}),
        0,
        -1,
        np.nan,
        2**62,
        np.zeros(3),
        b"\xff\xfe",
        "[" * 9999,
    ]
    if random.random() < 0.2:
        del owner.attrs[key]
    else:
        owner.attrs[key] = values[int(random.integers(len(values)))]


_HDF5_CHANGES: Final[tuple[Callable[[Any, str, Random], None], ...]] = (
    *(_wrong_shape, _wrong_values, _wrong_values, _wrong_type, _link, _group, _remove, _huge, _virtual, _attribute),
)
