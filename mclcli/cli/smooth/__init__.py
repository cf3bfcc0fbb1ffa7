"""The command ``mcl smooth``."""
