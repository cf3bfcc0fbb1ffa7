"""Coverage-guided fuzzing of every parser: ``python -m tests.fuzz``.

A target gives bytes to one parser; only the errors that the parser documents may come out. Inputs that reach a block of
code which none has reached before are kept and changed further. Same seed, same executions, same finds.
"""
