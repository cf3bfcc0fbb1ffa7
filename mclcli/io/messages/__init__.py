"""From the bytes of one message to a record."""
