"""What parses the numbers of large text files, compiled; readers import it when they read."""
