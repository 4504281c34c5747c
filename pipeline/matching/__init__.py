"""Motion matching: new motion from recorded frames, played on and joined where they are alike."""
