"""The particle filter: pure functions over particles and weights; no files, no printing."""
