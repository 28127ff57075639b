"""Reads the device code out of objects that nvcc wrote: PTX and machine code, with its kernels' own numbers.

The container ("fatbin") is a header and images one after the other; machine code is an ELF file whose .nv.info
sections hold attributes of kernels. Neither is documented by NVIDIA. Both are checked here as far as they are used, so
that a layout of another toolkit is an error and not a wrong number.
"""

import collections
import ctypes
import ctypes.util
import dataclasses
import functools
import struct

FATBIN_MAGIC = 0xBA55ED50
PTX, ELF = 1, 2
COMPRESSED = 0xE000  # bits of an image's flags: some method of compression
ZSTD = 0x8000  # nvcc 13's, a frame of Zstandard (RFC 8878)
LARGEST_IMAGE = 1 << 30  # bytes
EM_CUDA = 190
KERNEL = 0x10  # a symbol's st_other
STT_FUNC = 2
# Attributes of .nv.info: number, and how its value is stored (4: a length and that many bytes).
SIZED = 4
MIN_STACK_SIZE, REGCOUNT, NUM_BARRIERS = 0x12, 0x2F, 0x4C
INSTRUCTION_BYTES = 16  # since sm_70
# The low twelve bits of an instruction, as nvdisasm of CUDA 13.5 names them in this project's kernels.
OPERATIONS = {
    "local_loads": {0x983},            # LDL
    "local_stores": {0x387, 0x987},    # STL, of a register and of a uniform one
    "generic_loads": {0x980},          # LD: the memory of the address is known when it runs
    "generic_stores": {0x385, 0x985},  # ST
    "matches": {0x3A1},                # MATCH: a barrier of some lanes of a warp whose mask is known when it runs
}


class FatbinError(Exception):
    """Raised for a broken object, with a sentence."""


@dataclasses.dataclass
class Image:
    arch: str  # "90"
    payload: bytes


@dataclasses.dataclass
class Kernel:
    name: str  # mangled
    registers: int
    stack: int  # bytes of each thread
    barriers: int
    local_loads: int  # of a thread's own stack: spilled registers and arrays that got no register
    local_stores: int
    generic_loads: int
    generic_stores: int
    matches: int
    instructions: int
    bytes: int


@functools.cache
def libzstd():
    """The system's library, or None."""
    name = ctypes.util.find_library("zstd")
    if name is None:
        return None
    library = ctypes.CDLL(name)
    library.ZSTD_decompress.restype = ctypes.c_size_t
    library.ZSTD_decompress.argtypes = [ctypes.c_void_p, ctypes.c_size_t, ctypes.c_char_p, ctypes.c_size_t]
    return library


def decompress(frame, size, label):
    """The `size` bytes in a frame of Zstandard (RFC 8878)."""
    library = libzstd()
    if library is None:
        raise FatbinError(f"{label}: its device code is compressed and there is no libzstd; install it or compile with --no-compress")
    payload = ctypes.create_string_buffer(size)
    if library.ZSTD_decompress(payload, size, frame, len(frame)) != size:
        raise FatbinError(f"{label}: its compressed device code is damaged")
    return payload.raw


def payload_of(image, flags, label):
    """The code of one image, whose compressed size and whole size stand in its header."""
    header, _, compressed = struct.unpack_from("<IQI", image, 4)
    if not flags & COMPRESSED:
        return image[header:]
    if flags & COMPRESSED != ZSTD or header < 64 or header + compressed > len(image):
        raise FatbinError(f"{label}: its device code is compressed by another method than nvcc 13's; compile with --no-compress")
    (size,) = struct.unpack_from("<Q", image, 56)
    if size > LARGEST_IMAGE:
        raise FatbinError(f"{label}: the container of the device code has another layout than is known here")
    return decompress(image[header:header + compressed], size, label)


def images(data, label, wanted):
    """Every image of that kind in an object file."""
    found = []
    begin = data.find(struct.pack("<I", FATBIN_MAGIC))
    while begin >= 0:
        version, header, size = struct.unpack_from("<HHQ", data, begin + 4)
        at, end = begin + header, begin + header + size
        # The same four bytes may stand in code that embeds the container.
        if version != 1 or header != 16 or end > len(data):
            begin = data.find(struct.pack("<I", FATBIN_MAGIC), begin + 4)
            continue
        while at < end:
            kind, _, header, size = struct.unpack_from("<HHIQ", data, at)
            (arch,) = struct.unpack_from("<I", data, at + 28)
            (flags,) = struct.unpack_from("<Q", data, at + 40)
            if header < 48 or at + header + size > end:
                raise FatbinError(f"{label}: the container of the device code has another layout than is known here")
            if kind == wanted:
                found.append(Image(str(arch), payload_of(data[at:at + header + size], flags, label)))
            at += header + size
        begin = data.find(struct.pack("<I", FATBIN_MAGIC), end)
    return found


def ptx_text(image):
    return image.payload.rstrip(b"\0").decode()


def attributes(section):
    """(attribute, its bytes) of one .nv.info section."""
    at = 0
    while at + 4 <= len(section):
        form, attribute, value = struct.unpack_from("<BBH", section, at)
        at += 4
        if form == SIZED:
            yield attribute, section[at:at + value]
            at += value
        else:
            yield attribute, struct.pack("<H", value)


def kernels(cubin, label):
    """Every kernel of one piece of machine code."""
    if cubin[:4] != b"\x7fELF" or struct.unpack_from("<H", cubin, 18)[0] != EM_CUDA:
        raise FatbinError(f"{label}: an image is not CUDA machine code")
    (offset,) = struct.unpack_from("<Q", cubin, 40)
    size, count, names = struct.unpack_from("<HHH", cubin, 58)
    headers = [struct.unpack_from("<IIQQQQIIQQ", cubin, offset + i * size) for i in range(count)]

    def text(table, position):
        begin = headers[table][4] + position
        return cubin[begin:cubin.index(b"\0", begin)].decode()

    def content(header):
        return cubin[header[4]:header[4] + header[5]]

    sections = [text(names, header[0]) for header in headers]
    symbols = sections.index(".symtab")
    resources = {REGCOUNT: {}, MIN_STACK_SIZE: {}}
    for attribute, value in attributes(content(headers[sections.index(".nv.info")])):
        if attribute in resources:
            symbol, number = struct.unpack("<II", value)
            resources[attribute][symbol] = number
    found = []
    table = content(headers[symbols])
    for index, symbol in enumerate(struct.iter_unpack("<IBBHQQ", table)):
        if symbol[1] & 15 != STT_FUNC or not symbol[2] & KERNEL:
            continue
        name = text(headers[symbols][6], symbol[0])
        code = content(headers[symbol[3]])
        own = content(headers[sections.index(".nv.info." + name)])
        barriers = [value[0] for attribute, value in attributes(own) if attribute == NUM_BARRIERS]
        if any(index not in numbers for numbers in resources.values()) or len(code) % INSTRUCTION_BYTES != 0:
            raise FatbinError(f"{label}: {name}: its registers and stack are not where they are known to be")
        operations = collections.Counter(word & 0xFFF for word in memoryview(code).cast("Q")[::2].tolist())
        counts = {kind: sum(operations[code] for code in codes) for kind, codes in OPERATIONS.items()}
        found.append(Kernel(name, resources[REGCOUNT][index], resources[MIN_STACK_SIZE][index], max(barriers, default=0),
                            instructions=operations.total(), bytes=len(code), **counts))
    return found
