"""Requests of other threads to the thread that owns a board."""

import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from typing import TypeVar

from eitskin.device.client import Device
from eitskin.errors import DeviceError

T = TypeVar("T")


class Requests:
    """Actions that wait for the board, in the order of the requests. Each gets an answer: its
    result, the exception that it raises, or, if it cannot be carried out now or any more, a
    DeviceError that says why."""

    def __init__(self) -> None:
        self._waiting: deque[tuple[Future[object], Callable[[Device], object]]] = deque()
        self._lock = threading.Lock()
        self._closed: str | None = None

    def ask(self, action: Callable[[Device], T]) -> Future[T]:
        """Request ``action``; after ``close`` it is answered at once."""
        answer: Future[T] = Future()
        with self._lock:
            if self._closed is None:
                self._waiting.append((answer, action))  # type: ignore[arg-type]
                return answer
            reason = self._closed
        answer.set_exception(DeviceError(reason))
        return answer

    @property
    def waiting(self) -> bool:
        return bool(self._waiting)

    def carry_out(self, device: Device) -> None:
        """Carry out the waiting requests; the caller owns the board."""
        while (one := self._next()) is not None:
            answer, action = one
            if not answer.set_running_or_notify_cancel():
                continue
            try:
                answer.set_result(action(device))
            except BaseException as error:
                answer.set_exception(error)
                if not isinstance(error, Exception):
                    raise  # Ctrl-C ends the session, too

    def refuse(self, reason: str) -> None:
        """Answer the waiting requests with ``reason``."""
        while (one := self._next()) is not None:
            if one[0].set_running_or_notify_cancel():
                one[0].set_exception(DeviceError(reason))

    def close(self, reason: str) -> None:
        """Answer all waiting and later requests with ``reason``; the first reason counts."""
        with self._lock:
            self._closed = self._closed or reason
        self.refuse(self._closed)

    def _next(self) -> tuple[Future[object], Callable[[Device], object]] | None:
        with self._lock:
            return self._waiting.popleft() if self._waiting else None
