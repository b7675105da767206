"""Independent scalar references: the stages again, pixel by pixel with branches and early outs, without lanes.

Written from the docstrings and the sheet of the method, with own samplers, blends, roundings and elementary functions.
What they share with the program is the order of the arithmetic, which decides the bits, and the uniforms.
"""
