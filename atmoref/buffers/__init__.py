"""Formats, devices, blends, samplers and the layout of buffers.

`formats` says what one channel can hold, `device` what the hardware decides about it, `blend` and `sampler` are the
same rules as lane functions for kernels, `layout` is the memory. Modules are imported by name; nothing is re-exported.
"""
