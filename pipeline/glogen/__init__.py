"""GloGen and LocGen: new motion of known classes."""
