"""What is known of each class of surfaces: by exact arithmetic, and by the screen before it."""
