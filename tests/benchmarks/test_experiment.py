"""What a benchmark leaves behind, and when it runs again."""

import json

import numpy as np
import pytest

pytest.importorskip("matplotlib")
from benchmarks import experiment
from benchmarks.experiment import Experiment, main
from mpe_core.geometry.rigid import apply, rotation_error
from tests.factories.clouds import knot


@pytest.fixture
def results(tmp_path, monkeypatch):
    monkeypatch.setattr(experiment, "RESULTS", tmp_path)
    monkeypatch.setattr("sys.argv", ["benchmarks"])
    return tmp_path


@pytest.fixture
def counted():
    """An experiment and the list that grows by one each time it runs."""
    runs = []

    def run():
        runs.append(1)
        return {"runs": len(runs)}

    def table(result):
        return f"ran {result['runs']} times"

    return Experiment("counted", "A count", run, table, lambda result, figure: None), runs


def test_page_raw_figures_and_index(results, counted, capsys):
    main([counted[0]], "python -m benchmarks")
    assert "ran 1 times" in (results / "counted.md").read_text()
    assert json.loads((results / "counted.json").read_text())["result"] == {"runs": 1}
    assert "[A count](counted.md)" in (results / "README.md").read_text()
    assert (results / "counted.png").stat().st_size > 0
    assert "ran 1 times" in capsys.readouterr().out


def test_a_finished_one_is_skipped_until_the_code_changes_or_it_is_named(
    results, counted, monkeypatch
):
    counted, runs = counted
    main([counted], "python -m benchmarks")
    main([counted], "python -m benchmarks")
    assert len(runs) == 1
    monkeypatch.setattr("sys.argv", ["benchmarks", "counted"])
    main([counted], "python -m benchmarks")
    assert len(runs) == 2
    monkeypatch.setattr("sys.argv", ["benchmarks"])
    monkeypatch.setattr(experiment, "code", lambda: "other")
    main([counted], "python -m benchmarks")
    assert len(runs) == 3


def test_an_unknown_name_is_refused_before_anything_runs(results, counted, monkeypatch):
    counted, runs = counted
    monkeypatch.setattr("sys.argv", ["benchmarks", "counted", "other"])
    with pytest.raises(SystemExit, match="other; there are: counted"):
        main([counted], "python -m benchmarks")
    assert not runs


def test_starts_anywhere_are_undone_by_their_truth():
    trials = pytest.importorskip("benchmarks.paper.trials")
    cloud = knot(500, np.random.default_rng(0))
    turned = []
    for seed in range(40):
        trial = trials.anywhere(cloud, seed)
        np.testing.assert_allclose(apply(trial.T_target_source, trial.source), cloud, atol=1e-9)
        turned.append(rotation_error(trial.T_target_source, np.eye(4)))
    assert 110 < np.mean(turned) < 140  # evenly over SO(3): 126 degrees
