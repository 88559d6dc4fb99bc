"""The verdict on a result in words, with its reasons."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

SURE = 0.9
"""Confidence from which on nobody needs to look."""
_ABOUT_FILES = frozenset(
    {"file", "rows_not_finite", "rows_zeros", "rows_far", "rows_copies", "rows_shell"}
)
"""Codes of warnings that tell of the files alone."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """Whether to trust a result."""

    level: Literal["trust", "check", "refuse"]
    title: str
    reasons: tuple[str, ...]


def judge(result: Mapping[str, Any]) -> Verdict:
    """Judge a result as the API renders it; the page of the service judges by the same rules."""
    confidence, warnings = float(result["confidence"]), result["warnings"]
    is_open = bool(result["ambiguous"] or result["free_directions"])
    is_serious = any(item["code"] not in _ABOUT_FILES for item in warnings)
    reasons = [
        f"Confidence {100 * confidence:.0f} %: how likely this is the right pose; accepted from "
        "50 % on.",
        f"{100 * result['overlap']:.0f} % of the source has a counterpart in the target.",
    ]
    if is_open:
        reasons.append("The surfaces leave the pose open: other poses fit as well.")
    if not result["converged"]:
        reasons.append("The refinement stopped before it settled; allow more iterations.")
    reasons += [str(item["message"]) for item in warnings]
    if not result["accepted"]:
        return Verdict("refuse", "Do not use it", tuple(reasons))
    if confidence < SURE or is_open or is_serious:
        return Verdict("check", "Check it", tuple(reasons))
    return Verdict("trust", "Trust it", tuple(reasons))
