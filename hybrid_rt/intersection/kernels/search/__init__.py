"""What the searches on all surfaces share: rays, trees of boxes, the nearest root."""
