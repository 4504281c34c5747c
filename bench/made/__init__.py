"""Motion made by motion matching and by networks beside real motion."""
