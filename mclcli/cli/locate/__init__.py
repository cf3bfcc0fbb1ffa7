"""``mcl locate``: where a scan was taken, anywhere on the map."""
