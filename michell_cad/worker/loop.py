"""Requests in, events out: what the worker does with any request, whatever it asks for."""

import json
import logging
from collections.abc import Iterable, Mapping
from io import TextIOBase
from queue import SimpleQueue
from threading import Event, Lock, Thread
from typing import Any

from michell_cad.errors import InvalidInputError, MichellError
from michell_cad.worker.tasks import TASKS, Session

logger = logging.getLogger(__name__)

SMALLEST_STEP = 0.01
"""Progress of less than this is not worth an event (fraction of a stage)."""


class Cancelled(Exception):
    """The host does not want the result any more."""


class Host:
    """The other end: requests come from it in a thread of their own, so that a cancel is seen while something runs."""

    def __init__(self, source: Iterable[str], target: TextIOBase) -> None:
        self.requests: SimpleQueue[Mapping[str, Any] | None] = SimpleQueue()
        self._target, self._writing = target, Lock()
        self._cancelled: set[Any] = set()
        self._gone = Event()
        Thread(target=self._read, args=(source,), daemon=True).start()

    def send(self, number: Any, event: str, **values: Any) -> None:
        """Write an event."""
        line = json.dumps({"id": number, "event": event} | values, allow_nan=False) + "\n"
        try:
            with self._writing:
                self._target.write(line)
                self._target.flush()
        except BrokenPipeError:
            self._gone.set()

    def wants(self, number: Any) -> bool:
        """Whether the result of a request is still wanted."""
        return number not in self._cancelled and not self._gone.is_set()

    def _read(self, source: Iterable[str]) -> None:
        for line in source:
            try:
                message = json.loads(line)
            except ValueError as error:
                self.send(None, "error", kind="protocol", message=f"not a line of JSON: {error}")
                continue
            if not isinstance(message, dict):
                self.send(None, "error", kind="protocol", message="a request is a JSON object")
            elif message.get("do") == "cancel":
                self._cancelled.add(message.get("of"))
            else:
                self.requests.put(message)
        self._gone.set()
        self.requests.put(None)


def serve(source: Iterable[str], target: TextIOBase) -> None:
    """Do all requests of `source`, one after the other, until it ends."""
    host, session = Host(source, target), Session()
    while (request := host.requests.get()) is not None:
        number = request.get("id")
        try:
            host.send(number, "done", result=_answer(request, session, host))
        except Cancelled:
            host.send(number, "error", kind="cancelled", message="cancelled; nothing was written")
        except InvalidInputError as error:
            host.send(number, "error", kind="input", message=str(error))
        except MichellError as error:
            host.send(number, "error", kind="failed", message=str(error))
        except MemoryError:
            message = "out of memory; use a coarser mesh or a smaller resolution"
            host.send(number, "error", kind="failed", message=message)
        except Exception as error:
            logger.exception("request %s", number)
            host.send(number, "error", kind="bug", message=f"unexpected {type(error).__name__}: {error}")


def _answer(request: Mapping[str, Any], session: Session, host: Host) -> dict[str, Any]:
    number, shown = request.get("id"), [("", 0.0)]

    def progress(stage: str, fraction: float) -> None:
        if not host.wants(number):
            raise Cancelled
        last_stage, last = shown[0]
        if stage != last_stage or fraction - last >= SMALLEST_STEP or (fraction >= 1 > last):
            shown[0] = (stage, fraction)
            host.send(number, "progress", stage=stage, fraction=min(float(fraction), 1.0))

    if not host.wants(number):
        raise Cancelled
    task = TASKS.get(request.get("do", ""))
    if task is None:
        raise InvalidInputError(f"unknown request {request.get('do')!r}; expected one of {', '.join(TASKS)}")
    return task(session, {key: value for key, value in request.items() if key not in ("id", "do")}, progress)
