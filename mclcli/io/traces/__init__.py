"""What is written: traces, tracks and recovered logs; files that appear whole or not at all."""
