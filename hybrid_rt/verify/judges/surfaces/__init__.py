"""What the judges know of each class of surfaces: every module here registers the classes it judges."""
