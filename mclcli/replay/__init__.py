"""A recorded log through the filter: events in, track points out; what a notebook calls."""
