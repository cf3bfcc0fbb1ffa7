"""Thousands of damaged, crafted and hostile inputs, each with a known right answer: ``python -m tests.battery``.

A class of cases is a module here with a function ``cases(seed, quick)``. Every case runs in a worker process of its own
making, so that a crash, a hang or a gigabyte counts against the case and ends nothing else.
"""
