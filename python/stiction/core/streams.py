"""Streams of any framework as the handle that CUDA knows."""


def handle_of(stream, framework, device):
    """The handle of a stream: an int, or an object of PyTorch, CuPy, Warp or with `__cuda_stream__`.

    None is the stream that the batch's framework works in at the moment; 0 for memory of the host.
    """
    if stream is None:
        return 0 if device == "cpu" else framework.current_stream(device)
    if isinstance(stream, int) and not isinstance(stream, bool):
        if stream < 0:
            raise ValueError(f"stream: expected a stream's handle, got {stream}")
        return stream
    if hasattr(stream, "__cuda_stream__"):
        protocol = stream.__cuda_stream__
        version, handle = protocol() if callable(protocol) else protocol
        if version != 0:
            raise ValueError(f"stream: expected version 0 of __cuda_stream__, got {version}")
        return int(handle)
    for attribute in ("cuda_stream", "ptr"):  # PyTorch and Warp; CuPy
        if hasattr(stream, attribute):
            return int(getattr(stream, attribute) or 0)
    raise TypeError("stream: expected None, an int, a stream of PyTorch, CuPy or Warp, or an object with "
                    f"__cuda_stream__, got {type(stream).__name__}")
