"""What a release needs beside the program."""
