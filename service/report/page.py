"""Report of a registration: one HTML page, pictures included, for the screen and for paper."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

import numpy as np

from service.report.pose_forms import describe_pose
from service.report.verdict import Verdict, judge

STYLE = """
:root{color-scheme:light}
body{font:14px/1.45 system-ui,sans-serif;color:#1c2430}
body{margin:2rem auto;max-width:1000px;padding:0 1rem}
h1{font-size:1.5rem;margin:0}
h2{font-size:1.1rem;margin:1.6rem 0 .5rem;border-bottom:1px solid #cfd6df}
table{border-collapse:collapse;width:100%}
th,td{text-align:left;vertical-align:top;padding:.2rem .8rem .2rem 0}
th{font-weight:600;width:14rem}td{overflow-wrap:anywhere}
pre{font:12px/1.4 ui-monospace,monospace;background:#f4f6f8;padding:.5rem;margin:.2rem 0}
pre{white-space:pre-wrap}
.verdict{border-left:6px solid;padding:.6rem 1rem;margin:1rem 0;background:#f4f6f8}
.trust{border-color:#1a7f37}.check{border-color:#b7791f}.refuse{border-color:#b42318}
.verdict b{font-size:1.15rem}.pictures{display:grid;grid-template-columns:1fr 1fr;gap:8px}
img{max-width:100%;border:1px solid #e3e7ec}.legend{display:flex;align-items:center;gap:.6rem}
.ramp{flex:1;height:12px;background:linear-gradient(90deg,#283cbe,#28aad7,#46b44b,#f5c832,#cd2328)}
footer{margin-top:2rem;color:#5b6675;font-size:12px}
@media print{body{margin:0;max-width:none;font-size:10.5pt}h2{break-after:avoid}
table,pre,img,.verdict,figure{break-inside:avoid}*{-webkit-print-color-adjust:exact;print-color-adjust:exact}}
@page{margin:15mm}
"""
"""The only style; `CONTENT_POLICY` names its hash, so that a browser takes no other."""
_STYLE_HASH = base64.b64encode(hashlib.sha256(STYLE.encode()).digest()).decode()
CONTENT_POLICY = (
    f"default-src 'none'; style-src 'sha256-{_STYLE_HASH}'; img-src data:; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'none'"
)


@dataclass(frozen=True, slots=True)
class ReportContent:
    """What a report tells; texts may be a stranger's."""

    job: dict[str, Any]
    """The registration as the API renders it, without its result."""
    result: dict[str, Any]
    """Its result, as the API renders it."""
    deviation: dict[str, Any]
    """Statistics of the distances, as the API renders them."""
    sizes: tuple[int, int]
    """Number of points of the source and of the target."""
    unit: str | None
    """Name of the unit of the files, as the caller gives it."""
    reach: float
    """Distance at the ends of the colours."""
    release: str
    before_after: bytes
    """PNG."""
    sides: Sequence[bytes]
    """PNGs, coloured by distance."""


def render_report(content: ReportContent) -> str:
    """Return the page; every text is escaped."""
    parts = [
        _head(content),
        _verdict(judge(content.result)),
        _section("Clouds", _clouds(content)),
        _section(
            "Before and after", _picture(content.before_after, "both clouds, before and after")
        ),
        _section("Quality", _quality(content)),
        _section("Distances of the source from the target", _distances(content)),
        _section("Pose of the source in the frame of the target", _pose(content)),
        _section("Uncertainty of the pose", _uncertainty(content)),
        _section("Options", _table(_options(content.job["options"]))),
        _section("Times", _table((n, f"{s:.3f} s") for n, s in _timing(content.job))),
        f"<footer>mpe {escape(content.release)} · registration {escape(content.job['id'])} · "
        f"finished {escape(str(content.job['finished_at']))}</footer>",
    ]
    title = f"Registration {content.job['id']}"
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{escape(title)}</title>'
        '<meta name="viewport" content="width=device-width">'
        f"<style>{STYLE}</style></head><body>{''.join(parts)}</body></html>\n"
    )


def _head(content: ReportContent) -> str:
    labels = ", ".join(f"{name}: {value}" for name, value in content.job["labels"].items())
    return f"<h1>Registration report</h1><p>{escape(labels)}</p>"


def _verdict(verdict: Verdict) -> str:
    reasons = "".join(f"<li>{escape(reason)}</li>" for reason in verdict.reasons)
    title = escape(verdict.title)
    return f'<div class="verdict {verdict.level}"><b>{title}</b><ul>{reasons}</ul></div>'


def _clouds(content: ReportContent) -> str:
    rows = []
    for role, count in zip(("source", "target"), content.sizes, strict=True):
        cloud = content.job[role]
        label = content.job["labels"].get(role)
        name = cloud["cloud"] or cloud["url"] or label or "uploaded file"
        rows.append((role, f"{name}\n{count:,} points, {cloud['size']:,} bytes"))
        rows.append((f"SHA-256 of the {role}", cloud["sha256"]))
    unit = content.unit or "units of the file, which does not name them"
    return _table([*rows, ("unit of lengths", unit)])


def _quality(content: ReportContent) -> str:
    result, length = content.result, _length(content)
    inliers = result["inliers"]
    return _table(
        [
            ("confidence", f"{result['confidence']:.2f} (accepted from 0.5)"),
            ("overlap", f"{100 * result['overlap']:.1f} % of the source points have a counterpart"),
            ("rmse of the inliers", length(result["rmse"])),
            (
                "inliers",
                f"{inliers['count']:,} pairs closer than {length(inliers['threshold'])}",
            ),
            ("scale", f"{result['scale']:.9g}"),
            ("converged", "yes" if result["converged"] else "no"),
        ]
    )


def _distances(content: ReportContent) -> str:
    deviation, length = content.deviation, _length(content)
    kind = (
        "positive outside of the target, negative inside"
        if deviation["signed"]
        else "without a sign: the target's file has no normals, and no viewpoint was given"
    )
    rows = [
        ("kind", f"from a plane through the nearest target points; {kind}"),
        ("points", f"{deviation['count']:,}; {deviation['beyond']:,} farther away do not count"),
        *((name, length(deviation[name])) for name in ("mean", "std", "rms", "minimum", "maximum")),
        *(
            (f"{item['percent']:g} % lie below", length(item["value"]))
            for item in deviation["percentiles"]
        ),
        *(
            (f"within {length(item['tolerance'])}", _percent(item["share"]))
            for item in deviation["shares"]
        ),
    ]
    low = -content.reach if deviation["signed"] else 0.0
    legend = (
        f'<div class="legend"><span>{escape(length(low))}</span><span class="ramp"></span>'
        f"<span>{escape(length(content.reach))}</span></div>"
    )
    sides = "".join(
        _picture(png, f"distances, side {k}") for k, png in enumerate(content.sides, start=1)
    )
    return f'{_table(rows)}{_histogram(content)}{legend}<div class="pictures">{sides}</div>'


def _histogram(content: ReportContent) -> str:
    """Return the histogram as a picture of vectors."""
    edges = content.deviation["histogram_edges"]
    counts = content.deviation["histogram_counts"]
    most, width, height = max([*counts, 1]), 900, 160
    step = width / max(len(counts), 1)
    bars = "".join(
        f'<rect x="{k * step:.1f}" y="{height - height * count / most:.1f}" '
        f'width="{step * 0.9:.1f}" height="{height * count / most:.1f}" fill="#3a6ea5"/>'
        for k, count in enumerate(counts)
    )
    length = _length(content)
    texts = "".join(
        f'<text x="{share * width:.0f}" y="{height + 16}" font-size="12" text-anchor="{anchor}">'
        f"{escape(length(edges[0] + share * (edges[-1] - edges[0])))}</text>"
        for share, anchor in ((0.0, "start"), (0.5, "middle"), (1.0, "end"))
    )
    return (
        f'<figure><svg viewBox="0 0 {width} {height + 20}" role="img" '
        f'aria-label="histogram of the distances">{bars}{texts}</svg></figure>'
    )


def _pose(content: ReportContent) -> str:
    forms = describe_pose(content.result["transform"], content.result["scale"])
    return "".join(f"<p><b>{escape(name)}</b></p><pre>{escape(text)}</pre>" for name, text in forms)


def _uncertainty(content: ReportContent) -> str:
    deviations = np.sqrt(np.diagonal(np.array(content.result["covariance"])).clip(0))
    length = _length(content)
    rows = [
        *(
            (f"rotation about {axis}", f"± {np.degrees(s):.4g}°")
            for axis, s in zip("xyz", deviations, strict=False)
        ),
        *(
            (f"translation along {axis}", f"± {length(s)}")
            for axis, s in zip("xyz", deviations[3:], strict=True)
        ),
        ("free directions", str(len(content.result["free_directions"]))),
    ]
    text = (
        "Standard deviations of a small motion about the centroid of the moved source, along the "
        "axes of the target. They cover noise and misfit, not a wrong pose."
    )
    return f"{_table(rows)}<p>{text}</p>"


def _timing(job: dict[str, Any]) -> list[tuple[str, float]]:
    return [(name, value) for name, value in job["timing"].items() if value is not None]


def _length(content: ReportContent) -> Any:
    unit = f" {content.unit}" if content.unit else ""
    return lambda value: "–" if value is None else f"{value:.4g}{unit}"


def _percent(share: float | None) -> str:
    return "–" if share is None else f"{100 * share:.2f} %"


def _section(title: str, body: str) -> str:
    return f"<section><h2>{escape(title)}</h2>{body}</section>"


def _picture(png: bytes, text: str) -> str:
    data = base64.b64encode(png).decode()
    return f'<img alt="{escape(text)}" src="data:image/png;base64,{data}">'


def _options(options: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    words = {None: "not set", True: "yes", False: "no"}
    for name, value in sorted(options.items()):
        yield name, words[value] if value is None or isinstance(value, bool) else value


def _table(rows: Iterable[tuple[str, Any]]) -> str:
    return f"<table>{''.join(_row(name, str(value)) for name, value in rows)}</table>"


def _row(name: str, value: str) -> str:
    lines = "<br>".join(escape(line) for line in value.split("\n"))
    return f"<tr><th>{escape(name)}</th><td>{lines}</td></tr>"
