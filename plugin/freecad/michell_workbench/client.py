"""The other end of `python -m michell_cad.worker`: start it, ask it, cancel, and say plainly when it is gone."""

import json
import os
import signal
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from queue import Empty, SimpleQueue
from threading import Lock, Thread
from typing import Any

from michell_workbench import messages
from michell_workbench.interpreter import worker_environment

PROTOCOL = 1

POLL = 0.05
"""Seconds between two looks at whether the answer is still wanted."""

GRACE = 3.0
"""Seconds that a cancelled worker has to answer before it is ended."""

TAIL = 600
"""Characters of the worker's own complaints that a message shows."""


Progress = Callable[[str, float], None]
Wanted = Callable[[], bool]


def _no_progress(stage: str, fraction: float) -> None:
    """Show nothing."""


def _always() -> bool:
    """Never cancel."""
    return True


class WorkerError(Exception):
    """The worker could not do it; the text is for the designer.

    `kind` is that of the worker's protocol, or ``missing``, ``died``, ``busy``.
    """

    def __init__(self, kind: str, message: str) -> None:
        super().__init__(message)
        self.kind = kind


class Worker:
    """One worker process, started when it is first asked and again after its end.

    Parameters
    ----------
    command : how to start it.
    """

    def __init__(self, command: list[str]) -> None:
        self.command = command
        self._process: Any = None
        self._events: Any = SimpleQueue()
        self._complaints: Any = None
        self._last_words = ""
        self._number = 0
        self._hello: dict[str, Any] | None = None
        self._in_use = Lock()

    def hello(self) -> dict[str, Any]:
        """What the worker said about itself: schema of the knobs, materials, stages."""
        with _held(self._in_use):
            return self._started()

    def ask(
        self,
        do: str,
        values: dict[str, Any],
        progress: Progress = _no_progress,
        wanted: Wanted = _always,
    ) -> dict[str, Any]:
        """Ask for one thing and wait for the result.

        Parameters
        ----------
        do, values : the request.
        progress : called with stage and fraction.
        wanted : asked again and again; when it says no, the request is cancelled.

        Raises
        ------
        WorkerError
            If the worker is missing, busy, refuses, fails or dies, or if the request was cancelled.
        """
        with _held(self._in_use):
            self._started()
            return self._exchange(do, values, progress, wanted)

    def close(self) -> None:
        """End the worker, whatever it is doing, and what it has started."""
        process, self._process, self._hello = self._process, None, None
        if process is None:
            return
        if process.poll() is None:
            if os.name == "posix":
                os.killpg(process.pid, signal.SIGKILL)  # the mesher is a child of the worker
            else:
                subprocess.run(["taskkill", "/F", "/T", "/PID", str(process.pid)], capture_output=True, check=False)
        process.wait()
        with suppress(OSError):  # what was left to be sent
            process.stdin.close()
        self._complaints.seek(0)
        self._last_words = self._complaints.read().decode("utf-8", "replace")[-TAIL:].strip()
        self._complaints.close()

    def _started(self) -> dict[str, Any]:
        if self._process is not None and self._process.poll() is not None:
            self.close()
        if self._process is None:
            self._start()
            self._hello = None
        if self._hello is None:
            try:
                self._hello = self._exchange("hello", {"protocol": PROTOCOL}, _no_progress, _always)
            except WorkerError as error:
                self.close()
                if error.kind != "died":
                    raise
                raise WorkerError("missing", messages.not_installed(self.command[0], self._last_words)) from error
        return self._hello

    def _start(self) -> None:
        self._complaints = tempfile.TemporaryFile()
        self._events = SimpleQueue()
        try:
            self._process = subprocess.Popen(
                self.command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._complaints,
                env=worker_environment(),
                start_new_session=os.name == "posix",
                creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
                encoding="utf-8",
            )
        except OSError as error:
            self._complaints.close()
            raise WorkerError("missing", messages.not_installed(self.command[0], str(error))) from error
        Thread(target=_read_events, args=(self._process.stdout, self._events), daemon=True).start()

    def _exchange(
        self,
        do: str,
        values: dict[str, Any],
        progress: Progress,
        wanted: Wanted,
    ) -> dict[str, Any]:
        self._number += 1
        number, patience = self._number, None
        self._send({"id": number, "do": do, **values})
        while True:
            if patience is None and not wanted():
                self._send({"id": None, "do": "cancel", "of": number})
                patience = time.monotonic() + GRACE
            if patience is not None and time.monotonic() > patience:
                self.close()
                raise WorkerError("cancelled", messages.cancelled())
            try:
                event = self._events.get(timeout=POLL)
            except Empty:
                continue
            if event is None:
                raise self._death()
            if event.get("id") != number:
                continue
            if event["event"] == "progress":
                progress(event["stage"], event["fraction"])
            elif event["event"] == "done":
                return event["result"]
            else:
                text = messages.cancelled() if event["kind"] == "cancelled" else event["message"]
                raise WorkerError(event["kind"], text)

    def _send(self, request: dict[str, Any]) -> None:
        try:
            self._process.stdin.write(json.dumps(request) + "\n")
            self._process.stdin.flush()
        except OSError:  # it has just died; the end of its events says so
            return

    def _death(self) -> WorkerError:
        code = self._process.wait()
        self.close()
        return WorkerError("died", messages.worker_died(code, self._last_words))


@contextmanager
def _held(lock: Any) -> Iterator[None]:
    """Hold a lock, or say that the worker is busy."""
    if not lock.acquire(blocking=False):
        raise WorkerError("busy", messages.busy())
    try:
        yield
    finally:
        lock.release()


def _read_events(stream: Any, events: Any) -> None:
    """Put every event into a queue, and None at the end. Runs in a thread: reading waits."""
    with stream:
        for line in stream:
            try:
                events.put(json.loads(line))
            except ValueError:  # cut short by the end of the worker
                break
    events.put(None)
