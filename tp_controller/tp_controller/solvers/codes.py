"""Numbers by which the compiled recursion and its callers tell each other things."""

PLAIN, SIMPLE, BENT = 0, 1, 2
"""Whether levels are settled: not at all, without second derivatives as long as it is certain
that they would change nothing, and with them."""
BRIEF, WHOLE, ALONE = 0, 1, 2
"""What is wanted without bounds: nothing where an answer breaks one; the answer of all levels
nevertheless; that answer alone."""
NOTHING, LOSES, UNKNOWN, LEAVES = 0, 1, 2, 3
"""What settling finds: every direction is served; the answer is changed where it is lost; second
derivatives are needed; the answer stays, but levels below may not make it worse."""
FAILED, DONE, OUTSIDE = 0, 1, 4
"""What the recursion returns, beside `UNKNOWN`: something is not finite; the answer is there;
without bounds, the answer of a level and those above breaks one."""
ERRORS, FEEDFORWARD, BENDS = range(3)
"""Rows of what is known of levels, see `Curvature.rows`."""
