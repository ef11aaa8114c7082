"""Microsoft's compiler of HLSL, by the interface of its library: `make test-all` takes it from compushady's sources."""

from __future__ import annotations

import ctypes
import sys
import uuid
from pathlib import Path
from typing import Any

import pytest

_COMPILER, _COMPILER_3 = "73e22d93-e6ce-47f3-b5bf-f0664f39c1b0", "228b4687-5a6a-4730-900c-9702b2203f54"
_RESULT = "58346cda-dde7-4497-9461-6f87af5e0659"
_OWN = 5  # of IUnknown: three methods and, where it is not Windows', two destructors
_UTF_8 = 65001


class _Source(ctypes.Structure):
    _fields_ = (("text", ctypes.c_char_p), ("size", ctypes.c_size_t), ("encoding", ctypes.c_uint32))


def compile_hlsl(text: str, *arguments: str) -> tuple[bytes, str]:
    """Return what DXC compiles, empty where it refuses, and all that it says. Skip the test where there is none."""
    path = next(Path(sys.prefix, "lib").glob("libdxcompiler.*"), None)
    if path is None:
        pytest.skip("no DXC (make test-all installs it on Linux)")
    compiler, result = ctypes.c_void_p(), ctypes.c_void_p()
    found = ctypes.CDLL(str(path)).DxcCreateInstance(_id(_COMPILER), _id(_COMPILER_3), ctypes.byref(compiler))
    assert found == 0, hex(found & 0xFFFFFFFF)
    raw = text.encode()
    source, words = _Source(raw, len(raw), _UTF_8), (ctypes.c_wchar_p * len(arguments))(*arguments)
    done = _call(compiler, 0, ctypes.byref(source), words, len(arguments), None, _id(_RESULT), ctypes.byref(result))
    assert done == 0, hex(done & 0xFFFFFFFF)
    made, said = _bytes(result, 1), _bytes(result, 2)
    for thing in (result, compiler):
        _call(thing, 2 - _OWN)  # Release
    return made, said.rstrip(b"\0").decode()


def _id(name: str) -> Any:
    return (ctypes.c_ubyte * 16)(*uuid.UUID(name).bytes_le)


def _call(thing: Any, method: int, *arguments: Any, gives: Any = ctypes.c_long) -> Any:
    """Call a method, in the order in which its interface declares them."""
    table = ctypes.cast(thing, ctypes.POINTER(ctypes.POINTER(ctypes.c_void_p))).contents
    kinds = [ctypes.c_uint32 if isinstance(a, int) else ctypes.c_void_p for a in arguments]
    given = [a if a is None or isinstance(a, int) else ctypes.cast(a, ctypes.c_void_p) for a in arguments]
    return ctypes.CFUNCTYPE(gives, ctypes.c_void_p, *kinds)(table[_OWN + method])(thing, *given)


def _bytes(result: Any, method: int) -> bytes:
    """What one of the result's methods gives, a blob or none."""
    blob = ctypes.c_void_p()
    _call(result, method, ctypes.byref(blob))
    if not blob:
        return b""
    return ctypes.string_at(_call(blob, 0, gives=ctypes.c_void_p), _call(blob, 1, gives=ctypes.c_size_t))
