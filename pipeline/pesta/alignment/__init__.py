"""Strided temporal alignment of symbol strings (PESTA, sections 6 and 7), as pure functions on arrays.

A string is an int32 array of symbols of one posture dictionary; `distances` [m, m] float32 are the distances of the
dictionary's codes. Nothing here knows of clips, frames or the lake.
"""
