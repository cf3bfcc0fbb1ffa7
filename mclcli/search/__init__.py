"""Global localization: the best poses of a scan anywhere on the map, found exactly by branch and bound."""
