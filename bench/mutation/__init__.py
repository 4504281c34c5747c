"""How many faults planted in the modules that results hang on does some test find (mutation testing)?"""
