"""Implementations that are not gsvc_ref, judged by the kit: start from the one nearest to yours.

    c              C11 in integers: a decoder of profile `main`, for the kit a server; nearest to C++, Rust, a chip
    opencl         OpenCL C on tiles, and a thin host in Python: rendering and training; nearest to CUDA, HIP, Metal
    cuda           CUDA C++ on a warp for each tile: rendering and training, on NVIDIA GPUs and as fibers on a CPU
    webgpu         WGSL through wgpu: a decoder, and gradients; nearest to Vulkan, Direct3D 12, GLSL
    web            JavaScript with WebGPU or WebGL2: a decoder with a parser of its own, and a page that shows streams
    pytorch        tensors, of which autograd finds every gradient: rendering and training; nearest to Triton, JAX
    gsplat_cuda    the CUDA rasteriser of the paper's authors: what a fork of gsplat or GaussianImage has to map

None of them imports gsvc_ref: they are written from spec.md. `host` parses streams for those that have no parser, with
the code inside spec.md. Each docstring says what an adapter needs, does and leaves out.
"""
