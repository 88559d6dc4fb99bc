"""Refinement: from a coarse pose to the minimum next to it, and how exactly that is known.

`PointToPlane` and `FullSum` have one interface, `Refiner`. `regime.choose_regime` tells which of
them suits a pair of clouds, and which of the clouds gives the planes.
"""
