"""``mcl eval``: tracks against a reference."""
