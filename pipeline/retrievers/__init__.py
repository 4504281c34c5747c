"""The ways to retrieve whole clips, behind one interface."""
