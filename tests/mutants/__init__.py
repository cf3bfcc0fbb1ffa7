"""Mutants: small faults put into the code one at a time, to see whether a test notices.

A mutator of our own: the usual tools start an interpreter for every mutant, know nothing of which tests are near, and
draw no sample by seed.
"""
