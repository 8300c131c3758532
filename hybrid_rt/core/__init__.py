"""What every room uses: checked arguments, hit records, threads, progress, counts and seconds."""
