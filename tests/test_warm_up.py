import subprocess
import sys
from pathlib import Path

TESTS = Path(__file__).parent

CODE = """
import sys, time
from numba.core.dispatcher import Dispatcher
from shapes import cantilever
from michell_cad.pipeline import DesignOptions, design
from michell_cad.warm_up import load_compiled_loops

load_compiled_loops()
start = time.process_time()
load_compiled_loops()
assert time.process_time() - start < 1e-3
loops = {id(v): v for m in list(sys.modules.values()) if getattr(m, "__name__", "").startswith("michell_cad")
         for v in vars(m).values() if isinstance(v, Dispatcher)}
before = {number: len(loop.signatures) for number, loop in loops.items()}
assert sum(before.values()) >= 15, before  # loops that are only called by others may have none
design(cantilever((6, 3, 3)), DesignOptions(resolution=5))
print(before == {number: len(loop.signatures) for number, loop in loops.items()})
"""


def test_no_stage_compiles_anything():
    """In a process of its own: loops are compiled for the types that the stages ask for, and no others."""
    done = subprocess.run(
        [sys.executable, "-c", f"import sys; sys.path.insert(0, {str(TESTS)!r})\n{CODE}"],
        capture_output=True,
        text=True,
        check=False,
        cwd=TESTS.parent,
    )
    assert done.stdout.strip() == "True", done.stderr
