"""Search over all poses for the minima of the P2 energy.

For the source points x_i with weights K_i and normals n_i, and y_i*, n_i* the point of the target
nearest to R x_i + t and its normal, the search minimises over R in SO(3) and t in R^3

    E(R, t) = - sum_i K_i (n_i* . R n_i)^2 eps^2 / (|y_i* - (R x_i + t)|^2 + eps^2)

This is the P2 criterion (Eq. 10 of the paper) times the agreement of the normals: of either sign,
or 0 for opposing normals where both surfaces know their outside. A point far from the target adds
next to nothing, so that outliers and parts that one of the clouds lacks do not matter.

The energy has many minima. `pose_search.find_poses` finds starts by voting for translations, for
rotations spread evenly over SO(3), and descends from the best of them while eps falls and the
number of points grows. `levelled_search` tries, for scenes that show their ground, turns about
the vertical and all shifts at once, as thoroughly as a `levelled_effort` says, and `box_turns`
turns a pose as a box fits on itself. `candidate_search` has the three for a pair,
`nearest_lattice` tabulates y*, and `pose_prior` restricts the search to what the caller knows.
"""
