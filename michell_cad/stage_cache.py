"""Results of stages kept between runs, found again by what they depend on.

A result is kept under a hash of everything that went into it: the values themselves (arrays, options), the name of the
stage, and the program's own source, so that it can be wrong only if the hash is. A run that was interrupted goes on
behind the last stage that it finished, and one with other options reuses every stage before the first that they touch.

Files hold plain arrays and JSON, nothing pickled: reading one runs no code. A file that cannot be read counts as none.
"""

import hashlib
import json
import os
import zipfile
from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, get_args, get_type_hints

import numpy as np

from michell_cad.curves import Curve, Curves
from michell_cad.files import writing

FOLDER_VARIABLE = "MICHELL_CAD_CACHE"
"""Environment variable that names the folder of the cache; empty: no cache."""

LARGEST = 2_000_000_000
"""Bytes that the cache may take; the results that were used the longest ago go first."""

Value = TypeVar("Value")


@dataclass(frozen=True)
class StageCache:
    """A folder of results.

    Parameters
    ----------
    folder : is made when the first result is kept; None: nothing is kept.
    """

    folder: Path | None = None

    @staticmethod
    def usual() -> "StageCache":
        """The cache of this user, see `FOLDER_VARIABLE`; the default is ``michell_cad`` in the user's cache folder."""
        named = os.environ.get(FOLDER_VARIABLE)
        if named is not None:
            return StageCache(Path(named) if named else None)
        base = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
        return StageCache(Path(base) / "michell_cad")

    def keep(self, stage: str, kind: type[Value], inputs: tuple[Any, ...], compute: Callable[[], Value]) -> Value:
        """The result of a stage: as it was kept, or computed now.

        Parameters
        ----------
        stage : name.
        kind : the dataclass that the stage returns; its fields are arrays, plain values, or such dataclasses.
        inputs : everything that the result depends on.
        compute : computes it.
        """
        if self.folder is None:
            return compute()
        path = self.folder / f"{stage}-{content_hash((stage, inputs))}.npz"
        value = _read(path, kind)
        if value is None:
            value = compute()
            self._write(path, value)
        return value

    def _write(self, path: Path, value: Any) -> None:
        arrays: dict[str, Any] = {}
        plain: dict[str, Any] = {}
        _pack(value, arrays, plain, "")
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with writing(path) as partial, partial.open("wb") as file:
                np.savez(file, plain=np.array(json.dumps(plain)), **arrays)
            self._drop_oldest()
        except OSError:  # a full disk or a folder that is not ours: the result is there all the same
            return

    def _drop_oldest(self) -> None:
        assert self.folder is not None
        files = sorted(((f.stat().st_mtime, f.stat().st_size, f) for f in self.folder.glob("*.npz")), reverse=True)
        total = 0
        for _, size, file in files:
            total += size
            if total > LARGEST:
                file.unlink(missing_ok=True)


def _read(path: Path, kind: type[Value]) -> Value | None:
    """A kept result, or None if there is none that can be read."""
    try:
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as file:
            value = _unpack(kind, file, json.loads(str(file["plain"])), "")
        path.touch()  # used last now
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        return None
    return value


def content_hash(value: Any) -> str:
    """A hash of the contents of nested tuples, dataclasses, arrays and plain values, and of the program's source."""
    digest = hashlib.blake2b(_source_hash(), digest_size=20)
    _feed(digest, value)
    return digest.hexdigest()


@cache
def _source_hash() -> bytes:
    digest = hashlib.blake2b(digest_size=20)
    for file in sorted(Path(__file__).parent.rglob("*.py")):
        digest.update(file.read_bytes())
    return digest.digest()


def _feed(digest: Any, value: Any) -> None:
    if isinstance(value, np.ndarray):
        digest.update(f"{value.dtype.str}{value.shape}".encode())
        digest.update(np.ascontiguousarray(value).data)
    elif is_dataclass(value):
        digest.update(type(value).__name__.encode())
        for field in fields(value):
            digest.update(field.name.encode())
            _feed(digest, getattr(value, field.name))
    elif isinstance(value, tuple | list):
        digest.update(f"{len(value)}(".encode())
        for item in value:
            _feed(digest, item)
    else:
        digest.update(f"{type(value).__name__} {value!r};".encode())


def _pack(value: Any, arrays: dict[str, Any], plain: dict[str, Any], prefix: str) -> None:
    """Put the fields of a dataclass into arrays and plain values, by their path."""
    for field in fields(value):
        item, name = getattr(value, field.name), prefix + field.name
        if isinstance(item, tuple) and item and isinstance(item[0], Curve):
            item = Curves.of(item)
        if isinstance(item, np.ndarray):
            arrays[name] = item
        elif is_dataclass(item):
            _pack(item, arrays, plain, name + ".")
        else:
            plain[name] = item


def _unpack(kind: type[Value], arrays: Any, plain: dict[str, Any], prefix: str) -> Value:
    values: dict[str, Any] = {}
    for name, hint in get_type_hints(kind).items():
        path = prefix + name
        if path in plain:
            item = plain[path]
            values[name] = _tuples(item)
        elif path in arrays:
            values[name] = arrays[path]
        elif hint == tuple[Curve, ...]:
            values[name] = tuple(_unpack(Curves, arrays, plain, path + "."))
        else:
            inner = next(part for part in (hint, *get_args(hint)) if is_dataclass(part))
            values[name] = _unpack(inner, arrays, plain, path + ".")  # pyright: ignore[reportArgumentType]
    return kind(**values)


def _tuples(value: Any) -> Any:
    """JSON knows lists only."""
    return tuple(_tuples(item) for item in value) if isinstance(value, list) else value
