"""The stages of the lake: what is missing (plan), how a shard is made (run), how it enters the catalog (load)."""
