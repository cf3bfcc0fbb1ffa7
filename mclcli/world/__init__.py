"""What is known of the building: occupancy, distances, landmarks."""
