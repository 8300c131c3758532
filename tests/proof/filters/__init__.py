"""Fast filters: certain first crossings, so that exact arithmetic is asked about few rays only."""
