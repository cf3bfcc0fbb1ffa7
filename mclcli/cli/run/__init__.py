"""``mcl run``: Monte Carlo Localization over a log."""
