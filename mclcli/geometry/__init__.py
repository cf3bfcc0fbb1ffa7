"""Poses, rotations, paths through time, trees of frames and the pinhole camera."""
