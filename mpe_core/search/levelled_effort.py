"""How thoroughly a levelled search looks, see `levelled_search`."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class LevelledEffort:
    """Effort of a levelled search (docs/tuning.md)."""

    turn_step_deg: float
    """Step of the turns about the vertical in coarse cells."""
    fine_turns_deg: tuple[float, ...]
    """Turns in fine cells, from a coarse one that is left."""
    turns_kept: int
    """Coarse turns of each weight that are left."""
    windows_kept: int
    """Windows around their peaks that are left of each weight by a first look at few cells."""
    coarse_counted: int
    """Occupied coarse cells of either cloud that are counted; of more, every second or third is."""
    few_counted: int
    """Occupied fine cells that choose the windows."""
    max_counted: int
    """Occupied fine cells that tell the scores."""
    candidates: int
    """Poses that are taken."""


QUICK_LEVELLED = LevelledEffort(
    turn_step_deg=6.0,
    fine_turns_deg=(-1.5, 1.5),
    turns_kept=14,
    windows_kept=160,
    coarse_counted=600,
    few_counted=400,
    max_counted=3000,
    candidates=20,
)
THOROUGH_LEVELLED = LevelledEffort(
    turn_step_deg=3.0,
    fine_turns_deg=(0.0,),
    turns_kept=24,
    windows_kept=800,
    coarse_counted=6000,
    few_counted=1500,
    max_counted=6000,
    candidates=48,
)
