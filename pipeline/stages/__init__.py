"""Stages: what of a lake is due, how a shard of it is made, how it enters the catalog."""
