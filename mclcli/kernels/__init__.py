"""The compiled inner loops: arrays in, arrays out, no random numbers, no objects, nothing of ours imported.

A kernel module compiles when it is imported: import it through ``mclcli.compiled.load`` and inside functions only.
"""
