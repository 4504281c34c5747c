"""LocGen: natural dense motion from interpolated sparse poses (chapter 4, second stage)."""
