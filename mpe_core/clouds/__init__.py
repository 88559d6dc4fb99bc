"""Input clouds: validated, normalized to a common unit, thinned, with normals."""
