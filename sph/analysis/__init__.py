"""What a run says of itself: errors, summary, pictures."""
