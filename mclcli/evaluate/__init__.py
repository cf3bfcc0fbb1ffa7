"""How good a track is, against a reference."""
