"""Files of more points than the limit are thinned while they are read in pieces."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from service.formats import (
    DecodedCloud,
    FileLimitError,
    MissingAttributeError,
    ReadLimits,
    decoded_cloud,
    read_pieces,
    read_points,
    text_block,
    write_cloud,
)
from service.formats.thinning import thin_pieces
from tests.factories.array_files import hdf5, matlab_73
from tests.factories.cloud_files import lzf_literals, npy
from tests.factories.scanner_files import vtp

COUNT, LIMIT = 3000, 400
LIMITS = ReadLimits(max_points=LIMIT)


def scene(count: int = COUNT) -> DecodedCloud:
    rng = np.random.default_rng(3)
    points = rng.normal(0, [30, 20, 2], (count, 3)).round(3)
    intensity = rng.integers(0, 200, count).astype(np.float32)
    return DecodedCloud(points, "ply", attributes={"intensity": intensity})


def cut(cloud: DecodedCloud, places: list[int]) -> Iterator[DecodedCloud]:
    for start, end in pairwise([0, *places, len(cloud.points)]):
        kept = {name: column[start:end] for name, column in cloud.attributes.items()}
        yield DecodedCloud(cloud.points[start:end], "ply", attributes=kept)


def test_the_pieces_do_not_matter() -> None:
    cloud = scene()
    cloud.points[7] = np.nan
    thinned = [
        thin_pieces(cut(cloud, places), LIMIT, "intensity")
        for places in ([], [1, 2, 3, 499, 500, 501, 502], [1500], list(range(0, COUNT, 41)))
    ]
    first = thinned[0]
    assert first.rows is not None
    assert LIMIT / 8 < len(first.points) <= LIMIT
    assert 7 not in first.rows
    for each in thinned:
        np.testing.assert_array_equal(each.points, cloud.points[first.rows])
        np.testing.assert_array_equal(
            each.attributes["intensity"], cloud.attributes["intensity"][first.rows]
        )
        np.testing.assert_array_equal(each.rows, first.rows)


def test_each_cube_keeps_its_first_point() -> None:
    cloud = scene()
    thinned = thin_pieces(cut(cloud, [1000]), LIMIT)
    assert thinned.rows is not None
    (warning,) = thinned.warnings
    edge = next(2.0**k for k in range(-9, 9) if f"edge {2.0**k:.3g}:" in warning)
    cells = np.floor(cloud.points / edge)
    _, first = np.unique(cells, axis=0, return_index=True)
    np.testing.assert_array_equal(np.sort(first), thinned.rows)


@pytest.mark.parametrize("far", [1e30, 1e300])
def test_far_points_and_copies_are_bounded(far: float) -> None:
    points = np.tile(scene(50).points, (40, 1))
    points[::7] *= far
    thinned = thin_pieces(cut(DecodedCloud(points, "ply"), [900]), 60)
    assert 0 < len(thinned.points) <= 60


def test_missing_weights_are_named() -> None:
    with pytest.raises(MissingAttributeError, match="intensity"):
        thin_pieces(cut(scene(), [100]), LIMIT, "density")


def ascii_pcd(path: Path, cloud: DecodedCloud) -> None:
    header = f"FIELDS x y z\nSIZE 8 8 8\nTYPE F F F\nWIDTH {COUNT}\nHEIGHT 1\nDATA ascii\n"
    rows = "".join(f"{x} {y} {z}\n" for x, y, z in cloud.points.tolist())
    path.write_text(header + rows)


def ascii_ply(path: Path, cloud: DecodedCloud) -> None:
    header = f"ply\nformat ascii 1.0\nelement vertex {COUNT}\n"
    header += "".join(f"property double {axis}\n" for axis in "xyz") + "end_header\n"
    rows = "".join(f"{x} {y} {z}\n" for x, y, z in cloud.points.tolist())
    path.write_text(header + rows)


def raw_rows(path: Path, cloud: DecodedCloud) -> None:
    columns = [*cloud.points.T, cloud.attributes["intensity"]]
    path.write_bytes(np.stack(columns, axis=1).astype("<f4").tobytes())


def packed_pcd(path: Path, cloud: DecodedCloud) -> None:
    header = f"FIELDS x y z intensity\nSIZE 8 8 8 4\nTYPE F F F F\nWIDTH {COUNT}\nHEIGHT 1\n"
    columns = b"".join(column.tobytes() for column in cloud.points.T)
    columns += cloud.attributes["intensity"].tobytes()
    packed = lzf_literals(columns)
    sizes = struct.pack("<II", len(packed), len(columns))
    path.write_bytes(header.encode() + b"DATA binary_compressed\n" + sizes + packed)


def ptx(path: Path, cloud: DecodedCloud) -> None:
    """Two scans, the second with colours."""
    matrix = "0 1 0 0\n-1 0 0 0\n0 0 1 0\n5 6 7 1\n"
    content = ""
    for start, end in ((0, 1000), (1000, COUNT)):
        content += f"{end - start}\n1\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n{matrix}"
        rows = zip(cloud.points[start:end], cloud.attributes["intensity"][start:end], strict=True)
        ends = " 1 2 3" if start else ""
        content += "".join(f"{x} {y} {z} {i}{ends}\n" for (x, y, z), i in rows)
    path.write_text(content)


def vtk(path: Path, cloud: DecodedCloud, form: str = "BINARY") -> None:
    head = f"# vtk DataFile Version 3.0\n\n{form}\nDATASET POLYDATA\nPOINTS {COUNT} double\n"
    rows = "".join(f"{x} {y} {z}\n" for x, y, z in cloud.points.tolist()).encode()
    body = cloud.points.astype(">f8").tobytes() if form == "BINARY" else rows
    column = cloud.attributes["intensity"]
    text = "\n".join(map(str, column.tolist())).encode()
    body += f"\nPOINT_DATA {COUNT}\nSCALARS intensity double\nLOOKUP_TABLE default\n".encode()
    body += column.astype(">f8").tobytes() if form == "BINARY" else text
    path.write_bytes(head.encode() + body)


def ascii_vtk(path: Path, cloud: DecodedCloud) -> None:
    vtk(path, cloud, "ASCII")


def obj(path: Path, cloud: DecodedCloud) -> None:
    path.write_text("".join(f"v {x} {y} {z}\n" for x, y, z in cloud.points.tolist()))


def off(path: Path, cloud: DecodedCloud) -> None:
    rows = "".join(f"{x} {y} {z}\n" for x, y, z in cloud.points.tolist())
    path.write_text(f"OFF\n{COUNT} 1 0\n{rows}3 0 1 2\n")


def npy_table(path: Path, cloud: DecodedCloud, order: str = "C") -> None:
    table = np.column_stack([cloud.points, cloud.attributes["intensity"]])
    path.write_bytes(npy(np.asarray(table, order=order)))  # type: ignore[call-overload]


def npy_columns(path: Path, cloud: DecodedCloud) -> None:
    npy_table(path, cloud, "F")


def npy_transposed(path: Path, cloud: DecodedCloud) -> None:
    path.write_bytes(npy(np.ascontiguousarray(cloud.points.T)))


def npy_image(path: Path, cloud: DecodedCloud) -> None:
    path.write_bytes(npy(cloud.points.reshape(50, COUNT // 50, 3)))


def h5(path: Path, cloud: DecodedCloud) -> None:
    arrays = {"points": cloud.points, "intensity": cloud.attributes["intensity"][:, None]}
    path.write_bytes(hdf5(arrays | {"about": np.zeros(5)}, chunks=True))


def h5_turned(path: Path, cloud: DecodedCloud) -> None:
    path.write_bytes(matlab_73({"points": cloud.points, **cloud.attributes}))


MAKERS = dict.fromkeys(("ply", "pcd", "las", "laz", "e57", "xyz", "csv"))
OTHERS = {
    "ascii pcd": ascii_pcd,
    "ascii ply": ascii_ply,
    "kitti": raw_rows,
    "packed pcd": packed_pcd,
    "ptx": ptx,
    "vtk": vtk,
    "ascii vtk": ascii_vtk,
    "obj": obj,
    "off": off,
    "npy table": npy_table,
    "npy columns": npy_columns,
    "npy transposed": npy_transposed,
    "npy image": npy_image,
    "hdf5": h5,
    "matlab 7.3": h5_turned,
}
UNNAMED = {"npy table", "npy columns"}
"""Formats whose columns have no names by which weights are chosen."""


@pytest.mark.parametrize("name", [*MAKERS, *OTHERS])
def test_a_large_file_is_thinned(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.setattr(decoded_cloud, "PIECE_BYTES", 5000)
    monkeypatch.setattr(text_block, "_BLOCK_BYTES", 5000)
    path = tmp_path / "cloud"
    if name in MAKERS:
        write_cloud(path, name, scene())
    else:
        OTHERS[name](path, scene())
    format = "kitti" if name == "kitti" else None
    whole = read_points(path, format=format, attributes=True)
    thinned = read_points(path, LIMITS, format=format)
    assert thinned.rows is not None
    assert len(thinned.points) <= LIMIT
    assert thinned.format == whole.format
    np.testing.assert_array_equal(thinned.points, whole.points[thinned.rows])
    assert thinned.points.dtype == whole.points.dtype
    pieces = [p for p in read_pieces(path, LIMITS, format=format, attributes=True) if len(p.points)]
    np.testing.assert_array_equal(np.concatenate([p.points for p in pieces]), whole.points)
    for key, column in whole.attributes.items():
        np.testing.assert_array_equal(np.concatenate([p.attributes[key] for p in pieces]), column)
    if whole.attributes and name not in UNNAMED:
        weighted = read_points(path, LIMITS, format=format, weights="intensity")
        np.testing.assert_array_equal(weighted.weights, whole.attributes["intensity"][thinned.rows])


@pytest.mark.parametrize("form", ["text", "npy"])
def test_columns_keep_the_names_of_the_first_piece(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, form: str
) -> None:
    """Black points, or a normal that is none, at the end do not give other columns."""
    monkeypatch.setattr(decoded_cloud, "PIECE_BYTES", 5000)
    monkeypatch.setattr(text_block, "_BLOCK_BYTES", 5000)
    colors = np.random.default_rng(1).integers(0, 256, (COUNT, 3))
    colors[COUNT // 2 :] = 0
    colors[-1] = 300
    table = np.column_stack([scene().points, colors])
    np.savetxt(tmp_path / "text", table, fmt="%.3f")
    (tmp_path / "npy").write_bytes(npy(table))
    pieces = [p for p in read_pieces(tmp_path / form, LIMITS, attributes=True) if len(p.points)]
    assert len(pieces) > 5
    assert {tuple(piece.attributes) for piece in pieces} == {("red", "green", "blue")}
    found = np.concatenate([piece.attributes["green"] for piece in pieces])
    np.testing.assert_array_equal(found, colors[:, 1])


def test_what_is_read_whole_says_what_may_be_larger(tmp_path: Path) -> None:
    np.savez(tmp_path / "cloud.npz", points=scene().points, others=np.zeros(9))
    with pytest.raises(FileLimitError, match="ply, pcd, las, e57"):
        read_points(tmp_path / "cloud.npz", LIMITS)
    (tmp_path / "cloud").write_bytes(vtp() + b" " * LIMITS.max_whole_bytes)
    with pytest.raises(FileLimitError, match="save it as binary PLY"):
        read_points(tmp_path / "cloud", LIMITS)


@pytest.mark.parametrize("form", ["stl", "ascii stl"])
def test_corners_of_a_large_stl_are_thinned(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, form: str
) -> None:
    monkeypatch.setattr(decoded_cloud, "PIECE_BYTES", 5000)
    monkeypatch.setattr(text_block, "_BLOCK_BYTES", 5000)
    triangles = scene().points[: COUNT // 3 * 3].reshape(-1, 3, 3).astype(np.float32)
    facets = "".join(
        "facet normal 0 0 1\nouter loop\n"
        + "".join(f"  vertex {x} {y} {z}\n" for x, y, z in corners.tolist())
        + "endloop\nendfacet\n"
        for corners in triangles
    )
    rows = np.zeros(len(triangles), np.dtype([("n", "<f4", 3), ("c", "<f4", (3, 3)), ("a", "<u2")]))
    rows["c"] = triangles
    head = bytes(80) + np.uint32(len(rows)).tobytes()
    text = f"solid a\n{facets}endsolid a\n".encode()
    (tmp_path / "cloud").write_bytes(head + rows.tobytes() if form == "stl" else text)
    cloud = read_points(tmp_path / "cloud", LIMITS, faces=True)
    assert cloud.rows is not None
    np.testing.assert_array_equal(cloud.points, triangles.reshape(-1, 3)[cloud.rows])
    assert any("the faces are not kept, because the file is large" in w for w in cloud.warnings)


def test_faces_that_the_memory_does_not_hold_are_left_out(tmp_path: Path) -> None:
    rows = "".join(f"v {i} {i * i % 7} {i % 3}\n" for i in range(50))
    rows += "".join(f"f 1 {i % 48 + 2} {i % 48 + 3}\n" for i in range(100))
    (tmp_path / "cloud").write_text(rows)
    cloud = read_points(tmp_path / "cloud", ReadLimits(max_points=120), faces=True)
    assert cloud.faces is None
    assert "the limit for both together is 120" in cloud.warnings[0]


def test_errors_of_later_pieces_name_their_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(text_block, "_BLOCK_BYTES", 1000)
    lines = [f"{i} {i * i % 7} 1.5" for i in range(2000)]
    lines[1500] = "1 2 what"
    (tmp_path / "cloud").write_text("\n".join(lines) + "\n")
    with pytest.raises(ValueError, match="line 1501: 'what'"):
        read_points(tmp_path / "cloud", LIMITS)
