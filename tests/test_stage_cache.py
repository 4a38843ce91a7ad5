import numpy as np
import pytest
from comparing import assert_same
from shapes import cantilever

import michell_cad.pipeline as pipeline
from michell_cad.pipeline import DesignOptions, design
from michell_cad.stage_cache import FOLDER_VARIABLE, StageCache, content_hash

STAGES = ("solve_elasticity", "fit_frame_field", "parametrize", "trace_isocurves", "clean_network")


@pytest.fixture
def calls(monkeypatch) -> list[str]:
    """Names of the stages that were really run."""
    made: list[str] = []

    def count(name: str) -> None:
        original = getattr(pipeline, name)

        def counted(*arguments, **options):
            made.append(name)
            return original(*arguments, **options)

        monkeypatch.setattr(pipeline, name, counted)

    for name in STAGES:
        count(name)
    return made


def test_a_second_run_computes_nothing_and_gives_the_same(tmp_path, calls):
    cache, problem = StageCache(tmp_path), cantilever((6, 3, 3))
    first = design(problem, DesignOptions(5), cache=cache)
    assert calls == list(STAGES)
    calls.clear()
    second = design(problem, DesignOptions(5), cache=cache)
    assert calls == []
    for name in ("stress_field", "frame_field", "parametrization", "network", "truss", "cleaning"):
        assert_same(getattr(second, name), getattr(first, name))


def test_other_options_reuse_what_they_do_not_touch(tmp_path, calls):
    cache, problem = StageCache(tmp_path), cantilever((6, 3, 3))
    design(problem, DesignOptions(5), cache=cache)
    calls.clear()
    finer = design(problem, DesignOptions(6), cache=cache)
    assert calls == ["trace_isocurves", "clean_network"]
    assert_same(finer.truss, design(problem, DesignOptions(6)).truss)
    calls.clear()
    design(cantilever((6, 3, 3), load=-200.0), DesignOptions(5), cache=cache)
    assert calls[0] == "solve_elasticity"


def test_an_interrupted_run_goes_on_where_it_was(tmp_path, calls, monkeypatch):
    cache, problem = StageCache(tmp_path), cantilever((6, 3, 3))

    def interrupt(stage: str, fraction: float) -> None:
        if stage == "parametrization":
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        design(problem, DesignOptions(5), interrupt, cache)
    assert calls == ["solve_elasticity", "fit_frame_field"]
    calls.clear()
    design(problem, DesignOptions(5), cache=cache)
    assert calls == ["parametrize", "trace_isocurves", "clean_network"]


def test_a_damaged_result_is_computed_again(tmp_path, calls):
    cache, problem = StageCache(tmp_path), cantilever((6, 3, 3))
    design(problem, DesignOptions(5), cache=cache)
    for file in tmp_path.iterdir():
        file.write_bytes(file.read_bytes()[:100])
    calls.clear()
    design(problem, DesignOptions(5), cache=cache)
    assert calls == list(STAGES)


def test_the_oldest_results_go_when_there_are_too_many(tmp_path, monkeypatch):
    monkeypatch.setattr("michell_cad.stage_cache.LARGEST", 50_000)
    cache = StageCache(tmp_path)
    for n in range(5, 9):
        design(cantilever((6, 3, 3)), DesignOptions(n), cache=cache)
    assert sum(file.stat().st_size for file in tmp_path.iterdir()) <= 50_000


def test_the_hash_knows_arrays_options_and_order():
    a = np.arange(6.0)
    values = [
        (a,),
        (a.reshape(2, 3),),
        (a.astype(np.float32),),
        (a + 1e-16 + 1,),
        (a, None),
        (None, a),
        ((a,),),
        ("a",),
    ]
    hashes = [content_hash(value) for value in values]
    assert len(set(hashes)) == len(values)
    assert content_hash((np.arange(6.0), DesignOptions(5))) == content_hash((a, DesignOptions(5)))
    assert content_hash(DesignOptions(5)) != content_hash(DesignOptions(5.5))


def test_where_the_usual_cache_is(monkeypatch, tmp_path):
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path))
    assert StageCache.usual().folder == tmp_path
    monkeypatch.setenv(FOLDER_VARIABLE, "")
    assert StageCache.usual().folder is None
    monkeypatch.delenv(FOLDER_VARIABLE)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert StageCache.usual().folder == tmp_path / "michell_cad"
