"""Where results go: a place reserved before long work, written all or nothing, and another one where it fails after the work."""

import contextlib
import errno
import os
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType

from expert.errors import InvalidProblem

try:
    import fcntl
except ImportError:  # not on every system; without it two processes do not notice each other
    fcntl = None  # type: ignore[assignment]

ROOM = 1 << 20
"""Bytes that are reserved: a full disk is noticed before the work."""


class Output:
    """A file that this process is going to write: `with Output(path) as output: ...; output.write(content)`.

    Raises InvalidProblem, naming `output`, where nothing can be written there, and where another process is about to.
    An older file stays as it is until the new one is complete.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path)

    def __enter__(self) -> "Output":
        with _one_line(self.path), contextlib.ExitStack() as undo:
            self._target = _replaceable(self.path)
            undo.enter_context(_lock(self._target, self.path))
            handle, name = tempfile.mkstemp(dir=self._target.parent, prefix=f".{self._target.name}.")
            undo.callback(os.unlink, name)
            self._temporary, self._file = Path(name), os.fdopen(handle, "wb")
            undo.callback(self._file.close)
            _reserve(handle)
            self._undo = undo.pop_all()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with contextlib.suppress(OSError):  # the temporary file has become the new one, or its folder is gone
            self._undo.close()

    def write(self, content: bytes) -> None:
        """Replace the file at once, so that neither a crash nor Ctrl-C leaves half of it.  Raises InvalidProblem."""
        with _one_line(self.path):
            self._file.seek(0)
            self._file.write(content)
            self._file.truncate()
            self._file.flush()
            os.fsync(self._file.fileno())
            os.chmod(self._temporary, 0o666 & ~_umask())
            os.replace(self._temporary, self._target)

    def deliver(self, content: bytes) -> None:
        """Write what took long to find; where that fails, keep it elsewhere and say where in the InvalidProblem raised."""
        try:
            self.write(content)
        except InvalidProblem as failure:
            kept = _keep(self.path, content)
            raise InvalidProblem(
                "output", expected=failure.expected, got=failure.got, remedy=f"the result is kept {kept}"
            ) from None


@contextlib.contextmanager
def claimed(path: str | os.PathLike[str]) -> Iterator[None]:
    """Hold a file or folder that is written bit by bit; what it is to lie in is made.

    Raises InvalidProblem where that cannot be, and where another process holds it.  A process that dies lets go.
    """
    target = Path(os.path.realpath(path))
    with contextlib.ExitStack() as undo:
        with _one_line(target):
            target.parent.mkdir(parents=True, exist_ok=True)
            undo.enter_context(_lock(target, Path(path)))
        yield


@contextlib.contextmanager
def folder(path: str | os.PathLike[str]) -> Iterator[Path]:
    """A folder for results, made where it is missing; where nothing comes of them it goes again.  Raises InvalidProblem."""
    wanted = Path(path)
    missing = [place for place in (wanted, *wanted.parents) if not place.exists()]
    with _one_line(wanted):
        wanted.mkdir(parents=True, exist_ok=True)
    try:
        yield wanted
    except BaseException:
        for place in missing:
            with contextlib.suppress(OSError):
                place.rmdir()
        raise


def writable(path: str | os.PathLike[str]) -> None:
    """Raise InvalidProblem unless a file can be put there: asked before long work, not after it."""
    with Output(path):
        pass


def write_atomically(path: str | os.PathLike[str], content: bytes) -> None:
    """Replace the file at once.  Raises InvalidProblem where the place cannot be written."""
    with Output(path) as output:
        output.write(content)


@contextlib.contextmanager
def _one_line(path: Path) -> Iterator[None]:
    """What the system says about the path, as InvalidProblem."""
    try:
        yield
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        remedy = "choose another place"
        raise InvalidProblem(
            "output", expected="a place to write", got=f"{reason}: {path}", remedy=remedy
        ) from None


def _replaceable(path: Path) -> Path:
    """The file itself, where the path is a link to it."""
    target = Path(os.path.realpath(path))
    if target.is_dir() or not target.parent.is_dir() or not os.access(target.parent, os.W_OK):
        raise InvalidProblem(
            "output", expected="a file in a writable folder", got=str(path), remedy="create the folder"
        )
    if target.exists() and not (target.is_file() and target.stat().st_mode & 0o222):
        raise InvalidProblem(
            "output", expected="a file that may be replaced", got=f"{path}, which is read-only or no file"
        )
    return target


@contextlib.contextmanager
def _lock(target: Path, path: Path) -> Iterator[None]:
    """Hold the lock file beside the target, which the user calls `path`."""
    lock = target.with_name(f".{target.name}.lock")
    handle = _locked(lock, path)
    try:
        yield
    finally:
        if handle is not None:
            lock.unlink(missing_ok=True)  # while it is still held: nobody else can have it
            os.close(handle)


def _locked(lock: Path, path: Path) -> int | None:
    """A handle that holds the lock file, which names this process; None where the system knows no locks."""
    if fcntl is None:
        return None
    while True:
        handle = os.open(lock, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            owner = os.read(handle, 20).decode(errors="replace").strip()
            os.close(handle)
            raise InvalidProblem(
                "output",
                expected="a file that no other process writes",
                got=f"{path}, which process {owner or 'unknown'} is about to write",
                remedy="wait for it or choose another name",
            ) from None
        if lock.exists() and os.path.samestat(os.stat(lock), os.fstat(handle)):
            os.truncate(handle, 0)
            os.write(handle, str(os.getpid()).encode())
            return handle
        os.close(handle)  # its last owner has just removed it


def _reserve(handle: int) -> None:
    """Claim space for the result, where the system can do that."""
    try:
        os.posix_fallocate(handle, 0, ROOM)
    except AttributeError:
        return
    except OSError as error:
        if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
            raise


def _keep(path: Path, content: bytes) -> str:
    """Put the content into the first folder that takes it, or print it; says where."""
    for folder in (Path(tempfile.gettempdir()), Path.home(), Path.cwd()):
        with contextlib.suppress(OSError):
            handle, name = tempfile.mkstemp(dir=folder, prefix=f"{path.stem}-", suffix=path.suffix)
            try:
                with os.fdopen(handle, "wb") as file:
                    file.write(content)
            except OSError:
                os.unlink(name)
                raise
            return f"in {name}"
    sys.stdout.write(content.decode())
    return "on standard output"


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
