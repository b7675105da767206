"""What mirrors cost and what is got for it: CPU time, draws, skips, growth, error against time.

All times are CPU seconds of one thread around the kernels' calls (`thread_time`), the least of several rounds in which
everything that is compared takes its turn; they are to be read as ratios within one run.
"""
