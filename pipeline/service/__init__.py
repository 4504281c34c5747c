"""A lake as a service: the browser application, and what it asks, over HTTP (docs/browse.md)."""
