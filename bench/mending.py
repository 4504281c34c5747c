def mending(*a): return {}
