"""What text that no reader takes may be, by its first characters, for error messages."""

from __future__ import annotations

import re

_GUESSES: tuple[tuple[re.Pattern[bytes], str], ...] = (
    (
        re.compile(rb"(?:[^\n]{0,200}\n)?(?:[\w.]{0,40}[;,\t ])?[\"']?c?[\[({]{1,2}\s*[+-]?[\d.]"),
        "rows in brackets: write one point a line, x y z, without them, or save the array as .npy",
    ),
    (
        re.compile(rb"\$[A-Z]{5},"),
        "NMEA of a satellite receiver: send points in metres, one a line, x y z",
    ),
    (
        re.compile(rb"\{|\[\s*[\[{]"),
        "JSON, which is not read: write one point a line, x y z, or save the array as .npy",
    ),
    (
        re.compile(rb"<(?:!doctype html|html)", re.IGNORECASE),
        "HTML, a page of the web: send a point cloud",
    ),
    (
        re.compile(rb"<"),
        "XML of another kind, which is not read: export it as PLY, PCD, LAS or E57",
    ),
    (
        re.compile(
            rb"(?: {0,9}\w{1,30}:[^\n]{0,200}\n){0,12} {0,9}-\s{0,20}(?:\[|x:|name:)", re.IGNORECASE
        ),
        "YAML, which is not read: write one point a line, x y z",
    ),
    (
        re.compile(
            rb"(?:[^\n]{0,200}\n){0,3}[^\n]{0,200}\bx *[=:] *[-+.\d][^\n]{1,60}\by *[=:]",
            re.IGNORECASE,
        ),
        "a name beside each number, as x=1 y=2 z=3: write one point a line, x y z",
    ),
    (
        re.compile(rb"(?:[^\n]{0,200}\n){0,3}[^\n]{0,60}\b\d{1,9}\.\d{0,17}f\b"),
        "numbers of a program, as 1.5f: write 1.5",
    ),
    (
        re.compile(rb"(?:[^\n]{0,200}\n){0,3}[^\n]{0,200}\d[dD][+-]\d"),
        "numbers of Fortran, as 1.5D+02: write E in place of D",
    ),
    (
        re.compile(rb"(?:[^\n]{0,200}\n){0,3}[^\n]{0,200}\d\.\d{3}\.\d{3}"),
        "numbers with a sign between thousands, as 1.234.567: write 1234567",
    ),
    (
        re.compile(rb"(?:[^\n]{0,200}\n){0,3}[^\n]{0,200}(?:\d'\d{3}\b|\"\d{1,3}(?:,\d{3})+\.\d)"),
        "numbers with a sign between thousands, as 1'234'567 or 1,234,567.8: write 1234567.8",
    ),
    (
        re.compile(rb"(?:[^\n]{0,200}\n)?[^\n]{0,200}\b(?:MULTI)?POINT ?Z? ?\(", re.IGNORECASE),
        "geometry as WKT: export the coordinates as columns x, y and z",
    ),
    (
        re.compile(
            rb"(?:[^\n]{0,200}\n)?[-+\d.eE]{1,30} ?([:/^~&!_]) ?[-+\d.eE]{1,30} ?\1 ?[-+\d.eE]"
        ),
        "numbers between signs of another kind: use blanks, commas, semicolons, tabs or bars",
    ),
    (
        re.compile(rb"[^\n]{0,200}\d\.\d{1,9}[+-]\d{1,9}\."),
        "numbers that touch, as -1.5-2.5: separate them by blanks or commas",
    ),
    (
        re.compile(rb"\s*[-+\d.eE]{1,30}[ \t,;]{1,9}[-+\d.eE]{1,30}[ \t]*\r?\n"),
        "rows of two numbers: expected three, x, y and z",
    ),
)
"""Beginnings of text that no reader takes, in the order in which they are tried."""


def guess_foreign(head: bytes) -> str | None:
    """Describe what no reader takes, by its first characters; else None."""
    start = head.lstrip()
    for pattern, text in _GUESSES:
        if pattern.match(start):
            return text
    return None
