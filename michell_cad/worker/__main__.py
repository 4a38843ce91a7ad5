"""`python -m michell_cad.worker`: standard output for events only."""

import os
import sys

from michell_cad.worker.loop import serve


def main() -> None:
    """Serve a host until its end of standard input."""
    with os.fdopen(os.dup(1), "w", encoding="utf-8") as events:
        os.dup2(2, 1)  # what libraries print, also those of C++, must not come between the events
        sys.stdin.reconfigure(encoding="utf-8")  # pyright: ignore[reportAttributeAccessIssue]
        serve(sys.stdin, events)


if __name__ == "__main__":
    main()
