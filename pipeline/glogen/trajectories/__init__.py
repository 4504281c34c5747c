"""What generators read and give: motion over time, resampled by moved distance (chapter 4, section 4.3.2)."""
