"""Files that are whole or not there: everything is written beside its place and moved in when it is complete."""

import os
import shutil
import tempfile
from collections.abc import Iterator, Sequence
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


@contextmanager
def writing_folder(folder: Path) -> Iterator[Path]:
    """Yield an empty folder beside `folder`; move its files there when the block ends without an exception.

    Raises
    ------
    InvalidInputError
        If the system refuses.
    """
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        partial = Path(tempfile.mkdtemp(prefix=f".{folder.name}-", dir=folder.parent))
    except OSError as error:
        raise InvalidInputError(_refusal(folder, error)) from error
    try:
        yield partial
        partial.chmod(0o777 & ~_umask())
        if folder.exists():
            for file in sorted(partial.iterdir()):
                file.replace(folder / file.name)
        else:
            partial.replace(folder)
    except OSError as error:
        raise InvalidInputError(_refusal(folder, error)) from error
    except InvalidInputError as error:
        # The user knows the folder by its own name only.
        raise InvalidInputError(str(error).replace(str(partial), str(folder))) from error
    finally:
        shutil.rmtree(partial, ignore_errors=True)


@contextmanager
def writing_files(paths: Sequence[Path]) -> Iterator[list[Path]]:
    """Yield paths of the same names in folders of their own; move them to `paths` if no exception ends the block.

    Raises
    ------
    InvalidInputError
        If the system refuses.
    """
    partials: list[Path] = []
    try:
        for path in paths:
            try:
                folder = Path(tempfile.mkdtemp(prefix=f".{path.stem}-", dir=path.parent))
            except OSError as error:
                raise InvalidInputError(_refusal(path, error)) from error
            partials.append(folder / path.name)
        yield partials
        for partial, path in zip(partials, paths, strict=True):
            try:
                partial.replace(path)
            except OSError as error:
                raise InvalidInputError(_refusal(path, error)) from error
    except InvalidInputError as error:
        text = str(error)
        for partial, path in zip(partials, paths, strict=False):
            text = text.replace(str(partial), str(path))
        raise InvalidInputError(text) from error
    finally:
        for partial in partials:
            shutil.rmtree(partial.parent, ignore_errors=True)


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
