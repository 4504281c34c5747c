"""The evaluation of PESTA (paper, section 8) on real recordings: `python -m bench.pesta PART ...`."""
