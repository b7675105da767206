"""A Vulkan build of `beams`, in WGSL through wgpu."""
