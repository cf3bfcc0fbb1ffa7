"""One new thing of each kind that mcl has a registry of: a file here, and one line where `test_registries` adds it."""
