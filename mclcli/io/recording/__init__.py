"""What a log holds and which topic plays which part; then its messages as records."""
