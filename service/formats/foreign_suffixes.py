"""Formats without a public description, by the names of their files, for error messages."""

from __future__ import annotations

_BY_SUFFIX = {
    (".fls", ".fws", ".lsproj"): ("FARO", "export E57 in FARO Scene"),
    (".rcp", ".rcs"): ("Autodesk ReCap", "export E57 in ReCap"),
    (".rxp", ".rdb", ".rdbx"): ("RIEGL", "export LAS or E57 in RiSCAN"),
    (".zfs", ".zfprj"): ("Zoller+Froehlich", "export E57 in LaserControl"),
    (".lgs", ".lgsx", ".imp"): ("Leica Cyclone", "export E57 or PTX in Cyclone"),
    (".dwg", ".dxf"): ("AutoCAD", "export its points as LAS or its surfaces as STL"),
    (".usdz", ".usd"): ("USD", "export it as glTF, OBJ or PLY"),
    (".step", ".stp", ".iges", ".igs"): ("CAD", "export its surface as STL"),
    (".bag", ".db3", ".mcap"): ("ROS", "export its scans as PCD"),
    (".pcap", ".pcapng"): ("a packet capture", "export it as PLY, PCD, LAS or E57"),
    (".lvx", ".ksplat"): ("an older Livox or splat file", "export it as PLY, PCD, LAS or E57"),
    (".cl3", ".clr", ".tzf"): ("Topcon or Trimble", "export it as E57"),
}
"""Formats without a public description, by the ends of their names: the maker, and what to do."""


def foreign_by_name(name: str) -> str | None:
    """Describe a file of a well-known format that is not read, by its name; else None."""
    for suffixes, (maker, advice) in _BY_SUFFIX.items():
        if name.lower().endswith(suffixes):
            return f"{name[-40:]!r} looks like a file of {maker}, which is not read: {advice}"
    return None
