"""Locks that make objects safe to share between threads, and clear errors where they are not
(docs/reference/python-api.md, "Threads")."""

import threading
from collections import deque
from collections.abc import Callable, Generator
from contextlib import AbstractContextManager
from functools import wraps
from typing import Any, Concatenate, NoReturn, ParamSpec, Protocol, TypeVar

from eitskin.errors import UsageError

T = TypeVar("T")
P = ParamSpec("P")


class Lockable(Protocol):
    """An object whose calls are carried out one after the other: ``lock`` is reentrant."""

    @property
    def lock(self) -> AbstractContextManager[Any]: ...


S = TypeVar("S", bound=Lockable)


def one_at_a_time(method: Callable[Concatenate[S, P], T]) -> Callable[Concatenate[S, P], T]:
    """Let ``method`` run with the object's ``lock`` held, so that no two threads are inside the
    object. Every method that reaches the state of a C object is one of these."""

    @wraps(method)
    def locked(self: S, /, *given: P.args, **named: P.kwargs) -> T:
        with self.lock:
            return method(self, *given, **named)

    return locked


class FairLock:
    """A reentrant lock that threads get in the order in which they asked for it. A thread that lets
    go of a plain lock and takes it again at once starves the others."""

    def __init__(self) -> None:
        self._changed = threading.Condition(threading.Lock())
        self._waiting: deque[object] = deque()
        self._owner: int | None = None
        self._depth = 0

    def acquire(self, timeout_s: float | None = None) -> bool:
        """Wait for the lock, for ``timeout_s`` at most; False if it did not come free."""
        me = threading.get_ident()
        with self._changed:
            if self._owner == me or (self._owner is None and not self._waiting):
                self._owner, self._depth = me, self._depth + 1
                return True
            ticket = object()
            self._waiting.append(ticket)
            taken = False
            try:
                taken = self._changed.wait_for(lambda: self._is_next(ticket), timeout_s)
                if taken:
                    self._owner, self._depth = me, 1
            finally:
                self._waiting.remove(ticket)
                if not taken:
                    self._changed.notify_all()  # another one may be the next now
            return taken

    def _is_next(self, ticket: object) -> bool:
        return self._owner is None and self._waiting[0] is ticket

    def release(self) -> None:
        """Release the lock, once for each ``acquire``."""
        with self._changed:
            self._depth -= 1
            if self._depth == 0:
                self._owner = None
                if self._waiting:
                    self._changed.notify_all()

    def __enter__(self) -> None:
        self.acquire()

    def __exit__(self, *error: object) -> None:
        self.release()


class OneReader:
    """Lets one reader at a time read ``what``, such as "the frames of /dev/ttyACM0". A reader in
    the same thread takes over from the one before; another thread is refused while the thread that
    reads is alive."""

    def __init__(self, what: str, advice: str) -> None:
        self._what, self._advice = what, advice
        self._lock = threading.Lock()
        self._reader: object | None = None
        self._thread: threading.Thread | None = None

    def begin(self, reader: object) -> None:
        """``reader`` reads from now on.

        Raises:
            UsageError: another thread reads.
        """
        with self._lock:
            self._refuse_others()
            self._reader, self._thread = reader, threading.current_thread()

    def go_on(self, reader: object) -> None:
        """Let ``reader`` continue, in any thread.

        Raises:
            UsageError: another reader took over.
        """
        with self._lock:
            if self._reader is not reader:
                raise UsageError(
                    f"{self._what} were taken over by a later reader; read on with that one"
                )
            self._thread = threading.current_thread()

    def end(self, reader: object) -> bool:
        """``reader`` reads no more; False if it was not its turn."""
        with self._lock:
            if self._reader is not reader:
                return False
            self._reader = self._thread = None
            return True

    @property
    def idle(self) -> bool:
        """Nobody reads."""
        return self._reader is None

    def check(self) -> None:
        """Raise a UsageError if another thread reads."""
        with self._lock:
            self._refuse_others()

    def _refuse_others(self) -> None:
        thread = self._thread
        if thread is not None and thread is not threading.current_thread() and thread.is_alive():
            raise UsageError(f"{self._what} already go to thread {thread.name!r}; {self._advice}")


class OneThreadAtATime(Generator[T, None, None]):
    """The generator ``inner``, which any thread may advance, but only one at a time; another one
    gets an error that names the thread inside. ``what`` is it in the error."""

    def __init__(self, inner: Generator[T, None, None], what: str, advice: str) -> None:
        self._inner, self._what, self._advice = inner, what, advice
        self._lock = threading.Lock()
        self._inside: threading.Thread | None = None

    def send(self, value: None) -> T:
        self._enter()
        try:
            return self._inner.send(value)
        finally:
            self._leave()

    def throw(self, *error: Any) -> T:
        self._enter()
        try:
            return self._inner.throw(*error)
        finally:
            self._leave()

    def close(self) -> None:
        self._enter()
        try:
            self._inner.close()
        finally:
            self._leave()

    def _enter(self) -> None:
        with self._lock:
            inside = self._inside
            if inside is None:
                self._inside = threading.current_thread()
                return
        if inside is threading.current_thread():
            raise UsageError(f"{self._what} cannot be read from inside itself")
        raise UsageError(f"{self._what} is being read by thread {inside.name!r}; {self._advice}")

    def _leave(self) -> None:
        with self._lock:
            self._inside = None


def within(limit_s: float, action: Callable[[], T]) -> T | None:
    """Return the result of ``action``, or raise its error. Return None if it takes longer than
    ``limit_s``; a thread that ends with the process then continues it."""
    done: list[tuple[T | None, BaseException | None]] = []

    def run() -> None:
        try:
            done.append((action(), None))
        except BaseException as error:
            done.append((None, error))

    thread = threading.Thread(target=run, name="eitskin leaves a port", daemon=True)
    try:
        thread.start()
    except RuntimeError:  # Python is ending, and the port with it
        return None
    thread.join(limit_s)
    if not done:
        return None
    value, error = done[0]
    if error is not None:
        raise error
    return value


def refuse_copy(what: str, advice: str) -> NoReturn:
    """Raise the UsageError for an object that can be neither pickled nor copied."""
    raise UsageError(f"{what} can be neither pickled nor copied; {advice}")
