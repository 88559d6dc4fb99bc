"""Vectors and matrices in JSON: lists of numbers, and lists of rows."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

Vector3 = Annotated[list[float], Field(min_length=3, max_length=3)]
Vector4 = Annotated[list[float], Field(min_length=4, max_length=4)]
Vector6 = Annotated[list[float], Field(min_length=6, max_length=6)]
Matrix4x4 = Annotated[list[Vector4], Field(min_length=4, max_length=4)]
Matrix6x6 = Annotated[list[Vector6], Field(min_length=6, max_length=6)]
IndexPair = Annotated[list[int], Field(min_length=2, max_length=2)]
