"""What a LAS file says beside its points: encoding, records and coordinate system."""

from __future__ import annotations

from dataclasses import dataclass, field

_CRS_USER = "LASF_Projection"
_WKT_RECORD = 2112
_OWN_RECORDS = {"laszip encoded", "copc"}
"""Users of records that describe the encoding of the points, which a writer makes anew."""


@dataclass(frozen=True, slots=True)
class LasRecord:
    """A variable length record."""

    user_id: str
    """Who defines the record."""
    record_id: int
    """Kind of the record."""
    description: str
    """Text for people."""
    data: bytes
    """Content."""

    @property
    def is_crs(self) -> bool:
        """Whether the record describes the coordinate system."""
        return self.user_id == _CRS_USER

    @property
    def is_wkt(self) -> bool:
        """Whether the record holds the coordinate system as well-known text."""
        return self.is_crs and self.record_id == _WKT_RECORD

    @property
    def is_kept(self) -> bool:
        """Whether the record still holds for the same points in another encoding."""
        user, kind = self.user_id, self.record_id
        describes_points = user == "LASF_Spec" and (kind == 4 or 99 < kind < 355 or kind > 65000)
        return not (self.is_crs or user in _OWN_RECORDS or describes_points)


@dataclass(frozen=True, slots=True)
class LasMetadata:
    """How a LAS file stores its points."""

    version: str
    """Version of LAS: "1.2"."""
    point_format: int
    """Number of the layout of a point, 0 to 10."""
    scale: float | None
    """Step of the coordinates, the finest of the three; None if unknown."""
    has_standard_time: bool
    """Whether GPS times are adjusted standard time, not seconds of a week."""
    records: tuple[LasRecord, ...] = ()
    """Records that hold for the points wherever they lie."""
    descriptions: dict[str, str] = field(default_factory=dict)
    """Descriptions of the dimensions in extra bytes."""
