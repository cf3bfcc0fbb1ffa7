"""Small sabotages of mcl, each with the test that must notice it: ``python -m tests.sabotage``.

A test that nothing can make fail promises nothing. Each patch breaks one promise of docs/reliability.md, in a scratch
copy of the repository.
"""
