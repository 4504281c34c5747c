"""Pictures of a lake: functions from arrays to matplotlib figures, and the report that shows them all."""
