"""Numbers without rounding, as sums of binary64 (`expansions`), and bounds of errors that are derived with them."""
