"""Progress by stage, and leaving when the callback says so."""

from dataclasses import replace

import pytest

from mpe_core import RegistrationOptions, register
from mpe_core.progress import STAGE_SHARES, Progress
from tests.factories.clouds import real_pair


class CancelledError(Exception):
    """What a caller raises who no longer wants the result."""


@pytest.fixture(scope="module")
def trial(data):
    pair = real_pair(data, "dragon_24_0", largest_deg=60)
    return replace(pair, source=pair.source[::3], target=pair.target[::3])


def reports(trial, options, leave_at=None):
    """(stage, fraction) of each report, up to the number at which the caller leaves."""
    seen = []

    def note(stage, fraction):
        seen.append((stage, fraction))
        if len(seen) == leave_at:
            raise CancelledError

    if leave_at is None:
        register(trial.source, trial.target, options, on_progress=note)
    else:
        with pytest.raises(CancelledError):
            register(trial.source, trial.target, options, on_progress=note)
    return seen


@pytest.mark.parametrize(
    ("options", "least"),
    [
        (RegistrationOptions(), 3),  # after the votes, then after each wave
        (RegistrationOptions(method="mpe", max_iterations=12), 12),  # each iteration
        (RegistrationOptions(method="mpe", max_iterations=4, field="exact"), 4),
        (RegistrationOptions(search="sparse", sample_size=200), 10),
    ],
    ids=["mpl", "mpe", "mpe exact", "sparse"],
)
def test_a_caller_may_leave_at_a_report(trial, options, least):
    whole = reports(trial, options)
    # a pose that is not accepted is asked for at other scales, too
    assert [stage for stage, _ in whole].count("prepare") >= 4
    within_search = [k for k, (stage, _) in enumerate(whole) if stage == "search"][1:]
    assert len(within_search) >= least
    for k in (0, 1, within_search[len(within_search) // 2], len(whole) - 1):
        left = reports(trial, options, leave_at=k + 1)
        assert left == whole[: k + 1]  # nothing was done after the call that raised


def test_a_stage_entered_again_takes_no_progress_back():
    seen = []
    progress = Progress(lambda stage, fraction: seen.append((stage, round(fraction, 3))))
    for _ in range(2):
        for name in ("search", "refine"):
            with progress.stage(name) as report:
                report(0.5)
    timing = progress.finish()
    fractions = [fraction for _, fraction in seen]
    assert fractions == sorted(fractions)
    assert fractions[-1] == 1
    assert timing["total"] >= timing["search"] + timing["refine"]
    assert sum(STAGE_SHARES.values()) == pytest.approx(1)
