"""Small text files: YAML, CSV and TUM, read with every complaint's line."""
