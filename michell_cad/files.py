"""Files that are whole or not there: everything is written beside its place and moved in when it is complete."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from michell_cad.errors import InvalidInputError


@contextmanager
def writing(path: Path) -> Iterator[Path]:
    """Yield a path in the same folder to write to; rename it to `path` if the block ends without an exception.

    Raises
    ------
    InvalidInputError
        If the system refuses: no such folder, no permission, no space.
    """
    try:
        handle, name = tempfile.mkstemp(prefix=f".{path.stem}-", suffix=path.suffix, dir=path.parent)
    except OSError as error:
        raise InvalidInputError(_refusal(path, error)) from error
    os.close(handle)
    partial = Path(name)
    try:
        yield partial
        partial.chmod(0o666 & ~_umask())  # mkstemp makes files that only their owner may read
        partial.replace(path)
    except OSError as error:
        raise InvalidInputError(_refusal(path, error)) from error
    finally:
        partial.unlink(missing_ok=True)


def path_with_suffix(path: str | Path, *suffixes: str) -> Path:
    """The path, if its name ends in one of these.

    Raises
    ------
    InvalidInputError
        If it does not.
    """
    path = Path(path)
    if not path.name.lower().endswith(suffixes):
        expected = " or ".join(suffixes)
        raise InvalidInputError(f"{path}: expected a file name that ends in {expected}, found {path.suffix or 'none'}")
    return path


def _refusal(path: Path, error: OSError) -> str:
    return f"{path} cannot be written ({error.strerror}); nothing is left of it: free space, or choose another folder"


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
