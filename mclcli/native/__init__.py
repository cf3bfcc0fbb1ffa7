"""NumPy or compiled code: the choice, the machine code and where it is kept, the gates that arrays pass."""
