"""Damages bytes: flipped bits, cuts, splices, numbers replaced by extremes. The same for the same generator."""

from __future__ import annotations

import random
import re
import struct

INTEGERS = (0, 1, 2, -1, 127, 255, 32767, 65535, 2**31 - 1, 2**32 - 1, -(2**31), 10**12, 2**63 - 1)
FLOATS = (0.0, -0.0, 1.0, -1.0, 1e-45, 1e-30, 1e9, 2e9, 1e20, 3e38, -1e30, float("inf"), float("nan"))
WORDS = (
    b"nan", b"inf", b"-inf", b"1e400", b"1e20", b"-1", b"0", b"1e-50", b"4294967296", b"1000000000000", b"9" * 4000, b"",
    b"True", b"None", b"1j", b"\xef\xbb\xbf", b"\xff", b"((((((((", b'"',
)  # fmt: skip
NUMBER = re.compile(rb"-?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?")


def mutate(data: bytes, others: list[bytes], rng: random.Random) -> bytes:
    """Return `data` damaged one to four times; a splice takes the rest of one of `others`."""
    out = bytearray(data)
    ways = _TEXT_WAYS if data.isascii() and rng.random() < 0.9 else _WAYS  # else nearly all would be refused as no text
    while out == data:  # a way may find nothing to change
        for _ in range(rng.choice((1, 1, 1, 2, 3, 4))):
            rng.choice(ways)(out, others, rng)
    return bytes(out)


def _flip(out: bytearray, _: list[bytes], rng: random.Random) -> None:
    if out:
        out[rng.randrange(len(out))] ^= 1 << rng.randrange(8)


def _early(out: bytearray, _: list[bytes], rng: random.Random) -> None:
    """A byte of the header, where the counts are."""
    if out:
        out[rng.randrange(min(len(out), 32))] = rng.choice((0, 1, 127, 128, 255, rng.randrange(256)))


def _integer(out: bytearray, _: list[bytes], rng: random.Random) -> None:
    size = rng.choice((1, 2, 4, 8))
    if len(out) >= size:
        at = rng.randrange(len(out) - size + 1) // size * size
        value = rng.choice(INTEGERS) & (256**size - 1)
        out[at : at + size] = value.to_bytes(size, rng.choice(("little", "big")))


def _float(out: bytearray, _: list[bytes], rng: random.Random) -> None:
    form = rng.choice(("<f", "<d", ">f"))
    size = struct.calcsize(form)
    if len(out) >= size:
        at = rng.randrange(len(out) - size + 1) // 4 * 4
        out[at : at + size] = struct.pack(form, rng.choice(FLOATS))


def _word(out: bytearray, _: list[bytes], rng: random.Random) -> None:
    found = list(NUMBER.finditer(out))
    if found:
        at = rng.choice(found)
        out[at.start() : at.end()] = rng.choice(WORDS)


def _cut(out: bytearray, _: list[bytes], rng: random.Random) -> None:
    del out[rng.randrange(len(out) + 1) :]


def _remove(out: bytearray, _: list[bytes], rng: random.Random) -> None:
    at = rng.randrange(len(out) + 1)
    del out[at : at + rng.randint(1, 64)]


def _repeat(out: bytearray, _: list[bytes], rng: random.Random) -> None:
    at = rng.randrange(len(out) + 1)
    out[at:at] = out[at : at + rng.randint(1, 64)] * rng.choice((1, 1, 2, 50))


def _insert(out: bytearray, _: list[bytes], rng: random.Random) -> None:
    at = rng.randrange(len(out) + 1)
    out[at:at] = rng.choice((rng.randbytes(rng.randint(1, 8)), rng.choice(WORDS)))


def _splice(out: bytearray, others: list[bytes], rng: random.Random) -> None:
    other = rng.choice(others)
    out[rng.randrange(len(out) + 1) :] = other[rng.randrange(len(other) + 1) :]


def _letter(out: bytearray, _: list[bytes], rng: random.Random) -> None:
    if out:
        out[rng.randrange(len(out))] = rng.choice(b'0123456789.-+eE ,\n\t()[]{}=#x\0"')


_TEXT_WAYS = (_word, _word, _word, _letter, _cut, _remove, _repeat, _splice)
_WAYS = (_flip, _early, _integer, _float, _word, _word, _cut, _remove, _repeat, _insert, _splice)
