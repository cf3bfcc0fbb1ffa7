"""Smoothing: the best poses of a whole drive, each told by what came before it and by what came after."""
