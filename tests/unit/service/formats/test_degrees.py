"""Longitude and latitude are refused with what to do; poles and wires are not."""

from __future__ import annotations

import io

import laspy
import numpy as np
import pytest
from laspy.vlrs import VLR

from service.formats import LasRecord, UnsupportedFileError, warn_unlike
from service.formats.degrees import refuse_degrees
from tests.factories.cloud_files import text_rows
from tests.factories.decoding import decode

RNG = np.random.default_rng(0)
GEOGRAPHIC = b'GEOGCS["WGS 84",DATUM["WGS_1984"],UNIT["degree",0.0174],AUTHORITY["EPSG","4326"]]\0'
COMPOUND = b'COMPD_CS["NAD83 + NAVD88",GEOGCS["NAD83"],VERT_CS["NAVD88"],AUTHORITY["EPSG","5498"]]'
UTM = b'PROJCS["WGS 84 / UTM 32N",GEOGCS["WGS 84"],AUTHORITY["EPSG","32632"]]\0'
SWISS = b'COMPD_CS["CH1903+ / LV95 + LN02",PROJCS["CH1903+ / LV95",GEOGCS["CH1903+"]]]'


def place(longitude=8.5417, latitude=47.3769, size=0.002, height=12.0):
    ground = RNG.uniform(-size, size, (400, 2)) + np.array([longitude, latitude])
    return np.column_stack([ground, 430 + RNG.uniform(0, height, 400)])


def las(points, crs=None, record=2112, step=1e-7):
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.scales, header.offsets = np.array([step, step, 0.001]), np.floor(points.min(axis=0))
    if crs is not None:
        header.vlrs.append(VLR("LASF_Projection", record, "", crs))
    data = laspy.LasData(header)
    data.x, data.y, data.z = points.T
    file = io.BytesIO()
    data.write(file)
    return file.getvalue()


def geo_keys(*entries):
    rows = [(1, 1, 0, len(entries)), *((key, 0, 1, value) for key, value in entries)]
    return np.array(rows, "<u2").tobytes()


@pytest.mark.parametrize(
    "content",
    [
        las(place()),
        las(place(), GEOGRAPHIC),
        las(place(), COMPOUND),
        las(place(), geo_keys((1024, 2), (2048, 4326)), record=34735),
        text_rows(place(-122.4194, 37.7749)),
        text_rows(place()[:, [1, 0, 2]], ","),
    ],
)
def test_degrees_are_refused_with_what_to_do(tmp_path, content):
    with pytest.raises(UnsupportedFileError) as caught:
        decode(tmp_path, content)
    reason = str(caught.value)
    assert "longitude and latitude" in reason
    assert "project them to metres" in reason


@pytest.mark.parametrize(
    "points",
    [
        RNG.uniform(-1, 1, (100, 3)) * [0.01, 0.01, 20],  # a wire at the origin
        np.round(RNG.uniform(-1, 1, (100, 3)) * [0.02, 0.02, 8] + [8, 5, 0], 3),  # a pole in mm
        RNG.uniform(0, 100, (100, 3)),
        place() + np.array([500_000, 4_000_000, 0]),
    ],
)
def test_lengths_are_not_taken_for_degrees(points):
    refuse_degrees(points)


def test_las_in_metres_is_read_with_its_coordinate_system(tmp_path):
    points = RNG.uniform(0, 100, (50, 3))
    cloud = decode(tmp_path, las(points, UTM, step=0.001))
    assert [item.data for item in cloud.crs] == [UTM]


def record(data, kind=2112):
    return (LasRecord("LASF_Projection", kind, "", data),)


def test_unlike_coordinate_systems_are_named():
    (text,) = warn_unlike(record(UTM), record(SWISS))
    assert "UTM 32N" in text
    assert "LV95 + LN02" in text
    (text,) = warn_unlike(record(geo_keys((3072, 32633)), 34735), record(UTM))
    assert "EPSG:32633" in text
    same = record(geo_keys((1024, 1), (3072, 32632)), 34735)
    for other in (record(UTM), same, (), record(SWISS)):
        assert other == record(SWISS) or warn_unlike(same, other) == ()
    assert warn_unlike(same, record(SWISS)) == ()  # its code is not known
