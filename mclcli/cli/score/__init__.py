"""``mcl score``: poses against one scan."""
